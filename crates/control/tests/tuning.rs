//! Tuning: what it proposes holds, nothing lighter of its shape would, and a refusal names its reason.

use cpu_time::ThreadTime;
use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::time::Duration;
use teleclay_control::tuning::{Obstacle, TuningError, TuningTarget, propose, propose_while};
use teleclay_control::{ClosedLoop, DelayedScheme, RationalFunction, compensators::Sides, paper};

fn target() -> TuningTarget {
    TuningTarget {
        g_h: paper::g_hx(),
        s_h: RationalFunction::zero(),
        g_t: paper::default_g_t(),
        s_t: RationalFunction::zero(),
        position_ratio: 1.0,
        force_ratio: -1.0,
        t_h: paper::t_hx(),
        clay_damping_n_s_per_m: [0.0, 60.0],
        clay_stiffness_n_per_m: [0.0, 200.0],
        scheme: DelayedScheme::PositionForce,
        round_trip_s: 0.08,
        distance: 0.5,
        heaviest_n_s_per_m: 500.0,
    }
}

fn closed_loop(
    target: &TuningTarget,
    c_h1: RationalFunction,
    damping: f64,
    stiffness: f64,
) -> ClosedLoop {
    let sides = Sides {
        g_h: target.g_h.clone(),
        s_h: target.s_h.clone(),
        g_t: target.g_t.clone(),
        s_t: target.s_t.clone(),
        c_h1,
        position_ratio: target.position_ratio,
        force_ratio: target.force_ratio,
    };
    ClosedLoop::new(
        &sides,
        &target.t_h,
        &paper::t_t(damping, stiffness).unwrap(),
    )
    .unwrap()
}

/// Least distance over a clay grid finer than the search's own, and over delays sampled one by one: no closed form of
/// the alignment, only the definition.
fn sampled_distance(target: &TuningTarget, c_h1: &RationalFunction) -> f64 {
    let mut least = f64::INFINITY;
    for i in 0..=12 {
        for k in 0..=4 {
            let damping = target.clay_damping_n_s_per_m[1] * f64::from(i) / 12.0;
            let stiffness = target.clay_stiffness_n_per_m[1] * f64::from(k) / 4.0;
            let closed_loop = closed_loop(target, c_h1.clone(), damping, stiffness);
            assert!(closed_loop.is_stable_without_delay().unwrap());
            assert!(
                closed_loop
                    .delay_margin(target.scheme)
                    .unwrap()
                    .bears(target.round_trip_s)
            );
            let p = target.g_h.times(c_h1).unwrap();
            for step in 0..400 {
                let omega = 1e-3 * 10.0_f64.powf(f64::from(step) / 400.0 * 6.0);
                let s = teleclay_control::Complex::new(0.0, omega);
                let p = p.at(s).unwrap();
                let (h, e) = (p * target.t_h.at(s), p * (s * damping + stiffness));
                for part in 0..=20 {
                    let late = (-s * target.round_trip_s * f64::from(part) / 20.0).exp();
                    let value = match target.scheme {
                        DelayedScheme::PositionForce => 1.0 + h + e * late,
                        DelayedScheme::ForceExchange => (1.0 + e) * (1.0 + h) - h * e * late,
                    };
                    least = least.min(value.norm());
                }
            }
        }
    }
    least
}

#[test]
fn proposals_keep_the_target() {
    for (scheme, round_trip_s, distance) in [
        (DelayedScheme::PositionForce, 0.0, 0.7),
        (DelayedScheme::PositionForce, 0.08, 0.5),
        (DelayedScheme::ForceExchange, 0.4, 0.4),
    ] {
        let target = TuningTarget {
            scheme,
            round_trip_s,
            distance,
            ..target()
        };
        let proposal = propose(&target).unwrap();
        let sampled = sampled_distance(&target, &proposal.c_h1);
        assert!(
            distance <= sampled && proposal.distance <= sampled + 1e-6,
            "{scheme:?}: {sampled} {proposal:?}"
        );
        assert!(proposal.delay_margin.bears(round_trip_s));
        let impedance = (TAU * proposal.mass_kg).hypot(proposal.damping_n_s_per_m);
        assert!(
            (impedance - proposal.impedance_n_s_per_m).abs() < 1e-9
                && impedance <= target.heaviest_n_s_per_m
        );
        // A handle 5 % lighter of the same shape misses the target somewhere: the proposal does not hide reserves.
        let lighter =
            paper::c_h1(0.95 * proposal.mass_kg, 0.95 * proposal.damping_n_s_per_m).unwrap();
        let broken = (0..=6).any(|i| {
            (0..=6).any(|k| {
                let closed_loop = closed_loop(
                    &target,
                    lighter.clone(),
                    10.0 * f64::from(i),
                    200.0 / 6.0 * f64::from(k),
                );
                !closed_loop
                    .delay_margin(scheme)
                    .unwrap()
                    .bears(round_trip_s)
                    || closed_loop
                        .least_distance_within(scheme, round_trip_s)
                        .unwrap()
                        < distance
            })
        });
        assert!(broken, "{scheme:?}: 5 % lighter would do as well");
    }
}

