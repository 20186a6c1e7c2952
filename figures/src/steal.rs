//! Processor time that the hypervisor gave to others: above one per cent the tails of a run are not the program's.

/// Stolen and total jiffies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jiffies {
    stolen: f64,
    total: f64,
}

/// Now; zeros where the system does not tell.
pub(crate) fn read() -> Jiffies {
    let text = std::fs::read_to_string("/proc/stat").unwrap_or_default();
    let numbers: Vec<f64> = text
        .lines()
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .skip(1)
        .filter_map(|word| word.parse().ok())
        .collect();
    // user nice system idle iowait irq softirq steal; guest time is in user already.
    Jiffies {
        stolen: numbers.get(7).copied().unwrap_or(0.0),
        total: numbers.iter().take(8).sum(),
    }
}

/// Share of processor time stolen since `before`.
pub(crate) fn share_since(before: Jiffies) -> f64 {
    let now = read();
    (now.stolen - before.stolen) / (now.total - before.total).max(1.0)
}
