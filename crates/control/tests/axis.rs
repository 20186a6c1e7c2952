//! Poles and zeros on the imaginary axis, simple, double and cancelling: what the curve does there is known, and is
//! nothing that a number near it may tell otherwise.

use proptest::prelude::*;
use teleclay_control::analysis::{LoopAnalysis, LoopInput, analyse};
use teleclay_control::compensators::Sides;
use teleclay_control::{Polynomial, RationalFunction};

fn function(numerator: &[f64], denominator: &[f64]) -> RationalFunction {
    RationalFunction::new(numerator, denominator).unwrap()
}

fn polynomial(coefficients: &[f64]) -> Polynomial {
    Polynomial::new(coefficients).unwrap()
}

fn product(factors: &[&[f64]]) -> Vec<f64> {
    let product = factors
        .iter()
        .fold(Polynomial::one(), |p, f| p.times(&polynomial(f)).unwrap());
    product.coefficients().to_vec()
}

/// `L = g_h · c_h1 · t_h`, without clay.
fn through_arm(g_h: RationalFunction, c_h1: RationalFunction, t_h: &[f64]) -> LoopInput {
    LoopInput {
        sides: Sides {
            g_h,
            s_h: RationalFunction::zero(),
            g_t: function(&[1.0], &[1.0]),
            s_t: RationalFunction::zero(),
            c_h1,
            position_ratio: 1.0,
            force_ratio: -1.0,
        },
        t_h: polynomial(t_h),
        clay_damping_n_s_per_m: 0.0,
        clay_stiffness_n_per_m: 0.0,
        omegas_rad_s: Vec::new(),
    }
}

fn one() -> RationalFunction {
    function(&[1.0], &[1.0])
}

fn analysed(input: &LoopInput) -> LoopAnalysis {
    analyse(input).unwrap()
}

/// `(s² + omega²)` to a power, as a list.
fn swinging(omega: f64, power: usize) -> Vec<f64> {
    let factor = [1.0, 0.0, omega * omega];
    product(&vec![&factor[..]; power])
}

#[test]
fn an_undamped_resonance_has_no_peak() {
    let found = analysed(&through_arm(
        one(),
        function(&[1.0], &[1.0, 0.0, 1.0]),
        &[1.0],
    ));
    assert_eq!(found.small_gain_peak, None);
    assert!(!found.small_gain_holds && !found.stable_without_delay);
    // 1 + L = (s² + 2) / (s² + 1): the loop itself has its roots on the axis.
    assert!(found.nyquist_min_distance == 0.0, "{found:?}");
    assert!((found.nyquist_min_omega_rad_s - 2f64.sqrt()).abs() < 1e-12);
}

/// `(2s² + 1)(2s + 1) / ((s² + 4)(s² + s + 1))`: zero at `j/√2`, and the real axis is met nowhere else.
#[test]
fn a_zero_on_the_axis_is_no_gain_margin() {
    let c_h1 = function(&[4.0, 2.0, 2.0, 1.0], &[1.0, 1.0, 5.0, 4.0, 4.0]);
    let input = LoopInput {
        t_h: Polynomial::zero(),
        clay_stiffness_n_per_m: 1.0,
        ..through_arm(one(), c_h1, &[0.0])
    };
    let found = analysed(&input);
    assert_eq!(found.classical.gain_increase, None);
    assert_eq!(found.classical.gain_decrease, None);
    assert_eq!(found.small_gain_peak, None);
}

/// A curve that stays on the real axis meets -1 or nears it from either side: `k/(s² + 1)`, `-1/4 / (1 - s²)`, `-1/2`.
#[test]
fn a_curve_along_the_real_axis_has_the_gain_margins_of_its_ends() {
    let classical = |c_h1: RationalFunction| analysed(&through_arm(one(), c_h1, &[1.0])).classical;
    let through = classical(function(&[1.0], &[1.0, 0.0, 1.0]));
    let there = through.gain_increase.unwrap();
    assert!((there.factor - 1.0).abs() < 1e-15 && (there.omega_rad_s - 2f64.sqrt()).abs() < 1e-12);
    assert_eq!(through.gain_decrease, None);
    let near = classical(function(&[-0.25], &[-1.0, 0.0, 1.0]));
    assert!(
        (near.gain_increase.unwrap().factor - 4.0).abs() < 1e-15,
        "{near:?}"
    );
    assert_eq!((near.gain_decrease, near.phase), (None, None));
    let constant = classical(function(&[-0.5], &[1.0]));
    assert!((constant.gain_increase.unwrap().factor - 2.0).abs() < 1e-15);
}

