//! Why a device cannot be used: where it was looked for, and what to do.

use teleclay_impedance::SetupError;

/// Why a device cannot be used, or no longer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DeviceFault {
    /// No such device is there.
    #[error("no {device} is there, looked {looked}: {advice}")]
    NotFound {
        /// What was wanted.
        device: &'static str,
        /// Where, in words.
        looked: String,
        /// What to do.
        advice: &'static str,
    },
    /// Somebody else has it.
    #[error(
        "the {device} at {place} is in use by another program: close that program and start again"
    )]
    Busy {
        /// What was wanted.
        device: &'static str,
        /// Where it is.
        place: String,
    },
    /// This user may not open it.
    #[error(
        "no permission to open the {device} at {place}: add this user to the group `input` and log in again, or start from the seat that the device is plugged into"
    )]
    NoPermission {
        /// What was wanted.
        device: &'static str,
        /// Where it is, or would be.
        place: String,
    },
    /// The service that speaks to the device does not answer.
    #[error(
        "no Haply Inverse Service at {place} ({reason}): start it, with the Haply Hub or by `systemctl start haply-inverse-service`, or name its address with --haply-url"
    )]
    NoService {
        /// Its address.
        place: String,
        /// In the system's words.
        reason: String,
    },
    /// The address is none, or one of another machine.
    #[error(
        "`{got}` is not an address of a Haply Inverse Service on this machine, want ws://localhost:PORT"
    )]
    Address {
        /// As given.
        got: String,
    },
    /// A stick without motors.
    #[error(
        "the joystick `{name}` at {place} has no constant force (FF_CONSTANT), and nothing else renders a force: take one that has"
    )]
    CannotForce {
        /// In its own words.
        name: String,
        /// Where it is.
        place: String,
    },
    /// A stick that could move the tool nowhere but level.
    #[error(
        "the {device} `{name}` at {place} has neither lever, twist nor trigger that could lift the tool: take one that has"
    )]
    CannotLift {
        /// What was wanted.
        device: &'static str,
        /// In its own words.
        name: String,
        /// Where it is.
        place: String,
    },
    /// The session reflects more axes than the device has motors for.
    #[error(
        "the {device} renders force on {axes} axes and the session reflects {wanted}: what pushes along the others would be felt nowhere; join a session with `axes` {axes}, or take another device"
    )]
    TooFewAxes {
        /// What it is.
        device: &'static str,
        /// It renders force on so many.
        axes: usize,
        /// The session reflects so many.
        wanted: usize,
    },
    /// No coupling between this device and this session's handle keeps its promises.
    #[error("the {device} cannot hold this session's handle: {source}")]
    Coupling {
        /// What it is.
        device: &'static str,
        /// Which promise.
        source: SetupError,
    },
    /// The system gave no thread.
    #[error("no thread for the {device}: {reason}")]
    Thread {
        /// What it is.
        device: &'static str,
        /// In the system's words.
        reason: String,
    },
    /// It was there.
    #[error("the {device} is lost: {reason}")]
    Lost {
        /// What it is.
        device: &'static str,
        /// What was seen.
        reason: String,
    },
}
