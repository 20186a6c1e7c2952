//! What things are called: topics, services, and frames by REP 105.
//!
//! A session's names begin with `/teleclay/<session>`, where the session's id is spelled so that ROS 2 takes it
//! ([`spelled`]). Frames begin without the slash:
//!
//! | frame | is |
//! |---|---|
//! | `teleclay/<session>` | fixed to the clay: origin in a lower corner of the block, z up |
//! | `teleclay/<session>/tool_<n>` | moves with the tool, and is never turned |
//! | `teleclay/<session>/handle_<n>` | the handle's own: origin where the handle rests, which is where the tool starts |
//!
//! Poses and velocities of a tool are in the clay's frame, its force in the tool's; all of a handle in the handle's.

use crate::message::Message;
use crate::own::{Clay, Corrections, Energy, Event, HandleFrame, Link, Record, Settings, TickTime};
use crate::standard::{DiagnosticArray, PoseStamped, TfMessage, TwistStamped, WrenchStamped};

/// A topic, and the type of its messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, with the leading slash.
    pub name: String,
    /// Full name of the type, such as `geometry_msgs/msg/PoseStamped`.
    pub message: &'static str,
}

impl Topic {
    fn of<M: Message>(name: String) -> Self {
        Self {
            name,
            message: M::NAME,
        }
    }
}

/// Where frames lie in each other.
#[must_use]
pub fn tf() -> Topic {
    Topic::of::<TfMessage<'_>>("/tf".to_owned())
}

/// How the parts are doing.
#[must_use]
pub fn diagnostics() -> Topic {
    Topic::of::<DiagnosticArray<'_>>("/diagnostics".to_owned())
}

macro_rules! topics {
    (
        $(#[$about:meta])*
        $type:ident
        $($(#[$about_topic:meta])* $topic:ident: $message:ty,)*
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq, Eq)]
        pub struct $type {
            $($(#[$about_topic])* pub $topic: Topic,)*
        }

        impl $type {
            fn under(folder: &str) -> Self {
                Self {
                    $($topic: Topic::of::<$message>(format!("{folder}/{}", stringify!($topic))),)*
                }
            }

            /// All of them.
            pub fn iter(&self) -> impl Iterator<Item = &Topic> {
                [$(&self.$topic),*].into_iter()
            }
        }
    };
}

topics! {
    /// The topics of one tool.
    ToolTopics
    /// Handle in the handle's frame.
    handle_pose: PoseStamped<'_>,
    /// Tool in the clay's frame.
    tool_pose: PoseStamped<'_>,
    /// Velocity of the handle.
    handle_twist: TwistStamped<'_>,
    /// Velocity of the tool.
    tool_twist: TwistStamped<'_>,
    /// Force of the hand on the handle.
    hand_wrench: WrenchStamped<'_>,
    /// Force of the handle on the hand.
    felt_wrench: WrenchStamped<'_>,
    /// Force of the clay on the tool.
    tool_wrench: WrenchStamped<'_>,
    /// The line to whoever holds it.
    link: Link<'_>,
    /// Energy that flowed into that line.
    energy: Energy,
    /// What corrections do to the hand.
    corrections: Corrections,
    /// Frames of the handle, only in recordings.
    handle_frame: HandleFrame<'_>,
}

topics! {
    /// The topics of one session.
    SessionTopics
    /// What happened.
    events: Event<'_>,
    /// What it is set to.
    settings: Settings<'_>,
    /// The clay at some moments, only in recordings.
    clay: Clay<'_>,
    /// Records of its history, only in recordings.
    history: Record<'_>,
    /// When each tick was, only in recordings.
    ticks: TickTime,
}

/// The topics of a tool, numbered from 1.
#[must_use]
pub fn topics(session: &str, tool: u32) -> ToolTopics {
    ToolTopics::under(&format!("/{}/tool_{tool}", clay_frame(session)))
}

/// The topics of a session besides those of its tools.
#[must_use]
pub fn session_topics(session: &str) -> SessionTopics {
    SessionTopics::under(&format!("/{}", clay_frame(session)))
}

/// The name of a service of a session, such as `pause`.
#[must_use]
pub fn service(session: &str, name: &str) -> String {
    format!("/{}/{name}", clay_frame(session))
}

/// The frame that is fixed to the clay.
#[must_use]
pub fn clay_frame(session: &str) -> String {
    format!("teleclay/{}", spelled(session))
}

/// The frame that moves with a tool.
#[must_use]
pub fn tool_frame(session: &str, tool: u32) -> String {
    format!("{}/tool_{tool}", clay_frame(session))
}

/// The frame of the handle that holds a tool.
#[must_use]
pub fn handle_frame(session: &str, tool: u32) -> String {
    format!("{}/handle_{tool}", clay_frame(session))
}

/// A session's id as a part of ROS 2's names, which know letters, digits and underscores, begin with no digit, and are
/// hidden from lists where they begin with an underscore: what is none of these becomes an underscore, and `s` goes
/// before what may not stand first.
#[must_use]
pub fn spelled(session: &str) -> String {
    let mut name: String = session
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        name.insert(0, 's');
    }
    name
}
