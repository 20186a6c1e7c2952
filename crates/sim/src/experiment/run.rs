//! The run itself: the rig, tick by tick, from the first edge to the last.

use std::ops::ControlFlow;

use teleclay_clay::BladeDimensions;
use teleclay_operator::{Intent, IntentError};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, Material, Scheme, ToolDescription};

use super::feasible::TICK_S;
use super::record::{Plateau, Recorder, Sample, Trace, Window};
use super::{CuttingExperiment, LONGEST_S, Push, Refusal};
use crate::rig::{Rig, RigError, Setup};
use teleclay_session::Lines;

/// Ticks between two reports of progress.
const REPORT_TICKS: u64 = 100;
/// A run may take this many times as long as the formula says, and this many seconds more.
const PATIENCE: f64 = 4.0;
const PATIENCE_S: f64 = 5.0;
/// The handle is running away once it is this many times faster than on its fastest plateau: transients stay below
/// three.
const RUNAWAY: f64 = 8.0;
/// More ticks than any push takes to build up.
const MOST_PUSH_TICKS: u32 = 1000;
/// Bounds that no experiment within the input ranges comes near: it is about the loop, and safety would only hide it.
const FORCE_LIMIT_N: f64 = 1e3;
const SLEW_LIMIT_N_PER_S: f64 = 1e6;
const SPEED_LIMIT_M_S: f64 = 10.0;
/// Room of the tool around the clay, m.
const ROOM_M: f64 = 1.0;

/// How far a run has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Virtual time, s.
    pub time_s: f64,
    /// Handle position, m.
    pub position_m: f64,
    /// Share of the way that is done, 0 to 1.
    pub share: f64,
}

/// What a run found.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// One per range.
    pub plateaus: Vec<Plateau>,
    /// From the loop's taking over to the handle's passing the last edge, s.
    pub duration_s: f64,
    /// The way there.
    pub trace: Trace,
    /// Clay removed, m³.
    pub removed_volume_m3: f64,
}

/// Why a run came to no end.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The clay could not be made after all.
    #[error(transparent)]
    Refusal(#[from] Refusal),
    /// The operator has no such intent.
    #[error(transparent)]
    Intent(#[from] IntentError),
    /// The rig could not be built.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The handle stopped short of the last edge.
    #[error(
        "the handle stood at {position_m} m after {time_s} s, short of the last edge at {last_edge_m} m"
    )]
    Stalled {
        /// Where it was, m.
        position_m: f64,
        /// The last edge, m.
        last_edge_m: f64,
        /// Virtual time, s.
        time_s: f64,
    },
    /// The loop swings up, although each range by itself is stable.
    #[error("the loop swings up: {velocity_m_s} m/s at {position_m} m after {time_s} s")]
    RanAway {
        /// How fast, m/s.
        velocity_m_s: f64,
        /// Where, m.
        position_m: f64,
        /// When, s of virtual time.
        time_s: f64,
    },
    /// A range was crossed between two ticks.
    #[error("the handle leapt over the plateau of range {range}")]
    Leapt {
        /// Range, from 0.
        range: usize,
    },
    /// Whoever watched the progress called it off.
    #[error("called off after {time_s} s of virtual time")]
    Cancelled {
        /// Virtual time, s.
        time_s: f64,
    },
}

