//! Commands in any order, against a small model that knows nothing of the session's code: who holds which tool, who has
//! asked for it, for whom it is kept, and whether the session is stopped.
//!
//! The model is written from what the rules promise, in milliseconds and names. It says of every command whether it is
//! carried out, and else why not; of commands that were prepared long before, too. Time passes in steps whose sums lie
//! no nearer than a few milliseconds to any limit of the rules, so that model and session need not agree about the
//! tick.

mod bench;

use std::collections::BTreeSet;

use bench::{Bench, Hand, TICK, engaged_at, new_session, reset};
use teleclay_proto::frame::Header;
use teleclay_session::{Command, Operator, Outcome, Prepared, Refusal};

const TOOLS: usize = 3;
const STEP_MS: u32 = 23;
const WORLDS: u64 = 600;
const STEPS: usize = 250;

/// A tool as people would tell of it.
#[derive(Clone, Debug, Default, PartialEq)]
struct Tool {
    /// Name, lease, since when, when last heard.
    holder: Option<(String, u32, u64, u64)>,
    requests: Vec<(String, u64)>,
    kept: Option<(String, u64)>,
}

/// What must be.
#[derive(Debug, Default)]
struct Model {
    now_ms: u64,
    stop: Option<(String, String)>,
    tools: [Tool; TOOLS],
    next_lease: u32,
    /// Revision of the settings.
    settings: u64,
}

impl Model {
    fn silent(&self, slot: usize) -> Option<&str> {
        let (name, _, since, heard) = self.tools[slot].holder.as_ref()?;
        let is_silent = 1000 < self.now_ms - since && 150 < self.now_ms - heard;
        is_silent.then_some(name)
    }

    fn join(&mut self, name: &str) -> Result<u32, Refusal> {
        if let Some((by, reason)) = &self.stop {
            return Err(Refusal::Stopped {
                by: by.as_str().into(),
                reason: reason.as_str().into(),
            });
        }
        let slots = || 0..TOOLS;
        let is_kept_for = |slot: usize, who: &str| {
            let kept = self.tools[slot].kept.as_ref();
            kept.is_some_and(|(kept, _)| kept == who)
        };
        let is_free =
            |slot: usize| self.tools[slot].holder.is_none() && self.tools[slot].kept.is_none();
        let slot = slots()
            .find(|slot| is_kept_for(*slot, name))
            .or_else(|| slots().find(|slot| self.silent(*slot) == Some(name)))
            .or_else(|| slots().find(|slot| is_free(*slot)))
            .or_else(|| slots().find(|slot| self.silent(*slot).is_some()));
        let Some(slot) = slot else {
            let kept = self.tools.iter().find_map(|tool| tool.kept.as_ref());
            return Err(
                kept.map_or(Refusal::NoFreeTool { tools: TOOLS }, |(name, _)| {
                    Refusal::Reserved {
                        holder: name.as_str().into(),
                    }
                }),
            );
        };
        let lease = self.next_lease;
        self.next_lease += 1;
        self.tools[slot] = Tool {
            holder: Some((name.to_owned(), lease, self.now_ms, self.now_ms)),
            ..Tool::default()
        };
        Ok(lease)
    }

    /// The tool of a number, if it is held, and under this lease where it matters.
    fn held(&mut self, tool: u32, lease: Option<u32>) -> Result<&mut Tool, Refusal> {
        if !(1..=TOOLS as u32).contains(&tool) {
            return Err(Refusal::NoSuchTool { tool, tools: TOOLS });
        }
        let found = &mut self.tools[tool as usize - 1];
        match (&found.holder, lease) {
            (None, _) => Err(Refusal::NotHeld { tool }),
            (Some((_, held, ..)), Some(lease)) if *held != lease => {
                Err(Refusal::NoSuchLease { lease })
            }
            _ => Ok(found),
        }
    }

    fn end_request(
        &mut self,
        tool: u32,
        operator: &str,
        lease: Option<u32>,
    ) -> Result<(), Refusal> {
        let held = self.held(tool, lease)?;
        let at = held.requests.iter().position(|(name, _)| name == operator);
        let at = at.ok_or(Refusal::NoSuchRequest {
            tool,
            operator: operator.into(),
        })?;
        held.requests.remove(at);
        Ok(())
    }

