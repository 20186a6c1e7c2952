//! The robot, for many points at once.

use pyo3::prelude::*;
use teleclay_kinematics::{Branch, Dimensions, Geometry, KinematicsError, Matrix3, Vector3};

use crate::arrays::{Flat, Made, array, at, refused, rows};

/// What becomes of a point that has no answer.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Missing {
    /// The call fails.
    Raises,
    /// Its numbers are none.
    IsNan,
}

impl Missing {
    fn named(word: &str) -> PyResult<Self> {
        match word {
            "raise" => Ok(Self::Raises),
            "nan" => Ok(Self::IsNan),
            _ => Err(refused(format!(
                "unreachable is {word:?}, need \"raise\" or \"nan\""
            ))),
        }
    }
}

/// Lengths in m, then the directions of the arms in degrees, in the order of REST's `RobotGeometry`.
fn geometry(raw: [f64; 7]) -> PyResult<Geometry> {
    let [
        base_radius_m,
        platform_radius_m,
        upper_link_m,
        lower_link_m,
        angles_deg @ ..,
    ] = raw;
    Geometry::new(Dimensions {
        base_radius_m,
        platform_radius_m,
        upper_link_m,
        lower_link_m,
        arm_angles_rad: angles_deg.map(f64::to_radians),
    })
    .map_err(refused)
}

/// Calculates `N` numbers for each row, without Python's lock.
fn each<const IN: usize, const OUT: usize>(
    py: Python<'_>,
    (name, points): (&str, Vec<[f64; IN]>),
    missing: Missing,
    calculate: impl Fn(&[f64; IN]) -> Result<[f64; OUT], KinematicsError> + Sync,
) -> PyResult<Vec<f64>> {
    let found = py.detach(|| {
        let mut found = Vec::with_capacity(OUT * points.len());
        for (number, point) in points.iter().enumerate() {
            match calculate(point) {
                Ok(numbers) => found.extend(numbers),
                Err(_) if missing == Missing::IsNan => found.extend([f64::NAN; OUT]),
                Err(error) => return Err((number, error)),
            }
        }
        Ok(found)
    });
    found.map_err(|(number, error)| at(name, number, points.len(), error))
}

fn branch(signs: [i64; 3]) -> PyResult<Branch> {
    Branch::from_signs(signs).map_err(refused)
}

/// All eight joint sets of each position: 8 x 3 numbers a position.
#[pyfunction]
pub(crate) fn inverse<'py>(
    py: Python<'py>,
    raw: [f64; 7],
    position_m: Flat<'py>,
    unreachable: &str,
) -> PyResult<Made<'py, f64>> {
    let geometry = geometry(raw)?;
    let points = ("position_m", rows::<3>(&position_m)?);
    let found = each(py, points, Missing::named(unreachable)?, |point| {
        let solutions = geometry.inverse(&Vector3::from(*point))?;
        let mut joints = [0.0; 24];
        for (to, solution) in joints.as_chunks_mut::<3>().0.iter_mut().zip(solutions) {
            *to = solution.joints_rad.into();
        }
        Ok(joints)
    })?;
    Ok(array(py, found))
}

/// The joint set of one branch for each position.
#[pyfunction]
pub(crate) fn inverse_on<'py>(
    py: Python<'py>,
    raw: [f64; 7],
    position_m: Flat<'py>,
    signs: [i64; 3],
    unreachable: &str,
) -> PyResult<Made<'py, f64>> {
    let (geometry, branch) = (geometry(raw)?, branch(signs)?);
    let points = ("position_m", rows::<3>(&position_m)?);
    let found = each(py, points, Missing::named(unreachable)?, |point| {
        let joints_rad = geometry.inverse_on(&Vector3::from(*point), branch)?;
        Ok(joints_rad.into())
    })?;
    Ok(array(py, found))
}

/// Both positions of each joint set: 2 x 3 numbers.
#[pyfunction]
pub(crate) fn forward<'py>(
    py: Python<'py>,
    raw: [f64; 7],
    joints_rad: Flat<'py>,
    unreachable: &str,
) -> PyResult<Made<'py, f64>> {
    let geometry = geometry(raw)?;
    let points = ("joints_rad", rows::<3>(&joints_rad)?);
    let found = each(py, points, Missing::named(unreachable)?, |joints| {
        let [front, back] = geometry.forward(&Vector3::from(*joints))?;
        Ok([front.x, front.y, front.z, back.x, back.y, back.z])
    })?;
    Ok(array(py, found))
}

/// The three elbows of each joint set: 3 x 3 numbers.
#[pyfunction]
pub(crate) fn elbows<'py>(
    py: Python<'py>,
    raw: [f64; 7],
    joints_rad: Flat<'py>,
) -> PyResult<Made<'py, f64>> {
    let geometry = geometry(raw)?;
    let points = ("joints_rad", rows::<3>(&joints_rad)?);
    let found = each(py, points, Missing::Raises, |joints| {
        let elbows = geometry.elbows(&Vector3::from(*joints))?;
        Ok(flat(&elbows.map(Into::into)))
    })?;
    Ok(array(py, found))
}

/// Of each position 26 numbers: the Jacobian by rows, its condition number, the joints, the elbows, the three serial
/// measures and the parallel one.
#[pyfunction]
pub(crate) fn jacobian<'py>(
    py: Python<'py>,
    raw: [f64; 7],
    position_m: Flat<'py>,
    signs: [i64; 3],
    unreachable: &str,
) -> PyResult<Made<'py, f64>> {
    let (geometry, branch) = (geometry(raw)?, branch(signs)?);
    let points = ("position_m", rows::<3>(&position_m)?);
    let found = each(py, points, Missing::named(unreachable)?, |point| {
        let posture = geometry.posture(&Vector3::from(*point), branch)?;
        let joints = posture.joints_rad();
        let mut numbers = [0.0; 26];
        numbers[..9].copy_from_slice(&by_rows(&posture.jacobian()?));
        numbers[9] = posture.condition_number()?;
        numbers[10..13].copy_from_slice(joints.as_slice());
        numbers[13..22].copy_from_slice(&flat(&geometry.elbows(&joints)?.map(Into::into)));
        numbers[22..25].copy_from_slice(posture.serial_measures().as_slice());
        numbers[25] = posture.parallel_measure();
        Ok(numbers)
    })?;
    Ok(array(py, found))
}

/// Joint torques that hold a force at each position; a row is a position and a force.
#[pyfunction]
pub(crate) fn torques<'py>(
    py: Python<'py>,
    raw: [f64; 7],
    position_m_and_force_n: Flat<'py>,
    signs: [i64; 3],
    unreachable: &str,
) -> PyResult<Made<'py, f64>> {
    let (geometry, branch) = (geometry(raw)?, branch(signs)?);
    let points = ("position_m", rows::<6>(&position_m_and_force_n)?);
    let found = each(py, points, Missing::named(unreachable)?, |row| {
        let [x, y, z, force @ ..] = *row;
        let posture = geometry.posture(&Vector3::new(x, y, z), branch)?;
        Ok(posture.torques_n_m(&Vector3::from(force))?.into())
    })?;
    Ok(array(py, found))
}

fn flat(rows: &[[f64; 3]; 3]) -> [f64; 9] {
    std::array::from_fn(|at| rows[at / 3][at % 3])
}

fn by_rows(matrix: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|at| matrix[(at / 3, at % 3)])
}
