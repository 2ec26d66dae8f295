//! Fills an outline with well-shaped triangles without touching its edges.
//!
//! Seeds on a hexagonal lattice, constrained Delaunay triangulation, then rounds of: add the
//! circumcentres of triangles that are too large, drop crowded vertices, move vertices to the
//! weighted mean of their triangles' centroids (Chen & Holst 2011, "Efficient mesh optimization
//! schemes based on optimal Delaunay triangulations") and triangulate again. At last the worst
//! triangles are improved one vertex at a time. Where the outline is sampled more finely than the
//! rest, sizes grow inwards from it at a fixed rate.

use crate::geometry::polygon::Polygon;
use crate::geometry::quality::quality;
use crate::geometry::{Vec2, bounds, cross2};
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

/// Rounds of smoothing; quality gains less than 0.001 from more.
const ROUNDS: usize = 10;
/// Rounds of adding vertices, at most; each adds a layer to what is there.
const FILLINGS: usize = 20;
/// How far from the outline vertices are placed, over the local size.
const CLEARANCE: f64 = 0.6;
/// Growth of the local size with the distance from finely sampled outline \[m/m\].
const GROWTH: f64 = 0.3;
/// Sizes never fall below this fraction of the spacing, however tiny an edge.
const FINEST: f64 = 0.1;
/// A triangle is too large when its circumradius exceeds this times the local size (equilateral:
/// 0.58).
const LARGE: f64 = 0.85;
/// Triangles better than this are left alone by the polish.
const GOOD: f64 = 0.8;
/// Directions tried by the polish.
const COMPASS: [(f64, f64); 8] = [
    (1.0, 0.0),
    (0.7, 0.7),
    (0.0, 1.0),
    (-0.7, 0.7),
    (-1.0, 0.0),
    (-0.7, -0.7),
    (0.0, -1.0),
    (0.7, -0.7),
];

/// A triangulated outline.
pub(super) struct Filling {
    /// The outline's points, then those inside \[m\].
    pub(super) points: Vec<Vec2>,
    /// Counter-clockwise.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Triangulates the inside of the simple counter-clockwise `outline` with edges of about `spacing`
/// \[m\]; none when the outline is not simple after all.
pub(super) fn fill(outline: &[Vec2], spacing: f64) -> Option<Filling> {
    let room = Room {
        sizes: Sizes::new(outline, spacing),
        polygon: Polygon::new(outline.to_vec()),
    };
    let mut points = outline.to_vec();
    points.extend(lattice(&room, spacing));
    for _ in 0..FILLINGS {
        let triangles = delaunay(&points, outline.len())?;
        if room.refill(&mut points, &triangles) == 0 {
            break;
        }
    }
    for round in 0..ROUNDS {
        let triangles = delaunay(&points, outline.len())?;
        room.relax(&mut points, &triangles);
        match round {
            1 | 4 => room.thin(&mut points, &triangles),
            3 | 6 => _ = room.refill(&mut points, &triangles),
            _ => {}
        }
    }
    let triangles = delaunay(&points, outline.len())?;
    room.polish(&mut points, &triangles);
    Some(Filling { points, triangles })
}

/// Seeds: a hexagonal lattice where the outline leaves room for it.
fn lattice(room: &Room, spacing: f64) -> Vec<Vec2> {
    let (low, high) = bounds(room.polygon.points());
    let row_height = spacing * 0.75_f64.sqrt();
    let rows = ((high.y - low.y) / row_height) as usize;
    let columns = ((high.x - low.x) / spacing) as usize + 1;
    let mut seeds = Vec::new();
    for row in 1..=rows {
        for column in 0..=columns {
            let shift = if row % 2 == 0 { 0.0 } else { 0.5 };
            let p = low + Vec2::new((column as f64 + shift) * spacing, row as f64 * row_height);
            if room.polygon.contains(p) && room.is_clear(p) && room.sizes.at(p) > 0.8 * spacing {
                seeds.push(p);
            }
        }
    }
    seeds
}

/// Constrained Delaunay triangulation of the inside of the outline, which is the first `count` of
/// the points.
fn delaunay(points: &[Vec2], count: usize) -> Option<Vec<[u32; 3]>> {
    let vertices = points.iter().map(|p| Point2::new(p.x, p.y)).collect();
    let edges = (0..count).map(|i| [i, (i + 1) % count]).collect();
    let mut conflicts = false;
    let mesh =
        ConstrainedDelaunayTriangulation::<Point2<f64>>::try_bulk_load_cdt(vertices, edges, |_| {
            conflicts = true;
        })
        .ok()?;
    if conflicts || mesh.num_vertices() < points.len() {
        return None;
    }
    // From the faces left of the outline's edges, inwards.
    let mut inside = vec![false; mesh.num_all_faces()];
    let mut front = Vec::new();
    for edge in mesh.directed_edges().filter(|e| e.is_constraint_edge()) {
        if (edge.from().index() + 1) % count == edge.to().index() {
            front.push(edge);
        }
    }
    while let Some(edge) = front.pop() {
        let face = edge.face().as_inner()?;
        if !std::mem::replace(&mut inside[face.index()], true) {
            let crossed = face.adjacent_edges().into_iter();
            front.extend(crossed.filter(|e| !e.is_constraint_edge()).map(|e| e.rev()));
        }
    }
    let kept = mesh.inner_faces().filter(|face| inside[face.index()]);
    Some(
        kept.map(|face| face.vertices().map(|v| v.index() as u32))
            .collect(),
    )
}

/// The inside of an outline and the sizes wanted there.
struct Room {
    polygon: Polygon,
    sizes: Sizes,
}

impl Room {
    /// Whether `p`, known to be inside, is far enough from the outline.
    fn is_clear(&self, p: Vec2) -> bool {
        self.polygon.distance(p) >= CLEARANCE * self.sizes.at(p)
    }

