//! Snapshots of the clay on their way to handles that asked for one.

use teleclay_link::scheme::replica::Snapshot;

use super::Rig;
use super::hand::UnderWay;

impl Rig {
    pub(super) fn deliver_snapshots(&mut self) {
        let now = self.now;
        for hand in &mut self.hands {
            if let Some(wanted) = hand.handle.wanted_snapshot() {
                let is_new = hand
                    .snapshot
                    .as_ref()
                    .is_none_or(|under_way| under_way.number != wanted.number);
                if is_new {
                    let taken = now.after(self.lines.up.delay);
                    hand.snapshot = Some(UnderWay {
                        number: wanted.number,
                        taken,
                        due: taken.after(self.lines.down.delay),
                        snapshot: None,
                    });
                }
            }
            let Some(under_way) = &mut hand.snapshot else {
                continue;
            };
            if under_way.snapshot.is_none() && under_way.taken <= now {
                under_way.snapshot = Some(Snapshot {
                    clay: Box::new(self.session.clay().clone()),
                    epoch: self.session.clay_epoch(),
                });
            }
            if under_way.due <= now
                && let Some(snapshot) = under_way.snapshot.take()
            {
                hand.handle.handle_snapshot(snapshot);
                hand.snapshot = None;
            }
        }
    }
}
