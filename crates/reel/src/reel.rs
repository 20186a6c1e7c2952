//! All of a recording: read once from front to back, then shown at any moment.
//!
//! While it is read, an index is made: where each chunk lies, the whole state every few seconds, the extremes of every
//! quantity, what happened in words. Moments are shown from then on, also while the rest still comes: from the state
//! before, by the messages since. That is never more than [`Reel::keyframe_ns`] of the recording, and no more than a
//! chunk at once is in memory.
//!
//! ```text
//! push(piece) …            the file, in pieces of any length
//! seek(moment), want() ─> give(chunk) ─> want() ─> …  nothing wanted: scene() is at the moment
//! ```

use mcap::records::{Record, op};

use crate::channels::Channels;
use crate::chunk::{Chunk, Entry};
use crate::error::ReadError;
use crate::format::METADATA;
use crate::overview::Overview;
use crate::records::{Next, Records};
use crate::scene::{Head, Heard, Lost, Scene};

/// Between two keyframes at first, ns: a seek reads as much, some 5 MB of a file.
const KEYFRAME_NS: u64 = 4_000_000_000;
/// What keyframes may take. Where they would take more, every second one goes, and the time between them doubles.
const KEYFRAME_BYTES: usize = 64 << 20;
/// Marks that are kept: a session tells a few a minute.
const MOST_MARKS: usize = 20_000;
/// A file of other things is known by so many chunks without a topic of ours.
const CHUNKS_TO_TELL: usize = 16;

/// A stretch of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Want {
    /// Where it begins.
    pub offset: u64,
    /// Its bytes.
    pub length: usize,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mark {
    /// When, ns since 1970.
    pub time_ns: u64,
    /// As in [`teleclay_ros::own::Event`].
    pub level: u8,
    /// In words.
    pub text: String,
}

/// A stretch of time whose clay the recording does not lead to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gap {
    /// Since when, and why.
    pub lost: Lost,
    /// Until when, ns since 1970; nothing where no state follows.
    pub until_ns: Option<u64>,
}

/// How a file ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Nobody has read it to its end.
    Ahead,
    /// As it was meant to.
    Whole,
    /// Somewhere: its program was killed, or it is a part of a file.
    CutOff,
}

/// What is known of a recording so far.
#[derive(Clone, Debug)]
pub struct Facts {
    /// The session, as ROS 2 spells it.
    pub session: String,
    /// Time of the first and of the last message, ns since 1970.
    pub from_ns: u64,
    /// The last.
    pub to_ns: u64,
    /// Ticks that are in it.
    pub ticks: u64,
    /// Bytes that were read.
    pub bytes: u64,
    /// Hashes of the clay that were compared with what the history makes.
    pub hashes: u64,
    /// The last of them, as told and as made.
    pub hash: Option<[u64; 2]>,
    /// When the first of them differed, ns since 1970.
    pub differs_ns: Option<u64>,
    /// Its end.
    pub end: End,
    /// Why it ended, as the file says.
    pub reason: Option<String>,
}

/// A recording.
pub struct Reel {
    records: Records,
    channels: Channels,
    chunks: Vec<Place>,
    reading: Scene,
    overview: Option<Overview>,
    keyframes: Vec<Keyframe>,
    keyframe_ns: u64,
    keyframe_bytes: usize,
    marks: Vec<Mark>,
    gaps: Vec<Gap>,
    facts: Facts,
    shown: Shown,
}

struct Place {
    offset: u64,
    length: usize,
    from_ns: u64,
}

struct Keyframe {
    /// The chunk that follows.
    chunk: usize,
    head: Head,
    state: Vec<u8>,
}

/// The moment on show, or on the way there.
#[derive(Default)]
struct Shown {
    scene: Scene,
    /// The chunk that follows, or the one that is open.
    next: usize,
    open: Option<(Chunk, usize)>,
    until_ns: u64,
}

impl Default for Reel {
    fn default() -> Self {
        Self::new()
    }
}

impl Reel {
    /// Of which nothing was read yet.
    #[must_use]
    pub fn new() -> Self {
        Self {
            records: Records::new(),
            channels: Channels::default(),
            chunks: Vec::new(),
            reading: Scene::default(),
            overview: None,
            keyframes: Vec::new(),
            keyframe_ns: KEYFRAME_NS,
            keyframe_bytes: KEYFRAME_BYTES,
            marks: Vec::new(),
            gaps: Vec::new(),
            facts: Facts {
                session: String::new(),
                from_ns: 0,
                to_ns: 0,
                ticks: 0,
                bytes: 0,
                hashes: 0,
                hash: None,
                differs_ns: None,
                end: End::Ahead,
                reason: None,
            },
            shown: Shown::default(),
        }
    }

