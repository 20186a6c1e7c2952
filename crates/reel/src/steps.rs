//! A recording tick by tick, up to wherever it is whole: what a replay goes through.

use mcap::records::op;
use teleclay_ros::standard::Text;
use teleclay_ros::{from_cdr, own};

use crate::channels::{Channels, Told};
use crate::chunk::{Chunk, Entry, Message};
use crate::error::ReadError;
use crate::format::{FULL, HASH, STATE};
use crate::records::{Next, Records};

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
    /// What of the file was not given to `records` yet; nothing once its end was.
    rest: Option<&'a [u8]>,
    records: Records,
    channels: Channels,
    chunk: Chunk,
    at: usize,
    coming: Ticked,
    is_cut_off: bool,
    is_over: bool,
}

/// Bytes of a file that are taken at once.
const PIECE: usize = 1 << 20;

impl<'a> Recorded<'a> {
    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// They are none of MCAP.
    pub fn new(file: &'a [u8]) -> Result<Self, ReadError> {
        if !file.starts_with(mcap::MAGIC) {
            return Err(ReadError::NotMcap);
        }
        Ok(Self {
            rest: Some(file),
            records: Records::new(),
            channels: Channels::default(),
            chunk: Chunk::default(),
            at: 0,
            coming: Ticked {
                can_keep_cuts: true,
                ..Ticked::default()
            },
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
        loop {
            while let Some((entry, behind)) = self.chunk.entry(self.at)? {
                self.at = behind;
                let Entry::Message(message) = entry else {
                    self.channels.declare(entry);
                    continue;
                };
                if let Some(step) = take(&self.channels, &mut self.coming, message)? {
                    return Ok(Some(step));
                }
            }
            match self.records.next()? {
                Next::Hungry => {
                    let rest = self.rest.unwrap_or_default();
                    let (piece, rest) = rest.split_at(rest.len().min(PIECE));
                    self.records.push(piece);
                    self.rest = Some(rest);
                }
                Next::Over { is_whole } => {
                    self.is_cut_off = !is_whole;
                    return Ok(None);
                }
                Next::Record {
                    opcode: op::CHUNK,
                    body,
                    ..
                } => {
                    self.chunk = Chunk::open(body)?;
                    self.at = 0;
                }
                Next::Record { opcode, body, .. } => match Entry::read(opcode, body)? {
                    Entry::Message(message) => {
                        if let Some(step) = take(&self.channels, &mut self.coming, message)? {
                            return Ok(Some(step));
                        }
                    }
                    entry => self.channels.declare(entry),
                },
            }
        }
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

fn take(
    channels: &Channels,
    coming: &mut Ticked,
    message: Message<'_>,
) -> Result<Option<Step>, ReadError> {
    let Message { channel, data, .. } = message;
    let damaged = |error| channels.damaged(channel, error);
    match channels.told(channel) {
        Told::Frame(slot) => {
            let frame: own::HandleFrame<'_> = from_cdr(data).map_err(damaged)?;
            coming.frames.push(CameIn {
                slot,
                arrived_ns: frame.arrived_ns,
                bytes: frame.bytes.to_vec(),
            });
        }
        Told::Record => {
            let record: own::Record<'_> = from_cdr(data).map_err(damaged)?;
            coming.records.push(record.bytes.to_vec());
        }
        Told::Tick => {
            let time: own::TickTime = from_cdr(data).map_err(damaged)?;
            let next = Ticked {
                can_keep_cuts: coming.can_keep_cuts,
                ..Ticked::default()
            };
            return Ok(Some(Step::Ticked(Ticked {
                tick: time.tick,
                now_ns: time.now_ns,
                dropped: time.dropped,
                ..std::mem::replace(coming, next)
            })));
        }
        Told::Storage => {
            let text: Text<'_> = from_cdr(data).map_err(damaged)?;
            coming.can_keep_cuts = text.data != FULL;
        }
        Told::Clay => {
            let clay: own::Clay<'_> = from_cdr(data).map_err(damaged)?;
            match clay.format {
                STATE => return Ok(Some(Step::State(clay.bytes.to_vec()))),
                HASH => return Ok(Some(Step::Hash(clay.hash))),
                _ => {}
            }
        }
        Told::Event | Told::Shown(..) | Told::Nothing => {}
    }
    Ok(None)
}
