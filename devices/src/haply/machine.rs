//! The protocol of the simulation channel as a state machine: messages and times in, messages out.
//!
//! ```text
//! Waiting ──inventory──> Running ──whatever is wrong──> Ended
//! ```
//!
//! After every `handle_*`: [`poll`](Machine::poll), and send what it gives; then [`take_news`](Machine::take_news). In
//! every state but `Waiting`, what was sent last before the end is a force of zero.

use std::fmt;

use super::message::{
    Buttons, Event, Filters, Greeting, Grip, Inverse3, LONGEST, Spelling, State, set_force,
};
use super::taking::Taking;
use crate::exchange::{Marks, News};

/// A service that is there sends its inventory at once.
const INVENTORY_WITHIN_NS: u64 = 2_000_000_000;
/// From one message to the next, ns: a thousand a second.
const PERIOD_NS: u64 = 900_000;
/// An answer that is later than this, ns, finds the force gone.
const LATE_NS: u64 = 20_000_000;
/// One that is later than this never comes.
const SILENT_NS: u64 = 250_000_000;
/// No arm reaches as far as this, m.
const FARTHEST_M: f64 = 2.0;
/// The middle of the arm's reach where the origin is in its base: m, from the public examples.
const MIDDLE_M: [f64; 3] = [0.0, -0.12, 0.16];

/// Why it ended.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// No inventory came.
    NoInventory,
    /// No Inverse3 is in it.
    NoDevice,
    /// The device cannot be used.
    NotReady(&'static str),
    /// The service would do to forces what no hand should meet.
    BadLaw(String),
    /// The device is no longer there.
    Unplugged,
    /// The emergency brake is on.
    Brake,
    /// A motor is stalled.
    Stall,
    /// Another session has the device.
    Busy,
    /// The service raised an alarm.
    Alarm(String),
    /// A message that is none.
    Garbage(String),
    /// A place that is none.
    Implausible,
    /// No answer.
    Silent,
    /// The service has closed the channel.
    Closed(String),
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoInventory => f.write_str("the service sent no inventory within two seconds"),
            Self::NoDevice => f.write_str("the service knows of no Inverse3"),
            Self::NotReady(what) => write!(f, "it cannot be used: {what}"),
            Self::BadLaw(what) => write!(f, "the service is set to {what}"),
            Self::Unplugged => f.write_str("unplugged"),
            Self::Brake => f.write_str("the emergency brake was put on"),
            Self::Stall => f.write_str("a motor is stalled"),
            Self::Busy => f.write_str("another session of the service has it"),
            Self::Alarm(what) => write!(f, "the service raised an alarm: {what}"),
            Self::Garbage(what) => write!(f, "the service sent what is no message: {what}"),
            Self::Implausible => f.write_str("the service told a place that no arm reaches"),
            Self::Silent => f.write_str("the service did not answer for a quarter of a second"),
            Self::Closed(why) => write!(f, "the service closed the channel: {why}"),
        }
    }
}

/// What the service does to a force on its way to the motors, as far as it tells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Law {
    /// Gain of the force gate.
    pub force_gate_gain: Option<f64>,
    /// Damping that is added, N·s/m.
    pub damping_n_s_per_m: Option<f64>,
}

impl Law {
    /// How that changes what a hand feels, a sentence each; none where it changes nothing.
    #[must_use]
    pub fn sentences(&self) -> Vec<String> {
        let mut said = Vec::new();
        if let Some(gain) = self.force_gate_gain {
            said.push(format!(
                "the service's force gate (gain {gain}) weakens forces while it sees an oscillation: the hand then feels less than the loop gives"
            ));
        }
        if let Some(damping) = self.damping_n_s_per_m.filter(|damping| 0.0 < *damping) {
            said.push(format!(
                "the service adds a damping of {damping} N·s/m: free motion feels heavier by it, and the coupling does not count on it"
            ));
        }
        said
    }

