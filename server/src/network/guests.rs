//! Those who lose their tool: guests whose invite ends, and whoever is stopped, relieved or silent. They are told by a
//! word that nobody else can say.

use std::time::Duration;

use teleclay_channel::Purpose;
use teleclay_proto::RealmName;
use teleclay_proto::join::Farewell;
use teleclay_proto::keys::SessionKeys;
use tokio::sync::mpsc::UnboundedReceiver;
use tokio::sync::watch;
use tokio::time::{MissedTickBehavior, interval};
use zenoh::Session;
use zenoh::qos::{CongestionControl, Priority};

use super::json;
use super::sessions::Sessions;
use crate::directory::Directory;
use crate::session::{Departure, tool_id};

/// Invites end to the second.
const EVERY: Duration = Duration::from_secs(1);

pub(super) async fn let_go_of_guests(session: Session, directory: Directory) {
    let mut every = interval(EVERY);
    every.set_missed_tick_behavior(MissedTickBehavior::Delay);
    while !session.is_closed() {
        every.tick().await;
        directory.let_go_of_guests().await;
    }
}

/// Says goodbye to whoever has to go.
pub(super) async fn say_farewells(
    sessions: watch::Receiver<Sessions>,
    realm: RealmName,
    mut departed: UnboundedReceiver<Departure>,
) {
    while let Some(departure) = departed.recv().await {
        let Departure {
            session: id,
            slot,
            holder,
            reason,
        } = departure;
        let farewell = Farewell::fitting(holder.lease, &reason);
        let keys = SessionKeys::new(realm.clone(), id);
        let sealed = holder.channel.seal(Purpose::Leave, &json(&farewell));
        let control = sessions.borrow().control.clone();
        // An error means that the session is closing. Should it get lost, silence tells the same, later.
        let _ = control
            .put(keys.tool_farewell(tool_id(slot)), sealed)
            .congestion_control(CongestionControl::Drop)
            .priority(Priority::RealTime)
            .await;
    }
}
