//! The tick's end of a recording. It never waits, and touches no heap after it was made.
//!
//! A recording begins with the session's state, clay included, and no tick has the time to copy a block. So bricks
//! leave a few in each tick while the session goes on, and with them every cut that is made meanwhile. Cuts have no
//! order: the bricks, each as it was at some moment, and all cuts since the first of them are the clay at the last.

use rtrb::chunks::ChunkError;
use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_clay::{BrickView, Clay};
use teleclay_history::{Recorder, State, Strokes};
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{HandleFrame, MAX_FRAME};
use teleclay_session::{Event, EventKind, Session};

use crate::tick::{BASE, BRICK, CLASSES, END, Seen, TICK, WHOLE, put_frame};

/// Room between tick and writer: two seconds of eight tools, or of bricks.
const RING_BYTES: usize = 1 << 23;
/// Room for a parcel: the records of a tick take 128 KiB at most, and frames may have waited for a quarter of a second.
const PARCEL_BYTES: usize = 1 << 19;
/// Bricks of voxels that leave in a tick, 4 KiB each, and bricks that are looked at.
const VOXEL_BRICKS_A_TICK: usize = 4;
const BRICKS_A_TICK: usize = 64;
/// Bytes of classes that leave in a tick: as much as bricks of voxels.
const CLASS_BYTES_A_TICK: usize = 4 * 4096;
/// Bricks whose hash is brought up to date in a tick: half a microsecond each.
const HASHES_A_TICK: usize = 4;
/// Ticks between two snapshots of the clay.
pub const TICKS_BETWEEN_SNAPSHOTS: u64 = 30_000;

/// What of a session is recorded.
pub struct Tap {
    ring: Producer<u8>,
    recorder: Recorder,
    strokes: Strokes,
    parcel: Vec<u8>,
    frames: Vec<u8>,
    frame_count: u16,
    frames_are_lost: bool,
    buffer: Box<[u8; MAX_FRAME]>,
    /// Every how many ticks tools are shown.
    shown_every: u64,
    dropped: u64,
    snapshot: Snapshot,
    last_snapshot: u64,
    clay_epoch: u32,
}

/// The other end.
pub struct Feed {
    pub(crate) ring: Consumer<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Snapshot {
    /// What was written before does not lead to the session as it is.
    Wanted,
    /// Of the classes of material, bytes from this one on are still to leave, then bricks from `next` on.
    UnderWay {
        classes_from: usize,
        next: u32,
    },
    Done,
}

impl Tap {
    /// For a session of so many tools, which are shown every `shown_every` ticks.
    #[must_use]
    pub fn new(tools: usize, shown_every: u64) -> (Self, Feed) {
        let (mut ring, mut consumer) = RingBuffer::new(RING_BYTES);
        // Once through, so that no tick is the first to touch a page.
        if let Ok(chunk) = ring.write_chunk(RING_BYTES) {
            chunk.commit_all();
        }
        if let Ok(chunk) = consumer.read_chunk(RING_BYTES) {
            chunk.commit_all();
        }
        let tap = Self {
            ring,
            recorder: Recorder::new(tools),
            strokes: Strokes::new(tools),
            parcel: touched(PARCEL_BYTES),
            frames: touched(PARCEL_BYTES),
            frame_count: 0,
            frames_are_lost: false,
            buffer: Box::new([0; MAX_FRAME]),
            shown_every: shown_every.max(1),
            dropped: 0,
            snapshot: Snapshot::Wanted,
            last_snapshot: 0,
            clay_epoch: 0,
        };
        (tap, Feed { ring: consumer })
    }

    /// A frame has come to the tool side in `slot`: what [`Session::tick_heard`] tells.
    pub fn on_frame(&mut self, slot: usize, arrived: Timestamp, frame: &HandleFrame) {
        if PARCEL_BYTES / 2 < self.frames.len() + MAX_FRAME {
            self.frames_are_lost = true;
            return;
        }
        put_frame(&mut self.frames, slot, arrived, frame, &mut self.buffer);
        self.frame_count += 1;
    }

