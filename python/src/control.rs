//! Plants that are run and asked for their response, walls, and what grows by itself past a delay margin.

use pyo3::prelude::*;
use teleclay_control::wall::{self, DelayedWall};
use teleclay_control::{
    Complex, DelayedScheme, DiscreteStateSpace, RationalFunction, State, StateSpace, paper,
};
use teleclay_proto::http::parse;
use teleclay_proto::http::theory::{LoopRequest, TransferFunction};

use crate::arrays::{Flat, Made, array, at, numbers, refused, rows};

/// The plants of the paper and what it leaves open, as the fields of a `LoopRequest` that they are, JSON.
#[pyfunction]
pub(crate) fn plants() -> PyResult<String> {
    let coefficients = |function: &RationalFunction| TransferFunction {
        numerator: function.numerator().coefficients().to_vec(),
        denominator: function.denominator().coefficients().to_vec(),
    };
    let fields = serde_json::json!({
        "g_h": coefficients(&paper::g_hx()),
        "g_h_y": coefficients(&paper::g_hy()),
        "t_h": paper::t_hx().coefficients(),
        "c_h1": coefficients(&paper::default_c_h1()),
        "g_t": coefficients(&paper::default_g_t()),
        "position_ratio": paper::POSITION_RATIO,
        "force_ratio": paper::FORCE_RATIO,
        "hand_force_n": paper::HAND_FORCE_N,
        "edges_m": paper::CUTTING_EDGES_M,
        "clay_damping_n_s_per_m": paper::CUTTING_DAMPING_N_S_PER_M,
        "virtual_mass_kg": paper::HANDLE_MASS_KG,
        "virtual_damping_n_s_per_m": paper::HANDLE_DAMPING_N_S_PER_M,
    });
    Ok(fields.to_string())
}

/// A rational function at frequencies in rad/s, real and imaginary parts in turn; no number at a pole.
#[pyfunction]
pub(crate) fn frequency_response<'py>(
    py: Python<'py>,
    numerator: Vec<f64>,
    denominator: Vec<f64>,
    omega_rad_s: Flat<'py>,
) -> PyResult<Made<'py, f64>> {
    let function = RationalFunction::new(&numerator, &denominator).map_err(refused)?;
    let omegas = numbers(&omega_rad_s)?;
    let none = Complex::new(f64::NAN, f64::NAN);
    let values = omegas.into_iter().flat_map(|omega| {
        let value = function.at_omega(omega).unwrap_or(none);
        [value.re, value.im]
    });
    Ok(array(py, values.collect()))
}

/// What a plant gives for an input, sample by sample, from rest.
#[pyfunction]
pub(crate) fn respond<'py>(
    py: Python<'py>,
    numerator: Vec<f64>,
    denominator: Vec<f64>,
    input: Flat<'py>,
    tick_s: f64,
    method: &str,
) -> PyResult<Made<'py, f64>> {
    let function = RationalFunction::new(&numerator, &denominator).map_err(refused)?;
    let plant = StateSpace::from_rational(&function).map_err(refused)?;
    let sampled: DiscreteStateSpace = match method {
        "zoh" => plant.zoh(tick_s),
        "tustin" => plant.tustin(tick_s),
        _ => {
            return Err(refused(format!(
                "method is {method:?}, need \"zoh\" or \"tustin\""
            )));
        }
    }
    .map_err(refused)?;
    let input = numbers(&input)?;
    let output = py.detach(|| {
        let mut state = State::default();
        let outputs = input.iter().map(|u| sampled.step(&mut state, *u));
        outputs.collect()
    });
    Ok(array(py, output))
}

/// Stiffness at which each wall begins to oscillate; a row is mass, damping, round trip and tick.
#[pyfunction]
pub(crate) fn critical_stiffness<'py>(
    py: Python<'py>,
    walls: Flat<'py>,
) -> PyResult<Made<'py, f64>> {
    let walls = rows::<4>(&walls)?;
    let found: PyResult<_> = (0..walls.len())
        .map(|number| {
            let [mass_kg, damping_n_s_per_m, rtt_s, tick_s] = walls[number];
            wall::critical_stiffness(&DelayedWall {
                mass_kg,
                damping_n_s_per_m,
                rtt_s,
                tick_s,
            })
            .map_err(|error| at("wall", number, walls.len(), error))
        })
        .collect();
    Ok(array(py, found?))
}

/// Greatest stiffness of each sampled wall that stays passive; a row is damping, the wall's own and tick.
#[pyfunction]
pub(crate) fn passive_stiffness<'py>(
    py: Python<'py>,
    walls: Flat<'py>,
) -> PyResult<Made<'py, f64>> {
    let walls = rows::<3>(&walls)?;
    let found: PyResult<_> = (0..walls.len())
        .map(|number| {
            let [damping, own, tick_s] = walls[number];
            wall::passive_stiffness(damping, own, tick_s)
                .map_err(|error| at("wall", number, walls.len(), error))
        })
        .collect();
    Ok(array(py, found?))
}

/// For each clay and each round trip what grows fastest: rate in 1/s and frequency in Hz in turn, no number where
/// nothing grows faster than `slowest_per_s`. Then for each clay the delay margin in s: infinite without one, below
/// zero where the loop is unstable without delay.
#[pyfunction]
pub(crate) fn growth<'py>(
    py: Python<'py>,
    body: &str,
    scheme: &str,
    clay_damping_n_s_per_m: Flat<'py>,
    round_trip_s: Flat<'py>,
    slowest_per_s: f64,
) -> PyResult<(Made<'py, f64>, Made<'py, f64>)> {
    let request: LoopRequest = parse(body.as_bytes()).map_err(refused)?;
    let scheme = match scheme {
        "force_exchange" => DelayedScheme::ForceExchange,
        "position_force" => DelayedScheme::PositionForce,
        _ => {
            return Err(refused(format!(
                "scheme is {scheme:?}, need \"force_exchange\" or \"position_force\""
            )));
        }
    };
    let clays = numbers(&clay_damping_n_s_per_m)?;
    let delays = numbers(&round_trip_s)?;
    if let Some(delay_s) = delays
        .iter()
        .find(|delay_s| !(0.0..=10.0).contains(*delay_s))
    {
        return Err(refused(format!("{delay_s} is not a number from 0 to 10")));
    }
    let found = py.detach(|| {
        let (mut grown, mut margins) = (Vec::new(), Vec::new());
        for clay in clays {
            let request = LoopRequest {
                clay_damping_n_s_per_m: clay,
                ..request.clone()
            };
            let closed = teleclay_theory::loop_input(&request)
                .map_err(|error| error.to_string())?
                .closed_loop()
                .map_err(|error| error.to_string())?;
            let margin = closed
                .delay_margin(scheme)
                .map_err(|error| error.to_string())?;
            margins.push(match margin {
                teleclay_control::DelayMargin::Unbounded => f64::INFINITY,
                teleclay_control::DelayMargin::None(_) => -1.0,
                finite => finite.seconds().unwrap_or(f64::NAN),
            });
            let characteristic = closed
                .characteristic(scheme)
                .map_err(|error| error.to_string())?;
            for delay_s in &delays {
                let fastest = characteristic
                    .fastest_growth(*delay_s, slowest_per_s)
                    .map_err(|error| error.to_string())?;
                grown.extend(fastest.map_or([f64::NAN; 2], |growth| {
                    [growth.rate_per_s, growth.frequency_hz]
                }));
            }
        }
        Ok::<_, String>((grown, margins))
    });
    let (grown, margins) = found.map_err(refused)?;
    Ok((array(py, grown), array(py, margins)))
}
