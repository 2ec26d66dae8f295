//! Cutting a textured mesh along its texture seams: pattern vertices are the distinct pairs of
//! (`v`, `vt`), panels the islands of faces that share such pairs.
//!
//! Pairs rather than bare `vt`: two panels that a texture lays on top of one another stay two.

use crate::geometry::cross2;
use crate::geometry::groups::Groups;
use crate::io::obj::{Document, Face};
use crate::io::source::Problems;
use crate::problem::Problem;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// A textured mesh in triangles, cut into its islands.
pub(super) struct Islands {
    /// `[panel]`.
    pub(super) names: Vec<String>,
    /// Index of the texture coordinate, `[pattern vertex]`.
    pub(super) uvs: Vec<u32>,
    /// Cloth vertex, `[pattern vertex]`.
    pub(super) sewing: Vec<u32>,
    /// Index of the position in the file, `[cloth vertex]`.
    pub(super) cloth: Vec<u32>,
    /// Pattern vertices in the file's winding, by panel.
    pub(super) triangles: Vec<[u32; 3]>,
    /// `[panel]`.
    pub(super) panel_vertices: Vec<Range<usize>>,
    /// `[panel]`.
    pub(super) panel_triangles: Vec<Range<usize>>,
}

/// Cuts a document into islands; sews it first if it came in unsewn pieces.
pub(super) fn cut(
    document: &mut Document,
    notes: &mut Vec<String>,
) -> Result<Islands, Vec<Problem>> {
    check_textured(document)?;
    let mut cutting = Cutting::new(document);
    if cutting.is_unsewn() && weld_borders(document, notes) {
        cutting = Cutting::new(document);
    }
    let islands = cutting.islands(document, notes);
    check_flat(document, &islands)?;
    Ok(islands)
}

fn check_textured(document: &Document) -> Result<(), Vec<Problem>> {
    let mut problems = Problems::default();
    if document.faces.is_empty() {
        problems.whole("holds no faces");
    }
    let bare = |face: &&Face| face.corners.iter().any(|corner| corner.vt.is_none());
    let bare: Vec<usize> = document.faces.iter().filter(bare).map(|f| f.line).collect();
    match bare.first() {
        Some(_) if bare.len() == document.faces.len() => problems.whole(
            "has no texture coordinates (`vt`), so there is no pattern in it: export the garment \
             with its UVs being the pattern, or give the pattern as a GarmentCode file",
        ),
        Some(line) => problems.at(
            format!("line {line}"),
            format!(
                "{} of {} faces have no texture coordinates, this one first",
                bare.len(),
                document.faces.len()
            ),
        ),
        None => {}
    }
    problems.unless_any(())
}

/// A (`vt`, `v`) pair.
type Pair = (u32, u32);

/// The pairs, what connects them, and the faces in pairs.
struct Cutting {
    pairs: BTreeMap<Pair, usize>,
    /// Pairs by number, `[triangle][corner]`, and the face each comes from.
    triangles: Vec<([usize; 3], usize)>,
    dropped: usize,
}

impl Cutting {
    fn new(document: &Document) -> Self {
        let mut pairs: BTreeMap<Pair, usize> = BTreeMap::new();
        for face in &document.faces {
            pairs.extend(pairs_of(face).into_iter().map(|pair| (pair, 0)));
        }
        for (i, index) in pairs.values_mut().enumerate() {
            *index = i;
        }
        let mut triangles = Vec::new();
        let mut dropped = 0;
        for (f, face) in document.faces.iter().enumerate() {
            for triangle in fan(document, &pairs_of(face)) {
                let [a, b, c] = triangle.map(|pair| pairs[&pair]);
                if a == b || b == c || c == a {
                    dropped += 1;
                } else {
                    triangles.push(([a, b, c], f));
                }
            }
        }
        Self {
            pairs,
            triangles,
            dropped,
        }
    }

