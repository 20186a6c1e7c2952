//! The normal distribution.

use std::f64::consts::PI;

/// From here on the continued fraction of the tail has converged to the last digits, and the series has long terms.
const TAIL_FROM: f64 = 3.0;
/// Terms of the fraction: at [`TAIL_FROM`] twice as many change nothing.
const TAIL_TERMS: u32 = 80;

/// Density at `z`.
pub fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

/// Share of the distribution below `z`: a power series in the middle, Laplace's continued fraction in the tails.
///
/// ```
/// assert!((teleclay_study::normal::cumulative(1.959_963_984_540_054) - 0.975).abs() < 1e-15);
/// ```
pub fn cumulative(z: f64) -> f64 {
    if z.abs() < TAIL_FROM {
        let (mut term, mut sum, mut odd) = (z, z, 1.0);
        while 1e-17 * sum.abs() < term.abs() {
            odd += 2.0;
            term *= z * z / odd;
            sum += term;
        }
        return 0.5 + density(z) * sum;
    }
    let above = z.abs();
    let fraction = (1..=TAIL_TERMS)
        .rev()
        .fold(above, |rest, term| above + f64::from(term) / rest);
    let tail = density(above) / fraction;
    if z < 0.0 { tail } else { 1.0 - tail }
}

/// Where the share below is `share`, between 0 and 1; infinite at both ends.
pub fn quantile(share: f64) -> f64 {
    if share <= 0.0 {
        return f64::NEG_INFINITY;
    }
    if 1.0 <= share {
        return f64::INFINITY;
    }
    // Beyond 40 the density of f64 is zero.
    let (mut least, mut most) = (-40.0, 40.0);
    for _ in 0..200 {
        let middle = 0.5 * (least + most);
        if cumulative(middle) < share {
            least = middle;
        } else {
            most = middle;
        }
    }
    0.5 * (least + most)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Abramowitz and Stegun, table 26.1, and the tail by an integral that was done with more digits.
    #[test]
    fn shares_are_those_of_the_tables() {
        for (z, share) in [
            (0.0, 0.5),
            (0.5, 0.691_462_461_274_013),
            (1.0, 0.841_344_746_068_543),
            (2.0, 0.977_249_868_051_821),
            (3.0, 0.998_650_101_968_370),
            (4.0, 0.999_968_328_758_167),
        ] {
            assert!((cumulative(z) - share).abs() < 1e-14, "{z}");
            assert!((cumulative(-z) - (1.0 - share)).abs() < 1e-14, "-{z}");
        }
        let far = cumulative(-6.0) / 9.865_876_450_377e-10;
        assert!((far - 1.0).abs() < 1e-11, "{far}");
    }

    #[test]
    fn both_ways_of_reckoning_meet() {
        let (below, above) = (cumulative(TAIL_FROM - 1e-5), cumulative(TAIL_FROM + 1e-5));
        let slope = (above - below) / 2e-5;
        assert!((slope / density(TAIL_FROM) - 1.0).abs() < 1e-7, "{slope}");
    }

    #[test]
    fn a_quantile_is_where_the_share_is_reached() {
        for share in [1e-6, 0.025, 0.5, 0.8, 0.999] {
            assert!((cumulative(quantile(share)) - share).abs() < 1e-14);
        }
        assert!(quantile(0.0) < f64::MIN && f64::MAX < quantile(1.0));
    }
}
