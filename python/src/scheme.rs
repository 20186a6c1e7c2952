//! A scheme whose two ends are Python's. On virtual time alone: there Python's lock may be taken in a tick.
//!
//! The ends take the place of a built-in scheme's controllers, by the same ways by which a session changes its scheme:
//! limits, ramps and watchdogs stay those of every scheme. What each end says to the other beyond pose and force goes
//! in the frame's three free vectors, which the schemes of the wire use for waves and energies.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use teleclay_link::Vec3;
use teleclay_link::deadband::Signal;
use teleclay_link::motion_limiter::Recovery;
use teleclay_link::scheme::{Generation, HandleController, HandlePort, ToolController, ToolPort};
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{HandleFrame, ToolFrame};
use teleclay_sim::rig::Rig;

use crate::arrays::{array, refused};

/// The scheme on the wire whose place is taken: the one that sends nothing beyond pose and force.
const PLACE: Scheme = Scheme::PositionForce;
/// Numbers of a frame as Python sees it: position, velocity, force, and the three free vectors.
const HEARD: usize = 18;
/// Numbers that an end gives back: its answer, and the three free vectors.
const GIVEN: usize = 12;

/// What went wrong first in Python.
#[derive(Clone, Default)]
pub(crate) struct Fault(Arc<Mutex<Option<PyErr>>>);

impl Fault {
    /// Raises it.
    pub(crate) fn raise(&self) -> PyResult<()> {
        let mut first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        first.take().map_or(Ok(()), Err)
    }

    fn keep(&self, error: PyErr) {
        let mut first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        first.get_or_insert(error);
    }
}

/// The two ends: what Python is called with each tick, and whether the tool's reference is a sum of steps.
#[derive(FromPyObject)]
pub(crate) struct Own {
    #[pyo3(attribute("_handle"))]
    handle: Py<PyAny>,
    #[pyo3(attribute("_tool"))]
    tool: Py<PyAny>,
    #[pyo3(attribute("_restart"))]
    restart: Py<PyAny>,
    #[pyo3(attribute("incremental"))]
    incremental: bool,
}

impl Own {
    /// Couples the first operator's two sides by these ends from now on.
    pub(crate) fn take_over(self, rig: &mut Rig) -> Fault {
        let fault = Fault::default();
        let end = |step: Py<PyAny>| End {
            step,
            heard: None,
            said: [[0.0; 3]; 3],
            fault: fault.clone(),
        };
        let handle = OwnHandle(end(self.handle));
        rig.handle_mut().provide(PLACE, Box::new(handle));
        let mut tool: Box<dyn ToolController> = Box::new(OwnTool {
            end: end(self.tool),
            restart: self.restart,
            recovery: if self.incremental {
                Recovery::Incremental
            } else {
                Recovery::Absolute
            },
        });
        let session = rig.session_mut();
        let generation = Generation {
            since_revision: session.revision() as u32,
            epoch: session.clay_epoch(),
        };
        if let Some(side) = session.side_mut(0) {
            side.change_scheme(PLACE, generation, &mut tool);
        }
        fault
    }
}

/// One end.
struct End {
    step: Py<PyAny>,
    /// The newest frame, until it was shown.
    heard: Option<[f64; HEARD]>,
    said: [[f64; 3]; 3],
    fault: Fault,
}

impl End {
    /// A tick: what it gives, or zero once something went wrong.
    fn step(&mut self, now: Timestamp, port: &[Vec3], gain: f64) -> Vec3 {
        let given = Python::attach(|py| self.ask(py, now, port, gain));
        match given {
            Ok(given) => {
                let vector = |from: usize| [given[from], given[from + 1], given[from + 2]];
                self.said = [vector(3), vector(6), vector(9)];
                Vec3::from(vector(0))
            }
            Err(error) => {
                self.fault.keep(error);
                Vec3::zeros()
            }
        }
    }

    fn ask(
        &mut self,
        py: Python<'_>,
        now: Timestamp,
        port: &[Vec3],
        gain: f64,
    ) -> PyResult<[f64; GIVEN]> {
        let numbers = port.iter().flat_map(|vector| <[f64; 3]>::from(*vector));
        let heard = self.heard.take().map(|heard| array(py, heard.to_vec()));
        let now_s = now.as_nanos() as f64 * 1e-9;
        let port = array(py, numbers.collect());
        let given: [f64; GIVEN] = self
            .step
            .call1(py, (now_s, port, heard, gain))?
            .extract(py)?;
        match given.iter().position(|number| !number.is_finite()) {
            Some(at) => Err(refused(format!(
                "a scheme of one's own gave {} for number {at} of {GIVEN}",
                given[at]
            ))),
            None => Ok(given),
        }
    }
}

fn heard(vectors: [[f64; 3]; 6]) -> Option<[f64; HEARD]> {
    Some(std::array::from_fn(|at| vectors[at / 3][at % 3]))
}

struct OwnHandle(End);

impl HandleController for OwnHandle {
    fn on_frame(&mut self, _now: Timestamp, frame: &ToolFrame) {
        self.0.heard = heard([
            frame.position_m,
            frame.velocity_m_s,
            frame.force_n,
            frame.wave,
            frame.wave_integral,
            frame.energy_in_j,
        ]);
    }

    fn reaction(&mut self, now: Timestamp, port: &HandlePort) -> Vec3 {
        let port = [
            port.position,
            port.velocity,
            port.hand_force,
            port.displacement,
            port.felt_force,
        ];
        self.0.step(now, &port, 1.0)
    }

    fn fill(&mut self, frame: &mut HandleFrame) {
        [frame.wave, frame.wave_integral, frame.energy_in_j] = self.0.said;
    }

    fn signal(&self, _frame: &HandleFrame) -> Option<Signal> {
        None
    }
}

struct OwnTool {
    end: End,
    restart: Py<PyAny>,
    recovery: Recovery,
}

impl ToolController for OwnTool {
    fn on_frame(&mut self, _now: Timestamp, frame: &HandleFrame) {
        self.end.heard = heard([
            frame.position_m,
            frame.velocity_m_s,
            frame.hand_force_n,
            frame.wave,
            frame.wave_integral,
            frame.energy_in_j,
        ]);
    }

    fn reference(&mut self, now: Timestamp, port: &ToolPort, remote_gain: f64) -> Vec3 {
        let port = [
            port.position,
            port.velocity,
            port.clay_force,
            port.spring_force,
            port.displacement,
        ];
        self.end.step(now, &port, remote_gain)
    }

    fn reindex(&mut self, handle_position: Vec3) {
        let called = Python::attach(|py| {
            let position = array(py, <[f64; 3]>::from(handle_position).to_vec());
            self.restart.call1(py, (position,)).map(drop)
        });
        if let Err(error) = called {
            self.end.fault.keep(error);
        }
    }

    fn recovery(&self) -> Recovery {
        self.recovery
    }

    fn fill(&mut self, frame: &mut ToolFrame) {
        [frame.wave, frame.wave_integral, frame.energy_in_j] = self.end.said;
    }

    fn signal(&self, _frame: &ToolFrame) -> Option<Signal> {
        None
    }
}
