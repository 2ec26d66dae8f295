//! Fabrics as users tell them: by name, in files, by numbers, for all panels or for some.

use super::{LIMIT, in_plain_words, known, numbers_out_of_range, unknown_keys};
use dress_anyone::garment::{Fabric, FabricZone, fabrics};
use dress_anyone::io::file::read_capped;
use dress_anyone::problem::{BadInput, Problem};
use dress_anyone::refit::RefitParams;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// "NAME|FILE", or "PANEL:NAME|FILE".
#[derive(Clone, Debug, PartialEq)]
pub struct FabricOf {
    panel: Option<String>,
    fabric: PathBuf,
}

impl FabricOf {
    /// Splits what was given. Panels may have colons in their names, and so may files.
    pub fn read(text: &str) -> Result<Self, String> {
        let whole = fabrics::named(text).is_some() || Path::new(text).exists();
        let (panel, fabric) = match text.rsplit_once(':') {
            Some((panel, fabric)) if !whole => (Some(panel), fabric),
            _ => (None, text),
        };
        if fabric.is_empty() || panel == Some("") {
            return Err("must be a fabric, or a panel and a fabric as in cuff:denim".to_owned());
        }
        Ok(Self {
            panel: panel.map(str::to_owned),
            fabric: fabric.into(),
        })
    }
}

/// The fabrics of a command line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChosenFabrics {
    /// Of all panels that have none of their own.
    pub whole: Option<Fabric>,
    zones: Vec<FabricZone>,
}

impl ChosenFabrics {
    /// Looks all of them up.
    pub fn find(chosen: &[FabricOf]) -> Result<Self, BadInput> {
        let mut found = Self::default();
        for FabricOf { panel, fabric } in chosen {
            let fabric = named_or_file(fabric)?;
            match panel {
                None => found.whole = Some(fabric),
                Some(panel) => found.zones.push(FabricZone {
                    panels: vec![panel.clone()],
                    fabric: Some(fabric),
                    grain: None,
                }),
            }
        }
        Ok(found)
    }

    /// Has them decide over what `params` has.
    pub fn over(self, params: &mut RefitParams) {
        params.fabric = self.whole.unwrap_or(params.fabric);
        params.fabric_zones.extend(self.zones);
    }
}

/// The fabric that is called so, or else is in the TOML file at this path.
fn named_or_file(name: &Path) -> Result<Fabric, BadInput> {
    if let Some(found) = name.to_str().and_then(fabrics::named) {
        return Ok(found.fabric);
    }
    let bad = |problems| BadInput::new(name, problems);
    if !name.exists() {
        let text = format!(
            "there is no fabric of this name, and no such file; there are {}",
            fabrics::names()
        );
        return Err(bad(vec![Problem::whole(text)]));
    }
    let bytes = read_capped(name, LIMIT)?;
    let text = String::from_utf8(bytes)
        .map_err(|_| bad(vec![Problem::whole("this is no text; fabrics are TOML")]))?;
    let given: Table = (text.parse()).map_err(|error| bad(vec![in_plain_words(&text, &error)]))?;
    let all = known();
    let keys = all["fabric"].as_table().expect("[fabric] is a table");
    let mut problems = Vec::new();
    unknown_keys(&given, keys, &mut vec![], &all, &mut problems);
    numbers_out_of_range(&given, "fabric", &mut problems);
    if !problems.is_empty() {
        return Err(bad(problems));
    }
    let told: Told =
        toml::from_str(&text).map_err(|error| bad(vec![in_plain_words(&text, &error)]))?;
    told.over(Fabric::default())
        .map_err(|problem| bad(vec![problem]))
}

/// What a parameter file tells of fabrics.
#[derive(Debug, Default)]
pub(super) struct ToldFabrics {
    pub(super) whole: Told,
    pub(super) zones: Vec<ToldZone>,
}

