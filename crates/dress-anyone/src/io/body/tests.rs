use super::*;
use crate::fixture::{add_box, shared};

/// A crude person in a T-pose, 1.7 m tall and 1.6 m from hand to hand: closed boxes.
fn person() -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut cuboid = |low, high| add_box(&mut mesh, low, high);
    cuboid([-0.2, 0.8, -0.1], [0.2, 1.45, 0.12]);
    cuboid([-0.1, 1.45, -0.1], [0.1, 1.7, 0.1]);
    for side in [-1.0, 1.0] {
        let ends = |a: f64, b: f64| if side < 0.0 { [-b, -a] } else { [a, b] };
        let ([leg_low, leg_high], [arm_low, arm_high]) = (ends(0.02, 0.18), ends(0.2, 0.8));
        cuboid([leg_low, 0.0, -0.1], [leg_high, 0.8, 0.15]);
        cuboid([arm_low, 1.35, -0.05], [arm_high, 1.45, 0.05]);
    }
    mesh
}

fn surface(mesh: &TriangleMesh, frame: FileFrame) -> Surface {
    Surface {
        positions: mesh.positions.iter().map(|p| frame.from_si(*p)).collect(),
        polygons: mesh.triangles.iter().map(|t| t.to_vec()).collect(),
    }
}

#[test]
fn every_unit_and_up_axis_is_recognised() {
    for (metres_per_unit, _) in UNITS {
        for up in [UpAxis::Y, UpAxis::Z] {
            let frame = FileFrame {
                metres_per_unit,
                up,
            };
            let (mesh, found, notes) =
                stand_up(&surface(&person(), frame), &BodyOptions::default()).unwrap();
            assert_eq!(found, frame, "{notes:?}");
            for (p, q) in mesh.positions.iter().zip(&person().positions) {
                assert!((p - q).norm() < 1e-12);
            }
            assert_eq!(
                mesh.triangles,
                person().triangles,
                "closed and outward already"
            );
        }
    }
}

#[test]
fn a_body_that_lies_along_x_is_stood_up() {
    let mut slim = person();
    for p in &mut slim.positions {
        // Arms half spread: 1.36 m broad, 1.7 m tall.
        p.x *= 0.85;
    }
    let frame = FileFrame {
        metres_per_unit: 0.01,
        up: UpAxis::X,
    };
    let (mesh, found, notes) = stand_up(&surface(&slim, frame), &BodyOptions::default()).unwrap();
    assert_eq!(found, frame, "{notes:?}");
    for (p, q) in mesh.positions.iter().zip(&slim.positions) {
        assert!((p - q).norm() < 1e-12);
    }
    assert_eq!(mesh.triangles, slim.triangles, "turned, not mirrored");
}

#[test]
fn spread_arms_along_z_do_not_pass_for_the_height() {
    let mut turned = person();
    for p in &mut turned.positions {
        // A quarter turn about y, with arms longer than the body: 1.84 m against 1.7 m.
        *p = Vec3::new(p.z, p.y, -1.15 * p.x);
    }
    for up in [UpAxis::Y, UpAxis::Z] {
        let frame = FileFrame {
            metres_per_unit: 1.0,
            up,
        };
        let seen = match up {
            UpAxis::X | UpAxis::Y => surface(&turned, FileFrame::SI),
            UpAxis::Z => Surface {
                positions: turned
                    .positions
                    .iter()
                    .map(|p| Vec3::new(p.x, -p.z, p.y))
                    .collect(),
                ..surface(&turned, FileFrame::SI)
            },
        };
        let (_, found, notes) = stand_up(&seen, &BodyOptions::default()).unwrap();
        assert_eq!(found, frame, "{notes:?}");
    }
}

#[test]
fn inward_and_inconsistent_faces_are_turned_and_told() {
    let mut inward = person();
    for t in &mut inward.triangles {
        t.swap(1, 2);
    }
    inward.triangles[5].swap(0, 1);
    let (mesh, _, notes) =
        stand_up(&surface(&inward, FileFrame::SI), &BodyOptions::default()).unwrap();
    // Six boxes, each of its own volume; one triangle stood against its eleven neighbours.
    let all: Vec<usize> = (0..mesh.triangles.len()).collect();
    let volume: f64 = 0.4 * 0.65 * 0.22 + 0.04 * 0.25 + 2.0 * (0.16 * 0.8 * 0.25 + 0.6 * 0.01);
    let origin_free: f64 = all
        .chunks(12)
        .map(|one| {
            let corner = mesh.corners(one[0])[0];
            let cone = |t: &usize| {
                let [a, b, c] = mesh.corners(*t).map(|p| p - corner);
                a.dot(&b.cross(&c)) / 6.0
            };
            one.iter().map(cone).sum::<f64>()
        })
        .sum();
    assert!(
        (origin_free - volume).abs() < 1e-12,
        "{origin_free} {volume}"
    );
    let notes = notes.join("\n");
    assert!(notes.contains("1 triangles were wound against"), "{notes}");
    assert!(
        notes.contains("turned outward (6 of 6 components)"),
        "{notes}"
    );
}

