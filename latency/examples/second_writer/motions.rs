//! What the two operators do: the table's task, and four ways of moving that a forecast may find easier or harder.
//!
//! But for the table's task both work the same band of clay from two sides, with a ball that is mostly in it, and both
//! move slowly on across their strokes, so that there is fresh clay in every one. Each hand follows its way as a person
//! does, by a servo of some hertz, and gives way where the clay resists.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use teleclay_clay::{Clay, Shape};
use teleclay_latency::cell::{Cell, Profile};
use teleclay_latency::task;
use teleclay_link::scheme::Controllers;
use teleclay_operator::{Intent, Track, TrackPoint};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, Scheme, ToolDescription};
use teleclay_sim::rig::{Further, Rig, RigError, Setup};

use std::f64::consts::TAU;
use std::sync::Arc;

const TICK_S: f64 = 1e-3;
/// How long each motion lasts, s.
pub(crate) const LASTS_S: f64 = 8.0;
const BLOCK_M: [f64; 3] = [0.160, 0.096, 0.032];
const RADIUS_M: f64 = 0.008;
/// How deep the middle of the ball is, m.
const DEPTH_M: f64 = 0.006;
/// The homes of the two are so far apart along the strokes, m.
const APART_M: f64 = 0.02;
/// Both move on across the strokes at this speed, m/s, beginning so far before the middle.
const ON_M_S: f64 = 0.006;
const FROM_M: f64 = -0.024;
/// What a hand that knows the clay presses with beforehand, N s/m.
const PRESS_N_S_PER_M: f64 = 20.0;
/// A hand's tremor in action: 8 to 12 Hz, some tenths of a millimetre before the handle damps it.
const TREMOR_HZ: [f64; 2] = [8.0, 12.0];
const TREMOR_M: f64 = 4e-4;

/// How the two move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Motion {
    /// The table's task: steady pushes towards each other, with a blade.
    Pushes,
    /// To and fro at one speed, between turning points that vary.
    Straight,
    /// Round and round.
    Circles,
    /// Strokes that begin and end at rest, with pauses.
    Stops,
    /// To and fro, with a hand's tremor.
    Tremor,
}

impl Motion {
    /// Every motion.
    pub(crate) const ALL: [Self; 5] = [
        Self::Pushes,
        Self::Straight,
        Self::Circles,
        Self::Stops,
        Self::Tremor,
    ];

    /// The word for it.
    pub(crate) const fn word(self) -> &'static str {
        match self {
            Self::Pushes => "pushes",
            Self::Straight => "straight",
            Self::Circles => "circles",
            Self::Stops => "stops",
            Self::Tremor => "tremor",
        }
    }
}

/// A rig for a motion over the lines of a cell, at rest; the hands begin with [`work`].
///
/// # Errors
/// Does not happen with the constants of this module; told rather than hidden.
pub(crate) fn rig(
    motion: Motion,
    cell: &Cell,
    seed: u64,
    controllers: Arc<dyn Controllers>,
) -> Result<Rig, RigError> {
    if motion == Motion::Pushes {
        // The table's second operator comes with its profile, and the line may be another one.
        let task = Cell {
            profile: Profile::SecondWriter,
            ..*cell
        };
        let mut rig = task::rig_with(&task, seed, controllers)?;
        rig.impair(cell.lines(seed));
        return Ok(rig);
    }
    let home_m = [
        BLOCK_M[0] / 2.0 - APART_M / 2.0,
        BLOCK_M[1] / 2.0,
        BLOCK_M[2] - DEPTH_M,
    ];
    let setup = Setup {
        parameters: LoopParameters {
            scheme: Scheme::Replica,
            axes: Axes::Two,
            home_m,
            tool: ToolDescription::Ball { radius_m: RADIUS_M },
            ..LoopParameters::default()
        },
        clay: Clay::new(&Shape::Block { size_m: BLOCK_M }, 1e-3)
            .expect("the block's size and voxels fit each other"),
        intent: Intent::Idle,
        lines: cell.lines(seed),
    };
    let further = Further {
        home_m: [home_m[0] + APART_M, home_m[1], home_m[2]],
        intent: Intent::Idle,
    };
    Rig::with_controllers(setup, vec![further], controllers)
}

/// Has both hands work, and tells of each tick.
pub(crate) fn work(rig: &mut Rig, motion: Motion, seed: u64, mut each: impl FnMut(&mut Rig)) {
    let mut go_on = |rig: &mut Rig, span_s: f64| {
        for _ in 0..(span_s / TICK_S).round() as u64 {
            rig.tick();
            each(rig);
        }
    };
    rig.run_for(task::START);
    if motion == Motion::Pushes {
        for force_n in task::pushes(seed) {
            task::push(rig, force_n);
            go_on(rig, task::PUSH.as_secs_f64());
        }
        task::let_go(rig);
        go_on(rig, task::CALM.as_secs_f64());
        return;
    }
    for slot in 0..2 {
        let intent = Intent::Played(way(motion, 2 * seed + slot, slot));
        rig.device_of_mut(slot as usize).intend(intent);
    }
    go_on(rig, LASTS_S);
}

