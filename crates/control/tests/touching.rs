//! Curves that touch: the unit circle at rest, at a frequency, at infinity; the negative real axis. Each loop is built
//! around its point of contact, so its margins are known in closed form.

use proptest::prelude::*;
use std::f64::consts::{PI, TAU};
use teleclay_control::analysis::{LoopAnalysis, LoopInput, analyse};
use teleclay_control::compensators::Sides;
use teleclay_control::{Complex, DelayMargin, Polynomial, RationalFunction, delay_margin};

fn one() -> RationalFunction {
    RationalFunction::new(&[1.0], &[1.0]).unwrap()
}

fn polynomial(coefficients: &[f64]) -> Polynomial {
    Polynomial::new(coefficients).unwrap()
}

fn product(factors: impl IntoIterator<Item = Vec<f64>>) -> Polynomial {
    factors
        .into_iter()
        .fold(Polynomial::one(), |p, f| p.times(&polynomial(&f)).unwrap())
}

/// A loop through the clay's stiffness alone: `L = stiffness · c_h1 · g_h`.
fn through_clay(g_h: RationalFunction, c_h1: RationalFunction, stiffness: f64) -> LoopInput {
    LoopInput {
        sides: Sides {
            g_h,
            s_h: RationalFunction::zero(),
            g_t: one(),
            s_t: RationalFunction::zero(),
            c_h1,
            position_ratio: 1.0,
            force_ratio: -1.0,
        },
        t_h: Polynomial::zero(),
        clay_damping_n_s_per_m: 0.0,
        clay_stiffness_n_per_m: stiffness,
        omegas_rad_s: Vec::new(),
    }
}

fn constant(value: f64) -> RationalFunction {
    RationalFunction::new(&[value], &[1.0]).unwrap()
}

/// Denominator of a Butterworth filter with the corner at `a`: `|p(jω)|² = a^2n + ω^2n`.
fn butterworth(order: u32, a: f64) -> Polynomial {
    let pairs = (0..order / 2).map(|k| {
        let angle = PI * f64::from(2 * k + 1) / f64::from(2 * order);
        vec![1.0, 2.0 * a * angle.sin(), a * a]
    });
    let single = (order % 2 == 1).then(|| vec![1.0, a]);
    product(pairs.chain(single))
}

/// A filter of magnitude 1 at every frequency: zeros are the mirror images of the poles.
fn allpass(pairs: &[(f64, f64)]) -> RationalFunction {
    let factor = |sign: f64| {
        product(
            pairs
                .iter()
                .map(|&(omega, ratio)| vec![1.0, sign * 2.0 * ratio * omega, omega * omega]),
        )
    };
    RationalFunction::from_parts(factor(-1.0), factor(1.0)).unwrap()
}

fn pairs(most: usize) -> impl Strategy<Value = Vec<(f64, f64)>> {
    let pair = (-1.0..3.0f64, 0.05..1.5f64).prop_map(|(decade, ratio)| (10f64.powf(decade), ratio));
    proptest::collection::vec(pair, 0..=most)
}

fn analysed(input: &LoopInput) -> LoopAnalysis {
    analyse(input).unwrap()
}

