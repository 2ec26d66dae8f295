//! Which pieces of cloth may meet: broad phase, and what is exempt.
//!
//! Vertices are tested against triangles and edges against edges, over trees of boxes that enclose
//! their whole move. Pieces that are sewn together, or within twice the contact thickness of each
//! other along the mesh at rest, do not count as two layers. Neither do pieces that go through each
//! other already ([`crate::geometry::intersections`]): holding these apart would hold them where
//! they are.
//!
//! Moves that pass through nothing: `hold_apart`.

mod hold_apart;
mod stepping;
mod untangle;

use super::cloth::Cloth;
use super::energy::layers::{Kind, LEAST_THICKNESS, LayerParams, Pair};
use crate::geometry::box_tree::{Aabb, BoxTree, around};
use crate::geometry::{Vec3, intersections};
use hold_apart::hold_apart;
use std::collections::BTreeMap;
pub use stepping::Watch;

/// The pieces of one cloth, ready to be searched.
#[derive(Clone, Debug)]
pub struct Layers {
    params: LayerParams,
    triangles: Vec<[u32; 3]>,
    edges: Vec<[u32; 2]>,
    /// Contact stiffness \[N/m\] of each vertex and each edge.
    vertex_kappa: Vec<f64>,
    edge_kappa: Vec<f64>,
    /// Distance at which layers begin to feel each other \[m\]: at each vertex, and the largest.
    thickness: Vec<f64>,
    thickest: f64,
    /// Squared reference lengths of the edges \[m²\].
    squared_lengths: Vec<f64>,
    /// Corners opposite to each edge; of an edge of more than two triangles the last two.
    beside: Vec<[Option<u32>; 2]>,
    /// Vertices that no vertex counts as another layer of, itself included; sorted.
    close: Vec<Vec<u32>>,
    /// Vertices where layers go through each other.
    tangled: Vec<bool>,
    vertex_tree: BoxTree,
    triangle_tree: BoxTree,
    edge_tree: BoxTree,
    near: Near,
}

/// Pairs that were found with room to spare, so that they serve for several moves.
#[derive(Clone, Debug, Default)]
struct Near {
    pairs: Vec<Pair>,
    /// Positions for which they were found \[m\]; empty when they are out of date.
    from: Vec<Vec3>,
    /// By how much beyond the thickness they were looked for \[m\].
    room: f64,
}

/// What triangles beside an edge tell of it.
#[derive(Default)]
struct Side {
    area: f64,
    squared_length: f64,
    beside: [Option<u32>; 2],
}

/// sin² of the angle below which edges count as ever more parallel: 6°.
const PARALLEL: f64 = 1e-2;
/// Vertices closer to another layer than this part of the thickness count as tangled with it.
const STUCK: f64 = 1e-3;

impl Layers {
    /// Prepares to search `cloth` at positions `x` \[m\]. What goes through itself there is exempt.
    pub fn new(cloth: &Cloth, params: LayerParams, x: &[Vec3]) -> Self {
        let mut edges: BTreeMap<[u32; 2], Side> = BTreeMap::new();
        for (t, triangle) in cloth.triangles.iter().enumerate() {
            let rest = cloth.reference_corners(t);
            let area = 0.5 * crate::geometry::cross2(rest[1] - rest[0], rest[2] - rest[0]).abs();
            for i in 0..3 {
                let j = (i + 1) % 3;
                let ends = [triangle[i].min(triangle[j]), triangle[i].max(triangle[j])];
                let entry = edges.entry(ends).or_default();
                entry.area += area / 3.0;
                entry.squared_length = (rest[j] - rest[i]).norm_squared();
                entry.beside = [entry.beside[1], Some(triangle[3 - i - j])];
            }
        }
        let kappa = |area: &f64| params.stiffness * area;
        let own = |t: &f64| params.thickness.or(t.max(LEAST_THICKNESS));
        let thickness: Vec<f64> = cloth.thickness.iter().map(own).collect();
        let thickest = thickness.iter().copied().fold(0.0, f64::max);
        let mut layers = Self {
            params,
            triangles: cloth.triangles.clone(),
            vertex_kappa: cloth.reference_area.iter().map(kappa).collect(),
            edge_kappa: edges.values().map(|side| kappa(&side.area)).collect(),
            squared_lengths: edges.values().map(|side| side.squared_length).collect(),
            beside: edges.values().map(|side| side.beside).collect(),
            edges: edges.into_keys().collect(),
            close: close(cloth, 2.0 * thickest),
            tangled: vec![false; cloth.vertex_count],
            thickness,
            thickest,
            vertex_tree: BoxTree::new(&[]),
            triangle_tree: BoxTree::new(&[]),
            edge_tree: BoxTree::new(&[]),
            near: Near::default(),
        };
        if params.on {
            let still = vec![Vec3::zeros(); x.len()];
            layers.vertex_tree = BoxTree::new(&swept(&singles(x.len()), x, &still, 0.0));
            layers.triangle_tree = BoxTree::new(&swept(&layers.triangles, x, &still, 0.0));
            layers.edge_tree = BoxTree::new(&swept(&layers.edges, x, &still, 0.0));
            layers.find_tangles(x);
        }
        layers
    }

