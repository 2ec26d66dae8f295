//! What of a design a target shape keeps: ease, sizes and lengths.

use crate::params::Params;
use clap::Args;
use dress_anyone::problem::BadInput;
use dress_anyone::transfer::{Ease, Zone};

/// What a target shape keeps.
#[derive(Debug, Args)]
pub struct DesignArguments {
    /// What becomes of the room between garment and body, or a panel and the body: auto, absolute (kept in
    /// metres), relative (grows with the body), or a number between 0 (absolute) and 1 (relative); may be
    /// given several times [default: auto]
    #[arg(long, value_name = "[PANEL:]EASE", value_parser = ease)]
    pub ease: Vec<EaseOf>,
    /// A panel that keeps its size: a pocket, a badge, a cuff; may be given several times
    #[arg(long, value_name = "PANEL")]
    pub keep: Vec<String>,
    /// An edge that keeps its length, by its number or label; may be given several times
    #[arg(long, value_name = "PANEL:EDGE")]
    pub keep_length: Vec<String>,
}

/// The ease of one panel, or of all.
#[derive(Clone, Debug, PartialEq)]
pub struct EaseOf {
    panel: Option<String>,
    ease: Ease,
}

impl DesignArguments {
    /// The parameters, overridden by what is told here.
    pub fn over(&self, params: Result<Params, BadInput>) -> Result<Params, BadInput> {
        let mut params = params?;
        let transfer = &mut params.refit.transfer;
        for EaseOf { panel, ease } in &self.ease {
            match panel {
                None => transfer.ease = *ease,
                Some(panel) => transfer.zones.push(Zone {
                    panels: vec![panel.clone()],
                    ease: *ease,
                }),
            }
        }
        transfer.keep.extend(self.keep.iter().cloned());
        (transfer.keep_length).extend(self.keep_length.iter().cloned());
        Ok(params)
    }
}

/// Reads "EASE" or "PANEL:EASE".
fn ease(text: &str) -> Result<EaseOf, String> {
    let (panel, kind) = match text.rsplit_once(':') {
        Some((panel, kind)) => (Some(panel.to_owned()), kind),
        None => (None, text),
    };
    let ease = match kind {
        "auto" => Ease::Auto,
        "absolute" => Ease::Absolute,
        "relative" => Ease::Relative,
        number => match number.parse::<f64>() {
            Ok(kappa) if (0.0..=1.0).contains(&kappa) => Ease::Blend(kappa),
            _ => return Err("must be auto, absolute, relative, or a number from 0 to 1".to_owned()),
        },
    };
    Ok(EaseOf { panel, ease })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ease_is_read_for_all_and_for_panels() {
        let read = |text| ease(text).map(|of| (of.panel, of.ease));
        assert_eq!(read("relative"), Ok((None, Ease::Relative)));
        assert_eq!(
            read("front:0.3"),
            Ok((Some("front".to_owned()), Ease::Blend(0.3)))
        );
        // Panels may have colons in their names.
        let colon = Ok((Some("a:b".to_owned()), Ease::Absolute));
        assert_eq!(read("a:b:absolute"), colon);
        for bad in ["", "loose", "2", "-1", "nan", "front:"] {
            assert!(ease(bad).is_err(), "{bad}");
        }
    }
}
