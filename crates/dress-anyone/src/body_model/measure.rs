//! A tailor's measurements of a fitted body, standing upright: ankles below the hip joints, arms half
//! down. Legs astride would widen the hip by two centimetres and cost one of height.
//!
//! Girths are those of a tape held tight: the convex hull of a plane section through the parts of
//! the body that are meant, so arms do not count to the bust. Which plane or path is in the table of
//! [`measure`], and with every result.

use super::skeleton::{ANKLES, ELBOWS, HEAD, HIPS, KNEES, NECK, SHOULDERS, WRISTS};
use super::{BodyModel, Part, Pose, Shape};
use crate::geometry::{TriangleMesh, Vec2, Vec3, bounds, cross2};
use serde::Serialize;

/// One measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measurement {
    /// What a tailor calls it.
    pub name: &'static str,
    /// \[m\].
    pub length: f64,
    /// How it was taken.
    pub how: &'static str,
}

/// Planes tried where the largest or smallest girth is looked for.
const PLANES: usize = 25;

/// The measurements of a shape with offsets.
pub fn measure(model: &BodyModel, shape: &Shape, offsets: &[Vec3]) -> Vec<Measurement> {
    let posed = model.posed(shape, &upright(model, shape), offsets);
    let body = Standing {
        mesh: TriangleMesh {
            positions: posed.positions.clone(),
            triangles: model.parts().template.triangles.clone(),
        },
        parts: model.parts_of_vertices(),
        joints: posed.heads(),
    };
    let joint = |j: usize| body.joints[j];
    let (low, high) = bounds(&body.mesh.positions);
    let height = high.y - low.y;
    let trunk = [Part::Trunk];
    let level = |y: f64| (Vec3::new(0.0, y, 0.0), Vec3::y());
    let girth_at = |y: f64, parts: &[Part]| body.girth(level(y), parts);
    let between = |from: f64, to: f64| {
        (0..PLANES).map(move |i| from + (to - from) * i as f64 / (PLANES - 1) as f64)
    };

    let (chest, armpits) = (joint(SPINE3).y, joint(SHOULDERS[0]).y);
    let bust_line = body.foremost(
        chest + 0.4 * (armpits - chest),
        chest + 0.6 * (armpits - chest),
    );
    let (_, waist) = smallest(between(joint(SPINE1).y + 0.02, chest + 0.02), |y| {
        girth_at(y, &trunk)
    });
    let hip_joint = joint(HIPS[0]).y;
    let lower = [Part::Trunk, Part::LeftLeg, Part::RightLeg];
    let (_, hip) = largest(between(0.94 * hip_joint, 1.05 * hip_joint), |y| {
        girth_at(y, &lower)
    });
    let crotch = body.crotch(0.5 * (joint(HIPS[0]).x + joint(HIPS[1]).x));
    let limb = |from: usize, to: usize, share: f64, parts: &[Part]| {
        let axis = joint(to) - joint(from);
        body.girth((joint(from) + axis * share, axis.normalize()), parts)
    };
    let along = |from: usize, to: usize| (joint(to) - joint(from)).norm();
    let throat = [Part::Neck, Part::Head];
    let (_, neck) = smallest(between(0.2, 0.8), |t| limb(NECK, HEAD, t, &throat));
    let leg = [Part::LeftLeg];
    let (_, calf) = largest(between(0.1, 0.7), |t| limb(KNEES[0], ANKLES[0], t, &leg));
    let arm = [Part::LeftArm];
    let sleeve = along(SHOULDERS[0], ELBOWS[0]) + along(ELBOWS[0], WRISTS[0]);
    let table = [
        ("height", height, "sole to crown"),
        (
            "bust",
            girth_at(bust_line, &trunk),
            "level girth of the trunk through the foremost point of the chest",
        ),
        (
            "underbust",
            girth_at(bust_line - BELOW_BUST * height, &trunk),
            "level girth of the trunk 4.5 % of the height below the bust",
        ),
        (
            "waist",
            waist,
            "smallest level girth of the trunk between pelvis and chest",
        ),
        ("hip", hip, "largest level girth about the hip joints"),
        (
            "inseam",
            crotch - low.y,
            "floor to crotch, in the middle plane",
        ),
        ("sleeve", sleeve, "shoulder joint over elbow to wrist"),
        (
            "shoulders",
            along(SHOULDERS[0], SHOULDERS[1]),
            "between the shoulder joints",
        ),
        ("neck", neck, "smallest girth across the neck's axis"),
        (
            "upper arm",
            limb(SHOULDERS[0], ELBOWS[0], 0.45, &arm),
            "girth across the left upper arm, near its middle",
        ),
        (
            "wrist",
            limb(ELBOWS[0], WRISTS[0], 0.95, &[Part::LeftArm, Part::LeftHand]),
            "girth across the left forearm at the wrist",
        ),
        (
            "thigh",
            girth_at(crotch - 0.02 * height, &leg),
            "level girth of the left thigh 2 % of the height below the crotch",
        ),
        (
            "knee",
            girth_at(joint(KNEES[0]).y, &leg),
            "level girth of the left leg at the knee",
        ),
        ("calf", calf, "largest girth across the left lower leg"),
    ];
    let row = |(name, length, how)| Measurement { name, length, how };
    table.into_iter().map(row).collect()
}

