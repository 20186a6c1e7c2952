//! Roots: right, in pairs, and always with an end.

use cpu_time::ThreadTime;
use proptest::prelude::*;
use std::time::Duration;
use teleclay_control::{Complex, Polynomial, RationalFunction, RootsError, paper};

fn polynomial(coefficients: &[f64]) -> Polynomial {
    Polynomial::new(coefficients).unwrap()
}

/// `|p(z)|` in units of what rounding its coefficients would do there: a few for a root as good as can be had.
fn residual(p: &Polynomial, z: Complex<f64>) -> f64 {
    if z.norm() == 0.0 {
        return if p.roots_at_origin() == 0 {
            f64::INFINITY
        } else {
            0.0
        };
    }
    // Large roots in powers of 1/z, where nothing overflows.
    let mut descending = p.coefficients().to_vec();
    let mut z = z;
    if 1.0 < z.norm() {
        descending.reverse();
        z = z.inv();
    }
    let value = descending
        .iter()
        .fold(Complex::new(0.0, 0.0), |sum, &c| sum * z + c);
    let scale = descending
        .iter()
        .fold(0.0, |sum, c| sum * z.norm() + c.abs());
    value.norm() / (scale * f64::EPSILON * (1.0 + p.degree() as f64))
}

fn assert_roots(p: &Polynomial, roots: &[Complex<f64>]) {
    assert_eq!(roots.len(), p.degree());
    for root in roots {
        assert!(
            residual(p, *root) < 100.0,
            "{root} of {p:?}: residual {}",
            residual(p, *root)
        );
        assert!(
            roots.iter().any(|other| *other == root.conj()),
            "{root} of {p:?} has no mirror image"
        );
    }
    // Vieta, which no single residual implies: the sum of all roots is -a_(n-1)/a_n.
    if 1 < p.coefficients().len() {
        let sum: Complex<f64> = roots.iter().sum();
        let wanted = -p.coefficients()[1] / p.leading();
        let size: f64 = roots.iter().map(|r| r.norm()).sum::<f64>() + wanted.abs();
        assert!(
            (sum - wanted).norm() <= 1e-9 * size,
            "sum {sum}, wanted {wanted}"
        );
    }
}

#[test]
fn shapes_that_trap_the_companion_matrix_are_solved() {
    for n in 2..=24 {
        for constant in [1.0, -1.0, 1e-9, 1e12] {
            let mut coefficients = vec![0.0; n + 1];
            coefficients[0] = 1.0;
            coefficients[n] = constant;
            let p = polynomial(&coefficients);
            let roots = p.roots().unwrap();
            assert_roots(&p, &roots);
            let radius = constant.abs().powf(1.0 / n as f64);
            assert!(
                roots
                    .iter()
                    .all(|r| (r.norm() - radius).abs() < 1e-13 * radius)
            );
        }
    }
}

#[test]
fn known_roots_come_back() {
    // (s+1)(s+2)…(s+8): ill-conditioned enough to notice a careless method.
    let p = (1..=8).fold(Polynomial::one(), |p, k| {
        p.times(&polynomial(&[1.0, f64::from(k)])).unwrap()
    });
    for (root, wanted) in p.roots().unwrap().iter().zip((1..=8).rev()) {
        assert!(
            (root - Complex::from(-f64::from(wanted))).norm() < 1e-8,
            "{root}"
        );
    }
    let servo = paper::g_hx().denominator().roots().unwrap();
    assert!(
        (servo[2].re + 0.055_623_7).abs() < 1e-6
            && servo[0].im < 0.0
            && servo[0] == servo[1].conj()
    );
}

#[test]
fn roots_many_decades_apart_are_all_found() {
    let decades = [-9, -5, -2, 0, 3, 8, 12];
    let p = decades.iter().fold(Polynomial::one(), |p, &decade| {
        p.times(&polynomial(&[1.0, 10.0_f64.powi(decade)])).unwrap()
    });
    for (root, decade) in p.roots().unwrap().iter().zip(decades.iter().rev()) {
        let wanted = -10.0_f64.powi(*decade);
        assert!(
            ((root.re - wanted) / wanted).abs() < 1e-12 && root.im == 0.0,
            "{root}, wanted {wanted}"
        );
    }
}

