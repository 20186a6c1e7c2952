//! The virtual coupling: a spring and a damper between the device's place and the loop's handle.
//!
//! Source: [CSB95]; for a device that is an impedance at a handle that is an admittance, [AH99].
//!
//! ```text
//! f_h = cap(K (x_d - y_h) + B (v_d - v_h))        on the handle; the device renders -f_h, scaled
//! ```
//!
//! The cap shortens the force and keeps its direction. Then it passes the device's own law for force and slew, which
//! does not bind while both sides keep to their speeds (see [`SetupError::TooFast`]). What holds, and who pays for
//! what a sampled spring gives away, stands in [`Observer`].

use teleclay_device::{DeviceCommand, Guard};

use crate::grasp::{Grasp, GraspState, Wish};
use crate::observer::Observer;
use crate::reading::{Played, Reading, ReadingSetup, Taken};
use crate::scale::Scale;
use crate::setup::{CouplingSetup, SetupError};
use crate::vector::{Vector, is_within, minus, norm, plus, times};

/// No handle is as far away as this, m, or as fast, m/s.
const FARTHEST_M: f64 = 100.0;
const FASTEST_M_S: f64 = 1e3;
/// What rounding may add to a way, over the bound.
const ROUNDING: f64 = 1.0 + 1e-9;

/// Where the loop's handle is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HandlePlace {
    /// `y_h`, displacement from home, m. On a two-axis handle the third value is its lift.
    pub position_m: [f64; 3],
    /// `v_h`, m/s.
    pub velocity_m_s: [f64; 3],
}

/// What one tick gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingStep {
    /// `f_h`, force of the hand on the loop's handle, N.
    pub hand_force_n: [f64; 3],
    /// What the device renders on the hand, N.
    pub device_force_n: [f64; 3],
    /// `x_d`, where the handle is drawn to, or was last, m: on a two-axis handle the third value is the lift.
    pub target_m: [f64; 3],
    /// Who holds the handle.
    pub state: GraspState,
}

/// A spring and a damper between a device and the loop's handle.
///
/// Each tick: [`sample`](Self::sample) for every sample that came, then [`step`](Self::step) once. In between, whoever
/// holds the device may [`hold`](Self::hold), [`release`](Self::release), [`clutch`](Self::clutch),
/// [`set_scale`](Self::set_scale) and [`lock_axes`](Self::lock_axes). It starts released.
///
/// ```
/// use teleclay_device::DeviceProfile;
/// use teleclay_impedance::{Coupling, CouplingSetup, GraspState, HandlePlace};
///
/// let profile = DeviceProfile {
///     force_n: 20.0, slew_n_per_s: 2000.0, speed_m_s: 2.0, power_w: 15.0, silence_s: 0.1, ramp_s: 0.05,
/// };
/// let mut mouse = Coupling::new(CouplingSetup::without_feedback(60.0, 10.0, 1e-3, profile)).unwrap();
/// let handle = HandlePlace::default();
/// mouse.hold();
/// mouse.sample(0, 0, [0.3, 0.1, 0.0]);
/// // Taking hold stretches nothing, wherever device and handle are.
/// let step = mouse.step(0, &handle);
/// assert_eq!((step.state, step.hand_force_n), (GraspState::Held, [0.0; 3]));
/// // A sample that is none is not felt.
/// mouse.sample(1_000_000, 1_000_000, [f64::NAN; 3]);
/// assert_eq!(mouse.step(1_000_000, &handle).hand_force_n, [0.0; 3]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Coupling {
    setup: CouplingSetup,
    reading: Reading,
    grasp: Grasp,
    guard: Guard,
    observer: Observer,
    /// What was put out last.
    force: Vector,
    target: Vector,
    /// What the velocity of a new grip lacks to the handle's; fades as the filter does.
    lag: Vector,
    /// Of the last step: its time, the device's place and the handle's.
    last_ns: Option<u64>,
    device: Option<Vector>,
    handle: Option<Vector>,
}

