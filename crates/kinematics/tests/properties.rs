//! What must hold for any robot and any posture.

use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_4, PI, TAU};
use teleclay_kinematics::{
    Assembly, Branch, BranchError, Dimensions, Geometry, GeometryError, KinematicsError, Posture,
    Region, RegionError, Singularity, Vector3,
};

#[path = "newton/mod.rs"]
mod newton;

/// Robots of all proportions; arms anywhere, as long as they are apart.
fn geometries() -> impl Strategy<Value = Geometry> {
    (
        0.02..0.3f64,
        0.01..0.2f64,
        0.05..0.3f64,
        1.0..3.0f64,
        0.0..TAU,
        0.5..2.6f64,
        0.5..2.6f64,
    )
        .prop_map(|(base, platform, upper, ratio, first, second, third)| {
            Geometry::new(Dimensions {
                base_radius_m: base,
                platform_radius_m: platform,
                upper_link_m: upper,
                lower_link_m: upper * ratio,
                arm_angles_rad: [first, first + second, first + second + third],
            })
            .unwrap()
        })
}

fn positions() -> impl Strategy<Value = Vector3<f64>> {
    (-0.3..0.3f64, -0.3..0.3f64, -0.4..0.4f64).prop_map(|(x, y, z)| Vector3::new(x, y, z))
}

fn vectors() -> impl Strategy<Value = Vector3<f64>> {
    (-5.0..5.0f64, -5.0..5.0f64, -5.0..5.0f64).prop_map(|(x, y, z)| Vector3::new(x, y, z))
}

fn is_well_placed(posture: &Posture) -> bool {
    posture.singularity_within(0.02).is_none()
}

