//! A pointer on a page at a session: 60 to 125 samples a second, steps of a pixel, and every byte as on a WebSocket.

mod rigs;

use std::time::Duration;

use rigs::{both_ways, distance, line, norm, viscous};
use teleclay_bilateral::LinkState;
use teleclay_clay::Clay;
use teleclay_impedance::GraspState;
use teleclay_pointer::{MOST_AT_ONCE, MadePath, Mode, PROFILE, Pointer, PointerSetup};
use teleclay_proto::http::SessionPatch;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Scheme, ToolDescription};
use teleclay_session::Lines;
use teleclay_sim::pointed::{Pointed, PointedSetup, keys};
use teleclay_wire::FramesView;

const TICK_NS: u64 = 1_000_000;

/// A ball over the middle of a block, its lowest point on the surface.
fn carving(scheme: Scheme, lines: Lines, wakes_every: u64) -> Pointed {
    let radius_m = 0.0064;
    Pointed::new(PointedSetup {
        parameters: LoopParameters {
            scheme,
            home_m: [0.064, 0.032, 0.032 + radius_m],
            tool: ToolDescription::Ball { radius_m },
            material: viscous(2e5),
            ..LoopParameters::default()
        },
        size_m: [0.128, 0.064, 0.032],
        voxel_size_m: 1e-3,
        lines,
        wakes_every,
    })
    .unwrap()
}

/// A tenth of all frames lost, 150 ms each way, give or take 45.
fn bad() -> Lines {
    both_ways(line(150, 0.3, 0.1), 5)
}

fn ticks_of(span: Duration) -> u64 {
    span.as_nanos() as u64 / TICK_NS
}

fn hash(clay: &Clay) -> u64 {
    clay.clone().hash()
}

/// Runs for a while, holding every tick to the bounds. The felt force of every tick.
fn run(pointed: &mut Pointed, span: Duration) -> Vec<[f64; 3]> {
    let mut felt = Vec::new();
    let mut last = *pointed.pointer().view();
    for _ in 0..ticks_of(span) {
        pointed.tick();
        let view = *pointed.pointer().view();
        let ticks = ((view.at_ns - last.at_ns) / TICK_NS) as f64;
        let slew_n = PROFILE.slew_n_per_s * 1e-3 * ticks + 1e-9;
        for (now, before) in [
            (view.felt_force_n, last.felt_force_n),
            (view.hand_force_n, last.hand_force_n),
        ] {
            assert!(norm(now) <= PROFILE.force_n + 1e-9, "{view:?}");
            assert!(distance(now, before) <= slew_n, "{last:?} {view:?}");
        }
        let way_m = PROFILE.speed_m_s * 1e-3 * ticks + 1e-9;
        assert!(distance(view.handle_m, last.handle_m) <= way_m, "{view:?}");
        assert!(norm(view.device_force_n) <= 0.0, "a mouse renders nothing");
        last = view;
        felt.push(view.felt_force_n);
    }
    felt
}

/// Root mean square of the difference, of the range of what is the measure.
fn nrmse(of: &[[f64; 3]], against: &[[f64; 3]]) -> f64 {
    let square = of
        .iter()
        .zip(against)
        .map(|(a, b)| distance(*a, *b).powi(2));
    let most = against.iter().map(|f| norm(*f)).fold(0.0, f64::max);
    (square.sum::<f64>() / of.len() as f64).sqrt() / most
}

#[test]
fn under_every_scheme_a_pointer_cuts_across_a_bad_line_within_every_bound() {
    for scheme in Scheme::ALL.iter().copied() {
        for wakes_every in [1, 4] {
            let mut pointed = carving(scheme, bad(), wakes_every);
            let before = pointed.session().clay().remaining_units();
            let felt = run(&mut pointed, Duration::from_secs(6));
            let cut = before - pointed.session().clay().remaining_units();
            let most = felt.iter().map(|f| norm(*f)).fold(0.0, f64::max);
            println!("{scheme:?} {wakes_every}: cut {cut}, felt {most:.2} N");
            assert!(0 < cut && 0.1 < most, "{scheme:?}: {cut} {most}");
            let view = pointed.pointer().view();
            assert_eq!(
                (view.link_state, view.grasp),
                (LinkState::Live, GraspState::Held)
            );
        }
    }
}

