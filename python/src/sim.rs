//! The loop on virtual time, the latency table's cells, and the naive wall.

use std::sync::{Mutex, MutexGuard, TryLockError};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use teleclay_latency::cell::{Cell, Extent, Profile, cells};
use teleclay_latency::law::Law;
use teleclay_latency::table::Row;
use teleclay_latency::{run, task};
use teleclay_link::conditioner::Impairment;
use teleclay_link::scheme::ClayCopy;
use teleclay_operator::{Intent, Reach, Waypoint};
use teleclay_proto::Scheme;
use teleclay_proto::http::{NewSession, SessionPatch, parse};
use teleclay_proto::join::LoopParameters;
use teleclay_session::Settings;
use teleclay_sim::rig::{self, Setup};
use teleclay_sim::wall::{WallSetup, measured_critical_stiffness as measured};

use crate::arrays::{Made, array, refused};
use crate::clay::Clay;
use crate::scheme::{Fault, Own};

/// Longest run of one call, ticks: an hour.
const MOST_TICKS: u64 = 3_600_000;
/// Numbers of a sample.
const NUMBERS: usize = 23;
/// From question to question whether somebody has pressed Ctrl-C, ticks.
const ASK_EVERY: u64 = 20_000;

/// A simulated person, both sides of the loop, and the lines between them.
#[pyclass]
pub(crate) struct Rig {
    rig: Mutex<rig::Rig>,
    fault: Option<Fault>,
}

#[pymethods]
impl Rig {
    /// A session as REST makes it from `session`, JSON, with `parameters` put in place of its loop's own.
    #[new]
    fn new(session: &str, parameters: &str, own: Option<Own>) -> PyResult<Self> {
        let spec: NewSession = parse(session.as_bytes()).map_err(refused)?;
        let settings = Settings::new(spec).map_err(refused)?;
        let parameters = changed(&settings.parameters, parameters)?;
        let clay = settings.fresh_block().map_err(refused)?;
        let mut rig = rig::Rig::new(Setup {
            parameters,
            clay,
            intent: Intent::Idle,
            lines: settings.lines(),
        })
        .map_err(refused)?;
        let fault = own.map(|own| own.take_over(&mut rig));
        Ok(Self {
            rig: Mutex::new(rig),
            fault,
        })
    }

    /// Runs so many ticks. Of every `every`th: time, s; force of the hand, felt force, force of the clay, N; positions
    /// of handle and tool, m; their velocities, m/s; energy in the channel, J.
    fn run<'py>(&self, py: Python<'py>, ticks: u64, every: u64) -> PyResult<Made<'py, f64>> {
        if MOST_TICKS < ticks || every == 0 {
            return Err(refused(format!(
                "{ticks} ticks, of which every {every}th is kept, need {MOST_TICKS} at most and every first at least"
            )));
        }
        let mut rig = self.free()?;
        let mut samples = Vec::with_capacity((ticks / every + 1) as usize * NUMBERS);
        let mut left = ticks;
        while 0 < left {
            let now = left.min(ASK_EVERY);
            let rig = &mut *rig;
            let samples = &mut samples;
            py.detach(move || {
                for tick in 0..now {
                    rig.tick();
                    if (ticks - left + tick + 1).is_multiple_of(every) {
                        sample(rig, samples);
                    }
                }
            });
            left -= now;
            py.check_signals()?;
            if let Some(fault) = &self.fault {
                fault.raise()?;
            }
        }
        Ok(array(py, samples))
    }

    /// What the person does from now on.
    fn intend(&self, what: &str, numbers: Vec<f64>) -> PyResult<()> {
        let intent = intent(what, &numbers)?;
        self.free()?.device_mut().intend(intent);
        Ok(())
    }

    /// Changes settings as `PATCH` does, JSON.
    fn patch(&self, patch: &str) -> PyResult<()> {
        let patch: SessionPatch = parse(patch.as_bytes()).map_err(refused)?;
        let mut rig = self.free()?;
        let settings = rig.session().settings().patched(&patch).map_err(refused)?;
        if patch.scheme.is_some() && self.fault.is_some() {
            return Err(refused(
                "this rig runs a scheme of its own, and cannot change to another",
            ));
        }
        if patch.network.is_some() {
            rig.impair(settings.lines());
        }
        rig.patch(patch);
        Ok(())
    }

    /// A copy of the clay as the server has it.
    fn clay(&self) -> PyResult<Clay> {
        Ok(self.free()?.session().clay().clone().into())
    }

    /// The hash of the handle's copy, and of the server's clay.
    fn hashes(&self) -> PyResult<(Option<String>, String)> {
        let rig = self.free()?;
        let digits = |clay: &teleclay_clay::Clay| format!("{:016x}", clay.clone().hash());
        let copy = rig.clay_copy().and_then(ClayCopy::copy);
        Ok((
            copy.map(|copy| digits(copy.clay())),
            digits(rig.session().clay()),
        ))
    }

    /// The parameters of the loop, JSON.
    fn parameters(&self) -> PyResult<String> {
        let rig = self.free()?;
        let session = rig.session();
        let parameters = session.settings().parameters_at(session.revision());
        serde_json::to_string(&parameters).map_err(refused)
    }

    #[getter]
    fn now_s(&self) -> PyResult<f64> {
        Ok(self.free()?.now().as_nanos() as f64 * 1e-9)
    }

    #[getter]
    fn least_energy_j(&self) -> PyResult<f64> {
        Ok(self.free()?.least_energy_j())
    }

    /// Frames up and down.
    #[getter]
    fn frames_sent(&self) -> PyResult<[u64; 2]> {
        Ok(self.free()?.frames_sent())
    }
}

