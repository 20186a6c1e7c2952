//! What grows past a delay margin, against closed forms, published margins and a count of roots that looks for none.

mod winding;

use proptest::prelude::*;
use serde_json::Value;
use std::f64::consts::TAU;
use teleclay_control::compensators::Sides;
use teleclay_control::{
    Characteristic, ClosedLoop, Complex, DelayedScheme, LoopError, Polynomial, RationalFunction,
    paper,
};
use winding::roots_right_of;

/// A growth that nobody would see within a minute, 1/s.
const SLOWEST_PER_S: f64 = 0.01;

fn polynomial(coefficients: &[f64]) -> Polynomial {
    Polynomial::new(coefficients).unwrap()
}

fn characteristic(a: &[f64], b: &[f64]) -> Characteristic {
    Characteristic::new(polynomial(a), polynomial(b)).unwrap()
}

/// Real parts from the largest on.
fn roots_of(of: &Characteristic, delay_s: f64) -> Vec<Complex<f64>> {
    let mut roots = of.growing_roots(delay_s, SLOWEST_PER_S).unwrap();
    roots.sort_by(|a, b| b.re.total_cmp(&a.re));
    roots
}

/// `dy/dt = -k y(t - d)` has the roots `W_n(-k d) / d`, `W` the branches of Lambert's function; its values here are
/// mpmath's.
#[test]
fn a_delayed_integrator_has_the_roots_of_lamberts_function() {
    let branches: [(f64, &[(f64, f64)]); 5] = [
        (1.0, &[]),
        (2.0, &[(0.172_816_002_839_999_98, 1.673_686_413_740_842_7)]),
        (5.0, &[(0.844_844_605_432_169_7, 1.975_008_754_889_033_7)]),
        (
            10.0,
            &[
                (1.369_980_968_521_270_8, 2.140_194_527_074_713),
                (0.237_288_146_357_604_45, 7.884_069_716_082_307),
            ],
        ),
        (
            20.0,
            &[
                (1.908_615_873_140_498_6, 2.269_938_354_148_238),
                (0.913_746_671_485_816_8, 7.968_157_666_867_664),
                (0.344_907_528_894_335, 14.161_517_393_599_976),
            ],
        ),
    ];
    for (k_d, wanted) in branches {
        for delay_s in [0.004, 0.25, 3.0] {
            let found = roots_of(&characteristic(&[1.0, 0.0], &[k_d / delay_s]), delay_s);
            assert_eq!(
                found.len(),
                wanted.len(),
                "k d = {k_d}, d = {delay_s}: {found:?}"
            );
            for (found, (re, im)) in found.iter().zip(wanted) {
                let apart = (found - Complex::new(*re, *im) / delay_s).norm();
                assert!(apart < 1e-12 * found.norm(), "k d = {k_d}: {found}");
            }
        }
    }
}

/// `s = a` grows without swinging; with nothing late it does so at every delay.
#[test]
fn what_runs_away_does_not_swing() {
    let of = characteristic(&[1.0, -3.0], &[0.0]);
    for delay_s in [0.0, 0.1, 10.0] {
        let growth = of.fastest_growth(delay_s, 0.0).unwrap().unwrap();
        assert!((growth.rate_per_s - 3.0).abs() < 1e-12);
        assert!(growth.frequency_hz.abs() < 1e-12);
    }
}

#[test]
fn without_delay_what_grows_are_the_roots_of_the_sum() {
    // (s - 1) (s² - 4 s + 13) (s + 2): roots 1, 2 ± 3 j, -2.
    let sum = polynomial(&[1.0, -1.0])
        .times(&polynomial(&[1.0, -4.0, 13.0]))
        .and_then(|two| two.times(&polynomial(&[1.0, 2.0])))
        .unwrap();
    let b = polynomial(&[5.0, 7.0]);
    let of = Characteristic::new(sum.plus(&b.scaled(-1.0).unwrap()).unwrap(), b).unwrap();
    let found = roots_of(&of, 0.0);
    let wanted = [Complex::new(2.0, 3.0), Complex::new(1.0, 0.0)];
    assert_eq!(found.len(), wanted.len());
    for (found, wanted) in found.iter().zip(wanted) {
        assert!((found - wanted).norm() < 1e-12, "{found}");
    }
    let fastest = of.fastest_growth(0.0, SLOWEST_PER_S).unwrap().unwrap();
    assert!((fastest.frequency_hz - 3.0 / TAU).abs() < 1e-12);
    assert_eq!(of.fastest_growth(0.0, 2.5).unwrap(), None);
}

