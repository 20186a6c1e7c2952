//! The messages of ROS 2 that are used: `builtin_interfaces`, `std_msgs`, `geometry_msgs`, `tf2_msgs`,
//! `diagnostic_msgs` and `std_srvs`. Units are REP 103's: metres, radians, seconds, newtons; frames are right-handed, z
//! up.

use crate::cdr::{Cdr, CdrError, CdrReader};
use crate::message::{FromCdr, Message, message};

const NS_PER_S: u64 = 1_000_000_000;

message! {
    /// A moment, or a time since something began.
    #[derive(Copy, Eq)]
    "builtin_interfaces/msg/Time" Time {
        /// Whole seconds.
        sec: i32,
        /// The rest, ns, below a second.
        nanosec: u32,
    }
}

impl Time {
    /// The moment so many nanoseconds after 1970, or after whatever the time counts from.
    #[must_use]
    pub fn from_ns(ns: u64) -> Self {
        Self {
            // ROS 2 has no seconds beyond the year 2038.
            sec: i32::try_from(ns / NS_PER_S).unwrap_or(i32::MAX),
            nanosec: (ns % NS_PER_S) as u32,
        }
    }
}

message! {
    /// When a measurement was taken, and in which frame it is meant.
    #[derive(Copy, Eq)]
    "std_msgs/msg/Header" Header<'a> {
        /// Time of day.
        stamp: Time,
        /// The frame, see [`crate::names`].
        frame_id: &'a str,
    }
}

message! {
    /// A text.
    #[derive(Copy, Eq)]
    "std_msgs/msg/String" Text<'a> {
        /// The text.
        data: &'a str,
    }
}

message! {
    /// A place, m.
    #[derive(Copy)]
    "geometry_msgs/msg/Point" Point {
        /// Along x.
        x: f64,
        /// Along y.
        y: f64,
        /// Along z.
        z: f64,
    }
}

message! {
    /// A direction with a length; its unit is that of what it stands for.
    #[derive(Copy)]
    "geometry_msgs/msg/Vector3" Vector3 {
        /// Along x.
        x: f64,
        /// Along y.
        y: f64,
        /// Along z.
        z: f64,
    }
}

impl From<[f64; 3]> for Point {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<[f64; 3]> for Vector3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

/// A rotation as a unit quaternion; by default none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quaternion {
    /// The axis times the sine of half the angle, along x.
    pub x: f64,
    /// The same along y.
    pub y: f64,
    /// The same along z.
    pub z: f64,
    /// Cosine of half the angle.
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self {
            x: 0.0,
            y: 0.0,
            z: 0.0,
            w: 1.0,
        }
    }
}

impl Message for Quaternion {
    const NAME: &'static str = "geometry_msgs/msg/Quaternion";

    fn write(&self, cdr: &mut Cdr<'_>) {
        for part in [self.x, self.y, self.z, self.w] {
            cdr.f64(part);
        }
    }
}

impl FromCdr<'_> for Quaternion {
    fn read(cdr: &mut CdrReader<'_>) -> Result<Self, CdrError> {
        Ok(Self {
            x: cdr.f64()?,
            y: cdr.f64()?,
            z: cdr.f64()?,
            w: cdr.f64()?,
        })
    }
}

message! {
    /// Where something is, and how it is turned.
    #[derive(Copy)]
    "geometry_msgs/msg/Pose" Pose {
        /// Where, m.
        position: Point,
        /// How it is turned.
        orientation: Quaternion,
    }
}

message! {
    /// Where something is at a moment.
    #[derive(Copy)]
    "geometry_msgs/msg/PoseStamped" PoseStamped<'a> {
        /// When, and in which frame.
        header: Header<'a>,
        /// Where it is.
        pose: Pose,
    }
}

message! {
    /// How fast something moves.
    #[derive(Copy)]
    "geometry_msgs/msg/Twist" Twist {
        /// Velocity, m/s.
        linear: Vector3,
        /// Angular velocity, rad/s.
        angular: Vector3,
    }
}

message! {
    /// How fast something moves at a moment.
    #[derive(Copy)]
    "geometry_msgs/msg/TwistStamped" TwistStamped<'a> {
        /// When, and in which frame.
        header: Header<'a>,
        /// How fast.
        twist: Twist,
    }
}

