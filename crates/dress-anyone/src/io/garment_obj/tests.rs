use super::*;
use crate::fixture::shared;
use crate::pattern::{Curve, Edge, EdgeId, Panel, Stitch};
use proptest::prelude::*;

const COLUMNS: usize = 8;
const ROWS: usize = 12;
/// Width and height of a panel \[m\].
const SIZE: (f64, f64) = (0.4, 0.6);

/// A tube of two panels, sewn at the sides; the back is drawn face down if `mirrored`.
fn tube(mirrored: bool) -> Garment {
    let mut garment = Garment {
        name: "tube".into(),
        pattern: Pattern {
            panels: vec![],
            stitches: vec![],
        },
        mesh: PatternMesh {
            x_bar: vec![],
            triangles: vec![],
            panel_vertices: vec![],
            panel_triangles: vec![],
            right_side_up: vec![true, !mirrored],
            edge_vertices: vec![],
            sewing: vec![],
            cloth_vertex_count: 0,
        },
        drape: None,
    };
    let mut drape: Vec<Vec3> = Vec::new();
    for back in [false, true] {
        add_panel(&mut garment, &mut drape, back, mirrored && back);
    }
    // Edges run bottom, right, top, left, seen from the right side of the cloth.
    let stitch = |a, b| Stitch {
        sides: [EdgeId { panel: 0, edge: a }, EdgeId { panel: 1, edge: b }],
        right_wrong: false,
    };
    garment.pattern.stitches = vec![stitch(3, 1), stitch(1, 3)];
    garment.mesh.cloth_vertex_count = drape.len();
    garment.drape = Some(drape);
    garment
}

fn add_panel(garment: &mut Garment, drape: &mut Vec<Vec3>, back: bool, face_down: bool) {
    let mesh = &mut garment.mesh;
    let (first, first_triangle) = (mesh.x_bar.len(), mesh.triangles.len());
    let vertex = |i: usize, j: usize| (first + j * (COLUMNS + 1) + i) as u32;
    for j in 0..=ROWS {
        for i in 0..=COLUMNS {
            // Seen from outside, the back runs from its own left to right: against the front's.
            let (s, t) = (i as f64 / COLUMNS as f64, j as f64 / ROWS as f64);
            let x = if back { 1.0 - s } else { s };
            // A bottom that is curved by a quadratic Bézier of height 2 · 0.03 at its middle.
            let sag = 0.03 * 4.0 * s * (1.0 - s) * (1.0 - t);
            let y = SIZE.1 * t - sag;
            let side = if face_down { -1.0 } else { 1.0 };
            mesh.x_bar
                .push(Vec2::new(side * (SIZE.0 * s - 0.2) + 1.3, y + 0.7));
            // 0.015 high over 0.4: the cloth is at most 0.7 % longer in the drape.
            let z = 0.015 * (std::f64::consts::PI * x).sin() * if back { -1.0 } else { 1.0 };
            let p = Vec3::new(SIZE.0 * x - 0.2, 0.9 + y, z);
            let sewn = if back && (i == 0 || i == COLUMNS) {
                mesh.sewing[j * (COLUMNS + 1) + (COLUMNS - i)]
            } else {
                drape.push(p);
                drape.len() as u32 - 1
            };
            mesh.sewing.push(sewn);
        }
    }
    for j in 0..ROWS {
        for i in 0..COLUMNS {
            let [a, b, c, d] = [
                vertex(i, j),
                vertex(i + 1, j),
                vertex(i + 1, j + 1),
                vertex(i, j + 1),
            ];
            for mut triangle in [[a, b, c], [a, c, d]] {
                if face_down {
                    triangle.swap(1, 2);
                }
                mesh.triangles.push(triangle);
            }
        }
    }
    let chains = vec![
        (0..=COLUMNS).map(|i| vertex(i, 0)).collect::<Vec<_>>(),
        (0..=ROWS).map(|j| vertex(COLUMNS, j)).collect(),
        (0..=COLUMNS).rev().map(|i| vertex(i, ROWS)).collect(),
        (0..=ROWS).rev().map(|j| vertex(0, j)).collect(),
    ];
    let vertices: Vec<Vec2> = chains.iter().map(|c| mesh.x_bar[c[0] as usize]).collect();
    let below = (vertices[0] + vertices[1]) * 0.5 - Vec2::new(0.0, 0.06);
    let edge = |e: usize| Edge {
        start: e,
        end: (e + 1) % 4,
        curve: if e == 0 {
            Curve::Quadratic(below)
        } else {
            Curve::Line
        },
        label: (e == 2).then(|| "lower_interface".to_owned()),
    };
    garment.pattern.panels.push(Panel {
        name: if back { "the back" } else { "front" }.into(),
        vertices,
        edges: (0..4).map(edge).collect(),
        placement: Placement {
            rotation: Mat3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0),
            translation: Vec3::new(0.1, 1.2, if back { -0.3 } else { 0.3 }),
        },
        label: back.then(|| "body".to_owned()),
    });
    mesh.edge_vertices.push(chains);
    mesh.panel_vertices.push(first..mesh.x_bar.len());
    mesh.panel_triangles
        .push(first_triangle..mesh.triangles.len());
}