#[test]
fn holes_components_and_unused_vertices_are_noted() {
    let mut open = person();
    open.triangles.remove(0);
    open.positions.push(Vec3::new(100.0, 0.0, 0.0));
    let (mesh, _, notes) =
        stand_up(&surface(&open, FileFrame::SI), &BodyOptions::default()).unwrap();
    assert_eq!(mesh.positions.len(), open.positions.len());
    let notes = notes.join("\n");
    for expected in [
        "6 separate components",
        "1 hole, of 3 edges",
        "1 vertices belong to no face",
    ] {
        assert!(notes.contains(expected), "{notes}");
    }
}

#[test]
fn quads_are_cut_the_same_way_whatever_the_shape() {
    let quads = [vec![0, 1, 2, 3], vec![3, 2, 1], vec![4, 4, 5]];
    let mut notes = Vec::new();
    let triangles = super::surface::triangulate(&quads, &mut notes);
    assert_eq!(triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1]]);
    assert!(notes[0].starts_with("1 triangles"));
}

#[test]
fn what_fits_no_unit_has_to_be_told() {
    let tiny = FileFrame {
        metres_per_unit: 85.0,
        up: UpAxis::Y,
    };
    let body = || surface(&person(), tiny);
    let problem = stand_up(&body(), &BodyOptions::default()).unwrap_err();
    assert!(problem.text.contains("0.0200 units tall"), "{problem}");
    let told = BodyOptions {
        metres_per_unit: Some(85.0),
        up: None,
    };
    assert_eq!(stand_up(&body(), &told).unwrap().1, tiny);
}

#[test]
fn files_that_are_no_bodies_are_refused_in_plain_words() {
    let folder = tempfile::tempdir().unwrap();
    let cases: [(&str, &[u8], &str); 8] = [
        ("shirt.json", b" {\"pattern\": {}}", "garment's pattern"),
        ("empty.obj", b"", "empty"),
        ("no_faces.obj", b"v 0 0 0\nv 1 1 1\n", "no faces"),
        ("nan.obj", b"v 0 nan 0\n", "line 1"),
        ("range.obj", b"v 0 0 0\nf 1 2 3\n", "line 2"),
        (
            "point.obj",
            b"v 0 0 0\nf 1 1 1\nv 1 1 1\nf 1 2 1\n",
            "no faces",
        ),
        (
            "same.obj",
            b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n",
            "same point",
        ),
        ("model.npz", b"PK\x03\x04....", "zip"),
    ];
    for (name, content, expected) in cases {
        let path = folder.path().join(name);
        std::fs::write(&path, content).unwrap();
        let error = read(&path, &BodyOptions::default())
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{error}");
    }
    assert!(read(&folder.path().join("none.obj"), &BodyOptions::default()).is_err());
}

#[test]
fn every_shared_body_stands_upright_in_metres() {
    let folders = ["bodies/cc0", "bodies/garmentcode", "bodies/variants"];
    for path in shared(&folders, "obj") {
        let body = read(&path, &BodyOptions::default()).unwrap();
        println!(
            "{} {:?}\n  {}",
            body.name,
            body.frame,
            body.notes.join("\n  ")
        );
        let unit = match body.name.as_str() {
            name if name.ends_with("_mm") => 0.001,
            name if name.ends_with("_cm") => 0.01,
            _ => 1.0,
        };
        assert_eq!(
            body.frame,
            FileFrame {
                metres_per_unit: unit,
                up: UpAxis::Y
            }
        );
        let (low, high) = body.mesh.bounds();
        // The child is 1.30 m tall, the alien 1.99 m; soles are at 0 but for the scan's noise.
        assert!((1.29..2.0).contains(&(high.y - low.y)) && low.y.abs() < 0.005);

        // The same body, told in another frame, is the same body; the other folders hold the same.
        if !path.parent().unwrap().ends_with("cc0") {
            continue;
        }
        // The goblin is broader than tall; x is taken for up only where it is the longest.
        let is_tall = high.y - low.y > high.x - low.x;
        let ups = if is_tall {
            &[UpAxis::X, UpAxis::Z][..]
        } else {
            &[UpAxis::Z]
        };
        for &up in ups {
            let frame = FileFrame {
                metres_per_unit: 0.0254,
                up,
            };
            let (mesh, found, _) =
                stand_up(&surface(&body.mesh, frame), &BodyOptions::default()).unwrap();
            assert_eq!(found, frame, "{}", body.name);
            assert_eq!(mesh.triangles, body.mesh.triangles);
        }
    }
}
