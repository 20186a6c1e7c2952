//! What a session may be asked over ROS 2. Who asks is not known: a router lets everybody in. So it is refused, in
//! words, unless the server was told to take it; callers wait for ever for an answer that does not come, and always get
//! one.

use std::sync::Arc;
use std::time::Duration;

use teleclay_ros::own::{SetSchemeRequest, SetSchemeResponse};
use teleclay_ros::standard::{SetBoolRequest, SetBoolResponse, TriggerRequest, TriggerResponse};
use teleclay_ros::{CdrError, Message, from_cdr, names, to_cdr};
use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval};
use zenoh::query::Query;

use crate::Commands;
use crate::host::{Call, HostSession};
use crate::node::{AnsweredService, Node, now_ns};
use crate::wire::Attachment;

/// Calls of a service are that far apart, at least: whoever reaches the router could fill the logs with them.
const CALL_EVERY: Duration = Duration::from_millis(100);
/// A request that is longer is none: names of schemes are short.
const LONGEST_REQUEST: usize = 1024;
const REFUSED: &str = "this server takes no commands over ROS 2, where nobody knows who asks: --ros2-commands lets it";

const BUSY: &str = "other calls wait to be carried out";

/// A service: its name, the interface, what a request asks for, and how an answer is written.
struct Service {
    name: &'static str,
    interface: &'static str,
    read: fn(&[u8]) -> Result<Call, CdrError>,
    write: fn(success: bool, message: &str) -> Vec<u8>,
}

const SERVICES: [Service; 3] = [
    Service {
        name: "pause",
        interface: "std_srvs/srv/SetBool",
        read: |bytes| from_cdr::<SetBoolRequest>(bytes).map(|asked| Call::Pause(asked.data)),
        write: |success, message| written(&SetBoolResponse { success, message }),
    },
    Service {
        name: "reset_clay",
        interface: "std_srvs/srv/Trigger",
        read: |bytes| from_cdr::<TriggerRequest>(bytes).map(|_| Call::ResetClay),
        write: |success, message| written(&TriggerResponse { success, message }),
    },
    Service {
        name: "set_scheme",
        interface: "teleclay_msgs/srv/SetScheme",
        read: |bytes| {
            let asked = from_cdr::<SetSchemeRequest<'_>>(bytes)?;
            Ok(Call::SetScheme(asked.scheme.to_owned()))
        },
        write: |success, message| written(&SetSchemeResponse { success, message }),
    },
];

/// Answers every service of a session, each in the order of its calls.
pub(crate) async fn answer_all<S: HostSession>(
    node: &Arc<Node>,
    session: &S,
    tasks: &mut JoinSet<()>,
) {
    for service in SERVICES {
        let name = names::service(session.name(), service.name);
        let busy = (service.write)(false, BUSY);
        match node.answer(&name, service.interface, busy).await {
            Ok(answered) => {
                tasks.spawn(answer(answered, service, session.clone(), node.commands()));
            }
            Err(error) => tracing::error!(name, %error, "a service is not there on ROS 2"),
        }
    }
}

async fn answer(
    mut answered: AnsweredService,
    service: Service,
    session: impl HostSession,
    commands: Commands,
) {
    let mut pace = interval(CALL_EVERY);
    pace.set_missed_tick_behavior(MissedTickBehavior::Delay);
    while let Some(query) = answered.waiting.recv().await {
        pace.tick().await;
        let Some(asked) = asked_as(&query) else {
            let session = session.name();
            tracing::warn!(
                session,
                service.name,
                "a call over ROS 2 has no number to be answered by"
            );
            continue;
        };
        let outcome = outcome(&query, &service, &session, commands).await;
        let (success, message) = match &outcome {
            Ok(done) => (true, done),
            Err(why_not) => (false, why_not),
        };
        let attachment = Attachment {
            sent_ns: now_ns() as i64,
            ..asked
        };
        let reply = query
            .reply(query.key_expr().clone(), (service.write)(success, message))
            .attachment(attachment.to_bytes().to_vec());
        if let Err(error) = reply.await {
            tracing::warn!(%error, "an answer over ROS 2 was not sent");
        }
    }
}

/// What a caller knows its answer by.
fn asked_as(query: &Query) -> Option<Attachment> {
    Attachment::from_bytes(&query.attachment()?.to_bytes())
}

/// What is now, or why not.
async fn outcome(
    query: &Query,
    service: &Service,
    session: &impl HostSession,
    commands: Commands,
) -> Result<String, String> {
    let payload = query.payload().map(|payload| payload.to_bytes());
    let payload = payload.unwrap_or_default();
    if LONGEST_REQUEST < payload.len() {
        return Err(format!("{} bytes are no request", payload.len()));
    }
    let call = (service.read)(&payload).map_err(|error| error.to_string())?;
    match commands {
        Commands::Refused => {
            tracing::warn!(session = session.name(), %call, "refused over ROS 2");
            Err(REFUSED.to_owned())
        }
        Commands::Taken => {
            tracing::info!(session = session.name(), %call, "asked for over ROS 2");
            session.carry_out(call).await
        }
    }
}

fn written(message: &impl Message) -> Vec<u8> {
    let mut bytes = Vec::new();
    to_cdr(message, &mut bytes);
    bytes
}
