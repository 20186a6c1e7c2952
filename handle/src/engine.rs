//! Device and handle side, stepped by one 1 kHz thread: the machine that [`teleclay_shell::realtime`] runs.
//!
//! ```text
//! device ─sample─> handle side ─command─> device
//!            frames ^        v frame, record
//! ```
//!
//! The machine owns the device for as long as the program runs, with a server or without: a lost server leaves the
//! handle side with its watchdog. Another lease of the same session comes as a [`Renewal`] of the attachment, any other
//! as a new [`Attachment`]. It takes orders, and frames from the attachment's ring; it never allocates, locks, or calls
//! Zenoh.

use std::sync::Arc;

use teleclay_bilateral::{HandleSide, HandleStep, LinkState, Retired};
use teleclay_device::{Brake, DeviceProfile, DeviceSample, Guard};
use teleclay_link::arrivals::ArrivalCounts;
use teleclay_link::replica::ToolSetup;
use teleclay_link::safety::Implausible;
use teleclay_link::scheme::HandleController;
use teleclay_link::scheme::replica::Snapshot;
use teleclay_link::time::Timestamp;
use teleclay_operator::RobotState;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{CopyState, Corrections};
use teleclay_shell::realtime::{Capacities, Machine, Out, Timing};

use crate::attachment::{Attachment, Heard, Renewal};
use crate::device::{Device, DeviceCommand, DeviceError, DeviceRequest};
use crate::refresh::Wanted;

/// Lengths of the thread's rings. Four seconds of ticks may wait to be read.
pub(crate) const CAPACITIES: Capacities = Capacities {
    orders: 8,
    done: 16,
    records: 4096,
};
/// A handle that follows slowly never stands quite where it was sent, and a loop that takes over starts from where it
/// stands. What lies between fades with this time constant, s: 0.1 mm then moves the handle at 1 mm/s.
const SETTLE_TAU_S: f64 = 0.1;

/// What the tick is told to do.
pub(crate) enum Order {
    /// Goes on under another lease, once the handle is at rest.
    Attach(Box<Attachment>),
    /// Goes on under another lease of the same session at once, with the same handle side.
    Renew(Box<Renewal>),
    /// Other parameters from now on, under this lease: tool, place or clay, and which frames are left out.
    Move {
        lease: u32,
        setup: Arc<ToolSetup>,
        deadband: f64,
    },
    /// The server's clay, under this lease.
    LoadSnapshot { lease: u32, snapshot: Snapshot },
    /// A controller for the day when the session changes to this scheme, under this lease.
    Provide {
        lease: u32,
        scheme: Scheme,
        controller: Box<dyn HandleController>,
    },
    /// The server of this lease has gone.
    Release { lease: u32 },
    /// Says goodbye and brings the handle to rest.
    Leave,
}

/// What the tick is done with; to be dropped where that costs no tick.
pub(crate) enum Done {
    /// An order that left nothing behind.
    Order,
    Controller {
        _controller: Box<dyn HandleController>,
    },
    Attachment {
        _attachment: Box<Attachment>,
    },
    /// What a renewal exchanged, or one that no attachment was for.
    Renewal {
        _renewal: Box<Renewal>,
    },
    ToolSetup {
        _setup: Arc<ToolSetup>,
    },
    Snapshot {
        _snapshot: Snapshot,
    },
    Retired {
        _retired: Retired,
    },
}

/// Who moves the handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    /// The loop.
    Coupled,
    /// The brake, on its way to rest.
    Braking,
    /// Nobody: the handle is at rest and stays there.
    Resting,
}

/// One tick, for whoever counts and watches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Record {
    /// On the handle's clock.
    pub(crate) at_ns: u64,
    pub(crate) lateness_ns: u64,
    pub(crate) given_up: u64,
    pub(crate) work_ns: u64,
    pub(crate) lease: u32,
    pub(crate) mode: Mode,
    pub(crate) link_state: LinkState,
    /// Whether a frame has come under this lease.
    pub(crate) is_heard: bool,
    /// Ownership epoch of the session, as last heard, or as granted.
    pub(crate) ownership_epoch: u32,
    pub(crate) silence_ns: u64,
    /// Since the tool side last showed that it had heard something new.
    pub(crate) echo_age_ns: u64,
    pub(crate) heard: Heard,
    pub(crate) sample: DeviceSample,
    pub(crate) felt_force_n: [f64; 3],
    pub(crate) arrivals: ArrivalCounts,
    pub(crate) lost_on_the_way_out: u64,
    pub(crate) scheme: Scheme,
    /// What the copy of the clay is good for, where there is one.
    pub(crate) copy: CopyState,
    /// The block of clay that the handle side has seen, or that its copy is of.
    pub(crate) clay_epoch: u32,
    /// What corrections of it have done to the hand.
    pub(crate) corrections: Corrections,
    pub(crate) wanted: Wanted,
    pub(crate) fault: Option<Implausible>,
    pub(crate) request: Option<DeviceRequest>,
    pub(crate) robot: Option<RobotState>,
}

