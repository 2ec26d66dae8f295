//! Binds points around a source body to it and carries them to the target body.
//!
//! The original binds a point to its closest triangle k and carries it as z = c'_k + R_k (x − c_k). The
//! closest triangle jumps between the legs of a skirt and in armpits, and z with it. Here a point is
//! bound to all the body that faces it from nearby: z = Σ w_k (c'_k + F_k (x − c_k)), with weights that
//! vary smoothly with x, so that the map has no seam between two legs.
//!
//! F_k is how the surface around triangle k deforms, averaged over a few centimetres along the body:
//! along the surface its stretch, across it rotation times what becomes of the ease, e(g), where g is
//! the size ratio of the body there ([`super::ease`]). How the body turns at large, over a
//! reach that knows trunk and limbs but no bulges, is told apart from that.

use super::ease::EaseAt;
use crate::geometry::bvh::Bvh;
use crate::geometry::{Mat3, TriangleMesh, Vec3};

/// Two bodies of one topology, as a map from the space around the first to that around the second.
pub(super) struct BodyMap {
    tree: Bvh,
    /// In the order of the tree.
    pieces: Vec<Piece>,
    /// Half width of the patch under a point on the surface \[m\].
    width: f64,
    /// Groups of triangles that lie together: centre on the source, and moments.
    groups: Vec<(Vec3, Moments)>,
    /// Reach of what the body does at large \[m\].
    reach: f64,
}

/// A triangle of both bodies.
struct Piece {
    area: f64,
    centres: [Vec3; 2],
    normals: [Vec3; 2],
    deformation: Deformation,
}

/// How a patch deforms: `along` + e · `across`, where e is what becomes of distances across it.
struct Deformation {
    along: Mat3,
    across: Mat3,
    /// R.
    turn: Mat3,
    /// ln g.
    growth: f64,
}

/// Second moments of a patch's edges, from which its deformation is fitted.
#[derive(Clone, Copy)]
struct Moments {
    /// Σ e eᵀ of the source's edges e.
    spread: Mat3,
    /// Σ e' eᵀ.
    map: Mat3,
    /// Σ |e'|².
    size_after: f64,
    /// Σ area n' nᵀ.
    turn: Mat3,
}

/// Where a point goes.
#[derive(Clone, Copy)]
pub(super) struct Carried {
    /// Its place around the target body \[m\].
    pub(super) point: Vec3,
    /// Factor of its distance to the body \[–\].
    pub(super) ease: f64,
    /// Unit outward directions of the source and the target body there; zero where there is none.
    pub(super) normals: [Vec3; 2],
    /// How the space around it is turned and stretched.
    pub(super) map: Mat3,
}

/// Patch width on the surface, as a share of the body's height: 2.5 cm on an adult. Narrower follows
/// the body's details, wider is smoother.
const WIDTH: f64 = 0.015;
/// How far what the body does at large reaches, as share of its height: 50 cm on an adult, so that
/// the bulges of a trunk do not count and the turn of an arm does.
const REACH: f64 = 0.3;
/// Groups of triangles that tell what the body does at large, about.
const GROUPS: usize = 2000;
/// How much wider the patch grows per distance from the body.
const SPREAD: f64 = 1.2;
/// Share of the patch's spread below which a direction counts as across the surface.
const THIN: f64 = 0.02;
/// Weight of a piece that faces away from the cloth: only matters where nothing else is near.
const AVERTED: f64 = 1e-6;

