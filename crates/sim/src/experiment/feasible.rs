//! Whether an experiment can come to an end that means something, before anything is cut.

use teleclay_control::{DelayMargin, Polynomial, PolynomialError, delay_margin, paper};

use super::{
    CuttingInputs, LEAST_PLATEAU_TICKS, LONGEST_S, MOST_RANGES, Push, Refusal, Specimen,
    TRACE_SAMPLES, VELOCITY_TOLERANCE,
};

/// Tick of the loop, s.
pub(super) const TICK_S: f64 = 1e-3;

/// What sampling adds to the loop, as a delay of the clay's force, in ticks: half a tick for the position that is held,
/// half a tick for the velocity, which is a difference of two positions.
const SAMPLING_TICKS: f64 = 1.0;

impl CuttingInputs {
    pub(super) fn require_ranges(&self) -> Result<(), Refusal> {
        let edges = self.edges_m.len();
        let dampings = self.ranges();
        if edges != dampings + 1 || dampings == 0 || MOST_RANGES < dampings {
            return Err(Refusal::Counts { edges, dampings });
        }
        let scalars = [
            (
                "virtual_mass_kg",
                self.virtual_mass_kg,
                1e-3,
                1e3,
                "0.001 to 1000",
            ),
            (
                "virtual_damping_n_s_per_m",
                self.virtual_damping_n_s_per_m,
                0.0,
                1e5,
                "0 to 100000",
            ),
            (
                "position_ratio",
                self.position_ratio,
                1e-3,
                1e3,
                "0.001 to 1000",
            ),
            (
                "force_ratio",
                self.force_ratio,
                -1e3,
                -1e-3,
                "-1000 to -0.001: the clay must resist",
            ),
            (
                "hand_force_n",
                self.hand_force_n,
                1e-3,
                100.0,
                "0.001 to 100",
            ),
        ];
        for (field, got, least, most, need) in scalars {
            require(field, None, got, least..=most, need)?;
        }
        if let Some(got) = self.voxel_size_m {
            require("voxel_size_m", None, got, 2e-5..=5e-3, "0.00002 to 0.005")?;
        }
        if !TRACE_SAMPLES.contains(&self.most_trace_samples) {
            return Err(Refusal::Input {
                field: "most_trace_samples",
                index: None,
                got: self.most_trace_samples as f64,
                need: "64 to 100000",
            });
        }
        for (index, &got) in self.edges_m.iter().enumerate() {
            require("edges_m", Some(index), got, -10.0..=10.0, "-10 to 10")?;
            if 0 < index && got <= self.edges_m[index - 1] {
                let need = "more than the edge before it";
                return Err(Refusal::Input {
                    field: "edges_m",
                    index: Some(index),
                    got,
                    need,
                });
            }
        }
        for (index, &got) in self.clay_damping_n_s_per_m.iter().enumerate() {
            require(
                "clay_damping_n_s_per_m",
                Some(index),
                got,
                0.0..=1e6,
                "0 to 1000000",
            )?;
        }
        Ok(())
    }

    pub(super) fn require_plateaus(&self) -> Result<(), Refusal> {
        let damping = |range: usize| {
            self.virtual_damping_n_s_per_m
                + self.force_per_position() * self.clay_damping_n_s_per_m[range]
        };
        match (0..self.ranges()).find(|&range| damping(range) <= 0.0) {
            Some(range) => Err(Refusal::NoPlateau { range }),
            None => Ok(()),
        }
    }

    /// Each range by itself must bear its own sampling: `A + B exp(-s d)` with the arm in `A` and the clay in `B`.
    pub(super) fn require_stability(&self) -> Result<(), Refusal> {
        for range in 0..self.ranges() {
            let damping_n_s_per_m = self.force_per_position() * self.clay_damping_n_s_per_m[range];
            // Coefficients are bounded by the input checks, so only a loop that cannot be judged is left, and that is
            // no loop to run.
            let margin = self
                .range_margin(damping_n_s_per_m)
                .unwrap_or(DelayMargin::Finite {
                    seconds: 0.0,
                    omega_rad_s: f64::INFINITY,
                });
            if !margin.bears(SAMPLING_TICKS * TICK_S) {
                return Err(Refusal::Unstable {
                    range,
                    damping_n_s_per_m,
                    virtual_mass_kg: self.virtual_mass_kg,
                    virtual_damping_n_s_per_m: self.virtual_damping_n_s_per_m,
                });
            }
        }
        Ok(())
    }

