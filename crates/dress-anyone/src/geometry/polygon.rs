//! Closed polygons: their measure, what lies inside, how far the outline is, where it crosses itself.
//!
//! [`Polygon`] files its sides in horizontal bands about as high as a side, so that a query looks at
//! a few of them and crossings are a sweep over each band: near-linear where sides are short against
//! the whole, as in sampled outlines. Sidedness is decided by exact predicates (Shewchuk 1997), so
//! no answer depends on round-off.

use super::{Vec2, bounds, cross2};
use robust::{Coord, orient2d};

/// The polygon's sides, in order, the closing one last.
pub fn sides(polygon: &[Vec2]) -> impl Iterator<Item = (Vec2, Vec2)> + '_ {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().copied().zip(next.copied())
}

/// Signed area \[m²\]; positive counter-clockwise.
pub fn signed_area(polygon: &[Vec2]) -> f64 {
    0.5 * sides(polygon).map(|(a, b)| cross2(a, b)).sum::<f64>()
}

/// Length around \[m\].
pub fn perimeter(polygon: &[Vec2]) -> f64 {
    sides(polygon).map(|(a, b)| (b - a).norm()).sum()
}

/// Centre of the enclosed area; of the corners when there is none.
pub fn centroid(polygon: &[Vec2]) -> Vec2 {
    // About the first corner, so that a far origin costs no digits.
    let origin = polygon.first().copied().unwrap_or_default();
    let (mut moment, mut area) = (Vec2::zeros(), 0.0);
    for (a, b) in sides(polygon).map(|(a, b)| (a - origin, b - origin)) {
        let doubled = cross2(a, b);
        area += 0.5 * doubled;
        moment += (a + b) * (doubled / 6.0);
    }
    // Less is round-off, and its centre anywhere.
    if area.abs() > 1e-12 * perimeter(polygon).powi(2) {
        origin + moment / area
    } else {
        polygon.iter().sum::<Vec2>() / polygon.len().max(1) as f64
    }
}

/// Whether no side crosses another; sides that merely touch do not cross.
pub fn is_simple(polygon: &[Vec2]) -> bool {
    let polygon = Polygon::new(polygon.to_vec());
    polygon.crossings().next().is_none()
}

/// Distance from `p` to a segment \[m\].
pub fn distance_to_segment(p: Vec2, (a, b): (Vec2, Vec2)) -> f64 {
    let along = b - a;
    let t = (p - a).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE);
    (a + along * t.clamp(0.0, 1.0) - p).norm()
}

/// Least distance between two segments \[m\].
pub fn distance_of_segments(s: (Vec2, Vec2), t: (Vec2, Vec2)) -> f64 {
    if crossing_point(s, t).is_some() {
        return 0.0;
    }
    distance_to_segment(s.0, t)
        .min(distance_to_segment(s.1, t))
        .min(distance_to_segment(t.0, s))
        .min(distance_to_segment(t.1, s))
}

/// Two sides of a polygon, in order, and the point inside both where they cross.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The smaller index first.
    pub sides: (usize, usize),
    /// \[m\]
    pub point: Vec2,
}

/// A closed polygon, prepared for queries; side i runs from point i to point i + 1.
#[derive(Clone, Debug)]
pub struct Polygon {
    points: Vec<Vec2>,
    low: f64,
    band_height: f64,
    bands: Vec<Vec<u32>>,
}

impl Polygon {
    /// Files the sides of the polygon through `points` \[m\].
    pub fn new(points: Vec<Vec2>) -> Self {
        let count = points.len();
        let (low, high) = bounds(&points);
        let (low, high) = (low.y, high.y);
        let rise: f64 = sides(&points).map(|(a, b)| (b.y - a.y).abs()).sum();
        // A side then lies in two bands on average, so that filing stays linear.
        let wanted = ((high - low) * count as f64 / rise.max(f64::MIN_POSITIVE)) as usize;
        let band_count = wanted.clamp(1, count.max(1));
        let mut polygon = Self {
            points,
            low,
            band_height: (high - low) / band_count as f64,
            bands: vec![Vec::new(); band_count],
        };
        for i in 0..count {
            let (a, b) = polygon.side(i);
            for band in polygon.band(a.y.min(b.y))..=polygon.band(a.y.max(b.y)) {
                polygon.bands[band].push(i as u32);
            }
        }
        polygon
    }

    /// The corners \[m\].
    pub fn points(&self) -> &[Vec2] {
        &self.points
    }

