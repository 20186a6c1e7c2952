//! The tick: device and handle side, stepped by one 1 kHz thread.
//!
//! ```text
//! device ─sample─> handle side ─command─> device
//!            frames ^        v frame, record
//! ```
//!
//! The thread owns the device for as long as the program runs, with a server or without: a lost server leaves the
//! handle side with its watchdog, a new lease comes as a new [`Attachment`]. It takes orders and frames from lock-free
//! rings and puts frames, records and attachments it is done with into others; it never allocates, locks, or calls
//! Zenoh.

use std::io;
use std::sync::Arc;

use rtrb::{Consumer, Producer, RingBuffer};
use teleclay_bilateral::{LinkState, Retired};
use teleclay_device::DeviceSample;
use teleclay_link::arrivals::ArrivalCounts;
use teleclay_link::replica::ToolSetup;
use teleclay_link::safety::NotFinite;
use teleclay_link::scheme::replica::Snapshot;
use teleclay_link::time::Timestamp;
use teleclay_operator::RobotState;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{CopyState, Corrections};
use teleclay_shell::Clock;
use teleclay_shell::ticker::{Next, Tick, Ticker, TickerConfig};

use crate::attachment::{Attachment, Heard};
use crate::brake::Brake;
use crate::device::{Device, DeviceCommand, DeviceError, DeviceRequest};
use crate::refresh::Wanted;

/// Records that may wait for whoever reads them: four seconds of ticks.
const RECORDS_WAITING: usize = 4096;
/// A handle that follows slowly never stands quite where it was sent, and a loop that takes over starts from where it stands. What lies
/// between fades with this time constant, s: 0.1 mm then moves the handle at 1 mm/s.
const SETTLE_TAU_S: f64 = 0.1;
/// Orders that may wait.
const ORDERS_WAITING: usize = 8;
/// Things that wait to be dropped.
const DISCARDED_WAITING: usize = 16;

/// What the tick is told to do.
pub(crate) enum Order {
    /// Goes on under another lease, once the handle is at rest.
    Attach(Box<Attachment>),
    /// Other parameters from now on, under this lease: tool, place or clay, and which frames are left out.
    Move {
        lease: u32,
        setup: Arc<ToolSetup>,
        deadband: f64,
    },
    /// The server's clay, under this lease.
    LoadSnapshot { lease: u32, snapshot: Snapshot },
    /// The server of this lease has gone.
    Release { lease: u32 },
    /// Says goodbye and brings the handle to rest.
    Leave,
}

/// What the tick is done with; to be dropped where that costs no tick.
pub(crate) enum Discarded {
    Attachment { _attachment: Box<Attachment> },
    ToolSetup { _setup: Arc<ToolSetup> },
    Snapshot { _snapshot: Snapshot },
    Retired { _retired: Retired },
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
    /// What corrections of it have done to the hand.
    pub(crate) corrections: Corrections,
    pub(crate) wanted: Wanted,
    pub(crate) fault: Option<NotFinite>,
    pub(crate) request: Option<DeviceRequest>,
    pub(crate) robot: Option<RobotState>,
}

/// The ends of the rings that the tick does not hold.
pub(crate) struct Ends {
    pub(crate) orders: Producer<Order>,
    pub(crate) records: Consumer<Record>,
    pub(crate) discarded: Consumer<Discarded>,
    /// Why the thread ended by itself.
    pub(crate) failures: Consumer<DeviceError>,
}

/// The state of the thread.
pub(crate) struct Engine {
    tick_s: f64,
    device: Box<dyn Device>,
    attachment: Box<Attachment>,
    next: Option<Box<Attachment>>,
    brake: Option<Brake>,
    is_leaving: bool,
    /// The last command and how far it was from the one before, m.
    last_command: Option<([f64; 3], [f64; 3])>,
    /// What is added to the loop's commands, m; `None` until the loop's first.
    offset_m: Option<[f64; 3]>,
    request: Option<DeviceRequest>,
    orders: Consumer<Order>,
    records: Producer<Record>,
    discarded: Producer<Discarded>,
    failures: Producer<DeviceError>,
}

impl Engine {
    /// A device at rest and the first attachment, taken at `now`.
    pub(crate) fn new(
        now: Timestamp,
        tick_s: f64,
        device: Box<dyn Device>,
        mut attachment: Box<Attachment>,
    ) -> (Self, Ends) {
        let (orders_in, orders) = RingBuffer::new(ORDERS_WAITING);
        let (records, records_out) = RingBuffer::new(RECORDS_WAITING);
        let (discarded, discarded_out) = RingBuffer::new(DISCARDED_WAITING);
        let (failures, failures_out) = RingBuffer::new(1);
        attachment.take(now);
        let engine = Self {
            tick_s,
            device,
            attachment,
            next: None,
            brake: None,
            is_leaving: false,
            last_command: None,
            offset_m: None,
            request: None,
            orders,
            records,
            discarded,
            failures,
        };
        let ends = Ends {
            orders: orders_in,
            records: records_out,
            discarded: discarded_out,
            failures: failures_out,
        };
        (engine, ends)
    }

    /// Starts the thread.
    ///
    /// # Errors
    /// The system cannot make a thread.
    pub(crate) fn spawn(mut self, clock: Clock, config: TickerConfig) -> io::Result<Ticker> {
        Ticker::spawn(config, move |tick| self.timed_tick(clock, &tick))
    }

