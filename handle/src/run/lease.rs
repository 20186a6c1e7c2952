//! From a search for the server to a device in motion under its lease.

use std::time::Duration;

use teleclay_link::time::Timestamp;
use teleclay_proto::PROTOCOL;
use teleclay_proto::join::JoinRequest;
use teleclay_shell::network::{self, Endpoints};
use teleclay_shell::ticker::TickerConfig;
use tokio::time::Instant;

use super::{Failure, Rig, Run, close};
use crate::device::Workplace;
use crate::engine::{Engine, Order};
use crate::event::Event;
use crate::join::{self, Invitation, OldLease};
use crate::line::Line;
use crate::welcome::Welcome;

impl Run {
    /// Asks for a lease until one is granted; for the old one, if there was one.
    pub(super) fn search(&mut self) {
        let invitation = Invitation {
            node: self.options.node.clone(),
            session: self.options.session.clone(),
            request: JoinRequest {
                protocol: PROTOCOL,
                operator: self.options.operator.clone(),
                token: self.options.token.clone(),
                device: self.options.device.clone(),
            },
        };
        let old = self.line.as_ref().map(|line| OldLease {
            keys: line.welcome.keys.clone(),
            lease: line.welcome.granted.lease,
            lease_s: line.welcome.granted.lease_s,
        });
        self.searching_since = Instant::now();
        self.searching = Some(Box::pin(join::search(
            self.control.clone(),
            invitation,
            old,
            self.events.clone(),
        )));
    }

    /// Takes a lease into use: by the running device when it fits, by a newly opened one when not.
    pub(super) async fn sit(&mut self, welcome: Box<Welcome>) -> Result<(), Failure> {
        let (keys, lease) = (welcome.keys.clone(), welcome.granted.lease);
        let sat = self.try_to_sit(welcome).await;
        if sat.is_err() {
            // A lease that nobody will use should not hold the tool.
            join::leave(&self.control, &keys, lease).await;
        }
        sat
    }

    async fn try_to_sit(&mut self, welcome: Box<Welcome>) -> Result<(), Failure> {
        let workplace = Workplace::of(&welcome.granted);
        let parameters = welcome.granted.parameters;
        let joined = Event::Joined {
            node: welcome.keys.node().clone(),
            session: welcome.keys.session().clone(),
            tool: welcome.granted.tool,
            lease: welcome.granted.lease,
            scheme: parameters.scheme,
            after_s: self
                .lost_at
                .take()
                .map(|lost_at| lost_at.elapsed().as_secs_f64()),
        };
        self.open_slow(welcome.granted.slow_endpoint.as_deref())
            .await?;
        let (_, slow) = self.slow.as_ref().expect("it was opened in the line above");
        // The old line first: it may use the same keys.
        self.line = None;
        let gone = self.gone.0.clone();
        let (line, seat) = Line::open(&self.control, slow, self.clock, welcome, gone).await?;
        self.refreshing = None;
        self.revision = parameters.revision;
        self.tally.on_lease(line.welcome.granted.lease);
        self.line = Some(line);
        self.tell(joined);

        let fitting = self
            .rig
            .take_if(|rig| rig.workplace == workplace && !rig.ticker.is_finished());
        // A device that does not fit is let go before it is opened again.
        self.rig = None;
        if let Some(mut rig) = fitting {
            rig.ends
                .orders
                .push(Order::Take(seat))
                .map_err(|_| Failure::ThreadEnded)?;
            self.rig = Some(rig);
            return Ok(());
        }
        let device = (self.options.open_device)(&workplace).map_err(Failure::Open)?;
        let name = device.name().to_owned();
        let now = Timestamp::from_nanos(self.clock.now_ns());
        let (engine, ends) = Engine::new(now, workplace.tick_s, device, seat);
        let period = Duration::from_secs_f64(workplace.tick_s);
        let config = TickerConfig {
            name: "handle-tick",
            period: self.options.clock_drift.true_span(period),
            scheduling: self.options.scheduling,
            spin: self.options.spin,
        };
        let ticker = engine.spawn(self.clock, config)?;
        self.tally.on_thread(period, ticker.scheduler());
        let scheduler = ticker.scheduler().to_owned();
        self.tell(Event::Ticking {
            device: name,
            tick_s: workplace.tick_s,
            scheduler,
        });
        self.rig = Some(Rig {
            workplace,
            ticker,
            ends,
        });
        Ok(())
    }

    async fn open_slow(&mut self, granted: Option<&str>) -> Result<(), Failure> {
        let endpoint = granted.map_or_else(
            || self.options.connect.clone(),
            |slow| reachable(slow, &self.options.connect),
        );
        if self
            .slow
            .as_ref()
            .is_some_and(|(open, _)| *open == endpoint)
        {
            return Ok(());
        }
        let endpoints = Endpoints {
            connect: vec![endpoint.clone()],
            ..Endpoints::default()
        };
        let session = network::open(&endpoints).await?;
        if let Some((_, old)) = self.slow.replace((endpoint, session)) {
            close(&old).await;
        }
        Ok(())
    }
}

/// The slow endpoint as seen from here: a server that listens everywhere names no address of its own.
fn reachable(slow: &str, connect: &str) -> String {
    let host = |endpoint: &str| {
        let address = endpoint.split_once('/').map(|(_, address)| address)?;
        address.rsplit_once(':').map(|(host, _)| host.to_owned())
    };
    match (host(slow), host(connect)) {
        (Some(everywhere), Some(known)) if everywhere == "0.0.0.0" || everywhere == "[::]" => {
            slow.replacen(&everywhere, &known, 1)
        }
        _ => slow.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_endpoint_that_listens_everywhere_is_reached_where_the_server_is() {
        let connect = "tcp/192.0.2.7:7447";
        assert_eq!(reachable("tcp/0.0.0.0:7448", connect), "tcp/192.0.2.7:7448");
        assert_eq!(
            reachable("udp/[::]:7448", "tcp/[2001:db8::1]:7447"),
            "udp/[2001:db8::1]:7448"
        );
        assert_eq!(
            reachable("tcp/127.0.0.1:7448", connect),
            "tcp/127.0.0.1:7448"
        );
    }
}
