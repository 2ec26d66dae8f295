//! Closed polygons: what lies inside, how far the outline is, whether it crosses itself.
//!
//! Edges are filed in horizontal bands about as high as an edge, so that a query looks at a few of
//! them and the crossing test is a sweep over each band: near-linear where edges are short against
//! the whole, as in sampled outlines. Sidedness is decided by exact predicates (Shewchuk 1997), so no answer depends on round-off.

use super::Vec2;
use robust::{Coord, orient2d};

/// A closed polygon, prepared for queries; edge i runs from point i to point i + 1.
#[derive(Clone, Debug)]
pub struct Polygon {
    points: Vec<Vec2>,
    low: f64,
    band_height: f64,
    bands: Vec<Vec<u32>>,
}

impl Polygon {
    /// Files the edges of the polygon through `points` \[m\].
    pub fn new(points: Vec<Vec2>) -> Self {
        let count = points.len();
        let (low, high) = points
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
                (low.min(p.y), high.max(p.y))
            });
        let rise: f64 = (0..count)
            .map(|i| (points[(i + 1) % count].y - points[i].y).abs())
            .sum();
        // An edge then lies in two bands on average, so that filing stays linear.
        let wanted = ((high - low) * count as f64 / rise.max(f64::MIN_POSITIVE)) as usize;
        let band_count = wanted.clamp(1, count.max(1));
        let mut polygon = Self {
            points,
            low,
            band_height: (high - low) / band_count as f64,
            bands: vec![Vec::new(); band_count],
        };
        for i in 0..count {
            let (a, b) = polygon.edge(i);
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

    /// Whether `p` lies inside. Of two polygons that share an edge, a point on it belongs to one.
    pub fn contains(&self, p: Vec2) -> bool {
        let crossed_right_of_p = |&i: &u32| {
            let (a, b) = self.edge(i as usize);
            let rising = a.y <= p.y && p.y < b.y && side(a, b, p) > 0.0;
            rising || (b.y <= p.y && p.y < a.y && side(b, a, p) > 0.0)
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
                    let (a, b) = self.edge(i as usize);
                    nearest = nearest.min(distance_to_segment(p, a, b));
                }
            }
        }
        nearest
    }

    /// The first two edges (i < j, smallest i, then smallest j) that cross, touch or overlap other
    /// than where neighbours meet; none for a simple polygon.
    pub fn first_crossing(&self) -> Option<(usize, usize)> {
        let mut first = None;
        for band in &self.bands {
            let mut by_x: Vec<(f64, f64, usize)> = band
                .iter()
                .map(|&i| {
                    let (a, b) = self.edge(i as usize);
                    (a.x.min(b.x), a.x.max(b.x), i as usize)
                })
                .collect();
            by_x.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
            for (k, &(_, right, i)) in by_x.iter().enumerate() {
                for &(_, _, j) in by_x[k + 1..].iter().take_while(|other| other.0 <= right) {
                    let pair = (i.min(j), i.max(j));
                    if first.is_none_or(|known| pair < known) && self.cross(pair) {
                        first = Some(pair);
                    }
                }
            }
        }
        first
    }

    fn edge(&self, i: usize) -> (Vec2, Vec2) {
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

    /// Whether edges i < j meet where they should not.
    fn cross(&self, (i, j): (usize, usize)) -> bool {
        let ((a, b), (c, d)) = (self.edge(i), self.edge(j));
        if j == i + 1 {
            return folds_back(a, b, d);
        }
        if i == 0 && j + 1 == self.points.len() {
            return folds_back(c, a, b);
        }
        let gap = a.inf(&b).sup(&c.inf(&d)) - a.sup(&b).inf(&c.sup(&d));
        gap.max() <= 0.0 && !same_side(a, b, c, d) && !same_side(c, d, a, b)
    }
}

/// The first two edges of the closed polygon that cross, touch or overlap other than where
/// neighbours meet; see [`Polygon::first_crossing`].
pub fn first_crossing(polygon: &[Vec2]) -> Option<(usize, usize)> {
    Polygon::new(polygon.to_vec()).first_crossing()
}

