//! Comments by which a written garment tells what OBJ cannot hold.
//!
//! ```text
//! # dress: uv in cm {"metres_per_unit":0.01,"up":"y"}
//! # dress: panel {"name":"front","offset":[0.2,-0.9],"corners":[1,12,…],"edges":[…],…}
//! # dress: stitches [[[0,1],[1,3],false],…]
//! ```
//!
//! Lengths in them are metres, corners are `vt` counted from 1, stitches name panel and edge
//! counted from 0. They are used only if they agree with the mesh in every point.

use super::border::Border;
use super::islands::Islands;
use crate::body::FileFrame;
use crate::garment::Garment;
use crate::geometry::{Mat3, Vec2, Vec3};
use crate::pattern::{Curve, Edge, EdgeId, Panel, Pattern, Placement, Stitch};
use serde::{Deserialize, Serialize};

/// What all tag lines start with.
pub(super) const MARK: &str = "dress: ";

/// No layout moves a panel by more than this \[m\].
const FARTHEST: f64 = 1e4;

/// All tags of a file.
pub(super) struct Tags {
    frame: FileFrame,
    panels: Vec<PanelTag>,
    stitches: Vec<StitchTag>,
}

/// Panel and edge of both sides, and whether right meets wrong.
pub(super) type StitchTag = ([usize; 2], [usize; 2], bool);

/// One panel.
#[derive(Serialize, Deserialize)]
pub(super) struct PanelTag {
    pub(super) name: String,
    pub(super) label: Option<String>,
    /// By how much the panel was moved in the layout \[m\].
    pub(super) offset: Vec2,
    pub(super) rotation: Mat3,
    pub(super) translation: Vec3,
    pub(super) corners: Vec<u32>,
    pub(super) edges: Vec<EdgeTag>,
}

/// One edge; `ends` are places in the panel's list of corners.
#[derive(Serialize, Deserialize)]
pub(super) struct EdgeTag {
    pub(super) ends: [usize; 2],
    pub(super) curve: CurveTag,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) label: Option<String>,
}

/// [`Curve`], in the panel's own coordinates \[m\].
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum CurveTag {
    Line,
    Quadratic(Vec2),
    Cubic([Vec2; 2]),
    Arc(f64, bool, bool),
}

/// The tags among a file's comments, if they are complete.
pub(super) fn parse(comments: &[String], notes: &mut Vec<String>) -> Option<Tags> {
    let lines = || {
        comments
            .iter()
            .filter_map(|comment| comment.strip_prefix(MARK))
    };
    lines().next()?;
    let read = || -> Option<Tags> {
        let of = |start: &'static str| lines().filter_map(move |line| line.strip_prefix(start));
        let unit = of("uv in ").next()?;
        let frame: FileFrame = serde_json::from_str(&unit[unit.find('{')?..]).ok()?;
        let panels = of("panel ").map(|json| serde_json::from_str(json).ok());
        let stitches = of("stitches ").next()?;
        let usable = frame.metres_per_unit.is_finite() && frame.metres_per_unit > 0.0;
        usable.then_some(Tags {
            frame,
            panels: panels.collect::<Option<_>>()?,
            stitches: serde_json::from_str(stitches).ok()?,
        })
    };
    let tags = read();
    if tags.is_none() {
        notes.push("the file's `# dress:` comments are damaged and were not used".into());
    }
    tags
}

/// What tags know better than the mesh.
struct Restored {
    pattern: Pattern,
    x_bar: Vec<Vec2>,
    edge_vertices: Vec<Vec<Vec<u32>>>,
}

impl Tags {
    /// Unit and axes of the drape; the texture has the same unit.
    pub(super) fn frame(&self) -> FileFrame {
        self.frame
    }

    /// Gives the garment its pattern back; false, and nothing changed, if mesh and tags disagree.
    pub(super) fn restore(
        self,
        islands: &Islands,
        border: &Border,
        garment: &mut Garment,
        notes: &mut Vec<String>,
    ) -> bool {
        let Some(restored) = self.pattern(islands, border, garment) else {
            notes.push(
                "the file's `# dress:` comments do not fit its mesh: the pattern was found anew"
                    .into(),
            );
            return false;
        };
        garment.pattern = restored.pattern;
        garment.mesh.x_bar = restored.x_bar;
        garment.mesh.edge_vertices = restored.edge_vertices;
        true
    }

