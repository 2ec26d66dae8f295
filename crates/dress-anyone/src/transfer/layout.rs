//! What of a garment counts for its target shape besides its drape: lines that stay smooth, the ease of
//! each zone, and parts that keep their size.

use super::TransferParams;
use super::ease::{Ease, EaseAt};
use super::relax::Stencil;
use crate::garment::Garment;
use crate::pattern::names::Names;
use crate::problem::Problem;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Panels with an ease of their own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Zone {
    /// Their names.
    pub panels: Vec<String>,
    /// What becomes of their distance to the body.
    pub ease: Ease,
}

/// How a cloth is made up.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// Triangles of the welded cloth, right side in front.
    pub triangles: Vec<[u32; 3]>,
    /// Cloth vertices along seams, darts and rims, each line once.
    pub lines: Vec<Vec<u32>>,
    /// `[cloth vertex]`.
    pub ease: Vec<EaseAt>,
    /// Mesh edges that keep their length.
    pub kept: Vec<[u32; 2]>,
}

/// Neighbours along a line, either way, in the stencil that keeps it smooth.
const LINE_REACH: usize = 3;

impl Layout {
    /// A cloth without lines, all with the same ease.
    pub fn plain(vertex_count: usize, triangles: Vec<[u32; 3]>, ease: Ease) -> Self {
        Self {
            triangles,
            lines: Vec::new(),
            ease: vec![ease.into(); vertex_count],
            kept: Vec::new(),
        }
    }

    /// Of a garment, with the zones and kept parts of `params`. All that they name must be there.
    pub fn of(garment: &Garment, params: &TransferParams) -> Result<Self, Vec<Problem>> {
        let mesh = &garment.mesh;
        let mut names = Names::new(&garment.pattern);
        let mut ease_of_panel = vec![EaseAt::from(params.ease); garment.pattern.panels.len()];
        for zone in &params.zones {
            for panel in &zone.panels {
                if let Some(p) = names.panel(panel, "transfer.zones") {
                    ease_of_panel[p] = zone.ease.into();
                }
            }
        }
        let mut kept = BTreeSet::new();
        let mut keep = |a: u32, b: u32| {
            let [a, b] = [a, b].map(|v| mesh.sewing[v as usize]);
            kept.insert([a.min(b), a.max(b)]);
        };
        for panel in &params.keep {
            if let Some(p) = names.panel(panel, "transfer.keep") {
                for &[a, b, c] in &mesh.triangles[mesh.panel_triangles[p].clone()] {
                    keep(a, b);
                    keep(b, c);
                    keep(c, a);
                }
            }
        }
        for edge in &params.keep_length {
            for id in names.edges(edge, "transfer.keep_length") {
                for pair in mesh.along(id).windows(2) {
                    keep(pair[0], pair[1]);
                }
            }
        }
        if !names.problems.is_empty() {
            return Err(names.problems);
        }
        kept.retain(|[a, b]| a != b);
        let mut at_vertex = vec![Vec::new(); mesh.cloth_vertex_count];
        for (p, vertices) in mesh.panel_vertices.iter().enumerate() {
            for v in vertices.clone() {
                at_vertex[mesh.sewing[v] as usize].push(ease_of_panel[p]);
            }
        }
        Ok(Self {
            triangles: mesh.outward_triangles(),
            lines: lines(garment),
            ease: at_vertex.iter().map(|all| EaseAt::mean(all)).collect(),
            kept: kept.into_iter().collect(),
        })
    }

    /// Stencils that keep the lines smooth.
    pub(super) fn line_stencils(&self) -> impl Iterator<Item = Stencil> {
        let along = |line: &Vec<u32>| -> Vec<Stencil> {
            let closed = line.len() > 3 && line.first() == line.last();
            let line = &line[..line.len() - usize::from(closed)];
            // Places as if the line came three times, so that a ring has no end and a line has.
            let at = |place: usize| -> Option<u32> {
                let inside = (line.len()..2 * line.len()).contains(&place);
                (closed || inside).then(|| line[place % line.len()])
            };
            let stencil = |i: usize| {
                let here = line.len() + i;
                let (first, last) = (here.saturating_sub(LINE_REACH), here + LINE_REACH);
                let others = (first..=last).filter(|place| *place != here);
                let around: Vec<u32> = others.filter_map(at).collect();
                let centre = line[i];
                let distinct = around.iter().all(|v| *v != centre);
                (around.len() > LINE_REACH && distinct).then_some(Stencil { centre, around })
            };
            (0..line.len()).filter_map(stencil).collect()
        };
        self.lines.iter().flat_map(along)
    }
}

