//! A device that a hand holds, under the tick: what lets go of the hand, and that nothing resumes by itself.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use teleclay_devices::exchange::{DriverEnds, Marks, News, exchange};
use teleclay_devices::{Coupled, Hardware, SessionNeeds};
use teleclay_impedance::GraspState;

use super::*;

const TICK_NS: u64 = 1_000_000;
const HARDWARE: Hardware = Hardware::Haply;

/// An Inverse3 whose driver is the test.
struct Hand {
    coupled: Coupled,
    now_ns: u64,
    is_held: Arc<AtomicBool>,
}

impl Device for Hand {
    fn name(&self) -> &str {
        "hand"
    }

    fn sample(&mut self) -> Result<DeviceSample, DeviceError> {
        self.now_ns += TICK_NS;
        let sample = self.coupled.sample(self.now_ns)?;
        let is_held = self.coupled.state() == GraspState::Held;
        self.is_held.store(is_held, Ordering::Relaxed);
        Ok(sample)
    }

    fn command(&mut self, command: &DeviceCommand) -> Result<(), DeviceError> {
        self.coupled.command(self.now_ns, command);
        Ok(())
    }

    fn poll_request(&mut self) -> Option<DeviceRequest> {
        None
    }

    fn let_go(&mut self) {
        self.coupled.let_go();
    }
}

struct Rig {
    bench: Bench,
    driver: DriverEnds,
    is_held: Arc<AtomicBool>,
    ticks: u64,
    position_m: [f64; 3],
    /// What the driver is told to render along x.
    device_force_n: f64,
}

impl Rig {
    fn new() -> Self {
        let profile = HARDWARE.profile();
        let (driver, ends) = exchange(profile.force_n);
        let needs = SessionNeeds {
            tick_s: TICK_S,
            axes: 2,
            handle_damping_n_s_per_m: LoopParameters::default().virtual_damping_n_s_per_m,
            reach_m: [0.05; 3],
        };
        let is_held = Arc::new(AtomicBool::new(false));
        let hand = Hand {
            coupled: Coupled::new(HARDWARE, &needs, profile, ends).unwrap(),
            now_ns: 0,
            is_held: Arc::clone(&is_held),
        };
        let (_, commands) = mpsc::channel();
        let (trouble, _) = mpsc::channel();
        Self {
            bench: Bench::around(Box::new(hand), profile, commands, trouble),
            driver,
            is_held,
            ticks: 0,
            position_m: [0.0; 3],
            device_force_n: 0.0,
        }
    }

    fn is_held(&self) -> bool {
        self.is_held.load(Ordering::Relaxed)
    }

    fn tell(&mut self, marks: Marks) {
        self.driver.tell(News {
            at_ns: self.ticks * TICK_NS,
            position_m: self.position_m,
            marks,
        });
    }

    fn takes_hold(&mut self) {
        self.tell(Marks {
            takes_hold: true,
            ..Marks::default()
        });
        self.run(20);
        assert!(self.is_held());
    }

    fn run(&mut self, ticks: u32) -> Record {
        let mut record = None;
        for _ in 0..ticks {
            self.tell(Marks::default());
            self.ticks += 1;
            record = Some(self.bench.couple_for(1));
            self.device_force_n = self.driver.force(self.ticks * TICK_NS)[0].abs();
        }
        record.unwrap()
    }

    /// The hand pushes the handle, which the tool side holds back.
    fn pushes(&mut self) {
        for _ in 0..100 {
            self.position_m[0] += 2e-4;
            self.run(1);
        }
    }
}

/// What ends a lease, or changes it.
#[derive(Clone, Copy, Debug)]
enum Change {
    Renewed,
    Gone,
    Attached,
    Left,
}

#[test]
fn a_hand_lets_go_whenever_its_lease_ends_or_changes() {
    for change in [
        Change::Renewed,
        Change::Gone,
        Change::Attached,
        Change::Left,
    ] {
        let mut rig = Rig::new();
        rig.run(50);
        assert!(!rig.is_held(), "nobody has taken hold yet");
        rig.takes_hold();
        rig.pushes();
        assert!(0.1 < rig.device_force_n, "the coupling pushes back");
        let order = match change {
            Change::Renewed => {
                let (mut tool, ends) = line(2, Clock::start());
                tool.frame.header.sequence = 0;
                rig.bench.tool = tool;
                Order::Renew(Box::new(Renewal { of: 1, ends }))
            }
            Change::Gone => Order::Release { lease: 1 },
            Change::Attached => {
                let (tool, attachment) = tool(2, Clock::start());
                rig.bench.tool = tool;
                Order::Attach(attachment)
            }
            Change::Left => Order::Leave,
        };
        assert!(rig.bench.ends.orders.push(order).is_ok());
        rig.run(500);
        assert!(!rig.is_held(), "{change:?}");
        assert_eq!(rig.device_force_n, 0.0, "{change:?}");
        while rig.bench.ends.done.pop().is_ok() {}
        if !matches!(change, Change::Left) {
            rig.takes_hold();
            rig.pushes();
            assert!(0.1 < rig.device_force_n, "{change:?}: held anew");
        }
    }
}

#[test]
fn a_button_that_is_pressed_while_a_loop_ends_does_not_count_for_the_next() {
    let mut rig = Rig::new();
    rig.takes_hold();
    rig.pushes();
    let (tool, attachment) = tool(2, Clock::start());
    rig.bench.tool = tool;
    let attach = Order::Attach(attachment);
    assert!(rig.bench.ends.orders.push(attach).is_ok());
    assert_eq!(rig.run(5).mode, Mode::Braking);
    rig.takes_hold();
    assert_eq!(rig.run(500).lease, 2);
    assert!(!rig.is_held());
}

#[test]
fn taking_hold_moves_nothing_wherever_the_device_is() {
    let mut rig = Rig::new();
    rig.position_m = [0.04, -0.03, 0.02];
    rig.bench.tool.frame.force_n = [0.0; 3];
    rig.run(50);
    rig.takes_hold();
    let record = rig.run(200);
    let place_m = record.sample.position_m;
    assert!(place_m.iter().all(|part| part.abs() < 1e-9), "{place_m:?}");
}

#[test]
fn the_hand_draws_the_handle_against_what_it_feels_within_its_profile() {
    let mut rig = Rig::new();
    rig.bench.tool.frame.force_n = [-1000.0, 0.0, 0.0];
    rig.takes_hold();
    let most_n = HARDWARE.profile().force_n;
    for _ in 0..300 {
        rig.position_m[0] = (rig.position_m[0] + 2e-4).min(0.05);
        let record = rig.run(1);
        let hand_n = record.sample.hand_force_n[0];
        assert!(hand_n.abs() <= most_n + 1e-9 && rig.device_force_n <= most_n + 1e-9);
        assert!(record.felt_force_n[0].abs() <= most_n + 1e-9);
    }
    assert!(
        0.9 * most_n < rig.device_force_n,
        "at its bound, and no further"
    );
}