/// A third-order Butterworth filter of 100 rad/s as the handle's servo: `|L|² = 1 / (1 + (ω/100)⁶)`, and `L(0) = 1`.
#[test]
fn a_curve_that_leaves_the_unit_circle_at_rest_has_no_crossover() {
    let g_h = RationalFunction::new(&[1e6], &[1.0, 200.0, 2e4, 1e6]).unwrap();
    let found = analysed(&through_clay(g_h, constant(0.002), 500.0));
    assert!(found.stable_without_delay);
    assert_eq!(found.classical.phase, None);
    assert_eq!(found.delay_margin_position_force, DelayMargin::Unbounded);
    assert_eq!(found.delay_margin_force_exchange, DelayMargin::Unbounded);
    assert!(!found.small_gain_holds, "its peak is 1, at rest");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// `|L|² = 1 / (1 + (ω/a)^2n)` below 1 at every frequency above 0, whatever turns its phase.
    #[test]
    fn a_low_pass_of_gain_1_bears_every_delay(
        order in 1..=6u32, decade in -1.0..3.0f64, share in 1e-3..1e3f64, turn in pairs(2),
    ) {
        let a = 10f64.powf(decade);
        let low_pass = butterworth(order, a);
        let numerator = polynomial(&[low_pass.lowest()]);
        let g_h = RationalFunction::from_parts(numerator, low_pass).unwrap();
        let c_h1 = allpass(&turn).scaled(share).unwrap();
        let found = analysed(&through_clay(g_h, c_h1, 1.0 / share));
        // Where the phase turns far below the corner, the curve comes to -1 as near as rounding can tell.
        prop_assume!(1e-9 < found.nyquist_min_distance);
        prop_assert!(found.stable_without_delay);
        prop_assert_eq!(found.classical.phase, None);
        prop_assert_eq!(found.delay_margin_position_force, DelayMargin::Unbounded);
        prop_assert!(!found.small_gain_holds);
    }

    /// The same filter with a gain a little above 1 has a crossover, where `(ω/a)^2n = gain² - 1`.
    #[test]
    fn a_low_pass_of_gain_above_1_crosses_where_it_should(
        order in 1..=6u32, decade in -1.0..3.0f64, excess in -9.0..-1.0f64,
    ) {
        let (a, excess) = (10f64.powf(decade), 10f64.powf(excess));
        let low_pass = butterworth(order, a);
        let numerator = polynomial(&[low_pass.lowest()]);
        let g_h = RationalFunction::from_parts(numerator, low_pass).unwrap();
        let found = analysed(&through_clay(g_h.clone(), constant(1.0 + excess), 1.0));
        let omega = a * (excess * (2.0 + excess)).powf(0.5 / f64::from(order));
        let phase = found.classical.phase.expect("it crosses");
        prop_assert!((phase.omega_rad_s / omega - 1.0).abs() < 1e-5, "{phase:?}, wanted {omega}");
        let lag = -g_h.at_omega(omega).unwrap().arg();
        let seconds = (PI - lag).rem_euclid(TAU) / omega;
        if found.stable_without_delay {
            let got = found.delay_margin_position_force.seconds().expect("it has a margin");
            prop_assert!((got / seconds - 1.0).abs() < 1e-4, "{got}, wanted {seconds}");
        }
    }

    /// `|L|² = (ω/a)^2n / (1 + (ω/a)^2n)` comes to 1 at infinite frequency only. The curve crosses nothing; a delay
    /// leaves an unending row of roots that come as near to the axis as one likes, so it bears none.
    #[test]
    fn a_high_pass_of_gain_1_has_no_crossover_and_bears_no_delay(
        order in 1..=6u32, decade in -1.0..3.0f64, share in 1e-3..1e3f64, turn in pairs(2),
    ) {
        let high_pass = butterworth(order, 10f64.powf(decade));
        let mut numerator = vec![0.0; order as usize + 1];
        numerator[0] = 1.0;
        let g_h = RationalFunction::from_parts(polynomial(&numerator), high_pass).unwrap();
        let c_h1 = allpass(&turn).scaled(share).unwrap();
        let found = analysed(&through_clay(g_h, c_h1, 1.0 / share));
        prop_assume!(1e-9 < found.nyquist_min_distance);
        prop_assert!(found.stable_without_delay);
        prop_assert_eq!(found.classical.phase, None);
        prop_assert_eq!(found.delay_margin_position_force.seconds(), Some(0.0));
        prop_assert!(!found.small_gain_holds);
    }

    /// A band-pass touches the circle at its centre: `Ω = (ω² - c²) / (b ω)`, `|L|² = 1 / (1 + Ω^2n)`. There, and only
    /// there, a turn or a delay brings the curve to -1 and a root onto the axis.
    #[test]
    fn a_band_pass_of_gain_1_meets_minus_one_at_its_centre(
        order in 1..=2u32, decade in -1.0..3.0f64, width in 0.1..2.0f64, share in 1e-3..1e3f64, turn in pairs(2),
    ) {
        let c = 10f64.powf(decade);
        let b = width * c;
        // s -> (s² + c²) / (b s) in the low-pass of order 1 or 2.
        let band = polynomial(&[1.0, 0.0, c * c]);
        let swing = polynomial(&[b, 0.0]);
        let (numerator, denominator) = if order == 1 {
            (swing.clone(), band.plus(&swing).unwrap())
        } else {
            let square = |p: &Polynomial| p.times(p).unwrap();
            let middle = band.times(&swing).unwrap().scaled(2f64.sqrt()).unwrap();
            (square(&swing), square(&band).plus(&middle).unwrap().plus(&square(&swing)).unwrap())
        };
        let g_h = RationalFunction::from_parts(numerator, denominator).unwrap();
        let turn = allpass(&turn);
        let at_centre = turn.at_omega(c).unwrap();
        // A loop that touches -1 itself is no loop to speak of.
        prop_assume!(1e-2 < (at_centre + 1.0).norm());
        let found = analysed(&through_clay(g_h, turn.scaled(share).unwrap(), 1.0 / share));
        prop_assert!(found.stable_without_delay);
        // Rounding smears a contact of multiplicity 2n over its 2n-th root.
        let place = [1e-6, 1e-4][order as usize - 1];
        let phase = found.classical.phase.expect("it touches");
        prop_assert!((phase.omega_rad_s / c - 1.0).abs() < place, "{phase:?}, wanted {c}");
        let wanted = (-at_centre).arg();
        prop_assert!(phase_difference(phase.phase_rad, wanted) < 100.0 * place, "{phase:?}, wanted {wanted}");
        let seconds = (-at_centre).arg().rem_euclid(TAU) / c;
        let got = found.delay_margin_position_force.seconds().expect("it has a margin");
        prop_assert!((got - seconds).abs() < 100.0 * place / c, "{got}, wanted {seconds}");
    }

    /// `D = s (s² + c²)² + e(s²)` is real at `j c`, and its imaginary part only touches zero there. So `k / D` touches
    /// the negative real axis, and the gain that takes it to -1 puts a root on the axis.
    #[test]
    fn a_curve_that_touches_the_negative_axis_has_its_gain_margin_there(
        decade in -1.0..2.0f64, height in 0.1..10.0f64, depth in 1.2..3.0f64, gain in 0.01..100.0f64,
    ) {
        prop_assume!(1e-3 < (gain * height - 1.0).abs());
        let c = 10f64.powf(decade);
        // e(s²) = h c⁵ (1 + depth s²/c²) with depth above 1: below zero at j c.
        let scale = c.powi(5) / height / (depth - 1.0);
        let odd = product([vec![1.0, 0.0, c * c], vec![1.0, 0.0, c * c], vec![1.0, 0.0]]);
        let even = polynomial(&[scale * depth / (c * c), 0.0, scale]);
        let denominator = odd.plus(&even).unwrap();
        let numerator = polynomial(&[gain * c.powi(5)]);
        let g_h = RationalFunction::from_parts(numerator, denominator).unwrap();
        let found = analysed(&through_clay(g_h, one(), 1.0)).classical;
        let wanted = 1.0 / (gain * height);
        let (there, other) = if 1.0 <= wanted {
            (found.gain_increase, found.gain_decrease)
        } else {
            (found.gain_decrease, found.gain_increase)
        };
        let margin = there.expect("it touches");
        prop_assert!((margin.factor / wanted - 1.0).abs() < 1e-6, "{margin:?}, wanted {wanted}");
        prop_assert!((margin.omega_rad_s / c - 1.0).abs() < 1e-6, "{margin:?}, wanted {c}");
        prop_assert_eq!(other, None);
    }

    /// Two integrators: the curve comes out of infinity along the negative real axis, from which it parts by a power of
    /// the frequency that soon is below rounding. It never meets the axis.
    #[test]
    fn a_curve_that_comes_along_the_negative_axis_has_no_gain_margin(
        power in 1..=5usize, decade in -1.0..2.0f64, gain in 1e-3..1e3f64,
    ) {
        // Im (1 + (s/a)^n) has one sign for odd n: n = 1, 3, 5 with either sign.
        let power = 2 * (power / 2) + 1;
        let a = 10f64.powf(decade);
        let mut denominator = vec![0.0; power + 3];
        denominator[0] = a.powi(-(power as i32));
        denominator[power] = 1.0;
        let g_h = RationalFunction::new(&[gain], &denominator).unwrap();
        let found = analysed(&through_clay(g_h, one(), 1.0)).classical;
        prop_assert_eq!((found.gain_increase, found.gain_decrease), (None, None));
    }

    /// `A + B exp(-s d)` with `|B/A|² = 1/(1 + (ω/a)^2n)`: stable at every delay, whatever rounding does to the pair.
    #[test]
    fn a_delayed_part_that_only_starts_as_large_as_the_rest_bears_every_delay(
        order in 1..=8u32, decade in -2.0..3.0f64, factor in 0.1..10.0f64,
    ) {
        let low_pass = butterworth(order, 10f64.powf(decade));
        let a = low_pass.scaled(factor).unwrap();
        let b = polynomial(&[low_pass.lowest() * factor]);
        prop_assert_eq!(delay_margin(&a, &b).unwrap(), DelayMargin::Unbounded);
    }
}

