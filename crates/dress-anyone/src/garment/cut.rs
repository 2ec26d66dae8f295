//! What each panel is cut from: its fabric, and how the panel lies on it.

use super::Fabric;
use crate::pattern::Pattern;
use crate::pattern::names::Names;
use crate::problem::Problem;
use serde::{Deserialize, Serialize};

/// What one panel is cut from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// The fabric.
    pub fabric: Fabric,
    /// Angle from the panel's y axis to the warp, counter-clockwise \[°\]: 0 on the straight grain,
    /// 90 across, 45 on the bias.
    pub grain: f64,
}

/// Panels of a fabric or a grain of their own. What is left out stays as it is without the zone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FabricZone {
    /// Their names.
    pub panels: Vec<String>,
    /// Their fabric.
    #[serde(default)]
    pub fabric: Option<Fabric>,
    /// Their grain, as in [`Cut`] \[°\].
    #[serde(default)]
    pub grain: Option<f64>,
}

/// What the panels are cut from, `[panel]`: `fabric` on the straight grain, but for the `zones`, of
/// which later ones decide. Panels that are not there count for nothing.
pub fn cuts(pattern: &Pattern, fabric: &Fabric, zones: &[FabricZone]) -> Vec<Cut> {
    let straight = Cut {
        fabric: *fabric,
        grain: 0.0,
    };
    let mut cuts = vec![straight; pattern.panels.len()];
    for zone in zones {
        for p in zone
            .panels
            .iter()
            .filter_map(|name| pattern.panel_named(name))
        {
            let cut = &mut cuts[p];
            cut.fabric = zone.fabric.unwrap_or(cut.fabric);
            cut.grain = zone.grain.unwrap_or(cut.grain);
        }
    }
    cuts
}

/// Panels that zones name and the pattern does not have.
pub fn unknown_panels(pattern: &Pattern, zones: &[FabricZone]) -> Vec<Problem> {
    let mut names = Names::new(pattern);
    for name in zones.iter().flat_map(|zone| &zone.panels) {
        names.panel(name, "fabric");
    }
    names.problems
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::rectangle;
    use crate::garment::fabrics::named;

    fn pattern() -> Pattern {
        Pattern {
            panels: ["front", "back", "cuff"]
                .map(|name| rectangle(name, 0.2, 0.3))
                .into(),
            stitches: Vec::new(),
        }
    }

    #[test]
    fn later_zones_decide_and_change_only_what_they_tell() {
        let denim = named("denim").expect("there is denim").fabric;
        let zone = |panels: &[&str], fabric, grain| FabricZone {
            panels: panels.iter().map(|&name| name.to_owned()).collect(),
            fabric,
            grain,
        };
        let zones = [
            zone(&["back", "cuff"], None, Some(45.0)),
            zone(&["cuff"], Some(denim), None),
            zone(&["back"], None, Some(90.0)),
        ];
        let plain = Fabric::default();
        let found = cuts(&pattern(), &plain, &zones).into_iter();
        let found: Vec<(Fabric, f64)> = found.map(|cut| (cut.fabric, cut.grain)).collect();
        assert_eq!(found, [(plain, 0.0), (plain, 90.0), (denim, 45.0)]);
    }

    #[test]
    fn unknown_panels_are_named_with_those_there_are() {
        let zones = [FabricZone {
            panels: vec!["frnt".to_owned(), "back".to_owned()],
            fabric: None,
            grain: Some(45.0),
        }];
        let found = unknown_panels(&pattern(), &zones);
        assert_eq!(found.len(), 1);
        assert!(found[0].text.contains("`frnt`") && found[0].text.contains("`front`"));
    }
}
