use super::*;
use crate::body_model::measure::measure;
use crate::body_model::sample::Random;
use crate::check::noise;
use crate::fixture::add_box;
use crate::geometry::{ClosestPoint, Mat3, bounds};
use crate::io::body_model::built_in;

/// `mesh` as another program might have it: other triangles, about 9 mm long.
fn remeshed(mesh: &TriangleMesh) -> TriangleMesh {
    let mut fine = mesh.clone();
    for _ in 0..2 {
        fine = halved(&fine);
    }
    let (index, count) = skin::clusters(&fine, 0.009);
    let mut positions = vec![Vec3::zeros(); count];
    // One vertex of each cluster, so that the new surface lies on the old one.
    for (p, i) in fine.positions.iter().zip(&index) {
        positions[*i as usize] = *p;
    }
    TriangleMesh {
        positions,
        triangles: skin::collapsed(&fine.triangles, &index),
    }
}

/// Every triangle cut in four.
fn halved(mesh: &TriangleMesh) -> TriangleMesh {
    let mut positions = mesh.positions.clone();
    let mut middles = std::collections::BTreeMap::new();
    let mut triangles = Vec::new();
    for &[a, b, c] in &mesh.triangles {
        let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[i, j]| {
            *middles.entry([i.min(j), i.max(j)]).or_insert_with(|| {
                let middle = (mesh.positions[i as usize] + mesh.positions[j as usize]) * 0.5;
                positions.push(middle);
                positions.len() as u32 - 1
            })
        });
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    TriangleMesh {
        positions,
        triangles,
    }
}

/// With noise of this size \[m\], holes at the soles and under an arm, and turned and moved.
fn scanned(mesh: &TriangleMesh, size: f64, turn: Mat3, shift: Vec3) -> TriangleMesh {
    let (low, high) = bounds(&mesh.positions);
    let armpit = Vec3::new(0.2, 0.5 * low.y + 0.5 * high.y + 0.35, 0.0);
    let hole = |p: &Vec3| p.y < low.y + 0.004 || (p - armpit).norm() < 0.05;
    let kept = |t: &&[u32; 3]| !t.iter().any(|v| hole(&mesh.positions[*v as usize]));
    let shaken = |(i, p): (usize, &Vec3)| {
        // Three uniform numbers of variance 1/3 make one of variance 1.
        let error = Vec3::from_fn(|c, _| (0..3).map(|k| noise(97 * i + 3 * c + k)).sum::<f64>());
        turn * (p + error * size) + shift
    };
    TriangleMesh {
        positions: mesh.positions.iter().enumerate().map(shaken).collect(),
        triangles: mesh.triangles.iter().filter(kept).copied().collect(),
    }
}

/// A random body, its arms lower and knees bent a little, as itself and as a surface.
fn someone(model: &BodyModel, seed: u64) -> (Shape, TriangleMesh) {
    let shape = model.sample(&mut Random::new(seed));
    let mut pose = model.arms_at(1.0);
    pose.rotations[4] = Vec3::new(0.15, 0.0, 0.0);
    pose.rotations[18] = Vec3::new(0.0, -0.3, 0.0);
    let mesh = TriangleMesh {
        positions: model.posed(&shape, &pose, &[]).positions,
        triangles: model.parts().template.triangles.clone(),
    };
    (shape, mesh)
}

#[test]
fn a_sampled_body_remeshed_and_posed_otherwise_is_found_again() {
    let model = built_in();
    let (shape, mesh) = someone(&model, 11);
    let fit = fit(&model, &remeshed(&mesh), &Landmarks::default()).unwrap();
    let (found, true_body) = (fit.a_pose(&model), model.a_pose(&shape, &[]));
    let parts = model.parts_of_vertices();
    let surface = ClosestPoint::new(&found);
    let clothed: Vec<f64> = (0..parts.len())
        .filter(|v| parts[*v].is_clothed())
        .map(|v| {
            surface
                .query(true_body.positions[v], f64::INFINITY)
                .unwrap()
                .distance
        })
        .collect();
    let mean = clothed.iter().sum::<f64>() / clothed.len() as f64;
    assert!(mean < 3e-3, "mean distance {mean}");
    // Elbows, knees, and the shoulders: points everyone finds by touch.
    let (joints, true_joints) = (
        model.a_pose(&fit.shape, &fit.offsets).heads(),
        true_body.heads(),
    );
    for j in [4, 5, 16, 17, 18, 19] {
        let off = (joints[j] - true_joints[j]).norm();
        assert!(off < 0.01, "{}: {off}", crate::body_model::joint_name(j));
    }
    assert_eq!(fit.report.flipped_faces, 0);
}

