//! A stand-in for the Inverse Service, at its own pace on real sockets, written from its public messages: an inventory
//! once, then a state for each message. Behind it is an arm in the hand of a person, who holds the button of a grip and
//! draws it through the clay.

use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// How long a socket is waited for before somebody looks whether all is over.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Mass of arm and hand, kg; stiffness and damping of the person, N/m and N·s/m.
const MASS_KG: f64 = 0.2;
const STIFFNESS_N_PER_M: f64 = 300.0;
const DAMPING_N_S_PER_M: f64 = 12.0;
/// The step of that motion at most, s: a hundredth of its period.
const STEP_S: f64 = 1e-3;
/// The arm is at rest there, m.
const HOME_M: [f64; 3] = [0.0, -0.12, 0.16];
/// The button goes down after so long, s, and every few seconds up for a moment: whoever was let go of takes hold anew.
const BUTTON_S: f64 = 0.5;
const GRIP_S: f64 = 3.0;
const PAUSE_S: f64 = 0.3;
/// Then the hand goes down into the clay, and from side to side.
const DOWN_S: f64 = 1.0;
const DEPTH_M: f64 = 0.014;
const SIDE_M: f64 = 0.03;
const PERIOD_S: f64 = 4.0;

/// How old the service is, and so how it spells a force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// Before 3.5: `values`.
    Old,
    /// Since then: `vector`, and an inventory that tells of filters.
    New,
}

/// What happens to the device, or to the service.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trouble {
    /// All is well.
    #[default]
    None,
    /// One answer is late by so much.
    Late(Duration),
    /// It is unplugged: states without it.
    Unplugged,
    /// Its emergency brake is put on.
    Brake,
    /// No answer any more.
    Silent,
}

/// What the service has seen.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Messages that were answered.
    pub exchanges: u64,
    /// Forces that were spelled `vector` and `values`.
    pub vectors: u64,
    /// See [`vectors`](Self::vectors).
    pub values: u64,
    /// The last force, N; none is a message that was never sent.
    pub force_n: Option<[f64; 3]>,
    /// The largest, and the largest change from one message to the next, N.
    pub most_n: f64,
    /// See [`most_n`](Self::most_n).
    pub largest_step_n: f64,
    /// Longest time between two messages, s.
    pub longest_gap_s: f64,
    /// Energy that the forces gave the hand, J; below zero, what they took.
    pub given_j: f64,
    /// Whether the other end has gone.
    pub is_over: bool,
    /// What was wrong with a message.
    pub wrong: Option<String>,
}

#[derive(Debug, Default)]
struct Common {
    trouble: Trouble,
    seen: Seen,
    ends: bool,
}

/// A running service. Dropping it ends it.
#[derive(Debug)]
pub struct InverseService {
    common: Arc<Mutex<Common>>,
    flags: Vec<String>,
    serving: Option<JoinHandle<()>>,
}

impl InverseService {
    /// Starts one for one client.
    ///
    /// # Errors
    /// Loopback has no port.
    pub fn start(version: Version) -> Result<Self> {
        let bind = || -> Result<(TcpListener, u16)> {
            let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
            listener.set_nonblocking(true)?;
            let port = listener.local_addr()?.port();
            Ok((listener, port))
        };
        let ((simulation, port), (events, events_port)) = (bind()?, bind()?);
        let common = Arc::new(Mutex::new(Common::default()));
        let shared = Arc::clone(&common);
        let serving = std::thread::spawn(move || {
            let served = serve(&simulation, &events, version, &shared);
            let mut common = locked(&shared);
            common.seen.is_over = true;
            if let Err(error) = served {
                common.seen.wrong.get_or_insert(format!("{error:#}"));
            }
        });
        let flags = [
            "--device",
            "haply",
            "--haply-url",
            &format!("ws://127.0.0.1:{port}"),
            "--haply-events-port",
            &events_port.to_string(),
        ];
        Ok(Self {
            common,
            flags: flags.map(str::to_owned).to_vec(),
            serving: Some(serving),
        })
    }

