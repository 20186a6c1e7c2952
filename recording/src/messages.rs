//! What a recording says of a tool in a tick, topic by topic.

use teleclay_ros::standard::{
    Header, Pose, PoseStamped, Time, Transform, TransformStamped, Twist, TwistStamped, Vector3,
    Wrench, WrenchStamped,
};
use teleclay_ros::{names, own, to_cdr};

use crate::tick::Seen;

/// What is told beside what was seen of a tool in a tick.
#[derive(Clone, Copy)]
pub(crate) struct Beside<'a> {
    pub(crate) stamp_ns: u64,
    pub(crate) operator_name: &'a str,
    /// How far corrections have moved the force since the message before, N.
    pub(crate) step_n: f64,
}

/// Corrections add up over a lease; a message tells what has come since the one before.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Moved(Option<(u32, f64)>);

impl Moved {
    /// How far corrections have moved the force since the last call, N.
    pub(crate) fn step_n(&mut self, seen: &Seen) -> f64 {
        let moved_n = seen.view.corrections.moved_n;
        let before_n = match self.0.replace((seen.lease, moved_n)) {
            Some((lease, before_n)) if lease == seen.lease => before_n,
            Some(_) => 0.0,
            // What had come before the recording began is in no message of it.
            None => moved_n,
        };
        // A copy that was made anew counts from zero.
        if moved_n < before_n {
            moved_n
        } else {
            moved_n - before_n
        }
    }
}

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

    /// Writes each of [`SHOWN`](teleclay_reel::format::SHOWN) in turn into `bytes` and gives it to `each`, with its
    /// place among them.
    pub(crate) fn tell<E>(
        &self,
        seen: &Seen,
        Beside {
            stamp_ns,
            operator_name,
            step_n,
        }: Beside<'_>,
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
            // What the tool puts into the clay has left the line.
            tool_j: -view.energy_tool_j,
        };
        to_cdr(&energy, bytes);
        each(8, bytes)?;
        let held = view.corrections.held_n.map(f64::from);
        let corrections = own::Corrections {
            stamp,
            step_n,
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

#[cfg(test)]
#[allow(clippy::float_cmp)] // a few binary fractions, whose differences are exact
mod tests {
    use super::*;

    /// Where a message's numbers begin: behind the header of CDR and a stamp.
    const NUMBERS: usize = 12;

    fn numbers(bytes: &[u8]) -> [f64; 2] {
        let number = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        [number(NUMBERS), number(NUMBERS + 8)]
    }

    fn told(seen: &Seen, step_n: f64) -> Vec<Vec<u8>> {
        let mut all = Vec::new();
        let beside = Beside {
            stamp_ns: 0,
            operator_name: "Ada",
            step_n,
        };
        let told = Frames::new("demo", 1).tell(seen, beside, &mut Vec::new(), |_, bytes| {
            all.push(bytes.to_vec());
            Ok::<(), std::convert::Infallible>(())
        });
        told.unwrap();
        all
    }

    /// The signs of `teleclay_msgs/msg/Energy`: a tool that has put 0.25 J into the clay has taken them from the line.
    #[test]
    fn energy_that_went_into_the_clay_has_left_the_line() {
        let mut seen = Seen::default();
        (seen.view.energy_handle_j, seen.view.energy_tool_j) = (0.5, 0.25);
        assert_eq!(numbers(&told(&seen, 0.0)[8]), [0.5, -0.25]);
    }

    #[test]
    fn corrections_are_told_as_what_has_come_since_the_message_before() {
        let mut moved = Moved::default();
        let steps = [(7, 1.5), (7, 1.5), (7, 2.0), (7, 0.25), (8, 3.0), (8, 3.5)];
        let told_n = steps.map(|(lease, moved_n)| {
            let mut seen = Seen {
                lease,
                ..Seen::default()
            };
            seen.view.corrections.moved_n = moved_n;
            let [step_n, _] = numbers(&told(&seen, moved.step_n(&seen))[9]);
            step_n
        });
        assert_eq!(told_n, [0.0, 0.0, 0.5, 0.25, 3.0, 0.5]);
    }
}