#[test]
fn a_noisy_scan_with_holes_anywhere_in_space_gives_the_same_measurements() {
    let model = built_in();
    let (shape, mesh) = someone(&model, 5);
    let turn = rotation_about(Vec3::new(0.3, 2.0, -0.2));
    let scan = scanned(&remeshed(&mesh), 1e-3, turn, Vec3::new(3.0, -1.0, 0.5));
    let fit = fit(&model, &scan, &Landmarks::default()).unwrap();
    let found = measure(&model, &fit.shape, &fit.offsets);
    for (m, truth) in found.iter().zip(measure(&model, &shape, &[])) {
        let error = (m.length - truth.length).abs();
        assert!(
            error < 0.01,
            "{}: {} for {}",
            m.name,
            m.length,
            truth.length
        );
    }
    // The noise's own mean distance along the normal is 0.8 mm; half a millimetre more is ours.
    assert!(fit.report.distances.scan_to_fit.mean < 1.3e-3);
}

fn rotation_about(axis_times_angle: Vec3) -> Mat3 {
    *nalgebra::Rotation3::new(axis_times_angle).matrix()
}

#[test]
fn a_chair_is_no_body() {
    let mut chair = TriangleMesh::default();
    // A seat, a back and four legs, as boxes (low corner, size).
    for (low, size) in [
        ([0.0, 0.45, 0.0], [0.45, 0.04, 0.45]),
        ([0.0, 0.47, 0.0], [0.45, 0.5, 0.04]),
        ([0.0, 0.0, 0.0], [0.04, 0.47, 0.04]),
        ([0.41, 0.0, 0.0], [0.04, 0.47, 0.04]),
        ([0.0, 0.0, 0.41], [0.04, 0.47, 0.04]),
        ([0.41, 0.0, 0.41], [0.04, 0.47, 0.04]),
    ] {
        add_box(&mut chair, low, [0, 1, 2].map(|c| low[c] + size[c]));
    }
    let told = fit(&built_in(), &chair, &Landmarks::default()).unwrap_err();
    assert!(told[0].text.contains("no body was recognised"), "{told:?}");
}

/// Joints of `posed` as landmarks of `mesh`.
fn told(model: &BodyModel, mesh: &TriangleMesh, joints: &[usize], posed: &Posed) -> Landmarks {
    let named: Vec<(String, Vec3)> = joints
        .iter()
        .map(|j| (crate::body_model::joint_name(*j), posed.head(*j)))
        .collect();
    Landmarks::new(model, mesh, &named).unwrap()
}

#[test]
fn a_body_without_arms_holds_them_where_landmarks_say() {
    let model = built_in();
    let shape = model.sample(&mut Random::new(3));
    let mut pose = model.arms_at(0.9);
    // The left arm forward, out of every starting pose.
    pose.rotations[16] += Vec3::new(0.0, -0.8, 0.0);
    let posed = model.posed(&shape, &pose, &[]);
    let parts = model.parts_of_vertices();
    let armless = |t: &&[u32; 3]| {
        let part = |v: &u32| parts[*v as usize];
        !t.iter()
            .any(|v| matches!(part(v), Part::LeftArm | Part::LeftHand))
    };
    let template = &model.parts().template.triangles;
    let mesh = TriangleMesh {
        positions: posed.positions.clone(),
        triangles: template.iter().filter(armless).copied().collect(),
    };
    let elbow_and_wrist = |landmarks: Landmarks| {
        let scan = Scan::new(mesh.clone(), landmarks);
        let state = pose_and_build(&model, &scan);
        let found = model.posed(&state.shape, &state.pose, &[]);
        [18, 20].map(|j| (found.head(j) - posed.head(j)).norm())
    };
    let alone = elbow_and_wrist(Landmarks::default());
    let helped = elbow_and_wrist(told(&model, &mesh, &[16, 18, 20], &posed));
    for (alone, helped) in alone.into_iter().zip(helped) {
        // A landmark's own accuracy is 3 cm; nothing else says where a missing arm is.
        assert!(helped < 0.03 && alone > 0.08, "{helped} {alone}");
    }
}

#[test]
fn true_landmarks_leave_a_good_fit_as_good() {
    let model = built_in();
    let (shape, mesh) = someone(&model, 11);
    let mut pose = model.arms_at(1.0);
    pose.rotations[4] = Vec3::new(0.15, 0.0, 0.0);
    pose.rotations[18] = Vec3::new(0.0, -0.3, 0.0);
    let posed = model.posed(&shape, &pose, &[]);
    let fit = fit(&model, &mesh, &told(&model, &mesh, &[4, 5, 18], &posed)).unwrap();
    // As without landmarks: on the model's own mesh, far below a millimetre.
    assert!(fit.report.distances.scan_to_fit.mean < 1e-3);
    assert!(fit.report.notes.is_empty(), "{:?}", fit.report.notes);
    for d in &fit.report.landmarks {
        // What the sampled body's joints are found again to.
        assert!(d.distance < 0.01, "{}: {}", d.name, d.distance);
    }
}
