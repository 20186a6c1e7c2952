//! The tick on virtual time, with a tool side that is a spring or a steady push.

#![allow(
    clippy::float_cmp,
    reason = "zero and the whole push are meant exactly: a ramp ends, a gain is full"
)]

use std::sync::mpsc::{self, Receiver};
use std::time::Duration;

use rtrb::Producer;
use teleclay_device::DeviceSample;
use teleclay_operator::{Axes, Intent, SimulatedHandle};
use teleclay_proto::NodeName;
use teleclay_proto::frame::{Engagement, HandleFrame, LoopStatus, ToolFrame};
use teleclay_proto::http::ClayShape;
use teleclay_proto::join::{ClayDescription, Granted, LoopParameters};
use teleclay_shell::Clock;
use teleclay_shell::realtime::{Ends, Realtime};
use teleclay_shell::ticker::{Next, Tick};

use super::*;
use crate::attachment::{Arrived, LineEnds};
use crate::device::DeviceKind;
use crate::outbox::Sender;

mod held;
mod malice;
mod renewed;
mod replaced;

const TICK_S: f64 = 1e-3;
const TICK: Duration = Duration::from_millis(1);
const IN_TIME: Tick = Tick {
    number: 0,
    deadline_ns: 0,
    lateness: Duration::ZERO,
    given_up: 0,
    rested: 0,
};

fn granted(lease: u32) -> Granted {
    Granted {
        lease,
        ownership_epoch: 1,
        node: NodeName::new("local").unwrap(),
        tool: 1,
        lease_s: 5.0,
        parameters: LoopParameters {
            scheme: Scheme::ForceExchange,
            ..LoopParameters::default()
        },
        clay: ClayDescription {
            shape: ClayShape::block(),
            voxel_size_m: 5e-4,
            epoch: 1,
            revision: 0,
        },
        slow_endpoint: None,
    }
}

/// What the device was told, tick by tick.
type Commands = Receiver<(DeviceSample, DeviceCommand)>;

/// A simulated handle that writes down what it is told, and fails in the ways a device can.
struct Probe {
    handle: SimulatedHandle,
    told: mpsc::Sender<(DeviceSample, DeviceCommand)>,
    last: DeviceSample,
    is_blind: bool,
    is_lost: bool,
    wants_clay: bool,
    trouble: Receiver<Trouble>,
}

enum Trouble {
    Blind,
    Lost,
    WantsClay,
}

impl Device for Probe {
    fn name(&self) -> &str {
        "probe"
    }

    fn sample(&mut self) -> Result<DeviceSample, DeviceError> {
        match self.trouble.try_recv() {
            Ok(Trouble::Blind) => self.is_blind = true,
            Ok(Trouble::Lost) => self.is_lost = true,
            Ok(Trouble::WantsClay) => self.wants_clay = true,
            Err(_) => {}
        }
        if self.is_lost {
            return Err(DeviceError::Lost {
                device: "probe".to_owned(),
                reason: "unplugged".to_owned(),
            });
        }
        self.last = self.handle.sample();
        if self.is_blind {
            self.last.position_m[0] = f64::NAN;
        }
        Ok(self.last)
    }

    fn command(&mut self, command: &DeviceCommand) -> Result<(), DeviceError> {
        self.handle.command(command.position_m);
        let _ = self.told.send((self.last, *command));
        Ok(())
    }

    fn poll_request(&mut self) -> Option<DeviceRequest> {
        std::mem::take(&mut self.wants_clay).then_some(DeviceRequest::FreshClay)
    }
}

/// An engine, a tool side under one lease, and the time.
struct Bench {
    realtime: Realtime<Engine>,
    ends: Ends<Engine>,
    now: Timestamp,
    tool: Tool,
    commands: Commands,
    trouble: mpsc::Sender<Trouble>,
}

/// A tool side that pushes on the hand whenever it speaks.
struct Tool {
    frame: ToolFrame,
    arriving: Producer<Arrived>,
    sent: Receiver<HandleFrame>,
    _sender: Sender,
}

/// A tool side under a lease, and a new handle side for it.
fn tool(lease: u32, clock: Clock) -> (Tool, Box<Attachment>) {
    let (tool, ends) = line(lease, clock);
    let attachment = Attachment::new(&granted(lease).parameters, ends).unwrap();
    (tool, attachment)
}

