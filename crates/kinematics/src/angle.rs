//! Angles of several directions at once.
//!
//! The inverse kinematics need six arc tangents. Here they are plain arithmetic without a branch, so that the processor
//! works on them side by side, which a call per angle forbids; and the same bits come out on every target, which a
//! mathematical library does not promise.
//!
//! With `a <= b` the two magnitudes: `atan(a/b)` directly up to `tan(pi/8)`, else `pi/4 - atan((b-a)/(b+a))`, so that
//! the argument `u` stays below 0.4143 and `atan(u)/u` is a short polynomial in `u²`.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Tangent of 22.5 degrees, `sqrt(2) - 1`.
const TAN_PI_8: f64 = 0.414_213_562_373_095_03;

/// `(atan(u)/u - 1) / u²` in powers of `u²` over `0 <= u² <= tan²(pi/8)`: interpolated at Chebyshev nodes in 50 digits;
/// relative error of the arc tangent below 5e-18, so only rounding remains.
const COEFFICIENTS: [f64; 11] = [
    -0.333_333_333_333_333_3,
    0.199_999_999_999_955_2,
    -0.142_857_142_846_665_34,
    0.111_111_110_152_556_69,
    -0.090_909_045_780_957_35,
    0.076_921_831_901_717_28,
    -0.066_645_114_381_646_44,
    0.058_581_488_327_312_73,
    -0.050_854_493_189_300_35,
    0.039_231_646_190_551_486,
    -0.019_176_872_294_336_067,
];

/// `atan2(y_i, x_i)` of each pair, within 2e-15 rad. NaN where both are zero.
#[inline]
pub(crate) fn directions<const N: usize>(y: &[f64; N], x: &[f64; N]) -> [f64; N] {
    // One short loop per stage rather than one long loop over pairs: this is the form that becomes vector instructions.
    let (mut a, mut b) = ([0.0; N], [0.0; N]);
    for i in 0..N {
        let (height, width) = (y[i].abs(), x[i].abs());
        a[i] = if height < width { height } else { width };
        b[i] = if height < width { width } else { height };
    }
    let mut u = [0.0; N];
    for i in 0..N {
        let diagonal = TAN_PI_8 * b[i] < a[i];
        let above = if diagonal { a[i] - b[i] } else { a[i] };
        let below = if diagonal { a[i] + b[i] } else { b[i] };
        u[i] = above / below;
    }
    let mut angles = [0.0; N];
    for i in 0..N {
        angles[i] = arc_tangent(u[i]);
    }
    for i in 0..N {
        let start = if TAN_PI_8 * b[i] < a[i] {
            FRAC_PI_4
        } else {
            0.0
        };
        angles[i] += start;
    }
    for i in 0..N {
        let complement = FRAC_PI_2 - angles[i];
        angles[i] = if y[i].abs() < x[i].abs() {
            angles[i]
        } else {
            complement
        };
    }
    for i in 0..N {
        let supplement = PI - angles[i];
        angles[i] = if x[i] < 0.0 { supplement } else { angles[i] };
    }
    for i in 0..N {
        angles[i] = angles[i].copysign(y[i]);
    }
    angles
}

/// For `|u| <= tan(pi/8)`.
#[inline(always)]
fn arc_tangent(u: f64) -> f64 {
    let c = &COEFFICIENTS;
    let w = u * u;
    // Estrin's order: halves are worked out side by side.
    let w2 = w * w;
    let w4 = w2 * w2;
    let low = (c[0] + c[1] * w) + (c[2] + c[3] * w) * w2;
    let middle = (c[4] + c[5] * w) + (c[6] + c[7] * w) * w2;
    let high = (c[8] + c[9] * w) + c[10] * w2;
    u + u * w * (low + (middle + high * w4) * w4)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        /// Against the platform's own arc tangent, near the axes and the diagonals as well.
        #[test]
        fn agrees_with_the_library(angle in -PI..PI, radius in 1e-9..1e3f64, near in prop_oneof![Just(0.0), -1e-9..1e-9]) {
            let snapped = (angle / FRAC_PI_4).round() * FRAC_PI_4 + near;
            for angle in [angle, snapped] {
                let (y, x) = (radius * angle.sin(), radius * angle.cos());
                let [got] = directions(&[y], &[x]);
                prop_assert!((got - y.atan2(x)).abs() <= 2e-15, "{y} {x}: {got}, {}", y.atan2(x));
            }
        }
    }

    #[test]
    fn axes_are_exact_or_nearly() {
        let got = directions(&[0.0, 1.0, 0.0, -1.0], &[1.0, 0.0, -1.0, 0.0]);
        for (got, wanted) in got.iter().zip([0.0, FRAC_PI_2, PI, -FRAC_PI_2]) {
            assert!((got - wanted).abs() < 1e-15);
        }
    }
}
