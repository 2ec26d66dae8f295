//! Blocks of constraints that are visited in every sweep, and the record that their adjoint needs.
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into the dispatched loop is not compiled for wide registers"
)]

use super::lanes::{Four, Four3, Walk, parts, walk};
use pulp::Simd;

/// A block of constraints that share no vertex.
pub(super) trait Visit {
    /// Visits `part` of the block's lanes, and notes Δλ in `visit`. The `first` visit of a step begins
    /// with λ = 0.
    fn visit<S: Simd>(
        &mut self,
        simd: S,
        part: usize,
        rows: &mut [Four],
        first: bool,
        visit: &mut Four3,
    );
}

/// The adjoint of its visits.
pub(super) trait Undo {
    /// Gradients by what the block has.
    type Hat: Default;

    /// Undoes a `visit` on `rows`, and hands the gradients `hats` by what it wrote on to what it read.
    /// The `last` visit of a step leaves λ to nobody.
    #[expect(clippy::too_many_arguments, reason = "what a visit reads and writes")]
    fn undo<S: Simd>(
        &mut self,
        simd: S,
        part: usize,
        visit: &Four3,
        hat: &mut Self::Hat,
        rows: &mut [Four],
        hats: &mut [Four],
        last: bool,
    );
}

/// Blocks, with Δλ of every visit that was recorded; 0 where its system could not be solved.
#[derive(Default)]
pub(super) struct Taped<B: Undo> {
    pub(super) blocks: Vec<B>,
    /// Gradients by what each block has.
    pub(super) hats: Vec<B::Hat>,
    pub(super) tape: Vec<Four3>,
}

impl<B: Visit + Undo> Taped<B> {
    pub(super) fn new(blocks: Vec<B>) -> Self {
        Self {
            blocks,
            hats: Vec::new(),
            tape: Vec::new(),
        }
    }

    /// Forgets what was recorded.
    pub(super) fn clear(&mut self) {
        self.tape.clear();
    }

    /// Visits every block once. The `first` sweep of a step begins with λ = 0.
    pub(super) fn sweep(&mut self, rows: &mut [Four], first: bool, record: bool) {
        let Self { blocks, tape, .. } = self;
        let tape = record.then_some(tape);
        walk(Sweep {
            blocks,
            rows,
            first,
            tape,
        });
    }

    /// Walks back through the last sweep that was recorded: undoes it on `rows`, and hands the gradients
    /// `hats` by what it wrote on to what it read. The `last` sweep of a step leaves λ to nobody.
    pub(super) fn pull_back(&mut self, rows: &mut [Four], hats: &mut [Four], last: bool) {
        self.hats.resize_with(self.blocks.len(), B::Hat::default);
        let first = self.tape.len() - self.blocks.len();
        walk(PullBack {
            blocks: &mut self.blocks,
            own: &mut self.hats,
            visits: &self.tape[first..],
            rows,
            hats,
            last,
        });
        self.tape.truncate(first);
    }
}

/// One sweep.
pub(super) struct Sweep<'a, B> {
    pub(super) blocks: &'a mut [B],
    pub(super) rows: &'a mut [Four],
    pub(super) first: bool,
    pub(super) tape: Option<&'a mut Vec<Four3>>,
}

impl<B: Visit> Walk for Sweep<'_, B> {
    #[inline(always)]
    fn walk<S: Simd>(mut self, simd: S) {
        for block in self.blocks {
            let mut visit = Four3::default();
            for part in 0..parts::<S>() {
                block.visit(simd, part, self.rows, self.first, &mut visit);
            }
            if let Some(tape) = &mut self.tape {
                tape.push(visit);
            }
        }
    }
}

/// The walk back through one sweep.
pub(super) struct PullBack<'a, B: Undo> {
    pub(super) blocks: &'a mut [B],
    pub(super) own: &'a mut [B::Hat],
    pub(super) visits: &'a [Four3],
    pub(super) rows: &'a mut [Four],
    pub(super) hats: &'a mut [Four],
    pub(super) last: bool,
}

impl<B: Undo> Walk for PullBack<'_, B> {
    #[inline(always)]
    fn walk<S: Simd>(self, simd: S) {
        let blocks = self.blocks.iter_mut().zip(self.own).zip(self.visits);
        for ((block, hat), visit) in blocks.rev() {
            for part in 0..parts::<S>() {
                block.undo(simd, part, visit, hat, self.rows, self.hats, self.last);
            }
        }
    }
}
