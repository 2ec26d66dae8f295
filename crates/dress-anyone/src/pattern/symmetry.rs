//! Which panels mirror each other across the wearer's middle, and how (paper §4.5).
//!
//! In the plane a mirror pair is congruent by a reflection `z ↦ u·conj(z) + b`, `|u| = 1`: the outlines,
//! sampled by arc length, are laid over each other at the shift that correlates best .
//! Many panels have the same shape, and a rectangle reflects onto itself in several ways, so the panels'
//! places in space must mirror too, across one plane x = x₀, and so must the seams between them.

use crate::geometry::plane::{complex, point, sides};
use crate::geometry::{Mat2, Vec2, Vec3, signed_area};
use crate::pattern::{Panel, Pattern, PatternMesh};
use nalgebra::Matrix3x2;
use num_complex::Complex64;
use std::collections::BTreeSet;

/// The mirror symmetry of a garment's pattern.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Symmetry {
    /// The garment mirrors across the plane x = `plane` \[m\].
    pub plane: f64,
    /// Mirror pairs and self-mirrored panels, by first panel; no panel occurs twice.
    pub mirrors: Vec<Mirror>,
}

/// Two panels that mirror each other, or one that mirrors itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror {
    /// The panels, lower index first; twice the same if it mirrors itself.
    pub panels: [usize; 2],
    /// Takes the first panel's plane onto the second's.
    pub reflection: Reflection,
}

/// The reflection `z ↦ u·conj(z) + b` of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflection {
    /// Of modulus one; twice the direction of the axis.
    pub u: Complex64,
    /// \[m\].
    pub b: Complex64,
}

/// Samples of an outline; 128 find every shift, the rest is refined continuously.
const SAMPLES: usize = 128;
/// Outlines further apart than this part of their perimeter (rms) are different shapes: mirrored
/// pairs measure below 0.05 %, the nearest different ones above 1 %.
const SHAPE_TOLERANCE: f64 = 3e-3;
/// Cost of a seam partner more or less, against 1 for each tolerance used up: decides between equals.
const SEAM_COST: f64 = 0.1;
/// Panels mirror in space if their places do to this part of the garment's diagonal: 3 cm on a dress.
const PLACE_TOLERANCE: f64 = 0.02;

impl Symmetry {
    /// Finds the mirror pairs of `pattern`. Where a panel lies in space is taken from the `drape`
    /// (\[m\], `[cloth vertex]`) if there is one, else from its placement.
    pub fn detect(pattern: &Pattern, mesh: &PatternMesh, drape: Option<&[Vec3]>) -> Self {
        let shapes: Vec<_> = (0..pattern.panels.len())
            .map(|p| Shape::new(&pattern.panels[p], place(pattern, mesh, drape, p)))
            .collect();
        let tolerance = PLACE_TOLERANCE * diagonal(&shapes);
        let mut fits = Vec::new();
        for a in 0..shapes.len() {
            for b in a..shapes.len() {
                fits.extend(
                    shapes[a]
                        .reflections_onto(&shapes[b])
                        .map(|fit| ([a, b], fit)),
                );
            }
        }
        let plane = common_plane(&fits, tolerance);
        let seams = Seams::new(pattern);
        let cost = |panels: &[usize; 2], fit: &Fit| {
            let [a, b] = panels.map(|p| seams.partner_count(p));
            fit.residual / SHAPE_TOLERANCE
                + fit.misplacement(plane) / tolerance
                + SEAM_COST * a.abs_diff(b) as f64
        };
        fits.retain(|(_, fit)| fit.misplacement(plane) < tolerance);
        fits.sort_by(|(a, f), (b, g)| cost(a, f).total_cmp(&cost(b, g)).then(a.cmp(b)));
        let mut mirrors: Vec<Mirror> = Vec::new();
        for (panels, fit) in fits {
            let mirror = Mirror::new(panels, fit.reflection);
            if mirrors
                .iter()
                .all(|other| mirror.agrees_with(other, &seams))
            {
                mirrors.push(mirror);
            }
        }
        mirrors.sort_by_key(|mirror| mirror.panels);
        Self { plane, mirrors }
    }

