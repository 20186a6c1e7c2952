//! Makes messages of what left the tick, and writes them.
//!
//! A file is written from front to back, in chunks that are whole before they are written. Whatever ends the program,
//! the file has everything up to the last [flush](Scribe::flush), and ordinary readers open it.

use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::io::Write;
use std::sync::Arc;

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Compression, McapError, WriteOptions, Writer};
use teleclay_history::{Fact, Record, State};
use teleclay_proto::watch::Level;
use teleclay_reel::format::{FULL, HASH, METADATA, READY, SHOWN, STATE, STORAGE};
use teleclay_ros::standard::{DiagnosticArray, Text, TfMessage, Time};
use teleclay_ros::{Message, definition, names, own, to_cdr};
use teleclay_session::{Event, EventKind, Settings, Snapshot, in_words};

use crate::base::{Coming, state_after};
use crate::error::WriteError;
use crate::messages::{Beside, Frames, Moved};
use crate::tap::Feed;
use crate::tick::{BASE, BRICK, CLASSES, END, Parcel, Seen, TICK, Tick, WHOLE};

/// What a chunk holds before it is written: a tenth of a second of two tools.
const CHUNK_BYTES: u64 = 128 << 10;
/// Every how many ticks frames are placed among each other: as often as screens show them.
const TICKS_BETWEEN_TRANSFORMS: u64 = 20;
/// Every how many ticks the clay's hash is told, where it is known.
const TICKS_BETWEEN_HASHES: u64 = 1000;
/// Every how many ticks it is told how the session is doing: as often as ROS 2 is.
const TICKS_BETWEEN_DIAGNOSES: u64 = 1000;

/// What a recording is of.
#[derive(Clone, Debug)]
pub struct About {
    /// The session's name.
    pub session: String,
    /// What time stamps have beyond the clock of the tick, ns: with it they are since 1970.
    pub offset_ns: u64,
    /// Which topics that show motion are written, by whole or last name; `None` is all of them. What a replay needs is
    /// written whatever is asked for.
    pub topics: Option<Vec<String>>,
    /// Who knows how the session is doing, once a second; `None` where nobody does.
    pub diagnose: Option<Diagnose>,
}

/// Tells how a session is doing at a time, ns since 1970, as the bytes of a `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Clone)]
pub struct Diagnose(pub Arc<dyn Fn(u64) -> Vec<u8> + Send + Sync>);

impl fmt::Debug for Diagnose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Diagnose")
    }
}

/// Writes one recording.
pub struct Scribe<W: Write> {
    out: Out<W>,
    about: About,
    tools: HashMap<usize, Tool>,
    session_ids: SessionIds,
    bytes: Vec<u8>,
    state: Progress,
    counts: Counts,
    can_keep_cuts: bool,
    clay_epoch: u32,
    last_ns: u64,
    last_tick: u64,
    last_hash_tick: u64,
    last_diagnosis_tick: Option<u64>,
}

/// How far it is.
#[derive(Default)]
struct Progress {
    /// A state that is on its way.
    coming: Option<Coming>,
    /// What the session's events have come to, once it has begun.
    snapshot: Option<Snapshot>,
    /// The newest state that was written, and the records since; `None` where there was a gap since.
    base: Option<(Vec<u8>, Vec<Vec<u8>>)>,
}

/// What a recording has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Ticks that are written.
    pub ticks: u64,
    /// Ticks that found no room on their way.
    pub dropped: u64,
}

struct Out<W: Write> {
    file: Writer<NoSeek<W>>,
    schemas: HashMap<&'static str, u16>,
    sequence: u32,
}

struct SessionIds {
    events: u16,
    settings: u16,
    clay: u16,
    history: u16,
    ticks: u16,
    storage: u16,
    tf: u16,
    diagnostics: u16,
}

struct Tool {
    frames: Frames,
    frame_id: u16,
    /// By place in [`SHOWN`]; `None` where it is not asked for.
    shown: [Option<u16>; SHOWN.len()],
    moved: Moved,
}

impl<W: Write> Out<W> {
    fn channel<M: Message>(&mut self, topic: &str) -> Result<u16, McapError> {
        let schema = match self.schemas.get(M::NAME) {
            Some(id) => *id,
            None => {
                let text = definition(M::NAME).unwrap_or_default();
                let id = self.file.add_schema(M::NAME, "ros2msg", text.as_bytes())?;
                self.schemas.insert(M::NAME, id);
                id
            }
        };
        self.file
            .add_channel(schema, topic, "cdr", &BTreeMap::new())
    }

    fn write(&mut self, channel_id: u16, stamp_ns: u64, bytes: &[u8]) -> Result<(), McapError> {
        self.sequence = self.sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id,
            sequence: self.sequence,
            log_time: stamp_ns,
            publish_time: stamp_ns,
        };
        self.file.write_to_known_channel(&header, bytes)
    }
}

