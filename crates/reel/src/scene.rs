//! A session at a moment of its recording: its tools, its settings, its clay.

use std::sync::Arc;

use teleclay_clay::Clay;
use teleclay_history::{Replay, ReplayError, State};
use teleclay_ros::standard::{PoseStamped, Text, TwistStamped, WrenchStamped};
use teleclay_ros::{CdrError, from_cdr, own};
use teleclay_session::Settings;

use crate::channels::{Channels, Told};
use crate::chunk::Message;
use crate::error::ReadError;
use crate::format::{FULL, HASH, STATE};

/// Quantities of a tool that messages tell: those of a sample of telemetry, in its order.
pub const TOLD: usize = 27;
/// These, and what follows of them: the force that the hand feels less the clay's own, x, y, z, and both energies.
pub const QUANTITIES: usize = TOLD + 4;

/// Where each quantity begins. Vectors are x, y, z; SI units.
pub mod quantity {
    /// Force of the hand on the handle.
    pub const HAND_FORCE_N: usize = 0;
    /// Force of the handle on the hand.
    pub const FELT_FORCE_N: usize = 3;
    /// Force of the clay on the tool.
    pub const TOOL_FORCE_N: usize = 6;
    /// The handle, in its own frame.
    pub const HANDLE_POSITION_M: usize = 9;
    /// The tool, in the clay's frame.
    pub const TOOL_POSITION_M: usize = 12;
    /// Velocity of the handle.
    pub const HANDLE_VELOCITY_M_S: usize = 15;
    /// Velocity of the tool.
    pub const TOOL_VELOCITY_M_S: usize = 18;
    /// Energy that flowed into the line at the handle.
    pub const ENERGY_HANDLE_J: usize = 21;
    /// Energy that flowed into the line at the tool.
    pub const ENERGY_TOOL_J: usize = 22;
    /// Round trip.
    pub const RTT_S: usize = 23;
    /// How far corrections have moved the felt force since the message before.
    pub const CORRECTION_STEP_N: usize = 24;
    /// How far the felt force still is from what the corrected copy gives.
    pub const CORRECTION_HELD_N: usize = 25;
    /// Time since the newest frame of the handle came.
    pub const AGE_S: usize = 26;
    /// Felt force less the clay's own.
    pub const FELT_LESS_TOOL_N: usize = 27;
    /// Both energies together.
    pub const ENERGY_BOTH_J: usize = 30;
}

/// A tool, as it was told last.
#[derive(Clone, Debug, PartialEq)]
pub struct Tool {
    /// By [`quantity`]; not a number where nothing was told.
    pub values: [f64; QUANTITIES],
    /// Whether frames of whoever holds it came.
    pub is_connected: bool,
    /// Who held it; empty where the link is not recorded.
    pub operator: String,
    /// When it was told, ns.
    pub told_ns: u64,
    /// Quantities that were told since the last tick, a bit for each.
    pub(crate) fresh: u32,
}

impl Default for Tool {
    fn default() -> Self {
        Self {
            values: [f64::NAN; QUANTITIES],
            is_connected: false,
            operator: String::new(),
            told_ns: 0,
            fresh: 0,
        }
    }
}

/// All of a moment but the clay.
#[derive(Clone, Debug, Default)]
pub struct Head {
    /// The moment, ns since 1970.
    pub time_ns: u64,
    /// The session's last tick.
    pub tick: Option<u64>,
    /// Ticks that were not written so far.
    pub dropped: u64,
    /// Whether cuts could not be kept.
    pub is_full: bool,
    /// What the session was set to; nothing before the first state.
    pub settings: Option<Arc<Settings>>,
    /// By slot; those that were never shown are missing at the end.
    pub tools: Vec<Tool>,
    /// Since when, and why, the recording does not lead to the clay.
    pub lost: Option<Lost>,
}

/// Why a moment's clay is unknown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lost {
    /// Since then, ns since 1970.
    pub since_ns: u64,
    /// What has lost it.
    pub why: Why,
}

/// Why a recording does not lead to the clay until its next state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Why {
    /// Ticks were dropped.
    Dropped {
        /// How many.
        ticks: u64,
    },
    /// Ticks are missing that are not told as dropped.
    Missing {
        /// How many.
        ticks: u64,
    },
    /// Something was undone that was cut earlier than the last state, or a block was given from a file.
    LeadsElsewhere,
    /// The history does not follow.
    Broken {
        /// What is wrong.
        why: String,
    },
}

/// What a message has brought, for whoever keeps a list of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Heard {
    /// Nothing to keep.
    Nothing,
    /// A tick has ended.
    Tick,
    /// The hash of the clay, and the one that the recording tells.
    Hash { told: u64, got: u64 },
    /// Something in words.
    Event { level: u8, text: String },
}

/// A session at a moment.
#[derive(Default)]
pub struct Scene {
    /// All but the clay.
    pub head: Head,
    clay: Option<Replay>,
}