fn direction(geometry: &Geometry, j: usize) -> Vector3<f64> {
    let (sine, cosine) = geometry.dimensions().arm_angles_rad[j].sin_cos();
    Vector3::new(cosine, sine, 0.0)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    /// There and back for all eight branches; the robot's own geometry closes as well, by (1)–(5) and for both rods of
    /// a pair.
    #[test]
    fn inverse_then_forward_returns_the_point(geometry in geometries(), position in positions(), half_width in 0.0..0.05f64) {
        let Ok(solutions) = geometry.inverse(&position) else { return Ok(()) };
        let Dimensions { base_radius_m, platform_radius_m, upper_link_m, lower_link_m, .. } = geometry.dimensions();
        for solution in solutions {
            for j in 0..3 {
                let e = direction(&geometry, j);
                let sideways = Vector3::z().cross(&e) * half_width;
                let (sine, cosine) = solution.joints_rad[j].sin_cos();
                let elbow = e * (base_radius_m + upper_link_m * cosine) + Vector3::z() * upper_link_m * sine;
                for side in [sideways, -sideways] {
                    let rod = (position + e * platform_radius_m + side) - (elbow + side);
                    prop_assert!((rod.norm() - lower_link_m).abs() < 1e-9);
                }
                prop_assert!((geometry.elbows(&solution.joints_rad).unwrap()[j] - elbow).norm() < 1e-12);
            }
            let posture = geometry.posture(&position, solution.branch).unwrap();
            if is_well_placed(&posture) {
                prop_assert_eq!(posture.branch(), solution.branch);
                let both = geometry.forward(&solution.joints_rad).unwrap();
                let miss = both.iter().map(|p| (p - position).norm()).fold(f64::INFINITY, f64::min);
                prop_assert!(miss < 1e-9, "{miss} m");
            }
        }
    }

    /// Both assemblies satisfy the joint angles, mirror each other in the elbows' plane, and are told apart by side.
    #[test]
    fn forward_then_inverse_returns_the_joints(geometry in geometries(), a in -PI..PI, b in -PI..PI, c in -PI..PI) {
        let joints = Vector3::new(a, b, c);
        let Ok(both) = geometry.forward(&joints) else { return Ok(()) };
        for (position, assembly) in both.iter().zip([Assembly::Front, Assembly::Back]) {
            let posture = geometry.posture_of(&joints, assembly).unwrap();
            if !is_well_placed(&posture) {
                continue;
            }
            let back = geometry.inverse_on(position, posture.branch()).unwrap();
            for j in 0..3 {
                prop_assert!((back[j] - joints[j]).rem_euclid(TAU).min((joints[j] - back[j]).rem_euclid(TAU)) < 1e-8);
            }
            prop_assert!((posture.joints_rad() - joints).norm() < 1e-12 && (posture.position_m() - position).norm() < 1e-15);
        }
        let [e1, e2, e3] = geometry.elbows(&joints).unwrap();
        let shift = |j: usize| direction(&geometry, j) * geometry.dimensions().platform_radius_m;
        let [c1, c2, c3] = [e1 - shift(0), e2 - shift(1), e3 - shift(2)];
        let normal = (c2 - c1).cross(&(c3 - c1)).normalize();
        let heights = both.map(|p| normal.dot(&(p - c1)));
        prop_assert!(0.0 <= heights[0] && (heights[0] + heights[1]).abs() < 1e-9);
        prop_assert!((both[0] - both[1]).cross(&normal).norm() < 1e-9);
    }

    /// Newton's method, which knows only the sphere equations, ends at one of the two closed-form solutions.
    #[test]
    fn newton_finds_what_the_closed_form_says(geometry in geometries(), position in positions()) {
        let Ok(solutions) = geometry.inverse(&position) else { return Ok(()) };
        let solution = solutions[geometry.outward_branch(&position).index()];
        prop_assume!(is_well_placed(&geometry.posture(&position, solution.branch).unwrap()));
        let start = position + Vector3::new(1e-3, -2e-3, 1e-3);
        if let Some(found) = newton::forward(&geometry.dimensions(), &solution.joints_rad, start) {
            let both = geometry.forward(&solution.joints_rad).unwrap();
            let miss = both.iter().map(|p| (p - found).norm()).fold(f64::INFINITY, f64::min);
            prop_assert!(miss < 1e-9, "{miss} m");
        }
    }

    /// J is the derivative of the forward solution, by central differences.
    #[test]
    fn jacobian_agrees_with_differences(geometry in geometries(), position in positions(), index in 0..8usize) {
        let Ok(posture) = geometry.posture(&position, Branch::ALL[index]) else { return Ok(()) };
        // Differences are blurred where J itself bends sharply.
        prop_assume!(posture.singularity_within(0.15).is_none());
        let joints = posture.joints_rad();
        let [front, back] = geometry.forward(&joints).unwrap();
        let assembly = if (front - position).norm() < (back - position).norm() { Assembly::Front } else { Assembly::Back };
        let jacobian = posture.jacobian().unwrap();
        const STEP_RAD: f64 = 1e-5;
        for j in 0..3 {
            let mut moved = [joints, joints];
            moved[0][j] += STEP_RAD;
            moved[1][j] -= STEP_RAD;
            let [ahead, behind] = moved.map(|joints| geometry.forward_on(&joints, assembly));
            if let (Ok(ahead), Ok(behind)) = (ahead, behind) {
                let slope = (ahead - behind) / (2.0 * STEP_RAD);
                let column = jacobian.column(j).into_owned();
                prop_assert!((slope - column).norm() < 1e-5 * (1.0 + column.norm()), "{slope} {column}");
            }
        }
    }

    /// The acceleration is what second differences of the forward solution say, on a path with rates and accelerations.
    #[test]
    fn acceleration_agrees_with_second_differences(
        geometry in geometries(), position in positions(), index in 0..8usize, rates in vectors(), turning in vectors(),
    ) {
        let Ok(posture) = geometry.posture(&position, Branch::ALL[index]) else { return Ok(()) };
        prop_assume!(posture.singularity_within(0.2).is_none());
        let joints = posture.joints_rad();
        let [front, back] = geometry.forward(&joints).unwrap();
        let assembly = if (front - position).norm() < (back - position).norm() { Assembly::Front } else { Assembly::Back };
        const STEP_S: f64 = 1e-4;
        let at = |t: f64| geometry.forward_on(&(joints + rates * t + turning * (0.5 * t * t)), assembly);
        let (Ok(ahead), Ok(here), Ok(behind)) = (at(STEP_S), at(0.0), at(-STEP_S)) else { return Ok(()) };
        let differences = (ahead - here * 2.0 + behind) / (STEP_S * STEP_S);
        let acceleration = posture.acceleration_m_s2(&rates, &turning).unwrap();
        prop_assert!((differences - acceleration).norm() < 1e-3 * (1.0 + acceleration.norm()), "{differences} {acceleration}");
    }

    /// Power is equal at both ends, `tau . rho_dot = F . X_dot`, and the velocity maps undo each other (13), (14).
    #[test]
    fn power_passes_through_unchanged(
        geometry in geometries(), position in positions(), index in 0..8usize, force in vectors(), rates in vectors(),
    ) {
        let Ok(posture) = geometry.posture(&position, Branch::ALL[index]) else { return Ok(()) };
        prop_assume!(is_well_placed(&posture));
        let velocity = posture.velocity_m_s(&rates).unwrap();
        let torques = posture.torques_n_m(&force).unwrap();
        let (joint_w, tool_w) = (torques.dot(&rates), force.dot(&velocity));
        prop_assert!((joint_w - tool_w).abs() < 1e-9 * (1.0 + torques.norm() * rates.norm()));
        prop_assert!((posture.rates_rad_s(&velocity).unwrap() - rates).norm() < 1e-8 * (1.0 + rates.norm()));
        let jacobian = posture.jacobian().unwrap();
        prop_assert!((jacobian.transpose() * force - torques).norm() < 1e-9 * (1.0 + torques.norm()));
        // The condition number by its definition: how much the longest image of a unit vector exceeds the shortest.
        let squares = (jacobian.transpose() * jacobian).symmetric_eigenvalues();
        let condition = posture.condition_number().unwrap();
        prop_assert!(1.0 <= condition && ((squares.max() / squares.min()).sqrt() / condition - 1.0).abs() < 1e-3);
        let residual = posture.b_r() * rates - posture.k_r() * velocity;
        prop_assert!(residual.norm() < 1e-12 * (1.0 + rates.norm()));
    }

    /// The serial measure is what (12) says: `l_1 sqrt V_j` over `l_1 l_2`.
    #[test]
    fn serial_measures_follow_the_discriminant(geometry in geometries(), position in positions()) {
        let Ok(posture) = geometry.posture(&position, Branch::ALL[0]) else { return Ok(()) };
        let Dimensions { base_radius_m, platform_radius_m, upper_link_m: l1, lower_link_m: l2, .. } = geometry.dimensions();
        for j in 0..3 {
            let e = direction(&geometry, j);
            let d = position + e * (platform_radius_m - base_radius_m);
            let (r, s, t) = (d.dot(&e), d.z, (d.norm_squared() + l1 * l1 - l2 * l2) / (2.0 * l1));
            let v = (r * r + s * s - t * t).max(0.0);
            prop_assert!((posture.serial_measures()[j] - v.sqrt() / l2).abs() < 1e-7);
        }
    }

    /// Reach by its definition: some joint angle brings the elbow to within a rod's length, and another one to beyond.
    #[test]
    fn reach_is_what_the_definition_says(geometry in geometries(), position in positions()) {
        let Dimensions { base_radius_m, platform_radius_m, upper_link_m, lower_link_m, .. } = geometry.dimensions();
        let mut slack = f64::INFINITY;
        for j in 0..3 {
            let e = direction(&geometry, j);
            let d = position + e * (platform_radius_m - base_radius_m);
            let lengths = (0..3600).map(|k| {
                let (sine, cosine) = (TAU * f64::from(k) / 3600.0).sin_cos();
                (d - (e * cosine + Vector3::z() * sine) * upper_link_m).norm()
            });
            let (least, most) = lengths.fold((f64::INFINITY, 0.0), |(l, m): (f64, f64), v| (l.min(v), m.max(v)));
            slack = slack.min(lower_link_m - least).min(most - lower_link_m);
        }
        prop_assume!(1e-5 < slack.abs());
        prop_assert_eq!(geometry.reaches_to(&position), 0.0 < slack);
        prop_assert_eq!(geometry.inverse(&position).is_ok(), 0.0 < slack);
    }

    /// Whatever comes in, an answer with finite numbers or a typed error comes out.
    #[test]
    fn any_input_is_answered(x in any::<f64>(), y in any::<f64>(), z in any::<f64>()) {
        let geometry = Geometry::default();
        let input = Vector3::new(x, y, z);
        if let Ok(solutions) = geometry.inverse(&input) {
            prop_assert!(solutions.iter().all(|s| s.joints_rad.iter().all(|j| j.is_finite())));
        }
        if let Ok(both) = geometry.forward(&input) {
            prop_assert!(both.iter().all(|p| p.iter().all(|v| v.is_finite())));
        }
    }
}