impl Coupling {
    /// Released, at rest.
    ///
    /// # Errors
    /// A number that is none or out of range; a spring stiffer than [`max_stiffness`](crate::max_stiffness) says, with
    /// the time that the playback costs, or than letting go allows; speeds at which the force outruns the slew.
    pub fn new(setup: CouplingSetup) -> Result<Self, SetupError> {
        setup.check()?;
        let tick_s = setup.handle.tick_s;
        let reading = Reading::new(ReadingSetup {
            timing: setup.device,
            playback: setup.playback,
            tick_s,
            speed_m_s: setup.device_speed_m_s,
            filter_s: setup.filter_s,
            hold_s: setup.hold_s,
        });
        Ok(Self {
            reading,
            grasp: Grasp::new(setup.scale),
            guard: Guard::new(setup.profile, tick_s),
            observer: observer(&setup, &setup.scale),
            force: [0.0; 3],
            target: [0.0; 3],
            lag: [0.0; 3],
            last_ns: None,
            device: None,
            handle: None,
            setup,
        })
    }

    /// The device was at `position_m`, m, at `at_ns`, which is told at `now_ns`.
    ///
    /// A device that tells only changes has to be asked again and again while it is known to be there: one that is not
    /// heard of for [`hold_s`](CouplingSetup::hold_s) is let go of.
    pub fn sample(&mut self, now_ns: u64, at_ns: u64, position_m: [f64; 3]) -> Taken {
        self.reading.take(now_ns, at_ns, position_m)
    }

    /// Takes hold of the handle where it is, at the next step at which device and handle are there.
    pub fn hold(&mut self) {
        self.grasp.wish(Wish::Hold);
    }

    /// Lets go of the handle, within [`ramp_s`](CouplingSetup::ramp_s).
    pub fn release(&mut self) {
        self.grasp.wish(Wish::Release);
    }

    /// Takes the clutch out, if the handle is held: the force fades as in a release, and the device moves without the
    /// handle until the next [`hold`](Self::hold).
    pub fn clutch(&mut self) {
        if self.grasp.is_holding() {
            self.grasp.wish(Wish::Clutch);
        }
    }

    /// Another scale: a handle that is held is let go of and taken hold of anew.
    ///
    /// # Errors
    /// The spring would be too stiff behind this scale, or the motion too fast; nothing changes.
    pub fn set_scale(&mut self, scale: Scale) -> Result<(), SetupError> {
        self.setup.check_scale(&scale)?;
        self.grasp.set_scale(scale);
        Ok(())
    }

    /// From the next grip on, the handle is held fast along these axes, where it is then, and the device feels nothing
    /// along them. A handle that is held is let go of and taken hold of anew.
    pub fn lock_axes(&mut self, locked: [bool; 3]) {
        self.grasp.lock_axes(locked);
    }

    /// One tick, at `now_ns`, with the handle where it is.
    pub fn step(&mut self, now_ns: u64, handle: &HandlePlace) -> CouplingStep {
        let device = self.reading.step(now_ns);
        let is_steady = self.is_steady(now_ns, handle);
        self.observe(
            device.map(|played| played.position_m),
            is_steady.then_some(handle.position_m),
        );
        let played = device.filter(|_| is_steady);
        if played.is_none() || !self.grasp.stays() {
            self.grasp.open();
        }
        let is_at_rest = norm(self.force) <= 0.0;
        let target = played.and_then(|played| self.grasp.target(played.position_m));
        if let Some(played) = played
            && is_at_rest
            && self.grasp.is_holding()
            && target.is_none()
        {
            self.take_hold(&played, handle);
        }
        let held = played.and_then(|played| Some((target?, played)));
        let wanted = match held {
            Some((target, played)) => {
                self.target = target;
                let velocity = plus(self.grasp.moved(played.velocity_m_s), self.lag);
                let share =
                    self.setup.handle.tick_s / (self.setup.filter_s + self.setup.handle.tick_s);
                self.lag = times(self.lag, 1.0 - share);
                let spring = times(
                    minus(target, handle.position_m),
                    self.setup.stiffness_n_per_m,
                );
                let damper = times(
                    minus(velocity, handle.velocity_m_s),
                    self.setup.damping_n_s_per_m,
                );
                self.reflected(plus(spring, damper))
            }
            None => self.faded(),
        };
        if self.setup.stop_force_n <= norm(wanted) && held.is_some() {
            self.grasp.open();
            self.grasp.wish(Wish::Stop);
        }
        let wanted = DeviceCommand {
            force_n: wanted,
            ..DeviceCommand::default()
        };
        self.force = self.guard.step(wanted, [0.0; 3]).force_n;
        self.given()
    }

