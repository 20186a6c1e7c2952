//! A session as one client is told of it.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::{Value, json};
use teleclay_foxglove::Connection;
use teleclay_foxglove::connection::Flow;
use teleclay_foxglove::server::{Channel, Service};
use teleclay_proto::watch::{Level, TelemetrySample};
use teleclay_ros::names::{self, Topic};
use teleclay_ros::{SessionClock, definition, standard::TransformStamped};
use teleclay_session::{Operator, Settings, Snapshot};
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::TryRecvError;

use super::services::Errand;
use crate::directory::Live;
use crate::ros::{self, Frames, Quantity, Told};
use crate::{Event, Sample};

/// A tool of which no sample has come for so long is nowhere, s: nobody holds it.
const GONE_AFTER_S: f64 = 0.5;

/// Something that waits to be written as a message.
#[derive(Clone, Debug)]
pub(super) enum Piece {
    /// One quantity of a sample.
    Sample {
        quantity: Quantity,
        frames: Arc<Frames>,
        sample: Box<TelemetrySample>,
        operator: Option<Arc<Operator>>,
        is_connected: bool,
    },
    /// A message as it is.
    Written(Vec<u8>),
}

impl Piece {
    /// Writes it as the message of this moment, ns since 1970.
    pub(super) fn write(&self, time_ns: u64, out: &mut Vec<u8>) {
        match self {
            Self::Sample {
                quantity,
                frames,
                sample,
                operator,
                is_connected,
            } => {
                let told = Told {
                    frames,
                    time_ns,
                    sample,
                    operator: operator.as_ref().map_or("", |operator| &operator.name),
                    is_connected: *is_connected,
                };
                told.write(*quantity, out);
            }
            Self::Written(bytes) => out.clone_from(bytes),
        }
    }
}

/// Numbers of channels and services, each given once.
#[derive(Debug, Default)]
pub(super) struct Numbers(u32);

impl Numbers {
    pub(super) fn next(&mut self) -> u32 {
        self.0 += 1;
        self.0
    }
}

/// A channel of a topic.
pub(super) fn channel(id: u32, topic: &Topic) -> Channel {
    Channel {
        id,
        topic: topic.name.clone(),
        encoding: "cdr".to_owned(),
        schema_name: topic.message.to_owned(),
        schema: definition(topic.message).unwrap_or_default(),
        schema_encoding: "ros2msg".to_owned(),
    }
}

/// A session, and the numbers of its channels and services.
pub(super) struct Followed {
    live: Live,
    clock: SessionClock,
    events: Receiver<Event>,
    samples: Option<Receiver<Sample>>,
    events_id: u32,
    settings_id: u32,
    service_ids: [u32; Errand::ALL.len()],
    tools: Vec<Tool>,
    /// The settings that were told last.
    settings: Arc<Settings>,
    /// The newest moment of a sample, s of the session.
    newest_s: f64,
}

struct Tool {
    frames: Arc<Frames>,
    ids: [u32; Quantity::ALL.len()],
    newest: Option<(f64, TelemetrySample)>,
}

impl Followed {
    /// Begins to follow a session; what is to be offered of it.
    pub(super) fn begin(
        live: Live,
        numbers: &mut Numbers,
    ) -> (Self, Vec<(Channel, Flow)>, Vec<Service>) {
        let session = live.id().to_string();
        let snapshot = live.snapshot();
        let topics = names::session_topics(&session);
        let (events_id, settings_id) = (numbers.next(), numbers.next());
        let mut channels = vec![
            (channel(events_id, &topics.events), Flow::State),
            (channel(settings_id, &topics.settings), Flow::State),
        ];
        let tools = (1..=snapshot.tools.len() as u32).map(|tool| {
            let topics = names::topics(&session, tool);
            let ids = Quantity::ALL.map(|quantity| {
                let id = numbers.next();
                channels.push((channel(id, quantity.topic(&topics)), Flow::Samples));
                id
            });
            Tool {
                frames: Arc::new(Frames::of(&session, tool)),
                ids,
                newest: None,
            }
        });
        let tools = tools.collect();
        let service_ids = Errand::ALL.map(|_| numbers.next());
        let services = Errand::ALL.iter().zip(service_ids);
        let services = services.map(|(errand, id)| errand.describe(id, &session));
        let followed = Self {
            events: live.events(),
            samples: None,
            clock: SessionClock::default(),
            events_id,
            settings_id,
            service_ids,
            tools,
            settings: snapshot.settings,
            newest_s: 0.0,
            live,
        };
        (followed, channels, services.collect())
    }

    pub(super) fn live(&self) -> &Live {
        &self.live
    }

    /// Everything that was offered of it.
    pub(super) fn channel_ids(&self) -> Vec<u32> {
        let tools = self.tools.iter().flat_map(|tool| tool.ids);
        [self.events_id, self.settings_id]
            .into_iter()
            .chain(tools)
            .collect()
    }

    pub(super) fn service_ids(&self) -> Vec<u32> {
        self.service_ids.to_vec()
    }