/// In force exchange each side moves a copy of the admittance, and without delay the copies part as the roots of its
/// denominator say: here `s (s - 0.5)`, while arm and clay hold what the copies have in common.
#[test]
fn copies_that_part_by_themselves_grow_without_delay() {
    let sides = Sides {
        g_h: RationalFunction::new(&[1.0], &[1.0]).unwrap(),
        s_h: RationalFunction::zero(),
        g_t: paper::default_g_t(),
        s_t: RationalFunction::zero(),
        c_h1: RationalFunction::new(&[1.0], &[1.0, -0.5, 0.0]).unwrap(),
        position_ratio: 1.0,
        force_ratio: -1.0,
    };
    let closed = ClosedLoop::new(&sides, &polynomial(&[2.0, 6.0]), &polynomial(&[3.0, 0.0]));
    let closed = closed.unwrap();
    let growing = |scheme| roots_of(&closed.characteristic(scheme).unwrap(), 0.0);
    assert_eq!(growing(DelayedScheme::PositionForce), []);
    let found = growing(DelayedScheme::ForceExchange);
    assert_eq!(found.len(), 1);
    assert!((found[0] - 0.5).norm() < 1e-12, "{found:?}");
}

/// A loop of the reference, its characteristic function and its margin.
struct Published {
    of: Characteristic,
    scheme: DelayedScheme,
    is_stable_without_delay: bool,
    margin_s: Option<f64>,
}

/// Loops whose margins were computed elsewhere.
fn published() -> Vec<Published> {
    let cases: Vec<Value> = serde_json::from_str(include_str!("reference/loops.json")).unwrap();
    let numbers = |list: &Value| -> Vec<f64> {
        let list = list.as_array().unwrap().iter();
        list.map(|number| number.as_f64().unwrap()).collect()
    };
    let rational =
        |pair: &Value| RationalFunction::new(&numbers(&pair[0]), &numbers(&pair[1])).unwrap();
    let mut found = Vec::new();
    for case in &cases {
        let number = |name: &str| case[name].as_f64().unwrap();
        let sides = Sides {
            g_h: rational(&case["g_h"]),
            s_h: RationalFunction::zero(),
            g_t: rational(&case["g_t"]),
            s_t: RationalFunction::zero(),
            c_h1: rational(&case["c_h1"]),
            position_ratio: number("position_ratio"),
            force_ratio: number("force_ratio"),
        };
        let clay = [
            number("clay_damping_n_s_per_m"),
            number("clay_stiffness_n_per_m"),
        ];
        let closed = ClosedLoop::new(
            &sides,
            &polynomial(&numbers(&case["t_h"])),
            &polynomial(&clay),
        );
        let closed = closed.unwrap();
        for (scheme, name) in [
            (
                DelayedScheme::ForceExchange,
                "delay_margin_force_exchange_s",
            ),
            (
                DelayedScheme::PositionForce,
                "delay_margin_position_force_s",
            ),
        ] {
            found.push(Published {
                of: closed.characteristic(scheme).unwrap(),
                scheme,
                is_stable_without_delay: case["stable_without_delay"].as_bool().unwrap(),
                margin_s: case[name].as_f64(),
            });
        }
    }
    found
}

/// Those that have a margin, both schemes among them.
fn with_margins() -> Vec<(Characteristic, f64)> {
    let all = published()
        .into_iter()
        .filter(|loop_| loop_.is_stable_without_delay);
    let found: Vec<_> = all
        .filter_map(|loop_| Some((loop_.scheme, loop_.of, loop_.margin_s?)))
        .collect();
    for scheme in [DelayedScheme::ForceExchange, DelayedScheme::PositionForce] {
        assert!(found.iter().any(|(of, ..)| *of == scheme));
    }
    found
        .into_iter()
        .map(|(_, of, margin_s)| (of, margin_s))
        .collect()
}

#[test]
fn nothing_grows_below_a_published_margin_and_something_above_it() {
    for (of, margin_s) in with_margins() {
        let growth = |share: f64| of.fastest_growth(share * margin_s, SLOWEST_PER_S).unwrap();
        assert_eq!(growth(0.97), None);
        assert!(growth(1.1).is_some(), "margin {margin_s} s");
    }
}

/// Just above a margin, what grows is what the axis was crossed by.
#[test]
fn a_loop_swings_at_its_margin_where_its_gain_is_minus_one() {
    for (of, margin_s) in with_margins() {
        let growth = of.fastest_growth(1.0001 * margin_s, 0.0).unwrap();
        let omega_rad_s = TAU * growth.expect("it is past its margin").frequency_hz;
        let gain = of.gain_at(omega_rad_s, margin_s);
        assert!((gain + 1.0).norm() < 0.002, "{gain} at {omega_rad_s} rad/s");
    }
}

#[test]
fn a_loop_without_a_margin_stays_calm_at_every_delay() {
    let calm: Vec<_> = published()
        .into_iter()
        .filter(|loop_| {
            let is_forward = loop_.scheme == DelayedScheme::PositionForce;
            is_forward && loop_.is_stable_without_delay && loop_.margin_s.is_none()
        })
        .collect();
    assert!(!calm.is_empty());
    for Published { of, .. } in calm {
        for delay_s in [0.0, 0.1, 1.0, 10.0] {
            assert_eq!(of.fastest_growth(delay_s, SLOWEST_PER_S).unwrap(), None);
        }
    }
}