/// (7) as printed has x and y exchanged: the rods then do not close, except for an arm at 45 degrees.
#[test]
fn the_printed_7_does_not_close_the_loop() {
    let dimensions = Dimensions {
        arm_angles_rad: [
            FRAC_PI_4,
            FRAC_PI_4 + TAU / 3.0,
            FRAC_PI_4 + 2.0 * TAU / 3.0,
        ],
        ..Dimensions::default()
    };
    let geometry = Geometry::new(dimensions).unwrap();
    let position = Vector3::new(0.03, -0.02, -0.17);
    assert!(geometry.reaches_to(&position));
    let Dimensions {
        base_radius_m,
        platform_radius_m,
        upper_link_m: l1,
        lower_link_m: l2,
        ..
    } = dimensions;
    let gap = |j: usize, printed: bool| {
        let e = direction(&geometry, j);
        let d = position + e * (platform_radius_m - base_radius_m);
        let r = if printed {
            d.y * e.x + d.x * e.y
        } else {
            d.x * e.x + d.y * e.y
        };
        let (s, t) = (d.z, (d.norm_squared() + l1 * l1 - l2 * l2) / (2.0 * l1));
        let v = r * r + s * s - t * t;
        let (sine, cosine) = (
            (s * t + r * v.sqrt()) / (r * r + s * s),
            (r * t - s * v.sqrt()) / (r * r + s * s),
        );
        ((d - (e * cosine + Vector3::z() * sine) * l1).norm() - l2).abs()
    };
    assert!((0..3).all(|j| gap(j, false) < 1e-12));
    assert!(
        gap(0, true) < 1e-12,
        "at 45 degrees the exchange does no harm"
    );
    // Not a number where the printed discriminant is negative: no solution at all.
    assert!(
        (1..3).all(|j| gap(j, true).is_nan() || 1e-3 < gap(j, true)),
        "{} {}",
        gap(1, true),
        gap(2, true)
    );
}

