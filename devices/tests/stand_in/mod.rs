//! A stand-in for the port of a gamepad or a joystick, and a bench that steps driver and tick on one virtual clock.

use std::sync::{Arc, Mutex, MutexGuard};

use teleclay_device::DeviceCommand;
use teleclay_devices::exchange::{DriverEnds, exchange};
use teleclay_devices::gap::{Clocks, GapWatch};
use teleclay_devices::pad::driver::PadDriver;
use teleclay_devices::pad::layout::{
    EAST, RY, RZ, SHOULDER, SOUTH, START, THROTTLE, THUMB2, TRIGGER, X, Y, Z,
};
use teleclay_devices::pad::port::{
    AxisInfo, Effect, InputPort, PadEvent, PadNature, PadState, PortError,
};
use teleclay_devices::thread::turn;
use teleclay_devices::{Coupled, DeviceFault, Hardware, SessionNeeds};

pub(crate) const MS: u64 = 1_000_000;
pub(crate) const NEEDS: SessionNeeds = SessionNeeds {
    tick_s: 1e-3,
    axes: 2,
    handle_damping_n_s_per_m: 10.0,
    reach_m: [0.04, 0.03, 0.02],
};

/// What a stand-in is told and what it tells, shared with the test that plays it.
#[derive(Debug, Default)]
pub(crate) struct Script {
    pub(crate) events: Vec<PadEvent>,
    pub(crate) state: PadState,
    pub(crate) failure: Option<PortError>,
    /// What is rendered now, and everything that ever was.
    pub(crate) rendered: Option<Effect>,
    pub(crate) played: Vec<Effect>,
}

#[derive(Clone, Debug)]
pub(crate) struct StandIn {
    pub(crate) nature: PadNature,
    pub(crate) script: Arc<Mutex<Script>>,
}

impl StandIn {
    pub(crate) fn new(hardware: Hardware) -> Self {
        let (keys, axes) = match hardware {
            Hardware::Gamepad => (vec![SOUTH, EAST, SHOULDER, START], vec![X, Y, RY, Z, RZ]),
            _ => (vec![TRIGGER, THUMB2], vec![X, Y, THROTTLE]),
        };
        let info = |&code: &u16| AxisInfo {
            code,
            least: if [Z, RZ].contains(&code) { 0 } else { -1000 },
            most: 1000,
            value: 0,
        };
        let state = PadState {
            axes: axes.iter().map(info).collect(),
            down: Vec::new(),
        };
        let nature = PadNature {
            name: "stand-in".to_owned(),
            keys,
            axes,
            rumbles: true,
            pushes: true,
        };
        let script = Script {
            state,
            ..Script::default()
        };
        Self {
            nature,
            script: Arc::new(Mutex::new(script)),
        }
    }

    pub(crate) fn script(&self) -> MutexGuard<'_, Script> {
        self.script.lock().unwrap()
    }
}

impl InputPort for StandIn {
    fn nature(&self) -> PadNature {
        self.nature.clone()
    }

    fn read(&mut self, events: &mut Vec<PadEvent>) -> Result<(), PortError> {
        let mut script = self.script();
        if let Some(failure) = &script.failure {
            return Err(failure.clone());
        }
        events.append(&mut script.events);
        Ok(())
    }

    fn state(&mut self) -> Result<PadState, PortError> {
        Ok(self.script().state.clone())
    }

    fn play(&mut self, effect: Effect) -> Result<(), PortError> {
        let mut script = self.script();
        if let Some(failure) = &script.failure {
            return Err(failure.clone());
        }
        script.rendered = Some(effect);
        script.played.push(effect);
        Ok(())
    }

    fn silence(&mut self) -> Result<(), PortError> {
        self.script().rendered = None;
        Ok(())
    }
}