    /// What becomes of a command that was prepared under the settings of a revision.
    fn command(&mut self, command: &Command, prepared_from: u64) -> Result<Option<u32>, Refusal> {
        let needs_settings = matches!(command, Command::Join { .. } | Command::Reset { .. });
        if needs_settings && prepared_from != self.settings {
            return Err(Refusal::Overtaken {
                prepared_from,
                settings_from: self.settings,
            });
        }
        match command {
            Command::Join { operator } => return self.join(&operator.name).map(Some),
            Command::Leave { lease } => {
                let has = |tool: &&mut Tool| {
                    tool.holder
                        .as_ref()
                        .is_some_and(|(_, held, ..)| held == lease)
                };
                let tool = self.tools.iter_mut().find(has);
                *tool.ok_or(Refusal::NoSuchLease { lease: *lease })? = Tool::default();
            }
            Command::Stop { by, reason } => {
                self.stop.get_or_insert((by.clone(), reason.clone()));
                self.tools = Default::default();
            }
            Command::ClearStop { .. } => {
                self.stop.take().ok_or(Refusal::NotStopped)?;
            }
            Command::Request { tool, operator } => {
                let (now_ms, tool) = (self.now_ms, *tool);
                let held = self.held(tool, None)?;
                let name = || operator.as_str().into();
                if held
                    .holder
                    .as_ref()
                    .is_some_and(|holder| holder.0 == *operator)
                {
                    let operator = name();
                    return Err(Refusal::HeldByAsker { tool, operator });
                }
                if held.requests.iter().any(|(asked, _)| asked == operator) {
                    let operator = name();
                    return Err(Refusal::AskedAlready { tool, operator });
                }
                if held.requests.len() == 8 {
                    return Err(Refusal::TooManyRequests { tool, most: 8 });
                }
                held.requests.push((operator.clone(), now_ms));
            }
            Command::Withdraw { tool, operator } => self.end_request(*tool, operator, None)?,
            Command::Deny {
                tool,
                operator,
                lease,
                ..
            } => self.end_request(*tool, operator, *lease)?,
            Command::Grant {
                tool,
                operator,
                lease,
            } => {
                self.end_request(*tool, operator, *lease)?;
                self.tools[*tool as usize - 1] = Tool {
                    kept: Some((operator.clone(), self.now_ms)),
                    ..Tool::default()
                };
            }
            Command::Release { tool, lease } => *self.held(*tool, *lease)? = Tool::default(),
            Command::Reset { .. } | Command::Patch { .. } => {}
        }
        Ok(None)
    }

    /// What time alone brings about.
    fn pass(&mut self, now_ms: u64, heard: &BTreeSet<u32>) {
        self.now_ms = now_ms;
        for tool in &mut self.tools {
            if let Some((_, lease, since, last_ms)) = &mut tool.holder {
                if heard.contains(lease) {
                    *last_ms = now_ms;
                }
                if 10_000 < now_ms - *last_ms && 10_000 < now_ms - *since {
                    *tool = Tool::default();
                }
            }
            tool.requests.retain(|(_, asked)| now_ms - asked <= 30_000);
            tool.kept.take_if(|(_, since)| 10_000 < now_ms - *since);
        }
    }
}

#[derive(Debug, Default)]
struct Counts {
    carried_out: u64,
    refused: [u64; 12],
    late: u64,
    stopped_ticks: u64,
    granted: u64,
    taken_up: u64,
    forgotten: u64,
}

struct World {
    bench: Bench,
    model: Model,
    hands: Vec<Hand>,
    /// Prepared before, and carried out some time.
    waiting: Vec<(Command, Prepared, u64)>,
    counts: Counts,
    lot: u64,
}