/// (2)–(5) as printed give each of the six rods an arm and an elbow of its own, `i = 1..6`, with a platform point of
/// its own. Two rods of a pair would then have to start from one elbow and end side by side, which one length cannot
/// do.
#[test]
fn printed_indices_would_give_a_pair_two_lengths() {
    let geometry = Geometry::default();
    let position = Vector3::new(0.04, 0.01, -0.16);
    let joints = geometry.inverse_on(&position, Branch::ALL[0]).unwrap();
    let elbow = geometry.elbows(&joints).unwrap()[1];
    let e = direction(&geometry, 1);
    let sideways = Vector3::z().cross(&e) * 0.02;
    let ends = [sideways, -sideways]
        .map(|side| position + e * geometry.dimensions().platform_radius_m + side);
    let lengths = ends.map(|end| (end - elbow).norm());
    assert!(1e-3 < (lengths[0] - lengths[1]).abs(), "{lengths:?}");
}

#[test]
fn singularities_are_told_apart() {
    let geometry = Geometry::default();
    // On the axis of a symmetric robot, all arms stretched: |d| = l_1 + l_2 with d = (r_p - r_b) e + z.
    let stretched = Vector3::new(0.0, 0.0, -(0.3_f64.powi(2) - 0.08_f64.powi(2)).sqrt());
    let posture = geometry.posture(&stretched, Branch::ALL[0]).unwrap();
    assert!(matches!(
        posture.singularity_within(1e-6),
        Some(Singularity::Serial { .. })
    ));
    assert!(matches!(
        posture.jacobian(),
        Err(KinematicsError::Singular(Singularity::Serial { .. }))
    ));
    assert!(matches!(
        posture.rates_rad_s(&Vector3::z()),
        Err(KinematicsError::Singular(Singularity::Serial { .. }))
    ));
    // A stretched arm carries a push along its rods without any torque, and says so instead of failing.
    assert!(posture.torques_n_m(&Vector3::z()).unwrap().norm() < 1e-7);

    // Rods flat in the plane of the platform: z = l_1 sin rho and horizontal rods of length l_2, reached with
    // r_b - r_p + l_1 cos rho = l_2.
    let flat = Geometry::new(Dimensions {
        base_radius_m: 0.17,
        ..Dimensions::default()
    })
    .unwrap();
    let cosine: f64 = (0.20 - 0.13) / 0.10;
    let height = 0.10 * (1.0 - cosine * cosine).sqrt();
    let joints = Vector3::repeat(cosine.acos());
    let posture = flat.posture_of(&joints, Assembly::Front).unwrap();
    assert!((posture.position_m() - Vector3::new(0.0, 0.0, height)).norm() < 1e-7);
    assert_eq!(
        posture.singularity_within(1e-6),
        Some(Singularity::Parallel)
    );
    let at_rest = flat
        .posture(&Vector3::new(0.0, 0.0, height), posture.branch())
        .unwrap();
    assert_eq!(
        at_rest.torques_n_m(&Vector3::z()),
        Err(KinematicsError::Singular(Singularity::Parallel))
    );
    assert_eq!(
        at_rest.velocity_m_s(&Vector3::z()),
        Err(KinematicsError::Singular(Singularity::Parallel))
    );

    // Both: arms stretched flat, r_b - r_p + l_1 = -l_2 folded back is out of proportion, so l_1 + l_2 = r_p - r_b.
    let both = Geometry::new(Dimensions {
        base_radius_m: 0.0,
        platform_radius_m: 0.3,
        ..Dimensions::default()
    })
    .unwrap();
    let posture = both.posture(&Vector3::zeros(), Branch::ALL[0]).unwrap();
    assert!(matches!(
        posture.jacobian(),
        Err(KinematicsError::Singular(Singularity::Both { .. }))
    ));
    assert!(posture.condition_number().is_err());
}