message! {
    /// What pushes and turns something.
    #[derive(Copy)]
    "geometry_msgs/msg/Wrench" Wrench {
        /// Force, N.
        force: Vector3,
        /// Torque, N·m.
        torque: Vector3,
    }
}

message! {
    /// What pushes and turns something at a moment.
    #[derive(Copy)]
    "geometry_msgs/msg/WrenchStamped" WrenchStamped<'a> {
        /// When, and in which frame.
        header: Header<'a>,
        /// Force and torque.
        wrench: Wrench,
    }
}

message! {
    /// From one frame into another.
    #[derive(Copy)]
    "geometry_msgs/msg/Transform" Transform {
        /// Where the child's origin is, m.
        translation: Vector3,
        /// How the child is turned.
        rotation: Quaternion,
    }
}

message! {
    /// Where a frame lies in another at a moment.
    #[derive(Copy)]
    "geometry_msgs/msg/TransformStamped" TransformStamped<'a> {
        /// When, and in which frame.
        header: Header<'a>,
        /// The frame that lies in it.
        child_frame_id: &'a str,
        /// Where it lies.
        transform: Transform,
    }
}

message! {
    /// Frames in frames.
    "tf2_msgs/msg/TFMessage" TfMessage<'a> {
        /// One per child frame.
        transforms: Vec<TransformStamped<'a>>,
    }
}

message! {
    /// A value under a name.
    #[derive(Copy, Eq)]
    "diagnostic_msgs/msg/KeyValue" KeyValue<'a> {
        /// The name.
        key: &'a str,
        /// The value.
        value: &'a str,
    }
}

message! {
    /// How one part is doing.
    #[derive(Eq)]
    "diagnostic_msgs/msg/DiagnosticStatus" DiagnosticStatus<'a> {
        /// [`DiagnosticStatus::OK`], [`DiagnosticStatus::WARN`], [`DiagnosticStatus::ERROR`] or
        /// [`DiagnosticStatus::STALE`].
        level: u8,
        /// What it is.
        name: &'a str,
        /// How it is.
        message: &'a str,
        /// What tells it from others of its kind.
        hardware_id: &'a str,
        /// The figures.
        values: Vec<KeyValue<'a>>,
    }
}

impl DiagnosticStatus<'_> {
    /// It does what it should.
    pub const OK: u8 = 0;
    /// It goes on, but should be looked at.
    pub const WARN: u8 = 1;
    /// It does not.
    pub const ERROR: u8 = 2;
    /// Nothing has been heard of it for too long.
    pub const STALE: u8 = 3;
}

message! {
    /// How the parts are doing.
    #[derive(Eq)]
    "diagnostic_msgs/msg/DiagnosticArray" DiagnosticArray<'a> {
        /// Time of day.
        header: Header<'a>,
        /// One per part.
        status: Vec<DiagnosticStatus<'a>>,
    }
}

message! {
    /// Asks for something to be on or off.
    #[derive(Copy, Eq)]
    "std_srvs/srv/SetBool_Request" SetBoolRequest {
        /// On, or off.
        data: bool,
    }
}

message! {
    /// Whether it is.
    #[derive(Copy, Eq)]
    "std_srvs/srv/SetBool_Response" SetBoolResponse<'a> {
        /// Whether it was done.
        success: bool,
        /// Why not, or what is now.
        message: &'a str,
    }
}

/// Asks for something to happen, and says nothing else. A message without fields has a byte that means nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TriggerRequest;

impl Message for TriggerRequest {
    const NAME: &'static str = "std_srvs/srv/Trigger_Request";

    fn write(&self, cdr: &mut Cdr<'_>) {
        cdr.u8(0);
    }
}

impl FromCdr<'_> for TriggerRequest {
    /// Some write no byte at all.
    fn read(_: &mut CdrReader<'_>) -> Result<Self, CdrError> {
        Ok(Self)
    }
}

message! {
    /// Whether it has happened.
    #[derive(Copy, Eq)]
    "std_srvs/srv/Trigger_Response" TriggerResponse<'a> {
        /// Whether it was done.
        success: bool,
        /// Why not, or what is now.
        message: &'a str,
    }
}
