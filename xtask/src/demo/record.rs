//! What a demo saw, what it says of it, and whether that is good enough.

use std::fmt;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};

use super::client::SessionView;

/// The loop's rate, ticks per second, and how far a run may be from it. The ticks themselves are counted against an
/// absolute clock; the margin is for asking twice over HTTP on a busy machine.
const RATE_HZ: f64 = 1000.0;
const RATE_MARGIN_HZ: f64 = 15.0;

/// One run: the first and the newest look at the session, and what happened in between.
pub(super) struct Record {
    first: Look,
    newest: Look,
    /// Sum of what was cut between looks, units. A fresh block in between takes nothing away from it.
    removed_units: u64,
    peak_force_n: f64,
    looks: u32,
    looks_without_operator: u32,
    /// The first thing that must never be.
    broken: Option<String>,
}

struct Look {
    at: Instant,
    session: SessionView,
}

impl Record {
    /// Begins with the session as it was before a handle joined, and as it is once one has.
    pub(super) fn begin(before: SessionView, at: Instant, first: SessionView) -> Self {
        let look = |session| Look { at, session };
        let mut record = Self {
            first: look(first.clone()),
            newest: look(before),
            removed_units: 0,
            peak_force_n: 0.0,
            looks: 0,
            looks_without_operator: 0,
            broken: None,
        };
        record.add(at, first);
        record
    }

    /// Takes one more look at the session.
    pub(super) fn add(&mut self, at: Instant, session: SessionView) {
        let clay = &session.clay;
        let known = self.newest.session.clay.removed_units;
        self.removed_units += clay.removed_units.saturating_sub(known);
        self.peak_force_n = self.peak_force_n.max(session.force_n());
        self.looks += 1;
        self.looks_without_operator += u32::from(!session.is_operated());
        // Exactly, not nearly: that is what the interface promises.
        let volume_m3 = clay.remaining_volume_m3 + clay.removed_volume_m3;
        if clay.initial_units != clay.remaining_units + clay.removed_units
            || clay.initial_volume_m3.total_cmp(&volume_m3).is_ne()
        {
            self.broken.get_or_insert(format!(
                "the volume balance of the clay does not hold: {clay:?}"
            ));
        }
        if session.state == "fault" {
            let reason = session.fault.as_deref().unwrap_or("no reason given");
            self.broken
                .get_or_insert(format!("the session went into fault: {reason}"));
        }
        self.newest = Look { at, session };
    }

    /// Fails with everything that is not as it must be.
    pub(super) fn judge(&self) -> Result<()> {
        let mut wrong = Vec::new();
        let rate = self.rate_hz();
        // Asked this way round, a rate that is not a number fails too.
        let keeps_its_rate = (rate - RATE_HZ).abs() <= RATE_MARGIN_HZ;
        if !keeps_its_rate {
            wrong.push(format!(
                "the loop ran at {rate:.1} ticks/s, not {RATE_HZ} ± {RATE_MARGIN_HZ}"
            ));
        }
        if self.removed_units == 0 {
            wrong.push("no clay was removed".to_owned());
        }
        if 0 < self.looks_without_operator {
            wrong.push(format!(
                "no handle was connected in {} of {} looks",
                self.looks_without_operator, self.looks
            ));
        }
        wrong.extend(self.broken.clone());
        if !wrong.is_empty() {
            bail!("the demo ran, but {}", wrong.join("; "));
        }
        Ok(())
    }

    fn time(&self) -> Duration {
        self.newest.at.saturating_duration_since(self.first.at)
    }

    fn rate_hz(&self) -> f64 {
        self.ticks() as f64 / self.time().as_secs_f64()
    }

    fn ticks(&self) -> u64 {
        let ticks = |look: &Look| look.session.control_loop.ticks;
        ticks(&self.newest).saturating_sub(ticks(&self.first))
    }

    fn late_ticks(&self) -> u64 {
        let late = |look: &Look| look.session.control_loop.late_ticks;
        late(&self.newest).saturating_sub(late(&self.first))
    }

    fn lost(&self) -> u64 {
        let lost = |look: &Look| look.session.control_loop.lost;
        lost(&self.newest).saturating_sub(lost(&self.first))
    }

    /// Volume of what was cut, m³, from the balance of the newest look.
    fn removed_m3(&self) -> f64 {
        let clay = &self.newest.session.clay;
        self.removed_units as f64 * clay.initial_volume_m3 / clay.initial_units as f64
    }
}

