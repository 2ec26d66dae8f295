//! Constraints of one colour, side by side in lanes: numbers of which a processor takes several at
//! once, and what a block of constraints reads and writes.
//!
//! Pieces of one colour share no vertex, so the order within a colour changes nothing but round-off,
//! and blocks of [`LANES`] can be computed together. Every lane is computed by the same operations in
//! the same order whatever the processor, so the bits are the same with wide registers and without.
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into the dispatched loop is not compiled for wide registers"
)]

use crate::geometry::Vec3;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Constraints in a block.
pub(super) const LANES: usize = 4;

/// A number of each constraint in a block.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(32))]
pub(super) struct Lane(pub(super) [f64; LANES]);

/// A vector of each constraint in a block.
pub(super) type Lane3 = [Lane; 3];

impl Lane {
    /// The same number in every lane.
    #[inline(always)]
    pub(super) fn all(value: f64) -> Self {
        Self([value; LANES])
    }

    /// `self` where `test` is positive, 0 elsewhere.
    #[inline(always)]
    pub(super) fn where_positive(self, test: Self) -> Self {
        let mut result = self;
        for l in 0..LANES {
            result.0[l] = if test.0[l] > 0.0 { self.0[l] } else { 0.0 };
        }
        result
    }

    /// The smaller of both.
    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        let mut result = self;
        for l in 0..LANES {
            result.0[l] = if self.0[l] < other.0[l] {
                self.0[l]
            } else {
                other.0[l]
            };
        }
        result
    }
}

macro_rules! lane_by_lane {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lane {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let mut result = self;
                for l in 0..LANES {
                    result.0[l] = self.0[l] $op other.0[l];
                }
                result
            }
        }
    };
}

lane_by_lane!(Add, add, +);
lane_by_lane!(Sub, sub, -);
lane_by_lane!(Mul, mul, *);
lane_by_lane!(Div, div, /);

impl AddAssign for Lane {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Neg for Lane {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let mut result = self;
        for value in &mut result.0 {
            *value = -*value;
        }
        result
    }
}

/// Vectors at the vertices of a block's constraints.
#[inline(always)]
pub(super) fn gather(x: &[Vec3], vertices: &[u32; LANES]) -> Lane3 {
    let [a, b, c, d] = vertices.map(|v| x[v as usize]);
    [
        Lane([a.x, b.x, c.x, d.x]),
        Lane([a.y, b.y, c.y, d.y]),
        Lane([a.z, b.z, c.z, d.z]),
    ]
}

/// Adds a vector to the vertices of a block's first `count` constraints.
#[inline(always)]
pub(super) fn scatter(x: &mut [Vec3], vertices: &[u32; LANES], count: usize, by: Lane3) {
    for l in 0..count.min(LANES) {
        let x = &mut x[vertices[l] as usize];
        x.x += by[0].0[l];
        x.y += by[1].0[l];
        x.z += by[2].0[l];
    }
}

/// `a + b` of vectors.
#[inline(always)]
pub(super) fn sum(a: Lane3, b: Lane3) -> Lane3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a − b` of vectors.
#[inline(always)]
pub(super) fn difference(a: Lane3, b: Lane3) -> Lane3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a · factor` of a vector.
#[inline(always)]
pub(super) fn scaled(a: Lane3, factor: Lane) -> Lane3 {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

/// `a · b` of vectors.
#[inline(always)]
pub(super) fn dot(a: Lane3, b: Lane3) -> Lane {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector `l` of a block.
#[inline(always)]
pub(super) fn of_lane(a: Lane3, l: usize) -> Vec3 {
    Vec3::new(a[0].0[l], a[1].0[l], a[2].0[l])
}

/// The vectors of all lanes, each in its element's place.
pub(super) fn in_place<'b>(
    count: usize,
    lanes: impl Iterator<Item = (Lane3, &'b [u32])>,
) -> Vec<Vec3> {
    let mut all = vec![Vec3::zeros(); count];
    for (lane, elements) in lanes {
        for (l, e) in elements.iter().enumerate() {
            all[*e as usize] = of_lane(lane, l);
        }
    }
    all
}

/// The elements of each block and how many of them count, by colours: pieces of one colour share no
/// vertex, and those of a block are of one `kind`. Blocks that are not full repeat their first element.
pub(super) fn blocks<const K: usize>(
    pieces: &[[u32; K]],
    vertex_count: usize,
    kind: impl Fn(u32) -> u16,
) -> Vec<([u32; LANES], usize)> {
    let mut blocks = Vec::new();
    for mut colour in colours(pieces, vertex_count) {
        colour.sort_by_key(|e| kind(*e));
        for alike in colour.chunk_by(|a, b| kind(*a) == kind(*b)) {
            for elements in alike.chunks(LANES) {
                let mut block = [elements[0]; LANES];
                block[..elements.len()].copy_from_slice(elements);
                blocks.push((block, elements.len()));
            }
        }
    }
    blocks
}

/// Every piece in the first colour that none of its vertices has yet, in the order of the pieces.
fn colours<const K: usize>(pieces: &[[u32; K]], vertex_count: usize) -> Vec<Vec<u32>> {
    let mut taken = vec![0_u128; vertex_count];
    let mut colours: Vec<Vec<u32>> = Vec::new();
    let mut alone = Vec::new();
    for (p, piece) in pieces.iter().enumerate() {
        let at_vertices = piece.iter().fold(0, |all, v| all | taken[*v as usize]);
        let colour = at_vertices.trailing_ones() as usize;
        if colour == u128::BITS as usize {
            // A hub of more pieces than there are bits: one after the other.
            alone.push(vec![p as u32]);
            continue;
        }
        for v in piece {
            taken[*v as usize] |= 1 << colour;
        }
        if colour == colours.len() {
            colours.push(Vec::new());
        }
        colours[colour].push(p as u32);
    }
    colours.extend(alone);
    colours
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Around vertex 0 a fan of triangles; more of them than there are bits.
    fn fan(count: u32) -> Vec<[u32; 3]> {
        (1..=count).map(|i| [0, i, i + 1]).collect()
    }

    #[test]
    fn blocks_hold_every_piece_once_and_none_that_share_a_vertex() {
        let strip: Vec<[u32; 3]> = (0..400).map(|i| [i, i + 1, i + 2]).collect();
        for pieces in [strip, fan(200)] {
            let mut seen = BTreeSet::new();
            for (elements, count) in blocks(&pieces, 402, |e| u16::from(e > 50)) {
                let live = &elements[..count];
                assert!(elements.iter().all(|e| (*e > 50) == (elements[0] > 50)));
                let vertices: BTreeSet<u32> =
                    live.iter().flat_map(|e| pieces[*e as usize]).collect();
                assert_eq!(vertices.len(), 3 * count);
                for e in live {
                    assert!(seen.insert(*e));
                }
            }
            assert_eq!(seen.len(), pieces.len());
        }
    }

    #[test]
    fn a_strip_needs_three_colours() {
        let strip: Vec<[u32; 3]> = (0..400).map(|i| [i, i + 1, i + 2]).collect();
        assert_eq!(colours(&strip, 402).len(), 3);
    }
}