fn phase_difference(a: f64, b: f64) -> f64 {
    Complex::from_polar(1.0, a - b).arg().abs()
}

/// With an integrator in `C_h1`, `(1 + E)(1 + H)` and `H E` are equal at rest. Where the latter is smaller at every
/// frequency above, force exchange bears every delay.
#[test]
fn force_exchange_with_an_integrator_starts_at_1_and_bears_every_delay() {
    for (mass, damping, arm, clay) in [
        (1.0, 10.0, 6.0, 60.0),
        (0.3, 7.0, 1.0, 1e3),
        (0.1, 3.0, 0.7, 0.1),
        (2.0, 30.0, 1e-3, 1e-3),
    ] {
        let c_h1 = RationalFunction::new(&[1.0], &[mass, damping, 0.0]).unwrap();
        let input = LoopInput {
            t_h: polynomial(&[0.1 * arm, arm]),
            clay_damping_n_s_per_m: 0.3 * clay,
            ..through_clay(one(), c_h1, clay)
        };
        let found = analysed(&input);
        assert!(found.stable_without_delay);
        // (1+E)(1+H) / (H E) - 1 = D C / (N_E N_H), and |1 + q| is above 1 at every frequency of this grid.
        let above = (-400..=600).all(|k| {
            let s = Complex::new(0.0, 10f64.powf(f64::from(k) / 100.0));
            let d = s * (s * mass + damping);
            let (h, e) = (s * 0.1 * arm + arm, s * 0.3 * clay + clay);
            let q = d * (d + h + e) / (h * e);
            0.0 < q.norm_sqr() + 2.0 * q.re
        });
        assert_eq!(
            found.delay_margin_force_exchange == DelayMargin::Unbounded,
            above,
            "{mass} {damping} {arm} {clay}: {:?}",
            found.delay_margin_force_exchange
        );
    }
}
