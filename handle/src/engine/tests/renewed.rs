//! Another lease of the same session: the handle side goes on, with what only it knows.

use std::collections::BTreeSet;

use teleclay_link::replica::SweepInbox;
use teleclay_proto::frame::SweepRecord;

use super::*;

/// What the guard lets the force change by in a tick, N: 2000 N/s.
const SLEW_STEP_N: f64 = 2.0 + 1e-9;

impl Bench {
    fn side(&self) -> &HandleSide {
        &self.realtime.machine().attachment.side
    }

    /// The tool side of another lease takes the place of the one before.
    fn renew(&mut self, lease: u32, ownership_epoch: u32) {
        let of = self.tool.frame.header.lease;
        let (mut tool, ends) = line(lease, Clock::start());
        tool.frame.header = teleclay_proto::frame::Header {
            lease,
            ownership_epoch,
            sequence: 0,
            ..self.tool.frame.header
        };
        self.tool = tool;
        self.order_renewal(of, ends);
    }

    fn order_renewal(&mut self, of: u32, ends: LineEnds) {
        let renewal = Box::new(Renewal { of, ends });
        assert!(self.ends.orders.push(Order::Renew(renewal)).is_ok());
    }

    /// Under the replica, with a copy of the clay that the hand pushes into.
    fn on_a_copy() -> Self {
        let mut bench = Self::new(pushing());
        bench.tool.frame.header.scheme = Scheme::Replica;
        bench.tool.frame.header.clay_epoch = 3;
        bench.couple_for(5);
        let description = granted(1).clay;
        let shape = teleclay_bilateral::clay_shape(&description.shape).unwrap();
        let clay = Box::new(teleclay_clay::Clay::new(&shape, 1e-3).unwrap());
        let snapshot = Snapshot { clay, epoch: 3 };
        let load = Order::LoadSnapshot { lease: 1, snapshot };
        assert!(bench.ends.orders.push(load).is_ok());
        assert_eq!(bench.couple_for(2).copy, CopyState::Live);
        while bench.ends.done.pop().is_ok() {}
        bench
    }
}

/// What a server knows of a handle's sweeps: those that it has, and which of them it heard under this lease.
struct Server {
    has: BTreeSet<u32>,
    inbox: SweepInbox,
}

impl Server {
    /// One that has the first so many of them from its journal, and a new tool side.
    fn recovered(sweeps: u32) -> Self {
        Self {
            has: (1..=sweeps).collect(),
            inbox: SweepInbox::default(),
        }
    }

    /// A tick with frames both ways. What is durable never goes beyond `durable`.
    fn tick(&mut self, bench: &mut Bench, durable: u32) -> Record {
        bench.tool.frame.sweeps_acknowledged = self.inbox.complete();
        self.inbox.fill(&mut bench.tool.frame.sweep_gaps);
        bench.tool.frame.sweeps_durable = durable.min(self.inbox.complete());
        bench.tool_speaks();
        let record = bench.tick();
        let frame = bench.side().frame_to_send().expect("every tick sends");
        self.inbox.skip_to(frame.sweeps.oldest_unacknowledged);
        for sweep in &frame.sweeps {
            self.inbox.on_sweep(sweep.sequence);
            self.has.insert(sweep.sequence);
        }
        record
    }
}

/// Merged up to 300 or so, durable up to 100: the next server has 150. The hand never leaves its copy, and cuts on.
#[test]
fn a_server_that_comes_back_with_less_gets_what_it_lacks_and_the_hand_feels_nothing_of_it() {
    let mut bench = Bench::on_a_copy();
    let mut before = Server::recovered(0);
    for _ in 0..700 {
        before.tick(&mut bench, 100);
    }
    let log = bench.side().clay_copy().unwrap().log();
    let (last, acknowledged) = (log.last(), log.acknowledged());
    assert!(300 < acknowledged, "{acknowledged} merged");
    let felt_n = bench.tick().felt_force_n[0];
    assert!(felt_n < -0.3, "{felt_n} N: it cuts");
    for _ in 0..300 {
        bench.tick();
    }
    bench.told();
    bench.renew(2, 2);
    let record = bench.tick();
    assert_eq!((record.lease, record.is_heard), (2, false));
    assert_eq!(
        (record.mode, record.link_state),
        (Mode::Coupled, LinkState::OnCopy)
    );
    assert_eq!(replaced::discarded(&mut bench), ["renewal"]);
    let mut next = Server::recovered(150);
    let mut durable = 100;
    for tick in 0..1000 {
        // Later its journal has everything.
        durable = if tick < 500 { durable } else { u32::MAX };
        let record = next.tick(&mut bench, durable);
        assert_eq!(
            (record.mode, record.copy),
            (Mode::Coupled, CopyState::Live),
            "{tick}"
        );
        assert_eq!(record.wanted.snapshot, None, "{tick}: it keeps its copy");
        assert!(
            record.felt_force_n[0] < 0.3 * felt_n,
            "{tick}: {:?}",
            record.felt_force_n
        );
    }
    let log = bench.side().clay_copy().unwrap().log();
    assert!(last + 500 < log.last(), "it cut on");
    let lacks: Vec<u32> = (1..=log.last() - 20)
        .filter(|sweep| !next.has.contains(sweep))
        .collect();
    assert_eq!(lacks, [0; 0]);
    assert!(log.kept() < 20, "{} are kept", log.kept());
    let (force_n, velocity_m_s) = steps(&bench.told());
    assert!(force_n <= SLEW_STEP_N / 4.0, "{force_n} N in a tick");
    assert!(
        velocity_m_s <= VELOCITY_STEP_M_S,
        "{velocity_m_s} m/s in a tick"
    );
}

