//! Draws a cage around a panel: a simple polygon of few points that strictly holds the outline.
//!
//! The outline is thickened by δ = margin × perimeter / points: the outer contour of its distance
//! field on a grid, so that darts, slits and notches narrower than 2δ are bridged and both legs of a
//! dart move together. The contour is then thinned to a few points by inserting the farthest one
//! (Douglas–Peucker order) where the polygon deviates most, runs longest or comes too near.
//!
//! Several outlines are held by one cage: a panel and its mirrored partner need the same cage. With
//! `mirrored` the cage is its own mirror image in the y axis, to the last bit.

use crate::geometry::plane::{
    centroid, contains, distance_of_segments, distance_to_segment, is_simple, perimeter, sides,
};
use crate::geometry::{Vec2, signed_area};

/// Fewest control points of a cage: with fewer, a rectangle cannot bow its sides.
pub const FEWEST_POINTS: usize = 8;
/// Grid cells per δ: contours are then good to about δ/50.
const CELLS: f64 = 5.0;
/// A cage keeps this part of δ free: the map's derivative has a logarithmic pole at the control
/// points.
pub(super) const CLEARANCE: f64 = 0.35;
/// How often δ is halved before giving up.
const ATTEMPTS: usize = 8;

/// A counter-clockwise cage around all `outlines` \[m\], with about `points` control points and at
/// most three times as many; `None` where there is no area to enclose. A `mirrored` cage starts on
/// the y axis below, and its point j mirrors its point n − j.
pub fn enclose(
    outlines: &[Vec<Vec2>],
    points: usize,
    margin: f64,
    mirrored: bool,
) -> Option<Vec<Vec2>> {
    let spacing = perimeter(outlines.first()?) / points as f64;
    if !spacing.is_finite() || outlines.iter().any(|o| signed_area(o).abs() == 0.0) {
        return None;
    }
    (0..ATTEMPTS)
        .map(|attempt| margin * spacing / f64::from(1 << attempt))
        .find_map(|delta| {
            let drawing = Drawing {
                outlines: outlines.iter().map(|o| refined(o, delta)).collect(),
                spacing,
                delta,
                fold: if mirrored { 2 } else { 1 },
                points,
            };
            let ring = drawing.contour()?;
            let cage = if mirrored {
                unfold(&drawing.thin(&right_half(ring)?))
            } else {
                let mut thinned = drawing.thin(&from_farthest(ring));
                thinned.pop();
                thinned
            };
            drawing.holds(&cage).then_some(cage)
        })
}

/// One attempt at a cage.
struct Drawing {
    outlines: Vec<Vec<Vec2>>,
    /// Wanted distance between control points \[m\].
    spacing: f64,
    /// Wanted distance between cage and outline \[m\].
    delta: f64,
    /// 2 where only the right half is thinned.
    fold: usize,
    points: usize,
}

/// A piece of the contour that the cage cuts short by one straight side.
struct Span {
    from: usize,
    to: usize,
    /// Where to cut it next.
    cut: usize,
    /// How much it needs cutting \[m\].
    score: f64,
    /// Whether its side comes too near the outline.
    near: bool,
}

impl Drawing {
    /// The outer contour of all points within δ of the outlines, counter-clockwise.
    fn contour(&self) -> Option<Vec<Vec2>> {
        let field = Field::around(&self.outlines, self.delta);
        field.outer_contour(self.delta)
    }

    /// Few points of the `chain`, among them its ends.
    fn thin(&self, chain: &[Vec2]) -> Vec<Vec2> {
        let last = chain.len() - 1;
        let mut spans = if self.fold == 2 {
            vec![self.span(chain, 0, last)]
        } else {
            let far = farthest(chain, chain[0]);
            vec![self.span(chain, 0, far), self.span(chain, far, last)]
        };
        loop {
            let count = spans.len() * self.fold;
            let worst = (0..spans.len())
                .filter(|&i| spans[i].to - spans[i].from > 1)
                .max_by(|&i, &j| spans[i].score.total_cmp(&spans[j].score));
            let Some(worst) = worst else { break };
            let near = spans[worst].near;
            let smooth = !near && spans[worst].score < self.delta / 4.0;
            let spent = count >= if near { 3 * self.points } else { self.points };
            if count >= FEWEST_POINTS && (smooth || spent || count + self.fold > 3 * self.points) {
                break;
            }
            let Span { from, to, cut, .. } = spans[worst];
            spans[worst] = self.span(chain, from, cut);
            spans.insert(worst + 1, self.span(chain, cut, to));
        }
        let starts = spans.iter().map(|span| chain[span.from]);
        starts.chain([chain[last]]).collect()
    }

