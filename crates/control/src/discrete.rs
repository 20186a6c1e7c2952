//! Sampled systems: coefficients here, memory in [`State`].
//!
//! One set of coefficients serves any number of axes; a replay can store the states, since they are plain numbers.

use crate::MAX_ORDER;
use crate::state_space::StateSpace;
use nalgebra::{DMatrix, DVector};

/// Coefficients of `x_{k+1} = A x_k + b u_k`, `y_k = c x_k + d u_k`, one input and `OUTPUTS` outputs.
///
/// Immutable and without memory: one set serves any number of axes, each with a [`State`] of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct DiscreteStateSpace<const OUTPUTS: usize = 1> {
    order: usize,
    dt_s: f64,
    /// Row major; only the first `order` rows and columns are used.
    a: [[f64; MAX_ORDER]; MAX_ORDER],
    b: [f64; MAX_ORDER],
    c: [[f64; MAX_ORDER]; OUTPUTS],
    d: [f64; OUTPUTS],
}

/// Memory of one sampled system on one axis. The default is rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    x: [f64; MAX_ORDER],
}

/// Why a system cannot be sampled.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DiscretiseError {
    /// The step is not a time.
    #[error("sample time is {got} s, need a finite one above zero")]
    SampleTime {
        /// The step as given.
        got: f64,
    },
    /// The bilinear map sends a pole at `2/dt` to infinity.
    #[error("a pole at 2/dt = {rad_s} rad/s has no place after the bilinear map")]
    PoleAtInfinity {
        /// Where the pole lies.
        rad_s: f64,
    },
    /// The system moves so fast that its sampled coefficients leave the range of numbers.
    #[error(
        "sampling at {dt_s} s overflows: the plant is unstable and far faster than the sample time"
    )]
    Overflow {
        /// The step.
        dt_s: f64,
    },
}

impl State {
    /// A state with these components, for instance out of a recording.
    #[must_use]
    pub fn from_components(x: [f64; MAX_ORDER]) -> Self {
        Self { x }
    }

    /// The components; those beyond the system's order are zero.
    #[must_use]
    pub fn components(&self) -> &[f64; MAX_ORDER] {
        &self.x
    }

    /// Whether every component is a finite number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.x.iter().all(|x| x.is_finite())
    }
}

impl<const OUTPUTS: usize> StateSpace<OUTPUTS> {
    /// Zero-order hold: exact at the samples for an input that holds its value between them, which is what a
    /// digital loop applies to an actuator.
    ///
    /// # Errors
    /// `dt_s` is not a time, or the outcome overflows.
    pub fn zoh(&self, dt_s: f64) -> Result<DiscreteStateSpace<OUTPUTS>, DiscretiseError> {
        require_sample_time(dt_s)?;
        let n = self.order();
        // exp([A b; 0 0] dt) holds both exp(A dt) and the integral that b passes through.
        let mut block = DMatrix::zeros(n + 1, n + 1);
        block.view_mut((0, 0), (n, n)).copy_from(&(&self.a * dt_s));
        block.view_mut((0, n), (n, 1)).copy_from(&(&self.b * dt_s));
        if !block.iter().all(|v| v.is_finite()) {
            return Err(DiscretiseError::Overflow { dt_s });
        }
        let exponential = block.exp();
        let a = exponential.view((0, 0), (n, n)).into_owned();
        let b = exponential.view((0, n), (n, 1)).column(0).into_owned();
        DiscreteStateSpace::from_matrices(dt_s, &a, &b, &self.c, self.d)
    }

    /// Tustin: `s` becomes `2/dt (z-1)/(z+1)`. Keeps stability and minimum phase, so it is what compensators get.
    ///
    /// # Errors
    /// `dt_s` is not a time, a pole lies at `2/dt`, or the outcome overflows.
    pub fn tustin(&self, dt_s: f64) -> Result<DiscreteStateSpace<OUTPUTS>, DiscretiseError> {
        require_sample_time(dt_s)?;
        let n = self.order();
        let identity = DMatrix::<f64>::identity(n, n);
        let half = &self.a * (dt_s / 2.0);
        if !half.iter().all(|v| v.is_finite()) {
            return Err(DiscretiseError::Overflow { dt_s });
        }
        let pole_at_infinity = DiscretiseError::PoleAtInfinity { rad_s: 2.0 / dt_s };
        let inverse = (&identity - &half).try_inverse().ok_or(pole_at_infinity)?;
        let a = &inverse * (&identity + &half);
        let b = &inverse * &self.b * dt_s;
        let c = &self.c * &inverse;
        let through = &c * &self.b * (dt_s / 2.0);
        let mut d = self.d;
        for (d, through) in d.iter_mut().zip(through.iter()) {
            *d += through;
        }
        DiscreteStateSpace::from_matrices(dt_s, &a, &b, &c, d)
    }
}

