//! Constraints side by side in lanes: numbers of which a processor takes several at once, and what a
//! block of constraints reads and writes.
//!
//! The constraints of a block share no vertex: they are computed together, from rows that are gathered
//! before and stored afterwards. In blocks that are not full, the lanes left over have the vertices of
//! the first constraint and move nothing; lanes are stored backwards, so that what the first stores
//! stays. Every lane is computed by the same operations in the same order whatever the processor, so the
//! bits are the same with wide registers and without: AVX2 (x86) takes the four lanes of a block at
//! once, NEON (ARM) two, others one.
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into the dispatched loop is not compiled for wide registers"
)]

use crate::geometry::Vec3;
use pulp::{Arch, Simd, WithSimd, bytemuck};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Constraints in a block.
pub(super) const LANES: usize = 4;

/// Four numbers that lie together: one of each constraint in a block, or a [`row`] of one vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(32))]
pub(super) struct Four(pub(super) [f64; LANES]);

/// Three numbers of each constraint in a block.
pub(super) type Four3 = [Four; 3];

/// Position \[m\] and inverse mass \[1/kg\] of a vertex; or the gradients by them.
pub(super) fn row(p: Vec3, w: f64) -> Four {
    Four([p.x, p.y, p.z, w])
}

impl Four {
    /// The vector of a row.
    pub(super) fn vector(&self) -> Vec3 {
        let [x, y, z, _] = self.0;
        Vec3::new(x, y, z)
    }

    /// Adds to the vector of a row.
    pub(super) fn shift(&mut self, by: Vec3) {
        for (own, by) in self.0.iter_mut().zip(by.iter()) {
            *own += by;
        }
    }
}

/// Vector `l` of a block.
pub(super) fn of_lane(a: &Four3, l: usize) -> Vec3 {
    Vec3::new(a[0].0[l], a[1].0[l], a[2].0[l])
}

/// The elements of a block, and how many of them count; the others repeat the first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elements {
    lanes: [u32; LANES],
    count: usize,
}

impl Elements {
    /// `of` every lane's element, those that do not count included.
    pub(super) fn map<T>(&self, of: impl FnMut(u32) -> T) -> [T; LANES] {
        self.lanes.map(of)
    }

    /// Lane and element of those that count.
    pub(super) fn each(&self) -> impl DoubleEndedIterator<Item = (usize, usize)> + use<> {
        let (lanes, count) = (self.lanes, self.count);
        (0..count).map(move |l| (l, lanes[l] as usize))
    }
}

/// Some of a register's width of numbers of constraints: what is computed with.
#[derive(Clone, Copy)]
pub(super) struct Lane<S: Simd> {
    simd: S,
    value: S::f64s,
}

/// A vector of each.
pub(super) type Lane3<S> = [Lane<S>; 3];

impl<S: Simd> Lane<S> {
    /// The same number in every lane.
    #[inline(always)]
    pub(super) fn all(simd: S, value: f64) -> Self {
        let value = simd.splat_f64s(value);
        Self { simd, value }
    }

    /// Register `part` of a block's numbers.
    #[inline(always)]
    pub(super) fn load(simd: S, from: &Four, part: usize) -> Self {
        let value = S::as_simd_f64s(&from.0).0[part];
        Self { simd, value }
    }

    /// The same of three.
    #[inline(always)]
    pub(super) fn load3(simd: S, from: &Four3, part: usize) -> Lane3<S> {
        [
            Self::load(simd, &from[0], part),
            Self::load(simd, &from[1], part),
            Self::load(simd, &from[2], part),
        ]
    }

    /// Puts it where [`Self::load`] finds it.
    #[inline(always)]
    pub(super) fn store(self, to: &mut Four, part: usize) {
        S::as_mut_simd_f64s(&mut to.0).0[part] = self.value;
    }

    /// Adds it there.
    #[inline(always)]
    pub(super) fn add_to(self, to: &mut Four, part: usize) {
        (Self::load(self.simd, to, part) + self).store(to, part);
    }

    /// `self` where `test` is positive, 0 elsewhere.
    #[inline(always)]
    pub(super) fn where_positive(self, test: Self) -> Self {
        let (simd, zero) = (self.simd, self.simd.splat_f64s(0.0));
        let positive = simd.less_than_f64s(zero, test.value);
        let value = simd.select_f64s(positive, self.value, zero);
        Self { simd, value }
    }

