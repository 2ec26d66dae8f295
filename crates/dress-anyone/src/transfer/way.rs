//! The way of a drape from one body to another: bound, held, relaxed and rebound, and taken out of the body.

use super::bind::{BodyMap, Carried};
use super::clear::{Clearing, belongs};
use super::draped::Draped;
use super::folds::Folds;
use super::hold::{self, Rims};
use super::layout::Layout;
use super::relax::{Hold, Kept, Relaxation, Slope, Springs, Stencil};
use super::settle::{Ground, Settling};
use super::turned::{turn_back, turned_over};
use super::{TransferParams, hang, layers, room};
use crate::body::{Body, parted};
use crate::geometry::groups::Groups;
use crate::geometry::{ClosestPoint, Mat3, TriangleMesh, Vec3, bounds};
use rayon::prelude::*;

/// How far a rim that grips may be pulled in, as share of the body's height: 3 cm on an adult.
const GRIP: f64 = 0.02;
/// First step of a triangle that meets the body, as share of its height: half a millimetre.
const STEP: f64 = 3e-4;
/// Times that folds which go through each other are let go.
const LOOSENINGS: usize = 3;
/// Times that a garment which met the body is relaxed again, to even out what was pushed.
const SMOOTHINGS: usize = 2;
/// Times that turned triangles are turned back.
const TURNINGS: usize = 8;
/// Part of what the way back misses that is taken back: the other half is the way back's own.
const HALF: f64 = 0.5;
/// Length over which that is averaged along the cloth, as share of the body's height: 5 cm. What single vertices miss is
/// chance: a crease of the body in which they went to one side.
const EVEN: f64 = 0.03;

/// A body to be dressed.
pub(super) struct Skin {
    /// With parts that go through each other drawn apart.
    mesh: TriangleMesh,
    pub(super) surface: ClosestPoint,
    /// As it is, where that is another.
    whole: Option<(TriangleMesh, ClosestPoint)>,
}

/// A drape on its way from a source to a target.
pub(super) struct Way<'a> {
    draped: Draped<'a>,
    triangles: &'a [[u32; 3]],
    rings: &'a [Vec<u32>],
    /// Edges that keep their length.
    kept: &'a [[u32; 2]],
    settling: Settling<'a>,
    clearing: Clearing<'a>,
    /// By the target with its parts as they are, where they go through each other.
    whole: Option<Clearing<'a>>,
    folds: Folds<'a>,
    /// How the body around each vertex turns at large.
    turns: Vec<Mat3>,
    /// Up on the target, which may lie where the source stands.
    pub(super) up: Vec3,
    /// Least distances to the target \[m\].
    least: Vec<f64>,
}

/// Where a drape stays on the target.
pub(super) struct Settled {
    /// \[m\].
    pub(super) x: Vec<Vec3>,
    /// Rounds that took, and whether they were enough.
    pub(super) rounds: usize,
    pub(super) converged: bool,
}

impl Skin {
    pub(super) fn of(body: &Body) -> Self {
        let mesh = parted(&body.mesh);
        let surface = ClosestPoint::new(&mesh);
        let other = mesh != body.mesh;
        let whole = other.then(|| (body.mesh.clone(), ClosestPoint::new(&body.mesh)));
        Self {
            mesh,
            surface,
            whole,
        }
    }

    /// How far it reaches along `up` \[m\].
    fn height(&self, up: Vec3) -> f64 {
        let heights = self.mesh.positions.iter().map(|p| up.dot(p));
        let low = heights.clone().fold(f64::INFINITY, f64::min);
        heights.fold(f64::NEG_INFINITY, f64::max) - low
    }
}

