//! What a run leaves behind: a trace of bounded length, and the plateaus, measured as they happen.

/// Columns of one run, all of one length, evenly spaced in time. Positions and velocities are the handle's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Time since the loop took over, s.
    pub t_s: Vec<f64>,
    /// Handle position, m; starts at the first edge.
    pub position_m: Vec<f64>,
    /// Its velocity, m/s.
    pub velocity_m_s: Vec<f64>,
    /// Net force of the hand at the sensor, N.
    pub hand_force_n: Vec<f64>,
    /// Force of the clay on the tool, N: below zero, it opposes the motion.
    pub tool_force_n: Vec<f64>,
}

/// What was measured in one range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plateau {
    /// `f_h / (B + rho B_i)` with the force that the sensor read over the window, m/s.
    pub theory_m_s: f64,
    /// Way over time through the window, m/s.
    pub measured_m_s: f64,
    /// Greatest less least velocity within the window, over the mean.
    pub ripple: f64,
    /// Handle positions between which it was measured, m.
    pub window_m: [f64; 2],
    /// Mean force of the hand at the sensor over the window, N.
    pub hand_force_n: f64,
    /// Mean engaged area over the window, m².
    pub engaged_area_m2: f64,
}

/// One tick of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    pub(super) t_s: f64,
    pub(super) position_m: f64,
    pub(super) velocity_m_s: f64,
    pub(super) hand_force_n: f64,
    pub(super) tool_force_n: f64,
    pub(super) engaged_area_m2: f64,
}

/// Keeps every `stride`-th sample; doubles the stride whenever it is full.
pub(super) struct Recorder {
    trace: Trace,
    most: usize,
    stride: u64,
    seen: u64,
}

impl Recorder {
    pub(super) fn new(most: usize) -> Self {
        Self {
            trace: Trace::default(),
            most,
            stride: 1,
            seen: 0,
        }
    }

    pub(super) fn push(&mut self, sample: &Sample) {
        let is_due = self.seen.is_multiple_of(self.stride);
        self.seen += 1;
        if !is_due {
            return;
        }
        if self.trace.t_s.len() == self.most {
            self.stride *= 2;
            for column in self.trace.columns_mut() {
                keep_every_second(column);
            }
            if !(self.seen - 1).is_multiple_of(self.stride) {
                return;
            }
        }
        let values = [
            sample.t_s,
            sample.position_m,
            sample.velocity_m_s,
            sample.hand_force_n,
            sample.tool_force_n,
        ];
        for (column, value) in self.trace.columns_mut().into_iter().zip(values) {
            column.push(value);
        }
    }

    pub(super) fn finish(self) -> Trace {
        self.trace
    }
}

impl Trace {
    fn columns_mut(&mut self) -> [&mut Vec<f64>; 5] {
        [
            &mut self.t_s,
            &mut self.position_m,
            &mut self.velocity_m_s,
            &mut self.hand_force_n,
            &mut self.tool_force_n,
        ]
    }
}

fn keep_every_second(column: &mut Vec<f64>) {
    let mut place = 0;
    column.retain(|_| {
        place += 1;
        place % 2 == 1
    });
}

/// Sums over one window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    window_m: [f64; 2],
    count: u32,
    /// Time and place of the first and the last sample.
    ends: Option<[(f64, f64); 2]>,
    force: f64,
    area: f64,
    least: f64,
    greatest: f64,
}

impl Window {
    pub(super) fn new(window_m: [f64; 2]) -> Self {
        Self {
            window_m,
            count: 0,
            ends: None,
            force: 0.0,
            area: 0.0,
            least: f64::INFINITY,
            greatest: f64::NEG_INFINITY,
        }
    }

    pub(super) fn push(&mut self, sample: &Sample) {
        let [from_m, to_m] = self.window_m;
        if !(from_m <= sample.position_m && sample.position_m < to_m) {
            return;
        }
        self.count += 1;
        let here = (sample.t_s, sample.position_m);
        self.ends = Some(self.ends.map_or([here, here], |[first, _]| [first, here]));
        self.force += sample.hand_force_n;
        self.area += sample.engaged_area_m2;
        self.least = self.least.min(sample.velocity_m_s);
        self.greatest = self.greatest.max(sample.velocity_m_s);
    }

    /// `None` when the handle leapt over the window. `theory` gives the formula's velocity for a force at the sensor.
    pub(super) fn finish(self, theory: impl Fn(f64) -> f64) -> Option<Plateau> {
        let [(first_s, first_m), (last_s, last_m)] = self.ends?;
        if last_s <= first_s {
            return None;
        }
        let measured_m_s = (last_m - first_m) / (last_s - first_s);
        let mean = |sum: f64| sum / f64::from(self.count);
        let hand_force_n = mean(self.force);
        Some(Plateau {
            theory_m_s: theory(hand_force_n),
            measured_m_s,
            ripple: (self.greatest - self.least) / measured_m_s,
            window_m: self.window_m,
            hand_force_n,
            engaged_area_m2: mean(self.area),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(tick: u64) -> Sample {
        let t_s = tick as f64 * 1e-3;
        Sample {
            t_s,
            position_m: 0.01 * t_s,
            velocity_m_s: 0.01,
            hand_force_n: 2.0,
            tool_force_n: -1.0,
            engaged_area_m2: 1e-4,
        }
    }

    /// Whatever the length of a run, the trace is bounded, evenly spaced, and begins at the beginning.
    #[test]
    fn a_trace_thins_itself_evenly() {
        for ticks in [1, 63, 64, 65, 100, 127, 128, 129, 1000, 4096, 4097, 10_000] {
            let mut recorder = Recorder::new(64);
            for tick in 0..ticks {
                recorder.push(&sample(tick));
            }
            let trace = recorder.finish();
            let kept = trace.t_s.len();
            assert!(
                kept <= 64 && (ticks.min(32) as usize) <= kept,
                "{kept} of {ticks}"
            );
            assert!(trace.t_s[0].abs() < 1e-15);
            let spacing = trace.t_s.get(1).map_or(0.0, |second| second - trace.t_s[0]);
            for (place, t_s) in trace.t_s.iter().enumerate() {
                assert!(
                    (t_s - place as f64 * spacing).abs() < 1e-9,
                    "{ticks}: {t_s}"
                );
            }
            let lost_at_end = (ticks - 1) as f64 * 1e-3 - trace.t_s[kept - 1];
            assert!(lost_at_end < spacing.max(1e-9), "{ticks}: {lost_at_end}");
        }
    }

    #[test]
    fn a_window_measures_what_lies_in_it_and_nothing_else() {
        let mut window = Window::new([0.02, 0.03]);
        for (tick, position_m, velocity_m_s) in [
            (0, 0.019, 9.0),
            (1, 0.02, 0.10),
            (2, 0.025, 0.12),
            (3, 0.0299, 0.11),
            (4, 0.03, 9.0),
        ] {
            window.push(&Sample {
                position_m,
                velocity_m_s,
                ..sample(tick)
            });
        }
        let plateau = window.finish(|force| force / 20.0).unwrap();
        assert!((plateau.measured_m_s - 0.0099 / 2e-3).abs() < 1e-9);
        assert!((plateau.ripple - 0.02 / plateau.measured_m_s).abs() < 1e-12);
        assert!((plateau.theory_m_s - 0.1).abs() < 1e-12);
        assert_eq!(Window::new([0.0, 1.0]).finish(|force| force), None);
    }
}