fn line(lease: u32, clock: Clock) -> (Tool, LineEnds) {
    let (sent_to_network, sent) = mpsc::channel();
    let (outbox, sender) = Sender::spawn(clock, move |bytes| {
        sent_to_network
            .send(HandleFrame::decode(bytes).unwrap())
            .is_ok()
    })
    .unwrap();
    let (ends, arriving) = LineEnds::new(&granted(lease), outbox);
    let mut frame = ToolFrame {
        status: LoopStatus::Running,
        force_n: [-3.0, 0.0, 0.0],
        ..ToolFrame::default()
    };
    frame.header.lease = lease;
    frame.header.ownership_epoch = 1;
    frame.header.scheme = Scheme::ForceExchange;
    (
        Tool {
            frame,
            arriving,
            sent,
            _sender: sender,
        },
        ends,
    )
}

impl Bench {
    fn new(intent: Intent) -> Self {
        let (told, commands) = mpsc::channel();
        let (trouble, troubles) = mpsc::channel();
        let probe = Probe {
            handle: SimulatedHandle::new(Axes::Two, TICK_S, intent).unwrap(),
            told,
            last: DeviceSample::default(),
            is_blind: false,
            is_lost: false,
            wants_clay: false,
            trouble: troubles,
        };
        let profile = DeviceKind::Simulated.profile();
        Self::around(Box::new(probe), profile, commands, trouble)
    }

    fn around(
        device: Box<dyn Device>,
        profile: DeviceProfile,
        commands: Commands,
        trouble: mpsc::Sender<Trouble>,
    ) -> Self {
        let now = Timestamp::ZERO.after(TICK);
        let (tool, attachment) = tool(1, Clock::start());
        let engine = Engine::new(now, TICK_S, device, profile, attachment);
        let (realtime, ends) = Realtime::new(engine, Clock::start(), CAPACITIES);
        Self {
            realtime,
            ends,
            now,
            tool,
            commands,
            trouble,
        }
    }

    fn tool_speaks(&mut self) {
        self.tool.frame.header.sequence += 1;
        self.tool.frame.header.sent_ns = self.now.as_nanos();
        let arrived = Arrived {
            at: self.now,
            frame: self.tool.frame,
        };
        assert!(
            self.tool.arriving.push(arrived).is_ok(),
            "the tick takes in what comes"
        );
    }

    fn tick(&mut self) -> Record {
        assert_eq!(self.realtime.tick_at(self.now, IN_TIME), Next::Continue);
        self.now = self.now.after(TICK);
        self.ends.records.pop().unwrap()
    }

    /// Ticks with the tool speaking.
    fn couple_for(&mut self, ticks: u32) -> Record {
        (0..ticks)
            .map(|_| {
                self.tool_speaks();
                self.tick()
            })
            .last()
            .unwrap()
    }

    fn told(&self) -> Vec<(DeviceSample, DeviceCommand)> {
        self.commands.try_iter().collect()
    }
}

fn pushing() -> Intent {
    Intent::constant_force([1.0, 0.25, 0.0]).unwrap()
}

/// Greatest change from tick to tick of the force, and of the command's velocity.
fn steps(told: &[(DeviceSample, DeviceCommand)]) -> (f64, f64) {
    let norm = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let minus = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|axis| a[axis] - b[axis]);
    let force = told
        .windows(2)
        .map(|pair| norm(minus(pair[1].1.force_n, pair[0].1.force_n)));
    let velocity = told.windows(3).map(|three| {
        let [a, b, c] = [
            three[0].1.position_m,
            three[1].1.position_m,
            three[2].1.position_m,
        ];
        norm(minus(minus(c, b), minus(b, a))) / TICK_S
    });
    (force.fold(0.0, f64::max), velocity.fold(0.0, f64::max))
}

/// Two ramps of 50 ticks, the watchdog's and the status's, run at once when frames begin: at most 2/50 of the push in a
/// tick.
const FORCE_STEP_N: f64 = 3.0 * 2.0 / 50.0 + 1e-9;
/// What 4 N do to the virtual mass of 1 kg in a tick is 4 mm/s; the brake takes 1/30 of the speed in a tick, and speeds
/// stay below 0.3 m/s.
const VELOCITY_STEP_M_S: f64 = 0.010;

