//! A hand at a running server. Its loop is a thread of Rust; between it and Python stand two rings, and neither waits
//! for the other.
//!
//! ```text
//!   Python: law(batch) ──intent──> ring ──> Drawing ──place──> Pointer <──frames──> WebSocket
//!                ^──────rows────── ring <────────────view─────────┘
//! ```
//!
//! The pointer is that of the page: its coupling, its guard, its watchdogs. A law that says nothing for longer than its
//! patience is late: the thread lets go of the hand by itself, brings the handle to rest, and gives the tool back.

mod conversation;
mod drawing;
mod line;
mod thread;

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use pyo3::create_exception;
use pyo3::exceptions::{PyConnectionError, PyRuntimeError};
use pyo3::prelude::*;
use rtrb::{Consumer, Producer, RingBuffer};

use crate::arrays::{Made, array, refused};
use conversation::join;
use drawing::Intent;
use line::{Address, Line, NoLine};
use thread::{Clock, HandThread, Report, Row, Shared};

/// Rows that may wait for a law: eight seconds, more than any patience.
const ROWS_WAITING: usize = 8192;
/// Intents that may wait for a tick. A law is not that fast; of more, the newest is refused.
const INTENTS_WAITING: usize = 64;
/// How long a law may take, s.
const PATIENCE_S: std::ops::RangeInclusive<f64> = 0.01..=1.0;
/// How often somebody who waits for rows looks whether there are any.
const LOOK_EVERY: Duration = Duration::from_micros(500);

/// Why a hand is over.
#[derive(Debug, thiserror::Error)]
enum Ended {
    #[error("it was asked to leave")]
    Asked,
    #[error("the law said nothing for {silent_s:.3} s, so the hand was let go of")]
    LawLate { silent_s: f64 },
    #[error("the server ended the lease: {0}")]
    Farewell(String),
    #[error("nothing was heard from the server for {silence_s:.1} s")]
    Silent { silence_s: f64 },
    #[error("the loop ended in a fault")]
    Fault,
    #[error("the session changed to what this hand cannot hold: {0}")]
    Changed(String),
    #[error("the line broke: {0}")]
    Line(String),
}

impl Ended {
    /// A word for programs.
    fn word(&self) -> &'static str {
        match self {
            Self::Asked => "asked",
            Self::LawLate { .. } => "law_late",
            Self::Farewell(_) => "farewell",
            Self::Silent { .. } => "silent",
            Self::Fault => "fault",
            Self::Changed(_) => "changed",
            Self::Line(_) => "line",
        }
    }
}

impl From<tungstenite::Error> for Ended {
    fn from(error: tungstenite::Error) -> Self {
        Self::Line(error.to_string())
    }
}

/// Why a hand holds no tool.
#[derive(Debug, thiserror::Error)]
enum NotJoined {
    #[error(transparent)]
    Line(#[from] NoLine),
    #[error("the line broke: {0}")]
    Broke(#[from] tungstenite::Error),
    #[error("refused: {reason}")]
    Refused { reason: String },
    #[error("this hand does not take what was granted: {0}")]
    Grant(String),
    #[error("the server did not answer")]
    Silent,
}

/// What Python reads once a hand is over: a word, the reason in full, and counts by name.
type Told = (&'static str, String, Vec<(&'static str, u64)>);

/// A hand that holds a tool. Several threads of Python use it at once.
#[pyclass(frozen)]
pub(crate) struct Hand {
    shared: Arc<Shared>,
    rows: Mutex<Consumer<Row>>,
    intents: Mutex<Producer<Intent>>,
    thread: Mutex<Option<JoinHandle<Report>>>,
    told: Mutex<Option<Told>>,
    tool: u32,
}

#[pymethods]
impl Hand {
    /// Asks a session for a tool, and starts the loop; nothing is held until the law says so.
    #[new]
    #[pyo3(signature = (url, session, operator, token, authority, patience_s))]
    fn new(
        py: Python<'_>,
        url: String,
        session: String,
        operator: &str,
        token: Option<String>,
        authority: Option<String>,
        patience_s: f64,
    ) -> PyResult<Self> {
        if !PATIENCE_S.contains(&patience_s) {
            return Err(refused(format!(
                "patience_s is {patience_s}, need a number from 0.01 to 1"
            )));
        }
        let address = Address {
            url,
            session,
            token,
            authority,
        };
        let clock = Clock::start();
        let begun = py.detach(|| {
            let mut line = Line::open(&address)?;
            let joined = join(&mut line, operator, || clock.now_ns())?;
            line.stop_waiting().map_err(tungstenite::Error::from)?;
            Ok::<_, NotJoined>((line, joined))
        });
        let (line, joined) = begun.map_err(|error| match error {
            NotJoined::Line(
                NoLine::Address { .. } | NoLine::InTheClear { .. } | NoLine::Authority { .. },
            ) => refused(error),
            NotJoined::Refused { .. } | NotJoined::Line(NoLine::Refused { .. }) => {
                NotGranted::new_err(error.to_string())
            }
            error => PyConnectionError::new_err(error.to_string()),
        })?;
        let (row_producer, row_consumer) = RingBuffer::new(ROWS_WAITING);
        let (intent_producer, intent_consumer) = RingBuffer::new(INTENTS_WAITING);
        let shared = Arc::new(Shared::default());
        let tool = joined.tool;
        let hand = HandThread {
            line,
            joined,
            clock,
            shared: Arc::clone(&shared),
            rows: row_producer,
            intents: intent_consumer,
            patience: Duration::from_secs_f64(patience_s),
        };
        let thread = std::thread::Builder::new()
            .name("hand".to_owned())
            .spawn(|| {
                let report = hand.run();
                // A law that never comes back may keep Python's lock: then nobody else can say it.
                if matches!(report.ended, Ended::LawLate { .. }) {
                    eprintln!("teleclay: {}", report.ended);
                }
                report
            })
            .map_err(refused)?;
        Ok(Self {
            shared,
            rows: row_consumer.into(),
            intents: intent_producer.into(),
            thread: Some(thread).into(),
            told: None.into(),
            tool,
        })
    }

