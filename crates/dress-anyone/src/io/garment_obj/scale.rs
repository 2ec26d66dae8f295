//! How large the pattern in the texture coordinates is, and in which unit and axes the drape.
//!
//! Cloth hardly stretches, so a mesh edge is as long in the drape as in the pattern: their ratio is
//! the scale. If it is not the same everywhere, the texture is no pattern, and no scale is right.

use super::UvOptions;
use super::islands::Islands;
use crate::body::{FileFrame, UpAxis};
use crate::geometry::{Mat2, Vec2, Vec3, bounds};
use crate::io::obj::Document;
use crate::problem::Problem;
use std::ops::Range;

/// Units a drape may come in, likeliest first: metres in one, and its name.
const UNITS: [(f64, &str); 5] = [
    (1.0, "metres"),
    (0.01, "centimetres"),
    (0.001, "millimetres"),
    (0.1, "decimetres"),
    (0.0254, "inches"),
];

/// Largest extent of a garment \[m\].
const GARMENT: std::ops::RangeInclusive<f64> = 0.2..=2.5;

/// How far the scale of single edges (5th to 95th percentile) and of single panels may be from the
/// common one: beyond what gravity stretches or simulation compresses.
const SPREAD: f64 = 0.15;

/// Panels whose own scale differs by more are worth a note.
const NOTABLE: f64 = 0.03;

/// A scale this near to a unit is that unit.
const SNAP: f64 = 0.03;

/// Frame of the drape, and metres in one unit of the texture coordinates.
pub(super) fn find(
    document: &Document,
    islands: &Islands,
    options: &UvOptions,
    notes: &mut Vec<String>,
) -> Result<(FileFrame, f64), Vec<Problem>> {
    let points: Vec<Vec3> = islands
        .cloth
        .iter()
        .map(|v| document.positions[*v as usize])
        .collect();
    let frame = frame(&points, options, notes).map_err(|problem| vec![problem])?;
    let edges = |triangles: &Range<usize>| edges(document, islands, triangles);
    if let Some(scale) = options.uv_scale {
        if !(scale.is_finite() && scale > 0.0) {
            let text = format!("one unit of the texture coordinates cannot be {scale} m");
            return Err(vec![Problem::whole(text)]);
        }
        let measured = ratio(&edges(&(0..islands.triangles.len()))).median * frame.metres_per_unit;
        if (measured / scale - 1.0).abs() > NOTABLE {
            notes.push(format!(
                "texture scale as told: {scale} m per unit; the drape suggests {measured:.4}"
            ));
        }
        return Ok((frame, scale));
    }
    let all = edges(&(0..islands.triangles.len()));
    let common = ratio(&all);
    let panels: Vec<Ratio> = islands
        .panel_triangles
        .iter()
        .map(|r| ratio(&edges(r)))
        .collect();
    check_uniform(&all, &common, &panels, islands, notes)?;
    let measured = common.median * frame.metres_per_unit;
    // Coordinates packed into the unit square may span about a metre by chance.
    let packed = document
        .uvs
        .iter()
        .all(|uv| uv.min() >= 0.0 && uv.max() <= 1.0);
    let is_near = |unit: &f64| (measured / unit - 1.0).abs() < SNAP && !(packed && *unit == 1.0);
    let mut units = UNITS.iter().map(|(unit, _)| *unit);
    let scale = units.find(is_near).unwrap_or(measured);
    notes.push(format!("texture scale: {scale:.5} m per unit"));
    Ok((frame, scale))
}

/// Edges as the squares of (Δu, Δv) and the length in the drape.
fn edges(document: &Document, islands: &Islands, triangles: &Range<usize>) -> Vec<(Vec2, f64)> {
    let mut edges = Vec::new();
    for &[a, b, c] in &islands.triangles[triangles.clone()] {
        for ends in [[a, b], [b, c], [c, a]] {
            let [uv, uw] = ends.map(|v| document.uvs[islands.uvs[v as usize] as usize]);
            let [p, q] = ends.map(|v| {
                document.positions[islands.cloth[islands.sewing[v as usize] as usize] as usize]
            });
            let flat = uw - uv;
            edges.push((flat.component_mul(&flat), (q - p).norm()));
        }
    }
    edges
}

/// Units of the drape in one of the texture.
struct Ratio {
    low: f64,
    median: f64,
    high: f64,
}

/// 5th percentile, median and 95th percentile.
fn ratio(edges: &[(Vec2, f64)]) -> Ratio {
    let mut ratios: Vec<f64> = edges
        .iter()
        .filter(|(flat, _)| flat.sum() > 0.0)
        .map(|(flat, length)| length / flat.sum().sqrt())
        .collect();
    ratios.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| {
        let i = (share * ratios.len() as f64) as usize;
        ratios
            .get(i.min(ratios.len().saturating_sub(1)))
            .copied()
            .unwrap_or(0.0)
    };
    Ratio {
        low: at(0.05),
        median: at(0.5),
        high: at(0.95),
    }
}

