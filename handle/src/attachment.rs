//! One lease as the tick holds it: the handle side of the loop, and the ends of the rings to and from the network.
//!
//! Another lease of the same session takes other ends and the same side ([`Renewal`]): its copy of the clay and its
//! cuts that are not durable stay.

use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_bilateral::{HandleSide, HandleStep, Lease, ParameterError};
use teleclay_device::DeviceSample;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::ToolFrame;
use teleclay_proto::join::{Granted, LoopParameters};

use crate::outbox::Outbox;

/// Frames that may wait for the tick: a quarter of a second, more than a line that was stuck delivers before it counts
/// as silent.
const WAITING: usize = 256;

/// A frame of the tool side and when it came.
pub(crate) struct Arrived {
    pub(crate) at: Timestamp,
    pub(crate) frame: ToolFrame,
}

/// What the frames of one tick told about the line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Heard {
    /// Round trip without the time that the tool side held the stamp, ns.
    pub(crate) rtt_ns: Option<u64>,
    /// From a frame's departure to the arrival of the first reaction to it, the tool side's wait for its tick included,
    /// ns.
    pub(crate) reaction_ns: Option<u64>,
}

/// The tick's ends of a line, and the lease that it is for.
pub(crate) struct LineEnds {
    lease: Lease,
    outbox: Outbox,
    inbox: Consumer<Arrived>,
}

impl LineEnds {
    /// Frames that arrive go into the producer.
    pub(crate) fn new(granted: &Granted, outbox: Outbox) -> (Self, Producer<Arrived>) {
        let (arriving, inbox) = RingBuffer::new(WAITING);
        let lease = Lease {
            number: granted.lease,
            ownership_epoch: granted.ownership_epoch,
        };
        let ends = Self {
            lease,
            outbox,
            inbox,
        };
        (ends, arriving)
    }

    /// Number of the lease.
    pub(crate) fn lease(&self) -> u32 {
        self.lease.number
    }
}

/// Another lease for an attachment; once it is carried out, what the attachment had before, to be dropped elsewhere.
pub(crate) struct Renewal {
    /// The lease that it follows.
    pub(crate) of: u32,
    /// The ends of the line that is exchanged.
    pub(crate) ends: LineEnds,
}

/// One lease.
pub(crate) struct Attachment {
    pub(crate) side: HandleSide,
    pub(crate) ramp_s: f64,
    ends: LineEnds,
    /// Whether a frame has come under this lease.
    is_heard: bool,
    heard_at: Timestamp,
    newest_echo_ns: u64,
    echoed_at: Timestamp,
    lost_on_the_way_out: u64,
}

impl Attachment {
    /// A handle side at rest, under the lease that the line is for.
    ///
    /// # Errors
    /// The parameters make no loop.
    pub(crate) fn new(
        parameters: &LoopParameters,
        ends: LineEnds,
    ) -> Result<Box<Self>, ParameterError> {
        Ok(Box::new(Self {
            side: HandleSide::new(parameters, ends.lease)?,
            ramp_s: parameters.ramp_s,
            ends,
            is_heard: false,
            heard_at: Timestamp::ZERO,
            newest_echo_ns: 0,
            echoed_at: Timestamp::ZERO,
            lost_on_the_way_out: 0,
        }))
    }

    /// Number of the lease.
    pub(crate) fn lease(&self) -> u32 {
        self.ends.lease()
    }

    /// Goes on under the lease of other ends from `now` on, with the same side; leaves its own in their place.
    pub(crate) fn renew(&mut self, now: Timestamp, ends: &mut LineEnds) {
        std::mem::swap(&mut self.ends, ends);
        self.side.renew(self.ends.lease);
        self.is_heard = false;
        self.take(now);
    }

    /// The attachment is taken at `now`: silence counts from here.
    pub(crate) fn take(&mut self, now: Timestamp) {
        self.heard_at = now;
        self.echoed_at = now;
    }

    /// Takes in what arrived.
    pub(crate) fn listen(&mut self) -> Heard {
        let mut heard = Heard::default();
        while let Ok(Arrived { at, frame }) = self.ends.inbox.pop() {
            self.is_heard = true;
            self.heard_at = self.heard_at.max(at);
            self.side.handle_frame(at, &frame);
            let header = &frame.header;
            let Some(reaction_ns) = at.as_nanos().checked_sub(header.echo_ns) else {
                continue;
            };
            // The first frame that echoes a stamp is the reaction to it; later ones echo it until they hear a newer
            // one.
            if self.newest_echo_ns < header.echo_ns {
                self.newest_echo_ns = header.echo_ns;
                self.echoed_at = self.echoed_at.max(at);
                heard.reaction_ns = Some(reaction_ns);
                heard.rtt_ns = reaction_ns.checked_sub(u64::from(header.echo_hold_ns));
            }
        }
        heard
    }

    /// One tick of the loop.
    pub(crate) fn step(&mut self, now: Timestamp, sample: &DeviceSample) -> HandleStep {
        self.side.step(now, sample)
    }

    /// Hands the frame of the last step over to the network, if it is one that goes out.
    pub(crate) fn send(&mut self) {
        if let Some(frame) = self.side.frame_to_send() {
            self.lost_on_the_way_out += u64::from(self.ends.outbox.push(frame).is_err());
        }
    }

    /// Frames that found the way out full.
    pub(crate) fn lost_on_the_way_out(&self) -> u64 {
        self.lost_on_the_way_out
    }

    /// Whether a frame has come under this lease.
    pub(crate) fn is_heard(&self) -> bool {
        self.is_heard
    }

    /// Time without a frame of this lease, ns.
    pub(crate) fn silence_ns(&self, now: Timestamp) -> u64 {
        now.since(self.heard_at).as_nanos() as u64
    }

    /// Time since the tool side last showed that it had heard something new, ns. Frames may come while nothing arrives
    /// there.
    pub(crate) fn echo_age_ns(&self, now: Timestamp) -> u64 {
        now.since(self.echoed_at).as_nanos() as u64
    }
}