    fn span(&self, chain: &[Vec2], from: usize, to: usize) -> Span {
        let side = (chain[from], chain[to]);
        let (mut cut, mut deviation) = (usize::midpoint(from, to), 0.0);
        for i in from + 1..to {
            let d = distance_to_segment(chain[i], side);
            if d > deviation {
                (cut, deviation) = (i, d);
            }
        }
        if deviation < self.delta / 4.0 {
            cut = usize::midpoint(from, to);
        }
        let near = self.clearance(side) < CLEARANCE * self.delta;
        let length = (side.1 - side.0).norm();
        let score = deviation + 0.15 * (length - 1.6 * self.spacing);
        Span {
            from,
            to,
            cut,
            // Nearness goes first, whatever the deviation.
            score: if near {
                score + 1e3 * self.spacing
            } else {
                score
            },
            near,
        }
    }

    /// Distance from a side of the cage to the outlines \[m\].
    fn clearance(&self, side: (Vec2, Vec2)) -> f64 {
        let distances = self.outlines.iter().flat_map(|o| sides(o));
        distances
            .map(|edge| distance_of_segments(side, edge))
            .fold(f64::INFINITY, f64::min)
    }

    /// Whether `cage` is simple, counter-clockwise, and holds the outlines with room to spare.
    fn holds(&self, cage: &[Vec2]) -> bool {
        signed_area(cage) > 0.0
            && is_simple(cage)
            && self.outlines.iter().all(|o| contains(cage, o[0]))
            && sides(cage).all(|side| self.clearance(side) >= CLEARANCE * self.delta)
    }
}

/// Distances to outlines at the nodes of a grid, exact near the outlines.
struct Field {
    centre: Vec2,
    step: f64,
    /// The grid has `2·half + 1` columns and rows about the centre.
    half: [i64; 2],
    distance: Vec<f64>,
}

impl Field {
    fn around(outlines: &[Vec<Vec2>], delta: f64) -> Self {
        let start = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
        let all = outlines.iter().flatten();
        let (low, high) = all.fold(start, |(low, high), p| (low.inf(p), high.sup(p)));
        let step = delta / CELLS;
        let reach = 1.5 * delta;
        let half = [0, 1].map(|i| ((0.5 * (high[i] - low[i]) + reach) / step).ceil() as i64 + 1);
        let mut field = Self {
            centre: (low + high) * 0.5,
            step,
            half,
            distance: vec![2.0 * delta; ((2 * half[0] + 1) * (2 * half[1] + 1)) as usize],
        };
        for side in outlines.iter().flat_map(|o| sides(o)) {
            field.draw(side, reach);
        }
        field
    }

    /// Lowers the distances within `reach` of a segment.
    fn draw(&mut self, side: (Vec2, Vec2), reach: f64) {
        let low = (side.0.inf(&side.1).add_scalar(-reach) - self.centre) / self.step;
        let high = (side.0.sup(&side.1).add_scalar(reach) - self.centre) / self.step;
        for j in low.y.floor() as i64..=high.y.ceil() as i64 {
            for i in low.x.floor() as i64..=high.x.ceil() as i64 {
                let distance = distance_to_segment(self.node([i, j]), side);
                if let Some(k) = self.index([i, j]) {
                    self.distance[k] = self.distance[k].min(distance);
                }
            }
        }
    }

    /// Walks around the nodes within `delta` (marching squares, inside on the left), starting below
    /// the lowest of them, so on the outer contour.
    fn outer_contour(&self, delta: f64) -> Option<Vec<Vec2>> {
        let [columns, rows] = self.half;
        let inside = |n: [i64; 2]| self.at(n) <= delta;
        let lowest = (-rows..=rows)
            .flat_map(|j| (-columns..=columns).map(move |i| [i, j]))
            .find(|&n| inside(n))?;
        let start = (lowest, [lowest[0], lowest[1] - 1]);
        let (mut a, mut b) = start;
        let mut contour = Vec::new();
        // Every grid edge is crossed at most once.
        for _ in 0..4 * self.distance.len() {
            let (near, far) = (self.at(a), self.at(b));
            let (p, q) = (self.node(a), self.node(b));
            contour.push(p + (q - p) * ((delta - near) / (far - near)));
            let ahead = [a[1] - b[1], b[0] - a[0]];
            let (c, d) = (step(a, ahead), step(b, ahead));
            (a, b) = match (inside(c), inside(d)) {
                (false, _) => (a, c),
                (true, false) => (c, d),
                (true, true) => (d, b),
            };
            if (a, b) == start {
                return Some(contour);
            }
        }
        None
    }

