//! Where a body leaves room for panels that wait around it: what is placed through the body waits farther
//! out, skirts that reach over the arms hang below them, and tops are narrowed to pass between them.

use crate::body::Body;
use crate::garment::Garment;
use crate::geometry::{Vec3, intersections};
use crate::pattern::Panel;

/// Farthest that a panel is moved out of the body, and steps in which that is tried \[m\].
const FARTHEST: f64 = 0.1;
const STEP: f64 = 0.01;

/// Moves every panel that is placed through `body` along its normal, the shorter way out.
pub(super) fn out_of(body: &Body, garment: &mut Garment) {
    let mesh = &garment.mesh;
    for (panel, (vertices, triangles)) in garment
        .pattern
        .panels
        .iter_mut()
        .zip((mesh.panel_vertices.iter()).zip(&mesh.panel_triangles))
    {
        let placed: Vec<Vec3> = (vertices.clone())
            .map(|v| panel.placement.place(mesh.x_bar[v]))
            .collect();
        let triangles: Vec<[u32; 3]> = (mesh.triangles[triangles.clone()].iter())
            .map(|t| t.map(|v| v - vertices.start as u32))
            .collect();
        let meets = |by: Vec3| {
            let moved: Vec<Vec3> = placed.iter().map(|p| p + by).collect();
            !intersections::between(
                &moved,
                &triangles,
                &body.mesh.positions,
                &body.mesh.triangles,
            )
            .is_empty()
        };
        if !meets(Vec3::zeros()) {
            continue;
        }
        let normal = panel.placement.rotation.column(2).into_owned();
        let tries = (1..).map(|n| f64::from(n) * STEP);
        let ways = tries
            .take_while(|by| *by <= FARTHEST)
            .flat_map(|by| [by, -by]);
        if let Some(by) = ways.map(|by| normal * by).find(|by| !meets(*by)) {
            panel.placement.translation += by + by.normalize() * STEP;
        }
    }
}

/// What files call the part of the body that skirts and trousers go on, and tops.
const LEG: &str = "leg";
const BODY: &str = "body";
/// Distance of the levels at which arms are looked for, and the least gap between them and the trunk \[m\].
const LEVEL: f64 = 0.02;
const GAP: f64 = 0.04;
/// Room that is left between skirts and arms \[m\].
const ROOM: f64 = 0.03;
/// What is no farther from the middle counts as the middle of a waist \[m\].
const MIDDLE: f64 = 0.1;
/// Parts of the angle from straight down that are tried, so many of them.
const TRIES: usize = 20;
/// The most by which narrowing fades from a level to the next: in 20 cm at most.
const FADE: f64 = 0.1;

/// A motion that lets skirts hang: about the middle of their waist, all is turned down by the same part of
/// its angle.
#[derive(Clone, Copy)]
pub(super) struct Hanging {
    waist: Vec3,
    part: f64,
}

impl Hanging {
    /// The least turn that keeps skirts from reaching over `arms`.
    pub(super) fn below_arms(arms: &Arms, garment: &Garment) -> Self {
        let mesh = &garment.mesh;
        let panels = garment.pattern.panels.iter().zip(&mesh.panel_vertices);
        let points: Vec<Vec3> = panels
            .filter(|(panel, _)| is_for(LEG, panel))
            .flat_map(|(panel, vertices)| {
                vertices
                    .clone()
                    .map(|v| panel.placement.place(mesh.x_bar[v]))
            })
            .collect();
        let middle = |p: &&Vec3| (p.x - arms.middle).abs() < MIDDLE;
        let waist = (points.iter().filter(middle))
            .map(|p| p.y)
            .fold(f64::NEG_INFINITY, f64::max);
        let mut hanging = Self {
            waist: Vec3::new(arms.middle, waist, 0.0),
            part: 1.0,
        };
        let reaches_over = |part: f64| {
            let hanging = Self { part, ..hanging };
            points.iter().any(|p| arms.are_within(hanging.turned(*p)))
        };
        let mut parts = (1..=TRIES).rev().map(|n| n as f64 / TRIES as f64);
        if waist.is_finite() {
            // Where arms hang so close that nothing helps, it stays as it is.
            hanging.part = parts.find(|part| !reaches_over(*part)).unwrap_or(1.0);
        }
        hanging
    }

    /// Where the point `p` of a panel starts \[m\].
    pub(super) fn start(&self, panel: &Panel, p: Vec3) -> Vec3 {
        if self.part < 1.0 && is_for(LEG, panel) {
            self.turned(p)
        } else {
            p
        }
    }

    fn turned(&self, p: Vec3) -> Vec3 {
        let d = p - self.waist;
        let (angle, radius) = (d.x.atan2(-d.y), d.x.hypot(d.y));
        let angle = angle * self.part;
        Vec3::new(
            self.waist.x + radius * angle.sin(),
            self.waist.y - radius * angle.cos(),
            p.z,
        )
    }
}