    /// The same with another bound on what keyframes take, bytes.
    #[must_use]
    pub const fn with_keyframe_bytes(mut self, bytes: usize) -> Self {
        self.keyframe_bytes = bytes;
        self
    }

    /// The next piece of the file; an empty one says that nothing more will come. A file that still grows is not over:
    /// more of it can come later.
    ///
    /// # Errors
    /// It is no recording, or damaged from here on. What was read before can be shown.
    pub fn push(&mut self, piece: &[u8]) -> Result<(), ReadError> {
        self.facts.bytes += piece.len() as u64;
        self.records.push(piece);
        loop {
            match self.records.next()? {
                Next::Hungry => return Ok(()),
                Next::Over { is_whole } => {
                    self.facts.end = if is_whole { End::Whole } else { End::CutOff };
                    let is_ours = self.channels.session().is_some();
                    // Of a file that ends before its first chunk, nobody knows.
                    return if is_ours || !is_whole {
                        Ok(())
                    } else {
                        Err(ReadError::NotOurs)
                    };
                }
                Next::Record {
                    opcode: op::CHUNK,
                    body,
                    offset,
                } => {
                    let chunk = Chunk::open(body)?;
                    self.chunks.push(Place {
                        offset,
                        length: body.len(),
                        from_ns: chunk.from_ns,
                    });
                    self.read(&chunk)?;
                    if self.channels.session().is_none() && CHUNKS_TO_TELL <= self.chunks.len() {
                        return Err(ReadError::NotOurs);
                    }
                }
                Next::Record {
                    opcode: op::METADATA,
                    body,
                    ..
                } => {
                    if let Record::Metadata(told) = mcap::parse_record(op::METADATA, body)?
                        && told.name == METADATA
                    {
                        self.facts.reason = told.metadata.get("reason").cloned();
                    }
                }
                Next::Record {
                    opcode: op::MESSAGE,
                    ..
                } => return Err(ReadError::Unchunked),
                Next::Record { opcode, body, .. } => {
                    let entry = Entry::read(opcode, body)?;
                    self.channels.declare(entry);
                }
            }
        }
    }

    /// What is known of it.
    #[must_use]
    pub const fn facts(&self) -> &Facts {
        &self.facts
    }

    /// What happened, in its order.
    #[must_use]
    pub fn marks(&self) -> &[Mark] {
        &self.marks
    }

    /// Where it does not lead to the clay.
    #[must_use]
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// All but the clay at the last moment that was read.
    #[must_use]
    pub const fn last(&self) -> &Head {
        &self.reading.head
    }

    /// The extremes of every quantity; nothing before the first message.
    #[must_use]
    pub const fn overview(&self) -> Option<&Overview> {
        self.overview.as_ref()
    }

    /// How much of the recording a seek goes through at most, ns, where it leads to the clay.
    #[must_use]
    pub const fn keyframe_ns(&self) -> u64 {
        self.keyframe_ns
    }

    /// What its keyframes take, bytes.
    #[must_use]
    pub fn keyframe_bytes(&self) -> usize {
        self.keyframes.iter().map(|frame| frame.state.len()).sum()
    }

    /// Sets out for a moment, ns since 1970: what was told up to it, and at it. A moment behind what was read is the
    /// last that was.
    ///
    /// # Errors
    /// A keyframe cannot be read.
    pub fn seek(&mut self, time_ns: u64) -> Result<(), ReadError> {
        let until_ns = time_ns.clamp(self.facts.from_ns, self.facts.to_ns.max(self.facts.from_ns));
        let before = self
            .keyframes
            .partition_point(|frame| frame.head.time_ns <= until_ns);
        let frame = before.checked_sub(1).map(|at| &self.keyframes[at]);
        let shown = &self.shown;
        let is_ahead = until_ns < shown.scene.head.time_ns;
        let is_far = frame.is_some_and(|frame| {
            shown.next < frame.chunk && shown.scene.head.time_ns < frame.head.time_ns
        });
        if is_ahead || is_far {
            self.shown = match frame {
                Some(frame) => Shown {
                    scene: Scene::resume(frame.head.clone(), &frame.state)?,
                    next: frame.chunk,
                    ..Shown::default()
                },
                None => Shown::default(),
            };
        }
        self.shown.until_ns = until_ns;
        self.advance()
    }

