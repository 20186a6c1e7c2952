//! The state of a hand as a row of numbers. `null` of JavaScript is NaN here; words are numbers in the order below.
//!
//! | from | is |
//! |---|---|
//! | 0 | time of the last tick, ms |
//! | 1 | who moves the handle: the loop, the brake, nobody |
//! | 2 | the link: live, not yet, silent, on copy, on stale copy, gone, paused, fault |
//! | 3 | who holds: released, waiting, held, letting go, clutched, stopped |
//! | 4, 5 | scheme and state of the copy, as on the wire |
//! | 6, 9, 12 | hand, handle and tool, m |
//! | 15, 18, 21 | felt force, hand's force, what the device renders, N |
//! | 24, 25 | the copy's hash, low and high half; NaN where it is not known |
//! | 26 | epoch of the clay |
//! | 27, 28 | round trip, silence, s |
//! | 29, 30, 31 | corrections: how many, the largest step and what is held back, N |
//! | 32 to 41 | counts: ticks, given up, gaps, guarded, sent, stale, unheard, undecodable, foreign, overflowed |
//! | 42, 43 | wanted: parameters, a lease, as 0 or 1 |
//! | 44, 45 | wanted: number and epoch of a snapshot; NaN for none |

use teleclay_bilateral::LinkState;
use teleclay_impedance::GraspState;
use teleclay_pointer::{Counts, Mode, Pointer};

/// How many there are.
pub const LENGTH: usize = 46;

pub(crate) fn write(pointer: &Pointer, to: &mut Vec<f64>) {
    let view = pointer.view();
    to.extend([
        view.at_ns as f64 * 1e-6,
        mode(view.mode),
        link(view.link_state),
        grasp(view.grasp),
        f64::from(view.scheme.byte()),
        f64::from(view.copy.byte()),
    ]);
    for place in [
        view.hand_m,
        view.handle_m,
        view.tool_m,
        view.felt_force_n,
        view.hand_force_n,
        view.device_force_n,
    ] {
        to.extend(place);
    }
    let halves = view
        .clay_hash
        .map(|hash| [hash as u32, (hash >> 32) as u32].map(f64::from));
    to.extend(halves.unwrap_or([f64::NAN; 2]));
    let corrections = &view.corrections;
    let held = corrections.held_n.map(f64::from);
    to.extend([
        f64::from(view.clay_epoch),
        view.round_trip_s.unwrap_or(f64::NAN),
        view.silence_s,
        f64::from(corrections.count),
        f64::from(corrections.largest_step_n),
        held.iter().map(|part| part * part).sum::<f64>().sqrt(),
    ]);
    let Counts {
        ticks,
        given_up,
        gaps,
        guarded,
        sent,
        stale,
        unheard,
        undecodable,
        foreign,
        overflowed,
    } = *pointer.counts();
    let counts = [
        ticks,
        given_up,
        gaps,
        guarded,
        sent,
        stale,
        unheard,
        undecodable,
        foreign,
        overflowed,
    ];
    to.extend(counts.map(|count| count as f64));
    let wanted = pointer.wanted();
    let snapshot = wanted.snapshot.map(|snapshot| {
        let parts = [snapshot.number, snapshot.epoch];
        parts.map(f64::from)
    });
    to.extend([wanted.parameters, wanted.lease].map(f64::from));
    to.extend(snapshot.unwrap_or([f64::NAN; 2]));
}

fn mode(mode: Mode) -> f64 {
    match mode {
        Mode::Coupled => 0.0,
        Mode::Braking => 1.0,
        Mode::Resting => 2.0,
    }
}

fn link(state: LinkState) -> f64 {
    match state {
        LinkState::Live => 0.0,
        LinkState::NotYet => 1.0,
        LinkState::Silent => 2.0,
        LinkState::OnCopy => 3.0,
        LinkState::OnStaleCopy => 4.0,
        LinkState::Gone => 5.0,
        LinkState::Paused => 6.0,
        LinkState::Fault => 7.0,
    }
}

fn grasp(state: GraspState) -> f64 {
    match state {
        GraspState::Released => 0.0,
        GraspState::Waiting => 1.0,
        GraspState::Held => 2.0,
        GraspState::LettingGo => 3.0,
        GraspState::Clutched => 4.0,
        GraspState::Stopped => 5.0,
    }
}
