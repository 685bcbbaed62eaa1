//! The simulator: Circuit → System → Trace.
