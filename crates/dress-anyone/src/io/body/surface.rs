//! The surface of a body: polygons cut into triangles, windings made to agree and to face outward,
//! and what is odd about it told.

use crate::geometry::TriangleMesh;
use crate::geometry::groups::Groups;
use rayon::prelude::*;

/// Fans of triangles from the first corner of each polygon. Only the topology decides, so that
/// bodies with the same polygons get the same triangles.
pub(crate) fn triangulate(polygons: &[Vec<u32>], notes: &mut Vec<String>) -> Vec<[u32; 3]> {
    let mut dropped = 0;
    let mut triangles = Vec::with_capacity(polygons.len());
    for polygon in polygons {
        for pair in polygon[1..].windows(2) {
            let triangle = [polygon[0], pair[0], pair[1]];
            let [a, b, c] = triangle;
            if a == b || b == c || c == a {
                dropped += 1;
            } else {
                triangles.push(triangle);
            }
        }
    }
    if dropped > 0 {
        notes.push(format!(
            "{dropped} triangles that name a vertex twice were left out"
        ));
    }
    triangles
}

/// Makes neighbouring triangles agree on their winding, and every closed component (and the
/// largest) enclose a positive volume.
pub(crate) fn turn_outward(mesh: &mut TriangleMesh, edges: &Edges, notes: &mut Vec<String>) {
    let components = components(&mesh.triangles, edges);
    let largest = components.iter().map(|c| c.triangles.len()).max();
    let (mut turned, mut inside_out, mut one_sided) = (0, 0, 0);
    for component in &components {
        let flipped = component.flips.iter().filter(|flip| **flip).count();
        // The majority is taken to be right.
        let wrong = 2 * flipped > component.flips.len();
        for (t, flip) in component.triangles.iter().zip(&component.flips) {
            if *flip != wrong {
                mesh.triangles[*t].swap(1, 2);
                turned += 1;
            }
        }
        one_sided += usize::from(component.one_sided);
        let main = Some(component.triangles.len()) == largest;
        if (main || component.closed) && volume(mesh, &component.triangles) < 0.0 {
            for t in &component.triangles {
                mesh.triangles[*t].swap(1, 2);
            }
            inside_out += 1;
        }
    }
    if turned > 0 {
        notes.push(format!(
            "{turned} triangles were wound against their neighbours and have been turned"
        ));
    }
    if inside_out > 0 {
        notes.push(format!(
            "faces pointed inward and have been turned outward ({inside_out} of {} components)",
            components.len()
        ));
    }
    if one_sided > 0 {
        notes.push("the surface has only one side, like a Möbius strip, somewhere".into());
    }
}

/// Notes on components, holes, odd edges and unused vertices.
pub(crate) fn describe(mesh: &TriangleMesh, edges: &Edges, notes: &mut Vec<String>) {
    let sizes = component_sizes(mesh);
    if sizes.len() > 1 {
        let shown: Vec<String> = sizes.iter().take(8).map(ToString::to_string).collect();
        let more = if sizes.len() > 8 { ", …" } else { "" };
        notes.push(format!(
            "{} separate components, of {}{more} vertices",
            sizes.len(),
            shown.join(", ")
        ));
    }
    let open = &edges.open;
    let holes = group_sizes(open, mesh.positions.len()).len();
    match holes {
        0 => {}
        1 => notes.push(format!("1 hole, of {} edges", open.len())),
        _ => notes.push(format!("{holes} holes, of {} edges together", open.len())),
    }
    if edges.tangled > 0 {
        notes.push(format!(
            "{} edges have more than two triangles",
            edges.tangled
        ));
    }
    let mut used = vec![false; mesh.positions.len()];
    for v in mesh.triangles.as_flattened() {
        used[*v as usize] = true;
    }
    let unused = used.iter().filter(|used| !**used).count();
    if unused > 0 {
        notes.push(format!(
            "{unused} vertices belong to no face; they are kept"
        ));
    }
}

/// How triangles meet. Half-edge 3 t + k of triangle t runs from its corner k to the next.
pub(crate) struct Edges {
    /// The half-edge of the other triangle at the same edge; `NONE` unless there are just two.
    mates: Vec<u32>,
    /// Edges of one triangle only.
    open: Vec<[u32; 2]>,
    /// How many edges have more than two.
    tangled: usize,
}

