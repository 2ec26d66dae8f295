use super::*;
use crate::body_model::Parts;
use crate::check::{STEP, assert_derivative, noise};
use crate::geometry::TriangleMesh;

/// Three bones in a row and six vertices, with two components and pose directions: small enough to
/// think about, and nothing in it is zero.
pub(crate) fn three_bones() -> BodyModel {
    let vector = |seed: usize| Vec3::from_fn(|c, _| noise(seed + c));
    let positions: Vec<Vec3> = (0..6).map(|v| vector(3 * v)).collect();
    BodyModel::new(Parts {
        name: "three bones".to_owned(),
        template: TriangleMesh {
            positions,
            triangles: vec![[0, 1, 2], [3, 4, 5]],
        },
        directions: (0..12).map(|i| vector(100 + 3 * i)).collect(),
        shape_count: 1,
        stretches: vec!["bone".to_owned()],
        pose_directions: (0..6 * 18).map(|i| vector(200 + 3 * i) * 0.1).collect(),
        regressor: vec![
            vec![(0, 1.0)],
            vec![(1, 0.5), (2, 0.5)],
            vec![(3, 0.3), (4, 0.7)],
        ],
        weights: (0..6)
            .map(|v| {
                vec![
                    (0, 0.5 - 0.05 * f64::from(v)),
                    (1, 0.3),
                    (2, 0.2 + 0.05 * f64::from(v)),
                ]
            })
            .collect(),
        parents: vec![None, Some(0), Some(1)],
    })
}

fn state(model: &BodyModel, along: &[f64], s: f64) -> (Shape, Pose) {
    let at = |i: usize| 0.7 * noise(900 + i) + s * along[i];
    let joints = model.parts.joint_count();
    let vector = |i: usize| Vec3::new(at(i), at(i + 1), at(i + 2));
    let pose = Pose {
        translation: vector(0),
        rotations: (0..joints).map(|j| vector(4 + 3 * j)).collect(),
    };
    let components = (0..model.parts.component_count())
        .map(|k| at(4 + 3 * joints + k))
        .collect();
    let scale = at(3).exp();
    (Shape { scale, components }, pose)
}

#[test]
fn the_zero_pose_of_the_mean_shape_is_the_template() {
    let model = three_bones();
    let posed = model.posed(&model.mean_shape(), &Pose::zero(&model), &[]);
    for (p, q) in posed.positions.iter().zip(&model.parts.template.positions) {
        // Weights sum to 1 up to round-off.
        assert!((p - q).norm() < 1e-14);
    }
}

#[test]
fn turning_the_root_turns_the_whole_body_about_its_joint() {
    let model = three_bones();
    let mut pose = Pose::zero(&model);
    let theta = Vec3::new(0.3, -1.2, 0.7);
    pose.rotations[0] = theta;
    let posed = model.posed(&model.mean_shape(), &pose, &[]);
    let template = &model.parts.template.positions;
    for (p, q) in posed.positions.iter().zip(template) {
        let expected = rotation(theta) * (q - template[0]) + template[0];
        assert!((p - expected).norm() < 1e-13);
    }
}

#[test]
fn every_parameters_slope_is_that_of_central_differences() {
    let model = three_bones();
    let still = vec![0.0; 4 + 9 + 2];
    let (shape, pose) = state(&model, &still, 0.0);
    let offsets: Vec<Vec3> = (0..6)
        .map(|v| Vec3::from_fn(|c, _| noise(700 + 3 * v + c)))
        .collect();
    let posed = model.posed(&shape, &pose, &offsets);
    let jacobian = Jacobian::new(&model, &posed, &pose);
    // The vertices, then the joints.
    for at in 0..6 + 3 {
        let n = Vec3::from_fn(|c, _| noise(400 + 3 * at + c));
        let mut row = vec![0.0; jacobian.parameter_count()];
        match at {
            0..6 => jacobian.add_row(at, n, &mut row),
            _ => jacobian.add_joint_row(at - 6, n, &mut row),
        }
        for (i, slope) in row.iter().enumerate() {
            let mut along = still.clone();
            along[i] = 1.0;
            let value = |s: f64| {
                let (shape, pose) = state(&model, &along, s);
                let posed = model.posed(&shape, &pose, &offsets);
                n.dot(&if at < 6 {
                    posed.positions[at]
                } else {
                    posed.head(at - 6)
                })
            };
            // Round-off over the step: 1e-16 / 1e-5, times values of order ten.
            assert_derivative(value, *slope, STEP, 1.0, 1e-8);
        }
    }
}

#[test]
fn an_offset_taken_to_rest_comes_back_in_the_pose() {
    let model = three_bones();
    let still = vec![0.0; 4 + 9 + 2];
    let (shape, pose) = state(&model, &still, 0.0);
    let posed = model.posed(&shape, &pose, &[]);
    let wanted = Vec3::new(0.01, -0.02, 0.03);
    let rest: Vec<Vec3> = (0..6)
        .map(|v| {
            posed
                .to_rest(&model, v, wanted)
                .expect("bones are not opposed")
        })
        .collect();
    let moved = model.posed(&shape, &pose, &rest);
    for (p, q) in moved.positions.iter().zip(&posed.positions) {
        assert!((p - q - wanted).norm() < 1e-12);
    }
}