const SPINE1: usize = 3;
const SPINE3: usize = 9;
/// The underbust lies this share of the height below the bust.
const BELOW_BUST: f64 = 0.045;

/// The canonical A-pose with the legs turned sideways until they are vertical.
fn upright(model: &BodyModel, shape: &Shape) -> Pose {
    let mut pose = model.arms_at(std::f64::consts::FRAC_PI_4);
    let joints = model.joints(shape);
    for side in 0..2 {
        let leg = joints[ANKLES[side]] - joints[HIPS[side]];
        let turn = Vec3::new(0.0, 0.0, -leg.x.atan2(-leg.y));
        pose.rotations[HIPS[side]] = turn;
        pose.rotations[ANKLES[side]] = -turn;
    }
    pose
}

/// Where `value` is largest among `places`, and what it is there.
fn largest(places: impl Iterator<Item = f64>, value: impl Fn(f64) -> f64) -> (f64, f64) {
    let pairs = places.map(|place| (place, value(place)));
    pairs.fold(
        (f64::NAN, 0.0),
        |best, pair| if pair.1 > best.1 { pair } else { best },
    )
}

/// Where `value` is smallest and not zero among `places`, and what it is there; 0 if nowhere.
fn smallest(places: impl Iterator<Item = f64>, value: impl Fn(f64) -> f64) -> (f64, f64) {
    let pairs = places
        .map(|place| (place, value(place)))
        .filter(|(_, girth)| *girth > 0.0);
    let least = pairs.reduce(|best, pair| if pair.1 < best.1 { pair } else { best });
    least.unwrap_or((f64::NAN, 0.0))
}

/// A body ready to be measured.
struct Standing {
    mesh: TriangleMesh,
    parts: Vec<Part>,
    joints: Vec<Vec3>,
}

impl Standing {
    /// Length of a tight tape around the section of these parts with a plane (point, unit normal).
    fn girth(&self, plane: (Vec3, Vec3), parts: &[Part]) -> f64 {
        let wanted = |t: &&[u32; 3]| t.iter().all(|v| parts.contains(&self.parts[*v as usize]));
        let points = self.section(plane, self.mesh.triangles.iter().filter(wanted));
        let (_, normal) = plane;
        let across = if normal.x.abs() < 0.9 {
            Vec3::x()
        } else {
            Vec3::z()
        };
        let u = normal.cross(&across).normalize();
        let v = normal.cross(&u);
        hull_length(
            points
                .iter()
                .map(|p| Vec2::new(u.dot(p), v.dot(p)))
                .collect(),
        )
    }