    /// Largest distance at which layers begin to feel each other \[m\].
    pub fn thickness(&self) -> f64 {
        self.thickest
    }

    /// How layers meet.
    pub fn params(&self) -> &LayerParams {
        &self.params
    }

    /// Whether layers go through each other anywhere.
    pub fn tangled(&self) -> bool {
        self.tangled.contains(&true)
    }

    /// Exempts what goes through itself at `x`, and its surroundings, and nothing else.
    pub fn find_tangles(&mut self, x: &[Vec3]) {
        self.tangled.fill(false);
        self.near.from.clear();
        if !self.params.on {
            return;
        }
        let mut at = vec![false; x.len()];
        for t in intersections::within(x, &self.triangles).as_flattened() {
            for v in self.triangles[*t as usize] {
                at[v as usize] = true;
            }
        }
        let stuck = STUCK * self.thickest;
        let still = vec![Vec3::zeros(); x.len()];
        for pair in self.search(x, &still, stuck) {
            for v in pair.vertices {
                at[v as usize] = true;
            }
        }
        for triangle in &self.triangles {
            if triangle.iter().any(|v| at[*v as usize]) {
                for v in triangle {
                    self.tangled[*v as usize] = true;
                }
            }
        }
    }

    /// All pairs that come closer than the thickness while the cloth moves by `d` from `x`, in a
    /// fixed order; `spare` more \[m\] for moves yet unknown.
    ///
    /// A search costs more than a look at what it found, so short moves are searched for with room
    /// to spare, and later ones make do with that until the room is used up.
    pub fn pairs(&mut self, x: &[Vec3], d: &[Vec3], spare: f64) -> Vec<Pair> {
        if !self.params.on {
            return Vec::new();
        }
        // What all cloth does alike brings no pieces closer.
        let d = without_mean(d);
        let reach = self.thickest + spare;
        if !self.near.serves(x, &d, spare) {
            let farthest = d.iter().map(Vec3::norm).fold(0.0, f64::max);
            let room = (MOVES_OF_ROOM * farthest).max(0.5 * self.most_room());
            if room > self.most_room() {
                return self.search(x, &d, reach);
            }
            let still = vec![Vec3::zeros(); x.len()];
            self.near = Near {
                room: spare + 2.0 * room,
                pairs: self.search(x, &still, reach + 2.0 * room),
                from: x.to_vec(),
            };
        }
        let pairs = self.near.pairs.iter().copied();
        pairs.filter(|p| comes_within(p, x, &d, reach)).collect()
    }

    /// Shortens the move `d` from `x` \[m\] of single vertices, so that no layer passes through another; all
    /// pairs that come closer than the thickness on the way.
    pub fn hold_apart(&mut self, x: &[Vec3], d: &mut [Vec3]) -> Vec<Pair> {
        let pairs = self.pairs(x, d, 0.0);
        hold_apart(&pairs, x, d, 0.0);
        pairs
    }