    /// Whether `p` lies inside. Of two polygons that share a side, a point on it belongs to one.
    pub fn contains(&self, p: Vec2) -> bool {
        let crossed_right_of_p = |&i: &u32| {
            let (a, b) = self.side(i as usize);
            let rising = a.y <= p.y && p.y < b.y && turn(a, b, p) > 0.0;
            rising || (b.y <= p.y && p.y < a.y && turn(b, a, p) > 0.0)
        };
        let in_band = self.bands[self.band(p.y)].iter();
        in_band.filter(|i| crossed_right_of_p(i)).count() % 2 == 1
    }

    /// Distance from `p` to the outline \[m\], inside and outside alike.
    pub fn distance(&self, p: Vec2) -> f64 {
        let home = self.band(p.y);
        let mut nearest = f64::INFINITY;
        for step in 0..self.bands.len() {
            let below = home.checked_sub(step);
            let above = Some(home + step).filter(|&band| band < self.bands.len() && step > 0);
            let reaches = |&band: &usize| self.gap(band, p.y) < nearest;
            let (below, above) = (below.filter(reaches), above.filter(reaches));
            if step > 0 && below.is_none() && above.is_none() {
                break;
            }
            for band in below.into_iter().chain(above) {
                for &i in &self.bands[band] {
                    nearest = nearest.min(distance_to_segment(p, self.side(i as usize)));
                }
            }
        }
        nearest
    }

    /// Every pair of sides that cross, each passing from one side of the other to the other side.
    pub fn crossings(&self) -> impl Iterator<Item = Crossing> + '_ {
        self.close_pairs().filter_map(|sides| {
            let point = crossing_point(self.side(sides.0), self.side(sides.1))?;
            Some(Crossing { sides, point })
        })
    }

    /// The first two sides (i < j, smallest i, then smallest j) that cross, touch or overlap other
    /// than where neighbours meet; none for a polygon that nowhere meets itself.
    pub fn first_meeting(&self) -> Option<(usize, usize)> {
        self.close_pairs().fold(None, |first, pair| {
            let earlier = first.is_none_or(|known| pair < known);
            if earlier && self.meet(pair) {
                Some(pair)
            } else {
                first
            }
        })
    }

    /// Pairs of sides i < j whose boxes overlap, each once.
    fn close_pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.bands.len()).flat_map(move |band| {
            let span = |&i: &u32| {
                let (a, b) = self.side(i as usize);
                (a.x.min(b.x), a.x.max(b.x), i as usize)
            };
            let mut by_x: Vec<(f64, f64, usize)> = self.bands[band].iter().map(span).collect();
            by_x.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
            (0..by_x.len()).flat_map(move |k| {
                let (_, right, i) = by_x[k];
                let reached = by_x[k + 1..].iter().take_while(move |side| side.0 <= right);
                let pairs: Vec<_> = reached.map(|side| (i.min(side.2), i.max(side.2))).collect();
                pairs
                    .into_iter()
                    .filter(move |pair| self.overlap_from(*pair, band))
            })
        })
    }

    /// Whether the boxes of two sides overlap, and `band` is the first that both are filed in.
    fn overlap_from(&self, (i, j): (usize, usize), band: usize) -> bool {
        let ((a, b), (c, d)) = (self.side(i), self.side(j));
        let gap = a.inf(&b).sup(&c.inf(&d)) - a.sup(&b).inf(&c.sup(&d));
        gap.max() <= 0.0 && self.band(a.y.min(b.y).max(c.y.min(d.y))) == band
    }

    fn side(&self, i: usize) -> (Vec2, Vec2) {
        (self.points[i], self.points[(i + 1) % self.points.len()])
    }

    /// The band of height `y`; the first or last for heights outside.
    fn band(&self, y: f64) -> usize {
        let band = ((y - self.low) / self.band_height.max(f64::MIN_POSITIVE)) as usize;
        band.min(self.bands.len() - 1)
    }

    /// How far `y` is from a band, slightly underestimated.
    fn gap(&self, band: usize, y: f64) -> f64 {
        let bottom = self.low + band as f64 * self.band_height;
        let gap = (bottom - y).max(y - bottom - self.band_height);
        gap - 1e-9 * self.band_height
    }

    /// Whether sides i < j, whose boxes overlap, meet where they should not.
    fn meet(&self, (i, j): (usize, usize)) -> bool {
        let ((a, b), (c, d)) = (self.side(i), self.side(j));
        if j == i + 1 {
            return folds_back(a, b, d);
        }
        if i == 0 && j + 1 == self.points.len() {
            return folds_back(c, a, b);
        }
        !same_side(a, b, c, d) && !same_side(c, d, a, b)
    }
}