/// With `r_b - r_p < l_1` all arms can fold inwards until their sphere centres meet on the robot's axis, at the heights
/// +-0.06 m of the default robot. The platform then swings freely on a sphere of radius `l_2` about that point.
#[test]
fn arms_folded_into_one_point_free_the_platform() {
    let geometry = Geometry::default();
    let folded = Vector3::repeat((-0.08_f64 / 0.10).acos());
    assert_eq!(
        geometry.forward(&folded),
        Err(KinematicsError::ElbowsInLine)
    );
    for (tilt, turn) in [(0.0, 0.0), (0.4, 1.0), (1.1, 4.0)] {
        let (tilt, turn): (f64, f64) = (tilt, turn);
        let swing =
            Vector3::new(tilt.sin() * turn.cos(), tilt.sin() * turn.sin(), tilt.cos()) * 0.20;
        let position = swing + Vector3::new(0.0, 0.0, 0.06);
        let solutions = geometry.inverse(&position).unwrap();
        let branch = solutions
            .iter()
            .find(|s| (s.joints_rad - folded).norm() < 1e-7)
            .unwrap()
            .branch;
        let posture = geometry.posture(&position, branch).unwrap();
        assert!(posture.parallel_measure() < 1e-12);
        assert_eq!(
            posture.jacobian(),
            Err(KinematicsError::Singular(Singularity::Parallel))
        );
    }
}

