//! The drape (paper §3): cloth on a static body, brought to rest, and its derivatives.
