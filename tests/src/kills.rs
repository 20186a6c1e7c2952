//! A server that is killed without a word, again and again, while two hands cut, and that is started again each time on
//! what it has written: nothing that it called durable is lost, nothing that a living hand has cut is, and no force
//! steps.

use std::fmt;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use serde_json::json;
use teleclay_proto::http::{Session, StorageState};

use crate::process::{PATIENCE, wait_for};
use crate::recording::{greatest_force_step_n, norm};
use crate::replay::replay;
use crate::stage::{DEMO, Handle, HandleOptions, Ports, Server, Transport};

/// The second session: its scheme keeps no copy of the clay.
const OTHER: &str = "other";
/// The slew limit of a session's parameters, a tick's worth, N.
const FORCE_STEP_N: f64 = 2000.0 * 1e-3 + 1e-9;
/// From the start of the process until both tools move again, s.
const MOVES_WITHIN_S: f64 = 2.0;

/// What the kills have come to.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// From a look at both sessions until all that it saw was on disk, s; with the calls that ask for it.
    pub kept_s: Vec<f64>,
    /// From each start of the process until it was ready, s.
    pub ready_s: Vec<f64>,
    /// From each start of the process until both tools moved again, s.
    pub moving_s: Vec<f64>,
    /// Greatest change of the force on a hand from tick to tick, N: of the replica's, and of the other.
    pub force_step_n: [f64; 2],
    /// Clay that the hand with a copy has removed from the last block that it asked for, m³.
    pub removed_m3: f64,
    /// Which block that was.
    pub blocks: u32,
    /// What the histories take on disk at the end, bytes.
    pub bytes: u64,
}

/// Kills a server `kills` times at moments that `seed` chooses.
///
/// # Errors
/// A promise was broken, or a process does not do what it should.
pub fn run(kills: usize, seed: u64, mut tell: impl FnMut(usize, &Report)) -> Result<Report> {
    let mut server = Server::start(Ports::free()?, Transport::Tcp)?;
    let other = json!({ "id": OTHER, "scheme": "force_exchange", "tools": 1 });
    server.client.create(&other)?;
    let options = HandleOptions::new(&server.endpoint());
    let mut hands = [
        Handle::start(&options)?,
        Handle::start(&options.clone().by("Bob").in_session(OTHER))?,
    ];
    let mut report = Report::default();
    let mut chance = seed;
    for kill in 0..kills {
        cut(&server, &mut hands)?;
        // An odd multiplier and a large increment: every moment within a second and a half, in no order.
        chance = chance
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        server.client.let_pass(DEMO, (chance >> 33) % 1500)?;
        let before = both(&server)?;
        let looked = Instant::now();
        wait_until_kept(&server, &before)?;
        report.kept_s.push(looked.elapsed().as_secs_f64());
        let remains = server.kill_and_keep()?;
        let began = Instant::now();
        server = Server::start_again(remains)?;
        report.ready_s.push(began.elapsed().as_secs_f64());
        let after = both(&server)?;
        for (before, after) in before.iter().zip(&after) {
            nothing_is_lost(before, after)
                .with_context(|| format!("kill {kill}, session {}", before.id))?;
        }
        wait_until_both_move(&server)?;
        let took_s = began.elapsed().as_secs_f64();
        report.moving_s.push(took_s);
        ensure!(
            took_s <= MOVES_WITHIN_S,
            "kill {kill}: the tools moved after {took_s:.3} s"
        );
        tell(kill + 1, &report);
    }
    finish(&server, &mut hands, &mut report)?;
    Ok(report)
}

fn both(server: &Server) -> Result<[Session; 2]> {
    Ok([server.client.session(DEMO)?, server.client.session(OTHER)?])
}

/// Both hands press into clay.
fn cut(server: &Server, hands: &mut [Handle; 2]) -> Result<()> {
    for (id, hand) in [DEMO, OTHER].into_iter().zip(hands) {
        let cuts = |session: &Session| {
            let mut tools = session.tools.iter();
            tools.any(|tool| tool.connected && 0.05 < norm(tool.force_n))
        };
        let seen = server.client.session_when(id, "a cut", PATIENCE, cuts);
        seen.with_context(|| format!("the hand said: {}", hand.process.stderr()))?;
    }
    Ok(())
}

/// Everything up to a look is on disk, as the histories tell.
fn wait_until_kept(server: &Server, before: &[Session; 2]) -> Result<()> {
    for session in before {
        let path = format!("/sessions/{}/history", session.id);
        let looked_at_s = session.control_loop.ticks as f64 * 1e-3;
        wait_for("what was seen to be on disk", PATIENCE, || {
            let (_, history) = match server.client.ask(&path) {
                Ok(answer) => answer,
                Err(error) => return Some(Err(error)),
            };
            let is_kept = history["to_s"]
                .as_f64()
                .is_some_and(|to_s| looked_at_s <= to_s);
            is_kept.then_some(Ok(()))
        })??;
    }
    Ok(())
}