impl<'a> Way<'a> {
    /// Of the `drape` of a cloth with these `rings` of neighbours, which hangs against `up`.
    pub(super) fn new(
        (drape, up): (&'a [Vec3], Vec3),
        (layout, rings): (&'a Layout, &'a [Vec<u32>]),
        [source, target]: [&'a Skin; 2],
        params: &TransferParams,
    ) -> Self {
        let height = source.height(up);
        let cloth = (&layout.triangles[..], rings);
        let mut draped = Draped::new(drape, cloth, &source.surface, (up, height));
        let map = BodyMap::new(&source.mesh, &target.mesh, height);
        let carry = |v: usize| {
            let (facing, distance) = (draped.facing[v], draped.distance[v]);
            map.carry(drape[v], facing, distance, layout.ease[v])
        };
        let bound: Vec<Carried> = (0..drape.len()).into_par_iter().map(carry).collect();
        let carried: Vec<Vec3> = bound.iter().map(|carried| carried.point).collect();
        draped.meet(&carried, (target.mesh.area() / source.mesh.area()).sqrt());
        let turns: Vec<Mat3> = drape.par_iter().map(|&x| map.turn(x)).collect();
        let slopes = hang::slopes(&draped, &bound, &turns);
        let surfaces = [&source.surface, &target.surface];
        let ways = (&bound[..], &turns[..]);
        let grounds = grounds(&draped, ways, &slopes, layout, surfaces, params);
        let ties = layers::ties(drape, &layout.triangles, rings, &bound, height);
        let springs = Springs {
            kept: layout.kept.iter().map(|&e| Kept::of(e, drape)).collect(),
            ties,
            slopes,
        };
        let ring = |(v, ring): (usize, &Vec<u32>)| Stencil {
            centre: v as u32,
            around: ring.clone(),
        };
        let mut stencils: Vec<Stencil> = rings.iter().enumerate().map(ring).collect();
        stencils.extend(layout.line_stencils());
        let usual: Vec<Hold> = grounds.iter().map(Ground::usual).collect();
        // Cloth that was in another part's half already may stay there.
        let home = |(carried, x): (&Carried, &Vec3)| {
            let [before, after] = carried.normals;
            let home = belongs(&source.surface, *x, before);
            if home { after } else { Vec3::zeros() }
        };
        let homes: Vec<Vec3> = bound.iter().zip(drape).map(home).collect();
        let clearing = |mesh: &'a TriangleMesh, surface: &'a ClosestPoint| {
            let homes = homes.clone();
            Clearing::new(
                surface,
                mesh,
                &layout.triangles,
                rings,
                homes,
                STEP * height,
            )
        };
        let least = |ground: &Ground| ground.wanted.clamp(0.0, params.thickness);
        let (low, high) = bounds(drape);
        Self {
            least: grounds.iter().map(least).collect(),
            clearing: clearing(&target.mesh, &target.surface),
            whole: (target.whole.as_ref()).map(|(mesh, surface)| clearing(mesh, surface)),
            folds: Folds::new(drape, &layout.triangles, rings),
            settling: Settling {
                relaxation: Relaxation::new(drape, &stencils, &usual, springs),
                body: &target.surface,
                bound,
                grounds,
                still: params.tolerance * (high - low).norm(),
                rounds: params.iterations,
            },
            turns,
            draped,
            triangles: &layout.triangles,
            rings,
            kept: &layout.kept,
            up: map.turn_of_all() * up,
        }
    }

    /// Where the drape stays, let go where folds are pushed through each other, and with the room that the
    /// body needs between vertices.
    pub(super) fn settled(&mut self) -> Settled {
        let bound = &self.settling.bound;
        let mut x: Vec<Vec3> = bound.iter().map(|carried| carried.point).collect();
        let (mut rounds, mut converged) = self.settling.settle(&mut x, &self.least);
        for _ in 0..LOOSENINGS {
            let around = self.folds.around_meetings(&x);
            if around.is_empty() {
                break;
            }
            for v in around {
                self.settling.grounds[v as usize].firmness.let_go();
            }
            let (more, settled) = self.settling.settle(&mut x, &self.least);
            rounds += more;
            converged = settled;
        }
        for _ in 0..SMOOTHINGS {
            let mut cleared = x.clone();
            if !self.clearing.clear(&mut cleared, &mut self.least) {
                break;
            }
            self.settling.settle(&mut x, &self.least);
        }
        Settled {
            x,
            rounds,
            converged,
        }
    }

    /// Takes half of what the way back `missed` the drape by \[m\] off `x`; what keeps its size moves as one.
    pub(super) fn take_back(&self, x: &mut [Vec3], missed: Vec<Vec3>) {
        let mut missed = self.draped.averaged(missed, EVEN);
        let mut parts = Groups::new(missed.len());
        for ends in self.kept {
            parts.join(*ends);
        }
        let part_of: Vec<usize> = (0..missed.len())
            .map(|v| parts.first_of(v as u32) as usize)
            .collect();
        let mut sums = vec![(Vec3::zeros(), 0.0); missed.len()];
        for (missed, part) in missed.iter().zip(&part_of) {
            let (sum, count) = &mut sums[*part];
            *sum += missed;
            *count += 1.0;
        }
        for (missed, part) in missed.iter_mut().zip(part_of) {
            *missed = sums[part].0 / sums[part].1;
        }
        for ((x, carried), missed) in x.iter_mut().zip(&self.settling.bound).zip(missed) {
            *x -= carried.map * missed * HALF;
        }
    }

    /// Takes `x` out of the target, draws its layers apart and turns back what was turned over; then once more by the
    /// target's parts as they are, where that helps: between two that overlap nothing can lie.
    pub(super) fn clear(&self, x: &mut Vec<Vec3>) {
        self.clear_by(&self.clearing, x);
        self.turn_back(x);
        if let Some(whole) = (self.whole.as_ref()).filter(|whole| whole.meetings(x) > 0) {
            let mut tried = x.clone();
            self.clear_by(whole, &mut tried);
            if self.no_worse(whole, [x, &tried]) {
                *x = tried;
            }
        }
    }

    /// Turns back triangles that were turned over, as long as that helps and nothing meets for it.
    fn turn_back(&self, x: &mut Vec<Vec3>) {
        let mut fewest = self.turned_over(x);
        let (mut tried, mut turned) = (x.clone(), fewest.clone());
        for _ in 0..TURNINGS {
            if turned.is_empty() {
                break;
            }
            turn_back(
                &mut tried,
                &turned,
                self.triangles,
                (self.draped.x, self.rings),
            );
            if self.clearing.meetings(&tried) > 0 {
                self.clear_by(&self.clearing, &mut tried);
            }
            turned = self.turned_over(&tried);
            if turned.len() < fewest.len() && self.no_worse(&self.clearing, [x, &tried]) {
                x.clone_from(&tried);
                fewest.clone_from(&turned);
            }
        }
    }

    fn clear_by(&self, clearing: &Clearing<'a>, x: &mut Vec<Vec3>) {
        let mut least = self.least.clone();
        clearing.clear(x, &mut least);
        self.folds
            .draw_apart(x, &self.turns, (clearing, &mut least));
    }

    fn turned_over(&self, x: &[Vec3]) -> Vec<usize> {
        turned_over(self.triangles, [self.draped.x, x])
    }

    /// Whether after goes no more through the body and through itself than before.
    fn no_worse(&self, clearing: &Clearing<'a>, [before, after]: [&[Vec3]; 2]) -> bool {
        clearing.meetings(after) <= clearing.meetings(before)
            && self.folds.meetings(after) <= self.folds.meetings(before)
    }
}

/// How each vertex stands to the target body.
fn grounds(
    draped: &Draped<'_>,
    (bound, turns): (&[Carried], &[Mat3]),
    slopes: &[Slope],
    layout: &Layout,
    surfaces: [&ClosestPoint; 2],
    params: &TransferParams,
) -> Vec<Ground> {
    let touching = hold::touching(draped);
    let across = |v: usize| {
        let free = turns[v] * draped.facing[v];
        let across = free.lerp(&bound[v].normals[1], touching[v]);
        across.try_normalize(1e-9).unwrap_or_else(Vec3::zeros)
    };
    let across: Vec<Vec3> = (0..bound.len()).map(across).collect();
    let rims = Rims::new(draped);
    let lines = (&rims, &layout.lines[..]);
    let firmness = hold::firmness(draped, lines, (bound, &across), params);
    let pressures = hang::pressures(draped, slopes);
    let wanted = room::wanted(draped.x, &draped.distance, bound, surfaces);
    let ground = |v: usize| Ground {
        across: across[v],
        touching: touching[v],
        wanted: wanted[v],
        pressure: pressures[v] * touching[v]
            + rims.grips[v] * firmness[v].touching * GRIP * draped.height,
        firmness: firmness[v],
    };
    (0..bound.len()).map(ground).collect()
}
