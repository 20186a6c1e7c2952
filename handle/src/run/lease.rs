//! From a search for the server to a device in motion under its lease.

use std::sync::Arc;
use std::time::Duration;

use teleclay_bilateral::{Known, LinkState, is_same_loop, lower, tool_setup};
use teleclay_link::time::Timestamp;
use teleclay_proto::PROTOCOL;
use teleclay_proto::join::{JoinRequest, LoopParameters};
use teleclay_shell::endpoint::Endpoint;
use teleclay_shell::network::{self, Endpoints};
use teleclay_shell::realtime::Realtime;
use teleclay_shell::ticker::TickerConfig;
use tokio::time::Instant;

use super::{Failure, Rig, Run, close};
use crate::attachment::{Attachment, LineEnds, Renewal};
use crate::device::DeviceSetup;
use crate::engine::{CAPACITIES, Engine, Order};
use crate::event::Event;
use crate::grant::JoinGrant;
use crate::join::{self, JoinError, JoinTarget, OldLease};
use crate::line::{Line, LineError};
use crate::refresh::Changed;

/// After the first lease under which no frame came.
const FIRST_PAUSE: Duration = Duration::from_millis(200);
/// After many of them.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

impl Run {
    /// Asks for a lease until one is granted; for the old one, if there was one.
    pub(super) fn search(&mut self) {
        let target = JoinTarget {
            realm: self.options.realm.clone(),
            session: self.options.session.clone(),
            request: JoinRequest {
                protocol: PROTOCOL,
                operator: self.options.operator.clone(),
                device: self.options.device.clone(),
            },
            token: self.options.token.clone(),
            invite: self.options.invite,
            door: self.options.door.clone(),
            waits_out_stops: self.options.waits_out_stops,
        };
        // What the server has taken back need not be given back, nor waited for.
        let held = self.line.as_ref();
        let held = held.filter(|line| self.taken_back != Some(line.grant.granted.lease));
        let old = held.map(|line| OldLease {
            keys: line.grant.keys.clone(),
            channel: Arc::clone(&line.grant.channel),
            lease: line.grant.granted.lease,
            lease_s: line.grant.granted.lease_s,
        });
        let was_heard = self.line.as_ref().is_none_or(|line| {
            let (lease, link_state, _) = self.link_state;
            lease == line.grant.granted.lease && link_state != LinkState::NotYet
        });
        self.unheard = if was_heard { 0 } else { self.unheard + 1 };
        self.searching_since = Instant::now();
        self.searching = Some(Box::pin(join::search(
            self.control.clone(),
            target,
            old,
            pause_after(self.unheard),
            self.events.clone(),
        )));
    }

    /// Takes a lease into use: by the running device when it fits, by a newly opened one when not.
    pub(super) async fn attach(&mut self, grant: Box<JoinGrant>) -> Result<(), Failure> {
        let (keys, lease) = (grant.keys.clone(), grant.granted.lease);
        let channel = Arc::clone(&grant.channel);
        let attached = self.try_to_attach(grant).await;
        if attached.is_err() {
            // A lease that nobody will use should not hold the tool.
            join::leave(&self.control, &keys, &channel, lease).await;
        }
        attached
    }

    async fn try_to_attach(&mut self, mut grant: Box<JoinGrant>) -> Result<(), Failure> {
        lower(&mut grant.granted.parameters, self.options.profile);
        let setup = DeviceSetup::of(&grant.granted);
        let parameters = grant.granted.parameters;
        let joined = Event::Joined {
            node: grant.granted.node.clone(),
            session: grant.keys.session().clone(),
            tool: grant.granted.tool,
            lease: grant.granted.lease,
            scheme: parameters.scheme,
            after_s: self
                .lost_at
                .take()
                .map(|lost_at| lost_at.elapsed().as_secs_f64()),
        };
        self.open_slow(grant.granted.slow_endpoint.as_deref())
            .await?;
        let (_, slow) = self.slow.as_ref().expect("it was opened in the line above");
        let follows = self.follows(&grant);
        // The old line first: it may use the same keys.
        self.line = None;
        let gone = self.gone.0.clone();
        let (line, ends) = Line::open(&self.control, slow, self.clock, grant, gone).await?;
        self.refreshing = None;
        self.known = Known::of(&line.grant.granted);
        self.metrics.on_lease(line.grant.granted.lease);
        self.line = Some(line);
        self.emit(joined);

        let fitting = self
            .rig
            .take_if(|rig| rig.setup == setup && !rig.ticker.is_finished());
        // A device that does not fit is let go before it is opened again.
        self.rig = None;
        match (fitting, follows) {
            (Some(rig), Some(of)) => self.go_on(rig, Renewal { of, ends }, parameters),
            (Some(rig), None) => {
                let attachment = self.attachment(parameters, ends)?;
                self.order(rig, Order::Attach(attachment))
            }
            (None, _) => {
                let attachment = self.attachment(parameters, ends)?;
                self.open_device(setup, attachment)
            }
        }
    }

    /// The lease that a grant follows, where the handle side goes on. One run has one operator, and a lease that the
    /// server has taken back is over with all that was under it.
    fn follows(&self, grant: &JoinGrant) -> Option<u32> {
        let held = &self.line.as_ref()?.grant;
        let is_ours = self.taken_back != Some(held.granted.lease);
        let goes_on = is_ours
            && held.keys == grant.keys
            && self.known.is_before(&grant.granted)
            && is_same_loop(&held.granted, &grant.granted, &self.parameters);
        goes_on.then_some(held.granted.lease)
    }

