//! How one panel's outline reflects onto another's, and how well their places in space then mirror.
//!
//! Outlines are sampled at equal arc length; the mirrored one is laid over the other at the shifts of
//! greatest correlation `|Σ_k conj(a_k) b_{k+s}|`, refined between samples, and the best reflection for a
//! shift has `u = c/|c|` (complex Procrustes).

use super::Reflection;
use crate::geometry::polygon::sides;
use crate::geometry::{Mat2, Vec2, Vec3, complex, point, signed_area};
use crate::pattern::{Pattern, PatternMesh};
use nalgebra::Matrix3x2;
use num_complex::Complex64;

/// Samples of an outline; 128 find every shift, the rest is refined continuously.
const SAMPLES: usize = 128;
/// Outlines further apart than this part of their perimeter (rms) are different shapes. In 56
/// GarmentCode designs mirrored outlines are within 3e-7; different ones in mirrored places start at
/// 5e-3. The room between is for digitised patterns.
pub(super) const SHAPE_TOLERANCE: f64 = 3e-3;

/// An outline, and the affine map that places its plane in space.
pub(super) struct Shape {
    /// Counter-clockwise.
    outline: Vec<Complex64>,
    /// Arc length up to each point, and all around \[m\].
    arcs: Vec<f64>,
    /// Whether the panel's own loop runs counter-clockwise.
    right_side_up: bool,
    place: Place,
}

/// `z ↦ linear · z + origin`.
struct Place {
    linear: Matrix3x2<f64>,
    origin: Vec3,
}

/// How one shape reflects onto another.
pub(super) struct Fit {
    pub(super) reflection: Reflection,
    /// Rms distance of the outlines, as part of the perimeter \[–\].
    pub(super) residual: f64,
    /// Plane x = … across which the places mirror best \[m\].
    pub(super) plane: f64,
    /// Rms distance of the places mirrored across it \[m\].
    spread: f64,
}

impl Fit {
    /// Rms distance of the places mirrored across x = `plane` \[m\].
    pub(super) fn misplacement(&self, plane: f64) -> f64 {
        self.spread.hypot(2.0 * (plane - self.plane))
    }
}

impl Shape {
    /// Panel `p`, as it lies in the `drape` (\[m\], `[cloth vertex]`) or else waits to be draped.
    pub(super) fn new(
        pattern: &Pattern,
        mesh: &PatternMesh,
        drape: Option<&[Vec3]>,
        p: usize,
    ) -> Self {
        let panel = &pattern.panels[p];
        let length: f64 = (0..panel.edges.len()).map(|e| panel.edge_length(e)).sum();
        let mut outline = panel.outline((length / 512.0).max(f64::MIN_POSITIVE));
        let right_side_up = signed_area(&outline) > 0.0;
        if !right_side_up {
            outline.reverse();
        }
        let mut arcs = vec![0.0];
        arcs.extend(sides(&outline).scan(0.0, |arc, (p, q)| {
            *arc += (q - p).norm();
            Some(*arc)
        }));
        Self {
            outline: outline.into_iter().map(complex).collect(),
            arcs,
            right_side_up,
            place: Place::new(pattern, mesh, drape, p),
        }
    }

    fn perimeter(&self) -> f64 {
        self.arcs[self.outline.len()]
    }

