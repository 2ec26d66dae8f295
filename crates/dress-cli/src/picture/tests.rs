use super::*;
use dress_anyone::geometry::Vec2;
use std::path::PathBuf;

/// A rippled cylinder about the vertical through the origin, outward side in front.
fn tube(radius: f64, low: f64, high: f64, around: u32, rows: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for row in 0..=rows {
        for i in 0..around {
            let angle = f64::from(i) / f64::from(around) * std::f64::consts::TAU;
            let y = low + (high - low) * f64::from(row) / f64::from(rows);
            let ripple = 1.0 + 0.06 * (angle * 9.0).sin() * (high - y);
            let [x, z] = [angle.sin(), angle.cos()].map(|v| v * radius * ripple);
            mesh.positions.push(Vec3::new(x, y, z));
        }
    }
    for row in 0..rows {
        for i in 0..around {
            let [a, b] = [i, (i + 1) % around].map(|i| row * around + i);
            let [c, d] = [a + around, b + around];
            mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh
}

struct Pixels {
    width: usize,
    data: Vec<u8>,
}

fn decoded(bytes: &[u8]) -> Pixels {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
        .read_info()
        .expect("a header");
    let mut data = vec![0; reader.output_buffer_size().expect("a picture")];
    let info = reader.next_frame(&mut data).expect("a frame");
    Pixels {
        width: info.width as usize,
        data,
    }
}

impl Pixels {
    fn count(&self, wanted: impl Fn([i32; 3]) -> bool) -> usize {
        let pixels = self.data.chunks(3);
        pixels
            .filter(|p| wanted([0, 1, 2].map(|i| i32::from(p[i]))))
            .count()
    }
}

/// The wrong side's hue: red and blue well above green.
fn is_plum([r, g, b]: [i32; 3]) -> bool {
    r > g + 25 && b > g + 20
}

fn figure<'a>(body: &'a TriangleMesh, cloth: &'a TriangleMesh, panels: &'a [usize]) -> Figure<'a> {
    Figure {
        caption: "tube",
        body,
        cloth_positions: &cloth.positions,
        cloth_triangles: &cloth.triangles,
        panel_of_triangle: panels,
        seam_edges: &[],
        scalar: None,
    }
}

#[test]
fn cloth_worn_inside_out_is_plum_and_cloth_worn_right_is_not() {
    let body = tube(0.1, 0.0, 1.7, 24, 20);
    let mut cloth = tube(0.14, 0.8, 1.4, 48, 20);
    let panels = vec![0; cloth.triangles.len()];
    let plum = |cloth: &TriangleMesh| {
        let png = preview("", &[figure(&body, cloth, &panels)], &[View::Front]);
        decoded(&png).count(is_plum)
    };
    let right = plum(&cloth);
    for triangle in &mut cloth.triangles {
        triangle.swap(0, 1);
    }
    let inside_out = plum(&cloth);
    assert!(
        inside_out > 20_000 && right * 50 < inside_out,
        "right side out {right}, inside out {inside_out} pixels"
    );
}

#[test]
fn columns_are_at_one_scale() {
    // The same cloth beside a body twice as high is as wide in both tiles.
    let bodies = [tube(0.05, 0.0, 1.0, 24, 20), tube(0.05, 0.0, 2.0, 24, 20)];
    let cloth = tube(0.2, 0.5, 0.9, 48, 20);
    let panels = vec![1; cloth.triangles.len()];
    let both: Vec<Figure> = bodies.iter().map(|b| figure(b, &cloth, &panels)).collect();
    let pixels = decoded(&preview("", &both, &[View::Front]));
    let half = pixels.width / 2;
    let coloured = |columns: std::ops::Range<usize>| {
        let inside = |i: usize| columns.contains(&(i % pixels.width));
        let saturated = |p: &[u8]| p[0] > p[2].saturating_add(20);
        let pixels = pixels.data.chunks(3).enumerate();
        pixels.filter(|(i, p)| inside(*i) && saturated(p)).count()
    };
    let (left, right) = (coloured(0..half), coloured(half..pixels.width));
    assert!(left > 10_000, "{left}");
    // Same silhouette; the lights of other pixels' rounding move a hundredth.
    assert!(left.abs_diff(right) < left / 50, "{left} {right}");
}

#[test]
fn nothing_to_draw_and_nonsense_are_still_a_picture() {
    assert!(decoded(&preview("", &[], &[View::Front])).width > 0);
    let empty = TriangleMesh::default();
    let mut cloth = tube(0.2, 0.5, 0.9, 8, 2);
    cloth.positions[3] = Vec3::repeat(f64::NAN);
    let panels = vec![0; cloth.triangles.len()];
    let mut lost = figure(&empty, &cloth, &panels);
    let scalar = vec![f64::NAN; cloth.positions.len()];
    lost.scalar = Some(&scalar);
    lost.caption = "naïve – \u{1f457}";
    assert!(decoded(&preview("t", &[lost], &[View::Front, View::Back])).width > 0);
}

#[test]
fn the_scale_ends_at_a_round_number_above_nearly_everything() {
    // [m] and its top [m]: never below a millimetre.
    for (value, top) in [
        (0.0, 1e-3),
        (1.6e-3, 2e-3),
        (0.021, 0.03),
        (0.2, 0.2),
        (0.09, 0.1),
    ] {
        assert!((scale_top(&[value; 9]) - top).abs() < 1e-12, "{value}");
    }
    assert_eq!(summary(&[]), "");
    assert_eq!(
        summary(&[0.001, 0.003]),
        "mean 2.0, 95% below 3.0, max 3.0 mm"
    );
}

