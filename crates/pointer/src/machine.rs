//! The machine.

use teleclay_bilateral::{HandleSide, HandleStep, Known, Lease, LinkState, ReceivedClay};
use teleclay_device::{Brake, DeviceCommand, Guard};
use teleclay_impedance::{GraspState, ImpedanceHandle, Scale, SetupError};
use teleclay_link::scheme::ClayCopy;
use teleclay_link::time::Timestamp;
use teleclay_proto::FrameError;
use teleclay_proto::frame::{MAX_FRAME, ToolFrame};
use teleclay_proto::join::{Granted, LoopParameters};
use teleclay_seal::{Channel, Keys, Purpose};
use teleclay_wire::{FramesKind, FramesView, FramesWriter};

use crate::deadlines::Deadlines;
use crate::grant::{Grant, PointerSetup, Refused};
use crate::inbox::Inbox;
use crate::view::{Counts, Mode, View, Wanted};

/// Frames that may wait for their tick: a quarter of a second, more than a line that was stuck delivers before it
/// counts as silent.
const FRAMES_WAITING: usize = 256;
/// Samples that may wait for theirs: half a second of the fastest page.
const SAMPLES_WAITING: usize = 64;
/// Older than this a frame is not sent, ns: a fifth of the silence after which the tool stops anyway. Every frame
/// repeats what has not been acknowledged.
const STALE_NS: u64 = 20_000_000;
/// After a gap as long as this, ns, nobody knows whether the hand still holds: it has to take hold anew.
const GAP_NS: u64 = 500_000_000;
/// Without frames for this long a lease counts as lost, s. Shorter gaps mend themselves.
const LOST_AFTER_S: f64 = 1.0;
/// A copy of the clay goes on without frames, and what was cut since waits for the line: the old lease is hoped for
/// until shortly before the server gives it up, which is after 10 s.
const LOST_ON_COPY_AFTER_S: f64 = 8.0;

/// What a call of [`Pointer::advance`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Advanced {
    /// Ticks that it made.
    pub ticks: u32,
    /// Ticks that it gave up.
    pub given_up: u64,
}

/// The handle side of one tool's loop, held by a pointer.
///
/// Its methods are of four kinds, and are meant to be called in this order, wake by wake:
///
/// 1. `handle_*` takes in what came, with its time: [`handle_sample`](Self::handle_sample),
///    [`handle_frames`](Self::handle_frames), and now and then [`handle_parameters`](Self::handle_parameters),
///    [`handle_peer_gone`](Self::handle_peer_gone), a snapshot, or another lease by [`renew`](Self::renew). So do the
///    hand's own wishes, [`hold`](Self::hold) and what stands beside it.
/// 2. [`advance`](Self::advance) makes the ticks that are owed.
/// 3. [`outgoing`](Self::outgoing) is what they send; [`tidy`](Self::tidy) then does what no tick has time for.
/// 4. Everything else is a getter: [`view`](Self::view), [`wanted`](Self::wanted), [`counts`](Self::counts).
///
/// What came is given to the first tick whose deadline is not before it, so that it makes no difference how often
/// somebody wakes. None of these allocates but for snapshots, parameters, [`renew`](Self::renew), [`tidy`](Self::tidy)
/// after a change of scheme, and [`new`](Self::new).
pub struct Pointer {
    pub(crate) setup: PointerSetup,
    /// As last granted.
    pub(crate) granted: Granted,
    /// What the loop works with.
    pub(crate) parameters: LoopParameters,
    pub(crate) known: Known,
    pub(crate) side: HandleSide,
    pub(crate) channel: Channel,
    handle: ImpedanceHandle,
    stiffness_n_per_m: f64,
    guard: Guard,
    /// Of what the device renders: the last thing before it.
    device_guard: Guard,
    brake: Option<Brake>,
    is_leaving: bool,
    last_command: Option<([f64; 3], [f64; 3])>,
    deadlines: Deadlines,
    samples: Inbox<(u64, [f64; 3])>,
    pub(crate) frames: Inbox<ToolFrame>,
    outgoing: FramesWriter,
    pub(crate) received: Option<ReceivedClay>,
    pub(crate) is_heard: bool,
    pub(crate) is_gone: bool,
    pub(crate) heard_at: Timestamp,
    heard_tool_m: [f64; 3],
    counts: Counts,
    last: View,
}

