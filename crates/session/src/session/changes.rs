//! What changes a session between two ticks, each under one new revision.

use std::sync::Arc;

use teleclay_bilateral::ToolSide;
use teleclay_clay::Sweep;
use teleclay_link::scheme::Generation;
use teleclay_link::time::Timestamp;

use super::{Journal, Session};
use crate::command::{Granted, Refusal};
use crate::cuts::Cuts;
use crate::event::{EventKind, Release};
use crate::prepare::{ExchangeParts, JoinParts, PatchParts, ResetParts};
use crate::settings::Settings;
use crate::slot::Holder;

/// Cuts that are made up for when clay is exchanged, at most: half a millisecond of work.
const CUTS_MADE_UP_FOR: usize = 96;

impl Session {
    pub(super) fn patch(&mut self, parts: &mut PatchParts) {
        let generation = self.next_revision_with(&mut parts.settings);
        if let Some(material) = parts.material {
            self.material = material;
        }
        if let Some(lines) = &parts.lines {
            self.impair(lines);
        }
        if let Some(deadband) = parts.deadband {
            for side in self.sides_mut() {
                let set = side.set_deadband(deadband);
                debug_assert!(set.is_ok(), "what was prepared was checked: {set:?}");
            }
        }
        if !parts.controllers.is_empty() {
            let scheme = self.settings.parameters.scheme;
            for (slot, controller) in self.slots.iter_mut().zip(&mut parts.controllers) {
                if let Some(side) = slot.side_mut() {
                    side.change_scheme(scheme, generation, controller);
                }
            }
        }
        self.announce_revision();
        self.emit(EventKind::Changed {
            settings: Arc::clone(&self.settings),
        });
    }

    pub(super) fn reset(&mut self, parts: &mut ResetParts) {
        self.clay_epoch = self.clay_epoch.wrapping_add(1);
        let generation = self.next_revision_with(&mut parts.settings);
        self.material = parts.setup.material;
        for slot in &mut self.slots {
            if let Some(holder) = &mut slot.holder {
                holder.fault = None;
            }
            if let Some(side) = slot.side_mut() {
                parts.before.push(side.move_to(Arc::clone(&parts.setup)));
                side.start_on_fresh_block(generation);
            }
        }
        std::mem::swap(&mut self.clay, &mut parts.clay);
        self.announce_revision();
        self.emit(EventKind::FreshBlock {
            settings: Arc::clone(&self.settings),
            clay_epoch: self.clay_epoch,
            given: parts.given,
        });
    }

    /// The clay as it would be without a stroke, or with one again. What was cut since it was made is cut in it, too.
    pub(super) fn exchange(&mut self, parts: &mut ExchangeParts) -> Result<(), Refusal> {
        if parts.clay_epoch != self.clay_epoch {
            return Err(Refusal::OtherClay {
                prepared_for: parts.clay_epoch,
                clay_epoch: self.clay_epoch,
            });
        }
        let since = self.made.after(parts.as_of_tick);
        let since = since.filter(|cuts| cuts.len() <= CUTS_MADE_UP_FOR);
        for (operation, cut) in since.ok_or(Refusal::CutMeanwhile {
            as_of_tick: parts.as_of_tick,
        })? {
            let sweep = Sweep {
                shape: parts.shape,
                from: cut.from,
                to: cut.to,
            };
            parts.clay.operate(operation, &sweep);
        }
        std::mem::swap(&mut self.clay, &mut parts.clay);
        self.clay_epoch = self.clay_epoch.wrapping_add(1);
        self.revision += 1;
        let generation = self.generation();
        for side in self.sides_mut() {
            side.go_on_in_exchanged_clay(generation);
        }
        self.announce_revision();
        self.emit(EventKind::Exchanged {
            clay_epoch: self.clay_epoch,
            exchange: parts.exchange,
            as_of_tick: parts.as_of_tick,
        });
        Ok(())
    }

    pub(super) fn join(
        &mut self,
        now: Timestamp,
        parts: &mut JoinParts,
    ) -> Result<Granted, Refusal> {
        let slot = self.slot_to_give(now, &parts.operator.name)?;
        let mut side = parts.side.take().expect("a command is carried out once");
        parts.side = self.release(slot, Release::TakenOver);
        let reserved = self.slots[slot].reserved.take();
        parts.name = reserved.map(|reserved| reserved.operator);
        self.revision += 1;
        let lease = self.next_lease;
        self.next_lease = lease.checked_add(1).unwrap_or(1);
        side.attach(lease, self.ownership_epoch, self.generation());
        if self.journal == Journal::Kept {
            side.set_durable(0);
        }
        self.slots[slot].holder = Some(Holder {
            lease,
            operator: Arc::clone(&parts.operator),
            since: now,
            is_recovered: false,
            side,
            was_connected: false,
            fault: None,
        });
        self.announce_revision();
        self.emit(EventKind::Taken {
            slot,
            lease,
            operator: Arc::clone(&parts.operator),
        });
        Ok(Granted { lease, slot })
    }

    /// Takes the tool in `slot` from its holder, if it has one. Gives the side, to be dropped elsewhere.
    pub(super) fn release(&mut self, slot: usize, because: Release) -> Option<Box<ToolSide>> {
        let holder = self.slots[slot].holder.take()?;
        self.slots[slot].clear_lines();
        self.slots[slot].requests.forget_all();
        self.departed = self.departed.and(holder.side.arrivals());
        self.revision += 1;
        self.announce_revision();
        self.emit(EventKind::Released {
            slot,
            lease: holder.lease,
            operator: holder.operator,
            because,
        });
        Some(holder.side)
    }

    /// A new revision, with these settings from it on. `settings` gets those before.
    fn next_revision_with(&mut self, settings: &mut Arc<Settings>) -> Generation {
        self.revision += 1;
        // Whoever prepared the settings does not know under which revision they come to hold, and nobody else has them
        // yet.
        if let Some(settings) = Arc::get_mut(settings) {
            settings.revision = self.revision;
        }
        std::mem::swap(&mut self.settings, settings);
        self.generation()
    }

    /// Counts go on from those of an earlier server of the session, which has told of its events.
    pub(crate) fn go_on_from(
        &mut self,
        now: Timestamp,
        ticks: u64,
        revision: u64,
        clay_epoch: u32,
    ) {
        self.now = now;
        self.ticks = ticks;
        self.revision = revision;
        self.clay_epoch = clay_epoch;
        self.made = Cuts::new(self.slots.len(), ticks);
    }

    pub(crate) fn put_holder(&mut self, slot: usize, holder: Holder) {
        if let Some(slot) = self.slots.get_mut(slot) {
            slot.holder = Some(holder);
        }
    }
}
