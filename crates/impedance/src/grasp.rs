//! Who holds the handle: what is wished, what is in force, and where the grip is.
//!
//! The device's place `p` draws the handle to `x_d = scale p + grip`. Taking hold chooses the grip so that the spring
//! is not stretched. Everything that would change `x_d` at once, or what the device feels of a force, waits until the
//! force has faded: letting go, the clutch, another scale, another lock. So there is one way from any state to any
//! other, by way of rest, and no force steps on it.

use crate::scale::Scale;
use crate::vector::{Vector, minus, plus, times};

/// Who holds the handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GraspState {
    /// Nobody holds it.
    Released,
    /// The device; it has not been heard of yet, or not for a while, or the handle stands nowhere. It takes hold by
    /// itself as soon as both are there.
    Waiting,
    /// The device, through the spring.
    Held,
    /// Nobody any more, or not yet anew: the force fades.
    LettingGo,
    /// The clutch is out: the device moves without the handle.
    Clutched,
    /// The force came to where the coupling stops. It waits to be taken hold of.
    Stopped,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wish {
    Release,
    Hold,
    Clutch,
    Stop,
}

/// What holds the handle, and what shall.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grasp {
    wish: Wish,
    /// In force, and the ones to come.
    scale: Scale,
    next_scale: Scale,
    locked: [bool; 3],
    next_locked: [bool; 3],
    grip: Option<Vector>,
}

impl Grasp {
    pub(crate) fn new(scale: Scale) -> Self {
        Self {
            wish: Wish::Release,
            scale,
            next_scale: scale,
            locked: [false; 3],
            next_locked: [false; 3],
            grip: None,
        }
    }

    pub(crate) fn wish(&mut self, wish: Wish) {
        self.wish = wish;
    }

    pub(crate) fn is_holding(&self) -> bool {
        self.wish == Wish::Hold
    }

    pub(crate) fn set_scale(&mut self, scale: Scale) {
        self.next_scale = scale;
    }

    pub(crate) fn lock_axes(&mut self, locked: [bool; 3]) {
        self.next_locked = locked;
    }

    pub(crate) fn scale(&self) -> Scale {
        self.scale
    }

    pub(crate) fn locked(&self) -> [bool; 3] {
        self.locked
    }

    /// Whether the spring may stay as it is.
    pub(crate) fn stays(&self) -> bool {
        self.wish == Wish::Hold && self.scale == self.next_scale && self.locked == self.next_locked
    }

    /// Lets go. The force is for the coupling to fade.
    pub(crate) fn open(&mut self) {
        self.grip = None;
    }

    /// Where the handle is drawn to with the device at `place`, if it is held.
    pub(crate) fn target(&self, place: Vector) -> Option<Vector> {
        self.grip.map(|grip| plus(self.moved(place), grip))
    }

    /// Takes hold of a handle at `handle` with the device at `place`, without a stretch: what was to come is in force.
    pub(crate) fn close(&mut self, place: Vector, handle: Vector) {
        self.scale = self.next_scale;
        self.locked = self.next_locked;
        self.grip = Some(minus(handle, self.moved(place)));
    }

    /// The device's motion as the handle shall follow it: none along what is locked.
    pub(crate) fn moved(&self, device: Vector) -> Vector {
        let scaled = times(device, self.scale.motion);
        std::array::from_fn(|axis| if self.locked[axis] { 0.0 } else { scaled[axis] })
    }

    pub(crate) fn state(&self, is_fading: bool) -> GraspState {
        match (self.grip.is_some(), is_fading, self.wish) {
            (true, _, _) => GraspState::Held,
            (false, true, _) => GraspState::LettingGo,
            (false, false, Wish::Hold) => GraspState::Waiting,
            (false, false, Wish::Clutch) => GraspState::Clutched,
            (false, false, Wish::Stop) => GraspState::Stopped,
            (false, false, Wish::Release) => GraspState::Released,
        }
    }
}
