//! The whole analysis: facts of the paper, its errata, curves as good as their promise, and an end in time.

use cpu_time::ThreadTime;
use proptest::prelude::*;
use std::time::Duration;
use teleclay_control::analysis::{AnalysisError, LoopInput, analyse};
use teleclay_control::compensators::{Compensator, Sides, compensators};
use teleclay_control::{ClosedLoop, Complex, Polynomial, RationalFunction, paper};

fn polynomial(coefficients: &[f64]) -> Polynomial {
    Polynomial::new(coefficients).unwrap()
}

fn sides(g_h: RationalFunction, c_h1: RationalFunction) -> Sides {
    Sides {
        g_h,
        s_h: RationalFunction::zero(),
        g_t: paper::default_g_t(),
        s_t: RationalFunction::zero(),
        c_h1,
        position_ratio: 1.0,
        force_ratio: -1.0,
    }
}

fn constant(value: f64) -> RationalFunction {
    RationalFunction::new(&[value], &[1.0]).unwrap()
}

fn input(damping: f64, stiffness: f64) -> LoopInput {
    LoopInput {
        sides: sides(paper::g_hx(), paper::default_c_h1()),
        t_h: paper::t_hx(),
        clay_damping_n_s_per_m: damping,
        clay_stiffness_n_per_m: stiffness,
        omegas_rad_s: vec![1.0],
    }
}

/// (34) allows a constant `C_h1` of at most 1.104e-3 on x and 9.951e-4 on y, with the arm alone.
#[test]
fn small_gain_bounds_a_constant_c_h1() {
    for (g_h, bound) in [(paper::g_hx(), 1.104e-3), (paper::g_hy(), 9.951e-4)] {
        let holds = |c: f64| {
            let sides = sides(g_h.clone(), constant(c));
            let closed_loop = ClosedLoop::new(&sides, &paper::t_hx(), &Polynomial::zero()).unwrap();
            closed_loop.margins().unwrap().small_gain.holds
        };
        assert!(holds(0.999 * bound) && !holds(1.001 * bound), "{bound}");
    }
}

/// (34) is only sufficient: an integrator in `C_h1` fails it at rest, although the loop is stable.
#[test]
fn small_gain_fails_with_an_integrator_though_the_loop_is_stable() {
    let analysis = analyse(&input(20.0, 0.0)).unwrap();
    assert!(
        analysis.stable_without_delay
            && !analysis.small_gain_holds
            && analysis.small_gain_peak.is_none()
    );
    assert!(0.5 < analysis.nyquist_min_distance);
}

/// (34) as printed has `T_h + A_h1 A_h2^-1 T_t`. With A_h2 below zero that subtracts the clay, and a loop of equal arm
/// and clay passes at any gain, a violently unstable one too.
#[test]
fn the_printed_sign_of_34_passes_unstable_loops() {
    let arm = polynomial(&[30.0, 3.0]);
    let sides = sides(paper::g_hx(), paper::c_h1(0.2, 5.0).unwrap());
    let closed_loop = ClosedLoop::new(&sides, &arm, &arm).unwrap();
    let p = sides.admittance().unwrap();
    let signed_ratio = sides.position_ratio / sides.force_ratio;
    let printed_peak = (-200..=300)
        .map(|k| Complex::new(0.0, 10.0_f64.powf(f64::from(k) / 100.0)))
        .map(|s| (p.at(s).unwrap() * (arm.at(s) + arm.at(s) * signed_ratio)).norm())
        .fold(0.0, f64::max);
    assert!(printed_peak < 1.0, "the printed condition holds");
    assert!(!closed_loop.is_stable_without_delay().unwrap(), "and yet");
    assert!(
        !closed_loop.margins().unwrap().small_gain.holds,
        "the right one does not hold"
    );
}