#[test]
fn the_hand_feels_what_the_tool_side_says() {
    let mut bench = Bench::new(Intent::Idle);
    let record = bench.couple_for(200);
    assert_eq!(
        (record.mode, record.link_state),
        (Mode::Coupled, LinkState::Live)
    );
    assert_eq!(record.felt_force_n, [-3.0, 0.0, 0.0]);
    assert_eq!(record.arrivals.received, 200);
    assert!(steps(&bench.told()).0 <= FORCE_STEP_N);
}

#[test]
fn a_reaction_is_timed_once_and_by_this_clock() {
    let mut bench = Bench::new(Intent::Idle);
    bench.couple_for(10);
    bench.tool.frame.header.echo_ns = bench.now.as_nanos() - 700_000;
    bench.tool.frame.header.echo_hold_ns = 500_000;
    bench.tool_speaks();
    let heard = bench.tick().heard;
    assert_eq!(
        heard,
        Heard {
            rtt_ns: Some(200_000),
            reaction_ns: Some(700_000)
        }
    );
    bench.tool_speaks();
    assert_eq!(
        bench.tick().heard,
        Heard::default(),
        "the same stamp echoed again"
    );
    bench.tool.frame.header.echo_ns = u64::MAX;
    bench.tool_speaks();
    assert_eq!(
        bench.tick().heard,
        Heard::default(),
        "a stamp from the future"
    );
}

#[test]
fn silence_releases_the_force_within_its_time_and_the_handle_stays_free() {
    let mut bench = Bench::new(pushing());
    bench.couple_for(300);
    let ticks_to_zero = (1..).find(|_| bench.tick().felt_force_n == [0.0; 3]);
    assert!(
        ticks_to_zero.is_some_and(|ticks| ticks <= 151),
        "{ticks_to_zero:?}"
    );
    let record = bench.tick();
    assert_eq!(
        (record.mode, record.link_state),
        (Mode::Coupled, LinkState::Silent)
    );
    assert!(
        (100_000_000..160_000_000).contains(&record.silence_ns),
        "{}",
        record.silence_ns
    );
    assert!(steps(&bench.told()).0 <= FORCE_STEP_N);
}

#[test]
fn another_lease_starts_where_the_handle_stands_without_a_step_of_force_or_speed() {
    let mut bench = Bench::new(pushing());
    bench.couple_for(300);
    for _ in 0..1000 {
        bench.tick();
    }
    let moving = bench.told();
    let speed = moving.last().unwrap().0.velocity_m_s[0];
    assert!(
        0.05 < speed,
        "the handle moves at {speed} m/s when the lease comes"
    );

    let (tool, attachment) = tool(2, Clock::start());
    bench.tool = tool;
    assert!(bench.ends.orders.push(Order::Attach(attachment)).is_ok());
    let ticks = (1..).find(|_| bench.tick().lease == 2).unwrap();
    assert!(ticks <= 302, "{ticks}");
    assert_eq!(replaced::discarded(&mut bench), ["attachment"]);
    let record = bench.couple_for(200);
    assert_eq!(
        (record.mode, record.link_state, record.lease),
        (Mode::Coupled, LinkState::Live, 2)
    );
    assert_eq!(record.felt_force_n, [-3.0, 0.0, 0.0]);

    let told: Vec<_> = moving.into_iter().chain(bench.told()).collect();
    let (force_n, velocity_m_s) = steps(&told);
    assert!(force_n <= FORCE_STEP_N, "{force_n} N in a tick");
    assert!(
        velocity_m_s <= VELOCITY_STEP_M_S,
        "{velocity_m_s} m/s in a tick"
    );
}

#[test]
fn leaving_says_so_in_every_frame_and_ends_at_rest_without_force() {
    let mut bench = Bench::new(pushing());
    bench.couple_for(300);
    bench.tool.sent.try_iter().for_each(drop);
    assert!(bench.ends.orders.push(Order::Leave).is_ok());
    let mut ticks = 0;
    let record = loop {
        bench.tool_speaks();
        let record = bench.tick();
        ticks += 1;
        if record.mode == Mode::Resting {
            break record;
        }
    };
    assert!((50..=302).contains(&ticks), "{ticks}");
    assert_eq!(record.felt_force_n, [0.0; 3]);
    let (force_n, velocity_m_s) = steps(&bench.told());
    assert!(
        force_n <= FORCE_STEP_N && velocity_m_s <= VELOCITY_STEP_M_S,
        "{force_n} N, {velocity_m_s} m/s"
    );
    assert_eq!(
        bench.realtime.machine().attachment.side.frame().engagement,
        Engagement::Leaving
    );
}