    /// What has happened in a tick, with all events that the session has given since the one before.
    pub fn on_tick<'a>(
        &mut self,
        session: &mut Session,
        now: Timestamp,
        events: impl Iterator<Item = &'a Event> + Clone,
    ) {
        if self.ring.is_abandoned() {
            // Nobody writes any more.
            return self.forget_frames();
        }
        let is_unwritable = events.clone().any(|event| leads_elsewhere(&event.kind));
        self.put_tick(session, now, events);
        let is_other_block = self.clay_epoch != session.clay_epoch();
        self.clay_epoch = session.clay_epoch();
        let fits = !self.frames_are_lost && self.push();
        self.dropped += u64::from(!fits);
        self.forget_frames();
        let is_copying = matches!(self.snapshot, Snapshot::UnderWay { .. });
        let is_due = self.last_snapshot + TICKS_BETWEEN_SNAPSHOTS <= session.ticks();
        if !fits || is_unwritable || (is_copying && is_other_block) || (is_due && !is_copying) {
            self.snapshot = Snapshot::Wanted;
        }
        match self.snapshot {
            Snapshot::Wanted => self.begin_snapshot(session),
            Snapshot::UnderWay { classes_from, next } => {
                if self.go_on_with_classes(session.clay(), classes_from) {
                    self.go_on_with_snapshot(session.clay(), next);
                }
            }
            Snapshot::Done => {}
        }
    }

    /// The recording ends here, with the hash of the clay.
    pub fn end(&mut self, session: &mut Session) {
        self.begin(END);
        let hash = session.clay_mut().hash();
        self.parcel
            .extend_from_slice(&session.ticks().to_le_bytes());
        self.parcel.extend_from_slice(&hash.to_le_bytes());
        self.parcel.extend_from_slice(&self.dropped.to_le_bytes());
        // Without room the end goes unsaid, and the file ends with its last tick.
        self.push();
    }

