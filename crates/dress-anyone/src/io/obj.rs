//! Wavefront OBJ as a document: `v` and `vt` as two numberings, polygons, groups, comments.
//!
//! The two index streams stay apart because a garment's seams are where they disagree. Negative
//! indices, continued lines, colours after coordinates and statements that are of no use here are
//! all accepted; what is wrong is told by line. [`ObjText`] writes the same statements.

use super::source::{Problems, Surface};
use crate::body::FileFrame;
use crate::geometry::{TriangleMesh, Vec2, Vec3};
use crate::problem::Problem;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// An OBJ file in its own unit and axes; all indices are in range and count from 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    /// `v`, `[vertex]`.
    pub positions: Vec<Vec3>,
    /// `vt`, `[uv]`.
    pub uvs: Vec<Vec2>,
    /// `f`, in the file's order.
    pub faces: Vec<Face>,
    /// Every name that an `o` or `g` gave.
    pub names: Vec<String>,
    /// Text of every `#` line, trimmed.
    pub comments: Vec<String>,
}

/// One polygon.
#[derive(Clone, Debug, PartialEq)]
pub struct Face {
    /// Three or more, in the file's winding.
    pub corners: Vec<Corner>,
    /// Name of its object (`o`), index into [`Document::names`].
    pub object: Option<u32>,
    /// Name of its group (`g`), index into [`Document::names`].
    pub group: Option<u32>,
    /// Where it stands, counted from 1.
    pub line: usize,
}

/// One corner of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corner {
    /// Index into [`Document::positions`].
    pub v: u32,
    /// Index into [`Document::uvs`].
    pub vt: Option<u32>,
}

/// Reads an OBJ document, or says by line everything that is wrong with it.
pub fn parse(bytes: &[u8]) -> Result<Document, Vec<Problem>> {
    let text = String::from_utf8_lossy(bytes);
    let mut reader = Reader::default();
    let mut continued = String::new();
    let mut first_line = 0;
    for (i, line) in text.lines().enumerate() {
        if continued.is_empty() {
            first_line = i + 1;
        }
        if let Some(start) = line.trim_end().strip_suffix('\\') {
            continued.push_str(start);
            continued.push(' ');
        } else if continued.is_empty() {
            reader.statement(line, first_line);
        } else {
            continued.push_str(line);
            reader.statement(&continued, first_line);
            continued.clear();
        }
    }
    reader.statement(&continued, first_line);
    reader.finish()
}

#[derive(Default)]
struct Reader {
    document: Document,
    name_index: BTreeMap<String, u32>,
    object: Option<u32>,
    group: Option<u32>,
    problems: Problems,
}