    /// A new handle side, for a tick that knows these parameters.
    fn attachment(
        &mut self,
        parameters: LoopParameters,
        ends: LineEnds,
    ) -> Result<Box<Attachment>, Failure> {
        let attachment = Attachment::new(&parameters, ends).map_err(LineError::from)?;
        self.parameters = parameters;
        self.context = Some(attachment.side.context().clone());
        Ok(attachment)
    }

    /// The same handle side under another lease, with what has changed of its parameters meanwhile.
    fn go_on(
        &mut self,
        rig: Rig,
        renewal: Renewal,
        parameters: LoopParameters,
    ) -> Result<(), Failure> {
        let lease = renewal.ends.lease();
        let setup = tool_setup(&parameters).map_err(LineError::from)?;
        self.order(rig, Order::Renew(Box::new(renewal)))?;
        self.take_parameters(lease, Changed { parameters, setup });
        Ok(())
    }

    fn order(&mut self, mut rig: Rig, order: Order) -> Result<(), Failure> {
        let pushed = rig.ends.orders.push(order);
        self.rig = Some(rig);
        pushed.map_err(|_| Failure::ThreadEnded)
    }

    fn open_device(
        &mut self,
        setup: DeviceSetup,
        attachment: Box<Attachment>,
    ) -> Result<(), Failure> {
        let device = (self.options.open_device)(&setup).map_err(Failure::Open)?;
        let name = device.name().to_owned();
        let now = Timestamp::from_nanos(self.clock.now_ns());
        let engine = Engine::new(now, setup.tick_s, device, self.options.profile, attachment);
        let (realtime, ends) = Realtime::new(engine, self.clock, CAPACITIES);
        let period = Duration::from_secs_f64(setup.tick_s);
        let config = TickerConfig {
            name: "handle-tick",
            period: self.options.clock_drift.true_span(period),
            scheduling: self.options.scheduling,
            spin: self.options.spin,
        };
        let ticker = realtime.spawn(config)?;
        self.metrics.on_thread(period, ticker.scheduler());
        let scheduler = ticker.scheduler().to_owned();
        self.emit(Event::Ticking {
            device: name,
            tick_s: setup.tick_s,
            profile: self.options.profile,
            scheduler,
        });
        self.rig = Some(Rig {
            setup,
            ticker,
            ends,
        });
        Ok(())
    }

    async fn open_slow(&mut self, granted: Option<&str>) -> Result<(), Failure> {
        let known = &self.options.door.endpoint;
        let endpoint = match granted.map(str::parse::<Endpoint>) {
            None => known.clone(),
            Some(Ok(slow)) => reachable(&slow, known),
            Some(Err(error)) => {
                return Err(Failure::Join {
                    session: self.options.session.clone(),
                    source: JoinError::Unusable {
                        reason: error.to_string(),
                    },
                });
            }
        };
        if self
            .slow
            .as_ref()
            .is_some_and(|(open, _)| *open == endpoint)
        {
            return Ok(());
        }
        let endpoints = Endpoints {
            trusted: self.trusted.clone(),
            ..Endpoints::connecting(endpoint.clone())
        };
        let session = network::open(&endpoints).await?;
        if let Some((_, old)) = self.slow.replace((endpoint, session)) {
            close(&old).await;
        }
        Ok(())
    }
}

/// How long nobody is asked after so many leases in a row under which no frame came: a server that grants and is then
/// silent is not asked fifty times a second.
fn pause_after(unheard: u32) -> Duration {
    match unheard {
        0 => Duration::ZERO,
        _ => LONGEST_PAUSE.min(FIRST_PAUSE * 2_u32.saturating_pow(unheard - 1)),
    }
}

/// The slow endpoint as seen from here: a server that listens everywhere names no address of its own.
fn reachable(slow: &Endpoint, known: &Endpoint) -> Endpoint {
    if slow.is_everywhere() {
        slow.on(&known.host)
    } else {
        slow.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_that_grants_and_is_silent_is_asked_ever_more_seldom() {
        let pauses_ms = [0, 200, 400, 800, 1600, 3200, 5000, 5000];
        for (unheard, pause_ms) in (0..).zip(pauses_ms) {
            assert_eq!(pause_after(unheard), Duration::from_millis(pause_ms));
        }
        assert_eq!(pause_after(u32::MAX), LONGEST_PAUSE);
    }

    #[test]
    fn a_slow_endpoint_that_listens_everywhere_is_reached_where_the_server_is() {
        for (slow, known, reached) in [
            (
                "tcp/0.0.0.0:7548",
                "tcp/192.0.2.7:7547",
                "tcp/192.0.2.7:7548",
            ),
            (
                "udp/[::]:7548?rel=0",
                "udp/[2001:db8::1]:7547",
                "udp/[2001:db8::1]:7548?rel=0",
            ),
            (
                "tcp/127.0.0.1:7548",
                "tcp/192.0.2.7:7547",
                "tcp/127.0.0.1:7548",
            ),
        ] {
            let [slow, known] = [slow, known].map(|text| text.parse().unwrap());
            assert_eq!(reachable(&slow, &known).to_string(), reached);
        }
    }
}
