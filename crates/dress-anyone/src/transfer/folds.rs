//! Folds that are pushed through each other: where the body shrinks more than a skirt's folds have room for,
//! holding cloth to its place along the body takes layers through one another that were apart. There it is let go
//! ([`super::hold::Firmness::let_go`]), again and again, until they are.
//!
//! What meets all the same in the end, and the legs of trousers between thighs that touch, is drawn apart along the
//! direction in which it lay apart in the drape, in turns with taking the cloth out of the body.

use super::clear::Clearing;
use crate::geometry::intersections::within;
use crate::geometry::{Mat3, Vec3};
use std::collections::BTreeSet;

/// What goes through itself in the source drape already, and the mesh of the cloth.
pub(super) struct Folds<'a> {
    drape: &'a [Vec3],
    triangles: &'a [[u32; 3]],
    rings: &'a [Vec<u32>],
    before: BTreeSet<[u32; 2]>,
}

/// Edges around two triangles that meet over which cloth is let go: as wide as a fold is deep.
const AROUND: usize = 4;
/// Times that what meets is drawn apart and the cloth taken out of the body.
const PARTINGS: usize = 6;
/// Most rounds of drawing apart at a time.
const ROUNDS: usize = 16;
/// Rounds after which steps have doubled.
const PATIENCE: usize = 8;
/// Farthest that cloth is drawn, in first steps: 1 cm on an adult.
const FARTHEST: f64 = 20.0;
/// Part of its least distance to the body that is left to what met, each time: there is no room for two layers.
const CROWDED: f64 = 0.5;
/// Power of the gap by which directions that part two triangles count: the widest decides, and two that are as wide
/// do so together.
const SHARP: i32 = 8;

impl<'a> Folds<'a> {
    /// Of the cloth `drape`.
    pub(super) fn new(drape: &'a [Vec3], triangles: &'a [[u32; 3]], rings: &'a [Vec<u32>]) -> Self {
        Self {
            drape,
            triangles,
            rings,
            before: within(drape, triangles).into_iter().collect(),
        }
    }

    /// Vertices around the triangles that meet in `x` and did not in the drape.
    pub(super) fn around_meetings(&self, x: &[Vec3]) -> BTreeSet<u32> {
        let pairs = self.pairs(x);
        let meeting = pairs.iter().flatten();
        let meeting = meeting.flat_map(|t| self.triangles[*t as usize]);
        let mut around: BTreeSet<u32> = meeting.collect();
        for _ in 0..AROUND {
            let rings = around.iter().flat_map(|v| &self.rings[*v as usize]);
            let wider: Vec<u32> = rings.copied().collect();
            around.extend(wider);
        }
        around
    }

