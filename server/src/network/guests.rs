//! Guests whose invite ends while they hold a tool: they lose it, and are told by a word that nobody else can say.

use std::time::Duration;

use teleclay_channel::Purpose;
use teleclay_proto::RealmName;
use teleclay_proto::join::Farewell;
use teleclay_proto::keys::SessionKeys;
use tokio::time::{MissedTickBehavior, interval};
use zenoh::Session;
use zenoh::qos::{CongestionControl, Priority};

use super::json;
use crate::directory::Directory;

/// Invites end to the second.
const EVERY: Duration = Duration::from_secs(1);

pub(super) async fn let_go_of_guests(session: Session, realm: RealmName, directory: Directory) {
    let mut every = interval(EVERY);
    every.set_missed_tick_behavior(MissedTickBehavior::Delay);
    while !session.is_closed() {
        every.tick().await;
        for (live, slot, holder) in directory.let_go_of_guests().await {
            let farewell = Farewell {
                lease: holder.lease,
                reason: "the invite has ended".to_owned(),
            };
            let keys = SessionKeys::new(realm.clone(), live.id().clone());
            let sealed = holder.channel.seal(Purpose::Leave, &json(&farewell));
            // An error means that the session is closing. Should it get lost, silence tells the same, later.
            let _ = session
                .put(keys.tool_farewell(crate::session::tool_id(slot)), sealed)
                .congestion_control(CongestionControl::Drop)
                .priority(Priority::RealTime)
                .await;
        }
    }
}