/// Where two segments cross, each passing from one side of the other to the other side.
fn crossing_point((a, b): (Vec2, Vec2), (c, d): (Vec2, Vec2)) -> Option<Vec2> {
    let opposite = |s: f64, t: f64| (s > 0.0 && t < 0.0) || (s < 0.0 && t > 0.0);
    let (to_c, to_d) = (turn(a, b, c), turn(a, b, d));
    let crosses = opposite(to_c, to_d) && opposite(turn(c, d, a), turn(c, d, b));
    crosses.then(|| c + (d - c) * (to_c / (to_c - to_d)))
}

/// Positive where `c` lies left of the line from `a` to `b`, zero on it; the sign is exact.
fn turn(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    let [a, b, c] = [a, b, c].map(|p| Coord { x: p.x, y: p.y });
    orient2d(a, b, c)
}

/// Whether the way from `b` to `c` retraces the way from `a` to `b`.
fn folds_back(a: Vec2, b: Vec2, c: Vec2) -> bool {
    turn(a, b, c) == 0.0 && (a - b).dot(&(c - b)) > 0.0
}

/// Whether `c` and `d` lie strictly on the same side of the line from `a` to `b`.
fn same_side(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool {
    let (to_c, to_d) = (turn(a, b, c), turn(a, b, d));
    (to_c > 0.0 && to_d > 0.0) || (to_c < 0.0 && to_d < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn square() -> Vec<Vec2> {
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(x, y)| Vec2::new(x, y))
            .to_vec()
    }

    fn polygon(points: &[(f64, f64)]) -> Vec<Vec2> {
        points.iter().map(|&(x, y)| Vec2::new(x, y)).collect()
    }

    fn first_meeting(points: Vec<Vec2>) -> Option<(usize, usize)> {
        Polygon::new(points).first_meeting()
    }

    /// A simple star-shaped polygon with an unsteady radius.
    fn star(count: usize) -> Vec<Vec2> {
        (0..count)
            .map(|i| {
                let angle = std::f64::consts::TAU * i as f64 / count as f64;
                Vec2::new(angle.cos(), angle.sin()) * (0.6 + 0.3 * noise(i))
            })
            .collect()
    }

    #[test]
    fn the_square_contains_its_middle_and_not_its_surroundings() {
        let square = Polygon::new(square());
        assert!(square.contains(Vec2::new(0.5, 0.5)));
        for (x, y) in [(1.5, 0.5), (-0.5, 0.5), (0.5, 1.5), (0.5, -0.5)] {
            assert!(!square.contains(Vec2::new(x, y)));
        }
    }

    #[test]
    fn a_point_on_a_shared_edge_belongs_to_one_of_two_squares() {
        let (left, mut shifted) = (Polygon::new(square()), square());
        for p in &mut shifted {
            p.x += 1.0;
        }
        let right = Polygon::new(shifted);
        for y in [0.0, 0.1, 0.3, 0.7] {
            let p = Vec2::new(1.0, y);
            assert_ne!(left.contains(p), right.contains(p));
        }
    }

    #[test]
    fn distances_are_those_of_the_nearest_edge() {
        let points = star(200);
        let polygon = Polygon::new(points.clone());
        for i in 0..300 {
            let p = Vec2::new(1.5 * noise(2 * i), 1.5 * noise(2 * i + 1));
            let brute = (0..200)
                .map(|k| distance_to_segment(p, (points[k], points[(k + 1) % 200])))
                .fold(f64::INFINITY, f64::min);
            assert_eq!(polygon.distance(p), brute);
        }
    }

    #[test]
    fn simple_polygons_nowhere_meet_themselves() {
        assert_eq!(first_meeting(square()), None);
        assert_eq!(first_meeting(star(500)), None);
        // Collinear neighbours do not meet.
        let mut long = square();
        long.insert(1, Vec2::new(0.5, 0.0));
        assert_eq!(first_meeting(long), None);
    }

    #[test]
    fn crossing_touching_and_folded_outlines_are_found() {
        let mut bow_tie = square();
        bow_tie.swap(2, 3);
        assert_eq!(first_meeting(bow_tie), Some((1, 3)));
        let mut touching = square();
        touching.insert(3, Vec2::new(0.5, 0.0));
        // The corner on edge 0 ends edge 2 and starts edge 3.
        assert_eq!(first_meeting(touching), Some((0, 2)));
        let mut spike = square();
        spike.splice(1..1, [Vec2::new(2.0, 0.0)]);
        spike[2].y = 0.0;
        assert_eq!(first_meeting(spike), Some((0, 1)));
    }

    #[test]
    fn a_hundred_thousand_edges_are_tested_quickly() {
        let wave = |i: i32| {
            let angle = std::f64::consts::TAU * f64::from(i) / 1e5;
            Vec2::new(angle.cos(), angle.sin()) * (0.6 + 0.3 * (40.0 * angle).sin())
        };
        let start = std::time::Instant::now();
        assert_eq!(first_meeting((0..100_000).map(wave).collect()), None);
        // All pairs would be 5e9 tests, most of a minute.
        assert!(start.elapsed().as_secs_f64() < 5.0);
    }

    #[test]
    fn the_centroid_of_an_l_is_the_mean_of_its_squares() {
        // Three unit squares with centres (½, ½), (1½, ½), (½, 1½), far from the origin.
        let corners = [(0., 0.), (2., 0.), (2., 1.), (1., 1.), (1., 2.), (0., 2.)];
        let far: Vec<_> = corners.iter().map(|(x, y)| (x + 1e6, y - 1e6)).collect();
        let middle = Vec2::new(1e6 + 5.0 / 6.0, -1e6 + 5.0 / 6.0);
        assert_relative_eq!(centroid(&polygon(&far)), middle, epsilon = 1e-9);
    }

    #[test]
    fn the_centroid_of_a_line_or_of_nothing_is_that_of_its_corners() {
        let line = polygon(&[(0., 0.), (1., 2.), (2., 4.)]);
        assert_relative_eq!(centroid(&line), Vec2::new(1.0, 2.0), epsilon = 1e-15);
        assert_eq!(centroid(&[]), Vec2::zeros());
    }

    #[test]
    fn a_bow_tie_crosses_itself_and_a_dart_does_not() {
        assert!(!is_simple(&polygon(&[
            (0., 0.),
            (1., 1.),
            (1., 0.),
            (0., 1.)
        ])));
        assert!(is_simple(&polygon(&[
            (0., 0.),
            (2., 0.),
            (1., 0.1),
            (0., 2.)
        ])));
    }

    #[test]
    fn a_notch_is_outside() {
        let dart = polygon(&[(0., 0.), (4., 0.), (4., 4.), (2., 1.), (0., 4.)]);
        let dart = Polygon::new(dart);
        assert!(dart.contains(Vec2::new(2.0, 0.5)));
        assert!(!dart.contains(Vec2::new(2.0, 2.0)));
        assert!(!dart.contains(Vec2::new(-1.0, 0.0)));
    }

    #[test]
    fn crossing_segments_have_no_distance_and_parallel_ones_their_gap() {
        let at = |x: f64, y: f64| Vec2::new(x, y);
        let base = (at(0.0, 0.0), at(1.0, 0.0));
        assert_eq!(
            distance_of_segments(base, (at(0.5, -1.0), at(0.5, 1.0))),
            0.0
        );
        assert_relative_eq!(
            distance_of_segments(base, (at(0.2, 0.3), at(3.0, 0.3))),
            0.3
        );
        // Corner (1, 0) to (1.3, 0.4): 3–4–5.
        assert_relative_eq!(
            distance_of_segments(base, (at(1.3, 0.4), at(2.0, 3.0))),
            0.5
        );
    }

    proptest! {
        #[test]
        fn the_sweep_finds_what_all_pairs_find(coordinates in prop::collection::vec((0u8..12, 0u8..12), 3..14)) {
            let points: Vec<Vec2> = coordinates
                .iter()
                .map(|&(x, y)| Vec2::new(f64::from(x), f64::from(y)))
                .collect();
            let polygon = Polygon::new(points.clone());
            let pairs = (0..points.len()).flat_map(|i| (i + 1..points.len()).map(move |j| (i, j)));
            let pairs: Vec<_> = pairs.collect();
            let close = |(i, j): (usize, usize)| {
                let ((a, b), (c, d)) = (polygon.side(i), polygon.side(j));
                (a.inf(&b).sup(&c.inf(&d)) - a.sup(&b).inf(&c.sup(&d))).max() <= 0.0
            };
            let brute = pairs.iter().find(|&&pair| close(pair) && polygon.meet(pair));
            prop_assert_eq!(polygon.first_meeting(), brute.copied());
            let cross = |(i, j): (usize, usize)| crossing_point(polygon.side(i), polygon.side(j)).is_some();
            let brute: Vec<_> = pairs.into_iter().filter(|pair| cross(*pair)).collect();
            let mut swept: Vec<_> = polygon.crossings().map(|crossing| crossing.sides).collect();
            swept.sort_unstable();
            prop_assert_eq!(swept, brute);
        }

        #[test]
        fn inside_is_where_the_outline_winds_an_odd_number_of_times(x in -1.0..1.0, y in -1.0..1.0) {
            let points = star(60);
            let p = Vec2::new(x, y);
            let winding: f64 = (0..60)
                .map(|i| {
                    let (a, b) = (points[i] - p, points[(i + 1) % 60] - p);
                    cross2(a, b).atan2(a.dot(&b))
                })
                .sum();
            prop_assert_eq!(Polygon::new(points).contains(p), winding.abs() > 3.0);
        }
    }
}