    /// The smaller of both.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        let (simd, a, b) = (self.simd, self.value, other.value);
        let value = simd.select_f64s(simd.less_than_f64s(a, b), a, b);
        Self { simd, value }
    }
}

macro_rules! lane_by_lane {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl<S: Simd> $trait for Lane<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let simd = self.simd;
                let value = simd.$operation(self.value, other.value);
                Self { simd, value }
            }
        }
    };
}

lane_by_lane!(Add, add, add_f64s);
lane_by_lane!(Sub, sub, sub_f64s);
lane_by_lane!(Mul, mul, mul_f64s);
lane_by_lane!(Div, div, div_f64s);

impl<S: Simd> Neg for Lane<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let (simd, value) = (self.simd, self.simd.neg_f64s(self.value));
        Self { simd, value }
    }
}

/// The vectors and fourth numbers of a block's vertices, register `part`.
#[inline(always)]
pub(super) fn gather<S: Simd>(
    simd: S,
    rows: &[Four],
    vertices: &[u32; LANES],
    part: usize,
) -> (Lane3<S>, Lane<S>) {
    let mut four = [simd.splat_f64s(0.0); 4];
    {
        let flat: &mut [[f64; 4]] = bytemuck::cast_slice_mut(&mut four);
        for l in 0..S::F64_LANES {
            flat[l] = rows[vertices[part * S::F64_LANES + l] as usize].0;
        }
    }
    let [x, y, z, w] = simd.deinterleave_shfl_f64s(four);
    let vector = [
        Lane { simd, value: x },
        Lane { simd, value: y },
        Lane { simd, value: z },
    ];
    (vector, Lane { simd, value: w })
}

/// Stores them back.
#[inline(always)]
pub(super) fn scatter<S: Simd>(
    rows: &mut [Four],
    vertices: &[u32; LANES],
    part: usize,
    (vector, fourth): (Lane3<S>, Lane<S>),
) {
    let [x, y, z] = vector;
    let four = (fourth.simd).interleave_shfl_f64s([x.value, y.value, z.value, fourth.value]);
    let flat: &[[f64; 4]] = bytemuck::cast_slice(&four);
    for l in (0..S::F64_LANES).rev() {
        rows[vertices[part * S::F64_LANES + l] as usize].0 = flat[l];
    }
}

/// `a + b` of vectors.
#[inline(always)]
pub(super) fn sum<S: Simd>(a: Lane3<S>, b: Lane3<S>) -> Lane3<S> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a − b` of vectors.
#[inline(always)]
pub(super) fn difference<S: Simd>(a: Lane3<S>, b: Lane3<S>) -> Lane3<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a · factor` of a vector.
#[inline(always)]
pub(super) fn scaled<S: Simd>(a: Lane3<S>, factor: Lane<S>) -> Lane3<S> {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

/// `a · b` of vectors.
#[inline(always)]
pub(super) fn dot<S: Simd>(a: Lane3<S>, b: Lane3<S>) -> Lane<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A walk over blocks, compiled for each kind of processor.
pub(super) trait Walk {
    /// Walks, with registers of the kind `S`.
    fn walk<S: Simd>(self, simd: S);
}

struct Dispatched<W>(W);

impl<W: Walk> WithSimd for Dispatched<W> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        const { assert!(S::F64_LANES <= LANES, "a block holds less than a register") };
        self.0.walk(simd);
    }
}

/// Walks with the widest registers that this processor has.
pub(super) fn walk(over: impl Walk) {
    Arch::new().dispatch(Dispatched(over));
}

/// Registers in a block.
pub(super) const fn parts<S: Simd>() -> usize {
    LANES / S::F64_LANES
}