    /// Time to the last edge by the formula, s.
    pub(super) fn expected_s(&self) -> Result<f64, Refusal> {
        let expected_s = match self.push {
            Push::AtSensor => (0..self.ranges())
                .map(|range| {
                    (self.edges_m[range + 1] - self.edges_m[range])
                        / self.plateau_velocity_m_s(range, self.hand_force_n)
                })
                .sum(),
            Push::ThroughArm => self.expected_through_arm_s()?,
        };
        if expected_s <= LONGEST_S {
            Ok(expected_s)
        } else {
            Err(Refusal::TooSlow { expected_s })
        }
    }

    /// Each plateau must last, and the specimen must be fine enough.
    pub(super) fn require_samples(&self, specimen: &Specimen) -> Result<(), Refusal> {
        for range in 0..self.ranges() {
            let [from_m, to_m] = specimen.window_m(self, range);
            let ticks =
                (to_m - from_m) / (self.plateau_velocity_m_s(range, self.hand_force_n) * TICK_S);
            if ticks < LEAST_PLATEAU_TICKS {
                return Err(Refusal::TooFast {
                    range,
                    ticks: ticks.max(0.0),
                });
            }
            let depth_m = specimen.depths_of_cut_m[range];
            let error = specimen.velocity_error(self, range);
            if VELOCITY_TOLERANCE < error {
                return Err(Refusal::TooShallow {
                    range,
                    depth_m,
                    deepest_m: specimen.deepest_m(),
                    voxel_size_m: specimen.voxel_size_m,
                    error,
                });
            }
        }
        Ok(())
    }

    /// With an arm of stiffness `K` and damping `b` the force at the sensor is `u - K y - b v`, so that
    /// `v = (u - K y) / (B + rho B_i + b)` and the time through a range is a logarithm.
    fn expected_through_arm_s(&self) -> Result<f64, Refusal> {
        let arm = paper::t_hx();
        let [_, damping, stiffness] = *arm.coefficients() else {
            unreachable!("the printed arm is of second order")
        };
        let travel_m = self.travel_m();
        let reach_m = self.hand_force_n / stiffness;
        if reach_m <= travel_m {
            return Err(Refusal::OutOfReach {
                hand_force_n: self.hand_force_n,
                reach_m,
                travel_m,
            });
        }
        let start_m = self.edges_m[0];
        Ok((0..self.ranges())
            .map(|range| {
                let total = self.virtual_damping_n_s_per_m
                    + self.force_per_position() * self.clay_damping_n_s_per_m[range]
                    + damping;
                let left_n =
                    |edge: usize| self.hand_force_n - stiffness * (self.edges_m[edge] - start_m);
                total / stiffness * (left_n(range) / left_n(range + 1)).ln()
            })
            .sum())
    }

    /// How much delay of the clay's force one range bears. Without an arm a common factor `s`, the handle's free
    /// position, is taken out.
    fn range_margin(&self, clay_damping_n_s_per_m: f64) -> Option<DelayMargin> {
        let polynomials = || -> Result<[Polynomial; 2], PolynomialError> {
            let servo = paper::g_hx();
            let (mass, damping) = (self.virtual_mass_kg, self.virtual_damping_n_s_per_m);
            let clay = servo.numerator().scaled(clay_damping_n_s_per_m)?;
            match self.push {
                Push::AtSensor => {
                    let handle = Polynomial::new(&[mass, damping])?;
                    Ok([servo.denominator().times(&handle)?, clay])
                }
                Push::ThroughArm => {
                    let handle = Polynomial::new(&[mass, damping, 0.0])?;
                    let arm = servo.numerator().times(&paper::t_hx())?;
                    let rate = Polynomial::new(&[1.0, 0.0])?;
                    Ok([
                        servo.denominator().times(&handle)?.plus(&arm)?,
                        clay.times(&rate)?,
                    ])
                }
            }
        };
        let [prompt, delayed] = polynomials().ok()?;
        delay_margin(&prompt, &delayed).ok()
    }
}

fn require(
    field: &'static str,
    index: Option<usize>,
    got: f64,
    range: std::ops::RangeInclusive<f64>,
    need: &'static str,
) -> Result<(), Refusal> {
    if range.contains(&got) {
        Ok(())
    } else {
        Err(Refusal::Input {
            field,
            index,
            got,
            need,
        })
    }
}