impl fmt::Display for Record {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Look { session, .. } = &self.newest;
        let (clay, control_loop) = (&session.clay, &session.control_loop);
        let mut line = |name: &str, text: String| writeln!(f, "  {name:<12} {text}");
        line(
            "loop",
            format!(
                "{:.1} ticks/s over {:.1} s, {} late, {:.1} µs p50 and {:.1} µs p99 a tick",
                self.rate_hz(),
                self.time().as_secs_f64(),
                self.late_ticks(),
                control_loop.tick_s.p50 * 1e6,
                control_loop.tick_s.p99 * 1e6
            ),
        )?;
        line(
            "round trip",
            format!(
                "{:.2} ms p50, {:.2} ms p99, {} frames lost",
                control_loop.rtt_s.p50 * 1e3,
                control_loop.rtt_s.p99 * 1e3,
                self.lost()
            ),
        )?;
        line(
            "clay",
            format!(
                "{:.2} cm³ cut; {:.2} of {:.2} cm³ left",
                self.removed_m3() * 1e6,
                clay.remaining_volume_m3 * 1e6,
                clay.initial_volume_m3 * 1e6
            ),
        )?;
        line(
            "force",
            format!(
                "{:.2} N on the tool now, {:.2} N at most, scheme {}",
                session.force_n(),
                self.peak_force_n,
                session.scheme
            ),
        )?;
        line("scheduler", control_loop.scheduler.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session(ticks: u64, removed_units: u64) -> SessionView {
        let text = format!(
            r#"{{"id": "demo", "state": "running", "fault": null, "scheme": "replica",
                "clay": {{"initial_volume_m3": 1e-3, "remaining_volume_m3": 7.5e-4, "removed_volume_m3": 2.5e-4,
                          "initial_units": 1000, "remaining_units": {}, "removed_units": {removed_units}}},
                "tools": [{{"connected": true, "force_n": [3.0, 4.0, 0.0]}}],
                "loop": {{"ticks": {ticks}, "late_ticks": 2, "tick_s": {{"p50": 3e-6, "p99": 9e-6}},
                          "rtt_s": {{"p50": 4e-4, "p99": 9e-4}}, "lost": 0, "scheduler": "as it comes"}}}}"#,
            1000 - removed_units
        );
        serde_json::from_str(&text).unwrap()
    }

    /// Ten seconds with `ticks` ticks, at the end of which `last` was seen.
    fn run_of_ten_seconds(ticks: u64, last: impl FnOnce(&mut SessionView)) -> Record {
        let begin = Instant::now();
        let mut record = Record::begin(session(0, 0), begin, session(500, 0));
        let mut end = session(500 + ticks, 10);
        last(&mut end);
        record.add(begin + Duration::from_secs(10), end);
        record
    }

    fn complaint(record: &Record) -> String {
        record.judge().unwrap_err().to_string()
    }

    #[test]
    fn a_good_run_passes_at_both_ends_of_the_margin() {
        for ticks in [9_850, 10_000, 10_150] {
            run_of_ten_seconds(ticks, |_| {}).judge().unwrap();
        }
    }

    #[test]
    fn a_loop_off_its_rate_fails() {
        for ticks in [0, 9_849, 10_151] {
            assert!(complaint(&run_of_ten_seconds(ticks, |_| {})).contains("ticks/s"));
        }
    }

    #[test]
    fn a_run_that_cuts_nothing_fails() {
        let record = run_of_ten_seconds(10_000, |end| *end = session(10_500, 0));
        assert!(complaint(&record).contains("no clay was removed"));
    }

    #[test]
    fn a_fresh_block_in_between_takes_nothing_away() {
        let mut record = run_of_ten_seconds(10_000, |_| {});
        record.add(record.newest.at, session(10_500, 0));
        record.add(record.newest.at, session(10_500, 7));
        assert_eq!(record.removed_units, 17);
    }

    #[test]
    fn a_handle_that_left_fails() {
        let record = run_of_ten_seconds(10_000, |end| end.tools[0].connected = false);
        assert!(complaint(&record).contains("no handle was connected in 1 of 2"));
    }

    #[test]
    fn a_fault_and_volume_out_of_balance_fail_with_their_reason() {
        let record = run_of_ten_seconds(10_000, |end| {
            end.state = "fault".to_owned();
            end.fault = Some("position is not finite".to_owned());
        });
        assert!(complaint(&record).contains("position is not finite"));
        let record = run_of_ten_seconds(10_000, |end| end.clay.remaining_units -= 1);
        assert!(complaint(&record).contains("does not hold"));
        let record = run_of_ten_seconds(10_000, |end| end.clay.remaining_volume_m3 += 1e-18);
        assert!(complaint(&record).contains("does not hold"));
    }

    #[test]
    fn the_summary_is_in_the_units_it_names() {
        let text = run_of_ten_seconds(10_000, |_| {}).to_string();
        for part in [
            "1000.0 ticks/s",
            "3.0 µs p50",
            "0.40 ms p50",
            "10.00 cm³ cut",
            "5.00 N",
            "as it comes",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
    }
}
