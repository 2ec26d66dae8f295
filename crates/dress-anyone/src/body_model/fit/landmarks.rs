//! Landmarks: places on a body that its owner names, as far as shape and pose are fitted.
//!
//! Each adds w ‖x − y‖² to the mean of the squared distances: x is the model's joint or surface point,
//! y where it is said to be. w falls with the reach of the rounds, so landmarks tell how a body stands
//! and the surface has the last word. Geman–McClure's weight lets go of those a little wrong; those
//! grossly wrong mislead, and are told.

use super::super::pose::{Jacobian, Posed};
use super::super::skeleton::{ANKLES, HIPS, Part, SHOULDERS, WRISTS, joint_name};
use super::super::{BodyModel, LEAST_JOINTS};
use super::pairs::geman_mcclure;
use crate::geometry::{TriangleMesh, Vec3, bounds};
use crate::problem::Problem;
use serde::Serialize;

/// Known places of one body.
#[derive(Clone, Debug, Default)]
pub struct Landmarks(Vec<Landmark>);

#[derive(Clone, Debug)]
struct Landmark {
    name: String,
    site: Site,
    /// Where it is said to be \[m\].
    point: Vec3,
}

/// A place on a body model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Site {
    Joint(usize),
    Vertex(usize),
}

/// How far a fitted body is from a landmark.
#[derive(Clone, Debug, Serialize)]
pub struct LandmarkDistance {
    /// Its name.
    pub name: String,
    /// \[m\].
    pub distance: f64,
}

impl Landmarks {
    /// Names and places \[m, where the mesh stands\]; or everything that is wrong with them.
    pub fn new(
        model: &BodyModel,
        mesh: &TriangleMesh,
        named: &[(String, Vec3)],
    ) -> Result<Self, Vec<Problem>> {
        let sites = sites(model);
        let (low, high) = bounds(&mesh.positions);
        let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
        let (mut landmarks, mut problems) = (Vec::<Landmark>::new(), Vec::new());
        for (name, point) in named {
            let mut wrong = |text: String| {
                problems.push(Problem::at(format!("landmark `{name}`"), text));
            };
            let beyond = ((point - middle).abs() - half).max();
            if !point.iter().all(|c| c.is_finite()) {
                wrong("its place must be three finite numbers".to_owned());
            } else if beyond > OUTSIDE * half.max() {
                wrong(format!(
                    "it lies {beyond:.2} m outside the body: give it in the file's own unit and axes"
                ));
            }
            if landmarks.iter().any(|other| other.name == *name) {
                wrong("it is given twice".to_owned());
            }
            if let Some((_, site)) = sites.iter().find(|(known, _)| known == name) {
                landmarks.push(Landmark {
                    name: name.clone(),
                    site: *site,
                    point: *point,
                });
            } else {
                let known: Vec<&str> = sites.iter().map(|(known, _)| known.as_str()).collect();
                let known = known.join(", ");
                wrong(format!("there is no such point; there are {known}"));
            }
        }
        if problems.is_empty() {
            Ok(Self(landmarks))
        } else {
            Err(problems)
        }
    }

    /// What they add to a step of reach `sigma` \[m\].
    pub(super) fn pulls(&self, posed: &Posed, sigma: f64) -> Vec<Pull> {
        let pull = |landmark: &Landmark| {
            let residual = landmark.site.of(posed) - landmark.point;
            let robust = geman_mcclure(residual.norm_squared(), REACH * sigma);
            Pull {
                site: landmark.site,
                residual,
                weight: WEIGHT * sigma * sigma * robust,
            }
        };
        self.0.iter().map(pull).collect()
    }

    /// Mean share of the landmarks that are not where they should be; 0 for no landmarks.
    pub(super) fn misfit(&self, posed: &Posed) -> f64 {
        let far = |d: LandmarkDistance| 1.0 - geman_mcclure(d.distance * d.distance, NEAR);
        let count = self.0.len().max(1) as f64;
        self.distances(posed).into_iter().map(far).sum::<f64>() / count
    }