/// Some of `pieces` by colours, as blocks: those of one colour share no vertex, and those of a block are
/// of one `kind`. Blocks that are not full repeat their first element.
pub(super) fn blocks<const K: usize>(
    elements: &[u32],
    vertices: impl Fn(u32) -> [u32; K],
    vertex_count: usize,
    kind: impl Fn(u32) -> u16,
) -> Vec<Elements> {
    let mut blocks = Vec::new();
    for mut colour in colours(elements, vertices, vertex_count) {
        colour.sort_by_key(|e| kind(*e));
        for alike in colour.chunk_by(|a, b| kind(*a) == kind(*b)) {
            for some in alike.chunks(LANES) {
                let mut lanes = [some[0]; LANES];
                lanes[..some.len()].copy_from_slice(some);
                let count = some.len();
                blocks.push(Elements { lanes, count });
            }
        }
    }
    blocks
}

/// Every element in the first colour that none of its vertices has yet, in the order given.
fn colours<const K: usize>(
    elements: &[u32],
    vertices: impl Fn(u32) -> [u32; K],
    vertex_count: usize,
) -> Vec<Vec<u32>> {
    let mut taken = vec![0_u128; vertex_count];
    let mut colours: Vec<Vec<u32>> = Vec::new();
    let mut alone = Vec::new();
    for &e in elements {
        let at = vertices(e);
        let at_vertices = at.iter().fold(0, |all, v| all | taken[*v as usize]);
        let colour = at_vertices.trailing_ones() as usize;
        if colour == u128::BITS as usize {
            // A hub of more pieces than there are bits: one after the other.
            alone.push(vec![e]);
            continue;
        }
        for v in at {
            taken[v as usize] |= 1 << colour;
        }
        if colour == colours.len() {
            colours.push(Vec::new());
        }
        colours[colour].push(e);
    }
    colours.extend(alone);
    colours
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn strip(e: u32) -> [u32; 3] {
        [e, e + 1, e + 2]
    }

    /// Around vertex 0 a fan of triangles; more of them than there are bits.
    fn fan(e: u32) -> [u32; 3] {
        [0, e + 1, e + 2]
    }

    #[test]
    fn blocks_hold_every_piece_once_and_none_that_share_a_vertex() {
        for piece in [strip, fan] {
            let elements: Vec<u32> = (0..400).collect();
            let mut seen = BTreeSet::new();
            for block in blocks(&elements, piece, 402, |e| u16::from(e > 50)) {
                let first = block.lanes[0];
                assert!(block.lanes.iter().all(|e| (*e > 50) == (first > 50)));
                let live: Vec<u32> = block.each().map(|(_, e)| e as u32).collect();
                assert!(block.lanes[live.len()..].iter().all(|e| *e == first));
                let vertices: BTreeSet<u32> = live.iter().flat_map(|e| piece(*e)).collect();
                assert_eq!(vertices.len(), 3 * live.len());
                for e in live {
                    assert!(seen.insert(e));
                }
            }
            assert_eq!(seen.len(), 400);
        }
    }

    #[test]
    fn a_strip_needs_three_colours() {
        let elements: Vec<u32> = (0..400).collect();
        assert_eq!(colours(&elements, strip, 402).len(), 3);
    }

    /// Adds to the vector of each vertex twice its fourth number.
    struct Shift<'a>(&'a mut [Four], [u32; LANES]);

    impl Walk for Shift<'_> {
        fn walk<S: Simd>(self, simd: S) {
            for part in 0..parts::<S>() {
                let (p, w) = gather(simd, self.0, &self.1, part);
                let by = w + w;
                scatter(self.0, &self.1, part, (sum(p, [by, by, by]), w));
            }
        }
    }

    #[test]
    fn what_is_gathered_is_stored_where_it_was_with_any_register() {
        let start: Vec<Four> = (0..6)
            .map(|i| row(Vec3::new(1.0, 2.0, 3.0) * f64::from(i), 0.25 * f64::from(i)))
            .collect();
        let at = [4, 1, 5, 2];
        let mut wide = start.clone();
        walk(Shift(&mut wide, at));
        let mut narrow = start.clone();
        Shift(&mut narrow, at).walk(pulp::Scalar::new());
        assert_eq!(wide, narrow);
        for (v, (row, was)) in wide.iter().zip(&start).enumerate() {
            let by = if at.contains(&(v as u32)) { 0.5 } else { 0.0 };
            let by = by * v as f64;
            assert_eq!(row.vector(), was.vector().add_scalar(by));
            assert_eq!(row.0[3], was.0[3]);
        }
    }
}
