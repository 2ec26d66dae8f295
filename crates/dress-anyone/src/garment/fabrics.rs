//! Fabrics by the names that tailors use, with where their numbers come from.
//!
//! Ten are samples that Wang, O'Brien & Ramamoorthi 2011 measured ("Data-driven elastic models for
//! cloth", doi 10.1145/2010324.1964966). They give stiffness at six strains and directions; a fabric here
//! has one number for each: the mean of their six for warp, weft and their coupling (the coupling told
//! as Poisson's ratio), their first for shear, and the mean of warp, weft and bias at small curvature
//! for bending. Which of their two axes is the warp they do not say; the stiffer one is taken for it.
//!
//! The others are no samples but what is typical of the name:
//!
//! - Density is that of the trade; silk in momme of 4.34 g/m².
//! - Bending is of the order that Feng, Huang, Xu & Wang 2022 (doi 10.1145/3550454.3555464) measured by
//!   cantilevers in fabrics of that weight. Of their data set's first 270 rows the middle half, mean of
//!   warp, weft and bias, has at 20–35 g/m² 0.8 to 1.3 µN·m, at 50–100 2 to 6, at 100–135 4 to 10, at
//!   135–190 6 to 21, at 190–250 9 to 28, at 250–340 16 to 50, at 350–500 21 to 53. Limp fabrics have
//!   the lower, crisp ones the upper end. (0.1 gf cm²/cm, as Kawabata's instruments print it, is 10 µN·m.)
//! - Tensile stiffness is what makes woven cloth 1 to 3 % longer at 20 N/m, which garments bear, and
//!   shear stiffness 0.3 to 3 gf/cm per degree, or 17 to 170 N/m: the ranges of Kawabata's and of the
//!   FAST instruments (Kawabata 1980; De Boos & Tester 1994). Cloth stiffens as it is pulled; one number
//!   cannot tell that. Poisson's ratios are of the order of Penava, Šimić Penava & Knezić 2014 (cotton
//!   0.24, wool 0.28, polyester 0.38).
//! - Thickness is typical, too, also of the ten samples, which came without. Penava et al. have 0.32 mm
//!   for cotton of 150 g/m², 0.25 for polyester of 165, 0.57 for wool of 235.
//! - Friction is that of cloth on dry skin, for all fabrics a guess within 0.2 to 0.6 (Derler & Gerhardt
//!   2012), smooth ones low. It depends on the skin more than on the cloth: one cotton had 0.31 on the
//!   forearm and 0.90 on the chest (Temel, Johnson & Lloyd 2022).

use super::Fabric;

/// A fabric with a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NamedFabric {
    /// As users call it.
    pub name: &'static str,
    /// What it is.
    pub what: &'static str,
    /// Its numbers.
    pub fabric: Fabric,
    /// Where they come from.
    pub sources: Sources,
}

/// Where a fabric's numbers come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sources {
    /// Warp, weft, their coupling and shear.
    pub stretch: &'static str,
    /// Bending rigidity.
    pub bending: &'static str,
    /// Mass per area.
    pub density: &'static str,
    /// Thickness.
    pub thickness: &'static str,
    /// Coulomb's coefficient.
    pub friction: &'static str,
}

const SKIN: &str = "typical of dry skin, 0.2 to 0.6: Derler & Gerhardt 2012; Temel et al. 2022";
const THICKNESS: &str = "typical";
const WEIGHT: &str = "typical of the trade";
const CANTILEVER: &str = "typical of its weight: 618 fabrics of Feng et al. 2022";
const WOVEN: &str = "typical of wovens: Kawabata 1980; De Boos & Tester 1994; Penava et al. 2014";

const TYPICAL: Sources = Sources {
    stretch: WOVEN,
    bending: CANTILEVER,
    density: WEIGHT,
    thickness: THICKNESS,
    friction: SKIN,
};