#[test]
fn a_target_that_cannot_be_met_says_why() {
    // 80 ms with a handle of at most 5 N s/m: position-force loses stability long before.
    let light = TuningTarget {
        heaviest_n_s_per_m: 5.0,
        ..target()
    };
    let refused = propose(&light).unwrap_err();
    let TuningError::NotWithin {
        obstacle,
        heaviest_n_s_per_m,
        ..
    } = refused
    else {
        panic!("{refused}")
    };
    assert!((heaviest_n_s_per_m - 5.0).abs() < 1e-12);
    assert!(
        matches!(obstacle, Obstacle::Delay { .. } | Obstacle::Unstable { .. }),
        "{obstacle}"
    );

    // The obstacle's figures are the loop's own: the mass and damping it names bear the margin it names, no more.
    let slightly_light = TuningTarget {
        heaviest_n_s_per_m: 30.0,
        clay_stiffness_n_per_m: [0.0, 0.0],
        round_trip_s: 1.0,
        ..target()
    };
    let refused = propose(&slightly_light).unwrap_err();
    let TuningError::NotWithin {
        mass_kg,
        damping_n_s_per_m,
        obstacle:
            Obstacle::Delay {
                margin_s,
                wanted_s,
                clay,
            },
        ..
    } = refused
    else {
        panic!("{refused}")
    };
    let c_h1 = paper::c_h1(mass_kg, damping_n_s_per_m).unwrap();
    let margin = closed_loop(
        &slightly_light,
        c_h1,
        clay.damping_n_s_per_m,
        clay.stiffness_n_per_m,
    )
    .delay_margin_position_force()
    .unwrap();
    assert!((margin.seconds().unwrap() - margin_s).abs() < 1e-12 && margin_s < wanted_s);
    assert!(
        refused.to_string().contains("stable up to a round trip of"),
        "{refused}"
    );

    let greedy = TuningTarget {
        distance: 0.99,
        heaviest_n_s_per_m: 30.0,
        round_trip_s: 0.0,
        ..target()
    };
    let refused = propose(&greedy).unwrap_err();
    assert!(
        matches!(
            refused,
            TuningError::NotWithin {
                obstacle: Obstacle::Distance { .. },
                ..
            }
        ),
        "{refused}"
    );
    let beyond = TuningTarget {
        distance: 1.0,
        ..target()
    };
    assert!(matches!(
        propose(&beyond),
        Err(TuningError::DistanceBeyondReach { .. })
    ));
}

#[test]
fn targets_out_of_range_are_refused_by_name() {
    let refused = |target: TuningTarget| match propose(&target) {
        Err(TuningError::OutOfRange { quantity, .. }) => quantity,
        other => panic!("{other:?}"),
    };
    assert_eq!(
        refused(TuningTarget {
            round_trip_s: f64::NAN,
            ..target()
        }),
        "round_trip_s"
    );
    assert_eq!(
        refused(TuningTarget {
            clay_damping_n_s_per_m: [5.0, 1.0],
            ..target()
        }),
        "clay_damping_n_s_per_m"
    );
    assert_eq!(
        refused(TuningTarget {
            distance: 0.0,
            ..target()
        }),
        "distance"
    );
    assert!(matches!(
        propose(&TuningTarget {
            force_ratio: 1.0,
            ..target()
        }),
        Err(TuningError::Compensator(_))
    ));
    // A tool of fifth order: no C_h1 of this form makes C_h2 proper.
    let stiff = RationalFunction::new(&[1.0], &[1e-6, 1e-4, 1e-2, 0.5, 20.0, 0.0]).unwrap();
    assert!(matches!(
        propose(&TuningTarget {
            g_t: stiff,
            ..target()
        }),
        Err(TuningError::Compensator(_))
    ));
}

/// Whoever asked may lose patience at any moment, and the search then ends at once.
#[test]
fn a_search_can_be_called_off() {
    for most in [0, 1, 7, 100] {
        let mut asked = 0;
        let outcome = propose_while(&target(), || {
            asked += 1;
            if most < asked {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        assert_eq!(outcome, Err(TuningError::CalledOff));
        assert_eq!(asked, most + 1);
    }
}

/// Traces of clay and of delay are none, and cost nothing.
#[test]
fn what_is_negligible_changes_nothing() {
    let traces = |trace: f64| TuningTarget {
        clay_damping_n_s_per_m: [trace, target().clay_damping_n_s_per_m[1]],
        clay_stiffness_n_per_m: [trace; 2],
        round_trip_s: trace,
        ..target()
    };
    let wanted = propose(&traces(0.0)).unwrap();
    for trace in [5e-324, 5e-301, 1e-100, 1e-13] {
        let before = ThreadTime::now();
        assert_eq!(propose(&traces(trace)).unwrap(), wanted);
        assert!(before.elapsed() < Duration::from_secs(1));
    }
}