    fn outline_count(&self) -> usize {
        self.polygon.points().len()
    }

    /// Drops inner vertices that crowd a neighbour.
    fn thin(&self, points: &mut Vec<Vec2>, triangles: &[[u32; 3]]) {
        let mut dropped = vec![false; points.len()];
        for [a, b] in triangles.iter().flat_map(sides) {
            let (a, b) = (a as usize, b as usize);
            let middle = (points[a] + points[b]) * 0.5;
            let crowded = (points[b] - points[a]).norm() < 0.6 * self.sizes.at(middle);
            if crowded && !dropped[a] && !dropped[b] && a.max(b) >= self.outline_count() {
                dropped[a.max(b)] = true;
            }
        }
        let mut index = 0;
        points.retain(|_| {
            index += 1;
            !dropped[index - 1]
        });
    }

    /// Adds the circumcentres of triangles that are too large, not two next to each other, and
    /// counts them.
    fn refill(&self, points: &mut Vec<Vec2>, triangles: &[[u32; 3]]) -> usize {
        let before = points.len();
        let mut busy = vec![false; before];
        for triangle in triangles {
            let corners = triangle.map(|v| points[v as usize]);
            let centroid = mean(corners);
            let size = self.sizes.at(centroid);
            let (centre, radius) = circumcircle(corners);
            if radius < LARGE * size || triangle.iter().any(|&v| busy[v as usize]) {
                continue;
            }
            let fits = |p: &Vec2| self.polygon.contains(*p) && self.is_clear(*p);
            if let Some(p) = [centre, centroid].into_iter().find(fits) {
                points.push(p);
                for &v in triangle {
                    busy[v as usize] = true;
                }
            }
        }
        points.len() - before
    }

    /// Moves inner vertices to the mean centroid of their triangles, each weighted by its area over
    /// that wanted there.
    fn relax(&self, points: &mut [Vec2], triangles: &[[u32; 3]]) {
        let stars = Stars::new(points.len(), triangles);
        let wanted: Vec<f64> = triangles
            .iter()
            .map(|t| self.sizes.at(mean(t.map(|v| points[v as usize]))).powi(2))
            .collect();
        for v in self.outline_count()..points.len() {
            let (mut sum, mut weights) = (Vec2::zeros(), 0.0);
            for &t in stars.of(v) {
                let [a, b, c] = triangles[t as usize].map(|v| points[v as usize]);
                let weight = cross2(b - a, c - a) / wanted[t as usize];
                sum += mean([a, b, c]) * weight;
                weights += weight;
            }
            let (old, new) = (points[v], sum / weights);
            let tolerated = stars.worst(v, points, triangles).min(0.3);
            for share in [1.0, 0.5] {
                points[v] = old + (new - old) * share;
                if stars.worst(v, points, triangles) >= tolerated {
                    break;
                }
                points[v] = old;
            }
        }
    }

