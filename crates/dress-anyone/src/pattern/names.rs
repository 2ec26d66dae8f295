//! Panels and edges by the names that users give them.

use super::{EdgeId, Pattern};
use crate::problem::Problem;

/// Looks names up, and notes those that are not there.
pub(crate) struct Names<'a> {
    pattern: &'a Pattern,
    /// What was not there.
    pub(crate) problems: Vec<Problem>,
}

impl<'a> Names<'a> {
    /// Nothing looked up yet.
    pub(crate) fn new(pattern: &'a Pattern) -> Self {
        Self {
            pattern,
            problems: Vec::new(),
        }
    }

    /// The panel called `name`, which `place` asks for.
    pub(crate) fn panel(&mut self, name: &str, place: &str) -> Option<usize> {
        let found = self.pattern.panel_named(name);
        if found.is_none() {
            let names: Vec<String> = (self.pattern.panels.iter())
                .map(|panel| format!("`{}`", panel.name))
                .collect();
            self.problems.push(Problem::at(
                place,
                format!("there is no panel `{name}`; there are {}", names.join(", ")),
            ));
        }
        found
    }

    /// The edges behind "PANEL:EDGE", where EDGE is a number or a label, which `place` asks for.
    pub(crate) fn edges(&mut self, text: &str, place: &str) -> Vec<EdgeId> {
        let Some((panel, edge)) = text.rsplit_once(':') else {
            let text = format!("`{text}` must be a panel and an edge, as in `front:2`");
            self.problems.push(Problem::at(place, text));
            return Vec::new();
        };
        let Some(p) = self.panel(panel, place) else {
            return Vec::new();
        };
        let edges = &self.pattern.panels[p].edges;
        let numbered = edge.parse::<usize>().ok();
        let found: Vec<EdgeId> = (0..edges.len())
            .filter(|&e| numbered == Some(e) || edges[e].label.as_deref() == Some(edge))
            .map(|edge| EdgeId { panel: p, edge })
            .collect();
        if found.is_empty() {
            self.problems.push(Problem::at(
                format!("{place}, panel `{panel}`"),
                format!(
                    "there is no edge `{edge}`; edges are 0 to {}, or have one of the labels that \
                     `dress inspect` tells",
                    edges.len().saturating_sub(1)
                ),
            ));
        }
        found
    }
}
