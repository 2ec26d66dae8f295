//! The three curve kinds of a panel edge, with their lengths and equal-arc-length samples.
//!
//! Control points are absolute, in the panel's plane \[m\]; files that give them relative to the
//! edge are converted when read.

use crate::geometry::{Vec2, cross2};

/// What runs between the two end points of an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Curve {
    /// Straight.
    Line,
    /// Quadratic Bézier with one control point \[m\].
    Quadratic(Vec2),
    /// Cubic Bézier with two control points \[m\].
    Cubic([Vec2; 2]),
    /// Circular arc, in SVG's end-point form.
    Arc {
        /// \[m\]; enlarged to half the chord when smaller, as SVG does.
        radius: f64,
        /// Takes the longer way round.
        large: bool,
        /// Runs counter-clockwise about its centre (y up).
        counter_clockwise: bool,
    },
}

/// Intervals of the table by which Béziers are measured and cut; each is integrated by a 5-point
/// Gauss rule, so lengths are good to about 1e-12 of the edge.
const INTERVALS: usize = 64;

/// Abscissae and weights of 5-point Gauss–Legendre quadrature on (−1, 1).
const GAUSS: [(f64, f64); 5] = [
    (0.0, 0.568_888_888_888_888_9),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

impl Curve {
    /// Point at parameter `t` in 0..=1 of the curve from `a` to `b`.
    pub fn point(&self, a: Vec2, b: Vec2, t: f64) -> Vec2 {
        let s = 1.0 - t;
        match *self {
            Self::Line => a * s + b * t,
            Self::Quadratic(c) => a * (s * s) + c * (2.0 * s * t) + b * (t * t),
            Self::Cubic([c, d]) => {
                a * (s * s * s) + c * (3.0 * s * s * t) + d * (3.0 * s * t * t) + b * (t * t * t)
            }
            Self::Arc { .. } => {
                let arc = self.arc(a, b);
                let angle = arc.start + t * arc.sweep;
                arc.centre + Vec2::new(angle.cos(), angle.sin()) * arc.radius
            }
        }
    }

    /// Derivative of [`Self::point`] by `t`.
    pub fn velocity(&self, a: Vec2, b: Vec2, t: f64) -> Vec2 {
        let s = 1.0 - t;
        match *self {
            Self::Line => b - a,
            Self::Quadratic(c) => (c - a) * (2.0 * s) + (b - c) * (2.0 * t),
            Self::Cubic([c, d]) => {
                (c - a) * (3.0 * s * s) + (d - c) * (6.0 * s * t) + (b - d) * (3.0 * t * t)
            }
            Self::Arc { .. } => {
                let arc = self.arc(a, b);
                let angle = arc.start + t * arc.sweep;
                Vec2::new(-angle.sin(), angle.cos()) * (arc.radius * arc.sweep)
            }
        }
    }

    /// Length \[m\].
    pub fn length(&self, a: Vec2, b: Vec2) -> f64 {
        match self {
            Self::Line => (b - a).norm(),
            Self::Arc { .. } => {
                let arc = self.arc(a, b);
                arc.radius * arc.sweep.abs()
            }
            _ => self.table(a, b)[INTERVALS],
        }
    }

    /// `pieces + 1` points at equal arc length, ends included exactly.
    pub fn sample(&self, a: Vec2, b: Vec2, pieces: usize) -> Vec<Vec2> {
        let uniform = matches!(self, Self::Line | Self::Arc { .. });
        let table = if uniform {
            Vec::new()
        } else {
            self.table(a, b)
        };
        let mut points = vec![a];
        for i in 1..pieces {
            let fraction = i as f64 / pieces as f64;
            let t = if uniform {
                fraction
            } else {
                self.parameter(a, b, &table, fraction * table[INTERVALS])
            };
            points.push(self.point(a, b, t));
        }
        points.push(b);
        points
    }

    /// The same curve run from its end to its start.
    #[must_use]
    pub fn reversed(&self) -> Self {
        match *self {
            Self::Cubic([c, d]) => Self::Cubic([d, c]),
            Self::Arc {
                radius,
                large,
                counter_clockwise,
            } => Self::Arc {
                radius,
                large,
                counter_clockwise: !counter_clockwise,
            },
            same => same,
        }
    }

    /// Arc length up to the end of each interval, starting with 0.
    fn table(&self, a: Vec2, b: Vec2) -> Vec<f64> {
        let mut lengths = vec![0.0];
        let mut sum = 0.0;
        for i in 0..INTERVALS {
            sum += self.stretch(
                a,
                b,
                i as f64 / INTERVALS as f64,
                (i + 1) as f64 / INTERVALS as f64,
            );
            lengths.push(sum);
        }
        lengths
    }

    /// Arc length between two parameters.
    fn stretch(&self, a: Vec2, b: Vec2, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let rate = |x: f64| self.velocity(a, b, middle + half * x).norm();
        half * GAUSS.iter().map(|(x, w)| w * rate(*x)).sum::<f64>()
    }

    /// Parameter at arc length `s`: bisection inside the table's interval, polished by Newton.
    fn parameter(&self, a: Vec2, b: Vec2, table: &[f64], s: f64) -> f64 {
        let i = table.partition_point(|l| *l < s).clamp(1, INTERVALS) - 1;
        let from = i as f64 / INTERVALS as f64;
        let width = 1.0 / INTERVALS as f64;
        let inside = (table[i + 1] - table[i]).max(f64::MIN_POSITIVE);
        let mut t = from + width * ((s - table[i]) / inside).clamp(0.0, 1.0);
        for _ in 0..4 {
            let rate = self.velocity(a, b, t).norm();
            if rate > 0.0 {
                let error = table[i] + self.stretch(a, b, from, t) - s;
                t = (t - error / rate).clamp(from, from + width);
            }
        }
        t
    }

    /// Centre form of an arc; a chord of no length gives a point.
    fn arc(&self, a: Vec2, b: Vec2) -> CentredArc {
        let &Self::Arc {
            radius,
            large,
            counter_clockwise,
        } = self
        else {
            unreachable!("asked only of arcs");
        };
        let chord = b - a;
        let half = 0.5 * chord.norm();
        let radius = radius.abs().max(half);
        let offset = (radius * radius - half * half).max(0.0).sqrt();
        // The centre lies left of the chord for the short counter-clockwise arc.
        let side = if large == counter_clockwise {
            -1.0
        } else {
            1.0
        };
        let left = Vec2::new(-chord.y, chord.x)
            .try_normalize(0.0)
            .unwrap_or_else(Vec2::zeros);
        let centre = (a + b) * 0.5 + left * (side * offset);
        let (u, v) = (a - centre, b - centre);
        let mut sweep = cross2(u, v).atan2(u.dot(&v));
        if counter_clockwise && sweep < 0.0 {
            sweep += std::f64::consts::TAU;
        } else if !counter_clockwise && sweep > 0.0 {
            sweep -= std::f64::consts::TAU;
        }
        CentredArc {
            centre,
            radius,
            start: u.y.atan2(u.x),
            sweep,
        }
    }
}

/// The point that lies at `c` of the edge from `a` to `b`: (0, 0) is `a`, (1, 0) is `b`, and the
/// second coordinate runs to the left of the edge, in lengths of the chord.
pub fn from_edge(c: Vec2, a: Vec2, b: Vec2) -> Vec2 {
    let along = b - a;
    a + along * c.x + Vec2::new(-along.y, along.x) * c.y
}

/// Inverse of [`from_edge`]; `a` and `b` must differ.
pub fn relative_to_edge(p: Vec2, a: Vec2, b: Vec2) -> Vec2 {
    let (along, offset) = (b - a, p - a);
    let left = Vec2::new(-along.y, along.x);
    Vec2::new(offset.dot(&along), offset.dot(&left)) / along.norm_squared()
}

/// An arc by its centre; angles in radians, positive counter-clockwise.
struct CentredArc {
    centre: Vec2,
    radius: f64,
    start: f64,
    sweep: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use std::f64::consts::PI;

    const A: Vec2 = Vec2::new(0.0, 0.0);
    const B: Vec2 = Vec2::new(0.2, 0.0);

    #[test]
    fn a_small_counter_clockwise_arc_bulges_to_the_right() {
        let arc = Curve::Arc {
            radius: 0.2,
            large: false,
            counter_clockwise: true,
        };
        assert!(arc.point(A, B, 0.5).y < 0.0);
        // Chord equal to the radius: a sixth of the circle.
        assert_relative_eq!(arc.length(A, B), 0.2 * PI / 3.0, epsilon = 1e-12);
    }

    #[test]
    fn the_large_arc_is_the_rest_of_the_circle() {
        let arc = Curve::Arc {
            radius: 0.2,
            large: true,
            counter_clockwise: true,
        };
        assert_relative_eq!(arc.length(A, B), 0.2 * PI * 5.0 / 3.0, epsilon = 1e-12);
        assert_relative_eq!(arc.point(A, B, 0.0), A, epsilon = 1e-12);
        assert_relative_eq!(arc.point(A, B, 1.0), B, epsilon = 1e-12);
    }

    #[test]
    fn samples_are_equally_far_apart_along_the_curve() {
        let cubic = Curve::Cubic([Vec2::new(0.3, 0.1), Vec2::new(-0.05, 0.12)]);
        let length = cubic.length(A, B);
        let fine = cubic.sample(A, B, 4000);
        let chords = |points: &[Vec2]| points.windows(2).map(|w| (w[1] - w[0]).norm()).sum::<f64>();
        assert_relative_eq!(chords(&fine), length, max_relative = 1e-6);
        // Every 400th of the fine samples is a sample of the coarse ones.
        for (i, p) in cubic.sample(A, B, 10).iter().enumerate() {
            assert_relative_eq!(*p, fine[400 * i], epsilon = 1e-9);
        }
    }

    #[test]
    fn a_reversed_curve_covers_the_same_points() {
        for curve in [
            Curve::Quadratic(Vec2::new(0.05, 0.1)),
            Curve::Cubic([Vec2::new(0.3, 0.1), Vec2::new(-0.05, 0.12)]),
            Curve::Arc {
                radius: 0.15,
                large: true,
                counter_clockwise: false,
            },
        ] {
            assert_relative_eq!(
                curve.point(A, B, 0.3),
                curve.reversed().point(B, A, 0.7),
                epsilon = 1e-12
            );
        }
    }
}
