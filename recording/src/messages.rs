//! What a recording says of a tool in a tick, topic by topic.

use teleclay_ros::standard::{
    Header, Pose, PoseStamped, Time, Transform, TransformStamped, Twist, TwistStamped, Vector3,
    Wrench, WrenchStamped,
};
use teleclay_ros::{names, own, to_cdr};

use crate::tick::Seen;

/// The frames of one tool.
pub(crate) struct Frames {
    clay: String,
    tool: String,
    handle: String,
}

impl Frames {
    pub(crate) fn new(session: &str, tool: u32) -> Self {
        Self {
            clay: names::clay_frame(session),
            tool: names::tool_frame(session, tool),
            handle: names::handle_frame(session, tool),
        }
    }

    /// Writes each of [`TOPICS`] in turn into `bytes` and gives it to `each`, with its place among them.
    pub(crate) fn tell<E>(
        &self,
        seen: &Seen,
        (stamp_ns, operator_name): (u64, &str),
        bytes: &mut Vec<u8>,
        mut each: impl FnMut(usize, &[u8]) -> Result<(), E>,
    ) -> Result<(), E> {
        let (view, stamp) = (&seen.view, Time::from_ns(stamp_ns));
        let header = |frame_id| Header { stamp, frame_id };
        let poses = [
            (&self.handle, view.handle_position_m),
            (&self.clay, view.position_m),
        ];
        for (at, (frame, position_m)) in poses.into_iter().enumerate() {
            let pose = PoseStamped {
                header: header(frame),
                pose: Pose {
                    position: position_m.into(),
                    ..Pose::default()
                },
            };
            to_cdr(&pose, bytes);
            each(at, bytes)?;
        }
        let twists = [
            (&self.handle, view.handle_velocity_m_s),
            (&self.clay, view.velocity_m_s),
        ];
        for (at, (frame, velocity_m_s)) in twists.into_iter().enumerate() {
            let twist = TwistStamped {
                header: header(frame),
                twist: Twist {
                    linear: velocity_m_s.into(),
                    ..Twist::default()
                },
            };
            to_cdr(&twist, bytes);
            each(2 + at, bytes)?;
        }
        let wrenches = [
            (&self.handle, view.hand_force_n),
            (&self.handle, view.felt_force_n),
            (&self.tool, view.force_n),
        ];
        for (at, (frame, force_n)) in wrenches.into_iter().enumerate() {
            let wrench = WrenchStamped {
                header: header(frame),
                wrench: Wrench {
                    force: force_n.into(),
                    ..Wrench::default()
                },
            };
            to_cdr(&wrench, bytes);
            each(4 + at, bytes)?;
        }
        let link = own::Link {
            stamp,
            rtt_s: seen.rtt_s.unwrap_or(f64::NAN),
            age_s: seen.age_s,
            connected: seen.is_connected,
            operator_name,
        };
        to_cdr(&link, bytes);
        each(7, bytes)?;
        let energy = own::Energy {
            stamp,
            handle_j: view.energy_handle_j,
            tool_j: view.energy_tool_j,
        };
        to_cdr(&energy, bytes);
        each(8, bytes)?;
        let held = view.corrections.held_n.map(f64::from);
        let corrections = own::Corrections {
            stamp,
            step_n: view.corrections.moved_n,
            held_n: held.iter().map(|n| n * n).sum::<f64>().sqrt(),
        };
        to_cdr(&corrections, bytes);
        each(9, bytes)
    }

    /// Where the tool is, among the frames.
    pub(crate) fn transform(&self, seen: &Seen, stamp_ns: u64) -> TransformStamped<'_> {
        TransformStamped {
            header: Header {
                stamp: Time::from_ns(stamp_ns),
                frame_id: &self.clay,
            },
            child_frame_id: &self.tool,
            transform: Transform {
                translation: Vector3::from(seen.view.position_m),
                ..Transform::default()
            },
        }
    }
}

/// Last words of the topics that show a tool, in the order in which they are told.
pub(crate) const TOPICS: [&str; 10] = [
    "handle_pose",
    "tool_pose",
    "handle_twist",
    "tool_twist",
    "hand_wrench",
    "felt_wrench",
    "tool_wrench",
    "link",
    "energy",
    "corrections",
];