/// A fabric as far as it is told.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Told {
    /// The name of the fabric that it is like in all that is not told.
    like: Option<String>,
    warp: Option<f64>,
    weft: Option<f64>,
    poisson: Option<f64>,
    shear: Option<f64>,
    bending: Option<f64>,
    density: Option<f64>,
    thickness: Option<f64>,
    friction: Option<f64>,
}

/// A [`FabricZone`] as far as it is told.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ToldZone {
    panels: Vec<String>,
    grain: Option<f64>,
    fabric: Option<Told>,
}

impl Told {
    /// The fabric: where nothing is told it is like the one named, or else like `base`.
    fn over(&self, base: Fabric) -> Result<Fabric, Problem> {
        let base = match &self.like {
            None => base,
            Some(name) => {
                let found = fabrics::named(name).ok_or_else(|| {
                    let text = format!(
                        "there is no fabric `{name}`; there are {}",
                        fabrics::names()
                    );
                    Problem::at("key `fabric.like`", text)
                })?;
                found.fabric
            }
        };
        Ok(Fabric {
            warp: self.warp.unwrap_or(base.warp),
            weft: self.weft.unwrap_or(base.weft),
            poisson: self.poisson.unwrap_or(base.poisson),
            shear: self.shear.unwrap_or(base.shear),
            bending: self.bending.unwrap_or(base.bending),
            density: self.density.unwrap_or(base.density),
            thickness: self.thickness.unwrap_or(base.thickness),
            friction: self.friction.unwrap_or(base.friction),
        })
    }
}

impl ToldFabrics {
    /// Sets the fabrics of `params`; `whole` stands in for the table `[fabric]`.
    pub(super) fn over(
        &self,
        whole: Option<Fabric>,
        params: &mut RefitParams,
    ) -> Result<(), Vec<Problem>> {
        let mut problems = Vec::new();
        let mut take = |told: &Told, base: Fabric| {
            told.over(base).unwrap_or_else(|problem| {
                problems.push(problem);
                base
            })
        };
        let base = whole.unwrap_or_else(|| take(&self.whole, Fabric::default()));
        let zone = |zone: &ToldZone| FabricZone {
            panels: zone.panels.clone(),
            fabric: zone.fabric.as_ref().map(|told| take(told, base)),
            grain: zone.grain,
        };
        params.fabric = base;
        params.fabric_zones = self.zones.iter().map(zone).collect();
        if problems.is_empty() {
            Ok(())
        } else {
            Err(problems)
        }
    }
}

