//! Sparse linear algebra over any field: ordering, LU, replay of a fixed pattern, pivot guard.
