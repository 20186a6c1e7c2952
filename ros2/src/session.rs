//! What is told of one session: seven stamped topics per tool and where its frames lie, at the rate of its samples; the
//! line, energy and corrections of each tool, in types of our own; what happens; and once a second its settings.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use teleclay_ros::SessionClock;
use teleclay_ros::names::{
    self, Topic, clay_frame, handle_frame, session_topics, tool_frame, topics,
};
use teleclay_ros::own::{Corrections, Energy, Event, Link, Settings};
use teleclay_ros::standard::{
    Header, Point, Pose, PoseStamped, Quaternion, TfMessage, Time, Transform, TransformStamped,
    Twist, TwistStamped, Vector3, Wrench, WrenchStamped,
};
use teleclay_wire::TelemetrySample;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval};

use crate::host::{self, HostSession, Level, Look};
use crate::node::{Node, PublishedTopic, now_ns};
use crate::service;
use crate::wire::Quality;

/// How often what changes slowly is told: whoever comes later knows it within that.
const SLOW_EVERY: Duration = Duration::from_secs(1);

/// Tells of a session until that ends, or this is dropped.
pub(crate) async fn tell<S: HostSession>(node: Arc<Node>, session: S) {
    let (mut samples, mut events) = (session.telemetry(), session.events());
    let mut teller = match Teller::open(&node, &session).await {
        Ok(teller) => teller,
        Err(error) => {
            let session = session.name();
            return tracing::error!(session, %error, "a session is not told of on ROS 2");
        }
    };
    // Calls may take long, and are answered beside.
    let mut calls = JoinSet::new();
    service::answer_all(&node, &session, &mut calls).await;
    let mut slow = interval(SLOW_EVERY);
    slow.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut events_end = false;
    loop {
        tokio::select! {
            sample = next(&mut samples, &node) => match sample {
                Some(sample) => teller.sample(sample.into()).await,
                None => return,
            },
            event = next(&mut events, &node), if !events_end => match event {
                Some(event) => teller.event(event.into()).await,
                None => events_end = true,
            },
            _ = slow.tick() => {
                teller.look = session.look();
                teller.settings().await;
            }
        }
    }
}

/// The next that there is; what was missed is counted. None at the end.
async fn next<T: Clone>(from: &mut Receiver<T>, node: &Node) -> Option<T> {
    loop {
        match from.recv().await {
            Ok(next) => return Some(next),
            Err(RecvError::Lagged(missed)) => {
                node.status().missed.fetch_add(missed, Ordering::Relaxed);
            }
            Err(RecvError::Closed) => return None,
        }
    }
}

/// The topics of a session.
struct Teller {
    node: Arc<Node>,
    tools: Vec<ToolTeller>,
    clay_frame: String,
    events: PublishedTopic,
    settings: PublishedTopic,
    look: Look,
    clock: SessionClock,
}

/// The topics of a tool.
struct ToolTeller {
    handle_pose: PublishedTopic,
    tool_pose: PublishedTopic,
    handle_twist: PublishedTopic,
    tool_twist: PublishedTopic,
    hand_wrench: PublishedTopic,
    felt_wrench: PublishedTopic,
    tool_wrench: PublishedTopic,
    link: PublishedTopic,
    energy: PublishedTopic,
    corrections: PublishedTopic,
    handle_frame: String,
    tool_frame: String,
}

impl Teller {
    async fn open(node: &Arc<Node>, session: &impl HostSession) -> zenoh::Result<Self> {
        let (name, look) = (session.name(), session.look());
        let mut tools = Vec::new();
        for tool in 1..=look.tools.len() as u32 {
            tools.push(ToolTeller::open(node, name, tool).await?);
        }
        let topics = session_topics(name);
        Ok(Self {
            tools,
            clay_frame: clay_frame(name),
            events: node.publish(&topics.events, Quality::Reliable).await?,
            settings: node.publish(&topics.settings, Quality::Reliable).await?,
            node: Arc::clone(node),
            look,
            clock: SessionClock::default(),
        })
    }

    async fn sample(
        &mut self,
        host::Sample {
            tool,
            time_s,
            sample,
        }: host::Sample,
    ) {
        let stamp = self.stamp(time_s);
        let slot = (tool as usize).wrapping_sub(1);
        let Some(topics) = self.tools.get(slot) else {
            return;
        };
        topics.motion(stamp, &self.clay_frame, &sample).await;
        topics.forces(stamp, &sample).await;
        let who = self.look.tools.get(slot);
        let link = Link {
            stamp,
            rtt_s: sample.rtt_s.into(),
            age_s: sample.age_s.into(),
            connected: who.is_some_and(|who| who.is_connected),
            operator_name: who.map_or("", |who| &who.operator),
        };
        topics.link.put(&link).await;
        let transforms = topics.transforms(stamp, &self.clay_frame, self.look.home_m, &sample);
        self.node.tf().put(&TfMessage { transforms }).await;
    }