#[test]
fn impossible_inputs_are_refused_by_name() {
    let geometry = Geometry::default();
    let nan = Vector3::new(0.0, f64::NAN, 0.0);
    assert!(matches!(
        geometry.inverse(&nan),
        Err(KinematicsError::NonFinite {
            quantity: "position_m",
            index: 1,
            ..
        })
    ));
    let infinite = Vector3::new(0.0, 0.0, f64::INFINITY);
    assert!(matches!(
        geometry.forward(&infinite),
        Err(KinematicsError::NonFinite {
            quantity: "joints_rad",
            index: 2,
            ..
        })
    ));
    for far in [
        Vector3::new(1e200, 1e-3, 1.0),
        Vector3::repeat(1e308),
        Vector3::new(0.0, 0.0, 1e6),
    ] {
        assert!(
            matches!(
                geometry.inverse(&far),
                Err(KinematicsError::Unreachable { arm: 1, .. })
            ),
            "{far}"
        );
    }
    // Elbows far outwards, rods shorter than the circle through the elbows.
    let wide = Geometry::new(Dimensions {
        base_radius_m: 0.5,
        ..Dimensions::default()
    })
    .unwrap();
    let refused = wide.forward(&Vector3::zeros()).unwrap_err();
    assert!(
        matches!(refused, KinematicsError::SpheresDoNotMeet { gap_m } if (gap_m - (0.5 + 0.1 - 0.04 - 0.2)).abs() < 1e-12)
    );
    // r_b = r_p + l_1, all arms folded inwards: the three centres meet in one point.
    let inwards = Geometry::new(Dimensions {
        base_radius_m: 0.14,
        ..Dimensions::default()
    })
    .unwrap();
    assert_eq!(
        inwards.forward(&Vector3::repeat(PI)),
        Err(KinematicsError::ElbowsInLine)
    );
    // l_1 = l_2 and r_p = r_b: at the centre every angle of every arm fits.
    let equal = Dimensions {
        base_radius_m: 0.1,
        platform_radius_m: 0.1,
        upper_link_m: 0.2,
        lower_link_m: 0.2,
        ..Dimensions::default()
    };
    let equal = Geometry::new(equal).unwrap();
    assert_eq!(
        equal.inverse(&Vector3::zeros()),
        Err(KinematicsError::Indeterminate { arm: 1 })
    );

    let refused = |dimensions: Dimensions| Geometry::new(dimensions).unwrap_err();
    let d = Dimensions::default();
    assert!(matches!(
        refused(Dimensions {
            upper_link_m: 0.0,
            ..d
        }),
        GeometryError::Length {
            quantity: "upper_link_m",
            ..
        }
    ));
    assert!(matches!(
        refused(Dimensions {
            platform_radius_m: f64::NAN,
            ..d
        }),
        GeometryError::Length { .. }
    ));
    assert!(matches!(
        refused(Dimensions {
            arm_angles_rad: [0.0, TAU, 1.0],
            ..d
        }),
        GeometryError::ArmsCoincide {
            first: 1,
            second: 2
        }
    ));
    assert!(matches!(
        refused(Dimensions {
            arm_angles_rad: [0.0, 1.0, f64::INFINITY],
            ..d
        }),
        GeometryError::Angle { arm: 3, .. }
    ));
    assert_eq!(
        Branch::from_signs([1, 0, -1]),
        Err(BranchError { arm: 2, got: 0 })
    );
}

