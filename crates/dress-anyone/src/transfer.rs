//! The target shape x*: the source drape carried to the target body (paper §4.2; de Goes, Fong,
//! O'Malley 2020). Geometry only: not physical, no pattern.
