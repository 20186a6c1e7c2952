//! What the tick has recorded, and what follows from it: what is told, what is fetched, and when a lease counts as
//! lost.

use std::time::Duration;

use teleclay_bilateral::{Known, LinkState, is_nothing_new};
use teleclay_link::scheme::handle_controller;
use teleclay_proto::Scheme;
use tokio::time::Instant;

use super::{Failure, Run};
use crate::device::DeviceRequest;
use crate::engine::{Order, Record};
use crate::event::Event;
use crate::grant::JoinGrant;
use crate::join;
use crate::line::Gone;
use crate::refresh::{self, Changed, Fresh, Wanted};

/// Without frames for this long a lease counts as lost. Shorter gaps mend themselves.
const LOST_AFTER: Duration = Duration::from_secs(1);
/// A copy of the clay goes on without frames, and what was cut since waits for the line: a new lease may be one of
/// another tool, or of a session made anew, which would give that up. The server holds a lease for 10 s of silence, so
/// the old one is hoped for until shortly before.
const LOST_ON_COPY_AFTER: Duration = Duration::from_secs(8);
/// A server whose end is seen was heard shortly before: a tick's records wait 20 ms, and the network's delay may be as
/// long as sessions allow.
const HEARD_WITHIN: Duration = Duration::from_secs(1);
/// A server that is said to be gone is, once nothing has come for this long: twice the longest pause that a deadband
/// leaves between two frames, and a little.
const GONE_AFTER: Duration = Duration::from_millis(50);

impl Run {
    /// Reads what the tick has recorded.
    pub(super) fn read(&mut self) -> Result<(), Failure> {
        let Some(rig) = &mut self.rig else {
            return Ok(());
        };
        while rig.ends.done.pop().is_ok() {}
        let is_finished = rig.ticker.is_finished();
        let mut records = Vec::new();
        while let Ok(record) = rig.ends.records.pop() {
            records.push(record);
        }
        let failure = rig.ends.failures.pop().ok();
        if let Some(line) = &self.line {
            self.metrics.observe(line);
        }
        self.write_down(&records);
        let mut outcome = Ok(());
        for record in &records {
            let met = self.on_record(record);
            outcome = outcome.and(met);
        }
        if let Some(record) = records.last() {
            self.provide(record.lease, record.wanted.controller);
        }
        match failure {
            Some(error) => Err(Failure::Device(error)),
            None if is_finished => outcome.and(Err(Failure::ThreadEnded)),
            None => outcome,
        }
    }

    /// Makes a controller that the tick lacks, for the day when the session changes to its scheme.
    fn provide(&mut self, lease: u32, scheme: Option<Scheme>) {
        if let (Some(scheme), Some(context), Some(rig)) = (scheme, &self.context, &mut self.rig) {
            // A full ring means that it will be asked for again.
            let _ = rig.ends.orders.push(Order::Provide {
                lease,
                scheme,
                controller: handle_controller(scheme, context),
            });
        }
    }

    /// A recording that fails ends; the handle goes on.
    fn write_down(&mut self, records: &[Record]) {
        let Some(recording) = &mut self.options.recording else {
            return;
        };
        let written = records
            .iter()
            .try_for_each(|record| recording.write(record))
            .and_then(|()| recording.flush());
        if let Err(error) = written {
            self.options.recording = None;
            let reason = error.to_string();
            self.emit(Event::RecordingEnded { reason });
        }
    }

    fn on_record(&mut self, record: &Record) -> Result<(), Failure> {
        self.metrics.add(record);
        self.mode = record.mode;
        if let Some(fault) = record.fault {
            return Err(Failure::Fault(fault));
        }
        if let Some(robot) = &record.robot
            && let Some(event) = self.singularity.watch(record.at_ns, robot)
        {
            self.emit(event);
        }
        match record.request {
            Some(DeviceRequest::FreshClay) => {
                let rounds = self.metrics.on_round();
                self.emit(Event::RoundFinished { rounds });
                self.ask_for_fresh_clay();
            }
            Some(DeviceRequest::FreshClayForHand) => self.ask_for_fresh_clay(),
            None => {}
        }
        if self.is_leaving {
            // A server may stop speaking to whoever says goodbye.
            return Ok(());
        }
        let is_current = self
            .line
            .as_ref()
            .is_some_and(|line| line.grant.granted.lease == record.lease);
        if !is_current {
            return Ok(());
        }
        self.silence = Duration::from_nanos(record.silence_ns);
        if record.is_heard {
            self.known = Known {
                ownership_epoch: record.ownership_epoch,
                revision: record.wanted.revision,
            };
        }
        self.believe_gone(record.lease);
        self.on_link_state(record);
        self.refresh(record.lease, record.wanted);
        let is_on_copy = matches!(
            link_state_under_lease(record),
            LinkState::OnCopy | LinkState::OnStaleCopy
        );
        let lost_after = if is_on_copy {
            LOST_ON_COPY_AFTER
        } else {
            LOST_AFTER
        };
        let is_lost = lost_after.as_nanos() < u128::from(record.silence_ns);
        if is_lost && self.searching.is_none() {
            self.lost_at.get_or_insert_with(Instant::now);
            self.search();
        }
        Ok(())
    }

    /// Fetches what the tick wants to know, one thing after the other.
    fn refresh(&mut self, lease: u32, wanted: Wanted) {
        let wants_any = wanted.revision != self.parameters.revision || wanted.snapshot.is_some();
        let (Some(line), Some((_, slow)), None, true) =
            (&self.line, &self.slow, &self.refreshing, wants_any)
        else {
            return;
        };
        if Instant::now() < self.refresh_from {
            return;
        }
        self.refreshing_for = lease;
        self.refreshing = Some(Box::pin(refresh::refresh(
            slow.clone(),
            JoinGrant::clone(&line.grant),
            self.options.profile,
            self.parameters.revision,
            wanted,
        )));
    }

