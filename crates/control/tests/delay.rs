//! Delay margins against closed forms and against a count of unstable roots that never looks for a crossing.

mod winding;

use proptest::prelude::*;
use std::f64::consts::PI;
use teleclay_control::compensators::Sides;
use teleclay_control::wall::{DelayedWall, critical_stiffness, passive_stiffness};
use teleclay_control::{
    ClosedLoop, Complex, DelayMargin, DelayedScheme, NoMargin, Polynomial, RationalFunction,
    delay_margin, paper,
};
use winding::roots_right_of;

fn polynomial(coefficients: &[f64]) -> Polynomial {
    Polynomial::new(coefficients).unwrap()
}

fn sides(c_h1: RationalFunction) -> Sides {
    Sides {
        g_h: paper::g_hx(),
        s_h: RationalFunction::zero(),
        g_t: paper::default_g_t(),
        s_t: RationalFunction::zero(),
        c_h1,
        position_ratio: 1.0,
        force_ratio: -1.0,
    }
}

proptest! {
    /// `dy/dt = -a y - k y(t - d)` loses stability at `acos(-a/k) / sqrt(k² - a²)` for `k > |a|`, never for `k <= a`.
    #[test]
    fn first_order_lag_agrees_with_its_closed_form(a in 0.01..10.0f64, k in 0.01..20.0f64) {
        prop_assume!(1e-6 < (k - a).abs());
        let margin = delay_margin(&polynomial(&[1.0, a]), &polynomial(&[k])).unwrap();
        if k < a {
            prop_assert_eq!(margin, DelayMargin::Unbounded);
        } else {
            let omega = (k * k - a * a).sqrt();
            let wanted = (-a / k).acos() / omega;
            prop_assert!((margin.seconds().unwrap() - wanted).abs() < 1e-9 * wanted, "{margin:?} {wanted}");
        }
    }

    /// A wall across a network at its critical stiffness bears exactly the delay it was computed for; and at 1 % more,
    /// less. Two derivations that share no code.
    #[test]
    fn the_wall_and_the_margin_tell_the_same_story(
        mass_kg in 0.05..2.0, damping in 0.1..20.0, rtt_s in 0.0..0.3, tick_s in 1e-4..5e-3,
    ) {
        let wall = DelayedWall { mass_kg, damping_n_s_per_m: damping, rtt_s, tick_s };
        let stiffness = critical_stiffness(&wall).unwrap();
        let free = polynomial(&[mass_kg, damping, 0.0]);
        let margin = |k: f64| delay_margin(&free, &polynomial(&[k])).unwrap().seconds().unwrap();
        let delay_s = tick_s / 2.0 + rtt_s;
        prop_assert!((margin(stiffness) - delay_s).abs() < 1e-9 * delay_s);
        prop_assert!(margin(1.01 * stiffness) < delay_s && delay_s < margin(0.99 * stiffness));
    }
}

#[test]
fn walls_agree_with_the_reference() {
    let table = [
        (0.0, 5002.973888361214),
        (0.002, 1002.9646977690447),
        (0.005, 457.49642052133095),
        (0.01, 241.02346426457925),
        (0.02, 124.8345292528001),
        (0.05, 52.25822556608554),
        (0.1, 27.428577006491114),
    ];
    for (rtt_s, wanted) in table {
        let wall = DelayedWall {
            mass_kg: 0.35,
            damping_n_s_per_m: 2.5,
            rtt_s,
            tick_s: 0.001,
        };
        let got = critical_stiffness(&wall).unwrap();
        assert!(
            (got - wanted).abs() < 1e-9 * wanted,
            "rtt {rtt_s}: {got}, wanted {wanted}"
        );
    }
    let wall = DelayedWall {
        mass_kg: 0.35,
        damping_n_s_per_m: 2.5,
        rtt_s: 0.0,
        tick_s: 0.001,
    };
    assert!(
        critical_stiffness(&DelayedWall {
            damping_n_s_per_m: 0.0,
            ..wall
        })
        .unwrap()
        .abs()
            < 1e-15
    );
    assert_eq!(
        critical_stiffness(&DelayedWall {
            mass_kg: 0.0,
            ..wall
        })
        .unwrap_err()
        .quantity,
        "mass_kg"
    );
    assert!(
        critical_stiffness(&DelayedWall {
            rtt_s: f64::NAN,
            ..wall
        })
        .is_err()
    );
    // b > K T / 2 + |B| at its edge.
    assert!((passive_stiffness(2.5, -0.5, 0.001).unwrap() - 4000.0).abs() < 1e-9);
    assert!(passive_stiffness(0.5, 2.0, 0.001).unwrap().abs() < 1e-15);
}

/// The quasi-polynomial itself, by its own root count: none unstable below the margin, two just above.
#[test]
fn roots_cross_at_the_margin_and_not_before() {
    let clays = [(20.0, 0.0), (60.0, 0.0), (5.0, 200.0), (10.0, 60.0)];
    for (damping, stiffness) in clays {
        let t_t = paper::t_t(damping, stiffness).unwrap();
        let closed_loop =
            ClosedLoop::new(&sides(paper::default_c_h1()), &paper::t_hx(), &t_t).unwrap();
        let margin = closed_loop
            .delay_margin_position_force()
            .unwrap()
            .seconds()
            .unwrap();
        let p = sides(paper::default_c_h1()).admittance().unwrap();
        let characteristic = |d: f64| {
            let (p, t_t) = (p.clone(), t_t.clone());
            move |s: Complex<f64>| {
                let motion = p.numerator().at(s);
                p.denominator().at(s) + motion * (paper::t_hx().at(s) + t_t.at(s) * (-s * d).exp())
            }
        };
        assert_eq!(
            roots_right_of(characteristic(0.98 * margin), 0.0, 1e4),
            0,
            "clay {damping} {stiffness}"
        );
        assert_eq!(
            roots_right_of(characteristic(1.02 * margin), 0.0, 1e4),
            2,
            "clay {damping} {stiffness}"
        );
    }
}

