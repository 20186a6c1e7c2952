//! Frames in, and frames out.

use teleclay_link::Vec3;
use teleclay_link::arrivals::Arrival;
use teleclay_link::freshness::{Age, Freshness};
use teleclay_link::round_trip::RoundTrip;
use teleclay_link::safety::{Implausible, Measure, check};
use teleclay_link::scheme::HandlePort;
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{CopyState, Corrections, Gaps, Sweeps, ToolFrame};
use teleclay_proto::{Scheme, is_after};

use super::HandleSide;

impl HandleSide {
    /// A frame came from the tool side. Frames under another lease, and those of an earlier server of the session, are
    /// not ours; older ones are counted, and shown to a scheme that plays its samples in order. Of frames that waited
    /// in a queue only the facts count.
    pub fn handle_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        let header = &frame.header;
        let own = &self.frame.header;
        if header.lease != own.lease || is_after(own.ownership_epoch, header.ownership_epoch) {
            return;
        }
        let is_another_owner = header.ownership_epoch != own.ownership_epoch;
        let outside = [
            ("position_m", Measure::Position, &frame.position_m[..]),
            ("velocity_m_s", Measure::Velocity, &frame.velocity_m_s),
            ("force_n", Measure::Force, &frame.force_n),
            ("wave", Measure::Wave, &frame.wave),
            ("wave_integral", Measure::Sum, &frame.wave_integral),
            ("energy_in_j", Measure::Sum, &frame.energy_in_j),
        ];
        let is_another_stream = is_another_owner || self.is_renewed;
        let is_plausible = check(&outside).and_then(|()| {
            if is_another_stream {
                self.listen_to_another_stream(header.sent_ns, header.sequence)
            } else {
                self.arrivals
                    .check_sequence(header.sent_ns, header.sequence)
            }
        });
        if let Err(fault) = is_plausible {
            self.arrivals.on_implausible();
            let silence = self.model.watchdog.silence;
            if self.persistence.on_implausible(now, silence) {
                self.fault = Some(fault);
            }
            return;
        }
        self.persistence.on_plausible();
        self.frame.header.ownership_epoch = header.ownership_epoch;
        let arrival = self.arrivals.on_sequence(header.sent_ns, header.sequence);
        let is_at_rest = self.watchdog.gain() <= 0.0;
        let age = match arrival {
            Arrival::Newest => self.freshness.on_newest(now, header.sent_ns, is_at_rest),
            _ => self.freshness.on_late(now, header.sent_ns),
        };
        let is_of_this_scheme =
            header.scheme == self.scheme && !is_after(self.scheme_since, header.sequence);
        if age == Age::Stale {
            self.arrivals.on_stale();
            if arrival == Arrival::Newest {
                self.watchdog.on_stale_frame();
            }
            if is_of_this_scheme {
                self.controller.on_stale_frame(now, frame);
            }
            return;
        }
        // What was on its way when the tool side went is no sign of life.
        let silence = self.model.watchdog.silence;
        if self
            .gone_since
            .is_some_and(|since| silence < now.since(since))
        {
            self.gone_since = None;
        }
        if arrival != Arrival::Newest {
            if is_of_this_scheme {
                self.controller.on_late_frame(now, frame);
            }
            return;
        }
        self.round_trip
            .on_frame(now, header.sent_ns, header.echo_ns, header.echo_hold_ns);
        if self.watchdog.is_stalled() {
            self.controller.on_news_again();
        }
        self.watchdog.on_frame(now);
        self.status = frame.status;
        self.frame.header.clay_epoch = header.clay_epoch;
        self.frame.header.revision = header.revision;
        let is_mine =
            header.scheme == self.scheme || self.change_scheme(header.scheme, header.sequence);
        if is_mine {
            self.controller.on_frame(now, frame);
        }
    }

    /// Another server goes on with the session, or this one under another lease: frames are numbered anew, by a clock
    /// that may be another.
    fn listen_to_another_stream(&mut self, sent_ns: u64, first: u32) -> Result<(), Implausible> {
        self.arrivals.restart(sent_ns, first)?;
        if !std::mem::take(&mut self.is_renewed) {
            self.forget_peer();
        }
        self.freshness = Freshness::new(self.model.watchdog.silence);
        self.scheme_since = first;
        Ok(())
    }

    /// What was agreed with one tool side is nothing to the next: neither what has come there, nor stamps of its clock.
    pub(super) fn forget_peer(&mut self) {
        self.round_trip = RoundTrip::default();
        self.controller.on_news_again();
        self.controller.on_another_peer();
    }

    pub(super) fn fill_frame(&mut self, now: Timestamp, port: &HandlePort, felt: Vec3) {
        let (echo_ns, echo_hold_ns) = self.round_trip.echo(now);
        let header = &mut self.frame.header;
        header.sent_ns = now.as_nanos();
        header.echo_ns = echo_ns;
        header.echo_hold_ns = echo_hold_ns;
        header.scheme = self.scheme;
        self.frame.position_m = port.position.into();
        self.frame.velocity_m_s = port.velocity.into();
        self.frame.hand_force_n = port.hand_force.into();
        self.frame.felt_force_n = felt.into();
        self.controller.fill(&mut self.frame);
        self.number_frame(now);
    }

    /// Decides whether the frame goes out. Numbers count the frames that do.
    pub(super) fn number_frame(&mut self, now: Timestamp) {
        let announcement = (self.frame.engagement, self.scheme);
        self.is_due = match &mut self.deadband {
            Some(deadband) => {
                if self.announced != Some(announcement) {
                    deadband.insist();
                }
                if self.controller.has_urgent_news() {
                    deadband.insist();
                }
                deadband.should_send(now, self.controller.signal(&self.frame))
            }
            None => true,
        };
        if self.is_due {
            self.controller.on_sent(&self.frame);
            self.announced = Some(announcement);
            self.frame.header.sequence = self.frame.header.sequence.wrapping_add(1);
        }
    }

    /// Whether the controller of `scheme` has taken over. Without one that waits, or without room for the one that is
    /// done, the present one goes on with what it heard last.
    fn change_scheme(&mut self, scheme: Scheme, since: u32) -> bool {
        let has_room = self.retired.is_none();
        let spare = &mut self.spares[usize::from(scheme.byte())];
        let Some(mut controller) = spare.take_if(|_| has_room) else {
            return false;
        };
        if let Some(copy) = controller.clay_copy_mut() {
            copy.move_to(&self.model.context.setup);
        }
        self.retired = Some(std::mem::replace(&mut self.controller, controller));
        self.scheme = scheme;
        self.scheme_since = since;
        self.frame.wave = [0.0; 3];
        self.frame.wave_integral = [0.0; 3];
        self.frame.energy_in_j = [0.0; 3];
        self.frame.copy = CopyState::None;
        self.frame.corrections = Corrections::default();
        self.frame.clay_hash = 0;
        self.frame.relayed_acknowledged = 0;
        self.frame.relayed_gaps = Gaps::default();
        self.frame.sweeps = Sweeps::default();
        // What was felt fades into what the new controller gives, instead of stepping there.
        self.blend_starts = true;
        true
    }
}