/// A server whose end was seen lets the hand go, copy or not; its successor's lease brings the force back by the ramp.
#[test]
fn on_a_copy_the_force_goes_with_the_server_and_comes_back_with_the_lease_by_the_ramp() {
    let mut bench = Bench::on_a_copy();
    let mut server = Server::recovered(0);
    for _ in 0..500 {
        server.tick(&mut bench, 0);
    }
    bench.told();
    assert!(bench.ends.orders.push(Order::Release { lease: 1 }).is_ok());
    for _ in 0..51 {
        bench.tick();
    }
    let record = bench.tick();
    assert_eq!(
        (record.link_state, record.felt_force_n),
        (LinkState::Gone, [0.0; 3])
    );
    bench.renew(2, 2);
    let record = bench.tick();
    assert!(-0.1 < record.felt_force_n[0], "{:?}", record.felt_force_n);
    let mut server = Server::recovered(0);
    for _ in 0..200 {
        server.tick(&mut bench, 0);
    }
    assert!(server.tick(&mut bench, 0).felt_force_n[0] < -0.3);
    let (force_n, _) = steps(&bench.told());
    assert!(force_n <= SLEW_STEP_N / 4.0, "{force_n} N in a tick");
}

/// Nobody is heard under one lease after the other: the copy's two seconds and its fading are of the silence, and not
/// of the lease.
#[test]
fn leases_without_frames_do_not_lengthen_what_a_copy_may() {
    let mut bench = Bench::on_a_copy();
    let mut server = Server::recovered(0);
    for _ in 0..500 {
        server.tick(&mut bench, 0);
    }
    for lease in 2..7 {
        bench.renew(lease, 1);
        for _ in 0..700 {
            bench.tick();
        }
    }
    let record = bench.tick();
    assert_eq!((record.lease, record.copy), (6, CopyState::Stale));
    assert_eq!(
        (record.link_state, record.felt_force_n),
        (LinkState::OnStaleCopy, [0.0; 3])
    );
}

/// The same server numbers what it relays anew under another lease, and takes nothing for relayed.
#[test]
fn what_others_cut_is_taken_in_under_another_lease_of_the_same_server() {
    let mut bench = Bench::on_a_copy();
    let relay = |bench: &mut Bench, count: i32| {
        bench.tool.frame.relayed.clear();
        bench.tool.frame.relayed.oldest_unacknowledged = 1;
        for sequence in 1..=count {
            let (from, to) = ([1000 * sequence, 0, 0], [1000 * sequence + 50, 0, 0]);
            let sweep = SweepRecord {
                sequence: sequence as u32,
                from,
                to,
            };
            bench.tool.frame.relayed.push(sweep).unwrap();
        }
        bench.couple_for(3);
        bench.side().frame().relayed_acknowledged
    };
    assert_eq!(relay(&mut bench, 5), 5);
    bench.renew(2, 1);
    assert_eq!(relay(&mut bench, 2), 2);
}

#[test]
fn without_a_copy_the_force_goes_by_silence_and_comes_back_by_the_ramp_without_a_brake() {
    let mut bench = Bench::new(pushing());
    bench.couple_for(300);
    let sequence = bench.side().frame().header.sequence;
    let ticks = (1..)
        .find(|_| bench.tick().felt_force_n == [0.0; 3])
        .unwrap();
    assert!(ticks <= 151, "{ticks}");
    bench.renew(2, 2);
    for _ in 0..100 {
        let record = bench.tick();
        assert_eq!(
            (record.lease, record.mode, record.is_heard),
            (2, Mode::Coupled, false)
        );
        assert_eq!(record.felt_force_n, [0.0; 3], "nobody has spoken");
    }
    assert!(bench.couple_for(1).is_heard);
    let record = bench.couple_for(200);
    assert_eq!(
        (record.link_state, record.felt_force_n),
        (LinkState::Live, [-3.0, 0.0, 0.0])
    );
    assert!(
        sequence + 400 < bench.side().frame().header.sequence,
        "it is the same side"
    );
    let (force_n, velocity_m_s) = steps(&bench.told());
    assert!(force_n <= FORCE_STEP_N, "{force_n} N in a tick");
    assert!(
        velocity_m_s <= VELOCITY_STEP_M_S,
        "{velocity_m_s} m/s in a tick"
    );
}