/// The state of the thread.
pub(crate) struct Engine {
    tick_s: f64,
    device: Box<dyn Device>,
    guard: Guard,
    attachment: Box<Attachment>,
    next: Option<Box<Attachment>>,
    brake: Option<Brake>,
    is_leaving: bool,
    /// The last command and how far it was from the one before, m.
    last_command: Option<([f64; 3], [f64; 3])>,
    /// What is added to the loop's commands, m; `None` until the loop's first.
    offset_m: Option<[f64; 3]>,
    request: Option<DeviceRequest>,
    /// Of the present tick.
    record: Option<Record>,
}

impl Engine {
    /// A device at rest, what it may do to the hand, and the first attachment, taken at `now`.
    pub(crate) fn new(
        now: Timestamp,
        tick_s: f64,
        device: Box<dyn Device>,
        profile: DeviceProfile,
        mut attachment: Box<Attachment>,
    ) -> Self {
        attachment.take(now);
        Self {
            tick_s,
            device,
            // What one command changes is never more than a millisecond is good for.
            guard: Guard::new(profile, tick_s.min(1e-3)),
            attachment,
            next: None,
            brake: None,
            is_leaving: false,
            last_command: None,
            offset_m: None,
            request: None,
            record: None,
        }
    }

    fn start_brake(&mut self) {
        if self.brake.is_none() {
            self.device.let_go();
            let (position_m, step_m) = self.last_command.unwrap_or_default();
            self.brake = Some(Brake::new(
                position_m,
                step_m,
                self.tick_s,
                self.attachment.ramp_s,
            ));
        }
    }

    /// The loop's command, from where the last one ended.
    fn settle(&mut self, loop_m: [f64; 3]) -> [f64; 3] {
        let last_m = self.last_command.map_or(loop_m, |(last_m, _)| last_m);
        let offset_m = self.offset_m.get_or_insert_with(|| minus(last_m, loop_m));
        let keep = (-self.tick_s / SETTLE_TAU_S).exp();
        *offset_m = offset_m.map(|offset| offset * keep);
        std::array::from_fn(|axis| loop_m[axis] + offset_m[axis])
    }

    /// Tells the device what the guard lets pass, and gives it.
    fn command(
        &mut self,
        wanted: DeviceCommand,
        sample: &DeviceSample,
    ) -> Result<DeviceCommand, DeviceError> {
        let command = self.guard.step(wanted, sample.position_m);
        let before = self
            .last_command
            .map_or(command.position_m, |(position_m, _)| position_m);
        self.last_command = Some((command.position_m, minus(command.position_m, before)));
        self.device.command(&command)?;
        Ok(command)
    }

    /// Takes the next attachment, if one waits: the handle is at rest, and the new loop starts from where it stands.
    fn change_attachments(&mut self, now: Timestamp, out: &mut Out<Self>) {
        if self.is_leaving || self.attachment.side.fault().is_some() || out.room_to_retire() == 0 {
            return;
        }
        let Some(mut attachment) = self.next.take() else {
            return;
        };
        attachment.take(now);
        // A button that was pressed while the handle came to rest was pressed for the loop that is over.
        self.device.let_go();
        let left = std::mem::replace(&mut self.attachment, attachment);
        out.retire(Done::Attachment { _attachment: left });
        self.brake = None;
        self.offset_m = None;
    }

    /// Another lease for the attachment that is the last to have come. In a fault none counts any more.
    fn renew(&mut self, now: Timestamp, mut renewal: Box<Renewal>) -> Done {
        let attachment = self.next.as_mut().unwrap_or(&mut self.attachment);
        if attachment.lease() == renewal.of && attachment.side.fault().is_none() {
            attachment.renew(now, &mut renewal.ends);
            self.device.let_go();
        }
        Done::Renewal { _renewal: renewal }
    }

    /// The side of this lease, if it is the present one.
    fn side_of(&mut self, lease: u32) -> Option<&mut HandleSide> {
        (lease == self.attachment.lease()).then_some(&mut self.attachment.side)
    }

    fn record(&self, now: Timestamp, mode: Mode, heard: Heard, step: &HandleStep) -> Record {
        let side = &self.attachment.side;
        Record {
            at_ns: now.as_nanos(),
            lateness_ns: 0,
            given_up: 0,
            work_ns: 0,
            lease: self.attachment.lease(),
            mode,
            link_state: step.link_state,
            is_heard: self.attachment.is_heard(),
            ownership_epoch: side.frame().header.ownership_epoch,
            silence_ns: self.attachment.silence_ns(now),
            echo_age_ns: self.attachment.echo_age_ns(now),
            heard,
            sample: DeviceSample::default(),
            felt_force_n: step.felt_force_n,
            arrivals: side.arrivals(),
            lost_on_the_way_out: self.attachment.lost_on_the_way_out(),
            scheme: side.scheme(),
            copy: side.frame().copy,
            clay_epoch: side.frame().header.clay_epoch,
            corrections: side.frame().corrections,
            wanted: Wanted {
                revision: side.revision(),
                snapshot: side.wanted_snapshot(),
                controller: side.wanted_controller(),
            },
            fault: side.fault(),
            request: self.request,
            robot: self.device.robot(),
        }
    }
}

