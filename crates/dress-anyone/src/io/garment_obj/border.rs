//! Borders of the islands: loops, what they are sewn to, and where one edge ends and the next
//! begins.
//!
//! A border runs as the file winds its faces, so counter-clockwise around a panel that lies right
//! side up and clockwise around one that lies face down. An edge ends where its seam starts, ends
//! or changes partner, and where the outline turns sharply; a corner on one side of a seam is one
//! on the other side too, so that stitches join whole edges.

use super::islands::Islands;
use crate::garment::Garment;
use crate::geometry::{Mat3, Vec2, Vec3, cross2, signed_area};
use crate::io::source::Problems;
use crate::pattern::{Curve, Edge, EdgeId, Panel, Placement, Stitch};
use crate::problem::Problem;
use std::collections::{BTreeMap, BTreeSet};

/// A turn by more than this is a corner \[rad\].
const CORNER: f64 = 30.0 * std::f64::consts::PI / 180.0;

/// How far before and after a vertex its turn is measured \[m\].
const WINDOW: f64 = 0.01;

/// One mesh edge of a border.
pub(super) struct Side {
    /// Pattern vertices.
    pub(super) ends: [u32; 2],
    /// The side it is sewn to.
    partner: Option<usize>,
    /// The side that follows it around the panel.
    next: usize,
}

/// All borders.
pub(super) struct Border {
    pub(super) sides: Vec<Side>,
    /// Loops in sides, `[panel][loop]`.
    pub(super) loops: Vec<Vec<Vec<usize>>>,
}