    /// What a handle is told to find it.
    pub fn flags(&self) -> Vec<&str> {
        self.flags.iter().map(String::as_str).collect()
    }

    /// What it has seen so far.
    pub fn seen(&self) -> Seen {
        locked(&self.common).seen.clone()
    }

    /// Lets something happen.
    pub fn make(&self, trouble: Trouble) {
        locked(&self.common).trouble = trouble;
    }
}

impl Drop for InverseService {
    fn drop(&mut self) {
        locked(&self.common).ends = true;
        if let Some(serving) = self.serving.take() {
            // A thread that panicked has said so.
            let _ = serving.join();
        }
    }
}

fn locked(common: &Mutex<Common>) -> MutexGuard<'_, Common> {
    common.lock().unwrap_or_else(PoisonError::into_inner)
}

type Channel = WebSocket<TcpStream>;

fn serve(
    simulation: &TcpListener,
    events: &TcpListener,
    version: Version,
    common: &Mutex<Common>,
) -> Result<()> {
    let Some(mut simulation) = accept(simulation, common)? else {
        return Ok(());
    };
    let Some(mut events) = accept(events, common)? else {
        return Ok(());
    };
    let mut arm = Arm::default();
    simulation.send(Message::text(arm.inventory(version).to_string()))?;
    let began = Instant::now();
    let mut heard_s = None;
    // A client that goes on asking keeps nobody from ending it.
    while !locked(common).ends {
        let text = match simulation.read() {
            Ok(Message::Text(text)) => text,
            Ok(_) => continue,
            Err(tungstenite::Error::Io(error)) if is_patience(&error) => continue,
            // The client has gone.
            Err(_) => return Ok(()),
        };
        let now_s = began.elapsed().as_secs_f64();
        let force_n = force_in(&text, version)?;
        let trouble = {
            let mut common = locked(common);
            let gap_s = now_s - heard_s.unwrap_or(now_s);
            common.seen.note(force_n, version, gap_s);
            common.seen.given_j += arm.move_to(now_s, force_n);
            std::mem::take(&mut common.trouble)
        };
        heard_s = Some(now_s);
        let mut state = arm.state();
        match trouble {
            Trouble::None => {}
            Trouble::Late(by) => std::thread::sleep(by),
            Trouble::Unplugged => state["inverse3"] = json!([]),
            Trouble::Brake => {
                let event = json!({
                    "name": "device-safety-triggered",
                    "level": "warning",
                    "data": { "device_id": DEVICE, "safety_type": "ebrake_triggered" },
                });
                events.send(Message::text(event.to_string()))?;
            }
            Trouble::Silent => locked(common).trouble = Trouble::Silent,
        }
        if trouble != Trouble::Silent && simulation.send(Message::text(state.to_string())).is_err()
        {
            return Ok(());
        }
    }
    Ok(())
}

const DEVICE: &str = "049D";

/// The next connection, unless all is over first.
fn accept(listener: &TcpListener, common: &Mutex<Common>) -> Result<Option<Channel>> {
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                stream.set_nodelay(true)?;
                let channel = tungstenite::accept(stream).context("the greeting")?;
                channel.get_ref().set_read_timeout(Some(LOOK_EVERY))?;
                return Ok(Some(channel));
            }
            Err(error) if is_patience(&error) => {
                if locked(common).ends {
                    return Ok(None);
                }
                std::thread::sleep(LOOK_EVERY);
            }
            Err(error) => bail!(error),
        }
    }
}

fn is_patience(error: &std::io::Error) -> bool {
    use std::io::ErrorKind::{TimedOut, WouldBlock};
    matches!(error.kind(), TimedOut | WouldBlock)
}