    /// The service of this number, if it is one of the session's.
    pub(super) fn errand(&self, service_id: u32) -> Option<Errand> {
        let mut errands = Errand::ALL.into_iter().zip(self.service_ids);
        errands.find_map(|(errand, id)| (id == service_id).then_some(errand))
    }

    /// A channel was subscribed to: what holds now is told, where it is one of those that tell of changes.
    pub(super) fn on_subscribed(
        &self,
        channel_id: u32,
        now_ns: u64,
        connection: &mut Connection<Piece>,
    ) {
        if channel_id == self.settings_id {
            let message = ros::settings(&self.settings, now_ns);
            connection.push_state(channel_id, now_ns, &message);
        }
    }

    /// Tells what has happened and changed since the last time.
    pub(super) fn tell_state(&mut self, now_ns: u64, connection: &mut Connection<Piece>) {
        loop {
            let event = match self.events.try_recv() {
                Ok(event) => event,
                Err(TryRecvError::Lagged(missed)) => Event {
                    level: Level::Warning,
                    text: format!(
                        "{missed} events are not shown: they came faster than they were read"
                    ),
                    time_s: self.newest_s,
                },
                Err(TryRecvError::Empty | TryRecvError::Closed) => break,
            };
            if connection.wants(self.events_id) {
                let time_ns = self.clock.stamp_ns(event.time_s, now_ns);
                connection.push_state(self.events_id, time_ns, &ros::event(&event, time_ns));
            }
        }
        let settings = self.live.snapshot().settings;
        if !Arc::ptr_eq(&settings, &self.settings) {
            self.settings = settings;
            self.on_subscribed(self.settings_id, now_ns, connection);
        }
    }

    /// Hands on the samples since the last time, where anybody wants them.
    pub(super) fn tell_samples(
        &mut self,
        now_ns: u64,
        tf_id: u32,
        connection: &mut Connection<Piece>,
    ) {
        let mut ids = self.tools.iter().flat_map(|tool| tool.ids);
        if !(connection.wants(tf_id) || ids.any(|id| connection.wants(id))) {
            self.samples = None;
            return;
        }
        let channel = self.samples.get_or_insert_with(|| self.live.telemetry());
        let mut samples = Vec::new();
        loop {
            match channel.try_recv() {
                Ok(sample) => samples.push(sample),
                // The oldest are gone, as they would be anyway.
                Err(TryRecvError::Lagged(_)) => {}
                Err(TryRecvError::Empty | TryRecvError::Closed) => break,
            }
        }
        let Some(newest) = samples.last() else { return };
        self.newest_s = newest.time_s;
        self.clock.observe(now_ns, newest.time_s);
        let snapshot = self.live.snapshot();
        for Sample {
            tool,
            time_s,
            sample,
            ..
        } in samples
        {
            let slot = tool as usize - 1;
            let Some(tool) = self.tools.get_mut(slot) else {
                continue;
            };
            tool.newest = Some((time_s, sample));
            let time_ns = self.clock.stamp_ns(time_s, now_ns);
            let holder = snapshot.tools[slot].holder.as_ref();
            for (quantity, id) in Quantity::ALL.into_iter().zip(tool.ids) {
                if connection.wants(id) {
                    let piece = Piece::Sample {
                        quantity,
                        frames: Arc::clone(&tool.frames),
                        sample: Box::new(sample),
                        operator: holder.map(|holder| Arc::clone(&holder.operator)),
                        is_connected: holder.is_some_and(|holder| holder.is_connected),
                    };
                    connection.push_sample(id, time_s, time_ns, piece);
                }
            }
        }
    }

    /// Where its tools are, as frames.
    pub(super) fn transforms(&self, now_ns: u64) -> Vec<TransformStamped<'_>> {
        let home_m = self.settings.parameters.home_m;
        let there = self.tools.iter().filter_map(|tool| {
            let (time_s, sample) = tool.newest.as_ref()?;
            (self.newest_s - time_s < GONE_AFTER_S).then(|| {
                let told = Told {
                    frames: &tool.frames,
                    time_ns: self.clock.stamp_ns(*time_s, now_ns),
                    sample,
                    operator: "",
                    is_connected: true,
                };
                told.transforms(home_m)
            })
        });
        there.flatten().collect()
    }

    /// What parameters say of it.
    pub(super) fn facts(&self, facts: &mut BTreeMap<String, Value>) {
        let Snapshot {
            revision,
            settings,
            stop,
            ..
        } = self.live.snapshot();
        let id = self.live.id();
        let mut tell = |name: &str, value: Value| {
            facts.insert(format!("teleclay.session.{id}.{name}"), value);
        };
        tell("revision", json!(revision));
        tell("scheme", json!(settings.spec.scheme.word()));
        tell("paused", json!(settings.is_paused));
        tell("tools", json!(settings.spec.tools));
        tell(
            "stopped_by",
            json!(stop.map_or_else(String::new, |stop| stop.by.to_string())),
        );
    }
}
