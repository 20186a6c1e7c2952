//! A device as the 1 kHz tick holds it: the virtual coupling, and the tick's ends of the exchange.

use teleclay_device::{DeviceCommand, DeviceProfile, DeviceSample, Feedback};
use teleclay_impedance::{GraspState, ImpedanceHandle};

use crate::exchange::{Marks, News, Order, TickEnds};
use crate::fault::DeviceFault;
use crate::profile::{Hardware, SessionNeeds};

/// A device that was silent for this long has to be taken hold of anew. The coupling has let go long before.
const ANEW_NS: u64 = 250_000_000;
/// One that was silent for this long is lost: its driver hangs.
const LOST_NS: u64 = 2_000_000_000;

/// A device as the tick holds it. Nothing here waits, locks or allocates. It starts released.
///
/// Each tick: [`sample`](Self::sample), then [`command`](Self::command).
#[derive(Debug)]
pub struct Coupled {
    hardware: Hardware,
    handle: ImpedanceHandle,
    ends: TickEnds,
    heard_ns: Option<u64>,
    grip: Grip,
    wants_clay: bool,
}

/// What whoever holds the device wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Grip {
    Open,
    Closed,
    Clutched,
}

impl Coupled {
    /// Released, at home.
    ///
    /// # Errors
    /// No coupling between this device and this session keeps its promises.
    pub fn new(
        hardware: Hardware,
        needs: &SessionNeeds,
        profile: DeviceProfile,
        ends: TickEnds,
    ) -> Result<Self, DeviceFault> {
        let setup = hardware.coupling(needs, profile)?;
        let handle = ImpedanceHandle::new(setup).map_err(|source| DeviceFault::Coupling {
            device: hardware.word(),
            source,
        })?;
        Ok(Self {
            hardware,
            handle,
            ends,
            heard_ns: None,
            grip: Grip::Open,
            wants_clay: false,
        })
    }

    /// What the handle's sensors read at `now_ns`, on the exchange's clock.
    ///
    /// # Errors
    /// The device is lost.
    pub fn sample(&mut self, now_ns: u64) -> Result<DeviceSample, DeviceFault> {
        let heard_ns = *self.heard_ns.get_or_insert(now_ns);
        while let Some(news) = self.ends.poll()? {
            self.take(now_ns, &news);
        }
        if !self.ends.has_driver() {
            return Err(self.lost("its driver has ended"));
        }
        let silence_ns = now_ns.saturating_sub(heard_ns);
        if LOST_NS <= silence_ns {
            return Err(self.lost("it was silent for two seconds"));
        }
        if ANEW_NS <= silence_ns {
            self.let_go();
        }
        Ok(self.handle.sample(now_ns))
    }

    /// Where the handle goes in the tick that begins; the device is told what it renders meanwhile: the coupling's
    /// force, or, where it can only show one, that of the far side on a hand that holds.
    pub fn command(&mut self, now_ns: u64, command: &DeviceCommand) {
        let coupled_n = self.handle.command(command);
        let force_n = match self.hardware.description().feedback {
            Feedback::Force { .. } => coupled_n,
            Feedback::Rumble if self.state() == GraspState::Held => command.force_n,
            Feedback::Rumble => [0.0; 3],
        };
        self.ends.order(Order {
            at_ns: now_ns,
            force_n,
        });
    }

    /// Lets go: whoever holds the device takes hold anew, or nothing moves.
    pub fn let_go(&mut self) {
        self.grip = Grip::Open;
        self.handle.coupling().release();
    }

    /// Whether a fresh block was asked for, once for each time.
    pub fn poll_wants_clay(&mut self) -> bool {
        std::mem::take(&mut self.wants_clay)
    }

    /// Who holds the handle.
    pub fn state(&mut self) -> GraspState {
        self.handle.coupling().state()
    }

    fn take(&mut self, now_ns: u64, news: &News) {
        self.heard_ns = Some(now_ns);
        let coupling = self.handle.coupling();
        coupling.sample(now_ns, news.at_ns, news.position_m);
        let Marks {
            takes_hold,
            lets_go,
            clutches,
            unclutches,
            wants_clay,
        } = news.marks;
        if lets_go {
            self.grip = Grip::Open;
            coupling.release();
        }
        if clutches && self.grip == Grip::Closed {
            self.grip = Grip::Clutched;
            coupling.clutch();
        }
        if takes_hold || (unclutches && self.grip == Grip::Clutched) {
            self.grip = Grip::Closed;
            coupling.hold();
        }
        self.wants_clay |= wants_clay;
    }

    fn lost(&self, reason: &str) -> DeviceFault {
        DeviceFault::Lost {
            device: self.hardware.word(),
            reason: reason.to_owned(),
        }
    }
}
