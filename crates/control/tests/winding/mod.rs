//! Counts roots without looking for any: the argument principle.

use std::f64::consts::{PI, TAU};
use teleclay_control::Complex;

/// Roots of `f` right of the line `Re s = shift`, inside a large half disc: the winding number of `f` around it, by
/// following its phase in small steps.
pub(crate) fn roots_right_of(
    f: impl Fn(Complex<f64>) -> Complex<f64>,
    shift: f64,
    radius: f64,
) -> i32 {
    const STEPS: usize = 400_000;
    let along_line = |t: f64| {
        Complex::new(
            shift,
            -radius * t.signum() * ((t.abs() * (1.0 + radius).ln()).exp_m1() / radius),
        )
    };
    let along_arc = |angle: f64| Complex::new(shift, 0.0) + Complex::from_polar(radius, angle);
    let mut turned = 0.0;
    let mut before = f(along_arc(-PI / 2.0));
    let mut follow = |s: Complex<f64>| {
        let now = f(s);
        turned += (now / before).arg();
        before = now;
    };
    for step in 1..=STEPS {
        follow(along_arc(-PI / 2.0 + PI * step as f64 / STEPS as f64));
    }
    for step in 1..=STEPS {
        follow(along_line(-1.0 + 2.0 * step as f64 / STEPS as f64));
    }
    (turned / TAU).round() as i32
}