impl<W: Write> Scribe<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(sink: W, about: About) -> Result<Self, WriteError> {
        let file = WriteOptions::new()
            .profile("ros2")
            .library(concat!("teleclay ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Lz4))
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .create(NoSeek::new(sink))?;
        let mut out = Out {
            file,
            schemas: HashMap::new(),
            sequence: 0,
        };
        let topics = names::session_topics(&about.session);
        let storage = format!("/{}/{STORAGE}", names::clay_frame(&about.session));
        let session_ids = SessionIds {
            events: out.channel::<own::Event<'_>>(&topics.events.name)?,
            settings: out.channel::<own::Settings<'_>>(&topics.settings.name)?,
            clay: out.channel::<own::Clay<'_>>(&topics.clay.name)?,
            history: out.channel::<own::Record<'_>>(&topics.history.name)?,
            ticks: out.channel::<own::TickTime>(&topics.ticks.name)?,
            storage: out.channel::<Text<'_>>(&storage)?,
            tf: out.channel::<TfMessage<'_>>(&names::tf().name)?,
            diagnostics: out.channel::<DiagnosticArray<'_>>(&names::diagnostics().name)?,
        };
        Ok(Self {
            out,
            about,
            tools: HashMap::new(),
            session_ids,
            bytes: Vec::new(),
            state: Progress::default(),
            counts: Counts::default(),
            can_keep_cuts: true,
            clay_epoch: 0,
            last_ns: 0,
            last_tick: 0,
            last_hash_tick: 0,
            last_diagnosis_tick: None,
        })
    }

    /// Writes what has come, up to so many parcels; gives how many there were.
    ///
    /// # Errors
    /// The file cannot be written, or what came does not fit together. The recording is over then.
    pub fn take_from(&mut self, feed: &mut Feed, most: usize) -> Result<usize, WriteError> {
        let mut parcel = Vec::new();
        for taken in 0..most {
            if !feed.pop(&mut parcel) {
                return Ok(taken);
            }
            self.take(&parcel)?;
        }
        Ok(most)
    }

    /// What it has so far.
    #[must_use]
    pub const fn counts(&self) -> Counts {
        self.counts
    }

    /// Whether the state it begins with is written.
    #[must_use]
    pub const fn has_begun(&self) -> bool {
        self.state.snapshot.is_some()
    }

    /// Closes the chunk: what was written so far can be read from the sink.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        Ok(self.out.file.flush()?)
    }