#[test]
fn roots_at_the_origin_are_exact() {
    let roots = polynomial(&[1.0, 3.0, 0.0, 0.0]).roots().unwrap();
    assert_eq!(
        roots,
        [
            Complex::new(-3.0, 0.0),
            Complex::new(0.0, 0.0),
            Complex::new(0.0, 0.0)
        ]
    );
}

#[test]
fn what_has_no_answer_says_so() {
    assert_eq!(Polynomial::zero().roots(), Err(RootsError::ZeroPolynomial));
    assert!(Polynomial::one().roots().unwrap().is_empty());
    assert_eq!(
        polynomial(&[1e-300, 1e300, 1e-300]).roots(),
        Err(RootsError::OutOfRange)
    );
    assert_eq!(
        polynomial(&[1e-300, 1e300]).roots(),
        Err(RootsError::OutOfRange)
    );
}

#[test]
fn the_verdict_knows_the_axis() {
    let stable = |coefficients: &[f64]| polynomial(coefficients).is_hurwitz().unwrap();
    assert!(stable(&[1.0, 2.0, 1.0]) && stable(&[1.0, 1e-9, 1.0]) && stable(&[3.0]));
    assert!(!stable(&[1.0, 0.0, 1.0]) && !stable(&[1.0, 1.0, 0.0]) && !stable(&[1.0, -1.0]));
    // (s² + 1)(s + 3) and (s² + 7)² (s + 1/3): exactly marginal, and no rounding may call them stable.
    assert!(!stable(&[1.0, 3.0, 1.0, 3.0]));
    let twice = polynomial(&[1.0, 0.0, 7.0])
        .times(&polynomial(&[1.0, 0.0, 7.0]))
        .unwrap();
    assert!(
        !twice
            .times(&polynomial(&[1.0, 1.0 / 3.0]))
            .unwrap()
            .is_hurwitz()
            .unwrap()
    );
    // Eight equal roots scatter widely, and yet all of them stay left.
    let eightfold = (0..8).fold(Polynomial::one(), |p, _| {
        p.times(&polynomial(&[1.0, 1.0])).unwrap()
    });
    assert!(eightfold.is_hurwitz().unwrap());
}

/// Hermite–Biehler as an oracle of another kind: even and odd part of a stable polynomial have real, interlacing zeros
/// in `s²`. Routh's table is its arithmetic form.
fn routh_is_stable(coefficients: &[f64]) -> bool {
    let sign = coefficients[0].signum();
    let mut upper: Vec<f64> = coefficients.iter().step_by(2).map(|c| c * sign).collect();
    let mut lower: Vec<f64> = coefficients
        .iter()
        .skip(1)
        .step_by(2)
        .map(|c| c * sign)
        .collect();
    while !lower.is_empty() {
        if lower[0] <= 0.0 {
            return false;
        }
        let ratio = upper[0] / lower[0];
        let next = (1..upper.len())
            .map(|i| upper[i] - ratio * lower.get(i).copied().unwrap_or(0.0))
            .collect();
        (upper, lower) = (lower, next);
    }
    0.0 < upper[0]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    /// Any user's polynomial: an answer that is right, within 50 ms.
    #[test]
    fn every_polynomial_is_answered_in_time(
        mantissas in proptest::collection::vec(prop_oneof![3 => -1.0..1.0, 1 => Just(0.0), 1 => Just(1.0)], 1..=25),
        decades in proptest::collection::vec(-12..12i32, 25),
    ) {
        let coefficients: Vec<f64> = mantissas.iter().zip(decades).map(|(m, d)| m * 10.0_f64.powi(d)).collect();
        let p = polynomial(&coefficients);
        let before = ThreadTime::now();
        let outcome = p.roots();
        prop_assert!(before.elapsed() < Duration::from_millis(50));
        match outcome {
            Ok(roots) => assert_roots(&p, &roots),
            Err(error) => prop_assert!(p.is_zero() && error == RootsError::ZeroPolynomial, "{error} for {coefficients:?}"),
        }
    }

    /// The verdict agrees with Routh's table, which never looks at a root.
    #[test]
    fn verdict_agrees_with_routh(
        reals in proptest::collection::vec(-5.0..1.0, 0..4), pairs in proptest::collection::vec((-5.0..1.0, 0.1..10.0), 0..4),
    ) {
        let factors = reals.iter().map(|r: &f64| vec![1.0, -r])
            .chain(pairs.iter().map(|(re, im): &(f64, f64)| vec![1.0, -2.0 * re, re * re + im * im]));
        let p = factors.fold(Polynomial::one(), |p, f| p.times(&polynomial(&f)).unwrap());
        let nearest = reals.iter().chain(pairs.iter().map(|(re, _)| re)).fold(f64::INFINITY, |n, re| n.min(re.abs()));
        prop_assume!(1e-3 < nearest);
        prop_assert_eq!(p.is_hurwitz().unwrap(), routh_is_stable(p.coefficients()));
    }
}