fn is_for(part: &str, panel: &Panel) -> bool {
    panel.label.as_deref() == Some(part)
}

/// A motion that lets tops pass between arms: level by level, all is narrowed by the same part. Side seams
/// that start beyond an arm would close around it, and hang on it.
pub(super) struct Narrowing {
    middle: f64,
    floor: f64,
    /// `[left of the middle, right of it][level]`; 1 keeps the width.
    parts: [Vec<f64>; 2],
}

impl Narrowing {
    /// The least that keeps tops from reaching into `arms`.
    pub(super) fn between_arms(arms: &Arms, garment: &Garment) -> Self {
        let (mesh, panels) = (&garment.mesh, &garment.pattern.panels);
        let mut parts = [0, 1].map(|_| vec![1.0_f64; arms.inner.len()]);
        for (panel, vertices) in panels.iter().zip(&mesh.panel_vertices) {
            if !is_for(BODY, panel) {
                continue;
            }
            for v in vertices.clone() {
                let p = panel.placement.place(mesh.x_bar[v]);
                let x = p.x - arms.middle;
                if arms.are_within(p) {
                    let level = arms.level(p.y);
                    let part = (arms.inner[level] - ROOM) / x.abs();
                    // It is taken between the middles of levels.
                    for near in level.saturating_sub(1)..=level + 1 {
                        if let Some(least) = parts[usize::from(x > 0.0)].get_mut(near) {
                            *least = least.min(part);
                        }
                    }
                }
            }
        }
        for parts in &mut parts {
            for level in 1..parts.len() {
                parts[level] = parts[level].min(parts[level - 1] + FADE);
            }
            for level in (1..parts.len()).rev() {
                parts[level - 1] = parts[level - 1].min(parts[level] + FADE);
            }
        }
        Self {
            middle: arms.middle,
            floor: arms.floor,
            parts,
        }
    }

    /// Where the point `p` of a panel starts \[m\].
    pub(super) fn start(&self, panel: &Panel, p: Vec3) -> Vec3 {
        if !is_for(BODY, panel) {
            return p;
        }
        let x = p.x - self.middle;
        let parts = &self.parts[usize::from(x > 0.0)];
        // A level's part holds in its middle.
        let at = ((p.y - self.floor) / LEVEL - 0.5).clamp(0.0, parts.len() as f64 - 1.0);
        let (below, between) = (at as usize, at.fract());
        let above = (below + 1).min(parts.len() - 1);
        let part = parts[below] + (parts[above] - parts[below]) * between;
        if part < 1.0 {
            Vec3::new(self.middle + x * part, p.y, p.z)
        } else {
            p
        }
    }
}

/// Where the arms of a body hang beside its trunk.
pub(super) struct Arms {
    /// Between left and right \[m\].
    middle: f64,
    floor: f64,
    /// How far from the middle they begin \[m\], `[level]`; infinite where there are none.
    inner: Vec<f64>,
}

impl Arms {
    pub(super) fn of(body: &Body) -> Self {
        let mesh = &body.mesh;
        let (low, high) = mesh.bounds();
        let middle = 0.5 * (low.x + high.x);
        let level = |y: f64| ((y - low.y) / LEVEL) as usize;
        // What each level's section covers, triangle by triangle, from the middle outwards.
        let mut across: Vec<Vec<[f64; 2]>> = vec![Vec::new(); level(high.y) + 1];
        for t in 0..mesh.triangles.len() {
            let corners = mesh.corners(t);
            let heights = corners.map(|p| p.y);
            let (below, above) = (
                heights.into_iter().fold(f64::INFINITY, f64::min),
                heights.into_iter().fold(f64::NEG_INFINITY, f64::max),
            );
            for n in level(below) + 1..=level(above) {
                let y = low.y + n as f64 * LEVEL;
                let cut = (0..3).filter_map(|k| {
                    let (p, q) = (corners[k], corners[(k + 1) % 3]);
                    let part = (y - p.y) / (q.y - p.y);
                    (0.0..=1.0)
                        .contains(&part)
                        .then(|| p.x + part * (q.x - p.x) - middle)
                });
                let ends = cut.fold([f64::INFINITY, 0.0_f64], |[from, to], x| {
                    [from.min(x.abs()), to.max(x.abs())]
                });
                across[n].push(ends);
            }
        }
        let inner = |mut across: Vec<[f64; 2]>| {
            across.sort_by(|a, b| a[0].total_cmp(&b[0]));
            let mut covered = f64::INFINITY;
            for [from, to] in across {
                if from > covered + GAP {
                    return from;
                }
                covered = if covered.is_finite() {
                    covered.max(to)
                } else {
                    to
                };
            }
            f64::INFINITY
        };
        Self {
            middle,
            floor: low.y,
            inner: across.into_iter().map(inner).collect(),
        }
    }