/// `f` and a radius beyond which it has no root right of the line.
fn counted(of: &Characteristic, value: impl Fn(Complex<f64>) -> Complex<f64>, delay_s: f64) {
    let found = roots_of(of, delay_s);
    let count: i32 = found
        .iter()
        .map(|root| if root.im == 0.0 { 1 } else { 2 })
        .sum();
    let wanted = roots_right_of(value, SLOWEST_PER_S, 3000.0);
    assert_eq!(count, wanted, "d = {delay_s} s: {found:?}");
    for root in found {
        assert!(SLOWEST_PER_S < root.re && 0.0 <= root.im);
    }
}

#[test]
fn every_growing_motion_of_a_loop_is_found() {
    let mut most = 0;
    for (of, margin_s) in with_margins() {
        for factor in [0.5, 1.2, 2.0, 6.0, 25.0] {
            let delay_s = factor * margin_s;
            counted(&of, |s| of.at(s, delay_s), delay_s);
            most = most.max(roots_of(&of, delay_s).len());
        }
    }
    assert!(5 < most, "{most} at most is no hard case");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Any quasi-polynomial of the second order with a delayed part of the first.
    #[test]
    fn every_root_right_of_the_axis_is_found(
        a in [-20.0..20.0, -100.0..100.0_f64], b in [-20.0..20.0, -100.0..100.0_f64], delay_s in 0.01..1.5_f64,
    ) {
        let of = characteristic(&[1.0, a[0], a[1]], &b);
        let (p, q) = (polynomial(&[1.0, a[0], a[1]]), polynomial(&b));
        counted(&of, |s| p.at(s) + q.at(s) * (-s * delay_s).exp(), delay_s);
    }

    /// `k / (s + a)` has its peak at rest, `k / (s² + 2 z w s + w²)` at its resonance.
    #[test]
    fn peaks_are_those_of_lag_and_resonance(k in 0.01..100.0_f64, w in 0.01..300.0_f64, z in 0.01..0.7_f64) {
        let lag = characteristic(&[1.0, w], &[k]).peak_gain().unwrap();
        prop_assert!((lag * w / k - 1.0).abs() < 1e-12);
        let resonance = characteristic(&[1.0, 2.0 * z * w, w * w], &[k]).peak_gain().unwrap();
        let wanted = k / (w * w * 2.0 * z * (1.0 - z * z).sqrt());
        prop_assert!((resonance / wanted - 1.0).abs() < 1e-9, "{resonance}, wanted {wanted}");
    }
}

#[test]
fn peaks_at_either_end_and_of_nothing() {
    let peak = |a: &[f64], b: &[f64]| characteristic(a, b).peak_gain().unwrap();
    assert!(peak(&[1.0, 2.0], &[0.0]).abs() < 1e-300);
    assert!((peak(&[1.0, 2.0], &[3.0, 0.0]) - 3.0).abs() < 1e-12);
    assert!(peak(&[1.0, 0.0], &[1.0]).is_infinite());
    assert!(peak(&[1.0, 2.0], &[1.0, 0.0, 0.0]).is_infinite());
    // An integrator on both sides is one on neither.
    assert!((peak(&[1.0, 5.0, 0.0], &[2.0, 0.0]) - 0.4).abs() < 1e-12);
}

/// `k exp(-j w d) / (j w + a)`: magnitude and phase are known, and between neighbours the phase turns a little.
#[test]
fn the_curve_of_a_lag_is_that_of_a_lag() {
    let (k, a) = (7.0, 3.0);
    for delay_s in [0.0, 0.003, 0.2, 5.0] {
        let curve = characteristic(&[1.0, a], &[k]).curve(delay_s);
        assert!(
            curve
                .windows(2)
                .all(|pair| pair[0].omega_rad_s < pair[1].omega_rad_s)
        );
        let (first, last) = (curve[0].omega_rad_s, curve[curve.len() - 1].omega_rad_s);
        assert!(first < 0.011 && 9e3 < last && curve.len() < 20_000);
        for at in &curve {
            let size = k / a.hypot(at.omega_rad_s);
            let phase_rad = -at.omega_rad_s * delay_s - (at.omega_rad_s / a).atan();
            let wanted = Complex::from_polar(size, phase_rad);
            assert!(
                (at.gain - wanted).norm() < 1e-9 * size,
                "{at:?}, wanted {wanted}"
            );
        }
        for pair in curve
            .windows(2)
            .take_while(|pair| pair[1].omega_rad_s * delay_s < 590.0)
        {
            let turn_rad = (pair[1].gain / pair[0].gain).arg().abs();
            assert!(
                turn_rad < 0.07,
                "{turn_rad} rad at {} rad/s",
                pair[0].omega_rad_s
            );
        }
    }
}

/// Where the delayed part does not fall off, roots have no end, and the search for them has.
#[test]
fn a_search_without_end_ends() {
    let of = characteristic(&[1.0, 4.0], &[2.0, 1.0]);
    assert!(of.fastest_growth(0.01, SLOWEST_PER_S).is_ok());
    let zero = Characteristic::new(Polynomial::zero(), Polynomial::one());
    assert!(matches!(zero, Err(LoopError::Undetermined)));
}
