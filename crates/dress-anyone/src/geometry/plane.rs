//! Closed polygons of the plane: their measure, and whether they cross themselves or hold a point.
//!
//! The plane is also the complex plane here: [`complex`] and [`point`] go to and fro.

use super::{Vec2, cross2, signed_area};
use num_complex::Complex64;

/// The point `p` as a complex number.
pub fn complex(p: Vec2) -> Complex64 {
    Complex64::new(p.x, p.y)
}

/// The complex number `z` as a point.
pub fn point(z: Complex64) -> Vec2 {
    Vec2::new(z.re, z.im)
}

/// The polygon's sides, in order, the closing one last.
pub fn sides(polygon: &[Vec2]) -> impl Iterator<Item = (Vec2, Vec2)> + '_ {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().copied().zip(next.copied())
}

/// Length around \[m\].
pub fn perimeter(polygon: &[Vec2]) -> f64 {
    sides(polygon).map(|(a, b)| (b - a).norm()).sum()
}

/// Centre of the enclosed area; of the corners when there is none.
pub fn centroid(polygon: &[Vec2]) -> Vec2 {
    // About the first corner, so that a far origin costs no digits.
    let origin = polygon[0];
    let area = signed_area(polygon);
    let moment: Vec2 = sides(polygon)
        .map(|(a, b)| (a - origin, b - origin))
        .map(|(a, b)| (a + b) * (cross2(a, b) / 6.0))
        .sum();
    let offset = moment / area;
    if offset.iter().all(|x| x.is_finite()) {
        origin + offset
    } else {
        polygon.iter().sum::<Vec2>() / polygon.len() as f64
    }
}

/// Whether `p` lies inside, by the even–odd rule.
pub fn contains(polygon: &[Vec2], p: Vec2) -> bool {
    sides(polygon)
        .filter(|(a, b)| (a.y > p.y) != (b.y > p.y))
        .filter(|(a, b)| {
            let (low, high) = if a.y < b.y { (*a, *b) } else { (*b, *a) };
            cross2(high - low, p - low) > 0.0
        })
        .count()
        % 2
        == 1
}

/// Whether no side crosses another; sides that merely touch do not cross.
pub fn is_simple(polygon: &[Vec2]) -> bool {
    let sides: Vec<_> = sides(polygon).collect();
    (0..sides.len()).all(|i| (0..i).all(|j| !cross(sides[i], sides[j])))
}

/// Least distance between two segments \[m\].
pub fn distance_of_segments(s: (Vec2, Vec2), t: (Vec2, Vec2)) -> f64 {
    if cross(s, t) {
        return 0.0;
    }
    distance_to_segment(s.0, t)
        .min(distance_to_segment(s.1, t))
        .min(distance_to_segment(t.0, s))
        .min(distance_to_segment(t.1, s))
}

/// Distance from `p` to a segment \[m\].
pub fn distance_to_segment(p: Vec2, (a, b): (Vec2, Vec2)) -> f64 {
    let along = b - a;
    let t = along.dot(&(p - a)) / along.norm_squared().max(f64::MIN_POSITIVE);
    (a + along * t.clamp(0.0, 1.0) - p).norm()
}

/// Whether two segments cross at a point inside both.
fn cross((a, b): (Vec2, Vec2), (c, d): (Vec2, Vec2)) -> bool {
    let apart = |i: usize| a[i].max(b[i]) < c[i].min(d[i]) || c[i].max(d[i]) < a[i].min(b[i]);
    if apart(0) || apart(1) {
        return false;
    }
    let side = |p: Vec2, q: Vec2, r: Vec2| {
        let [p, q, r] = [p, q, r].map(|v| robust::Coord { x: v.x, y: v.y });
        robust::orient2d(p, q, r)
    };
    let opposite = |x: f64, y: f64| (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0);
    opposite(side(a, b, c), side(a, b, d)) && opposite(side(c, d, a), side(c, d, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn polygon(points: &[(f64, f64)]) -> Vec<Vec2> {
        points.iter().map(|&(x, y)| Vec2::new(x, y)).collect()
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
        assert!(contains(&dart, Vec2::new(2.0, 0.5)));
        assert!(!contains(&dart, Vec2::new(2.0, 2.0)));
        assert!(!contains(&dart, Vec2::new(-1.0, 0.0)));
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
}
