//! The driver of a gamepad or a joystick: a state machine over a port, with time as an argument.

use std::time::Duration;

use super::effect::{self, RENEW_NS, RENEW_WITHIN_NS};
use super::layout::Layout;
use super::port::{Effect, InputPort, PadEvent, PortError};
use super::sticks::{Axes, Follower};
use crate::exchange::{Marks, News};
use crate::fault::DeviceFault;
use crate::profile::{Hardware, SessionNeeds};
use crate::thread::Driver;

/// Often enough for a coupling that reckons with 100 news a second.
const PERIOD: Duration = Duration::from_millis(4);
/// How fast a gamepad's place follows its stick, m/s: below the speed that its coupling takes for a leap.
pub const FOLLOWS_M_S: f64 = 0.4;

/// A gamepad or a joystick at work.
#[derive(Debug)]
pub struct PadDriver<P: InputPort> {
    hardware: Hardware,
    port: P,
    layout: Layout,
    reach_m: [f64; 3],
    axes: Axes,
    down: Vec<u16>,
    follower: Follower,
    events: Vec<PadEvent>,
    /// What is rendered, and since when.
    effect: Option<(u64, Effect)>,
    renders: bool,
}

impl<P: InputPort> PadDriver<P> {
    /// Takes a port into use. Nothing is rendered yet.
    ///
    /// # Errors
    /// The device lacks what is needed, or is gone.
    pub fn new(hardware: Hardware, mut port: P, needs: &SessionNeeds) -> Result<Self, DeviceFault> {
        let nature = port.nature();
        let device = hardware.word();
        let Some(layout) = Layout::of(hardware, &nature) else {
            return Err(DeviceFault::CannotLift {
                device,
                name: nature.name,
                place: super::FOLDER.to_owned(),
            });
        };
        if hardware == Hardware::Joystick && !nature.pushes {
            return Err(DeviceFault::CannotForce {
                name: nature.name,
                place: super::FOLDER.to_owned(),
            });
        }
        let state = port.state().map_err(|error| lost(hardware, &error))?;
        let workspace_m = hardware.workspace_m();
        Ok(Self {
            hardware,
            port,
            layout,
            reach_m: std::array::from_fn(|axis| needs.reach_m[axis].min(workspace_m[axis])),
            axes: Axes::of(&state),
            down: state.down,
            follower: Follower::default(),
            events: Vec::new(),
            effect: None,
            renders: hardware == Hardware::Joystick || nature.rumbles,
        })
    }

    /// The port, for tests that look at what it was told.
    pub fn port(&mut self) -> &mut P {
        &mut self.port
    }

    fn read(&mut self) -> Result<Marks, PortError> {
        let mut events = std::mem::take(&mut self.events);
        events.clear();
        self.port.read(&mut events)?;
        let mut marks = Marks::default();
        for event in &events {
            match *event {
                PadEvent::Axis { code, value } => self.axes.set(code, value),
                PadEvent::Key { code, is_down } => {
                    marks = marks.and_then(self.press(code, is_down));
                }
                PadEvent::Dropped => {
                    marks = marks.and_then(self.read_anew()?);
                    break;
                }
            }
        }
        self.events = events;
        Ok(marks)
    }

    fn press(&mut self, code: u16, is_down: bool) -> Marks {
        let was_down = self.down.contains(&code);
        if is_down == was_down {
            return Marks::default();
        }
        if is_down {
            self.down.push(code);
        } else {
            self.down.retain(|down| *down != code);
        }
        let buttons = self.layout.buttons;
        Marks {
            takes_hold: is_down && code == buttons.hold,
            lets_go: is_down && code == buttons.release,
            clutches: is_down && code == buttons.clutch,
            unclutches: !is_down && code == buttons.clutch,
            wants_clay: is_down && code == buttons.clay,
        }
    }

    /// After events were lost nobody knows which buttons were pressed meanwhile: the hand takes hold anew.
    fn read_anew(&mut self) -> Result<Marks, PortError> {
        let state = self.port.state()?;
        self.axes = Axes::of(&state);
        self.down = state.down;
        Ok(Marks {
            lets_go: true,
            ..Marks::default()
        })
    }

    fn place(&mut self, now_ns: u64) -> [f64; 3] {
        let deflection = self.axes.deflection(self.layout.lift);
        let target_m = std::array::from_fn(|axis| deflection[axis] * self.reach_m[axis]);
        match self.hardware {
            Hardware::Gamepad => self.follower.step(now_ns, target_m, FOLLOWS_M_S),
            // Its place is where its motors push.
            Hardware::Joystick | Hardware::Haply => target_m,
        }
    }

    fn render(&mut self, now_ns: u64, force_n: [f64; 3]) -> Result<(), PortError> {
        if !self.renders {
            return Ok(());
        }
        let wanted = match self.hardware {
            Hardware::Gamepad => effect::rumble(force_n, self.hardware.profile().force_n),
            Hardware::Joystick | Hardware::Haply => effect::constant(force_n),
        };
        let Some((since_ns, rendered)) = self.effect else {
            if effect::is_nothing(wanted) {
                return Ok(());
            }
            return self.play(now_ns, wanted);
        };
        // The end of a force waits for nothing.
        if effect::is_nothing(wanted) {
            self.effect = None;
            return self.port.silence();
        }
        let age_ns = now_ns.saturating_sub(since_ns);
        let is_due = (wanted != rendered && RENEW_NS <= age_ns) || RENEW_WITHIN_NS <= age_ns;
        if is_due {
            self.play(now_ns, wanted)
        } else {
            Ok(())
        }
    }

    fn play(&mut self, now_ns: u64, effect: Effect) -> Result<(), PortError> {
        self.effect = Some((now_ns, effect));
        self.port.play(effect)
    }
}

impl<P: InputPort> Driver for PadDriver<P> {
    fn device(&self) -> &'static str {
        self.hardware.word()
    }

    fn period(&self) -> Duration {
        PERIOD
    }

    fn step(&mut self, now_ns: u64, force_n: [f64; 3]) -> Result<Option<News>, DeviceFault> {
        let hardware = self.hardware;
        let told = self.read().and_then(|marks| {
            self.render(now_ns, force_n)?;
            Ok(marks)
        });
        let marks = told.map_err(|error| lost(hardware, &error))?;
        Ok(Some(News {
            at_ns: now_ns,
            position_m: self.place(now_ns),
            marks,
        }))
    }

    fn rest(&mut self) {
        self.effect = None;
        // A device that is gone renders nothing.
        let _ = self.port.silence();
    }
}

fn lost(hardware: Hardware, error: &PortError) -> DeviceFault {
    DeviceFault::Lost {
        device: hardware.word(),
        reason: error.to_string(),
    }
}