    /// The tool's number, from 1.
    #[getter]
    fn tool(&self) -> u32 {
        self.tool
    }

    /// Whether the loop still runs.
    #[getter]
    fn is_running(&self) -> bool {
        let thread = self.thread.lock().ok();
        thread.is_some_and(|thread| thread.as_ref().is_some_and(|thread| !thread.is_finished()))
    }

    /// Whether the hand was let go of because the law was late.
    #[getter]
    fn was_late(&self) -> bool {
        self.shared.was_late.load(Ordering::Relaxed)
    }

    /// What happened since the last call, once anything did, and how many rows were dropped in all. Nothing when
    /// nothing came in time. Whoever asks runs the law: from the first call on it may be late.
    fn take<'py>(
        &self,
        py: Python<'py>,
        timeout_s: f64,
    ) -> PyResult<Option<(Made<'py, f64>, u64)>> {
        let timeout = Duration::try_from_secs_f64(timeout_s).map_err(refused)?;
        self.shared.is_watched.store(true, Ordering::Relaxed);
        let numbers = py.detach(|| {
            let began = Instant::now();
            let mut rows = self.rows.lock().ok()?;
            while rows.is_empty() {
                if timeout <= began.elapsed() || !self.is_running() {
                    return None;
                }
                std::thread::sleep(LOOK_EVERY);
            }
            let mut numbers = Vec::new();
            while let Ok(row) = rows.pop() {
                numbers.extend(row);
            }
            Some(numbers)
        });
        let dropped = self.shared.dropped.load(Ordering::Relaxed);
        Ok(numbers.map(|numbers| (array(py, numbers), dropped)))
    }

    /// The hand lets go.
    fn let_go(&self) -> PyResult<()> {
        self.intend(Intent::Off)
    }

    /// The hand is drawn to a place, m, by a spring of so much at most, N/m.
    fn go_to(&self, position_m: [f64; 3], stiffness_n_per_m: f64) -> PyResult<()> {
        require_finite("position_m", &position_m)?;
        // Infinite is as stiff as may be.
        if stiffness_n_per_m.is_nan() || stiffness_n_per_m < 0.0 {
            return Err(refused(format!(
                "stiffness_n_per_m is {stiffness_n_per_m}, need a number not below zero"
            )));
        }
        self.intend(Intent::Place {
            position_m,
            stiffness_n_per_m,
        })
    }

    /// The hand pushes, N.
    fn push(&self, force_n: [f64; 3]) -> PyResult<()> {
        require_finite("force_n", &force_n)?;
        self.intend(Intent::Push { force_n })
    }

    /// Lets go, brings the handle to rest and gives the tool back. Waits for that, and tells how it went.
    fn finish(&self, py: Python<'_>) -> PyResult<Told> {
        self.shared.leave.store(true, Ordering::Relaxed);
        let thread = self.thread.lock().map_err(refused)?.take();
        if let Some(thread) = thread {
            let report = py.detach(|| thread.join()).map_err(|_| {
                PyRuntimeError::new_err(
                    "the hand's thread has broken; the server lets go by itself",
                )
            })?;
            *self.told.lock().map_err(refused)? = Some(told(&report));
        }
        let told = self.told.lock().map_err(refused)?.clone();
        told.ok_or_else(|| PyRuntimeError::new_err("this hand is being waited for elsewhere"))
    }
}

impl Hand {
    fn intend(&self, intent: Intent) -> PyResult<()> {
        let mut intents = self.intents.lock().map_err(refused)?;
        // With so many waiting the thread is held up, and this one would be no news.
        let _ = intents.push(intent);
        Ok(())
    }
}

impl Drop for Hand {
    /// The thread never asks for Python's lock, and is over in two seconds at most.
    fn drop(&mut self) {
        self.shared.leave.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.get_mut().ok().and_then(Option::take) {
            let _ = thread.join();
        }
    }
}

create_exception!(
    teleclay,
    NotGranted,
    pyo3::exceptions::PyException,
    "The server grants no tool, for a reason that it says."
);

fn told(report: &Report) -> Told {
    let counts = &report.counts;
    (
        report.ended.word(),
        report.ended.to_string(),
        vec![
            ("ticks", counts.ticks),
            ("given_up", counts.given_up),
            ("gaps", counts.gaps),
            ("guarded", counts.guarded),
            ("sent", counts.sent),
            ("stale", counts.stale),
            ("unheard", counts.unheard),
            ("undecodable", counts.undecodable),
            ("foreign", counts.foreign),
            ("overflowed", counts.overflowed),
            ("unsent", report.unsent),
            ("most_ticks", report.most_ticks.into()),
        ],
    )
}

fn require_finite(name: &str, vector: &[f64; 3]) -> PyResult<()> {
    match vector.iter().find(|number| !number.is_finite()) {
        Some(got) => Err(refused(format!("{name} holds {got}, need finite numbers"))),
        None => Ok(()),
    }
}
