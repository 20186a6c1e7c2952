//! Whether a lease goes on with what was held under the one before.
//!
//! A server that has lost its sessions may make one of the same name, and of the same block, anew. Cuts that were made
//! in the old one are none of its. It is told apart by its counts: a server that goes on with a session counts one
//! ownership epoch more, and one that has never lost it counts a revision for every lease.

use teleclay_proto::is_after;
use teleclay_proto::join::{Granted, LoopParameters};

/// Up to where a session has come, as last heard of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Known {
    /// Counts the servers that have run it.
    pub ownership_epoch: u32,
    /// Counts its changes.
    pub revision: u32,
}

impl Known {
    /// As of a lease that is granted.
    pub fn of(granted: &Granted) -> Self {
        Self {
            ownership_epoch: granted.ownership_epoch,
            revision: granted.parameters.revision,
        }
    }

    /// Whether the session that grants a lease is this one, later.
    pub fn is_before(self, granted: &Granted) -> bool {
        let then = Self::of(granted);
        is_after(then.ownership_epoch, self.ownership_epoch)
            || then.ownership_epoch == self.ownership_epoch
                && is_after(then.revision, self.revision)
    }
}

/// Whether a handle side that works with `parameters`, under the lease `held`, is one for the lease `granted` as well:
/// the same tool, the same block, and nothing else in the loop but what can change while a handle works. Its copy of
/// the clay follows any epoch by itself.
pub fn is_same_loop(held: &Granted, granted: &Granted, parameters: &LoopParameters) -> bool {
    let then = granted.parameters;
    let followed = LoopParameters {
        deadband: then.deadband,
        material: then.material,
        ..*parameters
    };
    held.tool == granted.tool
        && held.clay.shape == granted.clay.shape
        && held.clay.voxel_size_m.to_bits() == granted.clay.voxel_size_m.to_bits()
        && is_nothing_new(&followed, &then)
}

/// Whether two parameters are the same for whoever works with them. The scheme comes with frames.
pub fn is_nothing_new(before: &LoopParameters, then: &LoopParameters) -> bool {
    let counted = LoopParameters {
        revision: then.revision,
        scheme: then.scheme,
        ..*before
    };
    counted == *then
}

#[cfg(test)]
mod tests {
    use super::*;
    use teleclay_proto::http::ClayShape;
    use teleclay_proto::join::ClayDescription;
    use teleclay_proto::{NodeName, Scheme, ToolDescription};

    fn granted(ownership_epoch: u32, revision: u32) -> Granted {
        Granted {
            lease: 7,
            ownership_epoch,
            node: NodeName::new("lab").unwrap(),
            tool: 1,
            lease_s: 5.0,
            parameters: LoopParameters {
                revision,
                ..LoopParameters::default()
            },
            clay: ClayDescription {
                shape: ClayShape::block(),
                voxel_size_m: 5e-4,
                epoch: 1,
                revision: 0,
            },
            slow_endpoint: None,
        }
    }

    /// A server that makes a session of the same name anew counts from the beginning again.
    #[test]
    fn a_session_that_was_made_anew_is_another_one() {
        let known = Known {
            ownership_epoch: 2,
            revision: 9,
        };
        for (ownership_epoch, revision, is_later) in [
            (2, 10, true),
            (2, 9, false),
            (2, 3, false),
            // What was not durable is gone, the session is the same.
            (3, 3, true),
            (1, 30, false),
        ] {
            let then = granted(ownership_epoch, revision);
            assert_eq!(
                known.is_before(&then),
                is_later,
                "{ownership_epoch} {revision}"
            );
        }
    }

    #[test]
    fn a_loop_goes_on_with_another_material_and_not_with_another_tool_block_or_bound() {
        let held = granted(1, 1);
        let goes_on = |change: fn(&mut Granted)| {
            let mut then = granted(1, 2);
            change(&mut then);
            is_same_loop(&held, &then, &held.parameters)
        };
        assert!(goes_on(|_| {}));
        assert!(goes_on(|then| then.parameters.scheme = Scheme::Wave));
        assert!(goes_on(|then| then.parameters.deadband = 0.1));
        assert!(goes_on(
            |then| then.parameters.material.yield_stress_pa *= 2.0
        ));
        assert!(goes_on(|then| then.clay.epoch = 2));
        assert!(!goes_on(|then| then.tool = 2));
        assert!(!goes_on(|then| then.clay.voxel_size_m = 1e-3));
        assert!(!goes_on(
            |then| then.clay.shape = ClayShape::Block { size_m: [0.05; 3] }
        ));
        assert!(!goes_on(|then| then.parameters.slew_limit_n_per_s /= 2.0));
        assert!(!goes_on(|then| then.parameters.silence_s /= 2.0));
        assert!(!goes_on(|then| then.parameters.virtual_mass_kg *= 2.0));
        let ball = ToolDescription::Ball { radius_m: 0.0031 };
        assert_ne!(held.parameters.tool, ball);
        assert!(!goes_on(|then| {
            then.parameters.tool = ToolDescription::Ball { radius_m: 0.0031 };
        }));
    }
}
