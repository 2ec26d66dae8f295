//! Which panels mirror each other across the wearer's middle, and how (paper §4.5).
//!
//! In the plane a mirror pair is congruent by a reflection `z ↦ u·conj(z) + b`, `|u| = 1`: the outlines,
//! laid over each other, must agree. Many panels have the same shape, and a rectangle reflects onto
//! itself in several ways, so the panels' places in space must mirror too, across one plane x = x₀, and
//! so must the seams between them. The cheapest reflections that agree with each other are kept.

mod congruence;

use crate::geometry::plane::{complex, point};
use crate::geometry::{Vec2, Vec3};
use crate::pattern::{Pattern, PatternMesh};
use congruence::{Fit, SHAPE_TOLERANCE, Shape};
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

/// Cost of a seam partner more or less, against 1 for each tolerance used up: decides between equals.
const SEAM_COST: f64 = 0.1;
/// Panels mirror in space if their places do to this part of the garment's diagonal: 3 cm on a dress.
const PLACE_TOLERANCE: f64 = 0.02;

impl Symmetry {
    /// Finds the mirror pairs of `pattern`. Where a panel lies in space is taken from the `drape`
    /// (\[m\], `[cloth vertex]`) if there is one, else from its placement.
    pub fn detect(pattern: &Pattern, mesh: &PatternMesh, drape: Option<&[Vec3]>) -> Self {
        let shapes: Vec<_> = (0..pattern.panels.len())
            .map(|p| Shape::new(pattern, mesh, drape, p))
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

/// Diagonal of the box around all placed panels \[m\].
fn diagonal(shapes: &[Shape]) -> f64 {
    let start = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
    let (low, high) = shapes
        .iter()
        .flat_map(Shape::placed)
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
    use crate::fixtures::{panel, patterns, sampled};
    use crate::pattern::{EdgeId, Panel, Stitch};
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
