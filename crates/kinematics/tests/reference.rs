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
