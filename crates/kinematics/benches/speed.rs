//! Speed of the inverse and of the forward solution, beside Newton's method on the same postures.
//!
//! Prints `name ns_per_call largest_error_m`, one line each: the best of several rounds, since a shared machine only
//! ever adds time.

use std::hint::black_box;
use std::time::Instant;
use teleclay_kinematics::{Assembly, Branch, Geometry, Vector3};

#[path = "../tests/newton/mod.rs"]
mod newton;

const POSTURES: usize = 1024;
const ROUNDS: usize = 60;

struct Case {
    position_m: Vector3<f64>,
    joints_rad: Vector3<f64>,
    assembly: Assembly,
}

#[expect(clippy::print_stdout, reason = "the figures are the program's output")]
fn main() {
    let geometry = Geometry::default();
    let cases = cases(&geometry);
    let dimensions = geometry.dimensions();
    let nearest = |case: &Case, found: &[Vector3<f64>]| {
        found
            .iter()
            .map(|p| (p - case.position_m).norm())
            .fold(f64::INFINITY, f64::min)
    };

    let inverse = best_ns(&cases, |case| {
        black_box(geometry.inverse(black_box(&case.position_m))).ok();
    });
    let one_branch = best_ns(&cases, |case| {
        black_box(geometry.inverse_on(black_box(&case.position_m), Branch::ALL[0])).ok();
    });
    let closed = |case: &Case| {
        let solutions = geometry
            .inverse(&case.position_m)
            .expect("cases are reachable");
        solutions
            .iter()
            .filter_map(|s| geometry.forward(&s.joints_rad).ok())
            .map(|both| nearest(case, &both))
            .fold(0.0, f64::max)
    };
    println!(
        "inverse_8_branches {inverse:.1} {:e}",
        worst(&cases, closed)
    );
    println!(
        "inverse_1_branch {one_branch:.1} {:e}",
        worst(&cases, closed)
    );

    let forward = best_ns(&cases, |case| {
        black_box(geometry.forward(black_box(&case.joints_rad))).ok();
    });
    let exact = |case: &Case| {
        let found = geometry
            .forward_on(&case.joints_rad, case.assembly)
            .expect("cases come from the inverse");
        nearest(case, &[found])
    };
    println!(
        "forward_2_assemblies {forward:.1} {:e}",
        worst(&cases, exact)
    );

    // Warm: from where the platform was a millisecond ago at 0.1 m/s. Cold: from one fixed point.
    type Start = fn(&Case) -> Vector3<f64>;
    let starts: [(&str, Start); 2] = [
        ("newton_warm", |case| {
            case.position_m + Vector3::new(6e-5, -6e-5, 5e-5)
        }),
        ("newton_cold", |_| Vector3::new(0.0, 0.0, -0.15)),
    ];
    for (name, start) in starts {
        let ns = best_ns(&cases, |case| {
            black_box(newton::forward(
                &dimensions,
                black_box(&case.joints_rad),
                start(case),
            ));
        });
        let error = |case: &Case| {
            newton::forward(&dimensions, &case.joints_rad, start(case))
                .map_or(f64::NAN, |found| nearest(case, &[found]))
        };
        println!("{name} {ns:.1} {:e}", worst(&cases, error));
    }
    let torque = best_ns(&cases, |case| {
        let posture = geometry.posture_of(black_box(&case.joints_rad), case.assembly);
        black_box(posture.and_then(|posture| posture.torques_n_m(&Vector3::z()))).ok();
    });
    println!("joints_to_torques {torque:.1} 0e0");
}

/// Even points of the space below the base that the outward branch reaches, well away from singularities.
fn cases(geometry: &Geometry) -> Vec<Case> {
    let mut cases = Vec::new();
    let mut index = 0.0_f64;
    while cases.len() < POSTURES {
        index += 1.0;
        // Multiples of three irrational steps fill the cube evenly.
        let share =
            Vector3::new(0.754_877, 0.569_840, 0.430_159).map(|step| (index * step).fract());
        let position_m = Vector3::new(
            0.2 * share.x - 0.1,
            0.2 * share.y - 0.1,
            -0.12 - 0.1 * share.z,
        );
        let Ok(posture) = geometry.posture(&position_m, Branch::ALL[0]) else {
            continue;
        };
        if posture.singularity_within(0.05).is_some() {
            continue;
        }
        let joints_rad = posture.joints_rad();
        let both = geometry.forward(&joints_rad).expect("the posture exists");
        let front = (both[0] - position_m).norm() < (both[1] - position_m).norm();
        cases.push(Case {
            position_m,
            joints_rad,
            assembly: if front {
                Assembly::Front
            } else {
                Assembly::Back
            },
        });
    }
    cases
}

fn best_ns(cases: &[Case], mut call: impl FnMut(&Case)) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..ROUNDS {
        let before = Instant::now();
        for case in cases {
            call(case);
        }
        best = best.min(before.elapsed().as_nanos() as f64 / cases.len() as f64);
    }
    best
}

fn worst(cases: &[Case], error_m: impl Fn(&Case) -> f64) -> f64 {
    cases.iter().map(error_m).fold(0.0, f64::max)
}
