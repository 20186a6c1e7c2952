//! Continuous state space with one input and a fixed number of outputs over one shared state.

use crate::MAX_ORDER;
use crate::polynomial::{Polynomial, is_exactly_zero};
use crate::rational::RationalFunction;
use nalgebra::{DMatrix, DVector};

/// `dx/dt = A x + b u`, `y_i = c_i x + d_i u`, one input and `OUTPUTS` outputs.
///
/// Several outputs over one state keep signals consistent that belong to one machine: the handle's position `G_h v` and
/// the arm's answer to it `T_h G_h v` must come from the same motion.
#[derive(Clone, Debug, PartialEq)]
pub struct StateSpace<const OUTPUTS: usize> {
    pub(crate) a: DMatrix<f64>,
    pub(crate) b: DVector<f64>,
    /// One row per output.
    pub(crate) c: DMatrix<f64>,
    pub(crate) d: [f64; OUTPUTS],
}

/// Why a transfer function has no [`StateSpace`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum StateSpaceError {
    /// An output differentiates its input.
    #[error(
        "output {output} is improper: numerator degree {numerator_degree}, denominator degree {denominator_degree}"
    )]
    Improper {
        /// Which output, from 0.
        output: usize,
        /// Degree above the line.
        numerator_degree: usize,
        /// Degree below the line.
        denominator_degree: usize,
    },
    /// The shared denominator is zero.
    #[error("denominator is zero")]
    ZeroDenominator,
    /// The denominator's degree is above [`MAX_ORDER`].
    #[error("order {got} is above the supported {cap}")]
    OrderTooHigh {
        /// Degree of the denominator.
        got: usize,
        /// The cap.
        cap: usize,
    },
    /// Dividing by the leading coefficient leaves the range of numbers.
    #[error(
        "denominator's leading coefficient {leading:e} is too small for its other coefficients"
    )]
    IllScaled {
        /// The leading coefficient.
        leading: f64,
    },
}

impl StateSpace<1> {
    /// A single-output system with the given transfer function.
    ///
    /// # Errors
    /// The function is improper or too badly scaled.
    pub fn from_rational(function: &RationalFunction) -> Result<Self, StateSpaceError> {
        Self::with_outputs(function.denominator(), [function.numerator()])
    }
}

impl<const OUTPUTS: usize> StateSpace<OUTPUTS> {
    /// One state, several outputs: output `i` is `numerators[i] / denominator`.
    ///
    /// The state is the controllable canonical one, scaled by powers of two until rows and columns of `A` weigh the
    /// same: a servo's canonical coefficients span many decades, and sampling them unscaled would cost digits.
    ///
    /// # Errors
    /// A numerator outweighs the denominator, the denominator is zero, too long or too badly scaled.
    pub fn with_outputs(
        denominator: &Polynomial,
        numerators: [&Polynomial; OUTPUTS],
    ) -> Result<Self, StateSpaceError> {
        let order = denominator.degree();
        let leading = denominator.leading();
        if denominator.is_zero() {
            return Err(StateSpaceError::ZeroDenominator);
        }
        if MAX_ORDER < order {
            return Err(StateSpaceError::OrderTooHigh {
                got: order,
                cap: MAX_ORDER,
            });
        }
        let monic: Vec<f64> = denominator
            .coefficients()
            .iter()
            .map(|c| c / leading)
            .collect();
        let mut a = DMatrix::zeros(order, order);
        for row in 1..order {
            a[(row - 1, row)] = 1.0;
        }
        for column in 0..order {
            a[(order - 1, column)] = -monic[order - column];
        }
        let mut b = DVector::zeros(order);
        if 0 < order {
            b[order - 1] = 1.0;
        }
        let mut c = DMatrix::zeros(OUTPUTS, order);
        let mut d = [0.0; OUTPUTS];
        for (output, numerator) in numerators.iter().enumerate() {
            if order < numerator.degree() {
                return Err(StateSpaceError::Improper {
                    output,
                    numerator_degree: numerator.degree(),
                    denominator_degree: order,
                });
            }
            let padding = order - numerator.degree();
            let descending: Vec<f64> = std::iter::repeat_n(0.0, padding)
                .chain(numerator.coefficients().iter().map(|n| n / leading))
                .collect();
            // Polynomial division by the monic denominator: the quotient passes straight through, the rest is the row.
            d[output] = descending[0];
            for column in 0..order {
                c[(output, column)] =
                    descending[order - column] - d[output] * monic[order - column];
            }
        }
        let system = Self { a, b, c, d }.balanced();
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        if finite(system.a.as_slice())
            && finite(system.b.as_slice())
            && finite(system.c.as_slice())
            && finite(&system.d)
        {
            Ok(system)
        } else {
            Err(StateSpaceError::IllScaled { leading })
        }
    }

    /// Number of states.
    #[must_use]
    pub fn order(&self) -> usize {
        self.b.len()
    }

    /// `A`, order x order.
    #[must_use]
    pub fn a(&self) -> &DMatrix<f64> {
        &self.a
    }

    /// `b`, one entry per state.
    #[must_use]
    pub fn b(&self) -> &DVector<f64> {
        &self.b
    }

    /// `c`, one row per output.
    #[must_use]
    pub fn c(&self) -> &DMatrix<f64> {
        &self.c
    }

    /// Direct terms, one per output: how far an output jumps with its input.
    #[must_use]
    pub fn d(&self) -> [f64; OUTPUTS] {
        self.d
    }

    /// Diagonal similarity by powers of two (so it rounds nothing) that evens out row and column sums of `A`.
    /// Parlett and Reinsch's algorithm; a bounded number of sweeps, since each is only an improvement.
    fn balanced(mut self) -> Self {
        const SWEEPS: usize = 32;
        /// A step is worth taking when it shrinks the sum by at least this ratio.
        const WORTH: f64 = 0.95;
        let order = self.order();
        for _ in 0..SWEEPS {
            let mut changed = false;
            for i in 0..order {
                let off_diagonal =
                    |sum: f64, (j, v): (usize, &f64)| if j == i { sum } else { sum + v.abs() };
                let column = self.a.column(i).iter().enumerate().fold(0.0, off_diagonal);
                let row = self.a.row(i).iter().enumerate().fold(0.0, off_diagonal);
                if is_exactly_zero(column) || is_exactly_zero(row) || !(column / row).is_finite() {
                    continue;
                }
                let factor = ((row / column).log2() / 2.0).round().exp2();
                if WORTH * (column + row) <= column * factor + row / factor {
                    continue;
                }
                changed = true;
                self.a.column_mut(i).scale_mut(factor);
                self.a.row_mut(i).scale_mut(1.0 / factor);
                self.c.column_mut(i).scale_mut(factor);
                self.b[i] /= factor;
            }
            if !changed {
                break;
            }
        }
        self
    }
}