    /// Whether no position is used by two pairs, so that nothing is sewn to anything.
    fn is_unsewn(&self) -> bool {
        let positions: BTreeSet<u32> = self.pairs.keys().map(|pair| pair.1).collect();
        positions.len() == self.pairs.len()
    }

    fn islands(self, document: &Document, notes: &mut Vec<String>) -> Islands {
        if self.dropped > 0 {
            notes.push(format!("{} faces of no extent were left out", self.dropped));
        }
        let pairs: Vec<Pair> = self.pairs.keys().copied().collect();
        let mut groups = Groups::new(pairs.len());
        for ([a, b, c], _) in &self.triangles {
            groups.join([*a, *b].map(|pair| pair as u32));
            groups.join([*b, *c].map(|pair| pair as u32));
        }
        // Panels in the order of their first faces.
        let mut panel_of = BTreeMap::new();
        let mut members: Vec<Vec<usize>> = Vec::new();
        let mut panel_faces: Vec<Vec<([usize; 3], usize)>> = Vec::new();
        for triangle in &self.triangles {
            let panel = *panel_of
                .entry(groups.first_of(triangle.0[0] as u32))
                .or_insert(members.len());
            if panel == members.len() {
                members.push(Vec::new());
                panel_faces.push(Vec::new());
            }
            panel_faces[panel].push(*triangle);
        }
        for pair in 0..pairs.len() {
            if let Some(panel) = panel_of.get(&groups.first_of(pair as u32)) {
                members[*panel].push(pair);
            }
        }
        let order: Vec<usize> = members.concat();
        let mut vertex_of = vec![0; pairs.len()];
        for (vertex, pair) in order.iter().enumerate() {
            vertex_of[*pair] = vertex as u32;
        }
        let used: BTreeSet<u32> = order.iter().map(|pair| pairs[*pair].1).collect();
        let cloth: Vec<u32> = used.into_iter().collect();
        if cloth.len() < document.positions.len() {
            let unused = document.positions.len() - cloth.len();
            notes.push(format!(
                "{unused} vertices belong to no face and were left out"
            ));
        }
        let sewn = |pair: &usize| cloth.partition_point(|v| *v < pairs[*pair].1) as u32;
        let flat = panel_faces.iter().flatten();
        Islands {
            names: names(document, &panel_faces),
            uvs: order.iter().map(|pair| pairs[*pair].0).collect(),
            sewing: order.iter().map(sewn).collect(),
            triangles: flat.map(|(t, _)| t.map(|pair| vertex_of[pair])).collect(),
            panel_vertices: ranges(members.iter().map(Vec::len)),
            panel_triangles: ranges(panel_faces.iter().map(Vec::len)),
            cloth,
        }
    }
}

fn pairs_of(face: &Face) -> Vec<Pair> {
    let pair = |corner: &crate::io::obj::Corner| corner.vt.map(|vt| (vt, corner.v));
    face.corners.iter().filter_map(pair).collect()
}

/// Triangles of a polygon: of all fans the one whose slimmest triangle is the largest, and none
/// is turned over.
fn fan(document: &Document, polygon: &[Pair]) -> Vec<[Pair; 3]> {
    let n = polygon.len();
    let from = |apex: usize| -> Vec<[Pair; 3]> {
        let corner = |i: usize| polygon[(apex + i) % n];
        (1..n - 1)
            .map(|i| [corner(0), corner(i), corner(i + 1)])
            .collect()
    };
    let doubled_area = |t: &[Pair; 3]| {
        let [a, b, c] = t.map(|(vt, _)| document.uvs[vt as usize]);
        cross2(b - a, c - a)
    };
    let sign = from(0).iter().map(doubled_area).sum::<f64>().signum();
    let slimmest = |fan: &[[Pair; 3]]| {
        let areas = fan.iter().map(|t| sign * doubled_area(t));
        areas.fold(f64::INFINITY, f64::min)
    };
    let mut best = from(0);
    // Large polygons are cut from their first corner: trying all would take quadratic time.
    for apex in 1..if (4..32).contains(&n) { n } else { 1 } {
        let other = from(apex);
        if slimmest(&other) > slimmest(&best) {
            best = other;
        }
    }
    best
}

