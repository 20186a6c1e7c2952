//! Who gets which tool, and when a lease ends.
//!
//! - An operator who asks gets the tool that this operator held before, if it has fallen silent, or was held before
//!   this server began and was not heard since; else one that nobody holds; else any that has fallen silent.
//! - A holder has fallen silent when no frame has come for [`Rules::takeover_after`], and has had
//!   [`Rules::first_frame_within`] since the lease began to send a first one.
//! - A lease ends when its holder says goodbye, or [`Rules::lease`] after the last frame.
//! - A tool that was handed over is kept for [`Rules::reservation`]: the operator for whom it is gets it before any
//!   other, and nobody else gets it, not even the one who held it.
//! - Who asks for a tool is forgotten after [`Rules::request`].

use std::time::Duration;

/// Times of the rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rules {
    /// A lease ends this long after the last frame.
    pub lease: Duration,
    /// Silence after which another operator may take a tool over.
    pub takeover_after: Duration,
    /// A new holder's silence does not count before this much time has passed.
    pub first_frame_within: Duration,
    /// A request for a tool is forgotten after this much time.
    pub request: Duration,
    /// A tool that was handed over is kept for so long.
    pub reservation: Duration,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            // Long enough to plug a cable in again.
            lease: Duration::from_secs(10),
            // Half as long again as the silence after which a tool has stopped.
            takeover_after: Duration::from_millis(150),
            // Longer than a handle takes to open its device and to hear of its lease over a poor line.
            first_frame_within: Duration::from_secs(1),
            // Long enough to finish a stroke and look up; soon enough that nobody grants what is wanted no longer.
            request: Duration::from_secs(30),
            // Long enough to take hold of a handle; as long as a lease without a frame.
            reservation: Duration::from_secs(10),
        }
    }
}

/// A tool as the rules see it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Held<'a> {
    /// Who holds it.
    pub(crate) operator: &'a str,
    /// Whether frames come.
    pub(crate) is_connected: bool,
    /// Time without a frame.
    pub(crate) silence: Duration,
    /// Age of the lease.
    pub(crate) held_for: Duration,
    /// The holder held it under an earlier server of the session, and was not heard by this one.
    pub(crate) is_awaited: bool,
}

/// A place among the tools, as the rules see it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place<'a> {
    Free,
    /// Nobody holds it, and it is kept for this operator.
    ReservedFor(&'a str),
    Held(Held<'a>),
}

/// What somebody gets who asks for a tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Given {
    /// The tool in this slot.
    Slot(usize),
    /// None: the tool in this slot is free, but kept for somebody else.
    KeptFromYou(usize),
    /// None: others hold them all.
    Nothing,
}

impl Rules {
    /// What `operator` gets.
    pub(crate) fn slot_for<'a>(
        &self,
        operator: &str,
        slots: impl Iterator<Item = Place<'a>>,
    ) -> Given {
        let (mut own, mut free, mut silent, mut kept) = (None, None, None, None);
        for (slot, place) in slots.enumerate() {
            let held = match place {
                Place::ReservedFor(name) if name == operator => return Given::Slot(slot),
                Place::ReservedFor(_) => {
                    kept = kept.or(Some(slot));
                    continue;
                }
                Place::Free => None,
                Place::Held(held) => Some(held),
            };
            match held {
                None => free = free.or(Some(slot)),
                // A server that has just begun has nobody's frames yet: who asks by that name is who was there.
                Some(held) if held.is_awaited && held.operator == operator => {
                    own = own.or(Some(slot));
                }
                Some(held) if self.is_silent(&held) => {
                    silent = silent.or(Some(slot));
                    if held.operator == operator {
                        own = own.or(Some(slot));
                    }
                }
                Some(_) => {}
            }
        }
        match (own.or(free).or(silent), kept) {
            (Some(slot), _) => Given::Slot(slot),
            (None, Some(slot)) => Given::KeptFromYou(slot),
            (None, None) => Given::Nothing,
        }
    }

    /// Whether a request for a tool that is so old is forgotten.
    pub(crate) fn is_forgotten(&self, age: Duration) -> bool {
        self.request < age
    }

    /// Whether a lease is over because its holder was not heard for too long.
    pub(crate) fn has_run_out(&self, held: &Held<'_>) -> bool {
        self.lease < held.silence && self.lease < held.held_for
    }

    fn is_silent(&self, held: &Held<'_>) -> bool {
        !held.is_connected
            && self.takeover_after < held.silence
            && self.first_frame_within < held.held_for
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONG_AGO: Duration = Duration::from_secs(60);

    fn held(operator: &str, silence_ms: u64) -> Place<'_> {
        Place::Held(silent(operator, silence_ms))
    }

    fn silent(operator: &str, silence_ms: u64) -> Held<'_> {
        Held {
            operator,
            is_connected: silence_ms <= 100,
            silence: Duration::from_millis(silence_ms),
            held_for: LONG_AGO,
            is_awaited: false,
        }
    }

    fn given(slots: &[Place<'_>]) -> Option<usize> {
        match Rules::default().slot_for("Ada", slots.iter().copied()) {
            Given::Slot(slot) => Some(slot),
            Given::KeptFromYou(_) | Given::Nothing => None,
        }
    }

    #[test]
    fn a_reservation_wins_over_every_other_rule() {
        let (own, strangers) = (held("Ada", 200), held("Bob", 200));
        let (mine, hers) = (Place::ReservedFor("Ada"), Place::ReservedFor("Eve"));
        assert_eq!(given(&[own, Place::Free, strangers, mine]), Some(3));
        assert_eq!(given(&[hers, own]), Some(1));
        assert_eq!(given(&[hers, Place::Free]), Some(1));
        assert_eq!(given(&[hers, strangers]), Some(1));
        let told = |slots: &[Place<'_>]| Rules::default().slot_for("Ada", slots.iter().copied());
        assert_eq!(told(&[held("Bob", 1), hers]), Given::KeptFromYou(1));
        assert_eq!(told(&[held("Bob", 1)]), Given::Nothing);
    }

    #[test]
    fn an_operator_gets_the_own_tool_back_before_a_free_one_and_that_before_a_strangers() {
        let (own, strangers, busy) = (held("Ada", 200), held("Bob", 200), held("Bob", 1));
        let free = Place::Free;
        assert_eq!(given(&[busy, strangers, free, own]), Some(3));
        assert_eq!(given(&[busy, strangers, free]), Some(2));
        assert_eq!(given(&[busy, strangers]), Some(1));
        assert_eq!(given(&[busy]), None);
        assert_eq!(given(&[]), None);
    }

    #[test]
    fn a_tool_may_be_taken_over_just_after_150_ms_of_silence() {
        assert_eq!(given(&[held("Bob", 150)]), None);
        assert_eq!(given(&[held("Bob", 151)]), Some(0));
    }

    #[test]
    fn a_new_holder_has_a_second_for_the_first_frame() {
        let new = |age_ms| {
            Place::Held(Held {
                held_for: Duration::from_millis(age_ms),
                ..silent("Bob", age_ms)
            })
        };
        assert_eq!(given(&[new(1000)]), None);
        assert_eq!(given(&[new(1001)]), Some(0));
    }

    #[test]
    fn a_lease_runs_out_after_ten_seconds_without_a_frame() {
        let rules = Rules::default();
        let after = |silence_ms| rules.has_run_out(&silent("Bob", silence_ms));
        assert!(!after(10_000));
        assert!(after(10_001));
    }
}