    fn pattern(self, islands: &Islands, border: &Border, garment: &Garment) -> Option<Restored> {
        if self.panels.len() != islands.names.len() {
            return None;
        }
        let misplaced = |tag: &PanelTag| tag.offset.amax() > FARTHEST;
        if self.panels.iter().any(misplaced) {
            return None;
        }
        let mut x_bar = garment.mesh.x_bar.clone();
        let mut panels = Vec::new();
        let mut edge_vertices = Vec::new();
        for (k, tag) in self.panels.into_iter().enumerate() {
            for p in &mut x_bar[islands.panel_vertices[k].clone()] {
                *p -= tag.offset;
            }
            let corners = tag.vertices(islands, k)?;
            edge_vertices.push(tag.chains(&corners, border, k)?);
            let vertices = corners.iter().map(|v| x_bar[*v as usize]).collect();
            panels.push(tag.panel(vertices)?);
        }
        let stitch = |tag: &StitchTag| stitch(tag, &edge_vertices, islands);
        let stitches = self.stitches.iter().map(stitch).collect::<Option<_>>()?;
        Some(Restored {
            pattern: Pattern { panels, stitches },
            x_bar,
            edge_vertices,
        })
    }
}

impl PanelTag {
    /// Pattern vertices of the corners.
    fn vertices(&self, islands: &Islands, k: usize) -> Option<Vec<u32>> {
        let own = islands.panel_vertices[k].clone();
        // Pattern vertices of an island are in the order of their texture coordinates.
        let uvs = &islands.uvs[own.clone()];
        let vertex = |corner: &u32| {
            let vt = corner.checked_sub(1)?;
            let place = uvs.binary_search(&vt).ok()?;
            Some((own.start + place) as u32)
        };
        self.corners.iter().map(vertex).collect()
    }

    /// Pattern vertices along every edge; none unless the edges make one loop of the border.
    fn chains(&self, corners: &[u32], border: &Border, k: usize) -> Option<Vec<Vec<u32>>> {
        let next = self.edges.iter().cycle().skip(1);
        let mut sides = 0;
        let mut chains = Vec::new();
        for (edge, next) in self.edges.iter().zip(next) {
            let [from, to] = edge.ends;
            let chain = border.walk(*corners.get(from)?, *corners.get(to)?)?;
            sides += chain.len();
            chains.push(border.along(&chain));
            if next.ends[0] != to {
                return None;
            }
        }
        let whole = border.loops[k]
            .iter()
            .any(|sides_of| sides_of.len() == sides);
        whole.then_some(chains)
    }

    fn panel(self, vertices: Vec<Vec2>) -> Option<Panel> {
        let square = self.rotation.transpose() * self.rotation;
        let rigid = (square - Mat3::identity()).norm() < 1e-6 && self.rotation.determinant() > 0.0;
        let edge = |tag: EdgeTag| Edge {
            start: tag.ends[0],
            end: tag.ends[1],
            curve: tag.curve.into(),
            label: tag.label,
        };
        rigid.then(|| Panel {
            name: self.name,
            vertices,
            edges: self.edges.into_iter().map(edge).collect(),
            placement: Placement {
                rotation: self.rotation,
                translation: self.translation,
            },
            label: self.label,
        })
    }
}

/// The stitch, if its edges really are one line of cloth.
fn stitch(
    &(one, two, right_wrong): &StitchTag,
    edge_vertices: &[Vec<Vec<u32>>],
    islands: &Islands,
) -> Option<Stitch> {
    let cloth = |[panel, edge]: [usize; 2]| -> Option<Vec<u32>> {
        let chain = edge_vertices.get(panel)?.get(edge)?;
        Some(chain.iter().map(|v| islands.sewing[*v as usize]).collect())
    };
    let (a, mut b) = (cloth(one)?, cloth(two)?);
    if !right_wrong {
        b.reverse();
    }
    let id = |[panel, edge]: [usize; 2]| EdgeId { panel, edge };
    (a == b).then(|| Stitch {
        sides: [id(one), id(two)],
        right_wrong,
    })
}

impl From<CurveTag> for Curve {
    fn from(tag: CurveTag) -> Self {
        match tag {
            CurveTag::Line => Self::Line,
            CurveTag::Quadratic(c) => Self::Quadratic(c),
            CurveTag::Cubic(c) => Self::Cubic(c),
            CurveTag::Arc(radius, large, counter_clockwise) => Self::Arc {
                radius,
                large,
                counter_clockwise,
            },
        }
    }
}

impl From<Curve> for CurveTag {
    fn from(curve: Curve) -> Self {
        match curve {
            Curve::Line => Self::Line,
            Curve::Quadratic(c) => Self::Quadratic(c),
            Curve::Cubic(c) => Self::Cubic(c),
            Curve::Arc {
                radius,
                large,
                counter_clockwise,
            } => Self::Arc(radius, large, counter_clockwise),
        }
    }
}