    /// What of the file is needed to go on; nothing once the moment is there.
    #[must_use]
    pub fn want(&self) -> Option<Want> {
        if self.shown.open.is_some() {
            return None;
        }
        let place = self.chunks.get(self.shown.next)?;
        (place.from_ns <= self.shown.until_ns).then_some(Want {
            offset: place.offset,
            length: place.length,
        })
    }

    /// Gives what was wanted.
    ///
    /// # Errors
    /// The bytes are others, or damaged.
    pub fn give(&mut self, bytes: &[u8]) -> Result<(), ReadError> {
        self.shown.open = Some((Chunk::open(bytes)?, 0));
        self.advance()
    }

    /// The moment on show.
    pub const fn scene(&mut self) -> &mut Scene {
        &mut self.shown.scene
    }

    fn advance(&mut self) -> Result<(), ReadError> {
        let shown = &mut self.shown;
        let Some((chunk, at)) = &mut shown.open else {
            return Ok(());
        };
        while let Some((entry, behind)) = chunk.entry(*at)? {
            if let Entry::Message(message) = entry {
                if shown.until_ns < message.time_ns {
                    return Ok(());
                }
                shown.scene.take(&self.channels, message)?;
            }
            *at = behind;
        }
        shown.open = None;
        shown.next += 1;
        Ok(())
    }

    /// Takes in a chunk of which nobody has heard.
    fn read(&mut self, chunk: &Chunk) -> Result<(), ReadError> {
        let mut at = 0;
        while let Some((entry, behind)) = chunk.entry(at)? {
            at = behind;
            let Entry::Message(message) = entry else {
                self.channels.declare(entry);
                continue;
            };
            let facts = &mut self.facts;
            let overview = self.overview.get_or_insert_with(|| {
                facts.from_ns = message.time_ns;
                Overview::new(message.time_ns)
            });
            facts.to_ns = facts.to_ns.max(message.time_ns);
            let was_lost = self.reading.head.lost.is_some();
            match self.reading.take(&self.channels, message)? {
                Heard::Nothing => {}
                Heard::Tick => {
                    facts.ticks += 1;
                    for (slot, tool) in self.reading.head.tools.iter_mut().enumerate() {
                        if tool.fresh != 0 {
                            overview.put(slot, message.time_ns, tool);
                            tool.fresh = 0;
                        }
                    }
                }
                Heard::Hash { told, got } => {
                    facts.hashes += 1;
                    facts.hash = Some([told, got]);
                    if told != got {
                        facts.differs_ns.get_or_insert(message.time_ns);
                    }
                }
                Heard::Event { level, text } => {
                    if self.marks.len() < MOST_MARKS {
                        self.marks.push(Mark {
                            time_ns: message.time_ns,
                            level,
                            text,
                        });
                    }
                }
            }
            match (&self.reading.head.lost, was_lost) {
                (Some(lost), false) => self.gaps.push(Gap {
                    lost: lost.clone(),
                    until_ns: None,
                }),
                (None, true) => {
                    if let Some(gap) = self.gaps.last_mut() {
                        gap.until_ns = Some(message.time_ns);
                    }
                }
                _ => {}
            }
        }
        if self.facts.session.is_empty()
            && let Some(session) = self.channels.session()
        {
            session.clone_into(&mut self.facts.session);
        }
        self.keep_keyframe()
    }

    fn keep_keyframe(&mut self) -> Result<(), ReadError> {
        let now_ns = self.reading.head.time_ns;
        let is_due = self
            .keyframes
            .last()
            .is_none_or(|last| last.head.time_ns + self.keyframe_ns <= now_ns);
        if !is_due {
            return Ok(());
        }
        let Some(state) = self.reading.state()? else {
            return Ok(());
        };
        self.keyframes.push(Keyframe {
            chunk: self.chunks.len(),
            head: self.reading.head.clone(),
            state,
        });
        while self.keyframe_bytes < self.keyframe_bytes() && 2 < self.keyframes.len() {
            let mut number = 0;
            self.keyframes.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.keyframe_ns *= 2;
        }
        Ok(())
    }
}