    /// Who holds the handle.
    pub fn state(&self) -> GraspState {
        self.grasp.state(0.0 < norm(self.force))
    }

    /// The scale in force.
    pub fn scale(&self) -> Scale {
        self.grasp.scale()
    }

    /// What it is made of.
    pub fn setup(&self) -> &CouplingSetup {
        &self.setup
    }

    /// The energy that it has taken, as far as the samples show.
    pub fn observer(&self) -> &Observer {
        &self.observer
    }

    /// Without a stretch and without a difference of speeds; the force begins one tick later.
    fn take_hold(&mut self, device: &Played, handle: &HandlePlace) {
        self.grasp.close(device.position_m, handle.position_m);
        let device_at_handle = self.grasp.scale().at_handle(&self.setup.device);
        self.observer.on_scale(&device_at_handle);
        let moved = self.grasp.moved(device.velocity_m_s);
        self.lag = minus(handle.velocity_m_s, moved);
        self.target = handle.position_m;
    }

    fn given(&self) -> CouplingStep {
        let locked = self.grasp.locked();
        let share = self.grasp.scale().force;
        CouplingStep {
            hand_force_n: self.force,
            device_force_n: std::array::from_fn(|axis| {
                if locked[axis] {
                    0.0
                } else {
                    -share * self.force[axis]
                }
            }),
            target_m: self.target,
            state: self.state(),
        }
    }

    /// The force on the way to none: by as much a tick as brings the greatest there within the ramp.
    fn faded(&self) -> Vector {
        let less_n = self.setup.profile.force_n / self.setup.ramp_s * self.setup.handle.tick_s;
        let force_n = norm(self.force);
        if force_n <= less_n {
            [0.0; 3]
        } else {
            times(self.force, 1.0 - less_n / force_n)
        }
    }

    /// The part of a force on the axes that carry one.
    fn reflected(&self, force: Vector) -> Vector {
        std::array::from_fn(|axis| {
            if axis < self.setup.axes {
                force[axis]
            } else {
                0.0
            }
        })
    }

    /// Whether the handle is a place, and came there at a speed that a handle has.
    fn is_steady(&mut self, now_ns: u64, handle: &HandlePlace) -> bool {
        let tick_s = self.setup.handle.tick_s;
        let since_s = self.last_ns.map_or(tick_s, |last_ns| {
            now_ns.saturating_sub(last_ns) as f64 * 1e-9
        });
        self.last_ns = Some(now_ns);
        if !(is_within(handle.position_m, FARTHEST_M)
            && is_within(handle.velocity_m_s, FASTEST_M_S))
        {
            return false;
        }
        let most_m = self.setup.handle_speed_m_s * since_s.max(tick_s) * ROUNDING;
        // A lift is where the device put it.
        let way_m = self.handle.map_or(0.0, |last| {
            norm(self.reflected(minus(handle.position_m, last)))
        });
        if way_m <= most_m {
            return true;
        }
        self.handle = Some(handle.position_m);
        false
    }

    /// Counts what the force of the last tick did, where both sides were there to be seen.
    fn observe(&mut self, device: Option<Vector>, handle: Option<Vector>) {
        if let Some(handle) = handle {
            let way = self.handle.map_or([0.0; 3], |last| minus(handle, last));
            let device_way = match (device, self.device) {
                (Some(device), Some(last)) => self.grasp.moved(minus(device, last)),
                _ => [0.0; 3],
            };
            self.observer
                .on_tick(self.force, self.reflected(device_way), self.reflected(way));
            self.handle = Some(handle);
        }
        self.device = device;
    }
}

fn observer(setup: &CouplingSetup, scale: &Scale) -> Observer {
    let device = scale.at_handle(&setup.device);
    Observer::new(&device, &setup.handle)
}