    fn put_tick<'a>(
        &mut self,
        session: &mut Session,
        now: Timestamp,
        events: impl Iterator<Item = &'a Event> + Clone,
    ) {
        let tick = session.ticks();
        let is_hashed = session.clay_mut().refresh_hashes(HASHES_A_TICK) == 0;
        let hash = if is_hashed {
            session.clay_mut().hash()
        } else {
            0
        };
        self.begin(TICK);
        let out = &mut self.parcel;
        for number in [tick, now.as_nanos(), self.dropped] {
            out.extend_from_slice(&number.to_le_bytes());
        }
        out.push(u8::from(session.can_keep_cuts()));
        out.extend_from_slice(&session.clay_epoch().to_le_bytes());
        out.push(u8::from(is_hashed));
        out.extend_from_slice(&hash.to_le_bytes());
        out.extend_from_slice(&self.frame_count.to_le_bytes());
        out.extend_from_slice(&self.frames);
        let count_at = out.len();
        out.push(0);
        // What commands have done is a record of its own, so that a replay can do it between the ticks.
        if let Some(record) = self.recorder.between(session, events.clone()) {
            put_record(out, record);
            out[count_at] += 1;
        }
        let events = events.filter(|event| tick <= event.tick);
        if let Some(record) = self.recorder.record(session, events) {
            put_record(out, record);
            out[count_at] += 1;
        }
        let count_at = out.len();
        out.push(0);
        if !tick.is_multiple_of(self.shown_every) {
            return;
        }
        for slot in 0..session.tools() {
            let Some(side) = session.side(slot) else {
                continue;
            };
            let seen = Seen {
                slot,
                lease: side.lease(),
                is_connected: side.is_connected(now),
                age_s: side.silence_s(now),
                rtt_s: side.round_trip().last().map(|rtt| rtt.as_secs_f64()),
                view: side.view(),
            };
            seen.put(out);
            out[count_at] += 1;
        }
    }

    fn begin_snapshot(&mut self, session: &Session) {
        self.begin(BASE);
        let clay = session.clay();
        let grid = clay.grid();
        for count in grid.voxels() {
            self.parcel.extend_from_slice(&count.to_le_bytes());
        }
        self.parcel
            .extend_from_slice(&grid.voxel_size_m().to_le_bytes());
        self.parcel
            .extend_from_slice(&clay.initial_units().to_le_bytes());
        State::encode_without_clay(session, &self.strokes, &mut self.parcel);
        if self.push() {
            self.last_snapshot = session.ticks();
            self.snapshot = Snapshot::UnderWay {
                classes_from: 0,
                next: 0,
            };
        }
    }

    /// Tells a part of the classes, if there are some and not all of them have left; says whether none is left to tell.
    fn go_on_with_classes(&mut self, clay: &Clay, from: usize) -> bool {
        let encoded = clay.classes().map_or(&[][..], |classes| classes.encoded());
        let rest = encoded.get(from..).unwrap_or_default();
        if rest.is_empty() {
            return true;
        }
        let part = &rest[..rest.len().min(CLASS_BYTES_A_TICK)];
        self.begin(CLASSES);
        self.parcel.extend_from_slice(part);
        if RING_BYTES / 4 <= self.ring.slots() && self.push() {
            self.snapshot = Snapshot::UnderWay {
                classes_from: from + part.len(),
                next: 0,
            };
        }
        false
    }

    fn go_on_with_snapshot(&mut self, clay: &Clay, first: u32) {
        let mut next = first;
        let mut voxel_bricks = 0;
        for _ in 0..BRICKS_A_TICK {
            let Some(index) = clay.grid().brick_index(next) else {
                self.begin(WHOLE);
                if self.push() {
                    self.snapshot = Snapshot::Done;
                }
                return;
            };
            let view = clay.brick(index);
            self.begin(BRICK);
            self.parcel.extend_from_slice(&next.to_le_bytes());
            match view {
                BrickView::Empty => self.parcel.push(0),
                BrickView::Full => self.parcel.push(1),
                BrickView::Voxels(voxels) => {
                    self.parcel.push(2);
                    self.parcel.extend_from_slice(voxels);
                    voxel_bricks += 1;
                }
            }
            // Ticks come before bricks: these wait where there is little room.
            if self.ring.slots() < RING_BYTES / 4 || !self.push() {
                break;
            }
            next += 1;
            if voxel_bricks == VOXEL_BRICKS_A_TICK {
                break;
            }
        }
        self.snapshot = Snapshot::UnderWay {
            classes_from: usize::MAX,
            next,
        };
    }

    fn forget_frames(&mut self) {
        self.frames.clear();
        self.frame_count = 0;
        self.frames_are_lost = false;
    }

    fn begin(&mut self, kind: u8) {
        self.parcel.clear();
        self.parcel.extend_from_slice(&[0; 4]);
        self.parcel.push(kind);
    }

    /// The whole parcel, or nothing of it.
    fn push(&mut self) -> bool {
        let length = self.parcel.len();
        self.parcel[..4].copy_from_slice(&(length as u32 - 4).to_le_bytes());
        match self.ring.write_chunk(length) {
            Ok(mut chunk) => {
                let (first, second) = chunk.as_mut_slices();
                let (one, other) = self.parcel.split_at(first.len());
                first.copy_from_slice(one);
                second.copy_from_slice(other);
                chunk.commit_all();
                true
            }
            Err(ChunkError::TooFewSlots(_)) => false,
        }
    }
}

/// Room that has its pages already.
fn touched(bytes: usize) -> Vec<u8> {
    let mut room = vec![1; bytes];
    room.clear();
    room
}

fn put_record(out: &mut Vec<u8>, record: &[u8]) {
    out.extend_from_slice(&(record.len() as u32).to_le_bytes());
    out.extend_from_slice(record);
}

/// Whether the clay after an event is in nothing that is written.
fn leads_elsewhere(kind: &EventKind) -> bool {
    matches!(
        kind,
        EventKind::Exchanged { .. } | EventKind::FreshBlock { given: Some(_), .. }
    )
}

impl Feed {
    /// Takes a parcel into `parcel`, if one is there.
    pub(crate) fn pop(&mut self, parcel: &mut Vec<u8>) -> bool {
        parcel.clear();
        let Ok(head) = self.ring.read_chunk(4) else {
            return false;
        };
        let mut length = [0; 4];
        for (byte, from) in length.iter_mut().zip(head) {
            *byte = from;
        }
        let length = u32::from_le_bytes(length) as usize;
        let Ok(body) = self.ring.read_chunk(length) else {
            // A parcel comes as a whole.
            return false;
        };
        let (one, other) = body.as_slices();
        parcel.extend_from_slice(one);
        parcel.extend_from_slice(other);
        body.commit_all();
        true
    }

    /// Whether nothing more will come than what is there.
    pub(crate) fn has_ended(&self) -> bool {
        self.ring.is_abandoned()
    }
}