    /// Moves the vertices of the worst triangles to wherever nearby the worst gets better.
    fn polish(&self, points: &mut [Vec2], triangles: &[[u32; 3]]) {
        let stars = Stars::new(points.len(), triangles);
        for step in [0.2, 0.1, 0.05, 0.1, 0.05, 0.02] {
            for v in self.outline_count()..points.len() {
                let mut best = (stars.worst(v, points, triangles), points[v]);
                if best.0 > GOOD {
                    continue;
                }
                let (centre, reach) = (points[v], step * self.sizes.at(points[v]));
                for (x, y) in COMPASS {
                    points[v] = centre + Vec2::new(x, y) * reach;
                    let worst = stars.worst(v, points, triangles);
                    if worst > best.0 {
                        best = (worst, points[v]);
                    }
                }
                points[v] = best.1;
            }
        }
    }
}

/// The triangles around each vertex.
struct Stars {
    starts: Vec<usize>,
    triangles: Vec<u32>,
}

impl Stars {
    fn new(vertex_count: usize, triangles: &[[u32; 3]]) -> Self {
        let mut starts = vec![0; vertex_count + 1];
        for &v in triangles.as_flattened() {
            starts[v as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            starts[v + 1] += starts[v];
        }
        let mut next = starts.clone();
        let mut filed = vec![0; 3 * triangles.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            for &v in triangle {
                filed[next[v as usize]] = t as u32;
                next[v as usize] += 1;
            }
        }
        Self {
            starts,
            triangles: filed,
        }
    }

    fn of(&self, v: usize) -> &[u32] {
        &self.triangles[self.starts[v]..self.starts[v + 1]]
    }

    /// Quality of the worst triangle around `v`.
    fn worst(&self, v: usize, points: &[Vec2], triangles: &[[u32; 3]]) -> f64 {
        let around = self.of(v).iter();
        around
            .map(|&t| quality(triangles[t as usize].map(|v| points[v as usize])))
            .fold(1.0, f64::min)
    }
}

/// The edge length wanted everywhere: the spacing, less near finely sampled outline.
struct Sizes {
    spacing: f64,
    low: Vec2,
    columns: usize,
    /// Places and sizes of the fine samples that may matter in each square of side `spacing`.
    squares: Vec<Vec<(Vec2, f64)>>,
}

impl Sizes {
    fn new(outline: &[Vec2], spacing: f64) -> Self {
        let (low, high) = bounds(outline);
        let span = (high - low).map(|length| (length / spacing) as usize + 1);
        let mut sizes = Self {
            spacing,
            low,
            columns: span.x,
            squares: vec![Vec::new(); span.x * span.y],
        };
        let count = outline.len();
        for i in 0..count {
            let [before, p, after] = [count - 1, 0, 1].map(|k| outline[(i + k) % count]);
            // Between a tiny and an ordinary edge the geometric mean is kindest to both triangles.
            let size = ((p - before).norm() * (after - p).norm()).sqrt();
            let size = size.max(FINEST * spacing);
            if size < spacing {
                let reach = Vec2::repeat((spacing - size) / GROWTH);
                let (from, to) = (sizes.square(p - reach), sizes.square(p + reach));
                for row in from.1..=to.1 {
                    for column in from.0..=to.0 {
                        sizes.squares[row * span.x + column].push((p, size));
                    }
                }
            }
        }
        sizes
    }

    fn at(&self, p: Vec2) -> f64 {
        let (column, row) = self.square(p);
        let fine = self.squares[row * self.columns + column].iter();
        fine.map(|(q, size)| size + GROWTH * (p - q).norm())
            .fold(self.spacing, f64::min)
    }

    /// Column and row of the square around `p`, or of the nearest one.
    fn square(&self, p: Vec2) -> (usize, usize) {
        let cell = (p - self.low).map(|offset| (offset / self.spacing) as usize);
        let rows = self.squares.len() / self.columns;
        (cell.x.min(self.columns - 1), cell.y.min(rows - 1))
    }
}

fn sides([a, b, c]: &[u32; 3]) -> [[u32; 2]; 3] {
    [[*a, *b], [*b, *c], [*c, *a]]
}

fn mean([a, b, c]: [Vec2; 3]) -> Vec2 {
    (a + b + c) / 3.0
}

/// Centre and radius of the circle through three points; infinite for points on a line.
fn circumcircle([a, b, c]: [Vec2; 3]) -> (Vec2, f64) {
    let (u, v) = (b - a, c - a);
    let turned = u * v.norm_squared() - v * u.norm_squared();
    let offset = Vec2::new(-turned.y, turned.x) / (2.0 * cross2(u, v));
    (a + offset, offset.norm())
}