    /// Draws apart what meets in `x`, in a space that the body turns by `turns`, and takes the cloth out of the
    /// body: `x` becomes the state in which least meets.
    pub(super) fn draw_apart(
        &self,
        x: &mut Vec<Vec3>,
        turns: &[Mat3],
        (clearing, least): (&Clearing<'_>, &mut [f64]),
    ) {
        let mut fewest = self.meetings(x);
        let (start, mut tried) = (x.clone(), x.clone());
        for _ in 0..PARTINGS {
            if fewest == 0 {
                break;
            }
            let mut crowded = BTreeSet::new();
            for round in 0..ROUNDS {
                let step = clearing.step * (1 + round / PATIENCE) as f64;
                let met = self.draw(&mut tried, turns, step, clearing);
                if met.is_empty() {
                    break;
                }
                let met = met.iter().flatten();
                crowded.extend(met.flat_map(|t| self.triangles[*t as usize]));
                for (x, start) in tried.iter_mut().zip(&start) {
                    *x = start + (*x - start).cap_magnitude(FARTHEST * clearing.step);
                }
            }
            for v in crowded {
                least[v as usize] *= CROWDED;
            }
            clearing.clear(&mut tried, least);
            let left = self.meetings(&tried);
            if left < fewest {
                fewest = left;
                x.clone_from(&tried);
            }
        }
    }

    /// One step of drawing apart what meets, which it gives back.
    fn draw(
        &self,
        x: &mut [Vec3],
        turns: &[Mat3],
        step: f64,
        clearing: &Clearing<'_>,
    ) -> Vec<[u32; 2]> {
        let pairs = self.pairs(x);
        let mut sums = vec![(Vec3::zeros(), 0.0); x.len()];
        for pair in &pairs {
            let pair = pair.map(|t| self.triangles[t as usize]);
            let [before, after] = [self.drape, x].map(|x| pair.map(|t| t.map(|v| x[v as usize])));
            let turn: Mat3 = pair.iter().flatten().map(|v| turns[*v as usize]).sum();
            let across = turn * parting(before);
            let across = across.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
            let overlap = reach(after[0], across)[1] - reach(after[1], across)[0];
            let way = across * (0.5 * overlap + 0.1 * step).min(step);
            for (t, way) in pair.iter().zip([-way, way]) {
                for v in t {
                    let (sum, count) = &mut sums[*v as usize];
                    *sum += way;
                    *count += 1.0;
                }
            }
        }
        let mean = |(sum, count): &(Vec3, f64)| sum / f64::max(*count, 1.0);
        let pushes: Vec<Vec3> = sums.iter().map(mean).collect();
        clearing.spread(x, &pushes, 0.5);
        pairs
    }

    /// How many pairs of triangles meet in `x` and did not in the drape.
    pub(super) fn meetings(&self, x: &[Vec3]) -> usize {
        self.pairs(x).len()
    }

    /// Those pairs.
    fn pairs(&self, x: &[Vec3]) -> Vec<[u32; 2]> {
        let mut pairs = within(x, self.triangles);
        pairs.retain(|pair| !self.before.contains(pair));
        pairs
    }
}

/// The direction along which the second of two triangles lies beyond the first, or zero where it does not: the mean
/// of those at right angles to a side of each or to one of them, by far most of that along which the gap is widest.
fn parting([s, t]: [[Vec3; 3]; 2]) -> Vec3 {
    let sides = |t: [Vec3; 3]| [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
    let [of_s, of_t] = [s, t].map(sides);
    let crossed = of_s.iter().flat_map(|a| of_t.map(|b| a.cross(&b)));
    let normals = [of_s, of_t].map(|sides| sides[0].cross(&sides[1]));
    let units = (crossed.chain(normals)).filter_map(|across| across.try_normalize(1e-12));
    let both = units.flat_map(|unit| [unit, -unit]);
    let gap = |across: Vec3| (reach(t, across)[0] - reach(s, across)[1], across);
    let gaps: Vec<(f64, Vec3)> = both.map(gap).filter(|(gap, _)| *gap > 0.0).collect();
    let widest = gaps.iter().map(|(gap, _)| *gap).fold(0.0, f64::max);
    let weighed = gaps
        .iter()
        .map(|(gap, across)| across * (gap / widest).powi(SHARP));
    weighed.sum()
}

/// The least and the largest height of a triangle along `across`.
fn reach(t: [Vec3; 3], across: Vec3) -> [f64; 2] {
    let heights = t.map(|p| across.dot(&p));
    [
        heights.into_iter().fold(f64::INFINITY, f64::min),
        heights.into_iter().fold(f64::NEG_INFINITY, f64::max),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closest_point::tests::sphere;
    use crate::geometry::mesh::rings;
    use crate::geometry::{ClosestPoint, TriangleMesh};

    /// Two balls beside each other, no mirror images, `way` \[m\] apart.
    fn balls(way: f64) -> TriangleMesh {
        let ball = sphere(0.1, 4);
        let count = ball.positions.len() as u32;
        let moved = |p: &Vec3| p + Vec3::new(way, 3e-3, 1e-3);
        let moved: Vec<Vec3> = ball.positions.iter().map(moved).collect();
        let other = ball.triangles.iter().map(|t| t.map(|v| v + count));
        TriangleMesh {
            positions: ball.positions.iter().copied().chain(moved).collect(),
            triangles: ball.triangles.iter().copied().chain(other).collect(),
        }
    }

    #[test]
    fn what_meets_is_drawn_apart_the_way_it_lay() {
        let drape = balls(0.21);
        let rings = rings(drape.positions.len(), &drape.triangles);
        let folds = Folds::new(&drape.positions, &drape.triangles, &rings);
        // A body that is out of the way.
        let skin = sphere(1e-3, 1);
        let body = ClosestPoint::new(&skin);
        let count = drape.positions.len();
        let homes = vec![Vec3::zeros(); count];
        let clearing = Clearing::new(&body, &skin, &drape.triangles, &rings, homes, 5e-4);
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, 0.4, 0.5);
        let put = |p: Vec3| turn * p;
        let met: Vec<Vec3> = balls(0.198).positions.into_iter().map(put).collect();
        let mut x = met.clone();
        assert!(!folds.around_meetings(&x).is_empty());
        let turns = vec![*turn.matrix(); count];
        folds.draw_apart(&mut x, &turns, (&clearing, &mut vec![0.0; count]));
        assert!(folds.around_meetings(&x).is_empty());
        // They overlap by 2 mm, a millimetre for each, and move along the line between them.
        let axis = put(Vec3::x());
        for (v, (x, met)) in x.iter().zip(&met).enumerate() {
            let way = (x - met) * if v < count / 2 { -1.0 } else { 1.0 };
            assert!(way.norm() < 2e-3, "{way}");
            assert!(way.dot(&axis) >= 0.7 * way.norm(), "{way}");
        }
    }

    #[test]
    fn what_meets_is_found_with_what_is_around_it_unless_it_met_before() {
        let TriangleMesh {
            positions: drape,
            triangles,
        } = balls(0.21);
        let count = drape.len() / 2;
        let apart = |way: f64| balls(way).positions;
        let rings = rings(2 * count, &triangles);
        let folds = Folds::new(&drape, &triangles, &rings);
        assert!(folds.around_meetings(&apart(0.205)).is_empty());
        let x = apart(0.198);
        let found = folds.around_meetings(&x);
        assert!(found.iter().any(|v| (*v as usize) < count));
        assert!(found.iter().any(|v| (*v as usize) >= count));
        // They meet in a circle of 1.4 cm; edges are up to 9 mm long, five of them 4.5 cm.
        let farthest = |v: &u32| x[*v as usize].yz().norm();
        let farthest = found.iter().map(farthest).fold(0.0, f64::max);
        assert!((0.02..0.065).contains(&farthest), "{farthest}");
        let folds = Folds::new(&x, &triangles, &rings);
        assert!(folds.around_meetings(&x).is_empty());
    }
}