impl Machine for Engine {
    type Order = Order;
    type Done = Done;
    type Record = Record;
    type Failure = DeviceError;

    fn carry_out(&mut self, now: Timestamp, order: Order) -> Done {
        match order {
            Order::Leave => {
                self.is_leaving = true;
                self.attachment.side.leave();
                Done::Order
            }
            Order::Attach(attachment) => match self.next.replace(attachment) {
                Some(overtaken) => Done::Attachment {
                    _attachment: overtaken,
                },
                None => Done::Order,
            },
            Order::Renew(renewal) => self.renew(now, renewal),
            Order::Move {
                lease,
                setup,
                deadband,
            } => {
                let before = match self.side_of(lease) {
                    Some(side) => {
                        let set = side.set_deadband(deadband);
                        debug_assert!(set.is_ok(), "parameters are checked where they come in");
                        side.move_to(setup)
                    }
                    None => setup,
                };
                Done::ToolSetup { _setup: before }
            }
            Order::LoadSnapshot { lease, snapshot } => {
                let unused = match self.side_of(lease) {
                    Some(side) => side.handle_snapshot(snapshot),
                    None => Some(snapshot),
                };
                unused.map_or(Done::Order, |snapshot| Done::Snapshot {
                    _snapshot: snapshot,
                })
            }
            Order::Provide {
                lease,
                scheme,
                controller,
            } => {
                let before = match self.side_of(lease) {
                    Some(side) => side.provide(scheme, controller),
                    None => Some(controller),
                };
                before.map_or(Done::Order, |controller| Done::Controller {
                    _controller: controller,
                })
            }
            Order::Release { lease } => {
                if let Some(side) = self.side_of(lease) {
                    side.handle_peer_gone(now);
                    self.device.let_go();
                }
                Done::Order
            }
        }
    }

    fn tick(&mut self, now: Timestamp, out: &mut Out<Self>) -> Result<(), DeviceError> {
        let sample = self.device.sample()?;
        let heard = self.attachment.listen();
        let step = self.attachment.step(now, &sample);
        if self.is_leaving || self.next.is_some() || self.attachment.side.fault().is_some() {
            self.start_brake();
        }
        let mut mode = Mode::Coupled;
        let mut command = DeviceCommand {
            position_m: self.settle(step.command_m),
            force_n: step.felt_force_n,
        };
        if let Some(brake) = &mut self.brake {
            mode = if brake.is_done(&sample) {
                Mode::Resting
            } else {
                Mode::Braking
            };
            command = brake.step(step.felt_force_n);
        }
        // A handle that is in fault before its first command is left alone.
        if mode == Mode::Coupled || self.last_command.is_some() {
            command = self.command(command, &sample)?;
        }
        // The lease of an attachment that is about to be given up is over.
        if self.next.is_none() {
            self.attachment.send();
        }
        self.request = self.request.or_else(|| self.device.poll_request());
        self.record = Some(Record {
            sample,
            felt_force_n: command.force_n,
            ..self.record(now, mode, heard, &step)
        });
        if mode == Mode::Resting {
            self.change_attachments(now, out);
        }
        while 0 < out.room_to_retire()
            && let Some(retired) = self.attachment.side.poll_retired()
        {
            out.retire(Done::Retired { _retired: retired });
        }
        Ok(())
    }

    fn after_tick(&mut self, timing: Timing, out: &mut Out<Self>) {
        let Some(record) = self.record.take() else {
            return;
        };
        let told = out.record(Record {
            lateness_ns: timing.lateness_ns,
            given_up: timing.given_up,
            work_ns: timing.work_ns,
            ..record
        });
        // A request is told until somebody has room to hear it.
        if told.is_ok() {
            self.request = None;
        }
    }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

/// A tick like any other.
#[cfg(test)]
pub(crate) fn sample_record() -> Record {
    Record {
        at_ns: 1,
        lateness_ns: 0,
        given_up: 0,
        work_ns: 4_000,
        lease: 1,
        mode: Mode::Coupled,
        link_state: LinkState::Live,
        is_heard: true,
        ownership_epoch: 1,
        silence_ns: 0,
        echo_age_ns: 0,
        heard: Heard::default(),
        sample: DeviceSample::default(),
        felt_force_n: [0.0; 3],
        arrivals: ArrivalCounts::default(),
        lost_on_the_way_out: 0,
        scheme: Scheme::ForceExchange,
        copy: CopyState::None,
        clay_epoch: 1,
        corrections: Corrections::default(),
        wanted: Wanted {
            revision: 0,
            snapshot: None,
            controller: None,
        },
        fault: None,
        request: None,
        robot: None,
    }
}

#[cfg(test)]
mod tests;
