//! A stop that holds, and who asks whom for a tool.
//!
//! *Architecture invariant*: a stop is never refused. It waits for no settings and no room: the queue of events has
//! room for one beyond what anything else may fill, and until the queue is shorter again no stop can be cleared.

use std::sync::Arc;

use teleclay_link::time::Timestamp;

use super::{EVENTS_AT_ONCE, Session};
use crate::command::Refusal;
use crate::event::{EventKind, Release, RequestEnd, StopSnapshot};
use crate::prepare::{ControlParts, StopParts, Wish};
use crate::requests::MAX_REQUESTS;
use crate::rules::Given;
use crate::slot::Reservation;

impl Session {
    /// Takes every tool away. Where the session is stopped already, that stop stays as it is.
    pub(super) fn stop(&mut self, parts: &mut StopParts) {
        if self.stop.is_some() {
            return;
        }
        let (by, reason) = (Arc::clone(&parts.by), Arc::clone(&parts.reason));
        self.revision += 1;
        self.emit(EventKind::Stopped {
            by: Arc::clone(&by),
            reason: Arc::clone(&reason),
        });
        self.stop = Some(StopSnapshot { by, reason });
        for slot in 0..self.slots.len() {
            if let Some(reserved) = self.slots[slot].reserved.take() {
                parts.names.push(reserved.operator);
            }
            if let Some(side) = self.release(slot, Release::Stopped) {
                parts.sides.push(side);
            }
        }
    }

    /// Tools may be joined with again. Gives the stop that was, to be dropped elsewhere.
    pub(super) fn clear_stop(&mut self, by: &Arc<str>) -> Result<StopSnapshot, Refusal> {
        let stop = self.stop.take().ok_or(Refusal::NotStopped)?;
        self.change(EventKind::StopCleared { by: Arc::clone(by) });
        Ok(stop)
    }

    /// The slot that an operator gets who joins.
    pub(super) fn slot_to_give(&self, now: Timestamp, operator: &str) -> Result<usize, Refusal> {
        if let Some(StopSnapshot { by, reason }) = &self.stop {
            return Err(Refusal::Stopped {
                by: Arc::clone(by),
                reason: Arc::clone(reason),
            });
        }
        let places = self.slots.iter().map(|slot| slot.place(now));
        let kept = match self.rules.slot_for(operator, places) {
            Given::Slot(slot) => return Ok(slot),
            Given::KeptFromYou(slot) => self.slots[slot].reserved.as_ref(),
            Given::Nothing => None,
        };
        Err(match kept {
            Some(reserved) => Refusal::Reserved {
                holder: Arc::clone(&reserved.operator),
            },
            None => Refusal::NoFreeTool {
                tools: self.slots.len(),
            },
        })
    }

    /// Does with one tool what is wanted of it.
    pub(super) fn control(
        &mut self,
        now: Timestamp,
        parts: &mut ControlParts,
    ) -> Result<(), Refusal> {
        let tool = parts.tool;
        let slot = self.held_slot(tool, parts.lease)?;
        match &parts.wish {
            Wish::Request { operator } => {
                parts.name = self.request(now, slot, operator)?;
            }
            Wish::Withdraw { operator } => {
                self.end_request(slot, operator, RequestEnd::Withdrawn)?;
            }
            Wish::Deny { operator, reason } => {
                let reason = Arc::clone(reason);
                self.end_request(slot, operator, RequestEnd::Denied { reason })?;
            }
            Wish::Grant { operator } => {
                if !self.slots[slot].requests.has(operator) {
                    return Err(no_such_request(tool, operator));
                }
                let to = Arc::clone(operator);
                parts.side = self.release(slot, Release::HandedOver { to });
                self.slots[slot].reserved = Some(Reservation {
                    operator: Arc::clone(operator),
                    since: now,
                });
            }
            Wish::Release => parts.side = self.release(slot, Release::TakenAway),
        }
        Ok(())
    }

