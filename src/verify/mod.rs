//! Proof of the translation.
