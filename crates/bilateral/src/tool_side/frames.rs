//! Frames in, and frames out.

use teleclay_link::arrivals::Arrival;
use teleclay_link::freshness::Age;
use teleclay_link::safety::{Measure, check};
use teleclay_link::time::Timestamp;
use teleclay_proto::frame::{Engagement, HandleFrame, LoopStatus, SweepRefusal};

use super::{Permission, ToolSide, ToolStep};

impl ToolSide {
    /// A frame came from the handle side. Frames under another lease are not ours; what was meant for an earlier server
    /// of the session is not acted on; older frames are counted, and shown to a scheme that plays its samples in order.
    /// Of frames that waited in a queue only the facts count.
    pub fn handle_frame(&mut self, now: Timestamp, frame: &HandleFrame) {
        let header = &frame.header;
        if header.lease != self.frame.header.lease {
            return;
        }
        self.names_another_owner = header.ownership_epoch != self.frame.header.ownership_epoch;
        if self.names_another_owner {
            return;
        }
        let corrections = &frame.corrections;
        let scalars = [
            corrections.moved_n,
            corrections.largest_step_n.into(),
            corrections.injected_j.into(),
            corrections.tank_j.into(),
        ];
        let outside = [
            ("position_m", Measure::Position, &frame.position_m[..]),
            ("velocity_m_s", Measure::Velocity, &frame.velocity_m_s),
            ("hand_force_n", Measure::Force, &frame.hand_force_n),
            ("felt_force_n", Measure::Force, &frame.felt_force_n),
            ("wave", Measure::Wave, &frame.wave),
            ("wave_integral", Measure::Sum, &frame.wave_integral),
            ("energy_in_j", Measure::Sum, &frame.energy_in_j),
            (
                "corrections.held_n",
                Measure::Force,
                &corrections.held_n.map(f64::from),
            ),
            ("corrections", Measure::Sum, &scalars),
        ];
        let is_plausible = check(&outside).and_then(|()| {
            self.arrivals
                .check_sequence(header.sent_ns, header.sequence)
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
        let arrival = self.arrivals.on_sequence(header.sent_ns, header.sequence);
        self.heard_at = Some(now);
        let is_at_rest = self.watchdog.gain() <= 0.0;
        let age = match arrival {
            Arrival::Newest => self.freshness.on_newest(now, header.sent_ns, is_at_rest),
            _ => self.freshness.on_late(now, header.sent_ns),
        };
        if age == Age::Stale {
            self.handle_stale_frame(now, frame, arrival);
            return;
        }
        if arrival != Arrival::Newest {
            self.controller.on_late_frame(now, frame);
            return;
        }
        self.round_trip
            .on_frame(now, header.sent_ns, header.echo_ns, header.echo_hold_ns);
        if self.watchdog.is_stalled() {
            self.controller.on_news_again();
        }
        self.watchdog.on_frame(now);
        self.follow_engagement(now, frame.engagement);
        self.handle
            .on_frame(frame, self.model.watchdog.silence.as_secs_f64());
        self.lift = frame.position_m[2];
        if !self.engaged && frame.engagement == Engagement::Engaged {
            self.engaged = true;
            if self.arrivals.counts().stale == 0 {
                // The handle's own force ramps up from zero at the start, so nothing here needs to.
                self.watchdog.start_awake(now);
                self.permission_gain = 1.0;
            }
            self.reindex();
        }
        self.controller.on_frame(now, frame);
    }

    /// What waited in a queue moves nothing. Its cuts are facts, and that the operator leaves is one.
    fn handle_stale_frame(&mut self, now: Timestamp, frame: &HandleFrame, arrival: Arrival) {
        self.arrivals.on_stale();
        if arrival == Arrival::Newest {
            self.watchdog.on_stale_frame();
            // Where the handle is when the loop begins is told by the first frame that is news.
            self.engaged &= !self.freshness.has_not_begun();
            if frame.engagement == Engagement::Leaving {
                self.follow_engagement(now, frame.engagement);
            }
        }
        self.controller.on_stale_frame(now, frame);
    }

    pub(super) fn follow_engagement(&mut self, now: Timestamp, engagement: Engagement) {
        self.engagement = engagement;
        if engagement == Engagement::Leaving {
            self.left_at.get_or_insert(now);
        } else {
            self.left_at = None;
        }
    }

    pub(super) fn status(&self, permission: Permission) -> LoopStatus {
        match permission {
            _ if self.fault.is_some() => LoopStatus::Fault,
            Permission::Pause => LoopStatus::Paused,
            Permission::Work if self.engagement == Engagement::Engaged => LoopStatus::Running,
            Permission::Work => LoopStatus::Idle,
        }
    }

    pub(super) fn fill_frame(&mut self, now: Timestamp, status: LoopStatus, step: ToolStep) {
        let (echo_ns, echo_hold_ns) = self.round_trip.echo(now);
        let header = &mut self.frame.header;
        header.sent_ns = now.as_nanos();
        header.echo_ns = echo_ns;
        header.echo_hold_ns = echo_hold_ns;
        header.scheme = self.scheme;
        // A fault that this very tick brought is told at once.
        self.frame.status = if self.fault.is_some() {
            LoopStatus::Fault
        } else {
            status
        };
        self.frame.position_m = (self.model.setup().home + self.position).into();
        self.frame.velocity_m_s = self.velocity.into();
        self.frame.force_n = self.clay_force.into();
        self.frame.engaged_area_m2 = step.engaged_area_m2;
        self.controller.fill(&mut self.frame);
        if let Some(durable) = self.durable {
            self.frame.sweeps_durable = durable.min(self.frame.sweeps_acknowledged);
        }
        if self.names_another_owner {
            self.frame.refusal = SweepRefusal::WrongOwner;
        }
        self.number_frame(now);
    }

    /// Decides whether the frame goes out. Numbers count the frames that do.
    pub(super) fn number_frame(&mut self, now: Timestamp) {
        let announcement = (self.frame.status, self.scheme, self.frame.header.revision);
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
}