/// The way of one hand.
fn way(motion: Motion, seed: u64, slot: u64) -> Track {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut between = move |least: f64, most: f64| {
        let share = (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        least + share * (most - least)
    };
    let side = if slot == 0 { 1.0 } else { -1.0 };
    let ticks = (LASTS_S / TICK_S) as usize;
    let mut places = match motion {
        Motion::Pushes | Motion::Straight | Motion::Tremor => to_and_fro(&mut between, side, ticks),
        Motion::Circles => circles(&mut between, side, ticks),
        Motion::Stops => strokes(&mut between, side, ticks),
    };
    // From home to where the way begins, within half a second; and on across the strokes.
    let across_m = between(-0.003, 0.003);
    for (tick, place) in places.iter_mut().enumerate() {
        let t_s = tick as f64 * TICK_S;
        place[1] += FROM_M + across_m + ON_M_S * t_s;
        let share = smooth((t_s / 0.5).min(1.0));
        *place = place.map(|at| at * share);
    }
    if motion == Motion::Tremor {
        for axis in 0..2 {
            let (hz, phase) = (between(TREMOR_HZ[0], TREMOR_HZ[1]), between(0.0, TAU));
            let size_m = TREMOR_M * between(0.5, 1.0);
            for (tick, place) in places.iter_mut().enumerate() {
                place[axis] += size_m * (TAU * hz * tick as f64 * TICK_S + phase).sin();
            }
        }
    }
    let points = (0..ticks)
        .map(|tick| {
            let (before, after) = (
                places[tick.saturating_sub(1)],
                places[(tick + 1).min(ticks - 1)],
            );
            let velocity_m_s: [f64; 3] =
                std::array::from_fn(|axis| (after[axis] - before[axis]) / (2.0 * TICK_S));
            TrackPoint {
                position_m: places[tick],
                velocity_m_s,
                hand_force_n: velocity_m_s.map(|v| v * PRESS_N_S_PER_M),
            }
        })
        .collect();
    Track::new(points, TICK_S).expect("ways are finite and last")
}

/// Between turning points at one speed.
fn to_and_fro(between: &mut impl FnMut(f64, f64) -> f64, side: f64, ticks: usize) -> Vec<[f64; 3]> {
    let speed_m_s = between(0.04, 0.06);
    let (mut x_m, mut toward) = (0.0_f64, side);
    let mut turn_m = between(0.015, 0.035);
    (0..ticks)
        .map(|_| {
            x_m += toward * speed_m_s * TICK_S;
            if turn_m < x_m * toward {
                toward = -toward;
                turn_m = between(0.015, 0.035);
            }
            [x_m, 0.0, 0.0]
        })
        .collect()
}

fn circles(between: &mut impl FnMut(f64, f64) -> f64, side: f64, ticks: usize) -> Vec<[f64; 3]> {
    let (radius_m, speed_m_s) = (between(0.010, 0.016), between(0.04, 0.06));
    let (phase, turns) = (between(0.0, TAU), between(-1.0, 1.0).signum());
    let rate = turns * speed_m_s / radius_m;
    (0..ticks)
        .map(|tick| {
            let angle = phase + rate * tick as f64 * TICK_S;
            // The two circles overlap by half.
            [
                radius_m * angle.cos() + side * 0.004,
                radius_m * angle.sin(),
                0.0,
            ]
        })
        .collect()
}

/// As people reach: the jerk of each stroke is the least that gets there in time.
fn strokes(between: &mut impl FnMut(f64, f64) -> f64, side: f64, ticks: usize) -> Vec<[f64; 3]> {
    let mut places = Vec::with_capacity(ticks);
    let (mut from_m, mut toward) = (0.0, side);
    while places.len() < ticks {
        let to_m = toward * between(0.012, 0.035);
        let lasts_s = ((to_m - from_m) / between(0.03, 0.05)).abs().max(0.2);
        let moving = (lasts_s / TICK_S) as usize;
        places.extend((0..moving).map(|tick| {
            let share = smooth(tick as f64 / moving as f64);
            [from_m + (to_m - from_m) * share, 0.0, 0.0]
        }));
        let resting = (between(0.1, 0.5) / TICK_S) as usize;
        places.extend((0..resting).map(|_| [to_m, 0.0, 0.0]));
        (from_m, toward) = (to_m, -toward);
    }
    places.truncate(ticks);
    places
}

/// From 0 to 1 with the least jerk.
fn smooth(share: f64) -> f64 {
    share * share * share * (10.0 + share * (6.0 * share - 15.0))
}