    /// Whether an arm is nearer to the trunk than `p`, or hardly farther.
    fn are_within(&self, p: Vec3) -> bool {
        let inner = (p.y >= self.floor)
            .then(|| self.inner.get(self.level(p.y)))
            .flatten();
        inner.is_some_and(|inner| (p.x - self.middle).abs() > inner - ROOM)
    }

    /// The level of a height at or above the floor.
    fn level(&self, y: f64) -> usize {
        ((y - self.floor) / LEVEL) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::super::placed::fixtures::tube;
    use super::*;
    use crate::body::FileFrame;
    use crate::fixture::add_box;
    use crate::geometry::TriangleMesh;
    use approx::assert_relative_eq;

    fn body(boxes: &[[[f64; 3]; 2]]) -> Body {
        let mut mesh = TriangleMesh::default();
        for [low, high] in boxes {
            add_box(&mut mesh, *low, *high);
        }
        Body {
            name: "boxes".to_owned(),
            mesh,
            frame: FileFrame::SI,
            notes: Vec::new(),
        }
    }

    #[test]
    fn a_panel_placed_through_the_body_waits_in_front_of_it() {
        let mut garment = tube();
        let before = garment.pattern.panels.clone();
        let at = before[0].placement.translation.z;
        // A pillar whose front is 3.5 cm in front of the first panel, and whose back is far behind it.
        let pillar = body(&[[[-0.05, -1.0, at - 0.3], [0.05, 1.0, at + 0.035]]]);
        out_of(&pillar, &mut garment);
        let after = garment.pattern.panels[0].placement.translation;
        // The first whole centimetre that is clear, and one more.
        assert_relative_eq!(after.z, at + 0.05, epsilon = 1e-12);
        assert_eq!(after.xy(), before[0].placement.translation.xy());
    }

    /// A trunk, and an arm 40 cm beside its middle that hangs to half its height.
    fn arms() -> Arms {
        let trunk = [[-0.15, -1.0, -0.1], [0.15, 1.0, 0.1]];
        let arm = |side: f64| {
            let x = [side * 0.4, side * 0.5];
            [[x[0].min(x[1]), 0.0, -0.05], [x[0].max(x[1]), 0.9, 0.05]]
        };
        Arms::of(&body(&[trunk, arm(-1.0), arm(1.0)]))
    }

    #[test]
    fn a_top_passes_between_the_arms_and_what_is_not_for_the_body_stays() {
        let arms = arms();
        let mut garment = tube();
        for p in &mut garment.mesh.x_bar {
            p.x = 4.0 * (p.x - 0.16);
        }
        let beyond = |garment: &Garment| {
            let narrowing = Narrowing::between_arms(&arms, garment);
            let (x, _) = garment.moved(|panel, p| narrowing.start(panel, p));
            // Where it begins, arms are 40 cm from the middle.
            let over = |p: &&Vec3| p.y > 0.1 && p.x.abs() > 0.4;
            x.iter().filter(over).count()
        };
        let without = beyond(&garment);
        for panel in &mut garment.pattern.panels {
            panel.label = Some(BODY.to_owned());
        }
        let with = beyond(&garment);
        assert!(without > 0 && with == 0, "{without} {with}");
        // Above the arms it keeps its width.
        let narrowing = Narrowing::between_arms(&arms, &garment);
        let above = Vec3::new(0.6, 1.2, 0.0);
        assert_eq!(narrowing.start(&garment.pattern.panels[0], above), above);
    }

    #[test]
    fn a_skirt_over_the_arms_is_turned_down_below_them_and_what_is_not_for_legs_stays() {
        let arms = arms();
        let beside = |x: f64, y: f64| arms.are_within(Vec3::new(x, y, 0.0));
        assert!(beside(0.45, 0.5) && beside(-0.45, 0.5));
        assert!(!beside(0.3, 0.5) && !beside(0.45, -0.5));

        let mut garment = tube();
        for panel in &mut garment.pattern.panels {
            panel.label = Some(LEG.to_owned());
        }
        let reach = |garment: &Garment| {
            let hanging = Hanging::below_arms(&arms, garment);
            let (x, _) = garment.moved(|panel, p| hanging.start(panel, p));
            (
                hanging.part,
                x.iter().filter(|p| arms.are_within(**p)).count(),
            )
        };
        // As narrow as the fixture is it reaches over nothing.
        assert_eq!(reach(&garment), (1.0, 0));
        for p in &mut garment.mesh.x_bar {
            p.x = 3.0 * (p.x - 0.16);
        }
        let (part, over) = reach(&garment);
        assert!(part < 1.0 && over == 0, "{part} {over}");
        for panel in &mut garment.pattern.panels {
            panel.label = None;
        }
        assert_eq!(reach(&garment).0, 1.0);
    }
}
