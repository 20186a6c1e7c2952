//! Who hears what a session does.

use teleclay_link::time::Timestamp;
use teleclay_proto::frame::HandleFrame;
use teleclay_session::{Event, Session};

use super::Rig;

/// Hears what a session does: what a recording is made of.
pub trait Ear: Send {
    /// A frame has come to the tool side in `slot`, as [`Session::tick_heard`] tells.
    fn on_frame(&mut self, slot: usize, arrived: Timestamp, frame: &HandleFrame);

    /// A tick is over. `events` are all that the session has told since the one before.
    fn on_tick(&mut self, session: &mut Session, now: Timestamp, events: &[Event]);
}

impl Rig {
    /// Has somebody hear what the session does from the next tick on; gives back who did so far.
    pub fn hear_with(&mut self, ear: Option<Box<dyn Ear>>) -> Option<Box<dyn Ear>> {
        std::mem::replace(&mut self.ear, ear)
    }
}