    fn of(filters: Option<&Filters>) -> Self {
        let gate = filters.and_then(|filters| filters.force_gate.as_ref());
        let damping = filters.and_then(|filters| filters.damping.as_ref());
        Self {
            force_gate_gain: gate.and_then(|gate| gate.gain),
            damping_n_s_per_m: damping.and_then(|damping| damping.scalar),
        }
    }

    /// A damping below zero drives whoever moves; a gate above 1 strengthens.
    fn check(&self) -> Result<(), End> {
        if let Some(damping) = self.damping_n_s_per_m.filter(|damping| *damping < 0.0) {
            let what = format!("a damping of {damping} N·s/m, which pushes along every motion");
            return Err(End::BadLaw(what));
        }
        let is_gain = |gain: &f64| (0.0..=1.0).contains(gain);
        if let Some(gain) = self.force_gate_gain.filter(|gain| !is_gain(gain)) {
            return Err(End::BadLaw(format!("a force gate of gain {gain}")));
        }
        Ok(())
    }
}

/// A device at work.
#[derive(Clone, Debug)]
struct Running {
    device_id: String,
    spelling: Spelling,
    greeting: Greeting,
    home_m: [f64; 3],
    law: Law,
    taking: Taking,
    /// Of the last message that asks for an answer.
    sent_ns: Option<u64>,
    heard_ns: Option<u64>,
    /// Answers that are still to come.
    unanswered: u32,
    is_late: bool,
    news: Option<News>,
}

#[derive(Clone, Debug)]
enum Phase {
    Waiting {
        since_ns: Option<u64>,
    },
    Running(Box<Running>),
    /// With the message that leaves the device without force, until it is sent.
    Ended {
        end: End,
        last_word: Option<String>,
    },
}

/// The client's end of the simulation channel.
#[derive(Clone, Debug)]
pub struct Machine {
    phase: Phase,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            phase: Phase::Waiting { since_ns: None },
        }
    }
}

impl Machine {
    /// A message of the simulation channel came.
    pub fn handle_message(&mut self, now_ns: u64, bytes: &[u8]) {
        let outcome = match (&mut self.phase, parse::<State>(bytes)) {
            (Phase::Ended { .. }, _) => return,
            (_, Err(end)) => Err(end),
            (Phase::Waiting { .. }, Ok(inventory)) => Running::new(&inventory).map(Some),
            (Phase::Running(running), Ok(state)) => running.hear(now_ns, &state).map(|()| None),
        };
        match outcome {
            Ok(Some(running)) => self.phase = Phase::Running(Box::new(running)),
            Ok(None) => {}
            Err(end) => self.end(end),
        }
    }

    /// A message of the event channel came.
    pub fn handle_event(&mut self, bytes: &[u8]) {
        let ours = match &self.phase {
            Phase::Ended { .. } => return,
            Phase::Waiting { .. } => None,
            Phase::Running(running) => Some(running.device_id.as_str()),
        };
        let end = match parse::<Event>(bytes) {
            Ok(event) => end_of(&event, ours),
            Err(end) => Some(end),
        };
        if let Some(end) = end {
            self.end(end);
        }
    }

    /// The simulation channel is closed: nothing can be sent any more.
    pub fn handle_closed(&mut self, why: &str) {
        match &mut self.phase {
            Phase::Ended { last_word, .. } => *last_word = None,
            _ => {
                self.phase = Phase::Ended {
                    end: End::Closed(why.to_owned()),
                    last_word: None,
                }
            }
        }
    }

    /// The event channel is closed: nobody would tell of a brake any more.
    pub fn handle_lost_events(&mut self, why: &str) {
        self.end(End::Closed(why.to_owned()));
    }