impl<const OUTPUTS: usize> DiscreteStateSpace<OUTPUTS> {
    /// All outputs for this state and input; changes nothing.
    #[must_use]
    #[inline]
    pub fn outputs(&self, state: &State, u: f64) -> [f64; OUTPUTS] {
        std::array::from_fn(|i| self.row(&self.c[i], state) + self.d[i] * u)
    }

    /// Moves the state one sample on, without asking for an output.
    #[inline]
    pub fn advance(&self, state: &mut State, u: f64) {
        let mut next = [0.0; MAX_ORDER];
        for ((slot, row), b) in next.iter_mut().zip(&self.a).zip(&self.b).take(self.order) {
            *slot = self.row(row, state) + b * u;
        }
        state.x = next;
    }

    /// All outputs at this sample; then moves the state one sample on.
    #[inline]
    pub fn step_outputs(&self, state: &mut State, u: f64) -> [f64; OUTPUTS] {
        let y = self.outputs(state, u);
        self.advance(state, u);
        y
    }

    /// Direct terms: `d y_k / d u_k`, one per output. Needed to solve a loop without a delay in it.
    #[must_use]
    pub fn direct(&self) -> [f64; OUTPUTS] {
        self.d
    }

    /// Number of states.
    #[must_use]
    pub fn order(&self) -> usize {
        self.order
    }

    /// Sample time, s.
    #[must_use]
    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    fn from_matrices(
        dt_s: f64,
        a: &DMatrix<f64>,
        b: &DVector<f64>,
        c: &DMatrix<f64>,
        d: [f64; OUTPUTS],
    ) -> Result<Self, DiscretiseError> {
        let order = b.len();
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        if !(finite(a.as_slice()) && finite(b.as_slice()) && finite(c.as_slice()) && finite(&d)) {
            return Err(DiscretiseError::Overflow { dt_s });
        }
        let mut system = Self {
            order,
            dt_s,
            a: [[0.0; MAX_ORDER]; MAX_ORDER],
            b: [0.0; MAX_ORDER],
            c: [[0.0; MAX_ORDER]; OUTPUTS],
            d,
        };
        for row in 0..order {
            for column in 0..order {
                system.a[row][column] = a[(row, column)];
            }
            system.b[row] = b[row];
            for output in 0..OUTPUTS {
                system.c[output][row] = c[(output, row)];
            }
        }
        Ok(system)
    }

    #[inline]
    fn row(&self, row: &[f64; MAX_ORDER], state: &State) -> f64 {
        row.iter()
            .zip(&state.x)
            .take(self.order)
            .fold(0.0, |sum, (c, x)| sum + c * x)
    }
}

impl DiscreteStateSpace<1> {
    /// The output for this state and input; changes nothing.
    #[must_use]
    #[inline]
    pub fn output(&self, state: &State, u: f64) -> f64 {
        self.outputs(state, u)[0]
    }

    /// The output at this sample; then moves the state one sample on.
    #[inline]
    pub fn step(&self, state: &mut State, u: f64) -> f64 {
        self.step_outputs(state, u)[0]
    }

    /// `c A x`: the next output if the input were zero now.
    #[inline]
    pub(crate) fn free_next_output(&self, state: &State) -> f64 {
        let mut next = *state;
        self.advance(&mut next, 0.0);
        self.output(&next, 0.0)
    }

    /// `c b`: how far the next output moves per unit of input now.
    pub(crate) fn next_output_gain(&self) -> f64 {
        self.row(&self.c[0], &State { x: self.b })
    }

    /// Zeros of the sampled system that an exact inverse would have as poles: eigenvalues of `A - b c A / (c b)`.
    /// `None` when `c b` is zero, or where the bounded iteration does not settle.
    pub(crate) fn inverse_dynamics_radius(&self) -> Option<f64> {
        let n = self.order;
        let a = DMatrix::from_fn(n, n, |i, j| self.a[i][j]);
        let b = DVector::from_fn(n, |i, _| self.b[i]);
        let c = DMatrix::from_fn(1, n, |_, j| self.c[0][j]);
        let closed = &a - &b * (&c * &a) / self.next_output_gain();
        if !closed.iter().all(|v| v.is_finite()) {
            return None;
        }
        const ITERATIONS: usize = 1000;
        let schur = nalgebra::linalg::Schur::try_new(closed, f64::EPSILON, ITERATIONS)?;
        Some(
            schur
                .complex_eigenvalues()
                .iter()
                .fold(0.0, |radius: f64, e| radius.max(e.norm())),
        )
    }
}

fn require_sample_time(dt_s: f64) -> Result<(), DiscretiseError> {
    if dt_s.is_finite() && 0.0 < dt_s {
        Ok(())
    } else {
        Err(DiscretiseError::SampleTime { got: dt_s })
    }
}
