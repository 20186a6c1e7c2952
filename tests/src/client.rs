//! The server's HTTP interface, as any script would use it.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};
use serde_json::Value;
use teleclay_proto::http::{ClayState, Session};
use ureq::Agent;

use crate::process::wait_for;

/// A healthy server answers in milliseconds; a busy machine may need more.
const ANSWER_WITHIN: Duration = Duration::from_secs(20);

/// Asks one server.
#[derive(Clone, Debug)]
pub struct Client {
    agent: Agent,
    origin: String,
    token: Option<String>,
}

impl Client {
    /// For the server at `address`.
    pub fn new(address: SocketAddr, token: Option<&str>) -> Self {
        let agent = Agent::config_builder()
            .timeout_global(Some(ANSWER_WITHIN))
            // A problem is an answer, not an error.
            .http_status_as_error(false)
            .build()
            .into();
        Self {
            agent,
            origin: format!("http://{address}"),
            token: token.map(str::to_owned),
        }
    }

    /// Whether the loop runs and Zenoh is up.
    pub fn is_ready(&self) -> bool {
        self.agent
            .get(format!("{}/readyz", self.origin))
            .call()
            .is_ok_and(|answer| answer.status() == 200)
    }

    /// The session as it is.
    ///
    /// # Errors
    /// There is none, or the server is not there.
    pub fn session(&self, id: &str) -> Result<Session> {
        let text = self.read(&format!("/sessions/{id}"))?;
        let mut session: Session =
            serde_json::from_str(&text).with_context(|| format!("session {id} answered {text}"))?;
        ensure_the_volume_balances(&session.clay)?;
        session.tools.sort_by_key(|tool| tool.id);
        Ok(session)
    }

    /// Waits until the session is as `is_wanted` says.
    ///
    /// # Errors
    /// It never was, or the volume balance of its clay did not hold meanwhile.
    pub fn session_when(
        &self,
        id: &str,
        what: &str,
        patience: Duration,
        mut is_wanted: impl FnMut(&Session) -> bool,
    ) -> Result<Session> {
        let mut last = None;
        let found = wait_for(what, patience, || match self.session(id) {
            Ok(session) if is_wanted(&session) => Some(Ok(session)),
            Ok(session) => {
                last = Some(session);
                None
            }
            Err(error) => Some(Err(error)),
        });
        match found {
            Ok(session) => session,
            Err(error) => Err(error.context(format!("the session was last seen as {last:?}"))),
        }
    }

    /// Lets `ticks` ticks of the session pass.
    ///
    /// # Errors
    /// The loop stands still, or the server is not there.
    pub fn let_pass(&self, id: &str, ticks: u64) -> Result<Session> {
        let until = self.session(id)?.control_loop.ticks + ticks;
        let patience = Duration::from_millis(ticks) + ANSWER_WITHIN;
        self.session_when(id, "ticks to pass", patience, |session| {
            until <= session.control_loop.ticks
        })
    }

    /// Makes a session.
    ///
    /// # Errors
    /// The server refuses.
    pub fn create(&self, new: &Value) -> Result<()> {
        self.send("POST", "/sessions", new).map(drop)
    }

    /// Changes a session.
    ///
    /// # Errors
    /// The server refuses.
    pub fn patch(&self, id: &str, change: &Value) -> Result<()> {
        self.send("PATCH", &format!("/sessions/{id}"), change)
            .map(drop)
    }

    /// Changes a session, and gives status and body of the answer, whatever it is.
    ///
    /// # Errors
    /// The server does not answer.
    pub fn try_to_patch(&self, id: &str, change: &Value) -> Result<(u16, Value)> {
        let (status, text) = self.call("PATCH", &format!("/sessions/{id}"), change)?;
        Ok((status, serde_json::from_str(&text)?))
    }

    /// Ends a session.
    ///
    /// # Errors
    /// The server refuses.
    pub fn delete(&self, id: &str) -> Result<()> {
        let address = format!("{}/api/v1/sessions/{id}", self.origin);
        let mut request = self.agent.delete(address);
        if let Some(token) = &self.token {
            request = request.header("Authorization", format!("Bearer {token}"));
        }
        let answer = request.call().with_context(|| format!("DELETE {id}"))?;
        ensure!(answer.status() == 204, "answered {}", answer.status());
        Ok(())
    }

    /// Asks for anything under `/api/v1`, and gives status and body of the answer, whatever they are.
    ///
    /// # Errors
    /// The server does not answer, or not in JSON.
    pub fn ask(&self, path: &str) -> Result<(u16, Value)> {
        let mut answer = self.get(path)?;
        let text = answer.body_mut().read_to_string()?;
        let body = serde_json::from_str(&text).with_context(|| text.clone())?;
        Ok((answer.status().as_u16(), body))
    }