/// (28) as printed has `S_h T_t` where `T_t S_t` belongs: with a tool that gives, only the latter solves the tool's own
/// equations (18), (19) and (22).
#[test]
fn the_printed_28_does_not_solve_the_tools_equations() {
    let sides = Sides {
        s_t: RationalFunction::new(&[2e-3], &[0.02, 0.5, 1.0]).unwrap(),
        ..sides(paper::g_hx(), paper::default_c_h1())
    };
    let c = compensators(&sides).unwrap();
    let s = Complex::new(0.0, 7.0);
    let at = |f: &RationalFunction| f.at(s).unwrap();
    let (t_t, f_h) = (polynomial(&[40.0, 100.0]).at(s), Complex::from(2.0));
    let solution = |give: Complex<f64>| {
        at(&sides.g_t) * t_t * at(&c.c_h2) * f_h
            / (1.0 + t_t * at(&sides.g_t) * at(&c.c_t2) + t_t * give)
    };
    let tool_equation = |f_t: Complex<f64>| {
        let v_t = -at(&c.c_h2) * f_h + at(&c.c_t2) * f_t;
        (f_t + t_t * (at(&sides.g_t) * v_t + at(&sides.s_t) * f_t)).norm()
    };
    assert!(tool_equation(solution(at(&sides.s_t))) < 1e-12);
    assert!(1e-2 < tool_equation(solution(at(&sides.s_h))));
}

/// (29): `f_h^e` is the net hand force `f_h - P^-1 y_h`. Read as the hand force itself, the law fails once the handle
/// moves.
#[test]
fn the_force_ratio_holds_for_the_net_hand_force() {
    let sides = Sides {
        force_ratio: -2.0,
        ..sides(paper::g_hx(), paper::default_c_h1())
    };
    let c = compensators(&sides).unwrap();
    let s = Complex::new(0.0, 5.0);
    let at = |f: &RationalFunction| f.at(s).unwrap();
    let (f_h, f_t) = (Complex::from(3.0), Complex::new(-1.0, 0.4));
    let y_h = at(&sides.g_h) * (at(&c.c_h1) * f_h - at(&c.c_t1) * f_t);
    let net = f_h - y_h / at(&sides.admittance().unwrap());
    assert!((f_t - net * sides.force_ratio).norm() < 1e-12);
    assert!(1.0 < (f_t - f_h * sides.force_ratio).norm());
}

/// Margins mean what they say: at the margin, and only there, the altered loop passes through -1.
#[test]
fn classical_margins_reach_minus_one() {
    let analysis = analyse(&input(60.0, 0.0)).unwrap();
    let closed_loop = input(60.0, 0.0).closed_loop().unwrap();
    let gain = analysis.classical.gain_increase.unwrap();
    assert!((closed_loop.gain_at(gain.omega_rad_s) * gain.factor + 1.0).norm() < 1e-9);
    let phase = analysis.classical.phase.unwrap();
    let turned =
        closed_loop.gain_at(phase.omega_rad_s) * Complex::from_polar(1.0, -phase.phase_rad);
    assert!((turned + 1.0).norm() < 1e-9);
    assert!(analysis.classical.gain_decrease.is_none());
    // More gain than the margin is unstable, less is not: C_h1 scales the loop gain.
    for (share, stable) in [(0.999, true), (1.001, false)] {
        let mut altered = input(60.0, 0.0);
        altered.sides.c_h1 = altered.sides.c_h1.scaled(gain.factor * share).unwrap();
        assert_eq!(analyse(&altered).unwrap().stable_without_delay, stable);
    }
}

/// A loop that needs its gain has a lower limit to it: a pole at +1 held by three times the gain that would just do.
/// The curve starts on the negative real axis at rest, where no positive frequency crosses it.
#[test]
fn a_loop_that_needs_its_gain_has_a_lower_limit() {
    let admittance = RationalFunction::new(&[1.0], &[0.1, 0.9, -1.0]).unwrap();
    let sides = |factor: f64| sides(constant(1.0), admittance.scaled(factor).unwrap());
    let with_gain = |factor: f64| {
        ClosedLoop::new(
            &sides(factor),
            &polynomial(&[1.5, 3.0]),
            &Polynomial::zero(),
        )
        .unwrap()
    };
    let margins = with_gain(1.0).margins().unwrap().classical;
    let lower = margins.gain_decrease.unwrap();
    assert!((lower.factor - 1.0 / 3.0).abs() < 1e-12 && lower.omega_rad_s.abs() < 1e-300);
    assert!(margins.gain_increase.is_none());
    assert!(with_gain(1.01 / 3.0).is_stable_without_delay().unwrap());
    assert!(!with_gain(0.99 / 3.0).is_stable_without_delay().unwrap());
}