    pub(super) fn on_refreshed(&mut self, fresh: Result<Fresh, String>) {
        self.refresh_from = Instant::now() + refresh::PAUSE;
        let lease = self.refreshing_for;
        let Fresh {
            parameters,
            snapshot,
            took,
        } = match fresh {
            Ok(fresh) => fresh,
            Err(reason) => return self.emit(Event::NotRefreshed { reason }),
        };
        if let Some(changed) = parameters {
            self.take_parameters(lease, changed);
        }
        let (Some(snapshot), Some(rig)) = (snapshot, &mut self.rig) else {
            return;
        };
        let epoch = snapshot.epoch;
        if rig
            .ends
            .orders
            .push(Order::LoadSnapshot { lease, snapshot })
            .is_ok()
        {
            self.emit(Event::Copied {
                epoch,
                took_s: took.as_secs_f64(),
            });
        }
    }

    /// Tells the tick of parameters, if they say anything new. An order that finds no room is lost, and what it carried
    /// is asked for again: the tick goes on wanting it.
    pub(super) fn take_parameters(&mut self, lease: u32, changed: Changed) {
        let Changed { parameters, setup } = changed;
        let Some(rig) = &mut self.rig else { return };
        // Most revisions are of something else: who holds a tool, which strokes the clay has.
        let is_known = is_nothing_new(&self.parameters, &parameters);
        let order = Order::Move {
            lease,
            setup,
            deadband: parameters.deadband,
        };
        if is_known || rig.ends.orders.push(order).is_ok() {
            self.parameters = parameters;
        }
    }

    /// The server's process has ended, or somebody says so: anybody can show the token and take it away. What is true
    /// shows within a moment, since a server that has ended sends nothing.
    pub(super) fn on_server_gone(&mut self, gone: Gone) {
        let is_current = self
            .line
            .as_ref()
            .is_some_and(|line| line.grant.granted.lease == gone.lease);
        // A token also goes when Zenoh gives up a line that has long been silent. A process that dies is seen at once.
        let was_heard = self.silence < HEARD_WITHIN;
        if is_current && !self.is_leaving && (was_heard || gone.reason.is_some()) {
            self.said_gone = Some((gone, Instant::now()));
        }
    }

    /// Lets go if the server was said to be gone and is silent, too, or has said itself that the lease is over: the
    /// force goes, and another lease is asked for.
    fn believe_gone(&mut self, lease: u32) {
        let Some((gone, said)) = self.said_gone.take_if(|(gone, _)| gone.lease == lease) else {
            return;
        };
        if gone.reason.is_none() && self.silence < GONE_AFTER {
            if said.elapsed() <= HEARD_WITHIN {
                self.said_gone = Some((gone, said));
            }
            return;
        }
        if let Some(rig) = &mut self.rig {
            // A full ring means a thread that has stopped: nothing is felt then.
            let _ = rig.ends.orders.push(Order::Release { lease });
        }
        if self.searching.is_none() {
            self.lost_at.get_or_insert_with(Instant::now);
            if gone.reason.is_some() {
                self.taken_back = Some(lease);
            }
            self.emit(match gone.reason {
                Some(reason) => Event::TakenBack { reason },
                None => Event::ServerGone,
            });
            self.search();
        }
    }

    fn on_link_state(&mut self, record: &Record) {
        let (lease, before, since) = self.link_state;
        let link_state = link_state_under_lease(record);
        if (lease, before) == (record.lease, link_state) {
            return;
        }
        let now = Instant::now();
        self.link_state = (record.lease, link_state, now);
        let was_lost = lease == record.lease
            && matches!(
                before,
                LinkState::Silent | LinkState::OnCopy | LinkState::OnStaleCopy | LinkState::Gone
            );
        let was_held =
            lease == record.lease && matches!(before, LinkState::Paused | LinkState::Fault);
        match link_state {
            // That the server has gone was told when it was seen.
            LinkState::NotYet | LinkState::Gone => {}
            LinkState::Live => {
                let after_s = (was_lost || was_held).then(|| (now - since).as_secs_f64());
                if was_lost {
                    self.lost_at = None;
                }
                let was_on_copy = matches!(before, LinkState::OnCopy | LinkState::OnStaleCopy);
                self.emit(match after_s {
                    Some(after_s) if was_on_copy => Event::Together { after_s },
                    _ => Event::Live {
                        lease: record.lease,
                        after_s,
                    },
                });
            }
            LinkState::Silent | LinkState::OnCopy => {
                self.lost_at.get_or_insert(now);
                let silence_s = self
                    .line
                    .as_ref()
                    .map_or(0.0, |line| line.grant.granted.parameters.silence_s);
                self.emit(if link_state == LinkState::Silent {
                    Event::Silent { silence_s }
                } else {
                    Event::OnCopy { silence_s }
                });
            }
            LinkState::OnStaleCopy => self.emit(Event::OnStaleCopy),
            LinkState::Paused => self.emit(Event::Paused),
            LinkState::Fault => self.emit(Event::SessionFault),
        }
    }

    fn ask_for_fresh_clay(&mut self) {
        let (Some(line), Some((_, slow)), None) = (&self.line, &self.slow, &self.freshening) else {
            return;
        };
        let grant = JoinGrant::clone(&line.grant);
        self.freshening = Some(Box::pin(join::fresh(slow.clone(), grant)));
    }
}

/// What was heard under the lease before says nothing of this one.
fn link_state_under_lease(record: &Record) -> LinkState {
    if record.is_heard {
        record.link_state
    } else {
        LinkState::NotYet
    }
}