/// Driver and tick on one virtual clock: the driver steps every 4 ms, the tick every millisecond.
pub(crate) struct Bench {
    pub(crate) port: StandIn,
    pub(crate) driver: PadDriver<StandIn>,
    pub(crate) ends: DriverEnds,
    pub(crate) gap: GapWatch,
    pub(crate) coupled: Coupled,
    pub(crate) now_ns: u64,
    /// What the machine slept, as the wall's clock has it.
    pub(crate) slept_ns: u64,
    pub(crate) hand_force_n: [f64; 3],
    /// A spring that holds the loop's handle to home, N/m: something to push against.
    pub(crate) wall_n_per_m: f64,
    pub(crate) place_m: [f64; 3],
    pub(crate) speed_m_s: [f64; 3],
}

impl Bench {
    pub(crate) fn new(hardware: Hardware) -> Self {
        let port = StandIn::new(hardware);
        let driver = PadDriver::new(hardware, port.clone(), &NEEDS).unwrap();
        let profile = hardware.profile();
        let (ends, tick) = exchange(profile.force_n);
        Self {
            port,
            driver,
            ends,
            gap: GapWatch::default(),
            coupled: Coupled::new(hardware, &NEEDS, profile, tick).unwrap(),
            now_ns: 0,
            slept_ns: 0,
            hand_force_n: [0.0; 3],
            wall_n_per_m: 0.0,
            place_m: [0.0; 3],
            speed_m_s: [0.0; 3],
        }
    }

    pub(crate) fn event(&self, event: PadEvent) {
        self.port.script().events.push(event);
    }

    pub(crate) fn axis(&self, code: u16, value: i32) {
        let mut script = self.port.script();
        script.events.push(PadEvent::Axis { code, value });
        if let Some(axis) = script.state.axes.iter_mut().find(|axis| axis.code == code) {
            axis.value = value;
        }
    }

    pub(crate) fn press(&self, code: u16) {
        self.event(PadEvent::Key {
            code,
            is_down: true,
        });
    }

    pub(crate) fn lift(&self, code: u16) {
        self.event(PadEvent::Key {
            code,
            is_down: false,
        });
    }

    pub(crate) fn drive(&mut self) -> Result<(), DeviceFault> {
        let clocks = Clocks {
            now_ns: self.now_ns,
            wall_ns: 1_000_000 * MS + self.now_ns + self.slept_ns,
        };
        turn(&mut self.driver, &mut self.ends, &mut self.gap, clocks)
    }

    /// A tick of a loop whose handle has 1 kg and 10 N·s/m.
    pub(crate) fn tick(&mut self) -> Result<(), DeviceFault> {
        let sample = self.coupled.sample(self.now_ns)?;
        self.hand_force_n = sample.hand_force_n;
        for axis in 0..2 {
            let force_n = sample.hand_force_n[axis]
                - 10.0 * self.speed_m_s[axis]
                - self.wall_n_per_m * self.place_m[axis];
            self.speed_m_s[axis] += force_n * 1e-3;
            self.place_m[axis] += self.speed_m_s[axis] * 1e-3;
        }
        self.place_m[2] = sample.position_m[2];
        let command = DeviceCommand {
            position_m: self.place_m,
            force_n: self.place_m.map(|place| -self.wall_n_per_m * place),
        };
        self.coupled.command(self.now_ns, &command);
        Ok(())
    }

    pub(crate) fn run(&mut self, ms: u64) -> Result<(), DeviceFault> {
        for _ in 0..ms {
            if self.now_ns.is_multiple_of(4 * MS) {
                self.drive()?;
            }
            self.tick()?;
            self.now_ns += MS;
        }
        Ok(())
    }

    /// A hand moves the stick to the right, to its end, within 100 ms.
    pub(crate) fn push(&mut self) {
        for value in 1..=25 {
            self.axis(X, 40 * value);
            self.run(4).unwrap();
        }
    }

    pub(crate) fn force_n(&self) -> f64 {
        self.hand_force_n
            .iter()
            .map(|part| part * part)
            .sum::<f64>()
            .sqrt()
    }
}