impl BodyMap {
    /// Of a source of this `height` \[m\].
    pub(super) fn new(source: &TriangleMesh, target: &TriangleMesh, height: f64) -> Self {
        let corners = |mesh: &TriangleMesh| -> Vec<[Vec3; 3]> {
            (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect()
        };
        let (before, after) = (corners(source), corners(target));
        let area = |[a, b, c]: [Vec3; 3]| 0.5 * (b - a).cross(&(c - a)).norm();
        let mean_area = before.iter().map(|&t| area(t)).sum::<f64>() / before.len() as f64;
        // A patch of a coarse mesh needs some triangles too.
        let width = (WIDTH * height).max(2.5 * mean_area.sqrt());
        // A round of averaging spreads by about the square root of a triangle's area.
        let rounds = (width * width / mean_area).round() as usize;
        let moments = patch_moments(source, &before, &after, rounds.clamp(2, 20));
        let tree = Bvh::new(&before);
        let piece = |&t: &u32| {
            let both = [before[t as usize], after[t as usize]];
            Piece {
                area: area(both[0]),
                centres: both.map(|[a, b, c]| (a + b + c) / 3.0),
                normals: both.map(unit_normal),
                deformation: moments[t as usize].deformation(),
            }
        };
        let pieces = tree.order().iter().map(piece).collect();
        let group = |triangles: &[u32]| {
            let (mut centre, mut sum) = (Vec3::zeros(), Moments::NONE);
            for &t in triangles {
                centre += before[t as usize].iter().sum::<Vec3>() / 3.0;
                sum.add(&moments[t as usize], 1.0);
            }
            (centre / triangles.len() as f64, sum)
        };
        let size = (before.len() / GROUPS).max(1);
        let groups = tree.order().chunks(size).map(group).collect();
        Self {
            tree,
            pieces,
            width,
            groups,
            reach: REACH * height,
        }
    }

    /// How the body around `x` turns at large.
    pub(super) fn turn(&self, x: Vec3) -> Mat3 {
        let mut reach = self.reach;
        loop {
            let mut sum = Moments::NONE;
            for (centre, moments) in &self.groups {
                let nearness = 1.0 - (x - centre).norm_squared() / (reach * reach);
                if nearness > 0.0 {
                    sum.add(moments, nearness * nearness);
                }
            }
            if sum.size_after > 0.0 {
                return sum.deformation().turn;
            }
            reach *= 2.0;
        }
    }

    /// How the whole body turns.
    pub(super) fn turn_of_all(&self) -> Mat3 {
        let mut sum = Moments::NONE;
        for (_, moments) in &self.groups {
            sum.add(moments, 1.0);
        }
        sum.deformation().turn
    }

    /// Carries the point `x` of a cloth that looks along `outward` and is `distance` \[m\] away from
    /// the source body.
    pub(super) fn carry(&self, x: Vec3, outward: Vec3, distance: f64, ease: EaseAt) -> Carried {
        let mut width = self.width + SPREAD * distance.abs();
        loop {
            let patch = self.patch(x, outward, distance.abs(), width);
            if patch.is_empty() {
                width *= 2.0;
                continue;
            }
            let growth: f64 = patch.iter().map(|(w, p)| p.deformation.growth * w).sum();
            let ease = ease.factor(growth);
            let image = |p: &Piece| p.centres[1] + p.deformation.at(ease) * (x - p.centres[0]);
            let normal = |k: usize| {
                let sum: Vec3 = patch.iter().map(|(w, piece)| piece.normals[k] * *w).sum();
                sum.try_normalize(1e-9).unwrap_or_else(Vec3::zeros)
            };
            return Carried {
                point: patch.iter().map(|(w, piece)| image(piece) * *w).sum(),
                ease,
                normals: [normal(0), normal(1)],
                map: patch.iter().map(|(w, p)| p.deformation.at(ease) * *w).sum(),
            };
        }
    }

    /// The pieces that face `x`, with their weights, whose sum is 1.
    fn patch(&self, x: Vec3, outward: Vec3, distance: f64, width: f64) -> Vec<(f64, &Piece)> {
        let squared_radius = distance * distance + width * width;
        let mut patch = Vec::new();
        self.tree.nearest(x, squared_radius, |place, bound| {
            let piece = &self.pieces[place];
            let (offset, normal) = (x - piece.centres[0], piece.normals[0]);
            let nearness = 1.0 - offset.norm_squared() / squared_radius;
            if nearness > 0.0 && piece.area > 0.0 {
                let above = smoothstep(0.5 + offset.dot(&normal) / self.width);
                let alike = smoothstep(0.5 + 0.75 * outward.dot(&normal));
                let facing = above * alike + AVERTED;
                patch.push((piece.area * nearness * nearness * facing, piece));
            }
            bound
        });
        let sum: f64 = patch.iter().map(|(weight, _)| weight).sum();
        for (weight, _) in &mut patch {
            *weight /= sum;
        }
        patch
    }
}

/// Moments of the patch around each triangle: those of its fans, averaged along the body.
fn patch_moments(
    mesh: &TriangleMesh,
    before: &[[Vec3; 3]],
    after: &[[Vec3; 3]],
    rounds: usize,
) -> Vec<Moments> {
    let mut patches: Vec<Moments> = (before.iter().zip(after))
        .map(|(&from, &to)| Moments::of_triangle(from, to))
        .collect();
    for _ in 0..rounds {
        let mut fans = vec![(Moments::NONE, 0.0); mesh.positions.len()];
        for (corners, patch) in mesh.triangles.iter().zip(&patches) {
            for &v in corners {
                let (sum, count) = &mut fans[v as usize];
                sum.add(patch, 1.0);
                *count += 1.0;
            }
        }
        for (corners, patch) in mesh.triangles.iter().zip(&mut patches) {
            *patch = Moments::NONE;
            for &v in corners {
                let (sum, count) = &fans[v as usize];
                patch.add(sum, 1.0 / (3.0 * count));
            }
        }
    }
    patches
}

impl Moments {
    const NONE: Self = Self {
        spread: Mat3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        map: Mat3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        size_after: 0.0,
        turn: Mat3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    fn of_triangle(from: [Vec3; 3], to: [Vec3; 3]) -> Self {
        let mut moments = Self::NONE;
        for k in 0..3 {
            let [e, e_after] = [from, to].map(|corners| corners[(k + 1) % 3] - corners[k]);
            moments.spread += e * e.transpose();
            moments.map += e_after * e.transpose();
            moments.size_after += e_after.norm_squared();
        }
        let area = 0.5 * (from[1] - from[0]).cross(&(from[2] - from[0])).norm();
        moments.turn = unit_normal(to) * unit_normal(from).transpose() * area;
        moments
    }

    fn add(&mut self, other: &Self, weight: f64) {
        self.spread += other.spread * weight;
        self.map += other.map * weight;
        self.size_after += other.size_after * weight;
        self.turn += other.turn * weight;
    }

    /// F = e R + (M − e R S) Q, Q = (S + ε tr S)⁻¹: the stretch M S⁻¹ where the patch extends, e R
    /// across.
    fn deformation(&self) -> Deformation {
        let size = self.spread.trace();
        let growth = (self.size_after / size).sqrt();
        if !(growth.is_finite() && growth > 0.0) {
            return Deformation {
                along: Mat3::zeros(),
                across: Mat3::identity(),
                turn: Mat3::identity(),
                growth: 0.0,
            };
        }
        let turn = rotation_of(self.map / growth + self.turn);
        let resistance = self.spread + Mat3::identity() * (THIN * size);
        let inverse = resistance.try_inverse().unwrap_or_else(Mat3::zeros);
        Deformation {
            along: self.map * inverse,
            across: turn * (Mat3::identity() - self.spread * inverse),
            turn,
            growth: growth.ln(),
        }
    }
}

impl Deformation {
    /// F, where distances across the surface change by the factor `ease`.
    fn at(&self, ease: f64) -> Mat3 {
        self.along + self.across * ease
    }
}

fn unit_normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    let normal = (b - a).cross(&(c - a));
    normal.try_normalize(0.0).unwrap_or_else(Vec3::zeros)
}

/// The rotation closest to `m`.
pub(super) fn rotation_of(m: Mat3) -> Mat3 {
    let svd = m.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Mat3::identity();
    };
    let mut upright = Mat3::identity();
    upright[(2, 2)] = (u.determinant() * v_t.determinant()).signum();
    u * upright * v_t
}

