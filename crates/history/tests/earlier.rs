//! What an earlier program has written is read: a session of three tools, in snapshot and records of version 1.
//!
//! Ada, Bob and Eve join; Ada cuts, the block is made fresh, Ada cuts on, another server goes on, Eve leaves, a stroke
//! is undone, Bob's numbers are none, Ada cuts on.

use teleclay_history::{Fact, Record, Replay, State};
use teleclay_link::safety::{Flaw, Implausible};
use teleclay_session::{EventKind, Rules, Session};

const SNAPSHOT: &[u8] = include_bytes!("old/version_1.snapshot");
const RECORDS: &[u8] = include_bytes!("old/version_1.records");
const HASH: u64 = 0xab18_7f6f_5dc7_ae26;

/// Each stands behind its length in four bytes.
fn records() -> Vec<&'static [u8]> {
    let mut rest = RECORDS;
    let mut records = Vec::new();
    while let Some((length, behind)) = rest.split_first_chunk() {
        let (record, behind) = behind.split_at(u32::from_le_bytes(*length) as usize);
        records.push(record);
        rest = behind;
    }
    records
}

#[test]
fn a_snapshot_of_version_1_is_read_and_has_no_stop_and_no_reservation() {
    assert_eq!(SNAPSHOT[0], 1);
    let mut state = State::decode(SNAPSHOT).unwrap();
    assert_eq!(state.clay.hash(), HASH);
    assert_eq!((state.next_lease, state.strokes.next()), (4, 4));
    assert_eq!(state.clay.removed_units(), 25_422);
    let session = &state.session;
    assert_eq!((session.ownership_epoch, session.clay_epoch), (2, 3));
    assert_eq!(session.stop, None);
    assert!(session.tools.iter().all(|tool| tool.reserved_for.is_none()));
    let holders: Vec<_> = session
        .tools
        .iter()
        .map(|tool| tool.holder.as_ref())
        .collect();
    let [Some(ada), Some(bob), None] = holders[..] else {
        panic!("{holders:?}")
    };
    assert_eq!((ada.lease, &*ada.operator.name), (1, "Ada"));
    assert!(ada.is_connected && ada.fault.is_none());
    assert_eq!((bob.lease, &*bob.operator.name), (2, "Bob"));
    let fault = Implausible {
        field: "position_m",
        flaw: Flaw::NotFinite,
    };
    assert_eq!((bob.is_connected, bob.fault), (false, Some(fault)));

    let again = state.encode();
    assert_eq!(again[0], 2);
    let again = State::decode(&again).unwrap();
    assert_eq!(again.session, state.session);
    let recovered = Session::recover(
        teleclay_link::time::Timestamp::ZERO,
        again.into_recovery(Rules::default()),
    );
    assert!(recovered.unwrap().side(0).is_some());
}

/// Which cuts belong to a stroke is told otherwise since: what a tool clears where it stands before its hand is heard
/// belongs to none. So the clay is followed up to where a stroke is undone, and the rest is read.
#[test]
fn records_of_version_1_are_followed_to_where_a_stroke_is_undone_and_are_written_as_they_were() {
    let records = records();
    assert_eq!(records.len(), 302);
    let mut replay = Replay::begin(records[0], Vec::new()).unwrap().checking();
    let mut followed = 1;
    let is_undone = |fact: &Fact| {
        let Fact::Told { kind, .. } = fact else {
            return false;
        };
        matches!(kind, EventKind::Exchanged { .. })
    };
    for record in &records[1..] {
        if Record::decode(record).unwrap().facts.iter().any(is_undone) {
            break;
        }
        // Whatever it tells that a tool has removed, the replay has removed.
        replay.apply(record).unwrap();
        followed += 1;
    }
    println!("{followed} records were followed");
    assert!((60..records.len()).contains(&followed), "{followed}");
    for record in &records {
        assert_eq!(Record::decode(record).unwrap().encode(), **record);
    }
    let told = replay.into_state();
    let snapshot = State::decode(SNAPSHOT).unwrap();
    assert_eq!(told.next_lease, snapshot.next_lease);
    assert_eq!(told.session.clay_epoch + 1, snapshot.session.clay_epoch);
    assert_eq!(
        told.session.ownership_epoch,
        snapshot.session.ownership_epoch
    );
    let names = |state: &State| -> Vec<Option<String>> {
        let tools = state.session.tools.iter();
        let holders = tools.map(|tool| tool.holder.as_ref());
        holders
            .map(|holder| holder.map(|holder| holder.operator.name.clone()))
            .collect()
    };
    assert_eq!(names(&told), names(&snapshot));
}
