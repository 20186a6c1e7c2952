//! The way of a frame from the tick to the network: a ring, and a thread that empties it.
//!
//! Handing a frame to the network may block for longer than a tick, so the tick only pushes and wakes the sender. A
//! frame that waited too long is thrown away: the hand has moved on, and every frame repeats what has not been
//! acknowledged.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_proto::frame::{HandleFrame, MAX_FRAME};
use teleclay_shell::Clock;
use teleclay_shell::beside::{Beside, Waking};

/// Frames that may wait: more than the ticks that are made up for after a suspension, so that none of those is lost
/// here.
const WAITING: usize = 64;
const _: () = assert!((teleclay_shell::ticker::MOST_BEHIND as usize) < WAITING);

/// Older than this a frame is not sent, ns: a fifth of the silence after which the tool stops anyway.
const STALE_NS: u64 = Duration::from_millis(20).as_nanos() as u64;

/// What became of the frames.
#[derive(Debug, Default)]
pub(crate) struct Counts {
    sent: AtomicU64,
    stale: AtomicU64,
    failed: AtomicU64,
}

impl Counts {
    /// Frames that went out.
    pub(crate) fn sent(&self) -> u64 {
        self.sent.load(Ordering::Relaxed)
    }

    /// Frames that were too old, or that the network did not take.
    pub(crate) fn unsent(&self) -> u64 {
        self.stale.load(Ordering::Relaxed) + self.failed.load(Ordering::Relaxed)
    }
}

/// The tick's end.
pub(crate) struct Outbox {
    frames: Producer<HandleFrame>,
    sender: Waking,
}

impl Outbox {
    /// Hands a frame over. Neither blocks nor allocates.
    ///
    /// # Errors
    /// The sender is stuck and the ring is full: the frame is lost.
    pub(crate) fn push(&mut self, frame: &HandleFrame) -> Result<(), Full> {
        let pushed = self.frames.push(frame.clone());
        self.sender.wake();
        pushed.map_err(|_| Full)
    }
}

/// The ring is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Full;

/// The sending thread. Dropping it stops and joins it.
#[derive(Debug)]
pub(crate) struct Sender {
    thread: Option<JoinHandle<()>>,
    stop: Arc<AtomicBool>,
    counts: Arc<Counts>,
}

impl Sender {
    /// Starts the thread. `put` hands the bytes of a frame to the network and says whether it took them.
    ///
    /// # Errors
    /// The system cannot make a thread.
    pub(crate) fn spawn(
        clock: Clock,
        put: impl FnMut(&[u8]) -> bool + Send + 'static,
    ) -> io::Result<(Outbox, Self)> {
        let (frames, waiting) = RingBuffer::new(WAITING);
        let stop = Arc::new(AtomicBool::new(false));
        let counts = Arc::new(Counts::default());
        let beside = Beside::new();
        let place = beside.place();
        let thread = {
            let (stop, counts) = (Arc::clone(&stop), Arc::clone(&counts));
            std::thread::Builder::new()
                .name("handle-send".to_owned())
                .spawn(move || send(clock, waiting, beside, &stop, &counts, put))?
        };
        let outbox = Outbox {
            frames,
            sender: place.waking(thread.thread()),
        };
        Ok((
            outbox,
            Self {
                thread: Some(thread),
                stop,
                counts,
            },
        ))
    }

    /// What became of the frames so far.
    pub(crate) fn counts(&self) -> &Counts {
        &self.counts
    }
}

impl Drop for Sender {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // A panic in the thread was printed by it; there is nothing to add here.
            let _ = thread.join();
        }
    }
}

fn send(
    clock: Clock,
    mut waiting: Consumer<HandleFrame>,
    mut beside: Beside,
    stop: &AtomicBool,
    counts: &Counts,
    mut put: impl FnMut(&[u8]) -> bool,
) {
    let mut buffer = [0; MAX_FRAME];
    while !stop.load(Ordering::Acquire) {
        let Ok(frame) = waiting.pop() else {
            // A push between the look above and this line has left its token, so this returns at once.
            std::thread::park();
            beside.follow();
            continue;
        };
        let age_ns = clock.now_ns().saturating_sub(frame.header.sent_ns);
        let count = if STALE_NS < age_ns {
            &counts.stale
        } else if put(frame.encode(&mut buffer)) {
            &counts.sent
        } else {
            &counts.failed
        };
        count.fetch_add(1, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    /// A frame that gets old when the clock reaches `sent_ns` and 20 ms.
    fn frame(sequence: u32, sent_ns: u64) -> HandleFrame {
        let mut frame = HandleFrame::default();
        frame.header.sequence = sequence;
        frame.header.sent_ns = sent_ns;
        frame
    }

    const NEVER: u64 = u64::MAX;

    fn sequence(bytes: &[u8]) -> u32 {
        HandleFrame::decode(bytes).unwrap().header.sequence
    }

    #[test]
    fn frames_go_out_in_order_and_dropping_the_sender_ends_it() {
        let clock = Clock::start();
        let (sent, received) = mpsc::channel();
        let (mut outbox, sender) =
            Sender::spawn(clock, move |bytes| sent.send(sequence(bytes)).is_ok()).unwrap();
        for number in 0..50 {
            outbox.push(&frame(number, NEVER)).unwrap();
            assert_eq!(received.recv_timeout(Duration::from_secs(10)), Ok(number));
        }
        drop(sender);
        assert!(
            received.recv().is_err(),
            "the thread has ended and dropped its end"
        );
    }

    /// The network blocks on the first frame until the ring has overflowed; what waited meanwhile is too old, what
    /// comes then is not.
    #[test]
    fn a_network_that_blocks_costs_old_frames_and_never_the_tick() {
        let clock = Clock::start();
        let (sent, received) = mpsc::channel();
        let (open, gate) = mpsc::channel::<()>();
        let mut is_first = true;
        let (mut outbox, sender) = Sender::spawn(clock, move |bytes| {
            sent.send(sequence(bytes)).unwrap();
            if std::mem::take(&mut is_first) {
                gate.recv().unwrap();
            }
            true
        })
        .unwrap();
        outbox.push(&frame(0, NEVER)).unwrap();
        assert_eq!(received.recv_timeout(Duration::from_secs(10)), Ok(0));
        let old = frame(1, 1);
        let began_ns = clock.now_ns();
        while clock.now_ns() < began_ns + 2 * STALE_NS {
            std::hint::spin_loop();
        }
        let refused = (0..WAITING + 3)
            .filter(|_| outbox.push(&old) == Err(Full))
            .count();
        assert_eq!(refused, 3);
        open.send(()).unwrap();
        let fresh = frame(2, NEVER);
        while outbox.push(&fresh) == Err(Full) {
            std::hint::spin_loop();
        }
        assert_eq!(received.recv_timeout(Duration::from_secs(10)), Ok(2));
        assert_eq!(sender.counts().unsent(), WAITING as u64);
    }
}
