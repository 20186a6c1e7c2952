//! A tick that is moved towards the frames it works on, against arrivals whose times are known.

use rand_core::{Rng as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;
use teleclay_link::phase::{MOST_SHIFT, PhaseLock};

const PERIOD_NS: f64 = 1e6;

/// Frames of one handle: every so many ns by its own clock, each up to so much later.
struct Handle {
    next_ns: f64,
    every_ns: f64,
    jitter_ns: f64,
}

impl Handle {
    fn new(phase_ns: f64, drift: f64, jitter_ns: f64) -> Self {
        let every_ns = PERIOD_NS * (1.0 + drift);
        Self {
            next_ns: phase_ns,
            every_ns,
            jitter_ns,
        }
    }
}

/// Ticks for so many seconds; the waits of each handle's frames in the last one, and the shifts of all ticks.
fn run(
    handles: &mut [Handle],
    seconds: u32,
    mut lock: Option<PhaseLock>,
) -> (Vec<Vec<f64>>, Vec<i64>) {
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let mut now_ns = 0.0;
    let mut waiting: Vec<Vec<f64>> = handles.iter().map(|_| Vec::new()).collect();
    let mut waits: Vec<Vec<f64>> = waiting.clone();
    let mut shifts = Vec::new();
    let ticks = 1000 * seconds;
    for tick in 0..ticks {
        for (number, handle) in handles.iter_mut().enumerate() {
            while handle.next_ns <= now_ns {
                let share = f64::from(random.next_u32()) / f64::from(u32::MAX);
                waiting[number].push(handle.next_ns + share * handle.jitter_ns);
                handle.next_ns += handle.every_ns;
            }
            let (came, later): (Vec<f64>, Vec<f64>) =
                waiting[number].iter().partition(|at| **at <= now_ns);
            waiting[number] = later;
            let Some(newest) = came.iter().copied().reduce(f64::max) else {
                continue;
            };
            if let Some(lock) = &mut lock {
                lock.on_frame(number as u64, (now_ns - newest) as u64);
            }
            if ticks - 1000 <= tick {
                waits[number].extend(came.iter().map(|at| now_ns - at));
            }
        }
        let shift = lock.as_mut().map_or(0, PhaseLock::shift_ns);
        shifts.push(shift);
        now_ns += PERIOD_NS + shift as f64;
    }
    (waits, shifts)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn lock() -> PhaseLock {
    PhaseLock::new(PERIOD_NS as u64, 8)
}

#[test]
fn frames_come_shortly_before_their_tick_from_any_phase_and_however_clocks_drift() {
    for phase in 0..20 {
        for drift in [-200e-6, -20e-6, 0.0, 20e-6, 200e-6] {
            let phase_ns = f64::from(phase) * 0.05 * PERIOD_NS;
            let jitter_ns = 60e3;
            let (waits, shifts) = run(
                &mut [Handle::new(phase_ns, drift, jitter_ns)],
                4,
                Some(lock()),
            );
            let (mean_ns, most_ns) = (
                mean(&waits[0]),
                waits[0].iter().copied().fold(0.0, f64::max),
            );
            assert!(
                mean_ns < 0.16 * PERIOD_NS,
                "{phase_ns} ns, {drift}: {mean_ns} ns on average"
            );
            assert!(
                most_ns < 0.25 * PERIOD_NS,
                "{phase_ns} ns, {drift}: {most_ns} ns at most"
            );
            // None misses its tick: a frame a tick, all the time.
            assert!(
                (waits[0].len() as i64 - 1000).abs() <= 1,
                "{} frames",
                waits[0].len()
            );
            let most = (MOST_SHIFT * PERIOD_NS) as i64;
            assert!(shifts.iter().all(|shift| shift.abs() <= most));
        }
    }
}

/// What the lock is for: without it the same frames wait for half a period, over all phases, and at the worst for a
/// whole one.
#[test]
fn without_it_frames_wait_as_chance_has_it() {
    let of_phase = |phase: u32| {
        let mut handles = [Handle::new(f64::from(phase) * 0.05 * PERIOD_NS, 0.0, 60e3)];
        mean(&run(&mut handles, 2, None).0[0])
    };
    let means: Vec<f64> = (0..20).map(of_phase).collect();
    let mean_ns = mean(&means);
    assert!(
        (mean_ns - 0.5 * PERIOD_NS).abs() < 0.05 * PERIOD_NS,
        "{mean_ns}"
    );
    let worst_ns = means.iter().copied().fold(0.0, f64::max);
    assert!(0.9 * PERIOD_NS < worst_ns, "{worst_ns}");
}

#[test]
fn it_moves_no_further_once_it_is_there() {
    let (_, shifts) = run(
        &mut [Handle::new(0.7 * PERIOD_NS, 0.0, 40e3)],
        10,
        Some(lock()),
    );
    // In the last second no more than a few microseconds in all, and nowhere to and fro by more.
    let last = &shifts[9000..];
    assert!(last.iter().sum::<i64>().abs() < 20_000);
    assert!(
        mean(
            &last
                .iter()
                .map(|shift| shift.abs() as f64)
                .collect::<Vec<_>>()
        ) < 150.0
    );
}

/// Two handles a third of a period apart: the tick waits for the later one, so that the sum of waits is a third of a
/// period and both margins. Following the earlier one would cost two thirds.
#[test]
fn of_two_tools_it_follows_the_one_that_spares_both_the_most() {
    for apart in [1.0 / 3.0, -1.0 / 3.0] {
        for first in [0.0, 0.4, 0.8] {
            let at = |share: f64| (first + share + 1.0) * PERIOD_NS;
            let mut handles = [
                Handle::new(at(0.0), 30e-6, 30e3),
                Handle::new(at(apart), 30e-6, 30e3),
            ];
            let (waits, _) = run(&mut handles, 6, Some(lock()));
            let sum_ns = mean(&waits[0]) + mean(&waits[1]);
            assert!(
                sum_ns < 0.62 * PERIOD_NS,
                "{apart} from {first}: {sum_ns} ns"
            );
        }
    }
}

#[test]
fn frames_that_scatter_over_the_whole_period_move_nothing() {
    let (_, shifts) = run(
        &mut [Handle::new(0.2 * PERIOD_NS, 50e-6, 1.5 * PERIOD_NS)],
        5,
        Some(lock()),
    );
    let moved: i64 = shifts.iter().map(|shift| shift.abs()).sum();
    assert_eq!(moved, 0);
}

#[test]
fn a_source_that_falls_silent_is_followed_no_longer() {
    let mut lock = lock();
    for _ in 0..500 {
        lock.on_frame(1, 500_000);
        lock.shift_ns();
    }
    // It would go on for ever towards a margin that nobody confirms.
    for _ in 0..201 {
        lock.shift_ns();
    }
    assert_eq!(lock.shift_ns(), 0);
    // One tool more than there is room for is not heard, and breaks nothing.
    for key in 0..20 {
        lock.on_frame(key, 100_000);
    }
    lock.shift_ns();
}

/// A frame of a tick that came late tells nothing of the phase.
#[test]
fn waits_beyond_a_period_are_no_phase() {
    let mut lock = lock();
    for _ in 0..300 {
        lock.on_frame(1, 5_000_000);
        assert_eq!(lock.shift_ns(), 0);
    }
}