/// Distance from `p` to the segment from `a` to `b` \[m\].
pub fn distance_to_segment(p: Vec2, a: Vec2, b: Vec2) -> f64 {
    let along = b - a;
    let t = (p - a).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE);
    (a + along * t.clamp(0.0, 1.0) - p).norm()
}

/// Positive where `c` lies left of the line from `a` to `b`, zero on it; the sign is exact.
pub fn side(a: Vec2, b: Vec2, c: Vec2) -> f64 {
    let [a, b, c] = [a, b, c].map(|p| Coord { x: p.x, y: p.y });
    orient2d(a, b, c)
}

/// Whether the way from `b` to `c` retraces the way from `a` to `b`.
fn folds_back(a: Vec2, b: Vec2, c: Vec2) -> bool {
    side(a, b, c) == 0.0 && (a - b).dot(&(c - b)) > 0.0
}

/// Whether `c` and `d` lie strictly on the same side of the line from `a` to `b`.
fn same_side(a: Vec2, b: Vec2, c: Vec2, d: Vec2) -> bool {
    let (to_c, to_d) = (side(a, b, c), side(a, b, d));
    (to_c > 0.0 && to_d > 0.0) || (to_c < 0.0 && to_d < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;
    use proptest::prelude::*;

    fn square() -> Vec<Vec2> {
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(x, y)| Vec2::new(x, y))
            .to_vec()
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
                .map(|k| distance_to_segment(p, points[k], points[(k + 1) % 200]))
                .fold(f64::INFINITY, f64::min);
            assert_eq!(polygon.distance(p), brute);
        }
    }

    #[test]
    fn simple_polygons_have_no_crossing() {
        assert_eq!(first_crossing(&square()), None);
        assert_eq!(first_crossing(&star(500)), None);
        // Collinear neighbours are no crossing.
        let mut long = square();
        long.insert(1, Vec2::new(0.5, 0.0));
        assert_eq!(first_crossing(&long), None);
    }

    #[test]
    fn crossing_touching_and_folded_outlines_are_found() {
        let mut bow_tie = square();
        bow_tie.swap(2, 3);
        assert_eq!(first_crossing(&bow_tie), Some((1, 3)));
        let mut touching = square();
        touching.insert(3, Vec2::new(0.5, 0.0));
        // The corner on edge 0 ends edge 2 and starts edge 3.
        assert_eq!(first_crossing(&touching), Some((0, 2)));
        let mut spike = square();
        spike.splice(1..1, [Vec2::new(2.0, 0.0)]);
        spike[2].y = 0.0;
        assert_eq!(first_crossing(&spike), Some((0, 1)));
    }

    #[test]
    fn a_hundred_thousand_edges_are_tested_quickly() {
        let wave = |i: i32| {
            let angle = std::f64::consts::TAU * f64::from(i) / 1e5;
            Vec2::new(angle.cos(), angle.sin()) * (0.6 + 0.3 * (40.0 * angle).sin())
        };
        let start = std::time::Instant::now();
        assert_eq!(
            first_crossing(&(0..100_000).map(wave).collect::<Vec<_>>()),
            None
        );
        // All pairs would be 5e9 tests, most of a minute.
        assert!(start.elapsed().as_secs_f64() < 5.0);
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
            let brute = pairs.into_iter().find(|&pair| polygon.cross(pair));
            prop_assert_eq!(polygon.first_crossing(), brute);
        }

        #[test]
        fn inside_is_where_the_outline_winds_an_odd_number_of_times(x in -1.0..1.0, y in -1.0..1.0) {
            let points = star(60);
            let p = Vec2::new(x, y);
            let winding: f64 = (0..60)
                .map(|i| {
                    let (a, b) = (points[i] - p, points[(i + 1) % 60] - p);
                    super::super::cross2(a, b).atan2(a.dot(&b))
                })
                .sum();
            prop_assert_eq!(Polygon::new(points).contains(p), winding.abs() > 3.0);
        }
    }
}