impl Reader {
    fn statement(&mut self, text: &str, line: usize) {
        let text = text.trim();
        if let Some(comment) = text.strip_prefix('#') {
            self.document.comments.push(comment.trim().to_owned());
            return;
        }
        let text = text.split('#').next().unwrap_or_default().trim();
        let (keyword, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        match keyword {
            "v" => {
                let position = Vec3::from(self.numbers(rest, 3, line));
                self.document.positions.push(position);
            }
            "vt" => {
                let [u, v, _] = self.numbers(rest, 1, line);
                self.document.uvs.push(Vec2::new(u, v));
            }
            "f" => self.face(rest, line),
            "o" => self.object = self.name(rest),
            "g" => self.group = self.name(rest),
            _ => {}
        }
    }

    /// The first three numbers; the ones beyond `needed` may be missing. A bad number is a problem
    /// and reads as 0, so that later indices keep their meaning.
    fn numbers(&mut self, rest: &str, needed: usize, line: usize) -> [f64; 3] {
        let mut values = [0.0; 3];
        let mut count = 0;
        for (value, word) in values.iter_mut().zip(rest.split_whitespace()) {
            count += 1;
            match word.parse() {
                Ok(number) => {
                    *value = number;
                    self.problems.check_coordinate(number, || at(line));
                }
                Err(_) => self
                    .problems
                    .at(at(line), format!("`{word}` is not a number")),
            }
        }
        if count < needed {
            let text = format!("{needed} numbers are needed and {count} are given");
            self.problems.at(at(line), text);
        }
        values
    }

    fn face(&mut self, rest: &str, line: usize) {
        let mut corners = Vec::new();
        for word in rest.split_whitespace() {
            let mut parts = word.split('/');
            let v = parts.next().unwrap_or_default();
            let v = self.index(v, self.document.positions.len(), word, line);
            let vt = match parts.next() {
                None | Some("") => None,
                Some(vt) => self.index(vt, self.document.uvs.len(), word, line),
            };
            corners.extend(v.map(|v| Corner { v, vt }));
        }
        if rest.split_whitespace().nth(2).is_none() {
            let text = "a face needs three corners or more; delete it or complete it";
            self.problems.at(at(line), text);
        }
        self.document.faces.push(Face {
            corners,
            object: self.object,
            group: self.group,
            line,
        });
    }

    /// Index from 0; a negative one counts back from the latest of the `count` so far. Whether a
    /// positive one exists is known only at the end of the file.
    fn index(&mut self, text: &str, count: usize, word: &str, line: usize) -> Option<u32> {
        let number: Option<i64> = text.parse().ok();
        let index = match number {
            None => Err(format!("`{word}` is not a face corner")),
            Some(0) => Err(format!(
                "`{word}`: indices of an OBJ file start at 1, not 0"
            )),
            Some(n) if n > 0 => {
                u32::try_from(n - 1).map_err(|_| format!("`{word}`: the index is out of range"))
            }
            Some(n) => usize::try_from(n.unsigned_abs())
                .ok()
                .and_then(|back| count.checked_sub(back))
                .map(|i| i as u32)
                .ok_or_else(|| format!("`{word}` counts back beyond the {count} listed so far")),
        };
        index.map_err(|text| self.problems.at(at(line), text)).ok()
    }

    fn name(&mut self, rest: &str) -> Option<u32> {
        if rest.trim().is_empty() {
            return None;
        }
        let next = self.name_index.len() as u32;
        let index = *self
            .name_index
            .entry(rest.trim().to_owned())
            .or_insert(next);
        if index == next {
            self.document.names.push(rest.trim().to_owned());
        }
        Some(index)
    }

    fn finish(mut self) -> Result<Document, Vec<Problem>> {
        let (v_count, vt_count) = (self.document.positions.len(), self.document.uvs.len());
        if v_count == 0 {
            self.problems
                .whole("holds no vertices (`v` lines): it is empty or no OBJ file");
        }
        for face in &self.document.faces {
            for corner in &face.corners {
                if corner.v as usize >= v_count && v_count > 0 {
                    let text = format!(
                        "vertex {} does not exist: the file has {v_count}",
                        u64::from(corner.v) + 1
                    );
                    self.problems.at(at(face.line), text);
                }
                if let Some(vt) = corner.vt.filter(|vt| *vt as usize >= vt_count) {
                    let text = format!(
                        "texture coordinate {} does not exist: the file has {vt_count}",
                        u64::from(vt) + 1
                    );
                    self.problems.at(at(face.line), text);
                }
            }
        }
        self.problems.unless_any(self.document)
    }
}

fn at(line: usize) -> String {
    format!("line {line}")
}

impl Document {
    /// The bare surface, without texture coordinates and names.
    pub(crate) fn into_surface(self) -> Surface {
        let polygon = |face: Face| face.corners.iter().map(|corner| corner.v).collect();
        Surface {
            positions: self.positions,
            polygons: self.faces.into_iter().map(polygon).collect(),
        }
    }
}

/// An OBJ file in the making. Points are given in metres, y up, and written in the file's frame,
/// rounded to a tenth of a micrometre.
pub struct ObjText {
    text: String,
    frame: FileFrame,
    decimals: usize,
}

impl ObjText {
    /// Starts with lines that say what this is, and its unit.
    pub fn new(title: &str, frame: FileFrame) -> Self {
        // A coordinate of one micrometre tenth is 1e-7 in metres, 1e-5 in centimetres.
        let decimals = (7.0 + frame.metres_per_unit.log10())
            .ceil()
            .clamp(0.0, 12.0) as usize;
        let mut obj = Self {
            text: String::new(),
            frame,
            decimals,
        };
        obj.comment(title);
        obj.comment(&format!(
            "unit: {}, {} up",
            frame.unit_name(),
            frame.up.name()
        ));
        obj
    }

    /// Comment lines.
    pub fn comment(&mut self, text: &str) {
        for line in text.lines() {
            self.line(format_args!("# {line}"));
        }
    }

    /// A `v` line from metres, y up.
    pub fn position(&mut self, p: Vec3) {
        let p = self.frame.from_si(p);
        let n = self.decimals;
        self.line(format_args!("v {:.n$} {:.n$} {:.n$}", p.x, p.y, p.z));
    }

    /// A `vt` line from metres.
    pub fn uv(&mut self, p: Vec2) {
        let p = p / self.frame.metres_per_unit;
        let n = self.decimals;
        self.line(format_args!("vt {:.n$} {:.n$}", p.x, p.y));
    }

    /// A `g` line; the faces that follow are of this group.
    pub fn group(&mut self, name: &str) {
        self.line(format_args!("g {}", name.replace(char::is_control, " ")));
    }

    /// An `f` line of three vertices, indices from 0.
    pub fn triangle(&mut self, v: [u32; 3]) {
        let [a, b, c] = v.map(|v| v + 1);
        self.line(format_args!("f {a} {b} {c}"));
    }