    /// The message to send at `now_ns`, if one is due; `force_n` is what the device shall render.
    pub fn poll(&mut self, now_ns: u64, force_n: [f64; 3]) -> Option<String> {
        match &mut self.phase {
            Phase::Waiting { since_ns } => {
                let since_ns = *since_ns.get_or_insert(now_ns);
                if INVENTORY_WITHIN_NS <= now_ns.saturating_sub(since_ns) {
                    self.end(End::NoInventory);
                }
                None
            }
            Phase::Running(running) => {
                if running.is_silent(now_ns) {
                    self.end(End::Silent);
                    return self.poll(now_ns, force_n);
                }
                running.poll(now_ns, force_n)
            }
            Phase::Ended { last_word, .. } => last_word.take(),
        }
    }

    /// Where the device is, once for each state that came.
    pub fn take_news(&mut self) -> Option<News> {
        match &mut self.phase {
            Phase::Running(running) => running.news.take(),
            _ => None,
        }
    }

    /// Ends it: the message that leaves the device without force, if it can be told.
    pub fn close(&mut self) -> Option<String> {
        self.end(End::Closed("the handle ended".to_owned()));
        self.poll(0, [0.0; 3])
    }

    /// Why it ended, once it did.
    #[must_use]
    pub fn why(&self) -> Option<&End> {
        match &self.phase {
            Phase::Ended { end, .. } => Some(end),
            _ => None,
        }
    }

    /// What the service does to forces; `None` before the inventory and after the end.
    #[must_use]
    pub fn law(&self) -> Option<Law> {
        match &self.phase {
            Phase::Running(running) => Some(running.law),
            _ => None,
        }
    }

    fn end(&mut self, end: End) {
        let last_word = match &self.phase {
            Phase::Ended { .. } => return,
            Phase::Waiting { .. } => None,
            Phase::Running(running) => Some(running.spell([0.0; 3], Greeting::Later)),
        };
        self.phase = Phase::Ended { end, last_word };
    }
}

impl Running {
    fn new(inventory: &State) -> Result<Self, End> {
        let device = inventory.inverse3.first().ok_or(End::NoDevice)?;
        let config = device.config.as_ref();
        let filters = config.and_then(|config| config.filters.as_ref());
        let law = Law::of(filters);
        law.check()?;
        check_status(device)?;
        let is_new = inventory.session_id.is_some() || filters.is_some();
        let preset = config.and_then(|config| config.preset.as_deref());
        let is_centred = preset.is_some_and(|preset| preset.ends_with("centered"));
        Ok(Self {
            device_id: device.device_id.clone(),
            spelling: if is_new {
                Spelling::Vector
            } else {
                Spelling::Values
            },
            greeting: if is_new {
                Greeting::First
            } else {
                Greeting::Later
            },
            home_m: if is_centred { [0.0; 3] } else { MIDDLE_M },
            law,
            taking: Taking::default(),
            sent_ns: None,
            heard_ns: None,
            unanswered: 0,
            is_late: false,
            news: None,
        })
    }

    fn hear(&mut self, now_ns: u64, state: &State) -> Result<(), End> {
        self.unanswered = self.unanswered.saturating_sub(1);
        self.heard_ns = Some(now_ns);
        self.is_late &= 0 < self.unanswered;
        let ours = |device: &&Inverse3| device.device_id == self.device_id;
        let device = state.inverse3.iter().find(ours).ok_or(End::Unplugged)?;
        check_status(device)?;
        let cursor = device.state.as_ref();
        let Some(position) = cursor.and_then(|cursor| cursor.cursor_position) else {
            return Ok(());
        };
        let position: [f64; 3] = position.into();
        // A NaN compares as false.
        if !position.iter().all(|part| part.abs() <= FARTHEST_M) {
            return Err(End::Implausible);
        }
        let position_m = std::array::from_fn(|axis| position[axis] - self.home_m[axis]);
        let before = self.news.map_or(Marks::default(), |news| news.marks);
        let marks = self.taking.step(now_ns, position_m, buttons(state));
        self.news = Some(News {
            at_ns: now_ns,
            position_m,
            marks: before.and_then(marks),
        });
        Ok(())
    }