/// The pattern's edges in cloth vertices; of two that are sewn together, one.
fn lines(garment: &Garment) -> Vec<Vec<u32>> {
    let mesh = &garment.mesh;
    let mut seen = BTreeSet::new();
    let edges = mesh.edge_vertices.iter().flatten();
    edges
        .map(|edge| -> Vec<u32> { edge.iter().map(|v| mesh.sewing[*v as usize]).collect() })
        .filter(|line| {
            let back: Vec<u32> = line.iter().rev().copied().collect();
            seen.insert(back.min(line.clone()))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{rectangle, stitch};
    use crate::pattern::{Pattern, triangulate};

    /// A front and a back, sewn along one side.
    fn garment() -> Garment {
        let mut pattern = Pattern {
            panels: vec![rectangle("front", 0.2, 0.3), rectangle("back", 0.2, 0.3)],
            stitches: vec![stitch((0, 1), (1, 3))],
        };
        pattern.panels[1].edges[0].label = Some("hem".to_owned());
        let mesh = triangulate::mesh(&pattern, 0.05).expect("rectangles can be meshed");
        Garment {
            name: "bib".to_owned(),
            pattern,
            mesh,
            drape: None,
        }
    }

    #[test]
    fn a_seam_is_one_line_and_has_the_mean_ease() {
        let params = TransferParams {
            ease: Ease::Absolute,
            zones: vec![Zone {
                panels: vec!["back".to_owned()],
                ease: Ease::Relative,
            }],
            ..TransferParams::default()
        };
        let garment = garment();
        let layout = Layout::of(&garment, &params).expect("all names are there");
        // Four edges each, one shared.
        assert_eq!(layout.lines.len(), 7);
        let at = |panel: usize, edge: usize, k: usize| {
            let v = garment.mesh.edge_vertices[panel][edge][k];
            layout.ease[garment.mesh.sewing[v as usize] as usize].fixed
        };
        assert_eq!([at(0, 3, 1), at(0, 1, 1), at(1, 1, 1)], [0.0, 0.5, 1.0]);
    }

    #[test]
    fn edges_are_kept_by_number_and_by_label() {
        let count = |names: &[&str], panels: &[&str]| {
            let owned = |names: &[&str]| names.iter().map(|s| (*s).to_owned()).collect();
            let params = TransferParams {
                keep: owned(panels),
                keep_length: owned(names),
                ..TransferParams::default()
            };
            Layout::of(&garment(), &params).map(|layout| layout.kept.len())
        };
        // 20 cm in pieces of 5 cm.
        assert_eq!(count(&["back:hem"], &[]), Ok(4));
        assert_eq!(count(&["back:0", "back:hem", "front:2"], &[]), Ok(8));
        assert!(count(&[], &["front"]).is_ok_and(|count| count > 30));
        let problems = count(&["back:7", "sleeve:0", "hem"], &["pocket"]).expect_err("wrong names");
        assert_eq!(problems.len(), 4);
    }

    #[test]
    fn a_line_knows_its_neighbours_and_a_ring_has_no_end() {
        let stencils = |line: Vec<u32>| {
            let mut layout = Layout::plain(10, Vec::new(), Ease::Auto);
            layout.lines.push(line);
            layout.line_stencils().map(|s| s.around).collect::<Vec<_>>()
        };
        let open = stencils(vec![0, 1, 2, 3, 4]);
        // The ends have three neighbours only.
        assert_eq!(open, [vec![0, 2, 3, 4], vec![0, 1, 3, 4], vec![0, 1, 2, 4]]);
        let ring = stencils(vec![0, 1, 2, 3, 4, 5, 6, 0]);
        assert_eq!(ring.len(), 7);
        assert_eq!(ring[0], [4, 5, 6, 1, 2, 3]);
    }
}