impl Scene {
    /// At a keyframe.
    pub(crate) fn resume(head: Head, state: &[u8]) -> Result<Self, ReadError> {
        let state = State::decode(state).map_err(ReadError::State)?;
        Ok(Self {
            head,
            clay: Some(Replay::from_state(state, Vec::new())),
        })
    }

    /// The clay of this moment; nothing where the recording does not lead to it.
    pub fn clay(&mut self) -> Option<&mut Clay> {
        self.clay.as_mut().map(Replay::clay)
    }

    /// Counts the blocks that the session had until then.
    #[must_use]
    pub fn clay_epoch(&self) -> u32 {
        let replay = self.clay.as_ref();
        replay.map_or(0, |replay| replay.session().clay_epoch)
    }

    /// Who holds each tool, by slot, where the recording leads to it.
    pub fn holders(&self) -> impl Iterator<Item = Option<&str>> {
        let tools = self.clay.iter().flat_map(|clay| &clay.session().tools);
        tools.map(|tool| tool.holder.as_ref().map(|holder| &*holder.operator.name))
    }

    /// The state as bytes. What was cut before it cannot be undone any more, here as for whoever begins with it.
    pub(crate) fn state(&mut self) -> Result<Option<Vec<u8>>, ReadError> {
        let Some(replay) = self.clay.take() else {
            return Ok(None);
        };
        let bytes = replay.into_state().encode();
        let state = State::decode(&bytes).map_err(ReadError::State)?;
        self.clay = Some(Replay::from_state(state, Vec::new()));
        Ok(Some(bytes))
    }

    /// Goes on by a message.
    pub(crate) fn take(
        &mut self,
        channels: &Channels,
        message: Message<'_>,
    ) -> Result<Heard, ReadError> {
        let Message { channel, data, .. } = message;
        let damaged = |error| channels.damaged(channel, error);
        self.head.time_ns = self.head.time_ns.max(message.time_ns);
        match channels.told(channel) {
            Told::Shown(slot, shown) if slot < MOST_TOOLS => {
                let head = &mut self.head;
                if head.tools.len() <= slot {
                    head.tools.resize_with(slot + 1, Tool::default);
                }
                head.tools[slot].told_ns = message.time_ns;
                head.tools[slot].show(shown, data).map_err(damaged)?;
                Ok(Heard::Nothing)
            }
            Told::Record => {
                let record: own::Record<'_> = from_cdr(data).map_err(damaged)?;
                self.on_record(record.bytes)
            }
            Told::Tick => {
                let time = from_cdr(data).map_err(damaged)?;
                Ok(self.on_tick(&time))
            }
            Told::Storage => {
                let text: Text<'_> = from_cdr(data).map_err(damaged)?;
                self.head.is_full = text.data == FULL;
                Ok(Heard::Nothing)
            }
            Told::Event => {
                let event: own::Event<'_> = from_cdr(data).map_err(damaged)?;
                Ok(Heard::Event {
                    level: event.level,
                    text: event.text.to_owned(),
                })
            }
            Told::Clay => {
                let clay: own::Clay<'_> = from_cdr(data).map_err(damaged)?;
                self.on_clay(&clay)
            }
            Told::Shown(..) | Told::Frame(_) | Told::Nothing => Ok(Heard::Nothing),
        }
    }

    fn on_tick(&mut self, time: &own::TickTime) -> Heard {
        let head = &mut self.head;
        let (before, dropped) = (head.tick.replace(time.tick), head.dropped);
        head.dropped = time.dropped;
        let missing = before.map_or(0, |before| time.tick.saturating_sub(before + 1));
        for tool in &mut head.tools {
            tool.complete();
        }
        if 0 < missing {
            let is_told = time.dropped.saturating_sub(dropped) == missing;
            self.lose(if is_told {
                Why::Dropped { ticks: missing }
            } else {
                Why::Missing { ticks: missing }
            });
        }
        Heard::Tick
    }

    fn on_record(&mut self, record: &[u8]) -> Result<Heard, ReadError> {
        let Some(replay) = &mut self.clay else {
            return Ok(Heard::Nothing);
        };
        let before = Arc::clone(&replay.session().settings);
        match replay.apply(record) {
            Ok(()) => {
                let settings = &replay.session().settings;
                if !Arc::ptr_eq(&before, settings) {
                    self.head.settings = Some(Arc::clone(settings));
                }
                Ok(Heard::Nothing)
            }
            Err(ReplayError::Malformed(error)) => Err(ReadError::Record(error)),
            Err(
                ReplayError::EarlierBaseNeeded { .. }
                | ReplayError::BlockMissing { .. }
                | ReplayError::Unknown { what: "stroke", .. },
            ) => {
                self.lose(Why::LeadsElsewhere);
                Ok(Heard::Nothing)
            }
            Err(error) => {
                let why = error.to_string();
                self.lose(Why::Broken { why });
                Ok(Heard::Nothing)
            }
        }
    }

