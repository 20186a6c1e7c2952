//! The thread around a [`Writer`], and the ring that feeds it.
//!
//! Whoever makes records, a tick, never waits: [`Appender::push`] copies into a ring of a fixed length, or says that it
//! is full. The thread takes records out of it while the writer has room for them, so a storage that fails fills first
//! the writer's memory and then the ring.

use std::io;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer, RingBuffer};

use crate::segment::MAX_PAYLOAD;
use crate::storage::Storage;
use crate::writer::{State, Writer};

/// Bytes in the ring: five seconds of eight tools that cut, so that a slow sync stops nobody.
const RING_BYTES: usize = 2 << 20;
/// The thread looks into the ring this often. Waking it would cost the tick a call to the system; looking more often
/// costs a processor more than everything that is written: a record that comes while a sync of 4 ms goes on waits for
/// that, for the next look and for its own sync, 16 ms in all.
const LOOK_EVERY: Duration = Duration::from_millis(8);
/// Bytes before a record in the ring: its length.
const LENGTH_BYTES: usize = 4;

/// What the thread tells.
struct Shared {
    durable: AtomicU64,
    has_failed: AtomicBool,
    must_end: AtomicBool,
    state: Mutex<State>,
}

/// The way in for records. Belongs to the one who makes them; never waits and allocates nothing.
pub struct Appender {
    ring: Producer<u8>,
    last: u64,
    shared: Arc<Shared>,
}

/// What has become of records, for whoever wants to know.
#[derive(Clone)]
pub struct Watch {
    shared: Arc<Shared>,
}

/// The thread. Dropped, it makes one last try to write what waits, and ends.
pub struct Running {
    thread: Option<JoinHandle<()>>,
    watch: Watch,
}

/// The ring is full, or the record is longer than a record may be: it was not taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no room for a record of {wanted} bytes, the ring has {room}")]
pub struct RingFull {
    /// Bytes of the record.
    pub wanted: usize,
    /// Bytes that the ring has left.
    pub room: usize,
}

/// Starts the thread of a writer.
///
/// # Errors
/// The operating system gives no thread.
pub fn start<S>(writer: Writer<S>) -> io::Result<(Appender, Running)>
where
    S: Storage + Send + 'static,
    S::File: Send,
{
    let (producer, consumer) = RingBuffer::new(RING_BYTES);
    let shared = Arc::new(Shared {
        durable: AtomicU64::new(writer.durable()),
        has_failed: AtomicBool::new(false),
        must_end: AtomicBool::new(false),
        state: Mutex::new(writer.state()),
    });
    let appender = Appender {
        ring: producer,
        last: writer.last(),
        shared: Arc::clone(&shared),
    };
    let watch = Watch {
        shared: Arc::clone(&shared),
    };
    let thread = Builder::new()
        .name("journal".to_owned())
        .spawn(move || run(writer, consumer, &shared))?;
    let running = Running {
        thread: Some(thread),
        watch,
    };
    Ok((appender, running))
}

impl Appender {
    /// Takes in a record and gives its number.
    ///
    /// # Errors
    /// There is no room for it. Whoever cuts has to stop before that: see [`Appender::must_pause`].
    pub fn push(&mut self, payload: &[u8]) -> Result<u64, RingFull> {
        let bytes = LENGTH_BYTES + payload.len();
        let full = |room: usize| RingFull {
            wanted: payload.len(),
            room: room.saturating_sub(LENGTH_BYTES),
        };
        if MAX_PAYLOAD < payload.len() {
            return Err(full(LENGTH_BYTES + MAX_PAYLOAD));
        }
        let room = self.ring.slots();
        let chunk = self.ring.write_chunk_uninit(bytes);
        let length = (payload.len() as u32).to_le_bytes();
        let record = length.into_iter().chain(payload.iter().copied());
        chunk.map_err(|_| full(room))?.fill_from_iter(record);
        self.last += 1;
        Ok(self.last)
    }

    /// Number of the last record taken in.
    #[must_use]
    pub const fn last(&self) -> u64 {
        self.last
    }

    /// Number of the last record that is durable.
    #[must_use]
    pub fn durable(&self) -> u64 {
        self.shared.durable.load(Ordering::Acquire)
    }

    /// Whether cutting has to pause: the storage fails, or half of the ring is full.
    #[must_use]
    pub fn must_pause(&self) -> bool {
        self.shared.has_failed.load(Ordering::Acquire) || self.ring.slots() < RING_BYTES / 2
    }
}

impl Watch {
    /// Number of the last record that is durable.
    #[must_use]
    pub fn durable(&self) -> u64 {
        self.shared.durable.load(Ordering::Acquire)
    }

    /// What has become of the records that the thread has taken out of the ring. Not for a tick: it may wait.
    #[must_use]
    pub fn state(&self) -> State {
        self.shared
            .state
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

impl Running {
    /// What has become of records.
    #[must_use]
    pub fn watch(&self) -> Watch {
        self.watch.clone()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.watch.shared.must_end.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // A panic there has been told already.
            let _ = thread.join();
        }
    }
}

fn run<S: Storage>(mut writer: Writer<S>, mut ring: Consumer<u8>, shared: &Shared) {
    let start = Instant::now();
    let mut record = Vec::new();
    loop {
        let must_end = shared.must_end.load(Ordering::Acquire);
        take_records(&mut writer, &mut ring, &mut record, start.elapsed());
        if must_end {
            writer.flush(start.elapsed());
        } else {
            writer.step(start.elapsed());
        }
        tell(&writer, shared);
        if must_end {
            return;
        }
        std::thread::park_timeout(LOOK_EVERY);
    }
}

/// Takes records out of the ring as long as the writer has room for one of any length.
fn take_records<S: Storage>(
    writer: &mut Writer<S>,
    ring: &mut Consumer<u8>,
    record: &mut Vec<u8>,
    now: Duration,
) {
    while writer.has_room_for(MAX_PAYLOAD) {
        let mut length = [0; LENGTH_BYTES];
        // A record is in the ring whole or not at all.
        if ring.pop_entire_slice(&mut length).is_err() {
            return;
        }
        record.resize(u32::from_le_bytes(length) as usize, 0);
        let popped = ring.pop_entire_slice(record);
        debug_assert!(popped.is_ok(), "a record follows its length");
        let pushed = writer.push(now, record);
        debug_assert!(pushed.is_ok(), "there was room for it");
    }
}

fn tell<S: Storage>(writer: &Writer<S>, shared: &Shared) {
    shared.durable.store(writer.durable(), Ordering::Release);
    let state = writer.state();
    let has_failed = matches!(state, State::Failed(_));
    shared.has_failed.store(has_failed, Ordering::Release);
    *shared.state.lock().unwrap_or_else(PoisonError::into_inner) = state;
}