/// What was there before the kill is there: settings, revision, block, who holds which tool, and every cut.
fn nothing_is_lost(before: &Session, after: &Session) -> Result<()> {
    ensure!(
        before.revision <= after.revision,
        "revision {} is {} again",
        before.revision,
        after.revision
    );
    ensure!(
        before.clay.epoch <= after.clay.epoch,
        "block {} is {} again",
        before.clay.epoch,
        after.clay.epoch
    );
    ensure!(
        (before.scheme, before.material) == (after.scheme, after.material),
        "other settings"
    );
    let names = |session: &Session| -> Vec<String> {
        let tools = session.tools.iter();
        tools.map(|tool| tool.operator.clone()).collect()
    };
    ensure!(
        names(before) == names(after),
        "{:?}, {:?}",
        names(before),
        names(after)
    );
    ensure!(
        before.clay.epoch < after.clay.epoch
            || after.clay.remaining_units <= before.clay.remaining_units,
        "{} units of clay are there again",
        after.clay.remaining_units - before.clay.remaining_units
    );
    ensure!(
        after.storage.state != StorageState::Failed,
        "{:?}",
        after.storage
    );
    Ok(())
}

fn wait_until_both_move(server: &Server) -> Result<()> {
    for id in [DEMO, OTHER] {
        let mut first = None;
        wait_for("a tool to move again", PATIENCE, || {
            let tool = match server.client.session(id) {
                Ok(session) => session.tools[0].clone(),
                Err(error) => return Some(Err(error)),
            };
            let from = *first.get_or_insert(tool.position_m);
            let way_m: [f64; 3] = std::array::from_fn(|axis| tool.position_m[axis] - from[axis]);
            let has_moved = tool.connected && 0.0 < norm(way_m);
            has_moved.then_some(Ok(()))
        })??;
    }
    Ok(())
}

/// Everything that was cut has come; then the clay is what the hand with a copy has cut, to the last bit.
fn finish(server: &Server, hands: &mut [Handle; 2], report: &mut Report) -> Result<()> {
    cut(server, hands)?;
    for (id, hand) in [DEMO, OTHER].into_iter().zip(hands.iter_mut()) {
        let alone = hand.process.stderr().len();
        server.client.patch(id, &json!({ "paused": true }))?;
        hand.process
            .logs_after(alone, "the session is paused", PATIENCE)?;
    }
    let mut last = server.client.session(DEMO)?;
    let drained = loop {
        server.client.let_pass(DEMO, 500)?;
        let next = server.client.session(DEMO)?;
        if next.clay.remaining_units == last.clay.remaining_units {
            break next;
        }
        last = next;
    };
    for (hand, most_n) in hands.iter_mut().zip(&mut report.force_step_n) {
        ensure!(hand.process.end()?.success(), "a hand ended badly");
        *most_n = greatest_force_step_n(&hand.ticks()?);
        ensure!(*most_n <= FORCE_STEP_N, "{most_n} N in a tick");
    }
    let mut cut = replay(&drained, &hands[0].ticks()?)?;
    report.removed_m3 = cut.clay.removed_volume_m3();
    report.blocks = drained.clay.epoch;
    ensure!(
        cut.epoch == drained.clay.epoch,
        "the hand's copy is of block {}, the server's of {}",
        cut.epoch,
        drained.clay.epoch
    );
    ensure!(
        cut.clay.hash() == drained.clay.hash.0,
        "the hand has cut {} units, the server's clay lacks {}",
        cut.clay.initial_units() - cut.clay.remaining_units(),
        drained.clay.removed_units
    );
    report.bytes = both(server)?
        .iter()
        .map(|session| session.storage.bytes)
        .sum();
    Ok(())
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let told = |times_s: &[f64]| {
            let mut sorted = times_s.to_vec();
            sorted.sort_by(f64::total_cmp);
            match (sorted.get(sorted.len() / 2), sorted.last()) {
                (Some(median), Some(most)) => format!("{median:.3} s, at most {most:.3} s"),
                _ => "never".to_owned(),
            }
        };
        writeln!(f, "{} kills", self.ready_s.len())?;
        writeln!(f, "seen on disk after {}", told(&self.kept_s))?;
        writeln!(f, "ready after {}", told(&self.ready_s))?;
        writeln!(f, "both tools moving after {}", told(&self.moving_s))?;
        writeln!(
            f,
            "force on the hand steps by {:.3} N (replica) and {:.3} N (force_exchange) a tick at most",
            self.force_step_n[0], self.force_step_n[1]
        )?;
        write!(
            f,
            "{:.3} cm3 removed from block {} by the hand with a copy, {} B on disk",
            self.removed_m3 * 1e6,
            self.blocks,
            self.bytes
        )
    }
}