/// The force-exchange case with a finite margin, and cases without one, by the same count. The difference mode at the
/// origin is divided out.
#[test]
fn force_exchange_is_counted_out_as_well() {
    let c_h1 = RationalFunction::new(&[0.5], &[0.01, 0.2, 1.0]).unwrap();
    let sides_y = Sides {
        g_h: paper::g_hy(),
        ..sides(c_h1)
    };
    let t_t = paper::t_t(20.0, 10.0).unwrap();
    let closed_loop = ClosedLoop::new(&sides_y, &paper::t_hx(), &t_t).unwrap();
    let margin = closed_loop
        .delay_margin_force_exchange()
        .unwrap()
        .seconds()
        .unwrap();
    let characteristic = |sides: &Sides, t_t: &Polynomial, d: f64, origin: i32| {
        let (p, t_t) = (sides.admittance().unwrap(), t_t.clone());
        move |s: Complex<f64>| {
            let h = p.numerator().at(s) * paper::t_hx().at(s);
            let e = p.numerator().at(s) * t_t.at(s);
            let own = p.denominator().at(s);
            ((own + e) * (own + h) - h * e * (-s * d).exp()) / s.powi(origin)
        }
    };
    assert_eq!(
        roots_right_of(characteristic(&sides_y, &t_t, 0.98 * margin, 0), 0.0, 1e4),
        0
    );
    assert_eq!(
        roots_right_of(characteristic(&sides_y, &t_t, 1.02 * margin, 0), 0.0, 1e4),
        2
    );
    // With an integrator the paper's scheme outlives any delay: look right of the origin at long ones.
    for (damping, stiffness) in [(20.0, 0.0), (60.0, 0.0), (5.0, 200.0)] {
        let t_t = paper::t_t(damping, stiffness).unwrap();
        let sides_x = sides(paper::default_c_h1());
        let closed_loop = ClosedLoop::new(&sides_x, &paper::t_hx(), &t_t).unwrap();
        assert_eq!(
            closed_loop.delay_margin_force_exchange().unwrap(),
            DelayMargin::Unbounded
        );
        for d in [0.05, 0.4, 2.0] {
            assert_eq!(
                roots_right_of(characteristic(&sides_x, &t_t, d, 1), 1e-4, 1e4),
                0,
                "{damping} {stiffness} {d}"
            );
        }
    }
}

#[test]
fn loops_without_a_margin_say_why() {
    let t_t = paper::t_t(60.0, 0.0).unwrap();
    let light =
        ClosedLoop::new(&sides(paper::c_h1(0.2, 5.0).unwrap()), &paper::t_hx(), &t_t).unwrap();
    for scheme in [DelayedScheme::ForceExchange, DelayedScheme::PositionForce] {
        assert_eq!(
            light.delay_margin(scheme).unwrap(),
            DelayMargin::None(NoMargin::UnstableWithoutDelay)
        );
    }
    // An admittance with a pole at +1 that the arm's own stiffness holds: one copy is held, the difference of two is
    // not.
    let runaway = Sides {
        g_h: RationalFunction::new(&[1.0], &[1.0]).unwrap(),
        ..sides(RationalFunction::new(&[1.0], &[1.0, 9.0, -10.0]).unwrap())
    };
    let held = ClosedLoop::new(&runaway, &polynomial(&[20.0]), &polynomial(&[1.0, 1.0])).unwrap();
    assert!(held.is_stable_without_delay().unwrap());
    assert_eq!(
        held.delay_margin_force_exchange().unwrap(),
        DelayMargin::None(NoMargin::UnstableAdmittance)
    );
    assert!(held.delay_margin_position_force().unwrap().bears(0.01));
}

/// When the delayed part does not fall off, the slightest delay sets off an endless row of roots.
#[test]
fn a_direct_path_through_the_delay_bears_none() {
    let margin = delay_margin(&polynomial(&[1.0, 1.0]), &polynomial(&[2.0, 1.0])).unwrap();
    assert_eq!(margin.seconds(), Some(0.0));
    assert!(!margin.bears(0.0));
    let margin = delay_margin(&polynomial(&[1.0, 1.0]), &polynomial(&[0.5, 0.4])).unwrap();
    assert_eq!(margin, DelayMargin::Unbounded);
}

/// A crossing far from every root is found: `s + 1e-9 + exp(-s d)` crosses at 1 rad/s, nine decades away.
#[test]
fn far_crossings_are_found() {
    let margin = delay_margin(&polynomial(&[1.0, 1e-9]), &polynomial(&[1.0]))
        .unwrap()
        .seconds()
        .unwrap();
    assert!((margin - PI / 2.0).abs() < 1e-8, "{margin}");
}