/// Cloth always ends somewhere: at a neck, a hem. A surface that does not is none.
pub(super) fn check_open(islands: &Islands) -> Result<(), Vec<Problem>> {
    let mut uses: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for triangle in &islands.triangles {
        let [a, b, c] = triangle.map(|v| islands.sewing[v as usize]);
        for [a, b] in [[a, b], [b, c], [c, a]] {
            *uses.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    if uses.into_values().any(|uses| uses == 1) {
        return Ok(());
    }
    Err(vec![Problem::whole(
        "the surface is closed, without neck or hem: it is a body, or cloth exported with \
         thickness. A garment has to be a single sheet (\"thin\") with open edges",
    )])
}

/// Finds the borders and what each of their sides is sewn to.
pub(super) fn trace(islands: &Islands) -> Result<Border, Vec<Problem>> {
    let mut problems = Problems::default();
    let mut border = Border {
        sides: Vec::new(),
        loops: Vec::new(),
    };
    for (panel, name) in islands.names.iter().enumerate() {
        if let Err(text) = border.add_panel(islands, panel) {
            problems.at(format!("panel `{name}`"), text);
        }
    }
    border.find_partners(islands);
    problems.unless_any(border)
}

impl Border {
    fn add_panel(&mut self, islands: &Islands, panel: usize) -> Result<(), String> {
        let mut uses: BTreeMap<[u32; 2], Vec<[u32; 2]>> = BTreeMap::new();
        for &[a, b, c] in &islands.triangles[islands.panel_triangles[panel].clone()] {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                let key = [from.min(to), from.max(to)];
                uses.entry(key).or_default().push([from, to]);
            }
        }
        if uses.values().any(|uses| uses.len() > 2) {
            return Err("more than two faces meet at an edge: remove doubled faces".into());
        }
        let first = self.sides.len();
        let mut side_from = BTreeMap::new();
        for ends in uses.into_values().filter(|uses| uses.len() == 1).flatten() {
            if side_from.insert(ends[0], self.sides.len()).is_some() {
                return Err("its border touches itself at a vertex: separate the two parts".into());
            }
            self.sides.push(Side {
                ends,
                partner: None,
                next: 0,
            });
        }
        for side in first..self.sides.len() {
            let next = side_from.get(&self.sides[side].ends[1]);
            self.sides[side].next = *next.ok_or("its faces are wound inconsistently")?;
        }
        let mut loops = Vec::new();
        let mut seen = BTreeSet::new();
        for start in side_from.into_values() {
            let mut sides = Vec::new();
            let mut side = start;
            while seen.insert(side) {
                sides.push(side);
                side = self.sides[side].next;
            }
            if !sides.is_empty() {
                loops.push(sides);
            }
        }
        self.loops.push(loops);
        Ok(())
    }

    /// Sides over the same two cloth vertices are sewn together; where more than two are, all
    /// others to the first.
    fn find_partners(&mut self, islands: &Islands) {
        let mut over: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
        for (i, side) in self.sides.iter().enumerate() {
            let [a, b] = side.ends.map(|v| islands.sewing[v as usize]);
            over.entry([a.min(b), a.max(b)]).or_default().push(i);
        }
        for sides in over.values().filter(|sides| sides.len() > 1) {
            self.sides[sides[0]].partner = Some(sides[1]);
            for side in &sides[1..] {
                self.sides[*side].partner = Some(sides[0]);
            }
        }
    }

    /// Whether the seam of a side does not go on in the next side.
    fn seam_breaks(&self, side: usize) -> bool {
        let next = self.sides[side].next;
        match (self.sides[side].partner, self.sides[next].partner) {
            (None, None) => false,
            // At the point of a dart the border is sewn to its own continuation.
            (Some(a), Some(b)) => a == next || (self.sides[b].next != a && self.sides[a].next != b),
            _ => true,
        }
    }

    /// Pattern vertices of a loop, in order.
    pub(super) fn vertices<'a>(&'a self, sides: &'a [usize]) -> impl Iterator<Item = u32> + 'a {
        sides.iter().map(|side| self.sides[*side].ends[0])
    }

    /// Sides from the pattern vertex `from` to `to`, in the border's direction.
    pub(super) fn walk(&self, from: u32, to: u32) -> Option<Vec<usize>> {
        let start = self.sides.iter().position(|side| side.ends[0] == from)?;
        let mut chain = vec![start];
        let mut side = start;
        while self.sides[side].ends[1] != to {
            side = self.sides[side].next;
            if side == start {
                return None;
            }
            chain.push(side);
        }
        Some(chain)
    }

    /// Pattern vertices along consecutive sides, both ends included.
    pub(super) fn along(&self, chain: &[usize]) -> Vec<u32> {
        let last = chain.last().map(|side| self.sides[*side].ends[1]);
        self.vertices(chain).chain(last).collect()
    }
}

/// Gives the garment panels with straight edges between the corners of their outlines, and the
/// stitches between these.
pub(super) fn outline(
    islands: &Islands,
    border: &Border,
    garment: &mut Garment,
    notes: &mut Vec<String>,
) {
    let x_bar = &garment.mesh.x_bar;
    let outlines = outlines(border, x_bar, islands, notes);
    let corners = corners(border, &outlines, x_bar, islands);
    let mut edge_of: BTreeMap<usize, EdgeId> = BTreeMap::new();
    let mut chains: Vec<Vec<Vec<usize>>> = Vec::new();
    for (panel, sides) in outlines.iter().enumerate() {
        let cut = cut_at(border, sides, &corners, islands);
        for (edge, chain) in cut.iter().enumerate() {
            edge_of.extend(chain.iter().map(|side| (*side, EdgeId { panel, edge })));
        }
        garment.pattern.panels.push(Panel {
            name: islands.names[panel].clone(),
            vertices: cut
                .iter()
                .map(|chain| x_bar[border.sides[chain[0]].ends[0] as usize])
                .collect(),
            edges: (0..cut.len())
                .map(|e| Edge {
                    start: e,
                    end: (e + 1) % cut.len(),
                    curve: Curve::Line,
                    label: None,
                })
                .collect(),
            placement: Placement {
                rotation: Mat3::identity(),
                translation: Vec3::zeros(),
            },
            label: None,
        });
        chains.push(cut);
    }
    garment.pattern.stitches = stitches(border, &chains, &edge_of, islands);
    let along = |cut: &Vec<Vec<usize>>| cut.iter().map(|chain| border.along(chain)).collect();
    garment.mesh.edge_vertices = chains.iter().map(along).collect();
}

/// The loop around the largest area of every panel; the others are holes.
fn outlines<'a>(
    border: &'a Border,
    x_bar: &[Vec2],
    islands: &Islands,
    notes: &mut Vec<String>,
) -> Vec<&'a [usize]> {
    let area = |sides: &[usize]| {
        let polygon: Vec<Vec2> = border.vertices(sides).map(|v| x_bar[v as usize]).collect();
        signed_area(&polygon).abs()
    };
    let mut outlines = Vec::new();
    for (loops, name) in border.loops.iter().zip(&islands.names) {
        let mut largest: &[usize] = &[];
        for sides in loops {
            if largest.is_empty() || area(sides) > area(largest) {
                largest = sides;
            }
        }
        if loops.len() > 1 {
            notes.push(format!(
                "panel `{name}` has {} holes: they stay in its mesh, but its outline is only the \
                 outer border",
                loops.len() - 1
            ));
        }
        outlines.push(largest);
    }
    outlines
}