    /// Asks for something to be done under `/api/v1`, and gives status and body of the answer, whatever they are.
    ///
    /// # Errors
    /// The server does not answer, or not in JSON.
    pub fn post(&self, path: &str, body: &Value) -> Result<(u16, Value)> {
        let (status, text) = self.call("POST", path, body)?;
        Ok((
            status,
            serde_json::from_str(&text).with_context(|| text.clone())?,
        ))
    }

    /// Puts a file under `/api/v1`, and gives the answer.
    ///
    /// # Errors
    /// The server refuses.
    pub fn put_file(&self, path: &str, media_type: &str, file: &[u8]) -> Result<Value> {
        let mut request = self.agent.put(format!("{}/api/v1{path}", self.origin));
        if let Some(token) = &self.token {
            request = request.header("Authorization", format!("Bearer {token}"));
        }
        let sent = request.header("content-type", media_type).send(file);
        let mut answer = sent.with_context(|| format!("PUT {path}"))?;
        let status = answer.status();
        let text = answer.body_mut().read_to_string()?;
        ensure!(status == 200, "PUT {path} answered {status}: {text}");
        Ok(serde_json::from_str(&text)?)
    }

    /// Puts a fresh block.
    ///
    /// # Errors
    /// The server refuses.
    pub fn reset(&self, id: &str) -> Result<()> {
        let path = format!("/sessions/{id}/clay/reset");
        self.send("POST", &path, &serde_json::json!({})).map(drop)
    }

    /// The clay as an STL file.
    ///
    /// # Errors
    /// The server does not give it.
    pub fn stl(&self, id: &str) -> Result<Vec<u8>> {
        self.bytes(&format!("/sessions/{id}/clay.stl"))
    }

    /// A file under `/api/v1`.
    ///
    /// # Errors
    /// The server does not give it.
    pub fn bytes(&self, path: &str) -> Result<Vec<u8>> {
        let mut answer = self.get(path)?;
        ensure!(answer.status() == 200, "answered {}", answer.status());
        let most = 256 * 1024 * 1024;
        Ok(answer.body_mut().with_config().limit(most).read_to_vec()?)
    }

    fn get(&self, path: &str) -> Result<ureq::http::Response<ureq::Body>> {
        let mut request = self.agent.get(format!("{}/api/v1{path}", self.origin));
        if let Some(token) = &self.token {
            request = request.header("Authorization", format!("Bearer {token}"));
        }
        request.call().with_context(|| format!("GET {path}"))
    }

    fn read(&self, path: &str) -> Result<String> {
        let mut answer = self.get(path)?;
        let status = answer.status();
        let text = answer.body_mut().read_to_string()?;
        ensure!(status == 200, "GET {path} answered {status}: {text}");
        Ok(text)
    }

    fn send(&self, method: &str, path: &str, body: &Value) -> Result<String> {
        let (status, text) = self.call(method, path, body)?;
        ensure!(
            (200..300).contains(&status),
            "{method} {path} answered {status}: {text}"
        );
        Ok(text)
    }

    /// Status and body of the answer, whatever it is.
    fn call(&self, method: &str, path: &str, body: &Value) -> Result<(u16, String)> {
        let address = format!("{}/api/v1{path}", self.origin);
        let mut request = match method {
            "POST" => self.agent.post(address),
            "PATCH" => self.agent.patch(address),
            other => bail!("no method {other}"),
        };
        if let Some(token) = &self.token {
            request = request.header("Authorization", format!("Bearer {token}"));
        }
        let mut answer = request
            .header("content-type", "application/json")
            .send(body.to_string())
            .with_context(|| format!("{method} {path}"))?;
        let status = answer.status();
        let text = answer.body_mut().read_to_string()?;
        Ok((status.as_u16(), text))
    }
}

/// Exactly, not nearly, in units and in m³: that is what the interface promises, at every look.
fn ensure_the_volume_balances(clay: &ClayState) -> Result<()> {
    let [initial_m3, remaining_m3, removed_m3] = [
        clay.initial_volume_m3,
        clay.remaining_volume_m3,
        clay.removed_volume_m3,
    ];
    ensure!(
        clay.initial_units == clay.remaining_units + clay.removed_units
            && initial_m3.to_bits() == (remaining_m3 + removed_m3).to_bits(),
        "the volume balance of the clay does not hold: {clay:?}"
    );
    Ok(())
}

/// The time since `began`, for a line that says how long something took.
pub fn since(began: Instant) -> String {
    format!("{:.3} s", began.elapsed().as_secs_f64())
}