    /// The outline as placed in space \[m\].
    pub(super) fn placed(&self) -> impl Iterator<Item = Vec3> + '_ {
        self.outline.iter().map(|z| self.place.apply(*z))
    }

    /// The point at a part of the way around, counted in samples.
    fn at(&self, sample: f64) -> Complex64 {
        let n = self.outline.len();
        let arc = (sample / SAMPLES as f64).rem_euclid(1.0) * self.perimeter();
        let i = self.arcs.partition_point(|s| *s <= arc).clamp(1, n) - 1;
        let length = (self.arcs[i + 1] - self.arcs[i]).max(f64::MIN_POSITIVE);
        let t = ((arc - self.arcs[i]) / length).min(1.0);
        self.outline[i] * (1.0 - t) + self.outline[(i + 1) % n] * t
    }

    /// Every reflection that lays this outline over the other's: one per local maximum of
    /// `|c_s| = |Σ_k conj(a_k) b_{k+s}|`, `a` being the mirrored, `b` the other outline.
    pub(super) fn reflections_onto<'a>(
        &'a self,
        other: &'a Self,
    ) -> impl Iterator<Item = Fit> + 'a {
        let comparable = self.right_side_up == other.right_side_up
            && (self.perimeter() / other.perimeter() - 1.0).abs() < 0.03;
        // Clockwise, so that the mirror image runs counter-clockwise.
        let from: Vec<_> = (0..SAMPLES).map(|k| self.at(-(k as f64))).collect();
        let onto: Vec<_> = (0..SAMPLES).map(|k| other.at(k as f64)).collect();
        let mean = from.iter().sum::<Complex64>() / SAMPLES as f64;
        let correlation: Vec<f64> = (0..if comparable { SAMPLES } else { 0 })
            .map(|s| {
                let product = |k: usize| (from[k] - mean) * onto[(k + s) % SAMPLES];
                (0..SAMPLES).map(product).sum::<Complex64>().norm()
            })
            .collect();
        let peaks = (0..correlation.len()).filter(move |&s| {
            let near = |step: usize| correlation[(s + step) % SAMPLES];
            near(0) >= near(1) && near(0) > near(SAMPLES - 1)
        });
        peaks.filter_map(move |s| {
            let samples = |shift: f64| (0..SAMPLES).map(move |k| other.at(k as f64 + shift));
            let rms = |shift: f64| reflect(&from, &samples(shift).collect::<Vec<_>>()).1;
            let shift = lowest(s as f64 - 1.0, s as f64 + 1.0, rms);
            let onto: Vec<_> = samples(shift).collect();
            let (reflection, rms) = reflect(&from, &onto);
            let residual = rms / other.perimeter();
            (residual < SHAPE_TOLERANCE).then(|| {
                let (plane, spread) = self.plane_between(other, &from, &onto);
                Fit {
                    reflection,
                    residual,
                    plane,
                    spread,
                }
            })
        })
    }

    /// The plane across which the placed points mirror best, and how well they do (rms).
    fn plane_between(&self, other: &Self, from: &[Complex64], onto: &[Complex64]) -> (f64, f64) {
        let placed: Vec<_> = from
            .iter()
            .zip(onto)
            .map(|(a, b)| (self.place.apply(*a), other.place.apply(*b)))
            .collect();
        let plane = placed.iter().map(|(a, b)| 0.5 * (a.x + b.x)).sum::<f64>() / SAMPLES as f64;
        let apart =
            |(a, b): &(Vec3, Vec3)| (Vec3::new(2.0 * plane - a.x, a.y, a.z) - b).norm_squared();
        (
            plane,
            (placed.iter().map(apart).sum::<f64>() / SAMPLES as f64).sqrt(),
        )
    }
}

impl Place {
    /// The affine map nearest to the drape, or the panel's placement.
    fn new(pattern: &Pattern, mesh: &PatternMesh, drape: Option<&[Vec3]>, p: usize) -> Self {
        let vertices = mesh.panel_vertices[p].clone();
        let count = vertices.len() as f64;
        let draped = drape.and_then(|x| {
            let pairs = || {
                vertices
                    .clone()
                    .map(|v| (mesh.x_bar[v], x[mesh.sewing[v] as usize]))
            };
            let flat = pairs().map(|(z, _)| z).sum::<Vec2>() / count;
            let middle = pairs().map(|(_, x)| x).sum::<Vec3>() / count;
            let moment: Mat2 = pairs()
                .map(|(z, _)| (z - flat) * (z - flat).transpose())
                .sum();
            let mixed: Matrix3x2<f64> = pairs()
                .map(|(z, x)| (x - middle) * (z - flat).transpose())
                .sum();
            let linear = mixed * moment.try_inverse()?;
            Some(Self {
                linear,
                origin: middle - linear * flat,
            })
        });
        draped.unwrap_or_else(|| {
            let placement = &pattern.panels[p].placement;
            Self {
                linear: placement.rotation.fixed_columns::<2>(0).into(),
                origin: placement.translation,
            }
        })
    }

    fn apply(&self, z: Complex64) -> Vec3 {
        self.linear * point(z) + self.origin
    }
}

/// The reflection that takes points nearest to their partners, and the rms distance left.
fn reflect(from: &[Complex64], onto: &[Complex64]) -> (Reflection, f64) {
    let n = from.len() as f64;
    let (p, q) = (
        from.iter().sum::<Complex64>() / n,
        onto.iter().sum::<Complex64>() / n,
    );
    let pairs = || from.iter().zip(onto);
    let c: Complex64 = pairs().map(|(a, b)| (a - p) * (b - q)).sum();
    let u = if c.norm() > 0.0 {
        c / c.norm()
    } else {
        Complex64::ONE
    };
    let left: f64 = pairs()
        .map(|(a, b)| (u * (a - p).conj() - (b - q)).norm_sqr())
        .sum();
    let reflection = Reflection {
        u,
        b: q - u * p.conj(),
    };
    (reflection, (left / n).sqrt())
}

/// Golden-section search for the minimum of `f` between two abscissae.
fn lowest(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    // 0.618⁴⁰ = 4e-9 of two samples, some nanometres.
    for _ in 0..40 {
        let width = GOLDEN * (high - low);
        if f(high - width) < f(low + width) {
            high = low + width;
        } else {
            low = high - width;
        }
    }
    0.5 * (low + high)
}
