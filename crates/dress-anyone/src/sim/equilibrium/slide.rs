//! Whether a garment slides: late in the search half of its vertices still fall.

use crate::geometry::Vec3;
use std::collections::VecDeque;

/// A garment half of whose vertices fall this far \[m\] over [`WINDOW`] late iterations slides.
const SLIDE: f64 = 0.01;
/// Iterations over which sliding is judged.
const WINDOW: usize = 10;
/// Sliding is judged only after this many iterations.
const SETTLED_AFTER: usize = 100;

/// The last states of a search.
pub(super) struct Late {
    window: VecDeque<Vec<Vec3>>,
    iterations: usize,
}

impl Late {
    /// Of a search that begins at `x` \[m\].
    pub(super) fn new(x: &[Vec3]) -> Self {
        Self {
            window: VecDeque::from([x.to_vec()]),
            iterations: 0,
        }
    }

    /// Notes the next state `x` \[m\]; whether the garment still falls.
    pub(super) fn slides(&mut self, x: &[Vec3]) -> bool {
        self.iterations += 1;
        self.window.push_back(x.to_vec());
        if self.window.len() <= WINDOW {
            return false;
        }
        let before = self.window.pop_front().expect("it holds some");
        self.iterations >= SETTLED_AFTER && median_fall(&before, x) > SLIDE
    }
}

/// How far at least half of the vertices fell \[m\]: a hood that turns over on a garment at rest moves its
/// centre, too.
fn median_fall(before: &[Vec3], x: &[Vec3]) -> f64 {
    let mut falls: Vec<f64> = before.iter().zip(x).map(|(b, x)| b.y - x.y).collect();
    let middle = falls.len() / 2;
    *falls.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hood_that_turns_over_is_no_slide() {
        // Some of nine vertices fall by 1 cm in each of 200 iterations, and the centre with them.
        let slide = |falling: usize| {
            let at = |n: usize| -> Vec<Vec3> {
                let fall = |v: usize| if v < falling { -0.01 * n as f64 } else { 0.0 };
                (0..9).map(|v| Vec3::y() * fall(v)).collect()
            };
            let mut late = Late::new(&at(0));
            (1..=200).any(|n| late.slides(&at(n)))
        };
        assert!(!slide(4));
        assert!(slide(5));
    }
}
