//! The messages of the package `teleclay_msgs`: what ROS 2 has no type for. Their texts, from which ROS 2 makes its own
//! classes, lie in `ros2/teleclay_msgs`.

use crate::message::message;
use crate::standard::Time;

message! {
    /// The line between a tool and whoever holds it, as the tool's side knows it.
    #[derive(Copy)]
    "teleclay_msgs/msg/Link" Link<'a> {
        /// Time of day.
        stamp: Time,
        /// Round trip, s; 0 before one was measured.
        rtt_s: f64,
        /// Time since the newest frame of the handle came, s.
        age_s: f64,
        /// Whether somebody holds the tool and frames come.
        connected: bool,
        /// Who holds the tool; empty while it is free.
        operator_name: &'a str,
    }
}

message! {
    /// What flowed into the line at its two ends, less what left it there.
    #[derive(Copy)]
    "teleclay_msgs/msg/Energy" Energy {
        /// Time of day.
        stamp: Time,
        /// At the handle, J.
        handle_j: f64,
        /// At the tool, J.
        tool_j: f64,
    }
}

message! {
    /// What corrections of the handle's copy of the clay do to the hand.
    #[derive(Copy)]
    "teleclay_msgs/msg/Corrections" Corrections {
        /// Time of day.
        stamp: Time,
        /// How far they have moved the felt force since the message before, N.
        step_n: f64,
        /// How far the felt force still is from what the corrected copy gives, N.
        held_n: f64,
    }
}

message! {
    /// Something that happened in a session.
    #[derive(Copy, Eq)]
    "teleclay_msgs/msg/Event" Event<'a> {
        /// Time of day.
        stamp: Time,
        /// [`Event::INFO`], [`Event::WARNING`] or [`Event::ERROR`].
        level: u8,
        /// What happened, for people.
        text: &'a str,
    }
}

impl Event<'_> {
    /// Nothing to do.
    pub const INFO: u8 = 0;
    /// Somebody should look.
    pub const WARNING: u8 = 1;
    /// Something went wrong.
    pub const ERROR: u8 = 2;
}

message! {
    /// What a session is set to from here on.
    #[derive(Copy, Eq)]
    "teleclay_msgs/msg/Settings" Settings<'a> {
        /// Time of day.
        stamp: Time,
        /// Counts the changes of the session.
        revision: u64,
        /// The settings and the parameters of the loop.
        json: &'a str,
    }
}

message! {
    /// A frame of a handle as the server decoded it.
    #[derive(Copy, Eq)]
    "teleclay_msgs/msg/HandleFrame" HandleFrame<'a> {
        /// When it came, on the clock of the loop, ns.
        arrived_ns: u64,
        /// The frame, in the layout of the protocol.
        bytes: &'a [u8],
    }
}

message! {
    /// When a tick of the loop was.
    #[derive(Copy, Eq)]
    "teleclay_msgs/msg/TickTime" TickTime {
        /// Its number since the session began.
        tick: u64,
        /// The time that the loop was given, on its own clock, ns.
        now_ns: u64,
        /// Messages that the recording has lost so far.
        dropped: u64,
    }
}

message! {
    /// One record of a session's history.
    #[derive(Copy, Eq)]
    "teleclay_msgs/msg/Record" Record<'a> {
        /// The record, in the layout of the journal.
        bytes: &'a [u8],
    }
}

message! {
    /// All of the clay at one moment.
    #[derive(Copy, Eq)]
    "teleclay_msgs/msg/Clay" Clay<'a> {
        /// Counts the blocks that the session has had.
        epoch: u32,
        /// Hash of the clay.
        hash: u64,
        /// What the bytes are.
        format: &'a str,
        /// The clay.
        bytes: &'a [u8],
    }
}

message! {
    /// Asks for another scheme.
    #[derive(Copy, Eq)]
    "teleclay_msgs/srv/SetScheme_Request" SetSchemeRequest<'a> {
        /// Its word, such as `replica`.
        scheme: &'a str,
    }
}

message! {
    /// Whether it is.
    #[derive(Copy, Eq)]
    "teleclay_msgs/srv/SetScheme_Response" SetSchemeResponse<'a> {
        /// Whether it was done.
        success: bool,
        /// Why not, or what is now.
        message: &'a str,
    }
}