/// On the way to these roots two candidates come within rounding of each other. What pushes them apart then makes the
/// step of one of them vanish, which is no sign of a root.
#[test]
fn a_candidate_that_a_neighbour_pins_down_is_not_taken_for_a_root() {
    let p = polynomial(&[
        21600799996.58693,
        1e6,
        5.188070283922556,
        1e6,
        0.0005447995139039054,
        1.0,
        -6.0438261509885246e-6,
        1e-6,
        -7436456.232034035,
        1e11,
        -57283027.7070825,
        502615123.8061707,
        1e11,
        -685345.3569922516,
        53581.86159683474,
        3.7473409762552325,
        0.0,
        -4.792059879109159e-7,
        -6056.180173667702,
        1e11,
        9.647170966554577e-8,
        0.6223045496759456,
    ]);
    assert_roots(&p, &p.roots().unwrap());
}

#[test]
fn repeated_roots_up_to_the_cap_end_in_time() {
    for n in 1..=24 {
        let p = (0..n).fold(Polynomial::one(), |p, _| {
            p.times(&polynomial(&[1.0, 0.7])).unwrap()
        });
        let before = ThreadTime::now();
        let roots = p.roots().unwrap();
        assert!(before.elapsed() < Duration::from_millis(50));
        // An n-fold root is uncertain by the n-th root of rounding.
        let spread = 4.0 * (f64::EPSILON * 25.0).powf(1.0 / f64::from(n));
        assert!(
            roots.iter().all(|r| (r + 0.7).norm() < spread),
            "{n}: {roots:?}"
        );
    }
}

#[test]
fn only_harmless_common_factors_are_cancelled() {
    // (s+2)(s+5) / ((s+2)(s+3)): the pair at -2 goes.
    let f = RationalFunction::new(&[1.0, 7.0, 10.0], &[1.0, 5.0, 6.0])
        .unwrap()
        .reduced()
        .unwrap();
    assert_eq!((f.numerator().degree(), f.denominator().degree()), (1, 1));
    let close = |got: f64, wanted: f64| (got - wanted).abs() < 1e-12;
    assert!(
        close(f.numerator().coefficients()[1], 5.0)
            && close(f.denominator().coefficients()[1], 3.0)
    );
    // (s-2) / (s-2)(s+1): what is hidden grows; it stays in sight.
    let unstable = RationalFunction::new(&[1.0, -2.0], &[1.0, -1.0, -2.0]).unwrap();
    assert_eq!(unstable.reduced().unwrap(), unstable);
    // s / (s² + s): exact zeros go exactly.
    let origin = RationalFunction::new(&[1.0, 0.0], &[1.0, 1.0, 0.0])
        .unwrap()
        .reduced()
        .unwrap();
    assert_eq!(origin, RationalFunction::new(&[1.0], &[1.0, 1.0]).unwrap());
}

proptest! {
    /// Cancelling never changes a value.
    #[test]
    fn reduction_keeps_the_values(
        shared in -5.0..-0.1, zero in -5.0..5.0, poles in proptest::collection::vec(-5.0..-0.1, 1..4), omega in 0.01..100.0,
    ) {
        let factor = |root: f64| polynomial(&[1.0, -root]);
        let numerator = factor(shared).times(&factor(zero)).unwrap();
        let denominator = poles.iter().fold(factor(shared), |p, r| p.times(&factor(*r)).unwrap());
        let full = RationalFunction::from_parts(numerator, denominator).unwrap();
        let reduced = full.reduced().unwrap();
        prop_assert!(reduced.denominator().degree() <= full.denominator().degree());
        let (a, b) = (full.at_omega(omega).unwrap(), reduced.at_omega(omega).unwrap());
        prop_assert!((a - b).norm() <= 1e-8 * a.norm());
    }
}