/// Straight lines between samples stay near the curve where it matters, and phases never jump.
#[test]
fn curves_are_dense_where_they_bend() {
    let resonant = {
        let mut input = input(20.0, 50.0);
        input.sides.g_h = RationalFunction::new(&[400.0], &[1.0, 0.02, 400.0]).unwrap();
        input
    };
    for input in [input(60.0, 0.0), resonant] {
        let closed_loop = input.closed_loop().unwrap();
        let curve = closed_loop.curve(&[1.0, 33.0]).unwrap();
        let n = curve.omega_rad_s.len();
        assert!(
            n < 4000
                && [curve.re.len(), curve.im.len()] == [n, n]
                && [curve.magnitude_db.len(), curve.phase_rad.len()] == [n, n]
        );
        assert!(
            [1.0, 33.0]
                .iter()
                .all(|omega| curve.omega_rad_s.contains(omega))
        );
        for k in 1..n {
            let point = |k: usize| Complex::new(curve.re[k], curve.im[k]);
            assert!(curve.omega_rad_s[k - 1] < curve.omega_rad_s[k]);
            let phase = |k: usize| curve.phase_rad[k].unwrap();
            assert!((phase(k) - phase(k - 1)).abs() < 0.5);
            for part in [0.25, 0.5, 0.75] {
                let omega = curve.omega_rad_s[k - 1]
                    * (curve.omega_rad_s[k] / curve.omega_rad_s[k - 1]).powf(part);
                let gain = closed_loop.gain_at(omega);
                let chord = point(k) - point(k - 1);
                let along =
                    (((gain - point(k - 1)) * chord.conj()).re / chord.norm_sqr()).clamp(0.0, 1.0);
                let off = (point(k - 1) + chord * along - gain).norm();
                assert!(off < 0.004 * (gain + 1.0).norm(), "{omega} rad/s: {off}");
            }
        }
        let least = (0..n)
            .map(|k| Complex::new(curve.re[k] + 1.0, curve.im[k]).norm())
            .fold(f64::INFINITY, f64::min);
        let exact = closed_loop.margins().unwrap().nyquist.distance;
        assert!(
            exact <= least + 1e-12 && least < 1.02 * exact,
            "{least} {exact}"
        );
    }
}

/// One integrator: the phase begins a quarter turn behind, and ends half a turn behind.
#[test]
fn phase_begins_where_the_integrators_put_it() {
    let curve = input(20.0, 0.0).closed_loop().unwrap().curve(&[]).unwrap();
    let (first, last) = (curve.phase_rad.first(), curve.phase_rad.last());
    assert!((first.unwrap().unwrap() + std::f64::consts::FRAC_PI_2).abs() < 1e-2);
    // L falls as s^-2 in the end: P as s^-4, the arm's mass lifts it by s^2.
    assert!((last.unwrap().unwrap() + std::f64::consts::PI).abs() < 1e-2);
}

#[test]
fn an_improper_compensator_is_named_yet_evaluated() {
    let mut input = input(20.0, 0.0);
    input.sides.c_h1 = constant(1e-4);
    input.sides.g_t = RationalFunction::new(&[1.0], &[0.01, 0.5, 20.0, 0.0]).unwrap();
    let analysis = analyse(&input).unwrap();
    assert_eq!(
        analysis.improper_compensators,
        [Compensator::CH2, Compensator::CT2]
    );
    assert!(analysis.compensators[0].c_h2.is_some());
}

