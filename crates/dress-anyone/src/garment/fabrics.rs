//! Fabrics by name, with where their numbers come from.
//!
//! All but the first are samples measured by Wang, O'Brien & Ramamoorthi 2011 ("Data-driven elastic
//! models for cloth", doi 10.1145/2010324.1964966), whose data set names each by its trade name.
//! They measured stiffness at six strains and directions; a fabric here has one number for each:
//! the mean of their six for warp, weft and their coupling (the coupling told as Poisson's ratio),
//! their first for shear, and the mean of warp, weft and bias at small curvature for bending. Which
//! of their two axes is the warp they do not say; the stiffer one is taken for it.

use super::Fabric;

/// A fabric with a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NamedFabric {
    /// As users call it.
    pub name: &'static str,
    /// Its numbers.
    pub fabric: Fabric,
    /// What was measured, or how else the numbers came about.
    pub source: &'static str,
}

const fn measured(
    name: &'static str,
    [density, weft, warp, poisson, shear, bending]: [f64; 6],
    source: &'static str,
) -> NamedFabric {
    NamedFabric {
        name,
        fabric: Fabric {
            warp,
            weft,
            poisson,
            shear,
            bending,
            density,
        },
        source,
    }
}

/// Every fabric there is: kg/m², N/m weft and warp, Poisson's ratio, N/m shear, N·m.
pub const ALL: [NamedFabric; 11] = [
    measured(
        "shirting",
        [0.2, 1000.0, 1000.0, 0.3, 1000.0 / 2.6, 1e-5],
        "the default: isotropic, of the order of Kawabata's measurements of soft shirting; not one sample",
    ),
    measured(
        "denim",
        [0.324, 222.0, 1042.0, 0.08, 53.0, 78e-6],
        "Wang et al. 2011, 11oz-black-denim: 99 % cotton, 1 % spandex, for jeans",
    ),
    measured(
        "interlock",
        [0.187, 69.0, 231.0, 0.42, 37.0, 21e-6],
        "Wang et al. 2011, gray-interlock: 60 % cotton, 40 % polyester, for T-shirts",
    ),
    measured(
        "ponte-roma",
        [0.284, 81.0, 139.0, 0.40, 32.0, 36e-6],
        "Wang et al. 2011, camel-ponte-roma: 60 % polyester, 40 % rayon, for jackets",
    ),
    measured(
        "rib-knit",
        [0.276, 62.0, 158.0, 0.01, 83.0, 36e-6],
        "Wang et al. 2011, ivory-rib-knit: 95 % cotton, 5 % spandex, for underwear",
    ),
    measured(
        "blanket",
        [0.228, 111.0, 207.0, 0.49, 30.0, 88e-6],
        "Wang et al. 2011, pink-ribbon-brown: 100 % polyester, for blankets",
    ),
    measured(
        "tablecloth",
        [0.128, 2089.0, 2125.0, 0.02, 19.0, 41e-6],
        "Wang et al. 2011, white-dots-on-blk: 100 % polyester, for tablecloths",
    ),
    measured(
        "sweatshirt",
        [0.224, 48.0, 136.0, 0.51, 18.0, 48e-6],
        "Wang et al. 2011, navy-sparkle-sweat: 96 % polyester, 4 % spandex, for sweaters",
    ),
    measured(
        "swimwear",
        [0.204, 48.0, 109.0, 0.19, 61.0, 57e-6],
        "Wang et al. 2011, white-swim-solid: 87 % nylon, 13 % spandex, for swimsuits",
    ),
    measured(
        "light-jacket",
        [0.113, 91.0, 233.0, 0.46, 14.0, 19e-6],
        "Wang et al. 2011, tango-red-jet-set: 100 % polyester, for jackets",
    ),
    measured(
        "trouser-cotton",
        [0.220, 2093.0, 2128.0, 0.02, 105.0, 120e-6],
        "Wang et al. 2011, royal-target: 65 % cotton, 35 % polyester, for trousers",
    ),
];

/// The fabric called `name`.
pub fn named(name: &str) -> Option<&'static NamedFabric> {
    ALL.iter().find(|fabric| fabric.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fabric_is_one_that_can_be_draped_and_says_where_it_is_from() {
        for NamedFabric {
            name,
            fabric,
            source,
        } in ALL
        {
            let all = [fabric.warp, fabric.weft, fabric.shear, fabric.bending];
            assert!(all.iter().all(|v| *v > 0.0), "{name}");
            // Cloth weighs 50 to 500 g/m²; plane stress is stable for |ν| < 1.
            assert!((0.05..0.5).contains(&fabric.density), "{name}");
            assert!((0.0..0.6).contains(&fabric.poisson), "{name}");
            assert!(source.len() > 20, "{name}");
            assert_eq!(named(name).map(|f| f.fabric), Some(fabric));
        }
        assert_eq!(named("shirting").map(|f| f.fabric), Some(Fabric::default()));
        assert!(named("chain mail").is_none());
    }
}
