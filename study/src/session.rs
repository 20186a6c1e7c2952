//! The session that trials are shown in.

use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};
use teleclay_study::file::Presentation;
use ureq::Agent;

/// A healthy server answers in milliseconds; one that builds a fresh block takes longer.
const ANSWER_WITHIN: Duration = Duration::from_secs(20);

/// Where trials are shown.
pub trait Shown {
    /// Shows a presentation from now on.
    ///
    /// # Errors
    /// The session refuses, or is not there.
    fn show(&mut self, presentation: &Presentation, line_seeds: [u64; 2]) -> Result<()>;

    /// A fresh block.
    ///
    /// # Errors
    /// Likewise.
    fn freshen(&mut self) -> Result<()>;

    /// Begins to record; nothing where the server cannot.
    ///
    /// # Errors
    /// Likewise.
    fn record(&mut self, name: &str) -> Result<Option<String>>;

    /// Ends a recording.
    ///
    /// # Errors
    /// Likewise.
    fn end_recording(&mut self, id: &str) -> Result<()>;

    /// Stops the session: every hand is let go of, until somebody clears the stop.
    ///
    /// # Errors
    /// Likewise.
    fn stop(&mut self) -> Result<()>;

    /// Sets the session to what it was before the run.
    ///
    /// # Errors
    /// Likewise.
    fn restore(&mut self) -> Result<()>;
}

/// A session of a server, over HTTP.
pub struct Remote {
    agent: Agent,
    base: String,
    token: Option<String>,
    /// Scheme, material and network before the run.
    before: Value,
}

impl Remote {
    /// Finds the session, and remembers how it is.
    ///
    /// # Errors
    /// The server or the session is not there.
    pub fn find(server: &str, session: &str, token: Option<String>) -> Result<Self> {
        let agent = Agent::config_builder()
            .timeout_global(Some(ANSWER_WITHIN))
            // A problem is an answer, not an error.
            .http_status_as_error(false)
            .build()
            .into();
        let server = server.trim_end_matches('/');
        let mut remote = Self {
            agent,
            base: format!("{server}/api/v1/sessions/{session}"),
            token,
            before: Value::Null,
        };
        let (status, now) = remote.call("GET", "", None)?;
        ensure!(
            status == 200,
            "GET {} answered {status}: {}",
            remote.base,
            detail(&now)
        );
        remote.before = json!({
            "scheme": now["scheme"],
            "material": now["material"],
            "network": now["network"],
        });
        Ok(remote)
    }

    /// Status and body of an answer.
    fn call(&self, method: &str, path: &str, body: Option<&Value>) -> Result<(u16, Value)> {
        let address = format!("{}{path}", self.base);
        let bearer = self.token.as_ref().map(|token| format!("Bearer {token}"));
        let answer = match (method, body) {
            ("GET", _) => {
                let request = self.agent.get(&address);
                match &bearer {
                    Some(bearer) => request.header("Authorization", bearer).call(),
                    None => request.call(),
                }
            }
            (_, body) => {
                let request = match method {
                    "PATCH" => self.agent.patch(&address),
                    _ => self.agent.post(&address),
                };
                let request = match &bearer {
                    Some(bearer) => request.header("Authorization", bearer),
                    None => request,
                };
                request.send_json(body.unwrap_or(&Value::Null))
            }
        };
        let mut answer = answer.with_context(|| format!("{method} {address}"))?;
        let status = answer.status().as_u16();
        let text = answer
            .body_mut()
            .read_to_string()
            .with_context(|| format!("{method} {address}"))?;
        Ok((
            status,
            serde_json::from_str(&text).unwrap_or(Value::String(text)),
        ))
    }

    fn change(&self, method: &str, path: &str, body: &Value) -> Result<Value> {
        let (status, answer) = self.call(method, path, Some(body))?;
        if !(200..300).contains(&status) {
            bail!(
                "{method} {}{path} answered {status}: {}",
                self.base,
                detail(&answer)
            );
        }
        Ok(answer)
    }
}

impl Shown for Remote {
    fn show(&mut self, presentation: &Presentation, line_seeds: [u64; 2]) -> Result<()> {
        let patch = serde_json::to_value(presentation.patch(line_seeds))?;
        self.change("PATCH", "", &patch).map(drop)
    }

    fn freshen(&mut self) -> Result<()> {
        self.change("POST", "/clay/reset", &json!({})).map(drop)
    }

    fn record(&mut self, name: &str) -> Result<Option<String>> {
        let (status, answer) = self.call("POST", "/recordings", Some(&json!({ "name": name })))?;
        match status {
            404 | 405 | 501 => Ok(None),
            200..300 => Ok(answer["id"].as_str().map(str::to_owned)),
            _ => bail!(
                "POST {}/recordings answered {status}: {}",
                self.base,
                detail(&answer)
            ),
        }
    }

    fn end_recording(&mut self, id: &str) -> Result<()> {
        let path = format!("/recordings/{id}/stop");
        self.change("POST", &path, &json!({})).map(drop)
    }

    fn stop(&mut self) -> Result<()> {
        let reason = json!({ "reason": "a participant ends the study" });
        self.change("POST", "/stop", &reason).map(drop)
    }

    fn restore(&mut self) -> Result<()> {
        self.change("PATCH", "", &self.before).map(drop)
    }
}

/// What a problem says, or all of another body.
fn detail(answer: &Value) -> String {
    match (&answer["detail"], answer) {
        (Value::String(detail), _) | (_, Value::String(detail)) => detail.clone(),
        (_, other) => other.to_string(),
    }
}
