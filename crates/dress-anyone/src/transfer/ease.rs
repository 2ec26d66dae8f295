//! Ease: the room between body and garment, and what becomes of it on a body of another size.
//!
//! Where the body's girth grows by the factor g, distances to it grow by e(g) = g^κ: κ = 0 keeps them in
//! metres, κ = 1 in proportion. Neither is right for all: a coat for a body 10 % larger is as roomy
//! as before, a coat for a child is not. [`Ease::Auto`] lets κ rise from 0 to 1 with |ln g|, the same
//! for growing as for shrinking, so that there and back is where it was.

use super::bind::smoothstep;
use serde::{Deserialize, Serialize};

/// What becomes of the distance between garment and body on a body of another size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ease {
    /// Kept in metres where the bodies are of like girth, in proportion where they are very
    /// different, and a blend between.
    Auto,
    /// Kept in metres: a coat stays as roomy as it was.
    Absolute,
    /// Grows with the body: scaling the body scales the garment.
    Relative,
    /// Grows by the body's local growth to this power, 0 (absolute) to 1 (relative).
    Blend(f64),
}

/// Growth of the girth up to which [`Ease::Auto`] keeps metres, and from which on proportions.
const AUTO: (f64, f64) = (1.15, 1.7);

/// The ease wanted at one vertex: κ = `fixed` + `auto` · κ(g).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EaseAt {
    /// The part of κ that was chosen \[–\].
    pub fixed: f64,
    /// Weight of the part that the growth decides \[–\].
    pub auto: f64,
}

impl From<Ease> for EaseAt {
    fn from(ease: Ease) -> Self {
        let (fixed, auto) = match ease {
            Ease::Auto => (0.0, 1.0),
            Ease::Absolute => (0.0, 0.0),
            Ease::Relative => (1.0, 0.0),
            Ease::Blend(kappa) => (kappa, 0.0),
        };
        Self { fixed, auto }
    }
}

impl EaseAt {
    /// The mean, where panels of different ease meet; absolute for none.
    pub fn mean(of: &[Self]) -> Self {
        let share = 1.0 / of.len().max(1) as f64;
        Self {
            fixed: of.iter().map(|at| at.fixed * share).sum(),
            auto: of.iter().map(|at| at.auto * share).sum(),
        }
    }

    /// e(g) from ln g.
    pub(super) fn factor(self, growth: f64) -> f64 {
        let (low, high) = (AUTO.0.ln(), AUTO.1.ln());
        let decided = smoothstep((growth.abs() - low) / (high - low));
        ((self.fixed + self.auto * decided) * growth).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn like_bodies_keep_metres_and_unlike_ones_proportions() {
        let auto = EaseAt::from(Ease::Auto);
        let factor = |g: f64| auto.factor(g.ln());
        assert!((factor(1.1) - 1.0).abs() < 1e-15);
        assert!((factor(0.5) - 0.5).abs() < 1e-15);
        assert!(1.0 < factor(1.4) && factor(1.4) < 1.4);
        // There and back.
        assert!((factor(1.4) * factor(1.0 / 1.4) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn where_panels_meet_their_ease_is_the_mean() {
        let both = [Ease::Absolute, Ease::Relative].map(EaseAt::from);
        let factor = EaseAt::mean(&both).factor(4.0_f64.ln());
        // √4.
        assert!((factor - 2.0).abs() < 1e-12, "{factor}");
    }
}
