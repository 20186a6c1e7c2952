//! Which axis and which button means what. Codes are those of Linux's `input-event-codes.h`.

use super::port::PadNature;
use crate::profile::Hardware;

/// `ABS_X`: to the right.
pub const X: u16 = 0x00;
/// `ABS_Y`: towards the hand.
pub const Y: u16 = 0x01;
/// `ABS_Z`: the left trigger of most gamepads.
pub const Z: u16 = 0x02;
/// `ABS_RX`: the right stick, to the right.
pub const RX: u16 = 0x03;
/// `ABS_RY`: the right stick, towards the hand.
pub const RY: u16 = 0x04;
/// `ABS_RZ`: the right trigger of most gamepads, the twist of most joysticks.
pub const RZ: u16 = 0x05;
/// `ABS_THROTTLE`: a lever.
pub const THROTTLE: u16 = 0x06;

/// `BTN_TRIGGER`: what has it is a joystick.
pub const TRIGGER: u16 = 0x120;
/// `BTN_THUMB`: clutch of a joystick.
pub const THUMB: u16 = 0x121;
/// `BTN_THUMB2`: lets go.
pub const THUMB2: u16 = 0x122;
/// `BTN_TOP`: fresh clay.
pub const TOP: u16 = 0x123;
/// `BTN_SOUTH`: what has it is a gamepad.
pub const SOUTH: u16 = 0x130;
/// `BTN_EAST`: lets go.
pub const EAST: u16 = 0x131;
/// `BTN_TL`: clutch of a gamepad.
pub const SHOULDER: u16 = 0x136;
/// `BTN_START`: fresh clay.
pub const START: u16 = 0x13b;

/// What lifts the tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lift {
    /// A stick that springs back, with its low end up, as axes count.
    Stick(u16),
    /// A stick and two triggers: one that lifts, one that lowers.
    StickAndTriggers {
        /// The stick.
        stick: u16,
        /// The trigger that lifts.
        up: u16,
        /// The trigger that lowers.
        down: u16,
    },
}

/// What the buttons of a device do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Buttons {
    /// Takes hold.
    pub hold: u16,
    /// Lets go.
    pub release: u16,
    /// Clutch, while it is down.
    pub clutch: u16,
    /// Asks for fresh clay.
    pub clay: u16,
}

/// Which axis and which button of a device means what. The place's own axes are always [`X`] and [`Y`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// What lifts.
    pub lift: Lift,
    /// The buttons.
    pub buttons: Buttons,
}

impl Layout {
    /// The layout of a device of this kind; `None` where nothing could lift the tool.
    #[must_use]
    pub fn of(hardware: Hardware, nature: &PadNature) -> Option<Self> {
        let has = |code: u16| nature.axes.contains(&code);
        match hardware {
            Hardware::Haply => None,
            Hardware::Gamepad => {
                let lift = if has(RY) && has(Z) && has(RZ) {
                    Lift::StickAndTriggers {
                        stick: RY,
                        up: Z,
                        down: RZ,
                    }
                } else {
                    Lift::Stick([RY, RZ].into_iter().find(|&code| has(code))?)
                };
                Some(Self {
                    lift,
                    buttons: Buttons {
                        hold: SOUTH,
                        release: EAST,
                        clutch: SHOULDER,
                        clay: START,
                    },
                })
            }
            Hardware::Joystick => {
                let lift = [THROTTLE, RZ, Z].into_iter().find(|&code| has(code))?;
                Some(Self {
                    lift: Lift::Stick(lift),
                    buttons: Buttons {
                        hold: TRIGGER,
                        release: THUMB2,
                        clutch: THUMB,
                        clay: TOP,
                    },
                })
            }
        }
    }
}

/// Whether a device is of this kind at all.
#[must_use]
pub fn is_of(hardware: Hardware, nature: &PadNature) -> bool {
    let has_stick = nature.axes.contains(&X) && nature.axes.contains(&Y);
    let mark = match hardware {
        Hardware::Gamepad => SOUTH,
        Hardware::Joystick => TRIGGER,
        Hardware::Haply => return false,
    };
    has_stick && nature.keys.contains(&mark)
}