fn force_in(text: &str, version: Version) -> Result<[f64; 3]> {
    let told: Value = serde_json::from_str(text)?;
    let device = &told["inverse3"][0];
    ensure!(device["device_id"] == DEVICE, "a force for nobody: {text}");
    let command = &device["commands"]["set_cursor_force"];
    let spelled = match version {
        Version::Old => &command["values"],
        Version::New => &command["vector"],
    };
    let part = |axis: &str| spelled[axis].as_f64().with_context(|| text.to_owned());
    Ok([part("x")?, part("y")?, part("z")?])
}

impl Seen {
    fn note(&mut self, force_n: [f64; 3], version: Version, gap_s: f64) {
        let before_n = self.force_n.unwrap_or_default();
        let change_n = std::array::from_fn(|axis| force_n[axis] - before_n[axis]);
        self.exchanges += 1;
        match version {
            Version::Old => self.values += 1,
            Version::New => self.vectors += 1,
        }
        self.most_n = self.most_n.max(crate::recording::norm(force_n));
        self.largest_step_n = self.largest_step_n.max(crate::recording::norm(change_n));
        self.longest_gap_s = self.longest_gap_s.max(gap_s);
        self.force_n = Some(force_n);
    }
}

/// An arm in a hand.
#[derive(Debug, Default)]
struct Arm {
    /// From home.
    place_m: [f64; 3],
    velocity_m_s: [f64; 3],
    now_s: f64,
}

impl Arm {
    /// Moves on under the force that it renders; the work of that force on the hand, J.
    fn move_to(&mut self, until_s: f64, force_n: [f64; 3]) -> f64 {
        let mut work_j = 0.0;
        while self.now_s < until_s {
            let step_s = STEP_S.min(until_s - self.now_s);
            let wished_m = wish_m(self.now_s);
            for axis in 0..3 {
                let pull_n = STIFFNESS_N_PER_M * (wished_m[axis] - self.place_m[axis]);
                let drag_n = DAMPING_N_S_PER_M * self.velocity_m_s[axis];
                let push_n = pull_n - drag_n + force_n[axis];
                self.velocity_m_s[axis] += step_s * push_n / MASS_KG;
                let way_m = step_s * self.velocity_m_s[axis];
                self.place_m[axis] += way_m;
                work_j += force_n[axis] * way_m;
            }
            self.now_s += step_s;
        }
        work_j
    }

    fn device(&self) -> Value {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|axis| HOME_M[axis] + self.place_m[axis]);
        json!({
            "device_id": DEVICE,
            "state": { "cursor_position": { "x": x, "y": y, "z": z } },
            "status": { "calibrated": true, "in_use": true, "power_supply": true, "ready": true },
        })
    }

    fn grip(&self) -> Value {
        let held_s = self.now_s - BUTTON_S;
        let is_down = 0.0 < held_s && held_s % (GRIP_S + PAUSE_S) < GRIP_S;
        json!([{ "device_id": "61548", "state": { "button": is_down, "hall": 0 } }])
    }

    fn inventory(&self, version: Version) -> Value {
        let mut device = self.device();
        device["config"] = json!({ "type": "inverse3", "handedness": "right" });
        let mut inventory = json!({ "verse_grip": self.grip(), "wireless_verse_grip": [] });
        if version == Version::New {
            device["config"]["preset"] = json!("defaults");
            device["config"]["filters"] =
                json!({ "force_gate": { "gain": 0.3 }, "damping": { "scalar": 0.0 } });
            inventory["session_id"] = json!(7);
        }
        inventory["inverse3"] = json!([device]);
        inventory
    }

    fn state(&self) -> Value {
        json!({ "inverse3": [self.device()], "verse_grip": self.grip() })
    }
}

/// Where the hand wants to be, from home, m.
fn wish_m(now_s: f64) -> [f64; 3] {
    let down = ((now_s - BUTTON_S) / DOWN_S).clamp(0.0, 1.0);
    let side_s = (now_s - BUTTON_S - DOWN_S).max(0.0);
    let side = (std::f64::consts::TAU * side_s / PERIOD_S).sin();
    [SIDE_M * side, 0.0, -DEPTH_M * down]
}