impl Rig {
    /// The rig, unless another thread is running it: waiting for it here would keep Python's lock from it.
    fn free(&self) -> PyResult<MutexGuard<'_, rig::Rig>> {
        self.rig.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => {
                PyRuntimeError::new_err("another thread is running this rig")
            }
            TryLockError::Poisoned(_) => PyRuntimeError::new_err("this rig has broken in a run"),
        })
    }
}

fn sample(rig: &rig::Rig, to: &mut Vec<f64>) {
    let handle = rig.device().sample();
    let tool = rig.tool().view();
    to.push(rig.now().as_nanos() as f64 * 1e-9);
    for vector in [
        handle.hand_force_n,
        rig.last().felt_force_n,
        tool.force_n,
        handle.position_m,
        tool.position_m,
        handle.velocity_m_s,
        tool.velocity_m_s,
    ] {
        to.extend(vector);
    }
    to.push(rig.energy_j());
}

/// Parameters with some of their fields changed.
fn changed(parameters: &LoopParameters, changes: &str) -> PyResult<LoopParameters> {
    let mut fields = serde_json::to_value(parameters).map_err(refused)?;
    let changes: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(changes).map_err(refused)?;
    if let Some(fields) = fields.as_object_mut() {
        fields.extend(changes);
    }
    let text = serde_json::to_vec(&fields).map_err(refused)?;
    parse(&text).map_err(refused)
}

fn intent(what: &str, numbers: &[f64]) -> PyResult<Intent> {
    let made = match (what, numbers) {
        ("idle", []) => Ok(Intent::Idle),
        ("force", [x, y, z]) => Intent::constant_force([*x, *y, *z]),
        ("sensor_force", [x, y, z]) => Intent::sensor_force([*x, *y, *z]),
        ("sinusoid", [x, y, z, frequency_hz]) => Intent::sinusoid([*x, *y, *z], *frequency_hz),
        ("cutting", [x_m, y_m, depth_m]) => Intent::cutting(Reach {
            x_m: *x_m,
            y_m: *y_m,
            depth_m: *depth_m,
        }),
        ("path", numbers) => {
            let waypoints = numbers.as_chunks::<4>().0.iter().map(|row| Waypoint {
                position_m: [row[0], row[1], row[2]],
                speed_m_s: row[3],
            });
            Intent::trajectory(&waypoints.collect::<Vec<_>>())
        }
        _ => {
            return Err(refused(format!(
                "nobody intends {what} with {} numbers",
                numbers.len()
            )));
        }
    };
    made.map_err(refused)
}

/// The cells of the table for one scheme: delay in ms, share of jitter, loss, and the special line.
#[pyfunction]
pub(crate) fn latency_cells(extent: &str) -> PyResult<Vec<(u32, f64, f64, &'static str)>> {
    let extent = match extent {
        "quick" => Extent::Quick,
        "full" => Extent::Full,
        _ => {
            return Err(refused(format!(
                "extent is {extent:?}, need \"quick\" or \"full\""
            )));
        }
    };
    let of_one = cells(extent)
        .into_iter()
        .filter(|cell| cell.scheme == Law::Of(Scheme::Replica));
    Ok(of_one
        .map(|cell| {
            (
                cell.delay_ms,
                cell.jitter_ratio,
                cell.loss,
                cell.profile.word(),
            )
        })
        .collect())
}