    fn poll(&mut self, now_ns: u64, force_n: [f64; 3]) -> Option<String> {
        let Some(sent_ns) = self.sent_ns else {
            return Some(self.send(now_ns, [0.0; 3]));
        };
        let age_ns = now_ns.saturating_sub(sent_ns);
        if self.unanswered == 0 {
            return (PERIOD_NS <= age_ns).then(|| self.send(now_ns, force_n));
        }
        if LATE_NS <= age_ns && !self.is_late {
            self.is_late = true;
            return Some(self.send(now_ns, [0.0; 3]));
        }
        None
    }

    fn send(&mut self, now_ns: u64, force_n: [f64; 3]) -> String {
        self.sent_ns = Some(now_ns);
        self.heard_ns.get_or_insert(now_ns);
        self.unanswered += 1;
        let greeting = std::mem::replace(&mut self.greeting, Greeting::Later);
        self.spell(force_n, greeting)
    }

    fn spell(&self, force_n: [f64; 3], greeting: Greeting) -> String {
        let is_finite = force_n.iter().all(|part| part.is_finite());
        let force_n = if is_finite { force_n } else { [0.0; 3] };
        set_force(&self.device_id, force_n, self.spelling, greeting)
    }

    fn is_silent(&self, now_ns: u64) -> bool {
        let heard_ns = self.heard_ns.unwrap_or(now_ns);
        SILENT_NS <= now_ns.saturating_sub(heard_ns)
    }
}

fn check_status(device: &Inverse3) -> Result<(), End> {
    let Some(status) = &device.status else {
        return Ok(());
    };
    let wanted = [
        (status.power_supply, "its motors have no power"),
        (status.calibrated, "it is not calibrated"),
        (status.ready, "the service says that it is not ready"),
    ];
    let lacking = wanted.into_iter().find(|(is_so, _)| *is_so == Some(false));
    lacking.map_or(Ok(()), |(_, what)| Err(End::NotReady(what)))
}

/// Of every grip together; `None` without a grip.
fn buttons(state: &State) -> Option<Buttons> {
    let grips = [
        &state.verse_grip,
        &state.wireless_verse_grip,
        &state.custom_verse_grip,
    ];
    let of = |grip: &Grip| {
        let state = grip.state.as_ref()?;
        let only = state.button.map(|a| Buttons {
            a,
            ..Buttons::default()
        });
        state.buttons.or(only)
    };
    grips
        .into_iter()
        .flatten()
        .filter_map(of)
        .reduce(|one, other| Buttons {
            a: one.a || other.a,
            b: one.b || other.b,
            c: one.c || other.c,
        })
}

/// The end that an event is, if it is one for this device.
fn end_of(event: &Event, ours: Option<&str>) -> Option<End> {
    let data = event.data.as_ref();
    let whose = data.and_then(|data| data.device_id.as_deref());
    // An event that names nobody, or comes before anybody is known, may be about this device.
    let is_other = matches!((whose, ours), (Some(whose), Some(ours)) if whose != ours);
    if is_other {
        return None;
    }
    let safety = data.and_then(|data| data.safety_type.as_deref());
    match (event.name.as_str(), safety, event.level.as_deref()) {
        ("device-disconnected", _, _) => Some(End::Unplugged),
        ("device-busy", _, _) => Some(End::Busy),
        ("device-safety-triggered", Some("ebrake_triggered"), _) => Some(End::Brake),
        ("device-safety-triggered", Some("stall_detected"), _) => Some(End::Stall),
        (name, _, Some("critical" | "panic")) => {
            let what = event.message.clone().filter(|message| !message.is_empty());
            Some(End::Alarm(what.unwrap_or_else(|| name.to_owned())))
        }
        _ => None,
    }
}

fn parse<'a, T: serde::Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, End> {
    if LONGEST < bytes.len() {
        return Err(End::Garbage(format!("{} bytes", bytes.len())));
    }
    serde_json::from_slice(bytes).map_err(|error| End::Garbage(error.to_string()))
}