/// The numbers, in the units in which they are usually told: g/m², N/m weft and warp, Poisson's ratio, N/m
/// shear, µN·m, mm, friction.
const fn fabric(
    [
        density,
        weft,
        warp,
        poisson,
        shear,
        bending,
        thickness,
        friction,
    ]: [f64; 8],
) -> Fabric {
    Fabric {
        warp,
        weft,
        poisson,
        shear,
        bending: bending / 1e6,
        density: density / 1e3,
        thickness: thickness / 1e3,
        friction,
    }
}

/// A fabric of which nothing but the name is certain.
const fn typical(name: &'static str, what: &'static str, numbers: [f64; 8]) -> NamedFabric {
    NamedFabric {
        name,
        what,
        fabric: fabric(numbers),
        sources: TYPICAL,
    }
}

/// A sample of Wang et al. 2011.
const fn measured(
    name: &'static str,
    what: &'static str,
    source: &'static str,
    numbers: [f64; 8],
) -> NamedFabric {
    NamedFabric {
        name,
        what,
        fabric: fabric(numbers),
        sources: Sources {
            stretch: source,
            bending: source,
            density: source,
            ..TYPICAL
        },
    }
}

const KNIT: Sources = Sources {
    stretch: "of the order of the knits that Wang et al. 2011 measured",
    ..TYPICAL
};