#[test]
fn on_its_copy_a_pointer_feels_across_a_bad_line_what_it_feels_beside_the_clay() {
    for wakes_every in [1, 4] {
        let mut near = carving(Scheme::Replica, Lines::default(), wakes_every);
        let mut far = carving(Scheme::Replica, bad(), wakes_every);
        let span = Duration::from_secs(6);
        let (by_far, by_near) = (run(&mut far, span), run(&mut near, span));
        let error = nrmse(&by_far, &by_near);
        println!("every {wakes_every} ms: {:.4} %", error * 100.0);
        assert!(error < 0.01, "{error}");
        for pointed in [&mut near, &mut far] {
            pointed.let_go();
            run(pointed, Duration::from_secs(3));
            let here = pointed.pointer().view().clay_hash;
            let there = hash(pointed.session().clay());
            assert_eq!(here, Some(there));
        }
        assert_eq!(near.pointer().counts().unheard, 0);
    }
    // A scheme without a copy feels the line, or this would compare nothing with nothing.
    let [by_far, by_near] = [bad(), Lines::default()].map(|lines| {
        let mut pointed = carving(Scheme::ForceExchange, lines, 1);
        run(&mut pointed, Duration::from_secs(6))
    });
    assert!(0.05 < nrmse(&by_far, &by_near));
}

/// What came to a pointer, and when.
enum Came {
    Sample(u64, [f64; 3]),
    Frames(Vec<u8>),
}

/// Whoever wakes seldom makes the same ticks: what was told has its time, and so has what is sent.
#[test]
fn how_often_somebody_wakes_changes_no_bit_of_what_the_hand_does() {
    let mut pointed = carving(Scheme::ForceExchange, bad(), 1);
    let granted = pointed.granted().to_vec();
    let mut came: Vec<(u64, Came)> = Vec::new();
    let mut path = MadePath::new(11).peekable();
    let mut frames = Vec::new();
    for _ in 0..3000 {
        let now_ns = pointed.now_ns() + TICK_NS;
        while let Some((at_ns, place_m)) = path.next_if(|(at_ns, _)| *at_ns <= now_ns) {
            came.push((now_ns, Came::Sample(at_ns, place_m)));
        }
        let messages = pointed.on_their_way_in().iter().cloned();
        came.extend(messages.map(|message| (now_ns, Came::Frames(message))));
        pointed.tick();
        frames.extend(sent(pointed.sent()));
    }
    for every in [1, 4, 16] {
        let mut again = Pointer::new(0, PointerSetup::default(), &granted, &keys()).unwrap();
        again.hold();
        let (mut next, mut got) = (came.iter().peekable(), Vec::new());
        for wake in 1..=3000 / every {
            let now_ns = wake * every * TICK_NS;
            while let Some((at_ns, came)) = next.next_if(|(at_ns, _)| *at_ns <= now_ns) {
                match came {
                    Came::Sample(taken_ns, place_m) => {
                        again.handle_sample(*at_ns, *taken_ns, *place_m);
                    }
                    Came::Frames(message) => again.handle_frames(*at_ns, message).unwrap(),
                }
            }
            again.advance(now_ns);
            got.extend(sent(again.outgoing()));
        }
        assert!(2900 < got.len());
        assert_eq!(got[..], frames[..got.len()], "woken every {every} ms");
    }
}

fn sent(message: Option<&[u8]>) -> Vec<Vec<u8>> {
    let view = message.map(|message| FramesView::decode(message).unwrap());
    view.into_iter()
        .flat_map(|view| view.iter().map(<[u8]>::to_vec).collect::<Vec<_>>())
        .collect()
}

/// A tab that was hidden, a laptop that slept: in the very call that wakes, nothing is felt and nobody holds.
#[test]
fn after_a_long_gap_no_force_is_left_and_the_hand_has_to_take_hold_anew() {
    for scheme in Scheme::ALL.iter().copied() {
        let mut pointed = carving(scheme, Lines::default(), 1);
        run(&mut pointed, Duration::from_secs(3));
        let before = *pointed.pointer().view();
        assert!(0.1 < norm(before.felt_force_n) && before.grasp == GraspState::Held);
        let counts = *pointed.pointer().counts();
        // Half a second at the least, and up to a night.
        let gap_ns = [700_000_000, 10_000_000_000, 30_000_000_000_000][scheme as usize % 3];
        let woken_ns = pointed.now_ns() + gap_ns;
        let pointer = pointed.pointer_mut();
        let advanced = pointer.advance(woken_ns);
        assert_eq!(advanced.ticks, MOST_AT_ONCE);
        let view = *pointer.view();
        assert_eq!(view.at_ns, woken_ns);
        for force in [view.felt_force_n, view.hand_force_n, view.device_force_n] {
            assert!(norm(force) <= 0.0, "{scheme:?}: {view:?}");
        }
        assert_eq!(
            (view.grasp, view.link_state),
            (GraspState::Released, LinkState::Gone)
        );
        let now = *pointer.counts();
        assert_eq!(now.gaps, counts.gaps + 1);
        let passed = (now.ticks + now.given_up) - (counts.ticks + counts.given_up);
        assert_eq!(passed, gap_ns / TICK_NS);
        // The same pointer goes on telling where it is, and that is no grip.
        for tick in 1..200 {
            let now_ns = woken_ns + tick * TICK_NS;
            pointer.handle_sample(now_ns, now_ns, [0.01, 0.0, -0.01]);
            pointer.advance(now_ns);
            assert!(norm(pointer.view().hand_force_n) <= 0.0);
        }
    }
}

