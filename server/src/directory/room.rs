//! Room for sessions: how many there may be, and how much clay all of them together.

use std::collections::HashMap;

use teleclay_proto::SessionId;
use teleclay_session::Settings;

use super::live::Live;
use super::orders::NoMemory;
use super::{CreateError, Entry, Inner};
use crate::engine::MAX_SESSIONS;

/// Memory that a voxel of a session takes: in the loop's clay, and in the watchers' copy of it.
const BYTES_A_VOXEL: u64 = 2;

impl Inner {
    pub(super) fn find_room(&self, id: &SessionId) -> Result<(), CreateError> {
        find_room(&self.entries(), id)
    }

    pub(super) fn find_memory(&self, settings: &Settings) -> Result<(), CreateError> {
        let voxels = settings
            .voxels()
            .map_err(|error| CreateError::Field(error.under("/clay")))?;
        self.check_memory(voxels, None)
            .map_err(CreateError::NoMemory)
    }

    /// Whether a block of so many voxels fits beside the clay of all sessions, or in the place of one's. Two calls at
    /// once may both find room for one.
    pub(crate) fn check_memory(
        &self,
        voxels: u64,
        in_place_of: Option<&SessionId>,
    ) -> Result<(), NoMemory> {
        let lives: Vec<Live> = {
            let entries = self.entries();
            let others = entries.iter().filter(|(id, _)| Some(*id) != in_place_of);
            others.map(|(_, entry)| entry.live.clone()).collect()
        };
        let used_bytes: u64 = lives.iter().map(|live| BYTES_A_VOXEL * live.voxels()).sum();
        let wanted_bytes = BYTES_A_VOXEL.saturating_mul(voxels);
        let free_bytes = self.clay_bytes.saturating_sub(used_bytes);
        if free_bytes < wanted_bytes {
            return Err(NoMemory {
                wanted_bytes,
                free_bytes,
                most_bytes: self.clay_bytes,
            });
        }
        Ok(())
    }
}

pub(super) fn find_room(
    sessions: &HashMap<SessionId, Entry>,
    id: &SessionId,
) -> Result<(), CreateError> {
    if sessions.contains_key(id) {
        return Err(CreateError::Exists { id: id.clone() });
    }
    if MAX_SESSIONS <= sessions.len() {
        return Err(CreateError::TooMany { most: MAX_SESSIONS });
    }
    Ok(())
}
