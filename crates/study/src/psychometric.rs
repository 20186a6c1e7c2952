//! The psychometric function: the share of right (or yes) answers over the level. Source: [WH01a] and [KP16] in
//! docs/papers.md.
//!
//! ```text
//! psi(x) = guess + (1 - guess - lapse) F(x)
//!
//! cumulative Gaussian   F = Phi((x - location) / spread)                      threshold: F = 1/2
//! Weibull               F = 1 - exp(-exp((ln x - location) / spread))         threshold: F = 1 - 1/e
//! ```
//!
//! The Weibull's usual scale and slope are `alpha = exp(location)` and `beta = 1 / spread`. Written so, both functions
//! are a shape, moved and stretched along an axis, and are fitted alike.

use serde::{Deserialize, Serialize};

use crate::normal;

/// The shape `F`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// Of levels that may be of either sign.
    #[default]
    CumulativeGaussian,
    /// Of levels above zero; at zero nothing is noticed.
    Weibull,
}

impl Shape {
    /// A level as a place on the shape's axis; nothing where the shape is zero.
    pub fn place(self, level: f64) -> Option<f64> {
        match self {
            Self::CumulativeGaussian => Some(level),
            Self::Weibull => (0.0 < level).then(|| level.ln()),
        }
    }

    /// The level at a place.
    pub fn level(self, place: f64) -> f64 {
        match self {
            Self::CumulativeGaussian => place,
            Self::Weibull => place.exp(),
        }
    }

    /// The shape at a place, with its location at 0 and its spread 1.
    pub fn share(self, place: f64) -> f64 {
        match self {
            Self::CumulativeGaussian => normal::cumulative(place),
            Self::Weibull => -(-place.exp()).exp_m1(),
        }
    }

    /// Where the shape has this share.
    pub fn place_of(self, share: f64) -> f64 {
        match self {
            Self::CumulativeGaussian => normal::quantile(share),
            Self::Weibull => (-(-share).ln_1p()).ln(),
        }
    }

    /// The shape at its threshold.
    pub fn share_at_threshold(self) -> f64 {
        self.share(0.0)
    }
}

/// A psychometric function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Psychometric {
    /// The shape `F`.
    pub shape: Shape,
    /// Where the shape's threshold is, on the shape's axis.
    pub location: f64,
    /// How wide it is there, above zero.
    pub spread: f64,
    /// Share of right answers where nothing is noticed.
    pub guess: f64,
    /// Share of wrong answers however clear it is.
    pub lapse: f64,
}

impl Psychometric {
    /// Share of right answers at a level.
    pub fn share(&self, level: f64) -> f64 {
        let shape = self.shape.place(level).map_or(0.0, |place| {
            self.shape.share((place - self.location) / self.spread)
        });
        self.guess + (1.0 - self.guess - self.lapse) * shape
    }

    /// The threshold, in the unit of the levels.
    pub fn threshold(&self) -> f64 {
        self.shape.level(self.location)
    }

    /// The level at which this share is right; nothing where no level has it.
    pub fn level_at(&self, share: f64) -> Option<f64> {
        let shape = (share - self.guess) / (1.0 - self.guess - self.lapse);
        (0.0 < shape && shape < 1.0).then(|| {
            let place = self.location + self.spread * self.shape.place_of(shape);
            self.shape.level(place)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn function(shape: Shape) -> Psychometric {
        Psychometric {
            shape,
            location: shape.place(0.1).unwrap(),
            spread: 0.3,
            guess: 0.5,
            lapse: 0.02,
        }
    }

    #[test]
    fn the_threshold_is_where_the_shape_says() {
        let gaussian = function(Shape::CumulativeGaussian);
        assert!((gaussian.share(0.1) - (0.5 + 0.48 * 0.5)).abs() < 1e-12);
        let weibull = function(Shape::Weibull);
        let noticed = 1.0 - (-1.0_f64).exp();
        assert!((weibull.share(0.1) - (0.5 + 0.48 * noticed)).abs() < 1e-12);
        assert!((weibull.threshold() - 0.1).abs() < 1e-12);
    }

    /// The form of the textbook: `1 - exp(-(x / alpha)^beta)`.
    #[test]
    fn the_weibull_is_the_textbook_s() {
        let weibull = function(Shape::Weibull);
        for level in [0.01_f64, 0.05, 0.1, 0.2, 0.5] {
            let textbook = 1.0 - (-(level / 0.1).powf(1.0 / 0.3)).exp();
            let expected = 0.5 + 0.48 * textbook;
            assert!((weibull.share(level) - expected).abs() < 1e-12, "{level}");
        }
        assert!((weibull.share(0.0) - 0.5).abs() < 1e-15);
    }

    #[test]
    fn a_level_has_the_share_that_it_was_asked_for() {
        for shape in [Shape::CumulativeGaussian, Shape::Weibull] {
            let function = function(shape);
            for share in [0.51, 0.707, 0.794, 0.95] {
                let level = function.level_at(share).unwrap();
                assert!((function.share(level) - share).abs() < 1e-9, "{share}");
            }
            assert_eq!(function.level_at(0.5), None);
            assert_eq!(function.level_at(0.98), None);
        }
    }
}