impl Pointer {
    /// A handle at home, at rest, released, under what was granted; `keys` are those of the lease. Its first tick is
    /// due a tick after `now_ns`.
    ///
    /// # Errors
    /// What came is no grant, or makes no loop that this pointer can hold.
    pub fn new(
        now_ns: u64,
        setup: PointerSetup,
        granted: &[u8],
        keys: &Keys,
    ) -> Result<Self, Refused> {
        let grant = Grant::parse(granted, setup.profile)?;
        let granted = grant.granted().clone();
        let parameters = granted.parameters;
        let lease = Lease {
            number: granted.lease,
            ownership_epoch: granted.ownership_epoch,
        };
        let side = HandleSide::new(&parameters, lease)?;
        let coupling = setup.coupling(&parameters)?;
        let handle = ImpedanceHandle::new(coupling)?;
        let tick_s = parameters.tick_s;
        // What one command changes is never more than a millisecond is good for.
        let guard = Guard::new(setup.profile, tick_s.min(1e-3));
        Ok(Self {
            known: Known::of(&granted),
            last: View {
                at_ns: now_ns,
                mode: Mode::Coupled,
                link_state: LinkState::NotYet,
                grasp: GraspState::Released,
                scheme: side.scheme(),
                copy: side.frame().copy,
                hand_m: [0.0; 3],
                handle_m: [0.0; 3],
                tool_m: parameters.home_m,
                felt_force_n: [0.0; 3],
                hand_force_n: [0.0; 3],
                device_force_n: [0.0; 3],
                clay_hash: None,
                clay_epoch: granted.clay.epoch,
                round_trip_s: None,
                silence_s: 0.0,
                corrections: side.frame().corrections,
                is_in_fault: false,
            },
            setup,
            granted,
            parameters,
            side,
            channel: Channel::of_handle(keys),
            handle,
            stiffness_n_per_m: coupling.stiffness_n_per_m,
            guard,
            device_guard: guard,
            brake: None,
            is_leaving: false,
            last_command: None,
            deadlines: Deadlines::new(now_ns, (tick_s * 1e9).round() as u64),
            samples: Inbox::new(SAMPLES_WAITING),
            frames: Inbox::new(FRAMES_WAITING),
            outgoing: FramesWriter::new(FramesKind::Handle),
            received: None,
            is_heard: false,
            is_gone: false,
            heard_at: Timestamp::from_nanos(now_ns),
            heard_tool_m: parameters.home_m,
            counts: Counts::default(),
        })
    }

    /// The pointer was at `position_m`, m, at `at_ns`, which is told at `now_ns`. While it rests somebody has to tell
    /// so again and again: a pointer that is not heard of is let go of.
    pub fn handle_sample(&mut self, now_ns: u64, at_ns: u64, position_m: [f64; 3]) {
        let had_room = self.samples.push(now_ns, (at_ns, position_m));
        self.counts.overflowed += u64::from(!had_room);
    }

    /// A message of frames came from the server. Of its frames those count that the server wrote under this lease, each
    /// once.
    ///
    /// # Errors
    /// It is no such message.
    pub fn handle_frames(&mut self, now_ns: u64, message: &[u8]) -> Result<(), FrameError> {
        let view = FramesView::decode(message).and_then(|view| match view.kind {
            FramesKind::Tool => Ok(view),
            FramesKind::Handle => Err(FrameError::WrongKind {
                got: FramesKind::Handle as u8,
                want: FramesKind::Tool as u8,
            }),
        });
        self.counts.undecodable += u64::from(view.is_err());
        for sealed in view?.iter() {
            let count = match self.channel.open(Purpose::Frame, sealed) {
                Err(_) => &mut self.counts.unheard,
                Ok(frame) => match ToolFrame::decode(frame) {
                    Err(_) => &mut self.counts.undecodable,
                    Ok(frame) if frame.header.lease != self.granted.lease => {
                        &mut self.counts.foreign
                    }
                    Ok(frame) if self.frames.push(now_ns, frame) => continue,
                    Ok(_) => &mut self.counts.overflowed,
                },
            };
            *count += 1;
        }
        Ok(())
    }

    /// The server is known to have gone, or has ended the lease: the force ramps to zero whatever the scheme.
    pub fn handle_peer_gone(&mut self, now_ns: u64) {
        self.is_gone = true;
        self.side.handle_peer_gone(Timestamp::from_nanos(now_ns));
    }