const INCHES: FileFrame = FileFrame {
    metres_per_unit: 0.0254,
    up: UpAxis::Z,
};

fn text_of(garment: &Garment, frame: FileFrame) -> String {
    write(
        garment,
        &garment.mesh.x_bar,
        garment.drape.as_ref().unwrap(),
        frame,
    )
}

fn parse(text: &str, options: &UvOptions) -> Result<ObjGarment, Vec<Problem>> {
    assemble(obj::parse(text.as_bytes()).unwrap(), "tube".into(), options)
}

fn without_comments(text: &str) -> String {
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines.collect::<Vec<_>>().join("\n")
}

fn refusal(text: &str, options: &UvOptions) -> String {
    let problems = parse(text, options).expect_err("this is refused");
    problems
        .iter()
        .map(ToString::to_string)
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn a_written_garment_reads_back_as_it_was() {
    for mirrored in [false, true] {
        let garment = tube(mirrored);
        let read = parse(&text_of(&garment, INCHES), &UvOptions::default()).unwrap();
        assert_eq!((read.frame, read.notes), (INCHES, vec![]));
        let again = read.garment;
        assert_eq!(again.pattern.stitches, garment.pattern.stitches);
        for (a, b) in again.pattern.panels.iter().zip(&garment.pattern.panels) {
            assert_eq!(
                (&a.name, &a.label, &a.placement),
                (&b.name, &b.label, &b.placement)
            );
            assert_eq!(a.edges, b.edges);
            // The file has seven decimals of a metre: 0.05 mm and far better.
            assert!(
                a.vertices
                    .iter()
                    .zip(&b.vertices)
                    .all(|(p, q)| (p - q).norm() < 5e-7)
            );
        }
        let (new, old) = (&again.mesh, &garment.mesh);
        assert!(
            new.x_bar
                .iter()
                .zip(&old.x_bar)
                .all(|(p, q)| (p - q).norm() < 5e-7)
        );
        let drapes = again
            .drape
            .iter()
            .flatten()
            .zip(garment.drape.iter().flatten());
        assert!(drapes.into_iter().all(|(p, q)| (p - q).norm() < 5e-7));
        let mut same = new.clone();
        same.x_bar.clone_from(&old.x_bar);
        assert_eq!(&same, old);
    }
}

#[test]
fn the_right_side_of_a_written_drape_is_outside() {
    for mirrored in [false, true] {
        let document = obj::parse(text_of(&tube(mirrored), FileFrame::SI).as_bytes()).unwrap();
        for face in &document.faces {
            let [a, b, c] = [0, 1, 2].map(|i| document.positions[face.corners[i].v as usize]);
            let (normal, middle) = ((b - a).cross(&(c - a)), (a + b + c) / 3.0);
            // The tube's axis is the y axis, and its seams lie in z = 0.
            assert!(normal.z * middle.z > 0.0, "mirrored: {mirrored}");
        }
    }
}

#[test]
fn a_pattern_is_found_without_comments_too() {
    for mirrored in [false, true] {
        let garment = tube(mirrored);
        let text = without_comments(&text_of(
            &garment,
            FileFrame {
                up: UpAxis::Y,
                ..INCHES
            },
        ));
        let told = UvOptions {
            metres_per_unit: Some(0.0254),
            ..UvOptions::default()
        };
        let read = parse(&text, &told).unwrap();
        // Both numberings are in inches, so the scale snaps to one.
        assert_eq!(read.uv_scale, 0.0254, "{:?}", read.notes);
        let (new, old) = (&read.garment, &garment);
        assert_eq!(new.mesh.right_side_up, old.mesh.right_side_up);
        assert_eq!(new.mesh.sewing, old.mesh.sewing);
        assert_eq!(new.mesh.triangles, old.mesh.triangles);
        assert_eq!(new.pattern.panels[1].name, "the back");
        let chains = |mesh: &PatternMesh, k: usize| {
            let mut chains = mesh.edge_vertices[k].clone();
            chains.sort();
            chains
        };
        for k in 0..2 {
            assert_eq!(chains(&new.mesh, k), chains(&old.mesh, k));
            // The panel is laid where its cloth is.
            let middle = new.placed().iter().sum::<Vec3>() / new.placed().len() as f64;
            assert!(
                (middle - Vec3::new(0.0, 1.2, 0.0)).norm() < 0.02,
                "{middle}"
            );
        }
        let sewn = |garment: &Garment| {
            let along = |id: EdgeId| garment.mesh.along(id).to_vec();
            let mut sewn: Vec<_> = garment
                .pattern
                .stitches
                .iter()
                .map(|s| (along(s.sides[0]), along(s.sides[1]), s.right_wrong))
                .collect();
            sewn.sort();
            sewn
        };
        assert_eq!(sewn(new), sewn(old));
    }
}

#[test]
fn a_summary_counts_cloth_and_open_edges() {
    let summary = tube(true).summary();
    // Two grids that share two columns of 13; the bottoms sag by 0.03 m · 4 s (1 − s), whose
    // integral over 0.4 m is 0.008 m², less 1/64 of it for the eight chords.
    assert_eq!(
        (summary.pattern_vertices, summary.cloth_vertices),
        (234, 208)
    );
    assert!((summary.area - 2.0 * (0.24 + 0.008 * (1.0 - 1.0 / 64.0))).abs() < 1e-9);
    // Top and bottom of both; the bottom is 2 · 0.06 / 0.4 steep at its ends, so not 3 % longer.
    assert!(
        (1.6..1.6 * 1.03).contains(&summary.free_edges),
        "{}",
        summary.free_edges
    );
}

#[test]
fn what_is_told_against_the_comments_of_a_file_is_left_aside_and_said_so() {
    let options = UvOptions {
        uv_scale: Some(2.0),
        ..UvOptions::default()
    };
    let text = text_of(&tube(false), INCHES);
    let read = parse(&text, &options).unwrap();
    assert_eq!(read.garment.mesh.x_bar.len(), tube(false).mesh.x_bar.len());
    assert_eq!(
        (read.frame, read.uv_scale),
        (INCHES, INCHES.metres_per_unit)
    );
    assert!(
        read.notes.iter().any(|note| note.contains("is not used")),
        "{:?}",
        read.notes
    );
}

#[test]
fn comments_that_do_not_fit_the_mesh_are_not_believed() {
    let text = text_of(&tube(false), FileFrame::SI);
    for (from, to) in [
        ("[[0,3],[1,1],false]", "[[0,3],[1,1],true]"),
        ("\"corners\":[1,", "\"corners\":[2,"),
        ("\"ends\":[1,2]", "\"ends\":[1,3]"),
        ("stitches [", "stitches "),
    ] {
        assert!(text.contains(from), "{text}");
        let read = parse(&text.replacen(from, to, 1), &UvOptions::default()).unwrap();
        assert!(
            read.notes.iter().any(|note| note.contains("# dress:")),
            "{:?}",
            read.notes
        );
        assert_eq!(read.garment.pattern.stitches.len(), 2);
    }
}

#[test]
fn panels_that_were_not_welded_are_sewn_where_they_meet() {
    let mut garment = tube(false);
    let drape = garment.drape.clone().unwrap();
    let unsewn = garment
        .mesh
        .sewing
        .iter()
        .map(|v| drape[*v as usize])
        .collect();
    garment.mesh.sewing = (0..garment.mesh.x_bar.len() as u32).collect();
    garment.drape = Some(unsewn);
    let text = without_comments(&text_of(&garment, FileFrame::SI));
    let read = parse(&text, &UvOptions::default()).unwrap();
    assert_eq!(read.garment.pattern.stitches.len(), 2);
    assert_eq!(read.garment.mesh.cloth_vertex_count, drape.len());
}

/// A flat square of 0.6 m with a dart of 4 cm sewn shut in its lower side, in centimetres.
#[test]
fn a_dart_is_a_stitch_between_two_edges_of_one_panel() {
    let text = "v 0 100 0\nv 30 100 0\nv 60 100 0\nv 60 160 0\nv 30 160 0\nv 0 160 0\nv 30 130 0\n\
        vt 0 0\nvt 28 0\nvt 32 0\nvt 60 0\nvt 60 60\nvt 30 60\nvt 0 60\nvt 30 30\n\
        f 1/1 2/2 7/8\nf 1/1 7/8 6/7\nf 6/7 7/8 5/6\nf 2/3 3/4 7/8\nf 3/4 4/5 7/8\nf 4/5 5/6 7/8\n";
    let read = parse(text, &UvOptions::default()).unwrap();
    let pattern = &read.garment.pattern;
    assert_eq!(pattern.panels.len(), 1);
    // Four sides, the lower one in two, and two legs of the dart.
    assert_eq!(pattern.panels[0].edges.len(), 7);
    assert_eq!(pattern.stitches.len(), 1);
    let [one, two] = pattern.stitches[0].sides;
    let leg = Vec2::new(0.02, 0.3).norm();
    for id in [one, two] {
        assert!((pattern.edge_length(id) - leg).abs() < 1e-9);
    }
    assert!(!pattern.stitches[0].right_wrong);
}

#[test]
fn textures_that_are_no_pattern_are_refused_with_the_reason() {
    let text = without_comments(&text_of(&tube(false), FileFrame::SI));
    let scaled = |u: f64, v: f64, folded: bool| {
        let line = |line: &str| match *line.split(' ').collect::<Vec<_>>() {
            ["vt", a, b] => {
                let (a, b): (f64, f64) = (a.parse().unwrap(), b.parse().unwrap());
                // Folding mirrors what lies above the middle of the panels.
                let b = if folded && b > 0.4 { 0.8 - b } else { b };
                format!("vt {} {}", a * u, b * v)
            }
            _ => line.to_owned(),
        };
        text.lines().map(line).collect::<Vec<_>>().join("\n")
    };
    let guess = UvOptions::default();
    assert!(refusal(&scaled(1.0, 0.6, false), &guess).contains("stretched"));
    assert!(refusal(&scaled(1.0, 1.0, true), &guess).contains("folded over"));
    let told = UvOptions {
        uv_scale: Some(0.5),
        ..guess
    };
    assert_eq!(
        parse(&scaled(2.0, 2.0, false), &told).unwrap().uv_scale,
        0.5
    );
    assert_eq!(
        parse(&scaled(1.0, 0.6, false), &told).unwrap().uv_scale,
        0.5
    );
    let bare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n";
    assert!(refusal(bare, &guess).contains("no texture coordinates"));
    let tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n\
        f 1/1 3/2 2/3\nf 1/1 2/2 4/3\nf 2/1 3/2 4/3\nf 3/1 1/2 4/3\n";
    assert!(refusal(tetrahedron, &guess).contains("closed"));
}

proptest! {
    #[test]
    fn faces_strewn_at_random_never_panic(
        points in proptest::collection::vec((-2_i8..3, -2_i8..3, -2_i8..3), 5),
        corners in proptest::collection::vec((0_u32..5, 0_u32..6), 3..24),
        scale in proptest::option::of(0.1..2.0),
    ) {
        let position = |p: &(i8, i8, i8)| Vec3::new(p.0.into(), p.1.into(), p.2.into());
        let corner = |(v, vt): &(u32, u32)| obj::Corner { v: *v, vt: Some(*vt) };
        let document = obj::Document {
            positions: points.iter().map(position).collect(),
            uvs: [(0, 0), (2, 0), (2, 2), (0, 2), (1, 1), (3, 1)]
                .map(|(u, v)| Vec2::new(f64::from(u), f64::from(v)))
                .to_vec(),
            faces: corners
                .chunks_exact(3)
                .map(|face| obj::Face {
                    corners: face.iter().map(corner).collect(),
                    object: None,
                    group: None,
                    line: 1,
                })
                .collect(),
            ..obj::Document::default()
        };
        let options = UvOptions { uv_scale: scale, ..UvOptions::default() };
        if let Ok(read) = assemble(document, String::new(), &options) {
            // What is accepted keeps the promises of its types.
            let (pattern, mesh) = (&read.garment.pattern, &read.garment.mesh);
            prop_assert!((0..mesh.triangles.len()).all(|t| mesh.rest_area(t, &mesh.x_bar) > 0.0));
            for stitch in &pattern.stitches {
                let cloth = |id| mesh.along(id).iter().map(|v| mesh.sewing[*v as usize]);
                let [a, b] = stitch.sides;
                let mut b: Vec<u32> = cloth(b).collect();
                if !stitch.right_wrong {
                    b.reverse();
                }
                prop_assert_eq!(cloth(a).collect::<Vec<_>>(), b);
            }
        }
    }
}

/// A drape of the shared data, where they are at hand.
fn shared_drape(name: &str) -> Option<std::path::PathBuf> {
    let mut files = shared(&["garments/obj"], "obj").into_iter();
    files.find(|path| path.ends_with(name))
}

#[test]
fn the_shared_t_shirt_has_four_panels_and_opens_at_neck_hem_and_sleeves() {
    let Some(path) = shared_drape("diffavatar_tshirt.obj") else {
        return;
    };
    let read = super::read(&path, &UvOptions::default()).unwrap();
    let (pattern, mesh) = (&read.garment.pattern, &read.garment.mesh);
    println!("{}", read.notes.join("\n"));
    for panel in &pattern.panels {
        let lengths: Vec<String> = (0..panel.edges.len())
            .map(|e| format!("{:.3}", panel.edge_length(e)))
            .collect();
        println!(
            "{} {:.3} m², edges {}",
            panel.name,
            panel.signed_area(),
            lengths.join(" ")
        );
    }
    for stitch in &pattern.stitches {
        println!("{stitch:?}");
    }
    assert_eq!(
        read.frame,
        FileFrame {
            metres_per_unit: 0.01,
            up: UpAxis::Y
        }
    );
    // Median ratio of the lengths in the drape [cm] and in the texture, counted independently.
    assert!((read.uv_scale - 1.1514).abs() < 1e-3, "{}", read.uv_scale);
    assert_eq!(pattern.panels.len(), 4);
    // One sleeve is the texture of the other turned over.
    assert_eq!(mesh.right_side_up.iter().filter(|up| !**up).count(), 1);
    assert_eq!(mesh.x_bar.len(), 2929);
    let round = write(
        &read.garment,
        &mesh.x_bar,
        read.garment.drape.as_ref().unwrap(),
        read.frame,
    );
    let again = parse(&round, &UvOptions::default()).unwrap();
    assert_eq!(again.notes, Vec::<String>::new());
    assert_eq!(again.garment.pattern.stitches, pattern.stitches);
    assert_eq!(again.garment.mesh.edge_vertices, mesh.edge_vertices);
}

#[test]
fn the_shared_dress_is_refused_for_its_warped_texture() {
    let Some(path) = shared_drape("diffavatar_dress_shortsleeve.obj") else {
        return;
    };
    let error = super::read(&path, &UvOptions::default())
        .unwrap_err()
        .to_string();
    println!("{error}");
    assert!(error.contains("folded over"), "{error}");
}
