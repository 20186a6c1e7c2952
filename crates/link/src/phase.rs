//! When a tick is due, so that what it works on has waited little for it.
//!
//! Two threads that tick at the same rate, each by its own clock, meet at a phase that chance gave them: a frame waits
//! for the other side's tick half a period on average, and as the clocks drift, every wait comes by. [`PhaseLock`]
//! moves the deadlines of one of the two, slowly, until frames come shortly before them. Only the tool side has one. A
//! handle keeps the time of its device, so there is one master, and nothing to oscillate.
//!
//! With several tools, each of whose handles has a phase of its own, the deadline follows the one of them for which the
//! sum of all waits is least. Tools whose frames scatter by more than an eighth of a period are followed by nobody:
//! their waits are chance at any phase.

/// How far a deadline moves in a tick at most, as a share of the period: the rate stays within this of its own.
pub const MOST_SHIFT: f64 = 5e-4;
/// A frame is to come this long before its tick, and three times its scatter in addition, ns.
const LEAST_WAIT_NS: f64 = 50e3;
const SCATTERS: f64 = 3.0;
/// Scatter beyond which a source is not followed, as a share of the period.
const MOST_SCATTER: f64 = 0.125;
/// Waits that an estimate looks back on.
const MEMORY: f64 = 32.0;
/// Frames after which an estimate counts.
const LEARNT_AFTER: u32 = 64;
/// Ticks without a frame after which a source is forgotten.
const FORGOTTEN_AFTER: u32 = 200;
/// Share of what is left of the way that a tick moves, where the bound does not hold it back.
const GAIN: f64 = 1.0 / 64.0;
/// Another source is followed instead when that spares this much of the sum of all waits, as a share of the period.
const WORTH_A_MOVE: f64 = 0.05;

/// Moves the deadlines of a tick towards the arrivals of what it works on.
///
/// Each tick: [`PhaseLock::on_frame`] for the newest frame of each source, then [`PhaseLock::shift_ns`] once.
#[derive(Clone, Debug)]
pub struct PhaseLock {
    period_ns: f64,
    sources: Vec<Source>,
    /// Which source is followed.
    followed: Option<u64>,
    /// The source that is compared with it in this tick.
    candidate: usize,
}

/// One tool's frames.
#[derive(Clone, Copy, Debug)]
struct Source {
    key: u64,
    /// Mean wait for the tick, 0 to a period.
    wait_ns: f64,
    /// Mean distance from it.
    scatter_ns: f64,
    frames: u32,
    silent_ticks: u32,
}

impl PhaseLock {
    /// For ticks this far apart, ns, and at most so many sources; further ones are not heard. Allocates only here.
    #[must_use]
    pub fn new(period_ns: u64, sources: usize) -> Self {
        Self {
            period_ns: period_ns as f64,
            sources: Vec::with_capacity(sources),
            followed: None,
            candidate: 0,
        }
    }

    /// The newest frame of a source waited this long for the tick that takes it.
    pub fn on_frame(&mut self, key: u64, waited_ns: u64) {
        let period_ns = self.period_ns;
        // One that waited longer than a period came while ticks were late; it tells nothing.
        if period_ns < waited_ns as f64 {
            return;
        }
        let known = self.sources.iter_mut().find(|source| source.key == key);
        if let Some(source) = known {
            source.on_frame(waited_ns as f64, period_ns);
        } else if self.sources.len() < self.sources.capacity() {
            self.sources.push(Source {
                key,
                wait_ns: waited_ns as f64,
                scatter_ns: period_ns,
                frames: 1,
                silent_ticks: 0,
            });
        }
    }

    /// By how much the next deadline is later than a period after this one, ns; negative for sooner. At most
    /// [`MOST_SHIFT`] of the period either way.
    pub fn shift_ns(&mut self) -> i64 {
        for source in &mut self.sources {
            source.silent_ticks += 1;
        }
        self.sources
            .retain(|source| source.silent_ticks <= FORGOTTEN_AFTER);
        let Some(left_ns) = self.way_left_ns() else {
            return 0;
        };
        let most_ns = MOST_SHIFT * self.period_ns;
        let shift_ns = (GAIN * left_ns).clamp(-most_ns, most_ns).round();
        for source in &mut self.sources {
            // What is moved here need not be learnt.
            source.wait_ns = (source.wait_ns + shift_ns).rem_euclid(self.period_ns);
        }
        shift_ns as i64
    }

    /// How far the deadline is from where it should be, the shorter way round.
    fn way_left_ns(&mut self) -> Option<f64> {
        let followed = self
            .followed
            .and_then(|key| self.sources.iter().find(|source| source.key == key))
            .filter(|source| source.is_steady(self.period_ns))
            .copied();
        self.candidate = (self.candidate + 1) % self.sources.len().max(1);
        let candidate = self
            .sources
            .get(self.candidate)
            .filter(|source| source.is_steady(self.period_ns))
            .copied();
        let best = match (followed, candidate) {
            (Some(followed), Some(candidate)) => {
                let spared_ns = self.waits_ns(&followed) - self.waits_ns(&candidate);
                if WORTH_A_MOVE * self.period_ns < spared_ns {
                    candidate
                } else {
                    followed
                }
            }
            (one, other) => one.or(other)?,
        };
        self.followed = Some(best.key);
        Some(nearest(best.way_to_go_ns(), self.period_ns))
    }

    /// Sum of all waits once the deadline is where this source wants it, ns.
    fn waits_ns(&self, wanted: &Source) -> f64 {
        let moved_ns = wanted.way_to_go_ns();
        let steady = self
            .sources
            .iter()
            .filter(|source| source.is_steady(self.period_ns));
        steady
            .map(|source| {
                // A frame that comes later than its margin before the tick often misses it, and waits for the next.
                let spare_ns = (moved_ns - source.way_to_go_ns()).rem_euclid(self.period_ns);
                source.margin_ns() + spare_ns
            })
            .sum()
    }
}

impl Source {
    fn on_frame(&mut self, waited_ns: f64, period_ns: f64) {
        let apart_ns = nearest(waited_ns - self.wait_ns, period_ns);
        self.frames = self.frames.saturating_add(1);
        self.silent_ticks = 0;
        // The mean of all until there are as many as are remembered.
        let memory = MEMORY.min(f64::from(self.frames));
        self.wait_ns = (self.wait_ns + apart_ns / memory).rem_euclid(period_ns);
        self.scatter_ns += (apart_ns.abs() - self.scatter_ns) / memory;
    }

    fn is_steady(&self, period_ns: f64) -> bool {
        LEARNT_AFTER <= self.frames && self.scatter_ns <= MOST_SCATTER * period_ns
    }

    /// How long before its tick this source's frames are to come.
    fn margin_ns(&self) -> f64 {
        LEAST_WAIT_NS + SCATTERS * self.scatter_ns
    }

    /// How much later the deadline would have to be for that.
    fn way_to_go_ns(&self) -> f64 {
        self.margin_ns() - self.wait_ns
    }
}

/// The same place on a circle, at most half of the way round.
fn nearest(way_ns: f64, period_ns: f64) -> f64 {
    way_ns - period_ns * (way_ns / period_ns).round()
}