/// Every fabric there is.
pub const ALL: [NamedFabric; 31] = [
    NamedFabric {
        sources: Sources {
            stretch: "the same in all directions, of the order of light knits and soft wovens; no sample",
            bending: "soft shirting, 0.1 gf cm²/cm: Kawabata 1980",
            ..TYPICAL
        },
        ..typical(
            "shirting",
            "the default: a soft medium cloth without a grain",
            [200.0, 1000.0, 1000.0, 0.3, 1000.0 / 2.6, 10.0, 0.5, 0.4],
        )
    },
    typical(
        "cotton-poplin",
        "crisp plain weave for shirts and summer dresses",
        [125.0, 1000.0, 2000.0, 0.24, 60.0, 7.0, 0.28, 0.4],
    ),
    typical(
        "cotton-voile",
        "sheer, soft plain weave for blouses",
        [75.0, 700.0, 1200.0, 0.24, 25.0, 3.0, 0.2, 0.35],
    ),
    typical(
        "flannel",
        "brushed cotton for shirts and nightwear",
        [170.0, 700.0, 1000.0, 0.24, 40.0, 10.0, 0.7, 0.45],
    ),
    typical(
        "corduroy",
        "ribbed cotton pile for trousers and jackets",
        [320.0, 1200.0, 2000.0, 0.24, 80.0, 40.0, 1.3, 0.45],
    ),
    typical(
        "canvas",
        "heavy plain weave (duck) for workwear and coats",
        [350.0, 3000.0, 4000.0, 0.2, 150.0, 75.0, 0.7, 0.4],
    ),
    typical(
        "linen",
        "flax in plain weave for suits, shirts and dresses",
        [180.0, 1500.0, 2000.0, 0.2, 45.0, 20.0, 0.4, 0.4],
    ),
    typical(
        "silk-charmeuse",
        "fluid silk satin, 16 momme, for slips and evening dresses",
        [70.0, 700.0, 1200.0, 0.3, 17.0, 2.5, 0.18, 0.25],
    ),
    typical(
        "silk-habotai",
        "light plain silk, 10 momme, for linings and blouses",
        [43.0, 700.0, 1000.0, 0.3, 20.0, 1.5, 0.1, 0.25],
    ),
    typical(
        "chiffon",
        "sheer crêpe yarns, loosely woven, for veils and overlays",
        [35.0, 400.0, 600.0, 0.3, 10.0, 1.2, 0.12, 0.3],
    ),
    typical(
        "organza",
        "sheer and stiff, for sleeves, ruffles and underskirts",
        [40.0, 1200.0, 1500.0, 0.2, 50.0, 6.0, 0.12, 0.3],
    ),
    typical(
        "crepe",
        "crêpe de chine and its like, for draped dresses",
        [110.0, 500.0, 800.0, 0.3, 20.0, 4.0, 0.3, 0.3],
    ),
    typical(
        "satin",
        "polyester satin for bridal and evening dresses",
        [150.0, 1200.0, 2000.0, 0.38, 40.0, 10.0, 0.25, 0.25],
    ),
    typical(
        "taffeta",
        "crisp, rustling plain weave for full skirts",
        [110.0, 1500.0, 2000.0, 0.3, 80.0, 11.0, 0.16, 0.3],
    ),
    typical(
        "velvet",
        "woven pile for evening dresses and jackets",
        [300.0, 700.0, 1000.0, 0.3, 40.0, 25.0, 1.4, 0.4],
    ),
    NamedFabric {
        sources: Sources {
            bending: "the range that suits tailor well, 5 to 14 µN·m: De Boos & Tester 1994",
            ..TYPICAL
        },
        ..typical(
            "wool-suiting",
            "worsted for suits, skirts and trousers",
            [250.0, 900.0, 1200.0, 0.28, 45.0, 12.0, 0.55, 0.4],
        )
    },
    typical(
        "wool-coating",
        "milled woollen (melton) for coats",
        [450.0, 700.0, 900.0, 0.28, 90.0, 45.0, 1.8, 0.45],
    ),
    NamedFabric {
        sources: Sources {
            stretch: "a net gives way between its threads: softer than wovens of its weight; no sample",
            ..TYPICAL
        },
        ..typical(
            "tulle",
            "soft nylon net for veils and overskirts",
            [20.0, 60.0, 150.0, 0.3, 10.0, 1.0, 0.25, 0.35],
        )
    },
    NamedFabric {
        sources: KNIT,
        ..typical(
            "jersey",
            "single jersey of cotton for T-shirts",
            [160.0, 80.0, 180.0, 0.4, 30.0, 6.0, 0.6, 0.45],
        )
    },
    NamedFabric {
        sources: KNIT,
        ..typical(
            "fleece",
            "brushed polyester knit, 200 weight, for jackets",
            [220.0, 120.0, 250.0, 0.35, 40.0, 20.0, 3.0, 0.45],
        )
    },
    NamedFabric {
        sources: Sources {
            stretch: "some 3 MPa at small strains, of garment leather 0.8 mm thick; no sample",
            bending: "of a plate of that modulus and thickness",
            thickness: "garment leather has 0.6 to 1.0 mm: Memon et al. 2021",
            ..TYPICAL
        },
        ..typical(
            "leather",
            "sheep nappa for jackets and skirts",
            [550.0, 2000.0, 3000.0, 0.4, 800.0, 110.0, 0.8, 0.5],
        )
    },
    measured(
        "denim",
        "11 oz, 99 % cotton and 1 % spandex, for jeans",
        "measured: Wang et al. 2011, 11oz-black-denim",
        [324.0, 222.0, 1042.0, 0.08, 53.0, 78.0, 0.8, 0.4],
    ),
    measured(
        "interlock",
        "knit of 60 % cotton and 40 % polyester, for T-shirts",
        "measured: Wang et al. 2011, gray-interlock",
        [187.0, 69.0, 231.0, 0.42, 37.0, 21.0, 0.8, 0.45],
    ),
    measured(
        "ponte-roma",
        "double knit of 60 % polyester and 40 % rayon, for jackets",
        "measured: Wang et al. 2011, camel-ponte-roma",
        [284.0, 81.0, 139.0, 0.40, 32.0, 36.0, 0.9, 0.4],
    ),
    measured(
        "rib-knit",
        "95 % cotton and 5 % spandex, for underwear and cuffs",
        "measured: Wang et al. 2011, ivory-rib-knit",
        [276.0, 62.0, 158.0, 0.01, 83.0, 36.0, 1.0, 0.45],
    ),
    measured(
        "blanket",
        "polyester, for blankets",
        "measured: Wang et al. 2011, pink-ribbon-brown",
        [228.0, 111.0, 207.0, 0.49, 30.0, 88.0, 2.5, 0.45],
    ),
    measured(
        "tablecloth",
        "polyester, for tablecloths",
        "measured: Wang et al. 2011, white-dots-on-blk",
        [128.0, 2089.0, 2125.0, 0.02, 19.0, 41.0, 0.3, 0.35],
    ),
    measured(
        "sweatshirt",
        "knit of 96 % polyester and 4 % spandex, for sweaters",
        "measured: Wang et al. 2011, navy-sparkle-sweat",
        [224.0, 48.0, 136.0, 0.51, 18.0, 48.0, 1.2, 0.45],
    ),
    measured(
        "swimwear",
        "knit of 87 % nylon and 13 % spandex, for swimsuits",
        "measured: Wang et al. 2011, white-swim-solid",
        [204.0, 48.0, 109.0, 0.19, 61.0, 57.0, 0.6, 0.4],
    ),
    measured(
        "light-jacket",
        "polyester, for windbreakers",
        "measured: Wang et al. 2011, tango-red-jet-set",
        [113.0, 91.0, 233.0, 0.46, 14.0, 19.0, 0.25, 0.35],
    ),
    measured(
        "trouser-cotton",
        "65 % cotton and 35 % polyester, for trousers",
        "measured: Wang et al. 2011, royal-target",
        [220.0, 2093.0, 2128.0, 0.02, 105.0, 120.0, 0.45, 0.4],
    ),
];

