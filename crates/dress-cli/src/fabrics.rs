//! `dress fabrics`.

use crate::arguments::FabricsArguments;
use crate::failure::Failure;
use dress_anyone::garment::fabrics::{self, NamedFabric};
use std::fmt::Write;

/// All fabrics as a table, or one with the sources of its numbers.
pub fn run(arguments: &FabricsArguments) -> Result<String, Failure> {
    match &arguments.name {
        None => Ok(table()),
        Some(name) => fabrics::named(name).map(one).ok_or_else(|| {
            let names = fabrics::names();
            Failure::Refused(format!("there is no fabric `{name}`; there are {names}"))
        }),
    }
}

fn table() -> String {
    let mut text = format!(
        "{:<16} {:>6} {:>6} {:>6} {:>6} {:>7} {:>6} {:>5} {:>5}  what it is\n\
         {:<16} {:>6} {:>6} {:>6} {:>6} {:>7} {:>6} {:>5} {:>5}\n",
        "fabric",
        "warp",
        "weft",
        "coupl.",
        "shear",
        "bending",
        "weight",
        "thick",
        "frict",
        "",
        "N/m",
        "N/m",
        "-",
        "N/m",
        "uN m",
        "g/m2",
        "mm",
        "-"
    );
    for NamedFabric {
        name, what, fabric, ..
    } in &fabrics::ALL
    {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{name:<16} {:>6.0} {:>6.0} {:>6.2} {:>6.0} {:>7.1} {:>6.0} {:>5.2} {:>5.2}  {what}",
            fabric.warp,
            fabric.weft,
            fabric.poisson,
            fabric.shear,
            1e6 * fabric.bending,
            1e3 * fabric.density,
            1e3 * fabric.thickness,
            fabric.friction
        );
    }
    text + "\nWhere the numbers of one come from: dress fabrics NAME\n"
}

fn one(named: &NamedFabric) -> String {
    let NamedFabric {
        name,
        what,
        fabric,
        sources,
    } = named;
    let stretch = format!(
        "warp = {}\nweft = {}\npoisson = {}\nshear = {:.1}",
        fabric.warp, fabric.weft, fabric.poisson, fabric.shear
    );
    let parts = [
        (sources.stretch, stretch),
        (sources.bending, format!("bending = {:e}", fabric.bending)),
        (sources.density, format!("density = {}", fabric.density)),
        (
            sources.thickness,
            format!("thickness = {:e}", fabric.thickness),
        ),
        (sources.friction, format!("friction = {}", fabric.friction)),
    ];
    let parts = parts.map(|(source, numbers)| format!("\n# {source}\n{numbers}\n"));
    format!("# {name}: {what}\n{}", parts.concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_printed_of_a_fabric_is_a_fabric_file() {
        for named in &fabrics::ALL {
            let table: toml::Table = one(named).parse().expect("TOML");
            let told = table["bending"].as_float().expect("a number");
            // Seventeen digits.
            assert!((told - named.fabric.bending).abs() < 1e-15 * told.abs());
            assert_eq!(table.len(), 8, "{}", named.name);
        }
    }
}