    /// The hand takes hold of the handle where it is.
    pub fn hold(&mut self) {
        if self.brake.is_none() && !self.is_leaving {
            self.handle.coupling().hold();
        }
    }

    /// The hand lets go.
    pub fn release(&mut self) {
        self.handle.coupling().release();
    }

    /// The hand moves without the handle until it takes hold again.
    pub fn clutch(&mut self) {
        self.handle.coupling().clutch();
    }

    /// Holds the handle fast along these axes from the next grip on.
    pub fn lock_axes(&mut self, locked: [bool; 3]) {
        self.handle.coupling().lock_axes(locked);
    }

    /// The handle moves so much for the pointer's motion.
    ///
    /// # Errors
    /// No coupling keeps its promises behind this; nothing changes.
    pub fn set_motion(&mut self, motion: f64) -> Result<(), SetupError> {
        let coupling = self.handle.coupling();
        coupling.set_scale(Scale {
            motion,
            ..coupling.scale()
        })
    }

    /// Says goodbye in every further frame, lets go and brings the handle to rest; [`View::mode`] tells when it is.
    pub fn leave(&mut self) {
        self.is_leaving = true;
        self.side.leave();
        self.release();
    }

    /// Makes the ticks that are owed at `now_ns`, [`MOST_AT_ONCE`](crate::MOST_AT_ONCE) at most. What they send
    /// replaces what the last call sent.
    pub fn advance(&mut self, now_ns: u64) -> Advanced {
        self.outgoing.restart();
        let owed = self.deadlines.take(now_ns);
        let tick_ns = self.deadlines.tick_ns();
        if GAP_NS <= owed.given_up.saturating_mul(tick_ns) {
            // Whatever the scheme, nothing is felt after a gap until frames have come anew.
            self.counts.gaps += 1;
            self.side
                .handle_peer_gone(Timestamp::from_nanos(owed.first_ns));
            self.release();
        }
        for number in 0..u64::from(owed.ticks) {
            self.tick(owed.first_ns + number * tick_ns, now_ns);
        }
        self.counts.ticks += u64::from(owed.ticks);
        self.counts.given_up = self.counts.given_up.saturating_add(owed.given_up);
        Advanced {
            ticks: owed.ticks,
            given_up: owed.given_up,
        }
    }

    /// The message that the ticks of the last [`advance`](Self::advance) send, if they send one.
    #[must_use]
    pub fn outgoing(&self) -> Option<&[u8]> {
        self.outgoing.message()
    }

    /// Drops what the loop is done with, and makes what it lacks should the scheme change again.
    pub fn tidy(&mut self) {
        while self.side.poll_retired().is_some() {}
        self.side.restock();
    }

    /// Spring by which the hand draws the handle, N/m.
    #[must_use]
    pub fn stiffness_n_per_m(&self) -> f64 {
        self.stiffness_n_per_m
    }

    /// The state of the last tick.
    #[must_use]
    pub fn view(&self) -> &View {
        &self.last
    }

    /// What was counted.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// What the server is to be asked for.
    #[must_use]
    pub fn wanted(&self) -> Wanted {
        let is_on_copy = matches!(
            self.last.link_state,
            LinkState::OnCopy | LinkState::OnStaleCopy
        );
        let lost_after_s = if is_on_copy {
            LOST_ON_COPY_AFTER_S
        } else {
            LOST_AFTER_S
        };
        let is_over = self.is_leaving || self.side.fault().is_some();
        Wanted {
            parameters: self.side.revision() != self.parameters.revision,
            snapshot: self.side.wanted_snapshot(),
            lease: !is_over && (self.is_gone || lost_after_s < self.last.silence_s),
        }
    }

    /// When the next tick is due, ns.
    #[must_use]
    pub fn next_ns(&self) -> u64 {
        self.deadlines.next_ns()
    }

    /// The handle side.
    #[must_use]
    pub fn side(&self) -> &HandleSide {
        &self.side
    }

