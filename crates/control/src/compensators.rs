//! The four compensators that tie tool to handle, `y_t = A_h1 y_h` and `f_t = A_h2 f_h^e`, as continuous transfer
//! functions. Source: [KHMH03] (21)–(22) and (30)–(32), with the sign of (31), which (25) lost in print.
//!
//! ```text
//! v_h =  C_h1 f_h - C_t1 f_t                                  (21)
//! v_t = -C_h2 f_h + C_t2 f_t                                  (22)
//! P    = G_h C_h1 + S_h
//! C_t1 = P (G_h A_h2)^-1 = (C_h1 + S_h / G_h) / A_h2          (30)
//! C_h2 = -G_t^-1 A_h1 P                                       (31)
//! C_t2 = G_t^-1 (-A_h1 A_h2^-1 P - S_t)                       (32)
//! ```

use crate::rational::{RationalError, RationalFunction};

/// What the compensators are made from. Positions in m, forces in N.
#[derive(Clone, Debug, PartialEq)]
pub struct Sides {
    /// Handle servo, command to position.
    pub g_h: RationalFunction,
    /// Handle's give under the hand, force to position; zero for a handle that cannot be driven back.
    pub s_h: RationalFunction,
    /// Tool actuator, command to position.
    pub g_t: RationalFunction,
    /// Tool's give under the clay, force to position.
    pub s_t: RationalFunction,
    /// The free choice: hand force to handle command.
    pub c_h1: RationalFunction,
    /// `A_h1`, above zero.
    pub position_ratio: f64,
    /// `A_h2`, below zero, so that the hand feels the clay as resistance.
    pub force_ratio: f64,
}

/// One of the four.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compensator {
    /// Hand force to handle command.
    CH1,
    /// Clay force to handle command (30).
    CT1,
    /// Hand force to tool command (31).
    CH2,
    /// Clay force to tool command (32).
    CT2,
}

/// All four, each proper.
#[derive(Clone, Debug, PartialEq)]
pub struct Compensators {
    /// Hand force to handle command.
    pub c_h1: RationalFunction,
    /// Clay force to handle command (30).
    pub c_t1: RationalFunction,
    /// Hand force to tool command (31).
    pub c_h2: RationalFunction,
    /// Clay force to tool command (32).
    pub c_t2: RationalFunction,
}

/// Why there are no compensators.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CompensatorError {
    /// `A_h1` must be a positive number.
    #[error("position ratio is {got}, need a finite one above zero")]
    PositionRatio {
        /// As given.
        got: f64,
    },
    /// `A_h2` must be a negative number.
    #[error(
        "force ratio is {got}, need a finite one below zero: otherwise the clay would push the hand along"
    )]
    ForceRatio {
        /// As given.
        got: f64,
    },
    /// A compensator would have to differentiate its input.
    #[error(
        "{compensator} is improper: numerator degree {numerator_degree}, denominator degree {denominator_degree}; \
         let C_h1 fall off faster"
    )]
    Improper {
        /// Which one.
        compensator: Compensator,
        /// Degree above the line.
        numerator_degree: usize,
        /// Degree below the line.
        denominator_degree: usize,
    },
    /// The algebra has no outcome: a plant is zero, or an order passes the cap.
    #[error("{compensator}: {source}")]
    Algebra {
        /// Which one.
        compensator: Compensator,
        /// What went wrong.
        source: RationalError,
    },
}

impl std::fmt::Display for Compensator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::CH1 => "C_h1",
            Self::CT1 => "C_t1",
            Self::CH2 => "C_h2",
            Self::CT2 => "C_t2",
        })
    }
}

/// The four compensators for these plants, each guaranteed proper.
///
/// # Errors
/// A ratio has the wrong sign, a compensator is improper, a plant is zero or an order passes
/// [`MAX_ORDER`](crate::MAX_ORDER).
pub fn compensators(sides: &Sides) -> Result<Compensators, CompensatorError> {
    let formal = sides.formal_compensators()?;
    require_proper(Compensator::CH1, &formal.c_h1)?;
    require_proper(Compensator::CT1, &formal.c_t1)?;
    require_proper(Compensator::CH2, &formal.c_h2)?;
    require_proper(Compensator::CT2, &formal.c_t2)?;
    Ok(formal)
}

impl Sides {
    /// `P = G_h C_h1 + S_h`, hand force to handle position: the admittance that both sides share.
    ///
    /// # Errors
    /// The order passes [`MAX_ORDER`](crate::MAX_ORDER) or a coefficient overflows.
    pub fn admittance(&self) -> Result<RationalFunction, RationalError> {
        self.g_h.times(&self.c_h1)?.plus(&self.s_h)
    }

    /// `rho = A_h1 / |A_h2|`: how much the clay's answer weighs against the arm's.
    ///
    /// # Errors
    /// A ratio has the wrong sign.
    pub fn force_per_position(&self) -> Result<f64, CompensatorError> {
        require_ratios(self.position_ratio, self.force_ratio)?;
        Ok(self.position_ratio / -self.force_ratio)
    }

    /// (30)–(32) as formulas, which have a frequency response even where no machine could realise them.
    ///
    /// # Errors
    /// As [`compensators`], but for improper ones.
    pub fn formal_compensators(&self) -> Result<Compensators, CompensatorError> {
        require_ratios(self.position_ratio, self.force_ratio)?;
        let algebra = |compensator| {
            move |source| CompensatorError::Algebra {
                compensator,
                source,
            }
        };
        let p = self.admittance().map_err(algebra(Compensator::CH1))?;
        let into_tool = |through: RationalFunction| through.divided_by(&self.g_t);
        let give = if self.s_h.is_zero() {
            Ok(RationalFunction::zero())
        } else {
            self.s_h.divided_by(&self.g_h)
        };
        Ok(Compensators {
            c_h1: self.c_h1.clone(),
            // Written without G_h wherever the handle does not give, so that nothing has to be cancelled.
            c_t1: give
                .and_then(|give| self.c_h1.plus(&give))
                .and_then(|sum| sum.scaled(1.0 / self.force_ratio))
                .map_err(algebra(Compensator::CT1))?,
            c_h2: p
                .scaled(-self.position_ratio)
                .and_then(into_tool)
                .map_err(algebra(Compensator::CH2))?,
            c_t2: p
                .scaled(-self.position_ratio / self.force_ratio)
                .and_then(|p| p.plus(&self.s_t.scaled(-1.0)?))
                .and_then(into_tool)
                .map_err(algebra(Compensator::CT2))?,
        })
    }
}

fn require_ratios(position_ratio: f64, force_ratio: f64) -> Result<(), CompensatorError> {
    if !(position_ratio.is_finite() && 0.0 < position_ratio) {
        return Err(CompensatorError::PositionRatio {
            got: position_ratio,
        });
    }
    if !(force_ratio.is_finite() && force_ratio < 0.0) {
        return Err(CompensatorError::ForceRatio { got: force_ratio });
    }
    Ok(())
}

fn require_proper(
    compensator: Compensator,
    function: &RationalFunction,
) -> Result<(), CompensatorError> {
    if function.is_proper() {
        return Ok(());
    }
    Err(CompensatorError::Improper {
        compensator,
        numerator_degree: function.numerator().degree(),
        denominator_degree: function.denominator().degree(),
    })
}
