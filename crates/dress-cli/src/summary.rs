//! A refit in a few lines that a designer understands.

use dress_anyone::report::{DrapeReport, Ending, PanelReport, Report, SeamReport};
use dress_anyone::sim::equilibrium::RestStatus;
use std::fmt::Write;
use std::path::Path;

/// The summary of a refit whose files are in `out`.
pub fn of(report: &Report, out: &Path) -> String {
    let [garment, source, target] = &report.names;
    let seconds: f64 = report.stages.iter().map(|stage| stage.seconds).sum();
    let mut lines = format!(
        "{garment}: refitted from {source} to {target} in {seconds:.0} s; {}\n",
        ending(report.ending)
    );
    let mut line = |text: String| lines.push_str(&(text + "\n"));
    if let (Some(first), Some(last)) = (report.iterations.first(), report.iterations.last()) {
        line(format!(
            "  shape loss       {:.3} -> {:.3} in {} steps ({} drapes)",
            first.shape_matching, last.shape_matching, last.iteration, last.drapes
        ));
    }
    let [mean, most] = report.distance_to_target.map(|metres| 1e3 * metres);
    line(format!(
        "  off the target   {mean:.1} mm on average, {most:.0} mm at most"
    ));
    line(format!(
        "  drape            {}",
        rest(report.final_drape.status)
    ));
    lines.push_str(&penetration(&report.final_drape));
    lines.push_str(&seams(&report.seams));
    let _ = writeln!(
        lines,
        "  mesh quality     worst triangle {:.2} (before: {:.2}), {} flipped",
        report.quality_after.quality.min,
        report.quality_before.quality.min,
        report.quality_after.flipped
    );
    lines.push_str(&panels(&report.panels));
    let _ = writeln!(lines, "Written to {}", out.display());
    lines
}

/// How a search ended, in words.
pub fn ending(ending: Ending) -> &'static str {
    match ending {
        Ending::SmallChange => "converged: the loss hardly fell any more",
        Ending::ShortStep => "converged: the pattern hardly changed any more",
        Ending::Flat => "converged: the loss is level",
        Ending::NoBetterStep => "stalled: no further step was better, though the slope promised it",
        Ending::IterationLimit => "not finished: the largest number of steps was taken",
        Ending::Interrupted => "stopped early: this is the best so far",
    }
}

/// How a drape ended, in words.
pub fn rest(status: RestStatus) -> &'static str {
    match status {
        RestStatus::AtRest => "at rest",
        RestStatus::IterationLimit => "nearly at rest (the iterations ran out)",
        RestStatus::Stalled => "nearly at rest (no step improved it)",
        RestStatus::Sliding => "sliding: nothing holds it",
        RestStatus::NotFinite => "broken",
        RestStatus::Stopped => "stopped",
    }
}

/// Whether cloth is inside the body, or passes through the body or itself.
pub fn penetration(drape: &DrapeReport) -> String {
    let inside = if drape.vertices_inside == 0 {
        "none".to_owned()
    } else {
        format!(
            "{:.1} mm at most, {} points inside the body",
            1e3 * drape.deepest_penetration,
            drape.vertices_inside
        )
    };
    let through = if drape.through_body + drape.through_itself == 0 {
        "none".to_owned()
    } else {
        format!(
            "{} pairs of triangles of cloth and body, {} of cloth and cloth",
            drape.through_body, drape.through_itself
        )
    };
    format!("  penetration      {inside}\n  intersections    {through}\n")
}

/// The seam whose two sides changed most unlike each other.
fn seams(seams: &[SeamReport]) -> String {
    let size = |seam: &&SeamReport| seam.ratio_change.abs();
    let worst = seams.iter().max_by(|a, b| size(a).total_cmp(&size(b)));
    let Some(worst) = worst else {
        return String::new();
    };
    let [a, b] = worst.after.map(|metres| 100.0 * metres);
    format!(
        "  seams            sides differ by {:.2} % at most from the design ({} and {}: {a:.1} \
         and {b:.1} cm)\n",
        100.0 * size(&worst),
        worst.sides[0],
        worst.sides[1]
    )
}

/// One line per panel: its area and the lengths around it.
fn panels(panels: &[PanelReport]) -> String {
    let width = panels.iter().map(|p| p.panel.chars().count()).max();
    let width = width.unwrap_or(0).max("panel".len());
    let mut text = format!(
        "  {:width$}  {:>26}  {:>26}\n",
        "panel", "area [cm2]", "outline [cm]"
    );
    for panel in panels {
        let length = |edges: &[f64]| 100.0 * edges.iter().sum::<f64>();
        let area = change(1e4 * panel.area_before, 1e4 * panel.area_after, 0);
        let outline = change(length(&panel.edges_before), length(&panel.edges_after), 1);
        let _ = writeln!(text, "  {:width$}  {area:>26}  {outline:>26}", panel.panel);
    }
    text
}

/// "123 -> 150 (+22 %)".
fn change(before: f64, after: f64, decimals: usize) -> String {
    let percent = 100.0 * (after / before - 1.0);
    format!("{before:.decimals$} -> {after:.decimals$} ({percent:+.1} %)")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_told_in_percent() {
        assert_eq!(change(100.0, 122.04, 0), "100 -> 122 (+22.0 %)");
        assert_eq!(change(80.0, 60.0, 1), "80.0 -> 60.0 (-25.0 %)");
    }

    #[test]
    fn the_worst_seam_is_the_one_told() {
        let seam = |name: &str, ratio_change| SeamReport {
            sides: [name.to_owned(), "back:1".to_owned()],
            before: [0.2, 0.2],
            after: [0.25, 0.24],
            ratio_change,
        };
        let text = seams(&[seam("front:0", 0.001), seam("front:1", -0.02)]);
        assert!(
            text.contains("2.00 %") && text.contains("front:1 and back:1"),
            "{text}"
        );
        assert_eq!(seams(&[]), "");
    }
}
