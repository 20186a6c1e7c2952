//! Rows of the robot: its closed solutions, how exact they are, and Newton's method on the same postures beside them.

use std::hint::black_box;
use std::time::Instant;

use teleclay_kinematics::{Assembly, Branch, Geometry, Vector3};

use crate::row::{Row, quantile};

#[path = "../../crates/kinematics/tests/newton/mod.rs"]
mod newton;

const POSTURES: usize = 4096;
/// Postures this near to a singularity are left out. Where all arms fold inwards the rods are nearly parallel in the
/// middle of the workspace already, at 0.026: a greater distance leaves nothing to measure.
const REGULAR: f64 = 0.02;
const ROUNDS: usize = 101;

/// Where Newton's method starts when it knows nothing, m.
const COLD: Vector3<f64> = Vector3::new(0.0, 0.0, -0.15);

/// A posture, well away from singularities.
struct Case {
    position_m: Vector3<f64>,
    joints_rad: Vector3<f64>,
    assembly: Assembly,
}

/// Inverse on all eight branches, forward, and Newton: warm from where the platform was a tick ago at 0.1 m/s, cold
/// from one fixed point.
pub(crate) fn rows() -> anyhow::Result<Vec<Row>> {
    let geometry = Geometry::default();
    let dimensions = geometry.dimensions();
    let cases = cases(&geometry)?;
    let inverse = per_call(&cases, |case| {
        black_box(geometry.inverse(black_box(&case.position_m))).ok();
    });
    let forward = per_call(&cases, |case| {
        black_box(geometry.forward(black_box(&case.joints_rad))).ok();
    });
    let newton_from = |start: fn(&Case) -> Vector3<f64>| {
        per_call(&cases, |case| {
            let joints = black_box(&case.joints_rad);
            black_box(newton::forward(&dimensions, joints, start(case)));
        })
    };
    let warm = newton_from(|case| case.position_m + Vector3::new(6e-5, -6e-5, 5e-5));
    let cold = newton_from(|_| COLD);
    let mut worst_m = 0.0_f64;
    for case in &cases {
        for solution in geometry.inverse(&case.position_m)? {
            let both = geometry.forward(&solution.joints_rad)?;
            worst_m = worst_m.max(miss(&both, case));
        }
        let there = geometry.forward_on(&case.joints_rad, case.assembly)?;
        worst_m = worst_m.max(miss(&[there], case));
    }
    Ok(vec![
        Row::new("kinematics_inverse_8_branches_s", "s", 100e-9, inverse),
        Row::new("kinematics_forward_s", "s", 120e-9, forward),
        Row::new("kinematics_worst_error_m", "m", 1e-9, worst_m),
        Row::new("kinematics_forward_s_vs_newton_warm", "s", warm, forward),
        Row::new("kinematics_forward_s_vs_newton_cold", "s", cold, forward),
    ])
}

/// How far the nearest of the positions is from the case's, m.
fn miss(found: &[Vector3<f64>], case: &Case) -> f64 {
    let misses = found
        .iter()
        .map(|position| (position - case.position_m).norm());
    misses.fold(f64::INFINITY, f64::min)
}

/// Even points of the space below the base that the outward branch reaches.
fn cases(geometry: &Geometry) -> anyhow::Result<Vec<Case>> {
    let mut cases = Vec::new();
    for index in 1..=20 * POSTURES {
        // Multiples of three irrational steps fill the cube evenly.
        let share =
            Vector3::new(0.754_877, 0.569_840, 0.430_159).map(|step| (index as f64 * step).fract());
        let position_m = Vector3::new(
            0.2 * share.x - 0.1,
            0.2 * share.y - 0.1,
            -0.12 - 0.1 * share.z,
        );
        let is_regular = |branch: &Branch| {
            geometry
                .posture(&position_m, *branch)
                .is_ok_and(|posture| posture.singularity_within(REGULAR).is_none())
        };
        if !Branch::ALL.iter().all(is_regular) {
            continue;
        }
        let joints_rad = geometry.posture(&position_m, Branch::ALL[0])?.joints_rad();
        let [front, back] = geometry.forward(&joints_rad)?;
        let is_front = (front - position_m).norm() < (back - position_m).norm();
        cases.push(Case {
            position_m,
            joints_rad,
            assembly: if is_front {
                Assembly::Front
            } else {
                Assembly::Back
            },
        });
        if cases.len() == POSTURES {
            return Ok(cases);
        }
    }
    anyhow::bail!("only {} regular postures, wanted {POSTURES}", cases.len())
}

/// Median over rounds of the mean time of a call, s.
fn per_call(cases: &[Case], mut call: impl FnMut(&Case)) -> f64 {
    let mut rounds: Vec<u64> = (0..ROUNDS)
        .map(|_| {
            let started = Instant::now();
            cases.iter().for_each(&mut call);
            started.elapsed().as_nanos() as u64
        })
        .collect();
    quantile(&mut rounds, 0.5) / cases.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// There are postures enough to measure, and Newton solves all of them: it is compared over the same work.
    #[test]
    fn newton_and_the_closed_form_solve_the_same_postures() {
        let geometry = Geometry::default();
        let cases = cases(&geometry).unwrap();
        assert_eq!(cases.len(), POSTURES);
        for case in &cases {
            let closed = geometry
                .forward_on(&case.joints_rad, case.assembly)
                .unwrap();
            assert!((closed - case.position_m).norm() < 1e-9);
            for start in [case.position_m + Vector3::new(6e-5, -6e-5, 5e-5), COLD] {
                let newton = newton::forward(&geometry.dimensions(), &case.joints_rad, start);
                assert!(
                    (newton.unwrap() - case.position_m).norm() < 1e-9,
                    "from {start}"
                );
            }
        }
    }
}