impl CuttingExperiment {
    /// Runs it. `progress` is told every 100 ticks and may call the run off.
    ///
    /// # Errors
    /// The handle does not get to the last edge, the loop swings up, or the run was called off.
    pub fn run(
        &self,
        mut progress: impl FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Outcome, RunError> {
        let inputs = self.inputs();
        let mut rig = self.rig()?;
        lean_on(&mut rig);

        let [start_m, end_m] = [inputs.edges_m[0], inputs.edges_m[inputs.ranges()]];
        let fastest_m_s = (0..inputs.ranges())
            .map(|range| inputs.plateau_velocity_m_s(range, inputs.hand_force_n))
            .fold(0.0, f64::max);
        let longest_s = (PATIENCE * self.expected_s() + PATIENCE_S).min(LONGEST_S);
        let mut recorder = Recorder::new(inputs.most_trace_samples);
        let mut windows: Vec<Window> = (0..inputs.ranges())
            .map(|range| Window::new(self.specimen().window_m(inputs, range)))
            .collect();

        let mut before = sample(&rig, 0, start_m);
        recorder.push(&before);
        for tick in 1_u64.. {
            rig.tick();
            let now = sample(&rig, tick, start_m);
            recorder.push(&now);
            for window in &mut windows {
                window.push(&now);
            }
            let Sample {
                t_s: time_s,
                position_m,
                velocity_m_s,
                ..
            } = now;
            if end_m <= position_m {
                let share = (end_m - before.position_m) / (position_m - before.position_m);
                let duration_s = before.t_s + share * TICK_S;
                return self.outcome(&rig, recorder, &windows, duration_s);
            }
            let is_sane = velocity_m_s.abs() <= RUNAWAY * fastest_m_s;
            if !is_sane {
                return Err(RunError::RanAway {
                    velocity_m_s,
                    position_m,
                    time_s,
                });
            }
            if longest_s < time_s {
                return Err(RunError::Stalled {
                    position_m,
                    last_edge_m: end_m,
                    time_s,
                });
            }
            if tick.is_multiple_of(REPORT_TICKS) {
                let share = ((position_m - start_m) / (end_m - start_m)).clamp(0.0, 1.0);
                if progress(Progress {
                    time_s,
                    position_m,
                    share,
                })
                .is_break()
                {
                    return Err(RunError::Cancelled { time_s });
                }
            }
            before = now;
        }
        unreachable!("the run ends at the time limit")
    }

    fn rig(&self) -> Result<Rig, RunError> {
        let inputs = self.inputs();
        let specimen = self.specimen();
        let force_n = [inputs.hand_force_n, 0.0, 0.0];
        let BladeDimensions {
            width_m,
            height_m,
            thickness_m,
        } = specimen.blade;
        let home_m = specimen.home_m();
        let length_m = specimen.tool_edges_m[inputs.ranges()];
        Ok(Rig::new(Setup {
            parameters: LoopParameters {
                tick_s: TICK_S,
                axes: Axes::Two,
                scheme: Scheme::ForceExchange,
                virtual_mass_kg: inputs.virtual_mass_kg,
                virtual_damping_n_s_per_m: inputs.virtual_damping_n_s_per_m,
                position_ratio: inputs.position_ratio,
                force_ratio: -inputs.force_ratio,
                // The hand pushes from the first tick, so nothing may ramp up.
                ramp_s: TICK_S,
                force_limit_n: FORCE_LIMIT_N,
                slew_limit_n_per_s: SLEW_LIMIT_N_PER_S,
                speed_limit_m_s: SPEED_LIMIT_M_S,
                home_m,
                reach_m: [
                    home_m.map(|at| at - ROOM_M),
                    [
                        home_m[0] + length_m + ROOM_M,
                        home_m[1] + ROOM_M,
                        home_m[2] + ROOM_M,
                    ],
                ],
                tool: ToolDescription::Blade {
                    width_m,
                    height_m,
                    thickness_m,
                },
                material: Material {
                    viscosity_pa_s_per_m: specimen.viscosity_pa_s_per_m,
                    yield_stress_pa: 0.0,
                    stiffness_pa: 0.0,
                },
                ..LoopParameters::default()
            },
            clay: specimen.clay()?,
            intent: match inputs.push {
                Push::AtSensor => Intent::sensor_force(force_n)?,
                Push::ThroughArm => Intent::constant_force(force_n)?,
            },
            lines: Lines::default(),
        })?)
    }

    fn outcome(
        &self,
        rig: &Rig,
        recorder: Recorder,
        windows: &[Window],
        duration_s: f64,
    ) -> Result<Outcome, RunError> {
        let inputs = self.inputs();
        let plateaus = windows.iter().enumerate().map(|(range, window)| {
            let theory = |force_n| inputs.plateau_velocity_m_s(range, force_n);
            window.finish(theory).ok_or(RunError::Leapt { range })
        });
        let clay = rig.session().clay();
        Ok(Outcome {
            plateaus: plateaus.collect::<Result<_, _>>()?,
            duration_s,
            trace: recorder.finish(),
            removed_volume_m3: clay.removed_volume_m3(),
        })
    }
}

/// The hand leans on the handle before the loop takes over, so that its push does not build up while the clock runs.
fn lean_on(rig: &mut Rig) {
    let device = rig.device_mut();
    let mut force_n = device.sample().hand_force_n[0];
    for _ in 0..MOST_PUSH_TICKS {
        device.command([0.0; 3]);
        let next_n = device.sample().hand_force_n[0];
        if next_n <= force_n && 0.0 < next_n {
            return;
        }
        force_n = next_n;
    }
}

/// Handle and clay at the end of a tick, which is the same moment at both ends.
fn sample(rig: &Rig, tick: u64, start_m: f64) -> Sample {
    let device = rig.device().sample();
    Sample {
        t_s: tick as f64 * TICK_S,
        position_m: start_m + device.position_m[0],
        velocity_m_s: device.velocity_m_s[0],
        hand_force_n: device.hand_force_n[0],
        tool_force_n: rig.tool().view().force_n[0],
        engaged_area_m2: rig.session().last_step(0).engaged_area_m2,
    }
}