/// Frames go out on the line of the lease that they are under.
#[test]
fn a_renewal_exchanges_both_ends_of_the_line() {
    let mut bench = Bench::new(Intent::Idle);
    bench.couple_for(3);
    let (before, ends) = line(1, Clock::start());
    drop(ends);
    let before = std::mem::replace(&mut bench.tool, before);
    bench.renew(2, 1);
    bench.couple_for(3);
    let sent = bench
        .tool
        .sent
        .recv_timeout(Duration::from_secs(60))
        .unwrap();
    assert_eq!((sent.header.lease, sent.header.sequence), (2, 4));
    assert_eq!(bench.tick().arrivals.received, 6);
    while bench.ends.done.pop().is_ok() {}
    // Its thread ends, and with it what it sends.
    let Tool { sent, _sender, .. } = before;
    drop(_sender);
    let leases: BTreeSet<u32> = sent.iter().map(|frame| frame.header.lease).collect();
    assert_eq!(leases, BTreeSet::from([1]), "nothing more goes the old way");
}

#[test]
fn a_renewal_is_for_the_lease_that_it_follows_be_it_taken_yet_or_not() {
    let mut bench = Bench::new(pushing());
    bench.couple_for(100);
    let (_stranger, ends) = line(9, Clock::start());
    bench.order_renewal(7, ends);
    assert_eq!(bench.couple_for(2).lease, 1);
    let (tool, attachment) = tool(2, Clock::start());
    bench.tool = tool;
    assert!(bench.ends.orders.push(Order::Attach(attachment)).is_ok());
    assert_eq!(bench.tick().mode, Mode::Braking);
    bench.renew(3, 1);
    let ticks = (1..).find(|_| bench.tick().lease == 3).unwrap();
    assert!(ticks <= 302, "{ticks}");
    assert_eq!(
        replaced::discarded(&mut bench),
        ["renewal", "renewal", "attachment"]
    );
    assert_eq!(bench.couple_for(200).felt_force_n, [-3.0, 0.0, 0.0]);
}

#[test]
fn in_a_fault_no_lease_counts_any_more() {
    let mut bench = Bench::new(pushing());
    bench.couple_for(100);
    bench.trouble.send(Trouble::Blind).unwrap();
    assert!(bench.couple_for(1).fault.is_some());
    bench.renew(2, 2);
    for _ in 0..400 {
        assert_eq!(bench.tick().lease, 1);
    }
    assert_eq!(replaced::discarded(&mut bench), ["renewal"]);
}

/// Undone strokes are clay of another epoch in the same place: the hand keeps its copy until a snapshot of that epoch
/// takes its place, and what it cuts meanwhile counts.
#[test]
fn clay_that_is_exchanged_leaves_the_copy_until_a_snapshot_of_it_comes() {
    let mut bench = Bench::on_a_copy();
    let mut server = Server::recovered(0);
    for _ in 0..500 {
        server.tick(&mut bench, 0);
    }
    let kept = bench.side().clay_copy().unwrap().log().kept();
    bench.told();
    bench.tool.frame.header.clay_epoch = 4;
    bench.tool.frame.epochs_kept = 1;
    let record = server.tick(&mut bench, 0);
    assert_eq!(record.copy, CopyState::Diverged);
    assert_eq!(record.wanted.snapshot.map(|wanted| wanted.epoch), Some(4));
    for _ in 0..200 {
        assert!(server.tick(&mut bench, 0).felt_force_n[0] < -0.3);
    }
    assert!(kept < bench.side().clay_copy().unwrap().log().kept());
    assert_eq!(replaced::discarded(&mut bench), [""; 0]);
    let shape = teleclay_bilateral::clay_shape(&granted(1).clay.shape).unwrap();
    let clay = Box::new(teleclay_clay::Clay::new(&shape, 1e-3).unwrap());
    let snapshot = Snapshot { clay, epoch: 4 };
    let load = Order::LoadSnapshot { lease: 1, snapshot };
    assert!(bench.ends.orders.push(load).is_ok());
    let record = server.tick(&mut bench, 0);
    assert_eq!(
        (record.copy, record.wanted.snapshot),
        (CopyState::Live, None)
    );
    let (force_n, _) = steps(&bench.told());
    assert!(force_n <= SLEW_STEP_N / 4.0, "{force_n} N in a tick");
}