    /// The most room that it pays to search with \[m\]: beyond, every piece would meet its
    /// neighbours' neighbours.
    fn most_room(&self) -> f64 {
        let lengths: f64 = self.squared_lengths.iter().map(|l| l.sqrt()).sum();
        (ROOM * lengths / self.edges.len() as f64).max(ROOM * self.thickest)
    }

    /// All pairs that come closer than `reach` \[m\] while the cloth moves by `d` from `x`, in a
    /// fixed order, found by boxes that enclose the moves.
    fn search(&mut self, x: &[Vec3], d: &[Vec3], reach: f64) -> Vec<Pair> {
        self.vertex_tree.refit(&swept(&singles(x.len()), x, d, 0.0));
        self.triangle_tree
            .refit(&swept(&self.triangles, x, d, reach));
        self.edge_tree.refit(&swept(&self.edges, x, d, 0.5 * reach));
        let near = |pair: &Pair| comes_within(pair, x, d, reach);
        let mut pairs = (self.vertex_tree).overlaps(&self.triangle_tree, |v, t| {
            self.point_triangle(v, t).filter(near)
        });
        pairs.extend(
            self.edge_tree
                .own_overlaps(|e, f| self.edge_edge(e, f).filter(near)),
        );
        pairs
    }

    /// Vertex `v` and triangle `t`, unless they are exempt.
    fn point_triangle(&self, v: u32, t: u32) -> Option<Pair> {
        let [a, b, c] = self.triangles[t as usize];
        (!self.exempt(&[v], &[a, b, c])).then(|| Pair {
            vertices: [v, a, b, c],
            kind: Kind::PointTriangle,
            kappa: self.vertex_kappa[v as usize],
            h: self.between(&[v], &[a, b, c]),
        })
    }

    /// Edges `e` and `f`, unless they are exempt.
    fn edge_edge(&self, e: u32, f: u32) -> Option<Pair> {
        let (e, f) = (e as usize, f as usize);
        let ([a, b], [c, d]) = (self.edges[e], self.edges[f]);
        (!self.exempt(&[a, b], &[c, d])).then(|| Pair {
            vertices: [a, b, c, d],
            kind: Kind::EdgeEdge(PARALLEL * self.squared_lengths[e] * self.squared_lengths[f]),
            kappa: 0.5 * (self.edge_kappa[e] + self.edge_kappa[f]),
            h: self.between(&[a, b], &[c, d]),
        })
    }

    /// Distance at which two pieces begin to feel each other \[m\]: half of it is each one's.
    fn between(&self, first: &[u32], second: &[u32]) -> f64 {
        let mean = |side: &[u32]| {
            let sum: f64 = side.iter().map(|v| self.thickness[*v as usize]).sum();
            sum / side.len() as f64
        };
        0.5 * (mean(first) + mean(second))
    }

    fn exempt(&self, first: &[u32], second: &[u32]) -> bool {
        let close = |v: &u32| {
            let close = &self.close[*v as usize];
            second.iter().any(|w| close.contains(w))
        };
        let tangled = |side: &[u32]| side.iter().any(|v| self.tangled[*v as usize]);
        first.iter().any(close) || tangled(first) && tangled(second)
    }
}

impl Near {
    /// Whether all that a move `d` from `x` brings within the thickness and `spare` is there: pieces
    /// come closer by twice what any vertex does, against the mean of all.
    fn serves(&self, x: &[Vec3], d: &[Vec3], spare: f64) -> bool {
        if self.from.len() != x.len() {
            return false;
        }
        let gone: Vec<Vec3> = x.iter().zip(&self.from).map(|(x, f)| x - f).collect();
        let gone = without_mean(&gone);
        let farthest = gone
            .iter()
            .zip(d)
            .map(|(g, d)| g.norm_squared().max((g + d).norm_squared()))
            .fold(0.0, f64::max);
        spare + 2.0 * farthest.sqrt() <= self.room
    }
}

/// Moves less the mean of all.
fn without_mean(d: &[Vec3]) -> Vec<Vec3> {
    let mean = d.iter().sum::<Vec3>() / d.len() as f64;
    d.iter().map(|d| d - mean).collect()
}

