//! Finite-difference checks shared by every differentiable piece. Test-only.

/// Step that balances truncation (h²) against round-off (ε/h) for central differences of values
/// of order one.
pub(crate) const STEP: f64 = 1e-5;

/// Asserts that `derivative` is d/ds f(s) at 0 to `tolerance`, relative to `scale`.
#[track_caller]
pub(crate) fn assert_derivative(
    f: impl Fn(f64) -> f64,
    derivative: f64,
    step: f64,
    scale: f64,
    tolerance: f64,
) {
    let expected = (f(step) - f(-step)) / (2.0 * step);
    let error = (derivative - expected).abs() / expected.abs().max(scale);
    assert!(
        error < tolerance,
        "analytic {derivative}, central difference {expected}, relative error {error:e}"
    );
}

/// A deterministic, unstructured number in (−1, 1), so that a failing test fails again.
pub(crate) fn noise(i: usize) -> f64 {
    2.0 * ((i as f64 + 1.0).sin() * 43_758.545_3).rem_euclid(1.0) - 1.0
}