fn check_uniform(
    edges: &[(Vec2, f64)],
    common: &Ratio,
    panels: &[Ratio],
    islands: &Islands,
    notes: &mut Vec<String>,
) -> Result<(), Vec<Problem>> {
    if common.median <= 0.0 {
        return Err(vec![Problem::whole("the drape has no extent")]);
    }
    let (low, high) = (
        common.low / common.median - 1.0,
        common.high / common.median - 1.0,
    );
    let per_unit = per_unit(edges);
    let skew = (per_unit.x / per_unit.y).max(per_unit.y / per_unit.x);
    let off: Vec<(&String, f64)> = islands
        .names
        .iter()
        .zip(
            panels
                .iter()
                .map(|panel| panel.median / common.median - 1.0),
        )
        .filter(|(_, off)| off.abs() > NOTABLE)
        .collect();
    let list: Vec<String> = off
        .iter()
        .map(|(name, off)| format!("`{name}` {:+.0} %", 100.0 * off))
        .collect();
    let far = off.iter().any(|(_, off)| off.abs() > SPREAD);
    if low < -SPREAD || high > SPREAD || far {
        let cause = if skew > 1.0 + SPREAD {
            format!(
                "the texture is stretched: a unit is {:.3} across and {:.3} up, in units of the \
                 drape",
                per_unit.x, per_unit.y
            )
        } else if far {
            format!("panels have scales of their own: {}", list.join(", "))
        } else {
            "the texture is distorted".into()
        };
        return Err(vec![Problem::whole(format!(
            "the texture coordinates are no pattern of one scale: 90 % of the edges are {:+.0} % to \
             {:+.0} % off the median ({cause}). Export the pattern as UVs without packing or \
             relaxing them, or say how many metres a unit is (uv scale)",
            100.0 * low,
            100.0 * high
        ))]);
    }
    if !list.is_empty() {
        notes.push(format!(
            "some panels are larger or smaller in the drape than in the texture, against the \
             median of all: {}",
            list.join(", ")
        ));
    }
    if skew > 1.0 + NOTABLE {
        notes.push(format!(
            "the drape is stretched {:.1} % more along one axis of the texture than the other",
            100.0 * (skew - 1.0)
        ));
    }
    Ok(())
}

/// Units of the drape in one of the texture along u and along v: the least-squares solution of
/// `s_u² Δu² + s_v² Δv² = length²`.
fn per_unit(edges: &[(Vec2, f64)]) -> Vec2 {
    let mut normal = Mat2::zeros();
    let mut right = Vec2::zeros();
    for (flat, length) in edges {
        normal += flat * flat.transpose();
        right += flat * (length * length);
    }
    let squares = normal
        .try_inverse()
        .map_or(Vec2::repeat(1.0), |inverse| inverse * right);
    squares.map(|s| s.max(f64::MIN_POSITIVE).sqrt())
}

/// Unit by the size of the garment, up axis by where it hangs above the floor.
fn frame(
    points: &[Vec3],
    options: &UvOptions,
    notes: &mut Vec<String>,
) -> Result<FileFrame, Problem> {
    let (low, high) = bounds(points);
    let up = options.up.unwrap_or_else(|| {
        // Garments hang about the axis of the body, well above its feet.
        let hangs_along_z = low.z > 0.0 && low.y < 0.0 && high.y > 0.0;
        if hangs_along_z { UpAxis::Z } else { UpAxis::Y }
    });
    let size = (high - low).max();
    let metres_per_unit = match options.metres_per_unit {
        Some(metres) if metres.is_finite() && metres > 0.0 => metres,
        Some(metres) => {
            let text = format!("one unit of the drape cannot be {metres} m");
            return Err(Problem::whole(text));
        }
        None => {
            let mut fitting = UNITS
                .iter()
                .filter(|(unit, _)| GARMENT.contains(&(size * unit)));
            let Some((metres, name)) = fitting.next() else {
                return Err(Problem::whole(format!(
                    "the drape is {size:.4} units large, which is no garment's size in m, dm, cm, \
                     mm or inches: say how many metres a unit is"
                )));
            };
            let others: Vec<&str> = fitting.map(|(_, name)| *name).collect();
            let others = if others.is_empty() {
                String::new()
            } else {
                format!("; {} would do too", others.join(" or "))
            };
            notes.push(format!(
                "unit of the drape: {name} (it is {:.2} m large){others}",
                size * metres
            ));
            *metres
        }
    };
    if up == UpAxis::Z && options.up.is_none() {
        notes.push("up axis of the drape: z, along which it hangs above the floor".into());
    }
    Ok(FileFrame {
        metres_per_unit,
        up,
    })
}