    /// Somebody asks for a tool that is held. Gives a name to be dropped elsewhere.
    fn request(
        &mut self,
        now: Timestamp,
        slot: usize,
        operator: &Arc<str>,
    ) -> Result<Option<Arc<str>>, Refusal> {
        let (tool, place) = (number(slot), &mut self.slots[slot]);
        let is_holder = |holder: &crate::slot::Holder| *holder.operator.name == **operator;
        if place.holder.as_ref().is_some_and(is_holder) {
            let operator = Arc::clone(operator);
            return Err(Refusal::HeldByAsker { tool, operator });
        }
        if place.requests.has(operator) {
            let operator = Arc::clone(operator);
            return Err(Refusal::AskedAlready { tool, operator });
        }
        if place.requests.is_full() {
            let most = MAX_REQUESTS;
            return Err(Refusal::TooManyRequests { tool, most });
        }
        let before = place.requests.push(Arc::clone(operator), now);
        self.change(EventKind::Requested {
            slot,
            operator: Arc::clone(operator),
        });
        Ok(before)
    }

    fn end_request(
        &mut self,
        slot: usize,
        operator: &Arc<str>,
        because: RequestEnd,
    ) -> Result<(), Refusal> {
        let asked = self.slots[slot].requests.forget(operator);
        let operator = asked.ok_or_else(|| no_such_request(number(slot), operator))?;
        self.change(EventKind::RequestEnded {
            slot,
            operator,
            because,
        });
        Ok(())
    }

    /// Forgets what was asked for and kept for long enough.
    pub(super) fn forget_old(&mut self, slot: usize) {
        if !self.has_room_for(EVENTS_AT_ONCE) {
            return;
        }
        let (now, place) = (self.now, &mut self.slots[slot]);
        let is_over =
            |reserved: &mut Reservation| self.rules.reservation < now.since(reserved.since);
        if let Some(reserved) = place.reserved.take_if(is_over) {
            let operator = reserved.operator;
            self.change(EventKind::ReservationEnded { slot, operator });
        }
        if let Some((operator, age)) = self.slots[slot].requests.oldest(now)
            && self.rules.is_forgotten(age)
        {
            let operator = Arc::clone(operator);
            let ended = self.end_request(slot, &operator, RequestEnd::RanOut);
            debug_assert!(ended.is_ok(), "it was there: {ended:?}");
        }
    }

    pub(crate) fn put_stop(&mut self, stop: StopSnapshot) {
        self.stop = Some(stop);
    }

    pub(crate) fn put_reservation(
        &mut self,
        since: Timestamp,
        slot: usize,
        operator: Option<Arc<str>>,
    ) {
        if let Some(slot) = self.slots.get_mut(slot) {
            slot.reserved = operator.map(|operator| Reservation { operator, since });
        }
    }

    /// The slot of a tool that is held, under `lease` if one is named.
    fn held_slot(&self, tool: u32, lease: Option<u32>) -> Result<usize, Refusal> {
        let tools = self.slots.len();
        let slot = (tool as usize)
            .checked_sub(1)
            .filter(|slot| *slot < tools)
            .ok_or(Refusal::NoSuchTool { tool, tools })?;
        let held = self.slots[slot].holder.as_ref();
        let holder = held.ok_or(Refusal::NotHeld { tool })?;
        match lease {
            Some(lease) if lease != holder.lease => Err(Refusal::NoSuchLease { lease }),
            _ => Ok(slot),
        }
    }

    /// Tells of a change, under a revision of its own. Callers have made sure of room.
    fn change(&mut self, kind: EventKind) {
        self.revision += 1;
        self.announce_revision();
        self.emit(kind);
    }
}

/// Tools are numbered from 1.
fn number(slot: usize) -> u32 {
    slot as u32 + 1
}

fn no_such_request(tool: u32, operator: &Arc<str>) -> Refusal {
    Refusal::NoSuchRequest {
        tool,
        operator: Arc::clone(operator),
    }
}