    /// A tick, and its record.
    fn timed_tick(&mut self, clock: Clock, tick: &Tick) -> Next {
        let started_ns = clock.now_ns();
        let mut record = match self.tick(Timestamp::from_nanos(started_ns)) {
            Ok(record) => record,
            Err(error) => {
                // The ring holds the one failure that there can be.
                let _ = self.failures.push(error);
                return Next::Stop;
            }
        };
        record.lateness_ns = tick.lateness.as_nanos() as u64;
        record.given_up = tick.given_up;
        record.work_ns = clock.now_ns() - started_ns;
        if self.records.push(record).is_ok() {
            self.request = None;
        }
        Next::Continue
    }

    /// One tick. Times in the record are the caller's to fill in.
    fn tick(&mut self, now: Timestamp) -> Result<Record, DeviceError> {
        self.take_orders(now);
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
            self.command(&command)?;
        }
        // The lease of an attachment that is about to be given up is over.
        if self.next.is_none() {
            self.attachment.send();
        }
        self.request = self.request.or_else(|| self.device.poll_request());
        let record = Record {
            at_ns: now.as_nanos(),
            lateness_ns: 0,
            given_up: 0,
            work_ns: 0,
            lease: self.attachment.lease,
            mode,
            link_state: step.link_state,
            silence_ns: self.attachment.silence_ns(now),
            echo_age_ns: self.attachment.echo_age_ns(now),
            heard,
            sample,
            felt_force_n: command.force_n,
            arrivals: self.attachment.side.arrivals(),
            lost_on_the_way_out: self.attachment.lost_on_the_way_out(),
            scheme: self.attachment.side.scheme(),
            copy: self.attachment.side.frame().copy,
            corrections: self.attachment.side.frame().corrections,
            wanted: Wanted {
                revision: self.attachment.side.revision(),
                snapshot: self.attachment.side.wanted_snapshot(),
            },
            fault: self.attachment.side.fault(),
            request: self.request,
            robot: self.device.robot(),
        };
        if mode == Mode::Resting {
            self.change_attachments(now);
        }
        self.discard_retired();
        Ok(record)
    }

    fn take_orders(&mut self, now: Timestamp) {
        // An order may leave one thing to discard: without room for it the order waits.
        while 0 < self.discarded.slots() {
            let Ok(order) = self.orders.pop() else { return };
            match order {
                Order::Leave => {
                    self.is_leaving = true;
                    self.attachment.side.leave();
                }
                Order::Attach(attachment) => {
                    if let Some(overtaken) = self.next.replace(attachment) {
                        self.discard(Discarded::Attachment {
                            _attachment: overtaken,
                        });
                    }
                }
                Order::Move {
                    lease,
                    setup,
                    deadband,
                } => {
                    let before = if lease == self.attachment.lease {
                        let set = self.attachment.side.set_deadband(deadband);
                        debug_assert!(set.is_ok(), "parameters are checked where they come in");
                        self.attachment.side.move_to(setup)
                    } else {
                        setup
                    };
                    self.discard(Discarded::ToolSetup { _setup: before });
                }
                Order::LoadSnapshot { lease, snapshot } => {
                    let unused = if lease == self.attachment.lease {
                        self.attachment.side.on_snapshot(snapshot)
                    } else {
                        Some(snapshot)
                    };
                    if let Some(snapshot) = unused {
                        self.discard(Discarded::Snapshot {
                            _snapshot: snapshot,
                        });
                    }
                }
                Order::Release { lease } => {
                    if lease == self.attachment.lease {
                        self.attachment.side.on_peer_gone(now);
                    }
                }
            }
        }
    }

    fn start_brake(&mut self) {
        if self.brake.is_none() {
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

    fn command(&mut self, command: &DeviceCommand) -> Result<(), DeviceError> {
        let before = self
            .last_command
            .map_or(command.position_m, |(position_m, _)| position_m);
        self.last_command = Some((command.position_m, minus(command.position_m, before)));
        self.device.command(command)
    }

    /// Takes the next attachment, if one waits: the handle is at rest, and the new loop starts from where it stands.
    fn change_attachments(&mut self, now: Timestamp) {
        if self.is_leaving || self.attachment.side.fault().is_some() || self.discarded.slots() == 0
        {
            return;
        }
        let Some(mut attachment) = self.next.take() else {
            return;
        };
        attachment.take(now);
        let left = std::mem::replace(&mut self.attachment, attachment);
        self.discard(Discarded::Attachment { _attachment: left });
        self.brake = None;
        self.offset_m = None;
    }

    /// What the loop is done with, as long as there is room for it elsewhere.
    fn discard_retired(&mut self) {
        while 0 < self.discarded.slots() {
            let Some(retired) = self.attachment.side.take_retired() else {
                return;
            };
            self.discard(Discarded::Retired { _retired: retired });
        }
    }

    fn discard(&mut self, done_with: Discarded) {
        // Room was checked before; dropping it here would free memory within the tick.
        let _ = self.discarded.push(done_with);
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
        silence_ns: 0,
        echo_age_ns: 0,
        heard: Heard::default(),
        sample: DeviceSample::default(),
        felt_force_n: [0.0; 3],
        arrivals: ArrivalCounts::default(),
        lost_on_the_way_out: 0,
        scheme: Scheme::ForceExchange,
        copy: CopyState::None,
        corrections: Corrections::default(),
        wanted: Wanted {
            revision: 0,
            snapshot: None,
        },
        fault: None,
        request: None,
        robot: None,
    }
}

#[cfg(test)]
mod tests;