/// 0 below 0, 1 above 1, smooth between.
pub(super) fn smoothstep(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::super::ease::Ease;
    use super::*;
    use crate::check::noise;
    use crate::geometry::closest_point::tests::sphere;

    fn point(i: usize) -> Vec3 {
        Vec3::new(noise(5 * i), noise(7 * i + 1), noise(11 * i + 2))
    }

    /// Two spheres side by side, as legs.
    fn pair(gap: f64) -> TriangleMesh {
        let mut mesh = sphere(0.1, 3);
        let half = mesh.positions.len();
        mesh.triangles.extend_from_within(..);
        let middle = mesh.triangles.len() / 2;
        for t in &mut mesh.triangles[middle..] {
            *t = t.map(|v| v + half as u32);
        }
        mesh.positions.extend_from_within(..);
        for (v, p) in mesh.positions.iter_mut().enumerate() {
            p.x += (0.1 + 0.5 * gap) * if v < half { -1.0 } else { 1.0 };
        }
        mesh
    }

    #[test]
    fn a_similarity_of_the_body_is_a_similarity_of_the_space_around() {
        let body = sphere(0.3, 3);
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, 2.0, -0.7);
        for (scale, ease) in [(1.0_f64, Ease::Absolute), (1.3, Ease::Relative)] {
            let move_ = |p: &Vec3| turn * p * scale + Vec3::new(1.0, 2.0, 3.0);
            let mut target = body.clone();
            target.positions = body.positions.iter().map(move_).collect();
            let map = BodyMap::new(&body, &target, 0.6);
            for i in 0..50 {
                let x = point(i);
                let carried = map.carry(x, x.normalize(), x.norm() - 0.3, ease.into());
                // Rounding of a 3 × 3 system of condition 1 / THIN.
                assert!((carried.point - move_(&x)).norm() < 1e-12);
                assert!((carried.ease - scale).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn ease_in_metres_survives_a_larger_body() {
        let body = sphere(0.3, 4);
        let map = BodyMap::new(&body, &sphere(0.36, 4), 0.6);
        for i in 0..50 {
            let direction = point(i).normalize();
            let ease = Ease::Absolute.into();
            let carried = map.carry(direction * 0.31, direction, 0.01, ease).point;
            // The patch is a cap 7 cm wide that sags by 7²/(2·30) = 0.8 cm, a fifth more on the
            // larger ball.
            let error = (carried - direction * 0.37).norm();
            assert!(error < 1.6e-3, "{error:e}");
        }
    }

    #[test]
    fn nothing_tears_between_two_legs() {
        let map = BodyMap::new(&pair(0.02), &pair(0.08), 0.42);
        let carried: Vec<Vec3> = (0..=400)
            .map(|i| Vec3::new(0.2 * f64::from(i) / 400.0 - 0.1, 0.0, 0.13))
            .map(|x| {
                let distance = x.z.hypot(x.x.abs() - 0.11) - 0.1;
                map.carry(x, Vec3::z(), distance, Ease::Absolute.into())
                    .point
            })
            .collect();
        for pair in carried.windows(2) {
            // Steps of 0.5 mm over a gap that opens from 2 to 8 cm: fourfold at best.
            let step = pair[1] - pair[0];
            assert!(step.norm() < 4e-3 && step.x > 0.0, "{step}");
        }
    }
}