    fn node(&self, [i, j]: [i64; 2]) -> Vec2 {
        self.centre + Vec2::new(i as f64, j as f64) * self.step
    }

    fn at(&self, node: [i64; 2]) -> f64 {
        self.index(node).map_or(f64::INFINITY, |k| self.distance[k])
    }

    fn index(&self, [i, j]: [i64; 2]) -> Option<usize> {
        let [columns, rows] = self.half;
        let known = i.abs() <= columns && j.abs() <= rows;
        known.then(|| ((j + rows) * (2 * columns + 1) + i + columns) as usize)
    }
}

fn step(a: [i64; 2], by: [i64; 2]) -> [i64; 2] {
    [a[0] + by[0], a[1] + by[1]]
}

/// The outline with its sides cut to δ/2, so that drawing one touches few nodes.
fn refined(outline: &[Vec2], delta: f64) -> Vec<Vec2> {
    let mut points = Vec::new();
    for (a, b) in sides(outline) {
        let pieces = ((b - a).norm() / (0.5 * delta)).ceil().max(1.0) as usize;
        points.extend((0..pieces).map(|k| a + (b - a) * (k as f64 / pieces as f64)));
    }
    points
}

/// The closed `ring` as a chain from its farthest point round to it again.
fn from_farthest(mut ring: Vec<Vec2>) -> Vec<Vec2> {
    let start = farthest(&ring, centroid(&ring));
    ring.rotate_left(start);
    ring.push(ring[0]);
    ring
}

fn farthest(points: &[Vec2], from: Vec2) -> usize {
    (0..points.len())
        .max_by(|&i, &j| {
            (points[i] - from)
                .norm()
                .total_cmp(&(points[j] - from).norm())
        })
        .expect("a contour has points")
}

/// The part of a symmetric ring with x ≥ 0, from its lower to its upper crossing of the axis.
fn right_half(mut ring: Vec<Vec2>) -> Option<Vec<Vec2>> {
    let mut on_axis: Vec<_> = (0..ring.len()).filter(|&i| ring[i].x == 0.0).collect();
    on_axis.sort_by(|&i, &j| ring[i].y.total_cmp(&ring[j].y));
    let &[bottom, top] = on_axis.as_slice() else {
        return None;
    };
    let end = (top + ring.len() - bottom) % ring.len();
    ring.rotate_left(bottom);
    ring.truncate(end + 1);
    Some(ring)
}