/// Cloth vertices at which edges end.
fn corners(
    border: &Border,
    outlines: &[&[usize]],
    x_bar: &[Vec2],
    islands: &Islands,
) -> BTreeSet<u32> {
    let cloth_at = |side: usize| islands.sewing[border.sides[side].ends[0] as usize];
    let mut corners = BTreeSet::new();
    for sides in border.loops.iter().flatten() {
        for &side in sides {
            if border.seam_breaks(side) {
                corners.insert(cloth_at(border.sides[side].next));
            }
        }
    }
    for sides in outlines {
        let polygon: Vec<Vec2> = border.vertices(sides).map(|v| x_bar[v as usize]).collect();
        corners.extend(sharp_turns(&polygon).map(|i| cloth_at(sides[i])));
    }
    // An outline of fewer than three edges is cut where its longest edge is halved.
    for sides in outlines {
        loop {
            let chains = cut_at(border, sides, &corners, islands);
            let Some(longest) = chains.iter().max_by_key(|chain| chain.len()) else {
                break;
            };
            if chains.len() >= 3 || longest.len() < 2 {
                break;
            }
            corners.insert(cloth_at(longest[0]));
            corners.insert(cloth_at(longest[longest.len() / 2]));
        }
    }
    corners
}

/// Vertices of a closed polygon where it turns more sharply than anywhere near, and sharply at all.
fn sharp_turns(polygon: &[Vec2]) -> impl Iterator<Item = usize> {
    let n = polygon.len();
    // The points about `WINDOW` before and after a vertex, and all between.
    let reach = move |i: usize, step: usize| -> Vec<usize> {
        let mut path = vec![];
        let (mut at, mut length) = (i, 0.0);
        while length < WINDOW && path.len() < n / 2 {
            let to = (at + step) % n;
            length += (polygon[to] - polygon[at]).norm();
            at = to;
            path.push(at);
        }
        path
    };
    let turn = move |i: usize| {
        let (Some(&before), Some(&after)) = (reach(i, n - 1).last(), reach(i, 1).last()) else {
            return 0.0;
        };
        let (a, b) = (polygon[i] - polygon[before], polygon[after] - polygon[i]);
        cross2(a, b).atan2(a.dot(&b)).abs()
    };
    let turns: Vec<f64> = (0..n).map(turn).collect();
    (0..n).filter(move |&i| {
        let sharper = |j: usize| turns[j] > turns[i] || (turns[j] == turns[i] && j < i);
        // The last points reached are beyond the window.
        let near = [1, n - 1].map(|step| {
            reach(i, step)
                .split_last()
                .map_or(vec![], |(_, near)| near.to_vec())
        });
        turns[i] > CORNER && !near.concat().into_iter().any(sharper)
    })
}

/// A loop cut at its corners, the piece that starts at the loop's first corner first; the whole
/// loop if it has none.
fn cut_at(
    border: &Border,
    sides: &[usize],
    corners: &BTreeSet<u32>,
    islands: &Islands,
) -> Vec<Vec<usize>> {
    let is_corner =
        |side: &usize| corners.contains(&islands.sewing[border.sides[*side].ends[0] as usize]);
    let first = sides.iter().position(is_corner).unwrap_or(0);
    let mut pieces: Vec<Vec<usize>> = Vec::new();
    for side in sides[first..].iter().chain(&sides[..first]) {
        match pieces.last_mut() {
            Some(piece) if !is_corner(side) => piece.push(*side),
            _ => pieces.push(vec![*side]),
        }
    }
    pieces
}

/// One stitch for each pair of edges that are sewn together over their whole length.
fn stitches(
    border: &Border,
    chains: &[Vec<Vec<usize>>],
    edge_of: &BTreeMap<usize, EdgeId>,
    islands: &Islands,
) -> Vec<Stitch> {
    let mut stitches: Vec<Stitch> = Vec::new();
    for (panel, cut) in chains.iter().enumerate() {
        for (edge, chain) in cut.iter().enumerate() {
            let id = EdgeId { panel, edge };
            let Some(partner) = border.sides[chain[0]].partner else {
                continue;
            };
            let Some(&other) = edge_of.get(&partner) else {
                continue;
            };
            let known = |stitch: &Stitch| stitch.sides == [other, id];
            if other == id || stitches.iter().any(known) {
                continue;
            }
            let start = |side: usize| islands.sewing[border.sides[side].ends[0] as usize];
            stitches.push(Stitch {
                sides: [id, other],
                right_wrong: start(chain[0]) == start(partner),
            });
        }
    }
    stitches
}
