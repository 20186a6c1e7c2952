//! What a hand and a server say to each other about its tool, in the texts of a stream.

use std::time::{Duration, Instant};

use teleclay_pointer::{Pointer, PointerSetup, Wanted};
use teleclay_proto::Axes;
use teleclay_proto::join::Granted;
use teleclay_proto::watch::{ClientText, HandDevice, ServerText, Switch};
use teleclay_seal::Keys;
use tungstenite::Message;

use super::line::Line;
use super::{Ended, NotJoined};

/// An answer that takes longer is none.
const PATIENCE: Duration = Duration::from_secs(5);
/// How often the device is told at the slowest, 1/s. The thread tells it every tick, and may be held up for a while.
pub(super) const RATE_HZ: f64 = 100.0;

/// A lease, and the machine that works under it.
pub(super) struct Joined {
    pub(super) pointer: Pointer,
    pub(super) tool: u32,
    pub(super) has_lift: bool,
}

/// Asks for a tool. Waits.
pub(super) fn join(
    line: &mut Line,
    operator: &str,
    now_ns: impl FnOnce() -> u64,
) -> Result<Joined, NotJoined> {
    let subscribe = ClientText::Subscribe {
        telemetry: Switch::Off,
        bricks: Switch::Off,
    };
    let question = ClientText::Join {
        operator: operator.to_owned(),
        device: HandDevice {
            name: "a law in Python".to_owned(),
            axes: Axes::Three,
            force_n: 0.0,
            rate_hz: RATE_HZ,
            measures_force: false,
        },
        token: None,
    };
    line.say(text(&subscribe)).map_err(NotJoined::from)?;
    line.say(text(&question)).map_err(NotJoined::from)?;
    let began = Instant::now();
    while began.elapsed() < PATIENCE {
        let Some(message) = line.hear()? else {
            break;
        };
        let Message::Text(said) = message else {
            continue;
        };
        match serde_json::from_str(&said) {
            Ok(ServerText::Granted { keys, granted }) => {
                return begin(&granted, &keys, now_ns());
            }
            Ok(ServerText::Refused { reason, .. }) => return Err(NotJoined::Refused { reason }),
            Ok(ServerText::Problem { problem }) => {
                return Err(NotJoined::Refused {
                    reason: problem.detail,
                });
            }
            _ => {}
        }
    }
    Err(NotJoined::Silent)
}

fn begin(granted: &Granted, keys: &[u8; 64], now_ns: u64) -> Result<Joined, NotJoined> {
    let (of_handle, of_server) = keys.split_at(32);
    let key = |half: &[u8]| std::array::from_fn(|at| half[at]);
    let keys = Keys::new(key(of_handle), key(of_server));
    let setup = PointerSetup {
        rate_hz: RATE_HZ,
        ..PointerSetup::default()
    };
    let json = serde_json::to_vec(granted).map_err(|error| NotJoined::Grant(error.to_string()))?;
    let pointer = Pointer::new(now_ns, setup, &json, &keys)
        .map_err(|error| NotJoined::Grant(error.to_string()))?;
    Ok(Joined {
        pointer,
        tool: granted.tool,
        has_lift: granted.parameters.axes == Axes::Two,
    })
}

/// What was asked, and what of an answer is still to come.
#[derive(Default)]
pub(super) struct Questions {
    parameters: bool,
    /// The snapshot that was asked for, by its number.
    snapshot: Option<u32>,
    /// Messages of bricks that belong to it and have not come.
    bricks: u32,
    has_left: bool,
}

impl Questions {
    /// Asks for what is wanted and was not asked for.
    pub(super) fn ask(&mut self, line: &mut Line, wanted: &Wanted) -> Result<(), Ended> {
        if wanted.parameters && !self.parameters {
            line.say(text(&ClientText::Parameters {}))?;
            self.parameters = true;
        }
        if let Some(snapshot) = wanted.snapshot
            && self.snapshot != Some(snapshot.number)
            && self.bricks == 0
        {
            let epoch = snapshot.epoch;
            line.say(text(&ClientText::Snapshot { epoch }))?;
            self.snapshot = Some(snapshot.number);
        }
        Ok(())
    }

    /// Gives the tool back.
    pub(super) fn leave(&mut self, line: &mut Line) -> Result<(), Ended> {
        Ok(line.say(text(&ClientText::Leave {}))?)
    }

    pub(super) fn has_left(&self) -> bool {
        self.has_left
    }

    /// A text came. One of another kind than is known says nothing to a hand.
    pub(super) fn on_text(&mut self, said: &str, pointer: &mut Pointer) -> Result<(), Ended> {
        match serde_json::from_str(said) {
            Ok(ServerText::Parameters { parameters }) => {
                self.parameters = false;
                let json = serde_json::to_vec(&parameters).unwrap_or_default();
                pointer
                    .handle_parameters(&json)
                    .map_err(|error| Ended::Changed(error.to_string()))
            }
            Ok(ServerText::Snapshot { clay, messages }) => {
                self.bricks = messages;
                let json = serde_json::to_vec(&clay).unwrap_or_default();
                self.took(pointer.begin_snapshot(&json));
                Ok(())
            }
            Ok(ServerText::Farewell { reason }) => Err(Ended::Farewell(reason)),
            Ok(ServerText::Left {}) => {
                self.has_left = true;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// A message of bricks came.
    pub(super) fn on_bricks(&mut self, message: &[u8], pointer: &mut Pointer) {
        if self.bricks == 0 {
            return;
        }
        self.bricks -= 1;
        let taken = pointer.handle_bricks(message);
        self.took(taken);
        if self.bricks == 0 && self.snapshot.is_some() {
            let finished = pointer.finish_snapshot();
            self.took(finished);
        }
    }

    /// What was not taken is asked for anew, once its messages have gone by.
    fn took(&mut self, taken: Result<(), teleclay_pointer::Refused>) {
        if taken.is_err() {
            self.snapshot = None;
        }
    }
}

fn text(question: &ClientText) -> String {
    // It has no maps, and no numbers that JSON lacks.
    serde_json::to_string(question).unwrap_or_default()
}
