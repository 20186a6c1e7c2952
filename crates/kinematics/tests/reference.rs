//! Cases computed and closed by other means: joints and positions to 1e-9, Jacobians to 1e-6.

use serde_json::Value;
use std::f64::consts::TAU;
use teleclay_kinematics::{Branch, Dimensions, Geometry, KinematicsError, Matrix3, Vector3};

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_row_slice(&numbers(value))
}

fn geometry(value: &Value) -> Geometry {
    let length = |name: &str| value[name].as_f64().unwrap();
    let angles = numbers(&value["arm_angles_deg"]);
    Geometry::new(Dimensions {
        base_radius_m: length("base_radius_m"),
        platform_radius_m: length("platform_radius_m"),
        upper_link_m: length("upper_link_m"),
        lower_link_m: length("lower_link_m"),
        arm_angles_rad: [
            angles[0].to_radians(),
            angles[1].to_radians(),
            angles[2].to_radians(),
        ],
    })
    .unwrap()
}

/// Difference of two angles, whole turns aside.
fn apart(a: f64, b: f64) -> f64 {
    let difference = (a - b).rem_euclid(TAU);
    difference.min(TAU - difference)
}

#[test]
fn solutions_agree_with_the_reference() {
    let sets: Value = serde_json::from_str(include_str!("reference/cases.json")).unwrap();
    let mut cases = 0;
    for set in sets.as_array().unwrap() {
        let geometry = geometry(&set["geometry"]);
        for case in set["reachable"].as_array().unwrap() {
            cases += 1;
            let position = vector(&case["position_m"]);
            let solutions = geometry.inverse(&position).unwrap();
            for (branch, solution) in Branch::ALL.into_iter().zip(&solutions) {
                assert_eq!(solution.branch, branch);
                let wanted = vector(&case["joints_rad"][branch.index()]);
                let alone = geometry.inverse_on(&position, branch).unwrap();
                for j in 0..3 {
                    assert!(apart(solution.joints_rad[j], wanted[j]) < 1e-9, "{case}");
                    assert!(apart(alone[j], wanted[j]) < 1e-9, "{case}");
                }
                let [front, back] = geometry.forward(&wanted).unwrap();
                let error = (front - position).norm().min((back - position).norm());
                assert!(error < 1e-9, "forward misses by {error} m");
            }
            let posture = geometry.posture(&position, Branch::ALL[0]).unwrap();
            let wanted =
                Matrix3::from_fn(|row, column| case["jacobian"][row][column].as_f64().unwrap());
            assert!(
                (posture.jacobian().unwrap() - wanted).abs().max() < 1e-6,
                "{case}"
            );
            let condition = case["condition_number"].as_f64().unwrap();
            assert!(
                (posture.condition_number().unwrap() / condition - 1.0).abs() < 1e-6,
                "{case}"
            );
        }
        for position in set["unreachable_m"].as_array().unwrap() {
            let refused = geometry.inverse(&vector(position)).unwrap_err();
            assert!(
                matches!(refused, KinematicsError::Unreachable { discriminant_m2, .. } if discriminant_m2 < 0.0)
            );
        }
    }
    assert_eq!(cases, 18);
}

/// Arm by arm: the reference's angles on every branch, links and rods of their lengths, and of a place out of reach the
/// arms that do not get there.
#[test]
fn arms_by_themselves_agree_with_the_reference() {
    let sets: Value = serde_json::from_str(include_str!("reference/cases.json")).unwrap();
    let (mut bends, mut short) = (0, 0);
    for set in sets.as_array().unwrap() {
        let geometry = geometry(&set["geometry"]);
        let lengths = geometry.dimensions();
        for case in set["reachable"].as_array().unwrap() {
            let position = vector(&case["position_m"]);
            for branch in Branch::ALL {
                let wanted = vector(&case["joints_rad"][branch.index()]);
                for (j, arm) in geometry.arms(&position, branch).into_iter().enumerate() {
                    let bend = arm.bend.unwrap();
                    assert!(apart(bend.joint_rad, wanted[j]) < 1e-9, "{case}");
                    let upper_m = (bend.elbow_m - arm.shoulder_m).norm();
                    let lower_m = (bend.elbow_m - arm.wrist_m).norm();
                    assert!((upper_m - lengths.upper_link_m).abs() < 1e-12);
                    assert!((lower_m - lengths.lower_link_m).abs() < 1e-9);
                    assert!((arm.shoulder_m.norm() - lengths.base_radius_m).abs() < 1e-12);
                    let across_m = (arm.wrist_m - position).norm();
                    assert!((across_m - lengths.platform_radius_m).abs() < 1e-12);
                    let angle_rad = arm.direction.y.atan2(arm.direction.x);
                    assert!(apart(angle_rad, lengths.arm_angles_rad[j]) < 1e-12);
                    bends += 1;
                }
            }
        }
        for position in set["unreachable_m"].as_array().unwrap() {
            let arms = geometry.arms(&vector(position), Branch::ALL[0]);
            let refused: Vec<_> = arms.iter().filter_map(|arm| arm.bend.err()).collect();
            let first = geometry.inverse(&vector(position)).unwrap_err();
            assert_eq!(refused.first(), Some(&first));
            short += refused.len();
        }
    }
    assert_eq!(bends, 18 * 8 * 3);
    assert!(0 < short);
}

/// Of three arms the one that is too short is told, and the others bend as they would without it.
#[test]
fn an_arm_that_does_not_reach_keeps_none_of_the_others() {
    let geometry = Geometry::default();
    let position = Vector3::new(0.3, 0.0, 0.1);
    let arms = geometry.arms(&position, Branch::ALL[7]);
    let reaches = arms.map(|arm| arm.bend.is_ok());
    assert_eq!(reaches, [true, false, false]);
    let nowhere = geometry.arms(&Vector3::new(f64::NAN, 0.0, 0.0), Branch::ALL[0]);
    assert!(nowhere.iter().all(|arm| arm.bend.is_err()));
}