impl World {
    fn new(seed: u64) -> Self {
        let bench = Bench::new(new_session(TOOLS as u8));
        Self {
            model: Model {
                next_lease: 1,
                now_ms: u64::from(STEP_MS),
                settings: bench.session.settings().revision,
                ..Model::default()
            },
            bench,
            hands: Vec::new(),
            waiting: Vec::new(),
            counts: Counts::default(),
            lot: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15),
        }
    }

    fn draw(&mut self, below: u64) -> u64 {
        self.lot = self
            .lot
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.lot >> 33) % below
    }

    fn name(&mut self) -> String {
        let most = [4, 4, 4, 14][self.draw(4) as usize];
        format!("operator {}", self.draw(most))
    }

    fn draw_command(&mut self) -> Command {
        let tool = self.draw(TOOLS as u64 + 2) as u32;
        let asked = self.model.tools.get((tool as usize).wrapping_sub(1));
        let asked = asked.and_then(|tool| tool.requests.last()).cloned();
        let operator = self.name();
        let lease = match self.draw(6) {
            0 => Some(self.draw(20) as u32),
            1 => self.hands.last().map(Hand::lease),
            _ => None,
        };
        let reason = format!("reason {}", self.draw(3));
        match self.draw(40) {
            0..12 => {
                let name = operator;
                let device = "none".to_owned();
                let operator = Operator { name, device };
                Command::Join { operator }
            }
            12 => {
                let held = self.hands.first().map(Hand::lease);
                let lease = lease.or(held).unwrap_or(1);
                Command::Leave { lease }
            }
            13 => Command::Stop {
                by: operator,
                reason,
            },
            14..17 => Command::ClearStop { by: operator },
            17..28 => Command::Request { tool, operator },
            28 | 29 => Command::Withdraw { tool, operator },
            30 | 31 => Command::Deny {
                tool,
                operator,
                reason,
                lease,
            },
            // Of those who asked, and of those who never did.
            32..37 => Command::Grant {
                tool,
                operator: asked.map_or(operator, |(name, _)| name),
                lease,
            },
            37 => Command::Grant {
                tool,
                operator,
                lease,
            },
            38 => Command::Release { tool, lease },
            _ => reset(None),
        }
    }

    fn step(&mut self) {
        match self.draw(10) {
            0..4 => {
                let command = self.draw_command();
                let prepared = self.prepare(&command);
                let from = self.model.settings;
                self.carry_out(&command, prepared, from);
            }
            4 => {
                let command = self.draw_command();
                let prepared = self.prepare(&command);
                self.waiting.push((command, prepared, self.model.settings));
            }
            5 if !self.waiting.is_empty() => {
                let at = self.draw(self.waiting.len() as u64) as usize;
                let (command, prepared, from) = self.waiting.swap_remove(at);
                self.counts.late += 1;
                self.carry_out(&command, prepared, from);
            }
            8 if self.draw(8) == 0 => {
                // Half a minute, in which whoever is there says so often enough to keep a tool.
                for _ in 0..5 {
                    self.bench.now = self.bench.now.after(TICK * (STEP_MS * 300));
                    self.run(7);
                }
            }
            7 if self.draw(12) == 0 => {
                // Everybody wants the same tool.
                let tool = 1 + self.draw(TOOLS as u64) as u32;
                for number in 0..10 {
                    let operator = format!("operator {number}");
                    let command = Command::Request { tool, operator };
                    let prepared = self.prepare(&command);
                    self.carry_out(&command, prepared, self.model.settings);
                }
            }
            6 if self.draw(4) == 0 => {
                // Nobody says anything, for up to half a minute. Silence is counted from a tick on: so there is one.
                self.run(0);
                let steps = [5, 44, 300, 1310][self.draw(4) as usize];
                self.bench.now = self.bench.now.after(TICK * (STEP_MS * steps));
                self.run(0);
            }
            _ => {
                let muted = self.draw(8);
                self.run(muted ^ 7);
            }
        }
        self.check();
    }

    fn prepare(&self, command: &Command) -> Prepared {
        Prepared::new(command, self.bench.session.settings()).unwrap()
    }

    fn carry_out(&mut self, command: &Command, mut prepared: Prepared, from: u64) {
        let told: Result<Outcome, Refusal> = self
            .bench
            .session
            .handle_command(self.bench.now, &mut prepared);
        let was_kept = self.model.tools.iter().any(|tool| tool.kept.is_some());
        let expected = self.model.command(command, from);
        let lease = told
            .as_ref()
            .map(|told| told.granted.map(|given| given.lease));
        assert_eq!(lease, expected.as_ref().copied(), "{command:?}");
        match told {
            Ok(told) => {
                self.counts.carried_out += 1;
                match command {
                    Command::Reset { .. } => self.model.settings = told.revision,
                    Command::Grant { .. } => self.counts.granted += 1,
                    _ => {}
                }
                if let Some(given) = told.granted {
                    let is_kept = self.model.tools.iter().any(|tool| tool.kept.is_some());
                    self.counts.taken_up += u64::from(was_kept && !is_kept);
                    self.hands.push(Hand {
                        slot: given.slot,
                        header: Header {
                            lease: given.lease,
                            ownership_epoch: 1,
                            ..Header::default()
                        },
                    });
                }
            }
            Err(refusal) => {
                let kind = match refusal {
                    Refusal::Stopped { .. } => 0,
                    Refusal::NotStopped => 1,
                    Refusal::Reserved { .. } => 2,
                    Refusal::NoSuchTool { .. } => 3,
                    Refusal::NotHeld { .. } => 4,
                    Refusal::HeldByAsker { .. } => 5,
                    Refusal::AskedAlready { .. } => 6,
                    Refusal::NoSuchRequest { .. } => 7,
                    Refusal::NoFreeTool { .. } => 8,
                    Refusal::NoSuchLease { .. } => 9,
                    Refusal::Overtaken { .. } => 10,
                    Refusal::TooManyRequests { .. } => 11,
                    other => panic!("{other}"),
                };
                self.counts.refused[kind] += 1;
            }
        }
    }

    /// A step of time. Who holds the tool of a bit that is set is there; who has lost a tool sends on, too.
    fn run(&mut self, there: u64) {
        let asked: usize = self
            .model
            .tools
            .iter()
            .map(|tool| tool.requests.len())
            .sum();
        let held: BTreeSet<u32> = self
            .model
            .tools
            .iter()
            .flat_map(|tool| &tool.holder)
            .map(|holder| holder.1)
            .collect();
        let newest = self.hands.len().saturating_sub(6);
        self.hands.drain(..newest);
        let session = &self.bench.session;
        let (scheme, epoch) = (session.settings().spec.scheme, session.clay_epoch());
        let mut heard = BTreeSet::new();
        let mut speaking: Vec<&mut Hand> = Vec::new();
        for hand in &mut self.hands {
            hand.header.scheme = scheme;
            hand.header.clay_epoch = epoch;
            hand.header.revision = session.revision() as u32;
            if there & (1 << hand.slot) != 0 || !held.contains(&hand.lease()) {
                heard.insert(hand.lease());
                speaking.push(hand);
            }
        }
        self.bench
            .run(STEP_MS, &mut speaking, |_| engaged_at([0.0, 0.0, 0.01]));
        let now_ms = self.bench.now.as_nanos() / 1_000_000;
        self.model.pass(now_ms, &heard);
        let still: usize = self
            .model
            .tools
            .iter()
            .map(|tool| tool.requests.len())
            .sum();
        let still_held = self.model.tools.iter().flat_map(|tool| &tool.holder);
        if still_held.count() == held.len() {
            // By their age, and not because the tool is free.
            self.counts.forgotten += (asked - still) as u64;
        }
        if self.model.stop.is_some() {
            self.counts.stopped_ticks += u64::from(STEP_MS);
            assert!(
                self.bench.sent.is_empty(),
                "a frame leaves a stopped session"
            );
        }
    }

    fn check(&mut self) {
        let session = &self.bench.session;
        let told = session.snapshot();
        let stop = told
            .stop
            .map(|stop| (stop.by.to_string(), stop.reason.to_string()));
        assert_eq!(stop, self.model.stop);
        for (slot, (told, wanted)) in told.tools.iter().zip(&self.model.tools).enumerate() {
            let holder = told.holder.as_ref();
            let holder = holder.map(|holder| (&holder.operator.name, holder.lease));
            let wanted_holder = wanted.holder.as_ref().map(|holder| (&holder.0, holder.1));
            assert_eq!(holder, wanted_holder, "tool {}", slot + 1);
            let side = session.side(slot).map(|side| side.lease());
            assert_eq!(side, wanted_holder.map(|(_, lease)| lease), "the side");
            let asked: Vec<&str> = told.requests.iter().map(|name| &**name).collect();
            let wanted_asked: Vec<&str> = wanted.requests.iter().map(|(name, _)| &**name).collect();
            assert_eq!(asked, wanted_asked, "tool {}", slot + 1);
            let kept = wanted.kept.as_ref().map(|(name, _)| &**name);
            assert_eq!(told.reserved_for.as_deref(), kept, "tool {}", slot + 1);
            if self.model.stop.is_some() {
                assert_eq!(wanted, &Tool::default());
                assert_eq!(session.last_step(slot), Default::default(), "a force");
            }
        }
        self.bench.take_events();
    }
}

#[test]
#[allow(clippy::print_stdout, reason = "the counts are a result")]
fn commands_in_any_order_do_what_the_model_says() {
    let mut all = Counts::default();
    for seed in 0..WORLDS {
        let mut world = World::new(seed);
        for _ in 0..STEPS {
            world.step();
        }
        let counts = world.counts;
        all.carried_out += counts.carried_out;
        all.late += counts.late;
        all.stopped_ticks += counts.stopped_ticks;
        all.granted += counts.granted;
        all.taken_up += counts.taken_up;
        all.forgotten += counts.forgotten;
        for (all, count) in all.refused.iter_mut().zip(counts.refused) {
            *all += count;
        }
    }
    println!("{all:?}");
    assert!(10_000 < all.carried_out && 5_000 < all.late);
    assert!(all.refused.iter().all(|count| 20 < *count));
    assert!(100_000 < all.stopped_ticks);
    assert!(500 < all.granted && 100 < all.taken_up && 100 < all.forgotten);
}