/// No half-edge.
const NONE: u32 = u32::MAX;

impl Edges {
    /// Of these triangles, as they are wound now.
    pub(crate) fn of(triangles: &[[u32; 3]]) -> Self {
        let mut halves: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len());
        for h in 0..3 * triangles.len() as u32 {
            let [from, to] = ends(triangles, h);
            halves.push(([from.min(to), from.max(to)], h));
        }
        halves.par_sort_unstable();
        let mut edges = Self {
            mates: vec![NONE; halves.len()],
            open: Vec::new(),
            tangled: 0,
        };
        for same in halves.chunk_by(|a, b| a.0 == b.0) {
            match same {
                [(edge, _)] => edges.open.push(*edge),
                [(_, one), (_, two)] => {
                    edges.mates[*one as usize] = *two;
                    edges.mates[*two as usize] = *one;
                }
                _ => edges.tangled += 1,
            }
        }
        edges
    }
}

/// From which vertex to which a half-edge runs.
fn ends(triangles: &[[u32; 3]], h: u32) -> [u32; 2] {
    let (triangle, k) = (triangles[h as usize / 3], h as usize % 3);
    [triangle[k], triangle[(k + 1) % 3]]
}

/// Triangles connected through edges of exactly two triangles.
struct Component {
    triangles: Vec<usize>,
    /// Which of them would have to be turned to agree with the first.
    flips: Vec<bool>,
    closed: bool,
    one_sided: bool,
}

fn components(triangles: &[[u32; 3]], edges: &Edges) -> Vec<Component> {
    let mut flip_of: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut components = Vec::new();
    for seed in 0..triangles.len() {
        if flip_of[seed].is_some() {
            continue;
        }
        flip_of[seed] = Some(false);
        let mut component = Component {
            triangles: vec![seed],
            flips: vec![false],
            closed: true,
            one_sided: false,
        };
        let mut next = 0;
        while let Some(&t) = component.triangles.get(next) {
            let flip = component.flips[next];
            next += 1;
            for h in 3 * t..3 * t + 3 {
                let mate = edges.mates[h];
                if mate == NONE {
                    component.closed = false;
                    continue;
                }
                let other = mate as usize / 3;
                // Neighbours agree when they run their edge in opposite directions.
                let against = ends(triangles, mate)[0] != ends(triangles, h as u32)[0];
                let other_flip = flip ^ !against;
                match flip_of[other] {
                    None => {
                        flip_of[other] = Some(other_flip);
                        component.triangles.push(other);
                        component.flips.push(other_flip);
                    }
                    Some(known) => component.one_sided |= known != other_flip,
                }
            }
        }
        components.push(component);
    }
    components
}

/// Signed volume of the cones from a point amid the triangles \[m³\].
fn volume(mesh: &TriangleMesh, triangles: &[usize]) -> f64 {
    let origin = mesh.corners(triangles[0])[0];
    let cone = |t: &usize| {
        let [a, b, c] = mesh.corners(*t).map(|p| p - origin);
        a.dot(&b.cross(&c)) / 6.0
    };
    triangles.iter().map(cone).sum()
}

/// Number of vertices of each component, largest first.
fn component_sizes(mesh: &TriangleMesh) -> Vec<usize> {
    let links: Vec<[u32; 2]> = mesh
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c]])
        .collect();
    group_sizes(&links, mesh.positions.len())
}

/// Sizes of the groups that `links` make of `count` vertices, largest first; vertices without a
/// link are no group.
fn group_sizes(links: &[[u32; 2]], count: usize) -> Vec<usize> {
    let mut groups = Groups::new(count);
    let mut linked = vec![false; count];
    for &link in links {
        groups.join(link);
        for v in link {
            linked[v as usize] = true;
        }
    }
    let mut sizes = vec![0; count];
    for v in (0..count).filter(|v| linked[*v]) {
        sizes[groups.first_of(v as u32) as usize] += 1;
    }
    sizes.retain(|size| *size > 0);
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    sizes
}