    /// An `f` line of three vertices and their texture coordinates, indices from 0.
    pub fn triangle_with_uvs(&mut self, v: [u32; 3], vt: [u32; 3]) {
        let ([a, b, c], [k, l, m]) = (v.map(|v| v + 1), vt.map(|vt| vt + 1));
        self.line(format_args!("f {a}/{k} {b}/{l} {c}/{m}"));
    }

    /// The file's text.
    pub fn finish(self) -> String {
        self.text
    }

    fn line(&mut self, arguments: std::fmt::Arguments) {
        writeln!(self.text, "{arguments}").expect("writing to a string never fails");
    }
}

/// A mesh as OBJ text in `frame`.
pub fn mesh_text(title: &str, mesh: &TriangleMesh, frame: FileFrame) -> String {
    let mut obj = ObjText::new(title, frame);
    for p in &mesh.positions {
        obj.position(*p);
    }
    for t in &mesh.triangles {
        obj.triangle(*t);
    }
    obj.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn problems(text: &str) -> Vec<String> {
        let problems = parse(text.as_bytes()).expect_err("this file is wrong");
        problems.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn both_index_streams_groups_and_comments_are_kept() {
        let text = "# made by hand\no shirt\nv 0 0 0 1 0.5 0.5\nv 1 0 0 # right\nv 1 1 0\nv 0 1 0\n\
                    vt 0 0\nvt 1 0 0\nvt 1\ng front\nf 1/1 2/2/7 -2/-1\nusemtl x\ng back\nf 1//1 \\\n3//1 4//1\n";
        let document = parse(text.as_bytes()).unwrap();
        assert_eq!(document.positions[1], Vec3::new(1.0, 0.0, 0.0));
        assert_eq!(document.uvs[2], Vec2::new(1.0, 0.0));
        assert_eq!(document.comments, ["made by hand"]);
        assert_eq!(document.names, ["shirt", "front", "back"]);
        let corner = |v, vt| Corner { v, vt };
        assert_eq!(
            document.faces[0],
            Face {
                corners: vec![corner(0, Some(0)), corner(1, Some(1)), corner(2, Some(2))],
                object: Some(0),
                group: Some(1),
                line: 11
            }
        );
        // The continued line is counted once, where it starts.
        assert_eq!(document.faces[1].line, 14);
        assert_eq!(
            document.faces[1].corners,
            [corner(0, None), corner(2, None), corner(3, None)]
        );
    }

    #[test]
    fn every_problem_is_told_with_its_line() {
        let text =
            "v 0 nan 0\nv 0 0\nv 1 x 0\nvt\nf 1 2 0\nf 1 2\nf 1 2 9\nf 1/5 2/1 -7\nf a b c\n";
        let found = problems(text);
        let lines: Vec<&str> = found.iter().map(|p| &p[..6]).collect();
        // Indices beyond the end are only known at the end; `f a b c` has three bad corners.
        let expected = [1, 2, 3, 4, 5, 6, 8, 9, 9, 9, 7, 8].map(|n| format!("line {n}"));
        assert_eq!(lines, expected, "{found:#?}");
    }

    #[test]
    fn a_long_list_of_problems_is_cut() {
        let found = problems(&"v 0 0 inf\n".repeat(25));
        assert_eq!(found.len(), 21);
        assert_eq!(found[20], "and 5 more");
    }

    #[test]
    fn an_empty_file_is_called_empty() {
        assert!(problems("# nothing\n")[0].contains("no vertices"));
    }

    #[test]
    fn a_written_mesh_reads_back() {
        let mesh = TriangleMesh {
            positions: vec![
                Vec3::new(0.123_456_78, 1.5, -0.2),
                Vec3::zeros(),
                Vec3::new(1.0, 2.0, 3.0),
            ],
            triangles: vec![[0, 1, 2]],
        };
        let frame = FileFrame {
            metres_per_unit: 0.01,
            up: crate::body::UpAxis::Z,
        };
        let document = parse(mesh_text("a triangle", &mesh, frame).as_bytes()).unwrap();
        for (p, q) in mesh.positions.iter().zip(&document.positions) {
            // Half of the last digit, 1e-7 m.
            assert!((p - frame.to_si(*q)).norm() < 1e-7);
        }
        assert_eq!(document.into_surface().polygons, [vec![0, 1, 2]]);
    }

    proptest! {
        #[test]
        fn arbitrary_statements_never_panic(text in "([vfgo#]|vt|[-0-9/ .e\\\\]|\n){0,200}") {
            let _ = parse(text.as_bytes());
        }

        #[test]
        fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = parse(&bytes);
        }
    }
}