/// `(s² + 5) / ((s² + 3)(s + 1))` at its own pole and zero, which no number hits exactly.
#[test]
fn a_pole_on_the_grid_has_no_value_and_a_zero_has_no_phase() {
    let (zero, pole) = (5f64.sqrt(), 3f64.sqrt());
    let c_h1 = function(&[1.0, 0.0, 5.0], &product(&[&[1.0, 0.0, 3.0], &[1.0, 1.0]]));
    let mut input = through_arm(one(), c_h1, &[1.0]);
    input.omegas_rad_s = vec![1.0, pole, zero];
    let found = analysed(&input);
    let values: Vec<_> = found.compensators.iter().map(|point| point.c_h1).collect();
    assert!(values[0].is_some() && values[1].is_none(), "{values:?}");
    assert!(values[2].unwrap().norm() == 0.0, "{values:?}");
    let curve = found.curve;
    let place = |omega| {
        curve
            .omega_rad_s
            .iter()
            .position(|w| w.total_cmp(&omega).is_eq())
    };
    assert_eq!(place(pole), None);
    let at = place(zero).unwrap();
    assert_eq!((curve.re[at], curve.im[at]), (0.0, 0.0));
    assert_eq!((curve.magnitude_db[at], curve.phase_rad[at]), (None, None));
    let others = (0..curve.omega_rad_s.len()).filter(|n| *n != at);
    assert!(
        others
            .into_iter()
            .all(|n| curve.magnitude_db[n].is_some() && curve.phase_rad[n].is_some())
    );
}

/// A mode that a compensator hides from itself leaves its response alone, at its own frequency too.
#[test]
fn a_hidden_mode_on_the_grid_leaves_the_response_alone() {
    let omega = 7f64.sqrt();
    let hidden = [1.0, 0.0, 7.0];
    let c_h1 = function(
        &product(&[&hidden, &[3.0]]),
        &product(&[&hidden, &[1.0, 4.0]]),
    );
    let mut input = through_arm(one(), c_h1, &[1.0]);
    input.omegas_rad_s = vec![omega];
    let found = analysed(&input);
    let wanted = function(&[3.0], &[1.0, 4.0]).at_omega(omega).unwrap();
    assert!((found.compensators[0].c_h1.unwrap() - wanted).norm() < 1e-12);
}