/// Joins positions that coincide exactly along the borders; whether there were any.
fn weld_borders(document: &mut Document, notes: &mut Vec<String>) -> bool {
    let mut uses: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for face in &document.faces {
        let next = face.corners.iter().cycle().skip(1);
        for (a, b) in face.corners.iter().zip(next) {
            *uses.entry([a.v.min(b.v), a.v.max(b.v)]).or_default() += 1;
        }
    }
    let border = uses.iter().filter(|(_, uses)| **uses == 1);
    let border: BTreeSet<u32> = border.flat_map(|(edge, _)| *edge).collect();
    let mut first_at: BTreeMap<[u64; 3], u32> = BTreeMap::new();
    let mut joined: BTreeMap<u32, u32> = BTreeMap::new();
    for v in border {
        let p = document.positions[v as usize];
        let first = *first_at
            .entry([p.x, p.y, p.z].map(|c| (c + 0.0).to_bits()))
            .or_insert(v);
        if first != v {
            joined.insert(v, first);
        }
    }
    for corner in document.faces.iter_mut().flat_map(|face| &mut face.corners) {
        corner.v = *joined.get(&corner.v).unwrap_or(&corner.v);
    }
    if !joined.is_empty() {
        notes.push(format!(
            "the panels were not welded: {} border vertices at the same place were sewn",
            joined.len()
        ));
    }
    !joined.is_empty()
}

/// Group names, else object names, if every island has one of its own; else numbers.
fn names(document: &Document, panels: &[Vec<([usize; 3], usize)>]) -> Vec<String> {
    let by = |name: fn(&Face) -> Option<u32>| -> Option<Vec<String>> {
        let mut taken = BTreeSet::new();
        let mut names = Vec::new();
        for triangles in panels {
            let own: BTreeSet<Option<u32>> = triangles
                .iter()
                .map(|(_, face)| name(&document.faces[*face]))
                .collect();
            let only = if own.len() == 1 {
                own.into_iter().next()?
            } else {
                None
            }?;
            names.push(document.names[only as usize].clone());
            taken.insert(only);
        }
        (taken.len() == panels.len()).then_some(names)
    };
    by(|face| face.group)
        .or_else(|| by(|face| face.object).filter(|_| panels.len() > 1))
        .unwrap_or_else(|| (0..panels.len()).map(|i| format!("panel_{i}")).collect())
}

fn ranges(lengths: impl Iterator<Item = usize>) -> Vec<Range<usize>> {
    let mut end = 0;
    lengths
        .map(|length| {
            let start = end;
            end += length;
            start..end
        })
        .collect()
}

/// A pattern lies flat: within an island no face may be turned over, or have no area.
fn check_flat(document: &Document, islands: &Islands) -> Result<(), Vec<Problem>> {
    let mut problems = Problems::default();
    if islands.triangles.is_empty() {
        problems.whole("all faces are of no extent");
    }
    let mut any = false;
    for (name, range) in islands.names.iter().zip(&islands.panel_triangles) {
        let areas: Vec<f64> = islands.triangles[range.clone()]
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| document.uvs[islands.uvs[v as usize] as usize]);
                cross2(b - a, c - a)
            })
            .collect();
        let sign = areas.iter().sum::<f64>().signum();
        let folded = areas.iter().filter(|area| sign * **area <= 0.0).count();
        if folded > 0 {
            problems.at(
                format!("panel `{name}`"),
                format!(
                    "{folded} of its {} faces are folded over or without area in the texture",
                    areas.len()
                ),
            );
            any = true;
        }
    }
    if any {
        problems.whole("such a texture is no pattern that can be cut: export the pattern as UVs");
    }
    problems.unless_any(())
}