    /// The tick that was due at `due_ns`, made at `now_ns`.
    fn tick(&mut self, due_ns: u64, now_ns: u64) {
        let due = Timestamp::from_nanos(due_ns);
        while let Some((told_ns, (at_ns, position_m))) = self.samples.pop(due_ns) {
            self.handle.coupling().sample(told_ns, at_ns, position_m);
        }
        self.listen(due_ns);
        let sample = self.handle.sample(due_ns);
        let step = self.side.step(due, &sample);
        if self.is_leaving || self.side.fault().is_some() {
            self.start_brake();
        }
        let mut mode = Mode::Coupled;
        let mut wanted = DeviceCommand {
            position_m: step.command_m,
            force_n: step.felt_force_n,
        };
        if let Some(brake) = &mut self.brake {
            mode = if brake.is_done(&sample) {
                Mode::Resting
            } else {
                Mode::Braking
            };
            wanted = brake.step(step.felt_force_n);
        }
        let told = self.guard.step(wanted, sample.position_m);
        self.counts.guarded += u64::from(told != wanted);
        let before_m = self.last_command.map_or(told.position_m, |(at_m, _)| at_m);
        let step_m = std::array::from_fn(|axis| told.position_m[axis] - before_m[axis]);
        self.last_command = Some((told.position_m, step_m));
        let rendered = DeviceCommand {
            position_m: [0.0; 3],
            force_n: self.handle.command(&told),
        };
        let rendered = self.device_guard.step(rendered, [0.0; 3]);
        self.send(due_ns, now_ns);
        self.look(due, mode, &step, &told, &rendered);
    }

    fn listen(&mut self, due_ns: u64) {
        while let Some((at_ns, frame)) = self.frames.pop(due_ns) {
            let at = Timestamp::from_nanos(at_ns);
            self.is_heard = true;
            self.heard_at = self.heard_at.max(at);
            self.side.handle_frame(at, &frame);
            if frame.position_m.iter().all(|part| part.is_finite()) {
                self.heard_tool_m = frame.position_m;
            }
        }
    }

    fn start_brake(&mut self) {
        if self.brake.is_some() {
            return;
        }
        self.handle.coupling().release();
        let (position_m, step_m) = self
            .last_command
            .unwrap_or((self.handle.place().position_m, [0.0; 3]));
        let LoopParameters { tick_s, ramp_s, .. } = self.parameters;
        self.brake = Some(Brake::new(position_m, step_m, tick_s, ramp_s));
    }

    fn send(&mut self, due_ns: u64, now_ns: u64) {
        let Some(frame) = self.side.frame_to_send() else {
            return;
        };
        if STALE_NS < now_ns.saturating_sub(due_ns) {
            self.counts.stale += 1;
            return;
        }
        let mut buffer = [0; MAX_FRAME];
        let bytes = frame.encode(&mut buffer);
        let trailer = self.channel.trailer(Purpose::Frame, bytes);
        let has_room = self.outgoing.push([bytes, &trailer[..]]).is_ok();
        let count = if has_room {
            &mut self.counts.sent
        } else {
            &mut self.counts.overflowed
        };
        *count += 1;
    }

    fn look(
        &mut self,
        due: Timestamp,
        mode: Mode,
        step: &HandleStep,
        told: &DeviceCommand,
        rendered: &DeviceCommand,
    ) {
        if self.is_heard {
            self.known = Known {
                ownership_epoch: self.side.frame().header.ownership_epoch,
                revision: self.side.revision(),
            };
        }
        let coupling = self.handle.last();
        let place = self.handle.place();
        let copy = self.side.clay_copy().and_then(ClayCopy::copy);
        let frame = self.side.frame();
        // What was heard under the lease before says nothing of this one.
        let link_state = if self.is_heard {
            step.link_state
        } else if self.side.fault().is_some() {
            LinkState::Fault
        } else {
            LinkState::NotYet
        };
        self.is_gone &= link_state != LinkState::Live;
        self.last = View {
            at_ns: due.as_nanos(),
            mode,
            link_state,
            grasp: coupling.map_or(GraspState::Released, |step| step.state),
            scheme: self.side.scheme(),
            copy: frame.copy,
            hand_m: coupling.map_or(place.position_m, |step| step.target_m),
            handle_m: place.position_m,
            tool_m: copy.map_or(self.heard_tool_m, |copy| copy.pose().position_m()),
            felt_force_n: told.force_n,
            hand_force_n: coupling.map_or([0.0; 3], |step| step.hand_force_n),
            device_force_n: rendered.force_n,
            clay_hash: copy.and_then(|copy| copy.hash()),
            clay_epoch: copy.map_or(frame.header.clay_epoch, |copy| copy.epoch()),
            round_trip_s: self.side.round_trip().last().map(|span| span.as_secs_f64()),
            silence_s: due.since(self.heard_at).as_secs_f64(),
            corrections: frame.corrections,
            is_in_fault: self.side.fault().is_some(),
        };
    }
}
