//! Who gets which tool, and when a lease ends.
//!
//! - An operator who asks gets the tool that this operator held before, if it has fallen silent, or was held before
//!   this server began and was not heard since; else one that nobody holds; else any that has fallen silent.
//! - A holder has fallen silent when no frame has come for [`Rules::takeover_after`], and has had
//!   [`Rules::first_frame_within`] since the lease began to send a first one.
//! - A lease ends when its holder says goodbye, or [`Rules::lease`] after the last frame.

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

impl Rules {
    /// The slot that `operator` gets, if there is one to be given.
    pub(crate) fn slot_for<'a>(
        &self,
        operator: &str,
        slots: impl Iterator<Item = Option<Held<'a>>>,
    ) -> Option<usize> {
        let (mut own, mut free, mut silent) = (None, None, None);
        for (slot, held) in slots.enumerate() {
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
        own.or(free).or(silent)
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

    fn held(operator: &str, silence_ms: u64) -> Option<Held<'_>> {
        Some(Held {
            operator,
            is_connected: silence_ms <= 100,
            silence: Duration::from_millis(silence_ms),
            held_for: LONG_AGO,
            is_awaited: false,
        })
    }

    fn given(slots: &[Option<Held<'_>>]) -> Option<usize> {
        Rules::default().slot_for("Ada", slots.iter().copied())
    }

    #[test]
    fn an_operator_gets_the_own_tool_back_before_a_free_one_and_that_before_a_strangers() {
        let (own, strangers, busy) = (held("Ada", 200), held("Bob", 200), held("Bob", 1));
        assert_eq!(given(&[busy, strangers, None, own]), Some(3));
        assert_eq!(given(&[busy, strangers, None]), Some(2));
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
            held("Bob", age_ms).map(|held| Held {
                held_for: Duration::from_millis(age_ms),
                is_awaited: false,
                ..held
            })
        };
        assert_eq!(given(&[new(1000)]), None);
        assert_eq!(given(&[new(1001)]), Some(0));
    }

    #[test]
    fn a_lease_runs_out_after_ten_seconds_without_a_frame() {
        let rules = Rules::default();
        let after = |silence_ms| rules.has_run_out(&held("Bob", silence_ms).unwrap());
        assert!(!after(10_000));
        assert!(after(10_001));
    }
}
