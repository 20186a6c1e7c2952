//! Another lease, and other parameters, for a loop that goes on.

use std::sync::Arc;

use teleclay_bilateral::{
    Known, Lease, ParameterError, is_nothing_new, is_same_loop, lower, tool_setup,
};
use teleclay_link::time::Timestamp;
use teleclay_proto::http::parse;
use teleclay_proto::join::LoopParameters;
use teleclay_seal::{Channel, Keys};

use crate::grant::{Grant, Refused};
use crate::machine::Pointer;

impl Pointer {
    /// Goes on under another lease of the same loop, with the copy of the clay and every cut that is not durable.
    ///
    /// # Errors
    /// It is none, or one of another loop: nothing changes, and a machine made anew is to take over once this one
    /// rests.
    pub fn renew(&mut self, now_ns: u64, granted: &[u8], keys: &Keys) -> Result<(), Refused> {
        if self.side.fault().is_some() {
            return Err(Refused::AtRest);
        }
        let grant = Grant::parse(granted, self.setup.profile)?;
        let granted = grant.granted();
        let goes_on =
            self.known.is_before(granted) && is_same_loop(&self.granted, granted, &self.parameters);
        if !goes_on {
            return Err(Refused::AnotherLoop);
        }
        self.take_parameters(&granted.parameters)?;
        self.side.renew(Lease {
            number: granted.lease,
            ownership_epoch: granted.ownership_epoch,
        });
        self.channel = Channel::of_handle(keys);
        self.known = Known::of(granted);
        self.granted = granted.clone();
        self.frames.clear();
        self.received = None;
        self.is_heard = false;
        self.is_gone = false;
        self.heard_at = Timestamp::from_nanos(now_ns);
        Ok(())
    }

    /// The parameters of the session, as JSON: of them a tool, its place, the clay's material and which frames are left
    /// out can change while the loop runs.
    ///
    /// # Errors
    /// They are none; nothing changes.
    pub fn handle_parameters(&mut self, json: &[u8]) -> Result<(), Refused> {
        let mut parameters: LoopParameters = parse(json)?;
        lower(&mut parameters, self.setup.profile);
        self.take_parameters(&parameters)?;
        Ok(())
    }

    fn take_parameters(&mut self, parameters: &LoopParameters) -> Result<(), ParameterError> {
        // Most revisions are of something else: who holds a tool, which strokes the clay has.
        if !is_nothing_new(&self.parameters, parameters) {
            // Where a tool works has the tick in it, and that of a loop that runs stays.
            let setup = tool_setup(&LoopParameters {
                tick_s: self.parameters.tick_s,
                ..*parameters
            })?;
            self.side.set_deadband(parameters.deadband)?;
            drop::<Arc<_>>(self.side.move_to(setup));
        }
        self.parameters = LoopParameters {
            tick_s: self.parameters.tick_s,
            ..*parameters
        };
        Ok(())
    }
}
