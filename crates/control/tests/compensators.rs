//! Compensators (30)–(32): what they are for, and when they are refused.

use proptest::prelude::*;
use teleclay_control::compensators::{Compensator, CompensatorError, Sides, compensators};
use teleclay_control::{Complex, RationalFunction, paper};

fn sides() -> Sides {
    Sides {
        g_h: paper::g_hx(),
        s_h: RationalFunction::zero(),
        g_t: paper::default_g_t(),
        s_t: RationalFunction::zero(),
        c_h1: paper::default_c_h1(),
        position_ratio: 1.0,
        force_ratio: -1.0,
    }
}

proptest! {
    /// The defining equations, not the formulas: positions follow y_t = A_h1 y_h for any pair of forces (27), and a
    /// handle that stands still under f_t = A_h2 f_h carries the force ratio (29). With give on both sides.
    #[test]
    fn tool_follows_handle_for_any_forces(
        omega in 0.01..300.0, hand in -5.0..5.0, clay in -5.0..5.0, ratio in 0.3..3.0, force_ratio in -3.0..-0.3,
        give_h in 1e-5..1e-3, give_t in 1e-5..1e-3,
    ) {
        let sides = Sides {
            s_h: RationalFunction::new(&[give_h], &[0.01, 0.3, 1.0]).unwrap(),
            s_t: RationalFunction::new(&[give_t], &[0.02, 0.5, 1.0]).unwrap(),
            position_ratio: ratio, force_ratio, ..sides()
        };
        let c = compensators(&sides).unwrap();
        let at = |f: &RationalFunction| f.at_omega(omega).unwrap();
        let positions = |f_h: Complex<f64>, f_t: Complex<f64>| {
            let v_h = at(&c.c_h1) * f_h - at(&c.c_t1) * f_t;
            let v_t = -at(&c.c_h2) * f_h + at(&c.c_t2) * f_t;
            (at(&sides.g_h) * v_h + at(&sides.s_h) * f_h, at(&sides.g_t) * v_t + at(&sides.s_t) * f_t)
        };
        let (y_h, y_t) = positions(Complex::new(hand, 1.0), Complex::new(clay, -0.5));
        prop_assert!((y_t - y_h * ratio).norm() < 1e-10 * (1.0 + y_t.norm()));
        let f_h = Complex::new(hand, 1.0);
        let (held, _) = positions(f_h, f_h * force_ratio);
        let (free, _) = positions(f_h, Complex::new(0.0, 0.0));
        prop_assert!(held.norm() < 1e-10 * (1.0 + free.norm()));
    }
}

/// (25) as printed lost a minus. With it, the tool runs away from the handle: y_t = -A_h1 y_h under hand force alone.
#[test]
fn the_printed_sign_of_25_mirrors_the_tool() {
    let sides = sides();
    let p = sides.admittance().unwrap();
    let printed = p
        .scaled(sides.position_ratio)
        .unwrap()
        .divided_by(&sides.g_t)
        .unwrap();
    let exact = compensators(&sides).unwrap().c_h2;
    let at = |f: &RationalFunction| f.at_omega(3.0).unwrap();
    let (y_h, f_h) = (at(&p) * 2.0, 2.0);
    assert!((-at(&sides.g_t) * at(&exact) * f_h - y_h).norm() < 1e-12 * y_h.norm());
    assert!((-at(&sides.g_t) * at(&printed) * f_h + y_h).norm() < 1e-12 * y_h.norm());
}

#[test]
fn a_compensator_that_would_differentiate_is_refused_by_name() {
    let differentiating = Sides {
        c_h1: RationalFunction::new(&[1.0, 0.0], &[1.0]).unwrap(),
        ..sides()
    };
    assert!(matches!(
        compensators(&differentiating),
        Err(CompensatorError::Improper {
            compensator: Compensator::CH1,
            numerator_degree: 1,
            denominator_degree: 0
        })
    ));
    // A tool of third order needs more roll-off than G_h C_h1 with a constant C_h1 offers.
    let heavy = Sides {
        c_h1: RationalFunction::new(&[1e-3], &[1.0]).unwrap(),
        g_t: RationalFunction::new(&[1.0], &[0.01, 0.5, 20.0, 0.0]).unwrap(),
        ..sides()
    };
    let refused = compensators(&heavy).unwrap_err();
    assert!(matches!(
        refused,
        CompensatorError::Improper {
            compensator: Compensator::CH2,
            ..
        }
    ));
    assert!(
        refused
            .to_string()
            .starts_with("C_h2 is improper: numerator degree 4")
    );
}

#[test]
fn ratios_of_the_wrong_sign_are_refused() {
    for force_ratio in [0.0, 1.0, f64::NAN, f64::NEG_INFINITY] {
        let sides = Sides {
            force_ratio,
            ..sides()
        };
        assert!(matches!(
            compensators(&sides),
            Err(CompensatorError::ForceRatio { .. })
        ));
    }
    let sides = Sides {
        position_ratio: -1.0,
        ..sides()
    };
    assert!(matches!(
        compensators(&sides),
        Err(CompensatorError::PositionRatio { .. })
    ));
}

#[test]
fn a_zero_plant_is_an_error_not_a_division() {
    let sides = Sides {
        g_t: RationalFunction::zero(),
        ..sides()
    };
    assert!(matches!(
        compensators(&sides),
        Err(CompensatorError::Algebra {
            compensator: Compensator::CH2,
            ..
        })
    ));
}
