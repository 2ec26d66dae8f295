//! Where panels go on a sheet, and where a panel has room for its name.

use crate::geometry::polygon::{Polygon, sides};
use crate::geometry::{Vec2, bounds};

/// Puts boxes of these sizes onto a sheet in rows, `gap` apart: the tallest first, rows filled from
/// the left, the rows of the length that makes the sheet's longer side shortest. Gives each box's
/// corner of least coordinates, and the size of the sheet; in the unit of `sizes`, the first row at
/// the least y.
pub fn shelves(sizes: &[Vec2], gap: f64) -> (Vec<Vec2>, Vec2) {
    const TRIALS: u32 = 60;
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by(|&a, &b| sizes[b].y.total_cmp(&sizes[a].y));
    let widest = sizes.iter().map(|s| s.x).fold(0.0, f64::max);
    let all: f64 = sizes.iter().map(|s| s.x + gap).sum();
    let room = |i: u32| widest + (all - widest) * f64::from(i) / f64::from(TRIALS);
    (0..=TRIALS)
        .map(|i| rows(sizes, &order, gap, room(i)))
        .min_by(|(_, a), (_, b)| a.max().total_cmp(&b.max()))
        .unwrap_or_default()
}

/// [`shelves`] with rows at most `room` long.
fn rows(sizes: &[Vec2], order: &[usize], gap: f64, room: f64) -> (Vec<Vec2>, Vec2) {
    let mut corners = vec![Vec2::zeros(); sizes.len()];
    let (mut x, mut y, mut row_height) = (0.0, 0.0, 0.0_f64);
    let mut used = Vec2::zeros();
    for &b in order {
        if x > 0.0 && x + sizes[b].x > room {
            (x, y, row_height) = (0.0, y + row_height + gap, 0.0);
        }
        corners[b] = Vec2::new(x, y);
        row_height = row_height.max(sizes[b].y);
        used = used.sup(&(corners[b] + sizes[b]));
        x += sizes[b].x + gap;
    }
    (corners, used)
}

/// Smallest and largest corner of the box around `points`; zero without any.
pub(super) fn box_around(points: &[Vec2]) -> (Vec2, Vec2) {
    if points.is_empty() {
        return Default::default();
    }
    bounds(points)
}

/// The point of a polygon farthest from its outline, to about a fortieth of its box, and that
/// distance; 0 for a polygon without inside.
pub(super) fn heart(polygon: &[Vec2]) -> (Vec2, f64) {
    const CELLS: usize = 40;
    let (low, high) = box_around(polygon);
    let polygon = Polygon::new(polygon.to_vec());
    let mut best = ((low + high) * 0.5, 0.0);
    for i in 0..CELLS * CELLS {
        let cell = Vec2::new((i % CELLS) as f64 + 0.5, (i / CELLS) as f64 + 0.5);
        let p = low + cell.component_mul(&(high - low)) / CELLS as f64;
        if polygon.contains(p) {
            let distance = polygon.distance(p);
            // Of many as good, the leftmost: rounding does not choose.
            if distance > 1.001 * best.1 {
                best = (p, distance);
            }
        }
    }
    best
}

/// Distance from `p` to the outline straight to the right; 0 when nothing is there.
pub(super) fn room_to_the_right(polygon: &[Vec2], p: Vec2) -> f64 {
    let first = crossings(polygon, p).fold(f64::INFINITY, f64::min);
    if first.is_finite() { first - p.x } else { 0.0 }
}

/// Where the ray from `p` to the right crosses the outline: x.
fn crossings(polygon: &[Vec2], p: Vec2) -> impl Iterator<Item = f64> {
    sides(polygon)
        .filter(move |(a, b)| (a.y > p.y) != (b.y > p.y))
        .map(move |(a, b)| a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x))
        .filter(move |x| *x > p.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn boxes_on_shelves_never_overlap(
            sizes in prop::collection::vec((0.0..50.0, 0.0..50.0), 0..20),
            gap in 0.0..5.0,
        ) {
            let sizes: Vec<Vec2> = sizes.into_iter().map(|(x, y)| Vec2::new(x, y)).collect();
            let (corners, sheet) = shelves(&sizes, gap);
            for (i, (a, a_size)) in corners.iter().zip(&sizes).enumerate() {
                let end = a + a_size;
                prop_assert!(a.min() >= 0.0 && end.x <= sheet.x && end.y <= sheet.y);
                for (b, b_size) in corners[..i].iter().zip(&sizes) {
                    let apart = |k: usize| {
                        let free = gap - 1e-9;
                        a[k] >= b[k] + b_size[k] + free || b[k] >= a[k] + a_size[k] + free
                    };
                    prop_assert!(apart(0) || apart(1));
                }
            }
        }
    }

    #[test]
    fn the_heart_of_an_angle_lies_in_its_corner() {
        // An L of two bars 1 wide: farthest from the outline near the inner corner's diagonal.
        let points = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 1.0],
            [1.0, 1.0],
            [1.0, 4.0],
            [0.0, 4.0],
        ];
        let (heart, clearance) = heart(&points.map(Vec2::from));
        // Touching both outer sides and the inner corner: r = (1 − r)·√2.
        let expected = 2_f64.sqrt() / (1.0 + 2_f64.sqrt());
        assert!((clearance - expected).abs() < 0.1, "{clearance}");
        assert!(heart.x < 0.75 && heart.y < 0.75);
    }
}
