//! Folds that are pressed along seams: collars turned over, pleats between panels, creases.

use crate::pattern::names::Names;
use crate::pattern::{EdgeId, Pattern};
use crate::problem::Problem;
use serde::{Deserialize, Serialize};

/// A fold as it is told.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PressedFold {
    /// The seam: "PANEL:EDGE", the edge by its number or label.
    pub edge: String,
    /// The angle by which what is sewn to the panel is turned out of the panel's plane \[°\]: 0 lies flat,
    /// 180 on the panel; positive brings it to the panel's wrong side, negative to its right side.
    pub angle: f64,
    /// How much firmer the crease is than the cloth \[–\]: a multiple of the bending rigidity.
    #[serde(default = "firm")]
    pub firmness: f64,
}

/// Pressed, but not starched.
fn firm() -> f64 {
    10.0
}

/// A fold of a garment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoldLine {
    /// The edge of the panel that the angle is told of.
    pub edge: EdgeId,
    /// \[rad\], as in [`PressedFold`].
    pub angle: f64,
    /// \[–\].
    pub firmness: f64,
}

/// The folds of a pattern; all that is wrong with them, if anything is.
pub fn fold_lines(pattern: &Pattern, folds: &[PressedFold]) -> Result<Vec<FoldLine>, Vec<Problem>> {
    let mut names = Names::new(pattern);
    let mut lines = Vec::new();
    for fold in folds {
        let place = || format!("folds, `{}`", fold.edge);
        if !(fold.angle.abs() <= 180.0) {
            let text = format!("`{}` must be an angle from -180 to 180 degrees", fold.angle);
            names.problems.push(Problem::at(place(), text));
        }
        if !(fold.firmness > 0.0 && fold.firmness.is_finite()) {
            let text = format!("firmness `{}` must be a number above zero", fold.firmness);
            names.problems.push(Problem::at(place(), text));
        }
        for edge in names.edges(&fold.edge, "folds") {
            let sewn = |stitch: &crate::pattern::Stitch| stitch.sides.contains(&edge);
            if !pattern.stitches.iter().any(sewn) {
                let text = "nothing is sewn to this edge: folds run along seams";
                names.problems.push(Problem::at(place(), text));
            }
            lines.push(FoldLine {
                edge,
                angle: fold.angle.to_radians(),
                firmness: fold.firmness,
            });
        }
    }
    if names.problems.is_empty() {
        Ok(lines)
    } else {
        Err(names.problems)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{rectangle, stitch};
    use std::f64::consts::PI;

    fn pattern() -> Pattern {
        let mut pattern = Pattern {
            panels: vec![rectangle("stand", 0.4, 0.03), rectangle("fall", 0.4, 0.06)],
            stitches: vec![stitch((0, 2), (1, 0))],
        };
        pattern.panels[0].edges[2].label = Some("roll".to_owned());
        pattern
    }

    fn fold(edge: &str, angle: f64, firmness: f64) -> PressedFold {
        PressedFold {
            edge: edge.to_owned(),
            angle,
            firmness,
        }
    }

    #[test]
    fn folds_run_along_seams_by_number_or_label() {
        for edge in ["stand:2", "stand:roll"] {
            let lines = fold_lines(&pattern(), &[fold(edge, -90.0, 2.0)]).expect("a seam");
            let edge = EdgeId { panel: 0, edge: 2 };
            let (angle, firmness) = (-0.5 * PI, 2.0);
            assert_eq!(
                lines,
                [FoldLine {
                    edge,
                    angle,
                    firmness
                }]
            );
        }
    }

    #[test]
    fn everything_wrong_is_told() {
        let folds = [
            fold("stand:0", 170.0, 1.0),
            fold("collar:1", 170.0, 1.0),
            fold("fall:0", 200.0, 0.0),
        ];
        let problems = fold_lines(&pattern(), &folds).expect_err("four problems");
        let texts: Vec<String> = problems.iter().map(ToString::to_string).collect();
        for words in [
            "nothing is sewn",
            "no panel `collar`",
            "`200`",
            "firmness `0`",
        ] {
            assert!(texts.iter().any(|text| text.contains(words)), "{texts:?}");
        }
        assert_eq!(texts.len(), 4);
    }
}
