//! The server's clay for the copy, in parts.

use teleclay_bilateral::ReceivedClay;
use teleclay_link::scheme::replica::Snapshot;
use teleclay_proto::http::{ClaySpec, parse};
use teleclay_proto::join::ClayDescription;

use crate::grant::Refused;
use crate::machine::Pointer;

impl Pointer {
    /// A snapshot begins: what the clay is, as JSON, as in a grant. One that is under way is forgotten.
    ///
    /// # Errors
    /// There is no such clay.
    pub fn begin_snapshot(&mut self, description: &[u8]) -> Result<(), Refused> {
        self.received = None;
        let clay: ClayDescription = parse(description)?;
        let spec = ClaySpec {
            shape: clay.shape,
            voxel_size_m: clay.voxel_size_m,
            // Its classes come with the bricks.
            layers: Vec::new(),
        };
        self.received = Some(ReceivedClay::begin(&spec, clay.epoch)?);
        Ok(())
    }

    /// A message of bricks.
    ///
    /// # Errors
    /// No snapshot was begun, or it is not of this one; then that is forgotten.
    pub fn handle_bricks(&mut self, message: &[u8]) -> Result<(), Refused> {
        let received = self.received.as_mut().ok_or(Refused::NoSnapshot)?;
        let taken = received.take_in(message);
        if taken.is_err() {
            self.received = None;
        }
        Ok(taken?)
    }

    /// All of the snapshot has come. What the scheme has no use for is dropped.
    ///
    /// # Errors
    /// No snapshot was begun, or bricks are missing; then it is forgotten.
    pub fn finish_snapshot(&mut self) -> Result<(), Refused> {
        let received = self.received.take().ok_or(Refused::NoSnapshot)?;
        let epoch = received.epoch();
        let clay = received.finish()?;
        drop(self.side.handle_snapshot(Snapshot { clay, epoch }));
        Ok(())
    }
}