/// Stalls of 300 ms, timers clamped to 4 ms, a tab at 1 Hz: every millisecond is a tick or was given up.
#[test]
fn ticks_made_and_ticks_given_up_are_the_time_that_passed() {
    let patterns: [&[u64]; 4] = [&[1], &[4], &[4, 4, 300, 4], &[1000]];
    for pattern in patterns {
        let pointed = carving(Scheme::ForceExchange, Lines::default(), 1);
        let granted = pointed.granted();
        let mut pointer = Pointer::new(5, PointerSetup::default(), granted, &keys()).unwrap();
        let mut now_ms = 0;
        for wake in pattern.iter().cycle().take(500) {
            now_ms += wake;
            let advanced = pointer.advance(5 + now_ms * TICK_NS);
            assert!(advanced.ticks <= MOST_AT_ONCE);
            let made = u64::from(advanced.ticks) + advanced.given_up;
            assert_eq!(made, *wake);
        }
        let counts = pointer.counts();
        assert_eq!(counts.ticks + counts.given_up, now_ms);
        // A clock that goes backwards owes nothing, and makes up for nothing.
        assert_eq!(pointer.advance(0).ticks, 0);
    }
}

#[test]
fn whoever_leaves_lets_go_and_comes_to_rest_within_half_a_second() {
    for scheme in Scheme::ALL.iter().copied() {
        let mut pointed = carving(scheme, Lines::default(), 1);
        run(&mut pointed, Duration::from_secs(3));
        pointed.pointer_mut().leave();
        // Wishes that come too late are none.
        for _ in 0..5 {
            pointed.pointer_mut().hold();
            run(&mut pointed, Duration::from_millis(100));
        }
        let view = pointed.pointer().view();
        assert_eq!(
            (view.mode, view.grasp),
            (Mode::Resting, GraspState::Released)
        );
        assert!(norm(view.felt_force_n) <= 0.0 && norm(view.hand_force_n) <= 0.0);
    }
}

/// A lease that is lost in the middle of a stroke: the copy and every cut that the session lacks go on under the next
/// one.
#[test]
fn under_another_lease_the_hand_goes_on_and_no_cut_is_lost() {
    let mut pointed = carving(Scheme::Replica, line_of(40), 2);
    run(&mut pointed, Duration::from_secs(3));
    let before = *pointed.pointer().view();
    assert_eq!(
        (before.link_state, before.grasp),
        (LinkState::Live, GraspState::Held)
    );
    pointed.renew().unwrap();
    run(&mut pointed, Duration::from_millis(20));
    assert_eq!(pointed.pointer().view().link_state, LinkState::NotYet);
    run(&mut pointed, Duration::from_secs(2));
    let view = pointed.pointer().view();
    assert_eq!(
        (view.link_state, view.grasp),
        (LinkState::Live, GraspState::Held)
    );
    pointed.let_go();
    run(&mut pointed, Duration::from_secs(2));
    let here = pointed.pointer().view().clay_hash;
    assert_eq!(here, Some(hash(pointed.session().clay())));
    let counts = pointed.pointer().counts();
    assert_eq!((counts.unheard, counts.foreign), (0, 0));
}

fn line_of(delay_ms: u32) -> Lines {
    both_ways(line(delay_ms, 0.3, 0.05), 9)
}

/// Scheme after scheme while the hand cuts, and other clay: no step of a force, and nothing that is asked for in vain.
#[test]
fn what_changes_in_the_session_changes_under_the_hand_within_the_bounds() {
    let mut pointed = carving(Scheme::Replica, line_of(10), 2);
    run(&mut pointed, Duration::from_secs(2));
    let schemes = [
        Scheme::ForceExchange,
        Scheme::Tdpa,
        Scheme::Replica,
        Scheme::ForceExchange,
    ];
    for scheme in schemes {
        pointed
            .patch(SessionPatch {
                scheme: Some(scheme),
                ..SessionPatch::default()
            })
            .unwrap();
        run(&mut pointed, Duration::from_secs(1));
        let view = pointed.pointer().view();
        assert_eq!((view.scheme, view.link_state), (scheme, LinkState::Live));
        let wanted = pointed.pointer().wanted();
        assert!(
            !wanted.parameters && !wanted.lease && wanted.snapshot.is_none(),
            "{wanted:?}"
        );
    }
    pointed
        .patch(SessionPatch {
            paused: Some(true),
            ..SessionPatch::default()
        })
        .unwrap();
    run(&mut pointed, Duration::from_millis(200));
    let view = pointed.pointer().view();
    assert!(norm(view.felt_force_n) <= 0.0 && view.link_state == LinkState::Paused);
}
