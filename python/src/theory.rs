//! The calls of the theory, as REST has them: a body goes in, the answer comes out, both JSON. So a value is the
//! server's to the last bit, and has its name.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use teleclay_proto::http::parse;
use teleclay_theory::Unanswered;

use crate::arrays::refused;

/// From question to question whether somebody has pressed Ctrl-C.
const ASK_EVERY: Duration = Duration::from_millis(200);

/// Answers `call`, one of `analyse`, `tune`, `cutting` and `workspace`.
#[pyfunction]
pub(crate) fn theory(py: Python<'_>, call: &str, body: &str) -> PyResult<String> {
    let body = body.as_bytes();
    match call {
        "analyse" => {
            let request = parse(body).map_err(refused)?;
            said(py.detach(|| teleclay_theory::analyse(&request)))
        }
        "tune" => {
            let request = parse(body).map_err(refused)?;
            let mut patience = Patience::new();
            let answer = py.detach(|| teleclay_theory::tune(&request, || patience.lasts()));
            patience.judged(answer)
        }
        "cutting" => {
            let request = parse(body).map_err(refused)?;
            let mut patience = Patience::new();
            let answer = py.detach(|| teleclay_theory::cutting(&request, |_| patience.lasts()));
            patience.judged(answer)
        }
        "workspace" => {
            let request = parse(body).map_err(refused)?;
            said(py.detach(|| teleclay_theory::workspace(&request)))
        }
        _ => Err(refused(format!("the theory has no call {call}"))),
    }
}

fn said(answer: Result<impl serde::Serialize, Unanswered>) -> PyResult<String> {
    serde_json::to_string(&answer.map_err(refused)?).map_err(refused)
}

/// Looks up now and then whether somebody has pressed Ctrl-C.
struct Patience {
    asked: Instant,
    interrupted: Option<PyErr>,
}

impl Patience {
    fn new() -> Self {
        Self {
            asked: Instant::now(),
            interrupted: None,
        }
    }

    fn lasts(&mut self) -> ControlFlow<()> {
        if ASK_EVERY <= self.asked.elapsed() {
            self.interrupted = Python::attach(|py| py.check_signals().err());
            self.asked = Instant::now();
        }
        match self.interrupted {
            Some(_) => ControlFlow::Break(()),
            None => ControlFlow::Continue(()),
        }
    }

    fn judged(self, answer: Result<impl serde::Serialize, Unanswered>) -> PyResult<String> {
        match self.interrupted {
            Some(error) => Err(error),
            None => said(answer),
        }
    }
}