    /// Panels, of `panel_count`, without a mirror image.
    pub fn unmatched(&self, panel_count: usize) -> Vec<usize> {
        let matched = |p: &usize| self.mirrors.iter().any(|m| m.panels.contains(p));
        (0..panel_count).filter(|p| !matched(p)).collect()
    }
}

impl Mirror {
    /// A panel's own reflection is made to undo itself exactly: `b + u·conj(b) = 0`.
    fn new(panels: [usize; 2], mut reflection: Reflection) -> Self {
        if panels[0] == panels[1] {
            reflection.b = 0.5 * (reflection.b + reflection.inverse().b);
        }
        Self { panels, reflection }
    }

    /// Whether the panel mirrors itself.
    pub fn is_of_one_panel(&self) -> bool {
        self.panels[0] == self.panels[1]
    }

    /// For each pattern vertex of the first panel its mirror image in the second, if the two meshes
    /// mirror each other to 1e-6 of the panel.
    pub fn vertices(&self, mesh: &PatternMesh) -> Option<Vec<u32>> {
        let [first, second] = self.panels.map(|p| mesh.panel_vertices[p].clone());
        let images: Vec<_> = second.clone().map(|v| mesh.x_bar[v]).collect();
        let middle = images.iter().sum::<Vec2>() / images.len() as f64;
        let size = images
            .iter()
            .map(|p| (p - middle).norm())
            .fold(0.0, f64::max);
        let image = |v: usize| {
            let wanted = self.reflection.apply(mesh.x_bar[v]);
            let near = |i: &usize| (images[*i] - wanted).norm();
            let best = (0..images.len()).min_by(|i, j| near(i).total_cmp(&near(j)))?;
            (near(&best) < 1e-6 * size).then_some((second.start + best) as u32)
        };
        let matched: Vec<_> = first.map(image).collect::<Option<_>>()?;
        (matched.len() == images.len()).then_some(matched)
    }

    /// Whether both can hold: they share no panel and mirror each other's seams.
    fn agrees_with(&self, other: &Self, seams: &Seams) -> bool {
        let ([a, b], [c, d]) = (self.panels, other.panels);
        ![a, b].iter().any(|p| [c, d].contains(p))
            && seams.join(a, c) == seams.join(b, d)
            && seams.join(a, d) == seams.join(b, c)
    }
}

impl Reflection {
    /// The mirror image of a point \[m\].
    pub fn apply(&self, p: Vec2) -> Vec2 {
        point(self.u * complex(p).conj() + self.b)
    }

    /// The mirror image of a displacement, and of a gradient: this map is its own transpose.
    pub fn turn(&self, displacement: Complex64) -> Complex64 {
        self.u * displacement.conj()
    }

    /// Turns the plane so that the axis becomes the y axis, for a reflection that undoes itself.
    pub fn upright(&self, p: Vec2) -> Vec2 {
        point(Complex64::I * self.u.sqrt().conj() * (complex(p) - 0.5 * self.b))
    }

    /// Inverse of [`Self::upright`].
    pub fn from_upright(&self, p: Vec2) -> Vec2 {
        point(-Complex64::I * self.u.sqrt() * complex(p) + 0.5 * self.b)
    }

    /// From the image back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self {
            u: self.u,
            b: -self.u * self.b.conj(),
        }
    }
}

/// An outline, and the affine map that places its plane in space.
struct Shape {
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
struct Fit {
    reflection: Reflection,
    /// Rms distance of the outlines, as part of the perimeter \[–\].
    residual: f64,
    /// Plane x = … across which the places mirror best \[m\].
    plane: f64,
    /// Rms distance of the places mirrored across it \[m\].
    spread: f64,
}

impl Fit {
    /// Rms distance of the places mirrored across x = `plane` \[m\].
    fn misplacement(&self, plane: f64) -> f64 {
        self.spread.hypot(2.0 * (plane - self.plane))
    }
}

impl Shape {
    fn new(panel: &Panel, place: Place) -> Self {
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
            place,
        }
    }