    fn on_clay(&mut self, told: &own::Clay<'_>) -> Result<Heard, ReadError> {
        match told.format {
            HASH => Ok(match self.clay() {
                Some(clay) => Heard::Hash {
                    told: told.hash,
                    got: clay.hash(),
                },
                None => Heard::Nothing,
            }),
            STATE => {
                let state = State::decode(told.bytes).map_err(ReadError::State)?;
                self.head.settings = Some(Arc::clone(&state.session.settings));
                self.head.lost = None;
                let before = self.clay().map(Clay::hash);
                self.clay = Some(Replay::from_state(state, Vec::new()));
                // A state on the way says what the clay has to be by then.
                let compared = before.map(|got| Heard::Hash {
                    told: told.hash,
                    got,
                });
                Ok(compared.unwrap_or(Heard::Nothing))
            }
            _ => Ok(Heard::Nothing),
        }
    }

    fn lose(&mut self, why: Why) {
        if self.clay.take().is_some() {
            self.head.lost = Some(Lost {
                since_ns: self.head.time_ns,
                why,
            });
        }
    }
}

/// Sessions have no more tools.
pub(crate) const MOST_TOOLS: usize = 8;

impl Tool {
    /// Takes in a message of one of [`SHOWN`](crate::format::SHOWN), by its place there.
    fn show(&mut self, shown: usize, data: &[u8]) -> Result<(), CdrError> {
        use quantity::{
            AGE_S, CORRECTION_HELD_N, CORRECTION_STEP_N, ENERGY_HANDLE_J, ENERGY_TOOL_J,
            FELT_FORCE_N, HAND_FORCE_N, HANDLE_POSITION_M, HANDLE_VELOCITY_M_S, RTT_S,
            TOOL_FORCE_N, TOOL_POSITION_M, TOOL_VELOCITY_M_S,
        };
        match shown {
            0 | 1 => {
                let at = [HANDLE_POSITION_M, TOOL_POSITION_M][shown];
                let told = from_cdr::<PoseStamped<'_>>(data)?.pose.position;
                self.put(at, &[told.x, told.y, told.z]);
            }
            2 | 3 => {
                let at = [HANDLE_VELOCITY_M_S, TOOL_VELOCITY_M_S][shown - 2];
                let told = from_cdr::<TwistStamped<'_>>(data)?.twist.linear;
                self.put(at, &[told.x, told.y, told.z]);
            }
            4..=6 => {
                let at = [HAND_FORCE_N, FELT_FORCE_N, TOOL_FORCE_N][shown - 4];
                let told = from_cdr::<WrenchStamped<'_>>(data)?.wrench.force;
                self.put(at, &[told.x, told.y, told.z]);
            }
            7 => {
                let link: own::Link<'_> = from_cdr(data)?;
                self.put(RTT_S, &[link.rtt_s]);
                self.put(AGE_S, &[link.age_s]);
                self.is_connected = link.connected;
                if self.operator != link.operator_name {
                    link.operator_name.clone_into(&mut self.operator);
                }
            }
            8 => {
                let energy: own::Energy = from_cdr(data)?;
                self.put(ENERGY_HANDLE_J, &[energy.handle_j]);
                self.put(ENERGY_TOOL_J, &[energy.tool_j]);
            }
            _ => {
                let corrections: own::Corrections = from_cdr(data)?;
                self.put(CORRECTION_STEP_N, &[corrections.step_n]);
                self.put(CORRECTION_HELD_N, &[corrections.held_n]);
            }
        }
        Ok(())
    }

    fn put(&mut self, at: usize, told: &[f64]) {
        self.values[at..at + told.len()].copy_from_slice(told);
        self.fresh |= ((1 << told.len()) - 1) << at;
    }

    /// What follows of what was told.
    pub(crate) fn complete(&mut self) {
        use quantity::{
            ENERGY_BOTH_J, ENERGY_HANDLE_J, ENERGY_TOOL_J, FELT_FORCE_N, FELT_LESS_TOOL_N,
            TOOL_FORCE_N,
        };
        let values = &mut self.values;
        for axis in 0..3 {
            values[FELT_LESS_TOOL_N + axis] =
                values[FELT_FORCE_N + axis] - values[TOOL_FORCE_N + axis];
        }
        values[ENERGY_BOTH_J] = values[ENERGY_HANDLE_J] + values[ENERGY_TOOL_J];
        let fresh = self.fresh;
        let has = |at: usize| fresh & (1 << at) != 0;
        if has(FELT_FORCE_N) && has(TOOL_FORCE_N) {
            self.fresh |= 0b111 << FELT_LESS_TOOL_N;
        }
        if has(ENERGY_HANDLE_J) {
            self.fresh |= 1 << ENERGY_BOTH_J;
        }
    }
}