#[test]
fn a_blind_device_is_held_where_it_was_and_never_told_nonsense() {
    let mut bench = Bench::new(pushing());
    bench.couple_for(300);
    let before = *bench.told().last().unwrap();
    bench.trouble.send(Trouble::Blind).unwrap();
    let record = bench.couple_for(400);
    assert_eq!(
        record.fault.map(|fault| fault.field),
        Some("device position_m")
    );
    assert_eq!(
        (record.mode, record.felt_force_n),
        (Mode::Resting, [0.0; 3])
    );
    let told = bench.told();
    assert!(told.iter().all(|(_, command)| {
        command
            .position_m
            .iter()
            .chain(&command.force_n)
            .all(|x| x.is_finite())
    }));
    let stopped_after_m = told.last().unwrap().1.position_m[0] - before.1.position_m[0];
    assert!(stopped_after_m.abs() < 0.01, "{stopped_after_m} m");
    // A lease that comes now changes nothing: a fault ends the run.
    let (_, attachment) = tool(2, Clock::start());
    assert!(bench.ends.orders.push(Order::Attach(attachment)).is_ok());
    assert_eq!(bench.couple_for(400).lease, 1);
}

#[test]
fn a_device_that_is_blind_from_the_start_is_never_moved() {
    let mut bench = Bench::new(pushing());
    bench.trouble.send(Trouble::Blind).unwrap();
    assert!(bench.couple_for(100).fault.is_some());
    assert!(bench.told().is_empty());
}

#[test]
fn a_value_from_the_tool_side_that_is_not_finite_releases_the_force() {
    let mut bench = Bench::new(pushing());
    bench.couple_for(300);
    bench.tool.frame.force_n[1] = f64::INFINITY;
    let record = bench.couple_for(400);
    assert_eq!(record.fault.map(|fault| fault.field), Some("force_n"));
    assert_eq!(
        (record.mode, record.felt_force_n),
        (Mode::Resting, [0.0; 3])
    );
}

#[test]
fn a_lost_device_ends_the_thread_and_says_why() {
    let mut bench = Bench::new(Intent::Idle);
    bench.tick();
    bench.trouble.send(Trouble::Lost).unwrap();
    assert_eq!(bench.realtime.tick_at(bench.now, IN_TIME), Next::Stop);
    assert_eq!(
        bench.ends.failures.pop().unwrap().to_string(),
        "probe is lost: unplugged"
    );
}

#[test]
fn a_request_waits_until_its_record_is_taken_and_is_told_once() {
    let mut bench = Bench::new(Intent::Idle);
    for _ in 0..CAPACITIES.records {
        bench.realtime.tick_at(bench.now, IN_TIME);
    }
    bench.trouble.send(Trouble::WantsClay).unwrap();
    for _ in 0..3 {
        bench.realtime.tick_at(bench.now, IN_TIME);
    }
    while bench.ends.records.pop().is_ok() {}
    for _ in 0..3 {
        bench.realtime.tick_at(bench.now, IN_TIME);
    }
    let requests: Vec<_> = std::iter::from_fn(|| bench.ends.records.pop().ok())
        .map(|record| record.request)
        .collect();
    assert_eq!(requests, [Some(DeviceRequest::FreshClay), None, None]);
}

#[test]
fn a_server_that_has_gone_releases_the_hand_within_a_ramp_whatever_the_scheme_and_frames_bring_it_back()
 {
    let mut bench = Bench::new(Intent::Idle);
    let felt = bench.couple_for(200).felt_force_n;
    assert_eq!(felt, [-3.0, 0.0, 0.0]);
    bench.told();
    // A frame that came before the news is no sign of life after it; another lease's server is none of ours.
    bench.tool_speaks();
    for lease in [9, 1] {
        assert!(bench.ends.orders.push(Order::Release { lease }).is_ok());
        assert_eq!(bench.tick().link_state == LinkState::Gone, lease == 1);
    }
    for _ in 0..60 {
        bench.tick();
    }
    let record = bench.tick();
    assert_eq!(record.link_state, LinkState::Gone);
    assert_eq!(record.felt_force_n, [0.0; 3]);
    let record = bench.couple_for(200);
    assert_eq!(record.link_state, LinkState::Live);
    assert_eq!(record.felt_force_n, [-3.0, 0.0, 0.0]);
    let (force_n, _) = steps(&bench.told());
    assert!(force_n <= FORCE_STEP_N, "{force_n} N in a tick");
}