/// Nothing in the loop, and a gain beyond the range of numbers: `20 log10 (5 · 10^-800)` at 10^200 rad/s.
#[test]
fn magnitudes_are_told_wherever_there_is_one() {
    let nothing = analysed(&through_arm(
        one(),
        function(&[1.0], &[1.0, 2.0, 0.0]),
        &[0.0],
    ));
    assert!(!nothing.curve.re.is_empty());
    assert!(nothing.curve.magnitude_db.iter().all(Option::is_none));
    assert!(nothing.curve.phase_rad.iter().all(Option::is_none));
    let c_h1 = function(&[5.0], &[1.0, 2.0, 3.0, 2.0, 1.0]);
    let mut input = through_arm(one(), c_h1, &[1.0]);
    input.omegas_rad_s = vec![1e200];
    let curve = analysed(&input).curve;
    let last = curve.magnitude_db.last().unwrap().unwrap();
    assert!(
        (last - 20.0 * (5f64.log10() - 800.0)).abs() < 1e-6,
        "{last}"
    );
    let phase = curve.phase_rad.last().unwrap().unwrap();
    assert!((phase + std::f64::consts::TAU).abs() < 1e-6, "{phase}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Poles on the axis, once or twice, in any part of the loop, beside whatever else: the gain has no peak.
    #[test]
    fn poles_on_the_axis_leave_the_gain_without_a_peak(
        omega in 1e-2..1e3f64, power in 1..=2usize, lag in 0.1..10.0f64, ratio in 0.01..1.0f64, in_servo in any::<bool>(),
        gain in 1e-3..1e3f64,
    ) {
        let denominator = product(&[&swinging(omega, power), &[lag / omega, 1.0]]);
        let other = product(&[&[1.0, 2.0 * ratio * omega, omega * omega]]);
        let (resonant, damped) = (function(&[gain], &denominator), function(&[omega * omega], &other));
        let (g_h, c_h1) = if in_servo { (resonant, damped) } else { (damped, resonant) };
        let found = analysed(&through_arm(g_h, c_h1, &[0.1, 1.0]));
        prop_assert_eq!(found.small_gain_peak, None);
        prop_assert!(!found.small_gain_holds);
    }

    /// `k (s² + z²)^m / (s (s + a)(s + b))` is real at `ω² = a b`, where it is `-k (z² - a b)^m / (a b (a + b))`, and
    /// at its zeros, where no gain takes it to -1.
    #[test]
    fn zeros_on_the_axis_are_no_phase_crossovers(
        z in 1e-2..1e2f64, power in 1..=2usize, a in 1e-2..1e2f64, b in 1e-2..1e2f64, gain in 1e-3..1e3f64,
        in_arm in any::<bool>(),
    ) {
        let apart = z * z - a * b;
        prop_assume!(1e-3 < (apart / (a * b)).abs());
        let zeros = swinging(z, power);
        let poles = product(&[&[1.0, 0.0], &[1.0, a], &[1.0, b]]);
        let input = if in_arm {
            through_arm(one(), function(&[gain], &poles), &zeros)
        } else {
            through_arm(function(&zeros, &poles), function(&[gain], &[1.0]), &[1.0])
        };
        let found = analysed(&input).classical;
        let factor = a * b * (a + b) / (gain * apart.powi(power as i32));
        prop_assume!(1e-6 < (factor - 1.0).abs());
        let (more, less) = (found.gain_increase, found.gain_decrease);
        // L ends at infinity like k s for m = 2, like k/s for m = 1: never on the negative axis.
        let wanted = if factor < 0.0 { (None, None) } else if 1.0 < factor { (Some(factor), None) } else { (None, Some(factor)) };
        let agrees = |got: Option<f64>, wanted: Option<f64>| match (got, wanted) {
            (None, None) => true,
            (Some(got), Some(wanted)) => (got / wanted - 1.0).abs() < 1e-6,
            _ => false,
        };
        prop_assert!(
            agrees(more.map(|m| m.factor), wanted.0) && agrees(less.map(|m| m.factor), wanted.1),
            "{more:?} {less:?}, wanted {wanted:?}"
        );
    }

    /// `k / ((s² + p²)^m (s + a))`: the curve is real at rest only, above zero; it turns by half at its poles without
    /// meeting the negative axis.
    #[test]
    fn poles_on_the_axis_are_no_phase_crossovers(
        p in 1e-2..1e2f64, power in 1..=2usize, a in 1e-2..1e2f64, gain in 1e-3..1e3f64,
    ) {
        let poles = product(&[&swinging(p, power), &[1.0, a]]);
        let found = analysed(&through_arm(one(), function(&[gain], &poles), &[1.0])).classical;
        prop_assert_eq!((found.gain_increase, found.gain_decrease), (None, None));
    }

    /// A mode on the axis that one part hides from another: the curve is that of the loop without it; the poles tell of
    /// it, and the loop is not stable.
    #[test]
    fn a_hidden_mode_on_the_axis_leaves_the_curve_alone(
        omega in 1e-1..1e2f64, power in 1..=2usize, mass in 0.1..2.0f64, damping in 1.0..20.0f64, servo in 1.0..100.0f64,
        in_arm in any::<bool>(),
    ) {
        let hidden = swinging(omega, power);
        let lag = [1.0 / (servo * servo), 1.0 / servo, 1.0];
        let c_h1 = function(&[1.0], &[mass, damping, 5.0]);
        let arm = [1.0, 3.0];
        let without = analysed(&through_arm(function(&[3.0], &lag), c_h1.clone(), &arm));
        let with = if in_arm {
            let poles = product(&[&hidden, &lag]);
            through_arm(function(&[3.0], &poles), c_h1, &product(&[&hidden, &arm]))
        } else {
            let poles = product(&[&hidden, &[mass, damping, 5.0]]);
            let zeros = product(&[&hidden, &[3.0]]);
            through_arm(function(&zeros, &lag), function(&[1.0], &poles), &arm)
        };
        let with = analysed(&with);
        prop_assert!(!with.stable_without_delay);
        let close = |got: f64, wanted: f64| (got - wanted).abs() <= 1e-6 * wanted.abs();
        prop_assert!(close(with.small_gain_peak.unwrap(), without.small_gain_peak.unwrap()));
        prop_assert!(close(with.nyquist_min_distance, without.nyquist_min_distance));
        match (with.classical.phase, without.classical.phase) {
            (None, None) => {}
            (Some(with), Some(without)) => {
                prop_assert!(close(with.omega_rad_s, without.omega_rad_s) && close(with.phase_rad, without.phase_rad));
            }
            others => prop_assert!(false, "{others:?}"),
        }
        match (with.classical.gain_increase, without.classical.gain_increase) {
            (None, None) => {}
            (Some(with), Some(without)) => prop_assert!(close(with.factor, without.factor)),
            others => prop_assert!(false, "{others:?}"),
        }
        let highest = |analysis: &LoopAnalysis| {
            let points = analysis.curve.re.iter().zip(&analysis.curve.im);
            points.map(|(re, im)| re.hypot(*im)).fold(0.0, f64::max)
        };
        prop_assert!(highest(&with) <= without.small_gain_peak.unwrap() * (1.0 + 1e-6));
    }
}
