//! One table of all loops: time, time per item, the multiple of the yardstick, and what that is on the
//! core that the aims were set for.

use crate::yardstick::REFERENCE_MS;
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
    let Some(yardstick) = least(&results.join(YARDSTICK)) else {
        return;
    };
    println!(
        "\nyardstick: {:.0} µs; {REFERENCE_MS} ms on the core of the aims",
        yardstick / 1e3
    );
    println!("vertices  loop                    ms    ns per item          × yardstick  ms there");
    for row in rows {
        let Some(time) = least(&results.join(&row.group).join(row.loop_name)) else {
            continue;
        };
        let time = time / row.runs as f64;
        println!(
            "{:>8}  {:<15} {:>10.3} {:>10.1} {:<10} {:>10.2} {:>10.2}",
            row.group,
            row.loop_name,
            time / 1e6,
            time / row.items as f64,
            row.unit,
            time / yardstick,
            time / yardstick * REFERENCE_MS,
        );
    }
}

/// Least time of one run of a loop \[ns\]: what other jobs disturbed least.
fn least(folder: &Path) -> Option<f64> {
    let text = std::fs::read_to_string(folder.join("new/sample.json")).ok()?;
    let sample: serde_json::Value = serde_json::from_str(&text).ok()?;
    let numbers = |name: &str| {
        Some(
            sample[name]
                .as_array()?
                .iter()
                .filter_map(serde_json::Value::as_f64),
        )
    };
    let each = numbers("times")?.zip(numbers("iters")?);
    each.map(|(time, runs)| time / runs).min_by(f64::total_cmp)
}