    fn perimeter(&self) -> f64 {
        self.arcs[self.outline.len()]
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
    fn reflections_onto<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = Fit> + 'a {
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

/// Where panel `p` lies: the affine map nearest to the drape, or its placement.
fn place(pattern: &Pattern, mesh: &PatternMesh, drape: Option<&[Vec3]>, p: usize) -> Place {
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
        Some(Place {
            linear,
            origin: middle - linear * flat,
        })
    });
    draped.unwrap_or_else(|| {
        let placement = &pattern.panels[p].placement;
        Place {
            linear: placement.rotation.fixed_columns::<2>(0).into(),
            origin: placement.translation,
        }
    })
}

/// Diagonal of the box around all placed panels \[m\].
fn diagonal(shapes: &[Shape]) -> f64 {
    let placed = |shape: &'_ Shape| {
        let points: Vec<_> = shape
            .outline
            .iter()
            .map(|z| shape.place.apply(*z))
            .collect();
        points
    };
    let start = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
    let (low, high) = shapes
        .iter()
        .flat_map(placed)
        .fold(start, |(low, high), p| (low.inf(&p), high.sup(&p)));
    (high - low).norm()
}

/// The plane that most fits agree on, x = 0 if none is better.
fn common_plane(fits: &[([usize; 2], Fit)], tolerance: f64) -> f64 {
    let agreement = |plane: f64| -> f64 {
        let closeness = |fit: &Fit| (1.0 - fit.misplacement(plane) / tolerance).max(0.0);
        fits.iter().map(|(_, fit)| closeness(fit)).sum()
    };
    let mut best = (0.0, agreement(0.0));
    for (_, fit) in fits {
        let score = agreement(fit.plane);
        // The margin keeps exactly placed garments at exactly zero.
        if score > best.1 + 1e-6 {
            best = (fit.plane, score);
        }
    }
    best.0
}

/// Which panels are sewn to which.
struct Seams(BTreeSet<[usize; 2]>);

impl Seams {
    fn new(pattern: &Pattern) -> Self {
        let joins = pattern
            .stitches
            .iter()
            .map(|s| s.sides.map(|side| side.panel));
        Self(joins.flat_map(|[a, b]| [[a, b], [b, a]]).collect())
    }

    fn join(&self, a: usize, b: usize) -> bool {
        self.0.contains(&[a, b])
    }

