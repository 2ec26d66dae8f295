//! What the refit minimises (paper §4.4).
