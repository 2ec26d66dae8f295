//! One table of all loops: time, time per item, and the multiple of the yardstick.

use std::path::Path;

/// The yardstick's name.
pub(crate) const YARDSTICK: &str = "yardstick";

/// A loop that was measured.
pub(crate) struct Row {
    pub(crate) group: String,
    pub(crate) loop_name: &'static str,
    /// Runs of the loop in what was measured.
    pub(crate) runs: usize,
    /// Of what `unit` names, per run of the loop.
    pub(crate) items: usize,
    pub(crate) unit: &'static str,
}

/// Prints what was measured in this or an earlier run; nothing without a yardstick.
pub(crate) fn print(results: &Path, rows: &[Row]) {
    let Some(yardstick) = median(&results.join(YARDSTICK)) else {
        return;
    };
    println!("\nyardstick: {:.0} µs", yardstick / 1e3);
    println!("vertices  loop                    ms    ns per item          × yardstick");
    for row in rows {
        let Some(time) = median(&results.join(&row.group).join(row.loop_name)) else {
            continue;
        };
        let time = time / row.runs as f64;
        println!(
            "{:>8}  {:<15} {:>10.3} {:>10.1} {:<10} {:>10.2}",
            row.group,
            row.loop_name,
            time / 1e6,
            time / row.items as f64,
            row.unit,
            time / yardstick,
        );
    }
}

/// Median time of one run of a loop \[ns\].
fn median(folder: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(folder.join("new/estimates.json")).ok()?;
    let estimates: serde_json::Value = serde_json::from_str(&text).ok()?;
    estimates["median"]["point_estimate"].as_f64()
}