/// Two squares sewn along one side: triangles, and their helpers.
fn two_sewn_squares() -> PatternMesh {
    let square = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]];
    let x_bar = [square, square].concat();
    PatternMesh {
        x_bar: x_bar.into_iter().map(Vec2::from).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
        panel_vertices: vec![0..4, 4..8],
        panel_triangles: vec![0..2, 2..4],
        right_side_up: vec![true, true],
        edge_vertices: [0, 4]
            .map(|o| [[0, 1], [1, 2], [2, 3], [3, 0]].map(|e| e.map(|v| v + o).to_vec()))
            .map(Vec::from)
            .to_vec(),
        sewing: vec![0, 1, 2, 3, 1, 4, 5, 2],
        cloth_vertex_count: 6,
    }
}

#[test]
fn seams_are_the_edges_two_panels_share() {
    let mesh = two_sewn_squares();
    assert_eq!(seam_edges(&mesh), [[1, 2]]);
    assert_eq!(panel_of_triangle(&mesh), [0, 0, 1, 1]);
}

#[test]
fn a_flipped_triangle_of_the_pattern_alarms() {
    let mesh = two_sewn_squares();
    let red = |x_bar: &[Vec2]| {
        let pixels = decoded(&pattern_png(&mesh, x_bar, &["front", "back"]));
        pixels.count(|[r, g, b]| r > 180 && g < 90 && b < 90)
    };
    assert_eq!(red(&mesh.x_bar), 0);
    let mut crossed = mesh.x_bar.clone();
    crossed[3] = Vec2::new(0.1, -0.05);
    assert!(red(&crossed) > 1000);
}

/// Shared data beside the repository, or where `DRESS_SHARED` says.
fn shared(path: &str) -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let root = std::env::var_os("DRESS_SHARED").map_or(beside, PathBuf::from);
    let file = root.join("data").join(path);
    file.exists().then_some(file)
}

/// Vertices and faces only.
fn read_obj(path: &std::path::Path) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for line in std::fs::read_to_string(path).expect("a body").lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |i: usize| words[i].parse::<f64>().expect("a coordinate");
        let index = |i: usize| words[i].split('/').next().map(str::parse::<u32>);
        match words.first() {
            Some(&"v") => mesh
                .positions
                .push(Vec3::new(number(1), number(2), number(3))),
            Some(&"f") => mesh
                .triangles
                .push([1, 2, 3].map(|i| index(i).expect("a word").expect("an index") - 1)),
            _ => {}
        }
    }
    mesh
}

/// A look at the whole: `DRESS_PICTURES=folder cargo test -p dress-cli contact_sheet`.
#[test]
fn a_contact_sheet_of_real_bodies_is_drawn() {
    let names = ["f_average", "m_muscular", "f_heavy", "child"];
    let bodies: Option<Vec<TriangleMesh>> = names
        .iter()
        .map(|name| shared(&format!("bodies/cc0/{name}.obj")).map(|file| read_obj(&file)))
        .collect();
    let Some(bodies) = bodies else {
        eprintln!("skipped: no shared data");
        return;
    };
    let cloth = tube(0.19, 0.75, 1.32, 220, 130);
    let quarter = |t: usize| (t / 2 % 220) / 55;
    let panels: Vec<usize> = (0..cloth.triangles.len()).map(quarter).collect();
    let seams: Vec<[u32; 2]> = (0..130 * 4)
        .map(|i| (i / 4 * 220) + (i % 4) * 55)
        .map(|v| [v, v + 220])
        .collect();
    let scalar: Vec<f64> = cloth
        .positions
        .iter()
        .map(|p| 0.03 * (1.32 - p.y) * (1.0 + (5.0 * p.x).sin()))
        .collect();
    let captions = [
        "source",
        "x*: what to aim for",
        "first guess",
        "result: distance to x*",
    ];
    let figures: Vec<Figure> = (0..4)
        .map(|i| Figure {
            caption: captions[i],
            body: &bodies[i],
            cloth_positions: &cloth.positions,
            cloth_triangles: &cloth.triangles,
            panel_of_triangle: &panels,
            seam_edges: &seams,
            scalar: (i == 3).then_some(&scalar),
        })
        .collect();
    let start = std::time::Instant::now();
    let sheet = preview(
        "tube: f_average to child",
        &figures,
        &[View::Front, View::Back],
    );
    eprintln!("drawn in {:.2?}, {} bytes", start.elapsed(), sheet.len());
    assert!(sheet.len() > 50_000);
    if let Some(folder) = std::env::var_os("DRESS_PICTURES") {
        let folder = PathBuf::from(folder);
        std::fs::write(folder.join("sheet.png"), sheet).expect("a folder");
        let views = [View::Front, View::ThreeQuarter, View::Back];
        let one = preview("", &figures[..1], &views[1..2]);
        std::fs::write(folder.join("one.png"), one).expect("a folder");
        let three = preview("three views", &figures[3..], &views);
        std::fs::write(folder.join("three.png"), three).expect("a folder");
    }
}