#[test]
fn branches_count_like_their_signs() {
    for (index, branch) in Branch::ALL.into_iter().enumerate() {
        assert_eq!(branch.index(), index);
        assert_eq!(Branch::from_signs(branch.signs()), Ok(branch));
    }
    assert_eq!(Branch::ALL[1].signs(), [1, 1, -1]);
}

/// A robot whose reach is known: `r_b = r_p` puts all three arms in the centre, and with `l_1 = l_2` each reaches a
/// horn torus of tube radius `l`. On the axis of the robot that is |z| <= 2 l.
#[test]
fn maps_show_the_reach() {
    let l = 0.1;
    let geometry = Geometry::new(Dimensions {
        base_radius_m: 0.05,
        platform_radius_m: 0.05,
        upper_link_m: l,
        lower_link_m: l,
        ..Dimensions::default()
    })
    .unwrap();
    let axis = Region::new(
        Vector3::new(0.0, 0.0, -0.3),
        Vector3::new(0.0, 0.0, 0.3),
        [1, 1, 600],
    )
    .unwrap();
    let map = geometry.map(&axis, Branch::ALL[0]);
    for (k, value) in map.dexterity().iter().enumerate() {
        let z = axis.centre_m([0, 0, k]).z;
        assert_eq!(value.is_some(), z.abs() < 2.0 * l, "{z}");
        assert!(value.is_none_or(|value| (0.0..=1.0).contains(&value)));
    }

    // Volume of the default robot, against random points judged by the inverse alone.
    let geometry = Geometry::default();
    let region = geometry.reachable_region([48, 48, 48]).unwrap();
    let map = geometry.map(&region, Branch::ALL[0]);
    let box_m3 = region.cell_volume_m3() * 48.0_f64.powi(3);
    let (low, high) = (region.centre_m([0, 0, 0]), region.centre_m([47, 47, 47]));
    // Halton's sequence: even, without any chance in it.
    let halton = |mut index: u32, base: u32| {
        let (mut value, mut share) = (0.0, 1.0);
        while 0 < index {
            share /= f64::from(base);
            value += share * f64::from(index % base);
            index /= base;
        }
        value
    };
    let margin = (high - low) / 47.0 / 2.0;
    let hits = (1..=40_000_u32)
        .filter(|&i| {
            let share = Vector3::new(halton(i, 2), halton(i, 3), halton(i, 5));
            geometry
                .inverse(&(low - margin + share.component_mul(&(high - low + margin * 2.0))))
                .is_ok()
        })
        .count();
    let wanted = hits as f64 / 40_000.0 * box_m3;
    assert!(
        (map.reachable_volume_m3() / wanted - 1.0).abs() < 0.02,
        "{} {wanted}",
        map.reachable_volume_m3()
    );
    let mean = map.mean_dexterity().unwrap();
    assert!(0.0 < mean && mean < 1.0);

    // Layer by layer is the same map.
    let layered: Vec<Option<f64>> = region
        .layers()
        .flat_map(|layer| geometry.map(&layer, Branch::ALL[0]).dexterity().to_vec())
        .collect();
    assert_eq!(layered.len(), map.dexterity().len());
    assert!(
        layered
            .iter()
            .zip(map.dexterity())
            .all(|(a, b)| match (a, b) {
                (Some(a), Some(b)) => (a - b).abs() < 1e-9,
                (a, b) => a.is_none() == b.is_none(),
            })
    );
    assert!(matches!(
        Region::new(low, high, [1000, 1000, 2]),
        Err(RegionError::Cells { .. })
    ));
    assert!(matches!(
        Region::new(high, low, [1, 1, 1]),
        Err(RegionError::Edges { axis: 0, .. })
    ));
}