    /// Height of the trunk's foremost vertex between two heights; their middle when there is none.
    fn foremost(&self, from: f64, to: f64) -> f64 {
        let trunk = |(_, part): &(&Vec3, &Part)| **part == Part::Trunk;
        let vertices = self.mesh.positions.iter().zip(&self.parts).filter(trunk);
        let between = vertices.filter(|(p, _)| (from..to).contains(&p.y));
        let foremost = between.max_by(|(a, _), (b, _)| a.z.total_cmp(&b.z));
        foremost.map_or(0.5 * (from + to), |(p, _)| p.y)
    }

    /// Height of the lowest point of the body in its middle plane.
    fn crotch(&self, middle: f64) -> f64 {
        let plane = (Vec3::new(middle, 0.0, 0.0), Vec3::x());
        let points = self.section(plane, self.mesh.triangles.iter());
        points.iter().map(|p| p.y).fold(f64::INFINITY, f64::min)
    }

    /// Where the edges of these triangles meet a plane.
    fn section<'a>(
        &self,
        (point, normal): (Vec3, Vec3),
        triangles: impl Iterator<Item = &'a [u32; 3]>,
    ) -> Vec<Vec3> {
        let mut points = Vec::new();
        for t in triangles {
            let corners = t.map(|v| self.mesh.positions[v as usize]);
            let heights = corners.map(|p| normal.dot(&(p - point)));
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                if (heights[i] < 0.0) != (heights[j] < 0.0) {
                    let share = heights[i] / (heights[i] - heights[j]);
                    points.push(corners[i] + (corners[j] - corners[i]) * share);
                }
            }
        }
        points
    }
}

/// Perimeter of the convex hull (Andrew's monotone chain).
fn hull_length(mut points: Vec<Vec2>) -> f64 {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let chain = |points: &mut dyn Iterator<Item = Vec2>| {
        let mut hull: Vec<Vec2> = Vec::new();
        for p in points {
            while let [.., a, b] = hull.as_slice()
                && cross2(b - a, p - a) <= 0.0
            {
                hull.pop();
            }
            hull.push(p);
        }
        hull.windows(2).map(|e| (e[1] - e[0]).norm()).sum::<f64>()
    };
    chain(&mut points.iter().copied()) + chain(&mut points.iter().rev().copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::body_model::built_in;

    fn value(measurements: &[Measurement], name: &str) -> f64 {
        measurements.iter().find(|m| m.name == name).unwrap().length
    }

    #[test]
    fn the_hull_of_a_dented_square_is_the_squares() {
        let corners = [
            [0.0, 0.0],
            [2.0, 0.0],
            [2.0, 2.0],
            [0.0, 2.0],
            [1.0, 0.5],
            [1.0, 1.0],
        ];
        let length = hull_length(corners.map(|[x, y]| Vec2::new(x, y)).to_vec());
        assert!((length - 8.0).abs() < 1e-12);
        assert_eq!(hull_length(Vec::new()), 0.0);
    }

    #[test]
    fn a_body_twice_as_large_measures_twice_as_much() {
        let model = built_in();
        let mut shape = model.mean_shape();
        let one = measure(&model, &shape, &[]);
        shape.scale = 2.0;
        let two = measure(&model, &shape, &[]);
        for (a, b) in one.iter().zip(&two) {
            // The search for waist and bust keeps 2 cm of margin that does not scale.
            assert!((b.length / a.length - 2.0).abs() < 0.02, "{}", a.name);
        }
    }

    #[test]
    fn the_mean_body_has_a_persons_proportions() {
        let model = built_in();
        let m = measure(&model, &model.mean_shape(), &[]);
        let v = |name| value(&m, name);
        // Waist, bust and hip in the order of any grown-up of average build; limbs as ANSUR II's
        // 1st to 99th percentiles of both sexes, in shares of the height.
        assert!(v("waist") < v("bust") && v("underbust") < v("bust") && v("waist") < v("hip"));
        for (name, range) in [
            ("inseam", 0.40..0.52),
            ("sleeve", 0.27..0.36),
            ("neck", 0.17..0.26),
            ("wrist", 0.08..0.11),
            ("thigh", 0.28..0.42),
            ("calf", 0.18..0.26),
        ] {
            let share = v(name) / v("height");
            assert!(range.contains(&share), "{name}: {share}");
        }
    }
}