    /// Ends the file with the clay as it was at the last tick, and the reason why it ends.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn finish(&mut self, reason: &str) -> Result<(), WriteError> {
        if let Some((base, records)) = self.state.base.take() {
            let state = State::decode(&base)
                .map_err(|error| WriteError::Broken(error.to_string()))
                .and_then(|state| state_after(state, &records));
            match state {
                Ok(mut state) => self.write_state(&mut state)?,
                Err(error) => self.tell(Level::Warning, &error.to_string())?,
            }
        }
        self.tell(Level::Info, &format!("the recording ends: {reason}"))?;
        let numbers = [
            ("ticks", self.counts.ticks.to_string()),
            ("dropped", self.counts.dropped.to_string()),
            ("reason", reason.to_owned()),
        ];
        self.out.file.write_metadata(&Metadata {
            name: METADATA.to_owned(),
            metadata: numbers
                .into_iter()
                .map(|(name, value)| (name.to_owned(), value))
                .collect(),
        })?;
        self.out.file.finish()?;
        Ok(())
    }

    fn take(&mut self, parcel: &[u8]) -> Result<(), WriteError> {
        let broken = || WriteError::Broken("a parcel is cut off".to_owned());
        let mut parcel = Parcel(parcel);
        match parcel.byte().ok_or_else(broken)? {
            TICK => {
                let tick = Tick::read(&mut parcel).ok_or_else(broken)?;
                self.on_tick(&tick)
            }
            BASE => {
                self.state.coming = Some(Coming::read(parcel).ok_or_else(broken)?);
                Ok(())
            }
            BRICK => match &mut self.state.coming {
                Some(coming) => coming.add_brick(parcel).ok_or_else(broken),
                None => Ok(()),
            },
            CLASSES => {
                if let Some(coming) = &mut self.state.coming {
                    coming.add_classes(parcel);
                }
                Ok(())
            }
            WHOLE => match self.state.coming.take() {
                Some(coming) => self.on_state(coming.finish()?),
                None => Ok(()),
            },
            END => {
                let (_, hash) = (parcel.u64(), parcel.u64());
                self.counts.dropped = parcel.u64().ok_or_else(broken)?;
                self.write_clay(hash.ok_or_else(broken)?, HASH, &[])
            }
            other => Err(WriteError::Broken(format!("a parcel is of kind {other}"))),
        }
    }

    fn on_tick(&mut self, tick: &Tick<'_>) -> Result<(), WriteError> {
        if tick.dropped != self.counts.dropped {
            // What lies between leads nowhere.
            self.state.base = None;
            self.counts.dropped = tick.dropped;
        }
        if let Some(coming) = &mut self.state.coming {
            for record in &tick.records {
                coming.add_record(record);
            }
        }
        self.clay_epoch = tick.clay_epoch;
        self.last_tick = tick.tick;
        self.last_ns = tick.now_ns.saturating_add(self.about.offset_ns);
        if !self.has_begun() {
            return Ok(());
        }
        if tick.can_keep_cuts != self.can_keep_cuts {
            self.write_storage(tick.can_keep_cuts)?;
        }
        for (slot, arrived_ns, bytes) in &tick.frames {
            let channel = self.tool(*slot)?.frame_id;
            let frame = own::HandleFrame {
                arrived_ns: *arrived_ns,
                bytes,
            };
            self.put(channel, &frame)?;
        }
        for record in &tick.records {
            self.on_record(record)?;
        }
        for seen in &tick.seen {
            self.show(seen)?;
        }
        if tick.tick.is_multiple_of(TICKS_BETWEEN_TRANSFORMS) {
            self.place(&tick.seen)?;
        }
        self.diagnose(tick.tick)?;
        let time = own::TickTime {
            tick: tick.tick,
            now_ns: tick.now_ns,
            dropped: tick.dropped,
        };
        self.put(self.session_ids.ticks, &time)?;
        self.counts.ticks += 1;
        if let Some(hash) = tick.hash
            && self.last_hash_tick + TICKS_BETWEEN_HASHES <= tick.tick
        {
            self.last_hash_tick = tick.tick;
            self.write_clay(hash, HASH, &[])?;
        }
        Ok(())
    }

    fn on_record(&mut self, record: &[u8]) -> Result<(), WriteError> {
        self.put(self.session_ids.history, &own::Record { bytes: record })?;
        if let Some((_, records)) = &mut self.state.base {
            records.push(record.to_vec());
        }
        let record =
            Record::decode(record).map_err(|error| WriteError::Broken(error.to_string()))?;
        for fact in record.facts {
            let Some(snapshot) = &mut self.state.snapshot else {
                return Ok(());
            };
            let Fact::Told { revision, kind } = fact else {
                continue;
            };
            let words = in_words(&kind, snapshot);
            let settings = match &kind {
                EventKind::Changed { settings } | EventKind::FreshBlock { settings, .. } => {
                    Some(Arc::clone(settings))
                }
                _ => None,
            };
            if matches!(
                kind,
                EventKind::Exchanged { .. } | EventKind::FreshBlock { given: Some(_), .. }
            ) {
                self.state.base = None;
            }
            snapshot.apply(&Event {
                tick: record.tick,
                revision,
                kind,
            });
            if let Some((level, text)) = words {
                self.tell(level, &text)?;
            }
            if let Some(settings) = settings {
                self.write_settings(&settings)?;
            }
        }
        Ok(())
    }

    fn on_state(&mut self, mut state: State) -> Result<(), WriteError> {
        let is_first = !self.has_begun();
        if is_first {
            self.write_settings(&state.session.settings)?;
            self.write_storage(self.can_keep_cuts)?;
        }
        self.write_state(&mut state)?;
        if is_first {
            self.tell(Level::Info, "the recording begins")?;
        }
        self.state.base = Some((state.encode(), Vec::new()));
        self.state.snapshot = Some(state.session);
        Ok(())
    }

    fn show(&mut self, seen: &Seen) -> Result<(), WriteError> {
        self.tool(seen.slot)?;
        let operator = self.state.snapshot.as_ref().and_then(|snapshot| {
            let holder = snapshot.tools.get(seen.slot)?.holder.as_ref()?;
            Some(&*holder.operator.name)
        });
        let (Some(tool), out) = (self.tools.get_mut(&seen.slot), &mut self.out) else {
            return Ok(());
        };
        let stamp_ns = self.last_ns;
        let beside = Beside {
            stamp_ns,
            operator_name: operator.unwrap_or(""),
            step_n: tool.moved.step_n(seen),
        };
        tool.frames
            .tell(seen, beside, &mut self.bytes, |at, bytes| {
                match tool.shown[at] {
                    Some(channel) => out.write(channel, stamp_ns, bytes),
                    None => Ok(()),
                }
            })?;
        Ok(())
    }

    fn place(&mut self, seen: &[Seen]) -> Result<(), WriteError> {
        let transforms: Vec<_> = seen
            .iter()
            .filter_map(|seen| {
                let tool = self.tools.get(&seen.slot)?;
                Some(tool.frames.transform(seen, self.last_ns))
            })
            .collect();
        if transforms.is_empty() {
            return Ok(());
        }
        to_cdr(&TfMessage { transforms }, &mut self.bytes);
        Ok(self
            .out
            .write(self.session_ids.tf, self.last_ns, &self.bytes)?)
    }

    fn diagnose(&mut self, tick: u64) -> Result<(), WriteError> {
        let is_due = self
            .last_diagnosis_tick
            .is_none_or(|last| last + TICKS_BETWEEN_DIAGNOSES <= tick);
        let (Some(Diagnose(diagnose)), true) = (&self.about.diagnose, is_due) else {
            return Ok(());
        };
        self.last_diagnosis_tick = Some(tick);
        let message = diagnose(self.last_ns);
        let channel = self.session_ids.diagnostics;
        Ok(self.out.write(channel, self.last_ns, &message)?)
    }

    fn tool(&mut self, slot: usize) -> Result<&Tool, WriteError> {
        if !self.tools.contains_key(&slot) {
            let number = slot as u32 + 1;
            let topics = names::topics(&self.about.session, number);
            let out = &mut self.out;
            let frame_id = out.channel::<own::HandleFrame<'_>>(&topics.handle_frame.name)?;
            let shown = self.shown(&topics)?;
            let tool = Tool {
                frames: Frames::new(&self.about.session, number),
                frame_id,
                shown,
                moved: Moved::default(),
            };
            self.tools.insert(slot, tool);
        }
        Ok(&self.tools[&slot])
    }

    fn shown(
        &mut self,
        topics: &names::ToolTopics,
    ) -> Result<[Option<u16>; SHOWN.len()], WriteError> {
        use teleclay_ros::standard::{PoseStamped, TwistStamped, WrenchStamped};
        let mut shown = [None; SHOWN.len()];
        for (at, last) in SHOWN.iter().enumerate() {
            let topic = topics
                .iter()
                .map(|topic| topic.name.as_str())
                .find(|name| name.rsplit('/').next() == Some(last));
            let Some(topic) = topic.filter(|name| self.about.wants(name)) else {
                continue;
            };
            let out = &mut self.out;
            shown[at] = Some(match at {
                0 | 1 => out.channel::<PoseStamped<'_>>(topic)?,
                2 | 3 => out.channel::<TwistStamped<'_>>(topic)?,
                4..=6 => out.channel::<WrenchStamped<'_>>(topic)?,
                7 => out.channel::<own::Link<'_>>(topic)?,
                8 => out.channel::<own::Energy>(topic)?,
                _ => out.channel::<own::Corrections>(topic)?,
            });
        }
        Ok(shown)
    }

    fn write_state(&mut self, state: &mut State) -> Result<(), WriteError> {
        state.session.tick = self.last_tick;
        let (epoch, hash) = (state.session.clay_epoch, state.clay.hash());
        let bytes = state.encode();
        self.clay_epoch = epoch;
        self.write_clay(hash, STATE, &bytes)
    }

    fn write_clay(&mut self, hash: u64, format: &str, bytes: &[u8]) -> Result<(), WriteError> {
        let clay = own::Clay {
            epoch: self.clay_epoch,
            hash,
            format,
            bytes,
        };
        self.put(self.session_ids.clay, &clay)
    }

    fn write_settings(&mut self, settings: &Settings) -> Result<(), WriteError> {
        let json = serde_json::to_string(settings)
            .map_err(|error| WriteError::Broken(error.to_string()))?;
        let message = own::Settings {
            stamp: Time::from_ns(self.last_ns),
            revision: settings.revision,
            json: &json,
        };
        self.put(self.session_ids.settings, &message)
    }

    fn write_storage(&mut self, can_keep_cuts: bool) -> Result<(), WriteError> {
        self.can_keep_cuts = can_keep_cuts;
        let data = if can_keep_cuts { READY } else { FULL };
        self.put(self.session_ids.storage, &Text { data })
    }

    fn tell(&mut self, level: Level, text: &str) -> Result<(), WriteError> {
        let event = own::Event {
            stamp: Time::from_ns(self.last_ns),
            level: match level {
                Level::Info => own::Event::INFO,
                Level::Warning => own::Event::WARNING,
                Level::Error => own::Event::ERROR,
            },
            text,
        };
        self.put(self.session_ids.events, &event)
    }

    fn put(&mut self, channel: u16, message: &impl Message) -> Result<(), WriteError> {
        to_cdr(message, &mut self.bytes);
        Ok(self.out.write(channel, self.last_ns, &self.bytes)?)
    }
}

impl About {
    fn wants(&self, topic: &str) -> bool {
        self.topics.as_ref().is_none_or(|wanted| {
            wanted
                .iter()
                .any(|wanted| topic == wanted || topic.ends_with(&format!("/{wanted}")))
        })
    }
}