/// The fabric called `name`.
pub fn named(name: &str) -> Option<&'static NamedFabric> {
    ALL.iter().find(|fabric| fabric.name == name)
}

/// The names of all, one after the other.
pub fn names() -> String {
    ALL.map(|fabric| fabric.name).join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_fabric_is_one_that_can_be_draped_and_says_where_it_is_from() {
        for NamedFabric {
            name,
            what,
            fabric,
            sources,
        } in ALL
        {
            let all = [fabric.warp, fabric.weft, fabric.shear, fabric.bending];
            assert!(all.iter().all(|v| *v > 0.0), "{name}");
            // Clothes are made of 20 to 600 g/m²; plane stress is stable for |ν| < 1.
            assert!((0.02..0.6).contains(&fabric.density), "{name}");
            assert!((0.0..0.6).contains(&fabric.poisson), "{name}");
            assert!((1e-4..5e-3).contains(&fabric.thickness), "{name}");
            assert!((0.2..0.6).contains(&fabric.friction), "{name}");
            // Fibres weigh 900 to 1600 kg/m³, and half of cloth or more is air.
            let solid = fabric.density / fabric.thickness;
            assert!((50.0..800.0).contains(&solid), "{name}: {solid} kg/m³");
            let Sources {
                stretch,
                bending,
                density,
                thickness,
                friction,
            } = sources;
            let texts = [stretch, bending, density, thickness, friction, what];
            assert!(texts.iter().all(|text| text.len() >= 7), "{name}");
            assert_eq!(named(name).map(|f| f.fabric), Some(fabric));
        }
        let names: BTreeSet<&str> = ALL.iter().map(|fabric| fabric.name).collect();
        assert_eq!(names.len(), ALL.len());
        assert!(named("chain mail").is_none());
    }

    #[test]
    fn the_default_is_the_shirting() {
        let (named, default) = (named("shirting").expect("there").fabric, Fabric::default());
        let numbers = |f: Fabric| {
            let stretch = [f.warp, f.weft, f.poisson, f.shear];
            [
                &stretch[..],
                &[f.bending, f.density, f.thickness, f.friction],
            ]
            .concat()
        };
        for (a, b) in numbers(named).into_iter().zip(numbers(default)) {
            // A rounding apart: one is told in grams and millimetres.
            assert!((a - b).abs() < 1e-12 * b, "{a} {b}");
        }
    }

    #[test]
    fn typical_bending_is_within_what_was_measured_of_that_weight() {
        for NamedFabric {
            name,
            fabric,
            sources,
            ..
        } in ALL
        {
            if sources.bending != CANTILEVER {
                continue;
            }
            // The middle halves of the data that the file's head quotes lie within 0.28 and 1.7 times this;
            // organza and canvas are known for standing stiff.
            let middle = 0.025e-6 * (1e3 * fabric.density).powf(1.25);
            let ratio = fabric.bending / middle;
            assert!((0.28..2.5).contains(&ratio), "{name}: {ratio}");
        }
    }
}