#[test]
fn bad_inputs_are_refused() {
    let clay = analyse(&LoopInput {
        clay_damping_n_s_per_m: -1.0,
        ..input(0.0, 0.0)
    });
    assert!(matches!(
        clay,
        Err(AnalysisError::Clay {
            quantity: "clay_damping_n_s_per_m",
            ..
        })
    ));
    let clay = analyse(&LoopInput {
        clay_stiffness_n_per_m: f64::INFINITY,
        ..input(0.0, 0.0)
    });
    assert!(matches!(
        clay,
        Err(AnalysisError::Clay {
            quantity: "clay_stiffness_n_per_m",
            ..
        })
    ));
    let omegas = analyse(&LoopInput {
        omegas_rad_s: vec![1.0, 0.0],
        ..input(0.0, 0.0)
    });
    assert!(matches!(omegas, Err(AnalysisError::Omega { index: 1, .. })));
    let omegas = analyse(&LoopInput {
        omegas_rad_s: vec![1.0; 10_001],
        ..input(0.0, 0.0)
    });
    assert!(matches!(
        omegas,
        Err(AnalysisError::TooManyOmegas { got: 10_001, .. })
    ));
}

/// As many needles as the order allows, none of them damped: the densest mesh there can be still ends in time.
#[test]
fn a_comb_of_undamped_resonances_is_answered_in_time() {
    let comb = |from: i32| {
        (from..from + 3).fold(Polynomial::one(), |p, k| {
            p.times(&polynomial(&[1.0, 0.0, 3.0_f64.powi(2 * k)]))
                .unwrap()
        })
    };
    let function =
        |from| RationalFunction::from_parts(polynomial(&[1.0, 1.0]), comb(from)).unwrap();
    let mut input = input(60.0, 200.0);
    input.sides = sides(function(-3), function(0));
    input.t_h = comb(1).times(&comb(4)).unwrap();
    let before = ThreadTime::now();
    let analysis = analyse(&input).unwrap();
    let took = before.elapsed();
    assert!(took < Duration::from_millis(50), "{took:?}");
    assert!(!analysis.stable_without_delay && analysis.small_gain_peak.is_none());
}

fn user_coefficients(longest: usize) -> impl Strategy<Value = Vec<f64>> {
    let coefficient = prop_oneof![
        4 => -10.0..10.0f64,
        1 => Just(0.0),
        1 => Just(1.0),
        1 => (-1.0..1.0f64, -9..9i32).prop_map(|(m, d)| m * 10.0_f64.powi(d)),
    ];
    proptest::collection::vec(coefficient, 1..=longest)
}

fn user_function(longest: usize) -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    (user_coefficients(longest), user_coefficients(longest))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    /// Whatever plants a user types: an answer with finite figures, or a typed error, within 50 ms of a processor.
    #[test]
    fn every_loop_is_answered_in_time(
        (g_h, c_h1) in prop_oneof![
            (user_function(7), user_function(7)), (user_function(13), user_function(1)), (user_function(1), user_function(13)),
        ],
        g_t in (user_coefficients(4), user_coefficients(4)), t_h in user_coefficients(13),
        damping in 0.0..100.0, stiffness in 0.0..1000.0,
    ) {
        let function = |(n, d): &(Vec<f64>, Vec<f64>)| RationalFunction::new(n, d);
        if let (Ok(g_h), Ok(c_h1), Ok(g_t)) = (function(&g_h), function(&c_h1), function(&g_t)) {
            let input = LoopInput {
                sides: Sides { g_t, ..sides(g_h, c_h1) },
                t_h: polynomial(&t_h),
                clay_damping_n_s_per_m: damping,
                clay_stiffness_n_per_m: stiffness,
                omegas_rad_s: vec![0.1, 10.0],
            };
            let before = ThreadTime::now();
            let outcome = analyse(&input);
            let took = before.elapsed();
            prop_assert!(took < Duration::from_millis(50), "{took:?}");
            if let Ok(analysis) = outcome {
                prop_assert!(!analysis.nyquist_min_distance.is_nan());
                prop_assert!(analysis.curve.re.iter().chain(&analysis.curve.im).all(|v| v.is_finite()));
                let closed_loop = input.closed_loop().unwrap();
                prop_assert_eq!(analysis.closed_loop_poles.len(), closed_loop.poles().unwrap().len());
                prop_assert!(analysis.stable_without_delay <= analysis.closed_loop_poles.iter().all(|p| p.re < 0.0));
            }
        }
    }
}