/// A right half, from axis to axis, and its mirror image.
fn unfold(half: &[Vec2]) -> Vec<Vec2> {
    let inner = half[1..half.len() - 1].iter().rev();
    let mirrored = inner.map(|p| Vec2::new(-p.x, p.y));
    half.iter().copied().chain(mirrored).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cage::green::coordinates;
    use crate::fixtures;
    use crate::geometry::plane::complex;
    use proptest::prelude::*;

    /// Everything a cage promises.
    #[track_caller]
    fn assert_holds(outline: &[Vec2], points: usize, what: &str) -> Vec<Vec2> {
        let cage = enclose(&[outline.to_vec()], points, 0.3, false).expect(what);
        assert!(is_simple(&cage), "{what}: the cage crosses itself");
        let n = cage.len();
        assert!((8..=3 * points).contains(&n), "{what}: {n} points");
        assert!(
            outline.iter().all(|p| contains(&cage, *p)),
            "{what}: sticks out"
        );
        let distance = sides(&cage)
            .flat_map(|s| sides(outline).map(move |t| distance_of_segments(s, t)))
            .fold(f64::INFINITY, f64::min);
        let delta = 0.3 * perimeter(outline) / points as f64;
        // δ may have been halved for narrow shapes; the fixtures below need at most two halvings.
        assert!(
            distance >= CLEARANCE * delta / 4.0,
            "{what}: {distance} of {delta}"
        );
        assert_reproduces(&cage, outline);
        cage
    }

    /// Coordinates reproduce the panel's own points to round-off.
    #[track_caller]
    fn assert_reproduces(cage: &[Vec2], points: &[Vec2]) {
        let control: Vec<_> = cage.iter().map(|p| complex(*p)).collect();
        let size = control.iter().map(|z| z.norm()).fold(0.0, f64::max);
        for z in points.iter().map(|p| complex(*p)) {
            let weights = coordinates(&control, z);
            let sum: num_complex::Complex64 =
                weights.iter().zip(&control).map(|(w, c)| w * c).sum();
            assert!((sum - z).norm() < 1e-12 * size, "{}", (sum - z).norm());
        }
    }

    fn polygon(points: &[(f64, f64)]) -> Vec<Vec2> {
        points.iter().map(|&(x, y)| Vec2::new(x, y)).collect()
    }

    #[test]
    fn rectangles_straps_and_darts_are_held() {
        let rectangle = polygon(&[(0., 0.), (0.5, 0.), (0.5, 0.7), (0., 0.7)]);
        let strap = polygon(&[(0., 0.), (0.6, 0.), (0.6, 0.02), (0., 0.02)]);
        let dart = polygon(&[
            (0., 0.),
            (0.3, 0.),
            (0.27, 0.6),
            (0.16, 0.61),
            (0.15, 0.45),
            (0.14, 0.61),
            (0.02, 0.6),
        ]);
        for points in [8, 12, 16] {
            assert_holds(&rectangle, points, "rectangle");
            assert_holds(&strap, points, "strap");
            let cage = assert_holds(&dart, points, "dart");
            // The dart, 2 cm wide at its mouth, is bridged: no control point lies in it.
            let inside = |p: &&Vec2| (0.14..0.16).contains(&p.x) && (0.4..0.6).contains(&p.y);
            assert!(cage.iter().find(inside).is_none());
        }
    }

    #[test]
    fn a_wide_notch_is_followed() {
        let u = polygon(&[
            (0., 0.),
            (0.6, 0.),
            (0.6, 0.5),
            (0.45, 0.5),
            (0.45, 0.15),
            (0.15, 0.15),
            (0.15, 0.5),
            (0., 0.5),
        ]);
        let cage = assert_holds(&u, 16, "u");
        assert!(
            !contains(&cage, Vec2::new(0.3, 0.4)),
            "the legs are not tied together"
        );
    }

    #[test]
    fn a_mirrored_cage_is_its_own_mirror_image() {
        let right = polygon(&[(0.2, 0.), (0.25, 0.3), (0.3, 0.5), (0.2, 0.5), (0.1, 0.4)]);
        let left = right.iter().rev().map(|p| Vec2::new(-p.x, p.y));
        let outline: Vec<_> = right.iter().copied().chain(left).collect();
        let cage = enclose(std::slice::from_ref(&outline), 12, 0.3, true).expect("encloses");
        let n = cage.len();
        assert_eq!((cage[0].x, cage[n / 2].x), (0.0, 0.0));
        for j in 1..n {
            assert_eq!((cage[j].x, cage[j].y), (-cage[n - j].x, cage[n - j].y));
        }
        assert!(is_simple(&cage) && outline.iter().all(|p| contains(&cage, *p)));
        assert_reproduces(&cage, &outline);
    }

    #[test]
    fn no_area_has_no_cage() {
        assert!(enclose(&[polygon(&[(0., 0.), (1., 0.), (2., 0.)])], 12, 0.3, false).is_none());
        assert!(
            enclose(
                &[polygon(&[(0., 0.), (f64::NAN, 0.), (2., 1.)])],
                12,
                0.3,
                false
            )
            .is_none()
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn star_shaped_outlines_are_held(
            radii in prop::collection::vec(0.15..1.0_f64, 5..24),
            points in 8..17_usize,
        ) {
            let turn = std::f64::consts::TAU / radii.len() as f64;
            let ray = |(i, r): (usize, &f64)| Vec2::new((turn * i as f64).cos(), (turn * i as f64).sin()) * *r;
            let outline: Vec<_> = radii.iter().enumerate().map(ray).collect();
            assert_holds(&outline, points, &format!("{radii:?}"));
        }

        /// A band bent along a wave: concave, narrow, without a centre that sees everything.
        #[test]
        fn bent_bands_are_held(bend in 0.0..0.6_f64, waves in 0.5..2.0_f64, width in 0.02..0.2_f64) {
            let n = 40;
            let spine = |k: usize| {
                let t = k as f64 / f64::from(n);
                Vec2::new(t, bend * (waves * std::f64::consts::TAU * t).sin())
            };
            let lower = (0..=n as usize).map(spine);
            let upper = (0..=n as usize).rev().map(|k| spine(k) + Vec2::new(0.0, width));
            let outline: Vec<_> = lower.chain(upper).collect();
            assert_holds(&outline, 12, "band");
        }
    }

    #[test]
    fn every_panel_of_the_garmentcode_designs_is_held() {
        for (name, pattern) in fixtures::patterns() {
            for panel in &pattern.panels {
                let outline = panel.outline(0.005);
                assert_holds(&outline, 12, &format!("{name} {}", panel.name));
            }
        }
    }
}