    /// How far `posed` is from each.
    pub(super) fn distances(&self, posed: &Posed) -> Vec<LandmarkDistance> {
        let distance = |landmark: &Landmark| LandmarkDistance {
            name: landmark.name.clone(),
            distance: (landmark.site.of(posed) - landmark.point).norm(),
        };
        self.0.iter().map(distance).collect()
    }
}

/// Landmarks farther outside the mesh's box than this share of its half size are in another unit.
const OUTSIDE: f64 = 0.5;
/// Weight of a landmark against the whole surface, per reach squared \[1/m²\]: 5 % at 8 cm, where the
/// pose is found, and less than a thousandth at the end.
const WEIGHT: f64 = 8.0;
/// A landmark counts a quarter at this many times the reach of the surface's pairs.
const REACH: f64 = 6.0;
/// A landmark this far off \[m\] is mostly missed.
const NEAR: f64 = 0.1;

/// Landmarks that stay farther than this \[m\] are told: joints are guessed to 3 cm from outside.
const MISSED: f64 = 0.06;

/// 95 % of a body comes nearer than this \[m\] by shape and pose alone, 6.5 mm at most on those tried;
/// bodies that wrong landmarks turn round, 21 mm.
const STRAINED: f64 = 0.012;

/// Notes on the landmarks that the fit did not come near, and on a fit that they may have misled:
/// `p95` \[m\] is what shape and pose alone leave.
pub(super) fn notes(distances: &[LandmarkDistance], p95: f64) -> Vec<String> {
    let missed = distances.iter().filter(|d| d.distance > MISSED);
    let mut notes: Vec<String> = missed
        .map(|d| {
            format!(
                "landmark `{}` stays {:.0} mm from where it is said to be: is it the other side's, \
                 or another point?",
                d.name,
                1e3 * d.distance
            )
        })
        .collect();
    if !distances.is_empty() && p95 > STRAINED {
        notes.push(format!(
            "standing as the landmarks say, a twentieth of the body stays more than {:.0} mm away \
             by shape and pose alone: are left and right exchanged? Left is the body's left",
            1e3 * p95
        ));
    }
    notes
}

/// One landmark's squared distance, as rows of the least-squares problem.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    site: Site,
    /// Where it is less where it should be \[m\].
    pub(super) residual: Vec3,
    pub(super) weight: f64,
}

impl Pull {
    /// Adds n · ∂x/∂parameters to `row`.
    pub(super) fn add_row(&self, jacobian: &Jacobian<'_>, n: Vec3, row: &mut [f64]) {
        match self.site {
            Site::Joint(j) => jacobian.add_joint_row(j, n, row),
            Site::Vertex(v) => jacobian.add_row(v, n, row),
        }
    }
}

impl Site {
    fn of(self, posed: &Posed) -> Vec3 {
        match self {
            Self::Joint(j) => posed.head(j),
            Self::Vertex(v) => posed.positions[v],
        }
    }
}

/// Every name a landmark may have: the joints, then points of the surface that everyone can tell.
pub(super) fn sites(model: &BodyModel) -> Vec<(String, Site)> {
    let joint_count = model.parts().joint_count();
    let mut sites: Vec<(String, Site)> = (0..joint_count)
        .map(|j| (joint_name(j), Site::Joint(j)))
        .collect();
    if joint_count < LEAST_JOINTS {
        return sites;
    }
    let template = &model.parts().template.positions;
    let parts = model.parts_of_vertices();
    let joints = model.joints(&model.mean_shape());
    let mut add = |name: &str, wanted: &dyn Fn(Part, Vec3) -> bool, most: &dyn Fn(Vec3) -> f64| {
        let vertices = (0..template.len()).filter(|v| wanted(parts[*v], template[*v]));
        let first = vertices.reduce(|a, b| {
            let farther = most(template[b]) > most(template[a]);
            if farther { b } else { a }
        });
        sites.extend(first.map(|v| (name.to_owned(), Site::Vertex(v))));
    };
    let head = |part, _| part == Part::Head;
    add("crown", &head, &|p| p.y);
    add("nose", &head, &|p| p.z);
    let middle = 0.5 * (joints[HIPS[0]].x + joints[HIPS[1]].x);
    let amid = |part: Part, p: Vec3| part.is_clothed() && (p.x - middle).abs() < AMID;
    add("crotch", &amid, &|p| -p.y);
    let (chest, armpits) = (joints[CHEST].y, joints[SHOULDERS[0]].y);
    let bust = |y: f64| (0.4..0.6).contains(&((y - chest) / (armpits - chest)));
    let of_side = [
        ("left", 1.0, Part::LeftHand, Part::LeftFoot),
        ("right", -1.0, Part::RightHand, Part::RightFoot),
    ];
    for (side, (word, sign, hand, foot)) in of_side.into_iter().enumerate() {
        let breast =
            |part, p: Vec3| part == Part::Trunk && bust(p.y) && (p.x - middle) * sign > 0.0;
        add(&format!("{word}_bust"), &breast, &|p| p.z);
        let (wrist, ankle) = (joints[WRISTS[side]], joints[ANKLES[side]]);
        let from = |joint: Vec3| move |p: Vec3| (p - joint).norm();
        let is = |wanted: Part| move |part, _| part == wanted;
        add(&format!("{word}_fingertip"), &is(hand), &from(wrist));
        add(&format!("{word}_toe"), &is(foot), &from(ankle));
    }
    sites
}

