//! What each channel of a file tells, by its topic and type.

use std::collections::BTreeMap;

use teleclay_ros::CdrError;

use crate::chunk::Entry;
use crate::error::ReadError;
use crate::format::{SHOWN, STORAGE};

/// What a message is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Told {
    /// A frame for the tool in a slot, from 0.
    Frame(usize),
    /// A record of the history.
    Record,
    /// A tick's end.
    Tick,
    /// Whether cuts could be kept.
    Storage,
    /// The clay, or its hash.
    Clay,
    /// Something in words.
    Event,
    /// One of [`SHOWN`], by its place there, of the tool in a slot.
    Shown(usize, usize),
    /// Nothing that is read here.
    Nothing,
}

#[derive(Default)]
pub(crate) struct Channels {
    schemas: BTreeMap<u16, String>,
    /// By number.
    channels: Vec<Option<(Told, String)>>,
    session: Option<String>,
}

impl Channels {
    /// Takes in what a file declares.
    pub(crate) fn declare(&mut self, entry: Entry<'_>) {
        match entry {
            Entry::Schema { id, name } => {
                self.schemas.insert(id, name);
            }
            Entry::Channel { id, schema, topic } => {
                let schema = self.schemas.get(&schema).map_or("", String::as_str);
                let told = told(schema, &topic);
                if told == Told::Tick {
                    // `/teleclay/<session>/ticks`
                    self.session = topic.rsplit('/').nth(1).map(str::to_owned);
                }
                let at = usize::from(id);
                if self.channels.len() <= at {
                    self.channels.resize(at + 1, None);
                }
                self.channels[at] = Some((told, topic));
            }
            Entry::Message(_) | Entry::Other => {}
        }
    }

    /// What the messages of a channel tell.
    pub(crate) fn told(&self, channel: u16) -> Told {
        match self.channels.get(usize::from(channel)) {
            Some(Some((told, _))) => *told,
            _ => Told::Nothing,
        }
    }

    /// The session, as ROS 2 spells it; nothing where the file is of other things.
    pub(crate) fn session(&self) -> Option<&str> {
        self.session.as_deref()
    }

    /// Why a message of a channel cannot be read.
    pub(crate) fn damaged(&self, channel: u16, error: CdrError) -> ReadError {
        let known = self.channels.get(usize::from(channel));
        let topic = known.and_then(Option::as_ref).map(|(_, topic)| topic);
        ReadError::Message {
            topic: topic.cloned().unwrap_or_default(),
            error,
        }
    }
}

fn told(schema: &str, topic: &str) -> Told {
    let last = topic.rsplit('/').next().unwrap_or_default();
    match schema {
        "teleclay_msgs/msg/HandleFrame" => Told::Frame(slot_of(topic)),
        "teleclay_msgs/msg/Record" => Told::Record,
        "teleclay_msgs/msg/TickTime" => Told::Tick,
        "teleclay_msgs/msg/Clay" => Told::Clay,
        "teleclay_msgs/msg/Event" => Told::Event,
        "std_msgs/msg/String" if last == STORAGE => Told::Storage,
        "geometry_msgs/msg/PoseStamped"
        | "geometry_msgs/msg/TwistStamped"
        | "geometry_msgs/msg/WrenchStamped"
        | "teleclay_msgs/msg/Link"
        | "teleclay_msgs/msg/Energy"
        | "teleclay_msgs/msg/Corrections" => {
            let shown = SHOWN.iter().position(|word| *word == last);
            shown.map_or(Told::Nothing, |shown| Told::Shown(slot_of(topic), shown))
        }
        _ => Told::Nothing,
    }
}

/// `…/tool_<n>/handle_frame` has slot n - 1.
fn slot_of(topic: &str) -> usize {
    let tool = topic
        .rsplit('/')
        .nth(1)
        .and_then(|part| part.rsplit('_').next());
    let tool = tool.and_then(|number| number.parse::<usize>().ok());
    tool.unwrap_or(1).saturating_sub(1)
}