/// What is wrong with the keys and numbers of the zones in `given`.
pub(super) fn zone_problems(given: &Table, known: &Table, problems: &mut Vec<Problem>) {
    let Some(Value::Array(zones)) = given.get("fabric_zones") else {
        return;
    };
    let mut keys: Table = ["panels", "grain"]
        .map(|key| (key.to_owned(), Value::String(String::new())))
        .into_iter()
        .collect();
    keys.insert("fabric".to_owned(), known["fabric"].clone());
    for zone in zones.iter().filter_map(Value::as_table) {
        let mut path = vec!["fabric_zones".to_owned()];
        unknown_keys(zone, &keys, &mut path, known, problems);
        if let Some(Value::Table(fabric)) = zone.get("fabric") {
            numbers_out_of_range(fabric, "fabric", problems);
        }
        let grain = match zone.get("grain") {
            Some(Value::Float(grain)) => *grain,
            Some(Value::Integer(grain)) => *grain as f64,
            _ => continue,
        };
        if !(grain.abs() <= 180.0) {
            let text = format!("`{grain}` must be an angle from -180 to 180 degrees");
            problems.push(Problem::at("key `fabric_zones.grain`", text));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    use super::*;

    #[test]
    fn fabrics_are_names_or_files() {
        let denim = named_or_file(Path::new("denim")).expect("a name");
        assert_eq!(Some(denim), fabrics::named("denim").map(|d| d.fabric));
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("my.toml");
        std::fs::write(&file, "density = 0.15\nwarp = 2000\n").expect("writable");
        let mine = named_or_file(&file).expect("a file");
        assert_eq!(
            (mine.density, mine.warp, mine.weft),
            (0.15, 2000.0, Fabric::default().weft)
        );
        std::fs::write(&file, "like = \"denim\"\nwarp = 2000\n").expect("writable");
        let like_denim = named_or_file(&file).expect("a file");
        assert_eq!((like_denim.warp, like_denim.weft), (2000.0, denim.weft));
        std::fs::write(&file, "densty = 0.15\nwarp = -1\n").expect("writable");
        assert_eq!(
            named_or_file(&file)
                .expect_err("two mistakes")
                .problems
                .len(),
            2
        );
        let unknown = named_or_file(Path::new("felt")).expect_err("neither");
        assert!(unknown.to_string().contains("denim"), "{unknown}");
    }

    #[test]
    fn a_fabric_is_for_all_panels_or_for_one() {
        let read = |text| FabricOf::read(text).map(|of| (of.panel, of.fabric));
        let of = |panel: Option<&str>, fabric: &str| Ok((panel.map(str::to_owned), fabric.into()));
        assert_eq!(read("denim"), of(None, "denim"));
        assert_eq!(read("cuff:denim"), of(Some("cuff"), "denim"));
        assert_eq!(read("a:b:my.toml"), of(Some("a:b"), "my.toml"));
        for bad in ["", ":denim", "cuff:"] {
            assert!(read(bad).is_err(), "{bad}");
        }
        let chosen = ["denim", "cuff:rib-knit"].map(|text| FabricOf::read(text).expect("good"));
        let chosen = ChosenFabrics::find(&chosen).expect("both are there");
        let fabric = |name| fabrics::named(name).expect("there").fabric;
        assert_eq!(chosen.whole, Some(fabric("denim")));
        assert_eq!(chosen.zones[0].fabric, Some(fabric("rib-knit")));
    }

    #[test]
    fn zones_tell_what_differs() {
        let text = "[fabric]\nlike = \"denim\"\ndensity = 0.4\n\
                    [[fabric_zones]]\npanels = [\"cuff\"]\nfabric.bending = 1e-3\n\
                    [[fabric_zones]]\npanels = [\"skirt\"]\ngrain = -45\n";
        let denim = fabrics::named("denim").expect("there").fabric;
        for (whole, base) in [
            (
                None,
                Fabric {
                    density: 0.4,
                    ..denim
                },
            ),
            (Some(Fabric::default()), Fabric::default()),
        ] {
            let params = parse(text, whole).expect("good parameters").refit;
            assert_eq!(params.fabric, base);
            let cuff = Fabric {
                bending: 1e-3,
                ..base
            };
            let zones = params.fabric_zones.iter().map(|z| (z.fabric, z.grain));
            let zones: Vec<_> = zones.collect();
            assert_eq!(zones, [(Some(cuff), None), (None, Some(-45.0))]);
        }
    }

    #[test]
    fn everything_wrong_with_zones_is_told() {
        let text = "[[fabric_zones]]\npanels = [\"cuff\"]\ngrian = 4\n\
                    [[fabric_zones]]\npanels = []\ngrain = 200\nfabric = { warp = 0 }\n";
        let told = |text| -> Vec<String> {
            let problems = parse(text, None).expect_err("bad parameters");
            problems.iter().map(ToString::to_string).collect()
        };
        assert_eq!(
            told(text),
            [
                "key `fabric_zones.grian`: there is no such key; did you mean `grain`?",
                "key `fabric.warp`: `0` must be a finite number, above zero",
                "key `fabric_zones.grain`: `200` must be an angle from -180 to 180 degrees",
            ]
        );
        let unknown = &told("[fabric]\nlike = \"felt\"\n")[0];
        assert!(unknown.starts_with("key `fabric.like`: there is no fabric `felt`; there are "));
    }
}