/// A row of the latency table, JSON: one cell under a scheme, from so many seeds. `own` makes the ends of a scheme of
/// one's own, anew for each run.
#[pyfunction]
pub(crate) fn latency_cell(
    py: Python<'_>,
    scheme: &str,
    line: (u32, f64, f64, String),
    seeds: Vec<u64>,
    own: Option<Py<PyAny>>,
) -> PyResult<String> {
    let (delay_ms, jitter_ratio, loss, profile) = line;
    let profile = Profile::ALL
        .into_iter()
        .find(|known| known.word() == profile)
        .ok_or_else(|| refused(format!("there is no line {profile:?}")))?;
    let share = |name: &str, value: f64| {
        if (0.0..=1.0).contains(&value) {
            Ok(value)
        } else {
            Err(refused(format!(
                "{name} is {value}, need a number from 0 to 1"
            )))
        }
    };
    if 1000 < delay_ms {
        return Err(refused(format!(
            "delay_ms is {delay_ms}, need 1000 at most"
        )));
    }
    let named = match own {
        Some(_) => Scheme::ForceExchange,
        None => Scheme::ALL
            .iter()
            .copied()
            .find(|known| known.word() == scheme)
            .ok_or_else(|| refused(format!("there is no scheme {scheme:?}")))?,
    };
    let cell = Cell {
        scheme: Law::Of(named),
        delay_ms,
        jitter_ratio: share("jitter_ratio", jitter_ratio)?,
        loss: share("loss", loss)?,
        profile,
    };
    let first = seeds.first().copied().ok_or_else(|| refused("no seeds"))?;
    let rig = |cell: &Cell, seed: u64| {
        let mut rig = task::rig(cell, seed).map_err(refused)?;
        let fault = match &own {
            Some(make) => Some(make.call0(py)?.extract::<Own>(py)?.take_over(&mut rig)),
            None => None,
        };
        Ok::<_, PyErr>((rig, fault))
    };
    let mut outcomes = Vec::with_capacity(seeds.len());
    for seed in &seeds {
        py.check_signals()?;
        let (ideal, fault) = rig(&cell.reference(), *seed)?;
        let reference = py.detach(|| run::reference_on(ideal, &cell, *seed));
        fault.map_or(Ok(()), |fault| fault.raise())?;
        let (real, fault) = rig(&cell, *seed)?;
        outcomes.push(py.detach(|| run::run_on(real, &cell, *seed, &reference)));
        fault.map_or(Ok(()), |fault| fault.raise())?;
    }
    serde_json::to_string(&Row::of(&cell, first, &outcomes)).map_err(refused)
}

/// Stiffness at which the naive wall turns unstable in a run, N/m, to a thousandth.
#[pyfunction]
pub(crate) fn measured_critical_stiffness(
    py: Python<'_>,
    mass_kg: f64,
    damping_n_s_per_m: f64,
    rtt_s: f64,
    tick_s: f64,
    between_n_per_m: (f64, f64),
) -> PyResult<f64> {
    let (low, high) = between_n_per_m;
    let are_good = [mass_kg, damping_n_s_per_m, tick_s, low, high]
        .iter()
        .all(|number| number.is_finite() && 0.0 < *number);
    if !are_good || !(0.0..=2.0).contains(&rtt_s) || tick_s < 1e-5 || high <= low {
        return Err(refused(
            "need mass, damping and tick above zero, a round trip up to 2 s, and two stiffnesses in order",
        ));
    }
    // Each way in whole ticks, as far as the round trip is: a line delivers at ticks.
    let up_s = (rtt_s / tick_s / 2.0).floor() * tick_s;
    let way = |delay_s: f64| Impairment {
        delay: Duration::from_secs_f64(delay_s.max(0.0)),
        ..Impairment::default()
    };
    let setup = WallSetup {
        mass_kg,
        damping_n_s_per_m,
        tick_s,
        up: way(up_s),
        down: way(rtt_s - up_s),
    };
    Ok(py.detach(|| measured(&setup, low, high)))
}