    async fn event(&mut self, event: host::Event) {
        let told = Event {
            stamp: self.stamp(event.time_s),
            level: match event.level {
                Level::Fine => Event::INFO,
                Level::Warning => Event::WARNING,
                Level::Error => Event::ERROR,
            },
            text: &event.text,
        };
        self.events.put(&told).await;
    }

    /// The time of day at the session's `time_s`, of which news is here now.
    fn stamp(&mut self, time_s: f64) -> Time {
        let now_ns = now_ns();
        self.clock.observe(now_ns, time_s);
        Time::from_ns(self.clock.stamp_ns(time_s, now_ns))
    }

    async fn settings(&self) {
        let told = Settings {
            stamp: Time::from_ns(now_ns()),
            revision: self.look.revision,
            json: &self.look.settings,
        };
        self.settings.put(&told).await;
    }
}

impl ToolTeller {
    async fn open(node: &Node, session: &str, tool: u32) -> zenoh::Result<Self> {
        let names::ToolTopics {
            handle_pose,
            tool_pose,
            handle_twist,
            tool_twist,
            hand_wrench,
            felt_wrench,
            tool_wrench,
            link,
            energy,
            corrections,
            handle_frame: _,
        } = topics(session, tool);
        let publish = async |topic: Topic| node.publish(&topic, Quality::BestEffort).await;
        Ok(Self {
            handle_pose: publish(handle_pose).await?,
            tool_pose: publish(tool_pose).await?,
            handle_twist: publish(handle_twist).await?,
            tool_twist: publish(tool_twist).await?,
            hand_wrench: publish(hand_wrench).await?,
            felt_wrench: publish(felt_wrench).await?,
            tool_wrench: publish(tool_wrench).await?,
            link: publish(link).await?,
            energy: publish(energy).await?,
            corrections: publish(corrections).await?,
            handle_frame: handle_frame(session, tool),
            tool_frame: tool_frame(session, tool),
        })
    }

    async fn motion(&self, stamp: Time, clay_frame: &str, sample: &TelemetrySample) {
        let of_handle = header(stamp, &self.handle_frame);
        let in_clay = header(stamp, clay_frame);
        for (topic, header, position_m) in [
            (&self.handle_pose, of_handle, sample.handle_position_m),
            (&self.tool_pose, in_clay, sample.tool_position_m),
        ] {
            let pose = Pose {
                position: Point::from(position_m.map(f64::from)),
                orientation: Quaternion::default(),
            };
            topic.put(&PoseStamped { header, pose }).await;
        }
        for (topic, header, velocity_m_s) in [
            (&self.handle_twist, of_handle, sample.handle_velocity_m_s),
            (&self.tool_twist, in_clay, sample.tool_velocity_m_s),
        ] {
            let twist = Twist {
                linear: vector(velocity_m_s),
                angular: Vector3::default(),
            };
            topic.put(&TwistStamped { header, twist }).await;
        }
    }

    async fn forces(&self, stamp: Time, sample: &TelemetrySample) {
        for (topic, frame, force_n) in [
            (&self.hand_wrench, &self.handle_frame, sample.hand_force_n),
            (&self.felt_wrench, &self.handle_frame, sample.felt_force_n),
            (&self.tool_wrench, &self.tool_frame, sample.tool_force_n),
        ] {
            let wrench = Wrench {
                force: vector(force_n),
                torque: Vector3::default(),
            };
            let header = header(stamp, frame);
            topic.put(&WrenchStamped { header, wrench }).await;
        }
        let energy = Energy {
            stamp,
            handle_j: sample.energy_handle_j.into(),
            tool_j: sample.energy_tool_j.into(),
        };
        self.energy.put(&energy).await;
        let corrections = Corrections {
            stamp,
            step_n: sample.correction_step_n.into(),
            held_n: sample.correction_held_n.into(),
        };
        self.corrections.put(&corrections).await;
    }

    /// Where the tool's frame lies in the clay's, and the handle's. That one rests, and is told as often: whoever comes
    /// later needs it too.
    fn transforms<'a>(
        &'a self,
        stamp: Time,
        clay_frame: &'a str,
        home_m: [f64; 3],
        sample: &TelemetrySample,
    ) -> Vec<TransformStamped<'a>> {
        let place = |child_frame_id: &'a str, at_m: [f64; 3]| TransformStamped {
            header: header(stamp, clay_frame),
            child_frame_id,
            transform: Transform {
                translation: at_m.into(),
                rotation: Quaternion::default(),
            },
        };
        vec![
            place(&self.tool_frame, sample.tool_position_m.map(f64::from)),
            place(&self.handle_frame, home_m),
        ]
    }
}

fn header(stamp: Time, frame_id: &str) -> Header<'_> {
    Header { stamp, frame_id }
}

fn vector(of: [f32; 3]) -> Vector3 {
    of.map(f64::from).into()
}