/// What is this near the middle plane \[m\] is in it.
const AMID: f64 = 0.01;
/// The joint in the chest.
const CHEST: usize = 9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::body_model::built_in;

    fn named(name: &str, point: Vec3) -> (String, Vec3) {
        (name.to_owned(), point)
    }

    #[test]
    fn every_wrong_landmark_is_told_at_once() {
        let model = built_in();
        let mesh = &model.parts().template;
        let good = mesh.positions[0];
        let given = [
            named("left_elbow", good),
            named("left_elbow", good),
            named("elbow", good),
            named("crown", Vec3::new(0.0, f64::NAN, 0.0)),
            named("nose", good * 100.0 + Vec3::repeat(100.0)),
        ];
        let told = Landmarks::new(&model, mesh, &given).unwrap_err();
        let told: Vec<String> = told.iter().map(ToString::to_string).collect();
        let words = ["twice", "left_fingertip", "finite", "outside the body"];
        assert_eq!(told.len(), words.len(), "{told:#?}");
        for (text, word) in told.iter().zip(words) {
            assert!(text.contains(word), "{text}");
        }
    }

    #[test]
    fn missed_landmarks_and_strained_bodies_are_told() {
        let at = |distance: f64| LandmarkDistance {
            name: "nose".to_owned(),
            distance,
        };
        assert!(notes(&[at(0.9 * MISSED)], 0.9 * STRAINED).is_empty());
        assert!(notes(&[], 1.1 * STRAINED).is_empty());
        let told = notes(&[at(0.2)], 0.021);
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[0].contains("`nose` stays 200 mm"), "{told:?}");
        assert!(told[1].contains("21 mm") && told[1].contains("left and right"));
    }

    #[test]
    fn landmarks_of_the_surface_are_where_their_names_say() {
        let model = built_in();
        let sites = sites(&model);
        let at = |name: &str| {
            let (_, site) = sites.iter().find(|(known, _)| known == name).unwrap();
            let Site::Vertex(v) = *site else {
                panic!("{name} is a joint")
            };
            model.parts().template.positions[v]
        };
        let (low, high) = model.parts().template.bounds();
        assert_eq!(at("crown").y, high.y);
        // Fingers reach the breadth of the body; the hips are at half of its height.
        assert!((at("left_fingertip").x - high.x).abs() < 0.02);
        assert!((at("right_fingertip").x - low.x).abs() < 0.02);
        let share = (at("crotch").y - low.y) / (high.y - low.y);
        assert!((0.42..0.52).contains(&share), "{share}");
        for side in ["left", "right"] {
            let sign = if side == "left" { 1.0 } else { -1.0 };
            let (bust, toe) = (at(&format!("{side}_bust")), at(&format!("{side}_toe")));
            assert!(bust.x * sign > 0.03 && bust.y > at("crotch").y && bust.y < at("nose").y);
            assert!(toe.x * sign > 0.03 && toe.y < low.y + 0.1);
        }
    }
}
