//! The seams a tailor sees: chains of stitches that follow one another between the same two panels.

use crate::geometry::Vec2;
use crate::pattern::{EdgeId, Panel, Pattern, Stitch};

/// A chain of stitches.
pub(super) struct Seam {
    pub(super) sides: [Side; 2],
    /// As its stitches.
    pub(super) right_wrong: bool,
}

/// The edges that a seam takes of one panel, in loop order.
pub(super) struct Side {
    pub(super) panel: usize,
    pub(super) edges: Vec<usize>,
}

impl Side {
    /// Length along the curves \[m\].
    pub(super) fn length(&self, panel: &Panel) -> f64 {
        self.edges.iter().map(|e| panel.edge_length(*e)).sum()
    }

    /// The point half-way along \[m\], and the unit direction there.
    pub(super) fn middle(&self, panel: &Panel) -> (Vec2, Vec2) {
        const PIECES: usize = 32;
        let mut rest = 0.5 * self.length(panel);
        let mut last = (Vec2::zeros(), Vec2::zeros());
        for &e in &self.edges {
            let (a, b) = panel.ends(e);
            let points = panel.edges[e].curve.sample(a, b, PIECES);
            for pair in points.windows(2) {
                let step = pair[1] - pair[0];
                let length = step.norm();
                let share = rest / length.max(f64::MIN_POSITIVE);
                last = (
                    pair[0] + step * share.min(1.0),
                    step / length.max(f64::MIN_POSITIVE),
                );
                if share <= 1.0 {
                    return last;
                }
                rest -= length;
            }
        }
        last
    }
}

/// The seams of a pattern, in the order of their first stitches.
pub(super) fn seams(pattern: &Pattern) -> Vec<Seam> {
    let mut taken = vec![false; pattern.stitches.len()];
    let mut seams = Vec::new();
    for first in 0..pattern.stitches.len() {
        if taken[first] {
            continue;
        }
        let mut chain = Vec::new();
        let mut open = vec![pattern.stitches[first]];
        taken[first] = true;
        while let Some(stitch) = open.pop() {
            chain.push(stitch);
            for (other, candidate) in pattern.stitches.iter().enumerate() {
                if let Some(turned) = follows(pattern, stitch, *candidate)
                    && !taken[other]
                {
                    taken[other] = true;
                    open.push(turned);
                }
            }
        }
        seams.push(Seam {
            sides: [0, 1].map(|s| side(pattern, &chain, s)),
            right_wrong: pattern.stitches[first].right_wrong,
        });
    }
    seams
}

/// `next`, with its sides in the order of `stitch`, when both its edges neighbour those of `stitch`
/// and run the way one seam does.
fn follows(pattern: &Pattern, stitch: Stitch, next: Stitch) -> Option<Stitch> {
    if stitch.right_wrong != next.right_wrong {
        return None;
    }
    let [a, b] = stitch.sides;
    let turned = [next.sides, [next.sides[1], next.sides[0]]];
    let sides = turned.into_iter().find(|[c, d]| {
        let steps = (step(pattern, a, *c), step(pattern, b, *d));
        // An ordinary seam goes forwards on one side where it goes backwards on the other.
        let opposite = if stitch.right_wrong { 1 } else { -1 };
        matches!(steps, (Some(there), Some(here)) if there == opposite * here)
    })?;
    Some(Stitch { sides, ..next })
}

/// 1 when `to` comes right after `from` in its panel's loop, −1 when right before.
fn step(pattern: &Pattern, from: EdgeId, to: EdgeId) -> Option<i32> {
    let count = pattern.panels[from.panel].edges.len();
    if from.panel != to.panel {
        None
    } else if (from.edge + 1) % count == to.edge {
        Some(1)
    } else if (to.edge + 1) % count == from.edge {
        Some(-1)
    } else {
        None
    }
}

/// The edges of side `s` of a chain, from the one that none of them precedes.
fn side(pattern: &Pattern, chain: &[Stitch], s: usize) -> Side {
    let panel = chain[0].sides[s].panel;
    let count = pattern.panels[panel].edges.len();
    let mut edges: Vec<usize> = chain.iter().map(|stitch| stitch.sides[s].edge).collect();
    edges.sort_unstable();
    edges.dedup();
    let begins = |e: &usize| !edges.contains(&((e + count - 1) % count));
    let first = edges.iter().position(begins).unwrap_or(0);
    edges.rotate_left(first);
    Side { panel, edges }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{panel, stitch};

    /// Two squares whose right and left sides are cut in two.
    fn cut_squares() -> Pattern {
        let corners = [[0.0, 0.0], [0.2, 0.0], [0.2, 0.1], [0.2, 0.3], [0.0, 0.3]];
        Pattern {
            panels: vec![panel("front", &corners), panel("back", &corners)],
            stitches: vec![
                stitch((0, 1), (1, 2)),
                stitch((1, 4), (0, 4)),
                stitch((1, 1), (0, 2)),
            ],
        }
    }

    #[test]
    fn stitches_that_follow_one_another_are_one_seam() {
        let seams = seams(&cut_squares());
        assert_eq!(seams.len(), 2);
        assert_eq!(seams[0].sides[0].edges, [1, 2]);
        assert_eq!(seams[0].sides[1].edges, [1, 2]);
        assert_eq!(seams[0].sides[1].panel, 1);
        assert_eq!(seams[1].sides[0].edges, [4]);
    }

    #[test]
    fn neighbours_that_run_the_wrong_way_are_two_seams() {
        let mut pattern = cut_squares();
        // Right to right without turning: forwards on both sides.
        pattern.stitches = vec![stitch((0, 1), (1, 1)), stitch((0, 2), (1, 2))];
        assert_eq!(seams(&pattern).len(), 2);
        for stitch in &mut pattern.stitches {
            stitch.right_wrong = true;
        }
        assert_eq!(seams(&pattern).len(), 1);
    }

    #[test]
    fn the_two_legs_of_a_dart_are_one_seam() {
        let mut pattern = cut_squares();
        pattern.stitches = vec![stitch((0, 1), (0, 2)), stitch((0, 3), (0, 0))];
        let seams = seams(&pattern);
        assert_eq!(seams.len(), 1);
        assert_eq!(seams[0].sides[0].edges.len(), 2);
    }

    #[test]
    fn the_middle_of_a_side_is_half_way_along() {
        let pattern = cut_squares();
        let side = &seams(&pattern)[0].sides[0];
        let (middle, along) = side.middle(&pattern.panels[0]);
        // The right side runs from (0.2, 0) up to (0.2, 0.3).
        assert!((middle - Vec2::new(0.2, 0.15)).norm() < 1e-12);
        assert!((along - Vec2::y()).norm() < 1e-12);
    }
}