/// Whether a pair may come closer than `reach` \[m\] while the cloth moves by `d` from `x`.
fn comes_within(pair: &Pair, x: &[Vec3], d: &[Vec3], reach: f64) -> bool {
    let v = pair.vertices.map(|v| v as usize);
    let distance = pair.closest(v.map(|v| x[v])).r.norm();
    distance < reach || distance < reach + relative_move(pair.kind, v.map(|v| d[v]))
}

/// Every vertex as a piece of its own.
fn singles(count: usize) -> Vec<[u32; 1]> {
    (0..count as u32).map(|v| [v]).collect()
}

/// Room as part of the mean edge length, and least room as part of the thickness.
const ROOM: f64 = 0.3;
/// Room as part of the farthest move, so that what was found serves for a few moves.
const MOVES_OF_ROOM: f64 = 3.0;

/// Whether corner `k` of a pair belongs to its first piece.
fn first_side(kind: Kind, k: usize) -> bool {
    match kind {
        Kind::PointTriangle => k == 0,
        Kind::EdgeEdge(_) => k < 2,
    }
}

/// The most by which a point of one piece moves against a point of the other.
fn relative_move(kind: Kind, d: [Vec3; 4]) -> f64 {
    let mut most = 0.0_f64;
    for k in (0..4).filter(|k| first_side(kind, *k)) {
        for l in (0..4).filter(|l| !first_side(kind, *l)) {
            most = most.max((d[k] - d[l]).norm_squared());
        }
    }
    most.sqrt()
}

/// Boxes around the whole move of pieces with `N` corners, widened by `margin` \[m\].
fn swept<const N: usize>(pieces: &[[u32; N]], x: &[Vec3], d: &[Vec3], margin: f64) -> Vec<Aabb> {
    let of_vertex = |(p, d): (&Vec3, &Vec3)| around(&[*p, p + d], margin);
    let vertices: Vec<Aabb> = x.iter().zip(d).map(of_vertex).collect();
    let boxed = |piece: &[u32; N]| {
        let mut hull = vertices[piece[0] as usize];
        for v in &piece[1..] {
            let [low, high] = &vertices[*v as usize];
            hull = [hull[0].inf(low), hull[1].sup(high)];
        }
        hull
    };
    pieces.iter().map(boxed).collect()
}

/// For every vertex those within `limit` \[m\] along the mesh of the reference pattern, itself
/// included; the two ends of a flat triangle's height count as joined.
fn close(cloth: &Cloth, limit: f64) -> Vec<Vec<u32>> {
    let mut joined: BTreeMap<u32, Vec<(u32, f64)>> = BTreeMap::new();
    for (t, triangle) in cloth.triangles.iter().enumerate() {
        let rest = cloth.reference_corners(t);
        let doubled = crate::geometry::cross2(rest[1] - rest[0], rest[2] - rest[0]).abs();
        for i in 0..3 {
            for j in (0..3).filter(|j| *j != i) {
                let third = 3 - i - j;
                let length = (rest[j] - rest[i]).norm();
                let height = doubled / (rest[third] - rest[j]).norm();
                // Over a foot that lies on the opposite side, corner i is as near as its height.
                let distance = length.min(height);
                if distance < limit {
                    joined
                        .entry(triangle[i])
                        .or_default()
                        .push((triangle[j], distance));
                    joined
                        .entry(triangle[j])
                        .or_default()
                        .push((triangle[i], distance));
                }
            }
        }
    }
    let around = |start: u32| {
        let mut reached: BTreeMap<u32, f64> = BTreeMap::from([(start, 0.0)]);
        let mut open = vec![start];
        while let Some(v) = open.pop() {
            let so_far = reached[&v];
            for (w, length) in joined.get(&v).into_iter().flatten() {
                let distance = so_far + length;
                if distance < limit && reached.get(w).is_none_or(|d| distance < *d) {
                    reached.insert(*w, distance);
                    open.push(*w);
                }
            }
        }
        reached.into_keys().collect()
    };
    (0..cloth.vertex_count as u32).map(around).collect()
}

#[cfg(test)]
mod tests;
