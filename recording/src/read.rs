//! A recording's file, tick by tick, up to wherever it is whole.

use std::collections::BTreeMap;

use mcap::{McapError, MessageStream};
use teleclay_ros::standard::Text;
use teleclay_ros::{CdrError, from_cdr, own};

use crate::scribe::{FULL, HASH, STATE, STORAGE};

/// Why a file is no recording.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It is damaged, or no MCAP file.
    #[error(transparent)]
    File(#[from] McapError),
    /// A message is damaged.
    #[error("a message on {topic} cannot be read: {error}")]
    Message {
        /// Its topic.
        topic: String,
        /// What is wrong with its bytes.
        error: CdrError,
    },
}

/// A frame as it came out of a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CameIn {
    /// The tool's slot, from 0.
    pub slot: usize,
    /// When it came, ns.
    pub arrived_ns: u64,
    /// The frame.
    pub bytes: Vec<u8>,
}

/// One tick.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ticked {
    /// The session's tick.
    pub tick: u64,
    /// The time that the tick was given, ns.
    pub now_ns: u64,
    /// Ticks that were not written so far.
    pub dropped: u64,
    /// Whether cuts could be kept in it.
    pub can_keep_cuts: bool,
    /// What came to the tool sides in it, in its order.
    pub frames: Vec<CameIn>,
    /// The records of its history, in their order.
    pub records: Vec<Vec<u8>>,
}

/// What a recording has, one after the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// A tick.
    Ticked(Ticked),
    /// The state after the last tick, as bytes of [`teleclay_history::State`].
    State(Vec<u8>),
    /// The hash of the clay after the last tick.
    Hash(u64),
}

/// The steps of a recording.
pub struct Recorded<'a> {
    messages: MessageStream<'a>,
    coming: Ticked,
    slots: BTreeMap<u16, usize>,
    is_cut_off: bool,
    is_over: bool,
}

impl<'a> Recorded<'a> {
    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// They are none of MCAP.
    pub fn new(file: &'a [u8]) -> Result<Self, ReadError> {
        Ok(Self {
            messages: MessageStream::new(file)?,
            coming: Ticked {
                can_keep_cuts: true,
                ..Ticked::default()
            },
            slots: BTreeMap::new(),
            is_cut_off: false,
            is_over: false,
        })
    }

    /// Whether the file ended before its end was written. Known once every step was taken.
    #[must_use]
    pub const fn is_cut_off(&self) -> bool {
        self.is_cut_off
    }

    fn step(&mut self) -> Result<Option<Step>, ReadError> {
        for message in self.messages.by_ref() {
            let message = match message {
                Ok(message) => message,
                Err(error) if is_end(&error) => {
                    self.is_cut_off = true;
                    return Ok(None);
                }
                Err(error) => return Err(error.into()),
            };
            let topic = &message.channel.topic;
            let damaged = |error| ReadError::Message {
                topic: topic.clone(),
                error,
            };
            let Some(schema) = &message.channel.schema else {
                continue;
            };
            match schema.name.as_str() {
                "teleclay_msgs/msg/HandleFrame" => {
                    let frame: own::HandleFrame<'_> = from_cdr(&message.data).map_err(damaged)?;
                    let id = message.channel.id;
                    let slot = *self.slots.entry(id).or_insert_with(|| slot_of(topic));
                    self.coming.frames.push(CameIn {
                        slot,
                        arrived_ns: frame.arrived_ns,
                        bytes: frame.bytes.to_vec(),
                    });
                }
                "teleclay_msgs/msg/Record" => {
                    let record: own::Record<'_> = from_cdr(&message.data).map_err(damaged)?;
                    self.coming.records.push(record.bytes.to_vec());
                }
                "teleclay_msgs/msg/TickTime" => {
                    let time: own::TickTime = from_cdr(&message.data).map_err(damaged)?;
                    let next = Ticked {
                        can_keep_cuts: self.coming.can_keep_cuts,
                        ..Ticked::default()
                    };
                    return Ok(Some(Step::Ticked(Ticked {
                        tick: time.tick,
                        now_ns: time.now_ns,
                        dropped: time.dropped,
                        ..std::mem::replace(&mut self.coming, next)
                    })));
                }
                "std_msgs/msg/String" if topic.ends_with(STORAGE) => {
                    let text: Text<'_> = from_cdr(&message.data).map_err(damaged)?;
                    self.coming.can_keep_cuts = text.data != FULL;
                }
                "teleclay_msgs/msg/Clay" => {
                    let clay: own::Clay<'_> = from_cdr(&message.data).map_err(damaged)?;
                    match clay.format {
                        STATE => return Ok(Some(Step::State(clay.bytes.to_vec()))),
                        HASH => return Ok(Some(Step::Hash(clay.hash))),
                        _ => {}
                    }
                }
                _ => {}
            }
        }
        Ok(None)
    }
}

impl Iterator for Recorded<'_> {
    type Item = Result<Step, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_over {
            return None;
        }
        let step = self.step().transpose();
        self.is_over = !matches!(step, Some(Ok(_)));
        step
    }
}

/// What a file ends with that was cut off anywhere.
fn is_end(error: &McapError) -> bool {
    matches!(
        error,
        McapError::UnexpectedEof | McapError::BadFooter | McapError::UnexpectedEoc
    )
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
