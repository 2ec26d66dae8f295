//! Layers of cloth: pockets, lapels, fold-overs, facings.
//!
//! Where another part of the garment lies close, on the same side of the same part of the body, the
//! nearest triangle of it joins a vertex's stencil: what is over and what is under stays so, at the same
//! distance but for what stretches all. (De Goes et al. 2020 extend stencils in the same way.)

use super::bind::Carried;
use super::relax::Stencil;
use crate::geometry::Vec3;
use crate::geometry::box_tree::{BoxTree, around};
use rayon::prelude::*;

/// Layers are closer than this share of the body's height: 1 cm on an adult.
const CLOSE: f64 = 0.006;
/// Cosine of the angle of the body's normals above which two vertices are at the same part of it: a
/// sleeve and the side it hangs beside are not.
const SAME_SIDE: f64 = 0.5;
/// Cloth this many edges away is no other layer.
const APART: usize = 4;

/// The one-rings of the cloth `x` as stencils, with the layer next to each vertex where there is one.
pub(super) fn stencils(
    x: &[Vec3],
    triangles: &[[u32; 3]],
    rings: &[Vec<u32>],
    bound: &[Carried],
    height: f64,
) -> Vec<Stencil> {
    let corners = |t: &[u32; 3]| t.map(|v| x[v as usize]);
    let boxes: Vec<_> = triangles.iter().map(|t| around(&corners(t), 0.0)).collect();
    let tree = BoxTree::new(&boxes);
    let reach = CLOSE * height;
    let layer = |v: usize| {
        let mut candidates = Vec::new();
        tree.overlapping(&around(&x[v..=v], reach), |t| candidates.push(t));
        let near = neighbourhood(v as u32, rings);
        let normal = bound[v].normals[0];
        let other = candidates.into_iter().filter(|&t| {
            let alike = |w: u32| bound[w as usize].normals[0].dot(&normal) > SAME_SIDE;
            let t = triangles[t as usize];
            t.iter().all(|w| near.binary_search(w).is_err()) && alike(t[0])
        });
        let middle = |t: u32| corners(&triangles[t as usize]).iter().sum::<Vec3>() / 3.0;
        let distance = |t: &u32| (middle(*t) - x[v]).norm();
        other.min_by(|s, t| distance(s).total_cmp(&distance(t)).then(s.cmp(t)))
    };
    let stencil = |v: usize| {
        let mut around = rings[v].clone();
        around.extend(
            layer(v)
                .map(|t| triangles[t as usize])
                .into_iter()
                .flatten(),
        );
        Stencil {
            centre: v as u32,
            around,
        }
    };
    (0..x.len()).into_par_iter().map(stencil).collect()
}

/// Vertices within a few edges of `v`, ascending.
fn neighbourhood(v: u32, rings: &[Vec<u32>]) -> Vec<u32> {
    let mut near = vec![v];
    for _ in 0..APART {
        let next: Vec<u32> = (near.iter())
            .flat_map(|&i| rings[i as usize].iter().copied())
            .collect();
        near.extend(next);
        near.sort_unstable();
        near.dedup();
    }
    near
}