    fn partner_count(&self, panel: usize) -> usize {
        self.0.range([panel, 0]..[panel + 1, 0]).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cage::fixture::{panel, patterns, sampled};
    use crate::pattern::{EdgeId, Stitch};
    use approx::assert_relative_eq;

    /// A lopsided sleeve, and its mirror image in the y axis, shifted.
    const SLEEVE: [(f64, f64); 5] = [
        (0.0, 0.0),
        (0.2, 0.0),
        (0.3, 0.42),
        (0.1, 0.52),
        (-0.05, 0.4),
    ];

    fn mirrored(corners: &[(f64, f64)], shift: f64) -> Vec<(f64, f64)> {
        corners.iter().rev().map(|(x, y)| (shift - x, *y)).collect()
    }

    fn detect(panels: Vec<Panel>, stitches: Vec<Stitch>) -> Symmetry {
        let pattern = Pattern { panels, stitches };
        let mesh = sampled(&pattern, 0.05);
        Symmetry::detect(&pattern, &mesh, None)
    }

    fn pairs(symmetry: &Symmetry) -> Vec<[usize; 2]> {
        symmetry.mirrors.iter().map(|m| m.panels).collect()
    }

    fn stitch(a: (usize, usize), b: (usize, usize)) -> Stitch {
        let id = |(panel, edge)| EdgeId { panel, edge };
        Stitch {
            sides: [id(a), id(b)],
            right_wrong: false,
        }
    }

    #[test]
    fn left_and_right_sleeves_pair_up_with_their_reflection() {
        let left = panel("left", &SLEEVE, Vec3::new(0.3, 1.2, 0.1));
        let right = panel("right", &mirrored(&SLEEVE, 0.7), Vec3::new(-1.0, 1.2, 0.1));
        let symmetry = detect(vec![left, right], vec![]);
        assert_eq!(pairs(&symmetry), [[0, 1]]);
        assert_eq!(symmetry.plane, 0.0);
        let reflection = symmetry.mirrors[0].reflection;
        assert_relative_eq!(reflection.u.re, -1.0, epsilon = 1e-9);
        for (x, y) in SLEEVE {
            let image = reflection.apply(Vec2::new(x, y));
            // The refined shift is good to nanometres.
            assert_relative_eq!(image, Vec2::new(0.7 - x, y), epsilon = 1e-7);
            assert_relative_eq!(
                reflection.inverse().apply(image),
                Vec2::new(x, y),
                epsilon = 1e-12
            );
        }
        assert_eq!(symmetry.unmatched(3), [2]);
    }

    #[test]
    fn equal_fronts_and_backs_mirror_themselves_and_not_each_other() {
        let skirt = [(-0.4, 0.0), (0.4, 0.0), (0.25, 0.6), (-0.25, 0.6)];
        let front = panel("front", &skirt, Vec3::new(0.0, 0.5, 0.2));
        let back = panel("back", &skirt, Vec3::new(0.0, 0.5, -0.2));
        let symmetry = detect(vec![front, back], vec![]);
        assert_eq!(pairs(&symmetry), [[0, 0], [1, 1]]);
        let axis = symmetry.mirrors[0].reflection;
        assert_relative_eq!(
            axis.apply(Vec2::new(0.1, 0.2)),
            Vec2::new(-0.1, 0.2),
            epsilon = 1e-7
        );
    }

    #[test]
    fn a_rectangle_mirrors_left_to_right_and_not_upside_down() {
        let band = [(-0.4, 0.0), (0.4, 0.0), (0.4, 0.05), (-0.4, 0.05)];
        let symmetry = detect(vec![panel("band", &band, Vec3::new(0.3, 1.0, 0.1))], vec![]);
        // Nothing else is placed, so the garment's own plane is where the band lies.
        assert_relative_eq!(symmetry.plane, 0.3, epsilon = 1e-6);
        let image = symmetry.mirrors[0].reflection.apply(Vec2::new(0.1, 0.01));
        assert_relative_eq!(image, Vec2::new(-0.1, 0.01), epsilon = 1e-7);
    }

    #[test]
    fn seams_decide_between_panels_in_the_same_place() {
        // Two layers of each side; only the seams tell which belongs to which.
        let place = |side: f64| Vec3::new(0.5 * side, 0.0, 0.1);
        let (l, r) = (SLEEVE.to_vec(), mirrored(&SLEEVE, 0.0));
        let panels = vec![
            panel("left", &l, place(1.0)),
            panel("left_lining", &l, place(1.0)),
            panel("right_lining", &r, place(-1.0)),
            panel("right", &r, place(-1.0)),
            panel(
                "front",
                &[(-0.3, 0.0), (0.3, 0.0), (0.3, 0.7), (-0.3, 0.7)],
                Vec3::zeros(),
            ),
        ];
        let stitches = vec![stitch((0, 0), (4, 0)), stitch((3, 0), (4, 2))];
        assert_eq!(pairs(&detect(panels, stitches)), [[0, 3], [1, 2], [4, 4]]);
    }

    #[test]
    fn different_shapes_and_shifted_places_do_not_pair() {
        let left = panel("left", &SLEEVE, Vec3::new(0.5, 1.2, 0.1));
        let mut longer = mirrored(&SLEEVE, 0.0);
        longer[4].1 -= 0.05;
        let right = panel("right", &longer, Vec3::new(-0.5, 1.2, 0.1));
        assert_eq!(
            pairs(&detect(vec![left.clone(), right], vec![])),
            [[0; 2]; 0]
        );
        let behind = panel(
            "behind",
            &mirrored(&SLEEVE, 0.0),
            Vec3::new(-0.5, 1.2, -0.1),
        );
        assert_eq!(pairs(&detect(vec![left, behind], vec![])), [[0; 2]; 0]);
    }

    #[test]
    fn a_drape_tells_the_place_where_placements_do_not() {
        // Both panels wait at the origin, as from a texture atlas; the drape is off-centre and rough.
        let panels = vec![
            panel("a", &SLEEVE, Vec3::zeros()),
            panel("b", &mirrored(&SLEEVE, 2.0), Vec3::zeros()),
        ];
        let pattern = Pattern {
            panels,
            stitches: vec![],
        };
        let mesh = sampled(&pattern, 0.05);
        let drape: Vec<_> = (0..mesh.x_bar.len())
            .map(|v| {
                let z = mesh.x_bar[v];
                let x = if v < mesh.panel_vertices[1].start {
                    z.x
                } else {
                    z.x - 2.0
                };
                let fold = 0.01 * crate::check::noise(v);
                Vec3::new(
                    5.0 + if v < mesh.panel_vertices[1].start {
                        0.4
                    } else {
                        -0.4
                    } + x,
                    z.y,
                    fold,
                )
            })
            .collect();
        let symmetry = Symmetry::detect(&pattern, &mesh, Some(&drape));
        assert_eq!(pairs(&symmetry), [[0, 1]]);
        assert_relative_eq!(symmetry.plane, 5.0, epsilon = 1e-6);
    }

    #[test]
    fn mirrored_meshes_give_matching_vertices_and_others_do_not() {
        let left = panel("left", &SLEEVE, Vec3::new(0.5, 0.0, 0.0));
        let right = panel("right", &mirrored(&SLEEVE, 0.0), Vec3::new(-0.5, 0.0, 0.0));
        let pattern = Pattern {
            panels: vec![left, right],
            stitches: vec![],
        };
        let mut mesh = sampled(&pattern, 0.06);
        let mirror = Symmetry::detect(&pattern, &mesh, None).mirrors[0];
        let (first, second) = (
            mesh.panel_vertices[0].clone(),
            mesh.panel_vertices[1].clone(),
        );
        assert!(
            mirror.vertices(&mesh).is_none(),
            "the fixture's grids are not mirrored"
        );
        let image = |v: usize| mirror.reflection.apply(mesh.x_bar[v]);
        let images: Vec<_> = first.clone().map(image).rev().collect();
        mesh.x_bar.truncate(second.start);
        mesh.x_bar.extend(images);
        mesh.panel_vertices[1] = second.start..mesh.x_bar.len();
        let last = mesh.x_bar.len() as u32 - 1;
        let expected: Vec<_> = first.map(|v| last - v as u32).collect();
        assert_eq!(mirror.vertices(&mesh), Some(expected));
    }

    #[test]
    fn garmentcode_names_and_shapes_agree_on_the_pairs() {
        for (name, pattern) in patterns() {
            let symmetry = Symmetry::detect(&pattern, &sampled(&pattern, 0.05), None);
            for mirror in &symmetry.mirrors {
                let [a, b] = mirror.panels.map(|p| pattern.panels[p].name.as_str());
                println!("{name}: {a} | {b}");
                let swap = a
                    .replace("left", "?")
                    .replace("right", "left")
                    .replace('?', "right");
                let sided = a.contains("left") || a.contains("right");
                assert!(!sided || swap == b, "{name}: {a} is paired with {b}");
            }
            let names: Vec<_> = symmetry
                .unmatched(pattern.panels.len())
                .iter()
                .map(|&p| &pattern.panels[p].name)
                .collect();
            println!("{name}: unmatched {names:?}");
        }
    }
}
