//! The tick threads as the directory has them: the way to each, what it has to do, and which session lives where.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

use rtrb::Producer;
use teleclay_proto::SessionId;
use teleclay_proto::http::TickQuantiles;
use teleclay_session::{Outcome, Prepared};
use teleclay_shell::ticker::Waker;
use tokio::time::{sleep, timeout};

use super::live::Live;
use super::orders::{ChangeError, ORDER_TIMEOUT, Orders};
use super::{Directory, Inner};
use crate::engine::{Answer, Mirror, Order, TICK, Task};
use crate::placing::{Budget, Cost, NoTickTime, load_s};
use crate::session::SessionShared;
use crate::statistics::LoopStats;

/// How often the threads' loads are compared: by then costs are of the time after the move before.
const BALANCED_EVERY: Duration = Duration::from_secs(10);
/// What a tool is taken to cost before any was measured, s: what clay and tool side may take in 99 ticks of a hundred.
const EXPECTED_TOOL_S: f64 = 25e-6;

/// A tick thread, before the directory has it.
pub(crate) struct ThreadParts {
    pub(crate) orders: Producer<Box<Order>>,
    pub(crate) waker: Waker,
    pub(crate) stats: Arc<Mutex<LoopStats>>,
}

/// All tick threads.
pub(super) struct Threads {
    all: Vec<TickThread>,
    budget: Budget,
    /// Joins that were let in and are not in their sessions yet: session, and what they will take, s.
    expected: Mutex<Vec<(u32, f64)>>,
    /// How often there was no time.
    refusals: AtomicU64,
}

struct TickThread {
    orders: Orders,
    stats: Arc<Mutex<LoopStats>>,
    scheduler: OnceLock<String>,
}

/// How a thread does.
#[derive(Clone, Debug)]
pub struct ThreadReport {
    /// How long after their time the last seconds' ticks started, s.
    pub lateness: TickQuantiles,
    /// Ticks since the server started that started more than a whole tick late.
    pub late_ticks: u64,
    /// Ticks a second, those that were slept through included.
    pub rate_hz: f64,
    /// Sessions that live on it.
    pub sessions: usize,
    /// What they take of a tick together, in parts of what they may take.
    pub load: f64,
}

/// Time that is kept for a join until it is in its session.
pub(super) struct Kept<'a> {
    threads: &'a Threads,
    session: u32,
    more_s: f64,
}

impl Drop for Kept<'_> {
    fn drop(&mut self) {
        let mut expected = self.threads.expected.lock().expect("no holder panics");
        let own = (self.session, self.more_s);
        if let Some(index) = expected.iter().position(|kept| *kept == own) {
            expected.swap_remove(index);
        }
    }
}

impl Threads {
    pub(super) fn new(parts: Vec<ThreadParts>, budget: Budget) -> Self {
        let all = parts.into_iter().map(|parts| TickThread {
            orders: Orders::new(parts.orders, parts.waker),
            stats: parts.stats,
            scheduler: OnceLock::new(),
        });
        Self {
            all: all.collect(),
            budget,
            expected: Mutex::default(),
            refusals: AtomicU64::new(0),
        }
    }

    /// What the scheduler granted a thread.
    pub(super) fn set_scheduler(&self, thread: usize, words: &str) {
        // Set once, by whoever starts it.
        let _ = self.all[thread].scheduler.set(words.to_owned());
    }

    pub(super) fn scheduler(&self, thread: usize) -> &str {
        let scheduler = self.all[thread].scheduler.get();
        scheduler.map_or("not known yet", String::as_str)
    }

    pub(super) fn stats(&self, thread: usize) -> &Mutex<LoopStats> {
        &self.all[thread].stats
    }

    /// What sessions may take of a thread's tick, s.
    pub(super) fn budget_s(&self) -> f64 {
        self.budget.per_tick_s()
    }

    /// Whether every thread has ticked within this time.
    pub(super) fn have_ticked_within(&self, time: Duration) -> bool {
        self.all.iter().all(|thread| {
            let stats = thread.stats.lock().expect("no holder panics");
            stats.last_tick.is_some_and(|last| last.elapsed() < time)
        })
    }

    /// Hands an order to a thread.
    pub(super) async fn carry_out(&self, thread: usize, task: Task) -> Result<Answer, ChangeError> {
        self.all[thread].orders.carry_out(task).await
    }

    fn admit(
        &self,
        costs: &[Cost],
        late_shares: &[f64],
        session: u32,
        more_s: f64,
    ) -> Result<usize, NoTickTime> {
        let admitted = self.budget.admit(costs, late_shares, session, more_s);
        if admitted.is_err() {
            self.refusals.fetch_add(1, Ordering::Relaxed);
        }
        admitted
    }

    fn late_shares(&self) -> Vec<f64> {
        let share = |thread: &TickThread| {
            let stats = thread.stats.lock().expect("no holder panics");
            stats.late_share()
        };
        self.all.iter().map(share).collect()
    }
}

impl Inner {
    /// Has a session's thread carry out an order. The session stays there meanwhile.
    pub(super) async fn carry_out(
        &self,
        shared: &SessionShared,
        task: Task,
    ) -> Result<Answer, ChangeError> {
        let stays = timeout(ORDER_TIMEOUT, shared.moving.read()).await;
        let _stays = stays.map_err(|_| ChangeError::Timeout)?;
        self.threads.carry_out(shared.thread(), task).await
    }

    /// Has a session's thread carry out a command of it. When this returns, what it changed can be seen by everybody.
    pub(super) async fn command(
        &self,
        shared: &SessionShared,
        prepared: Prepared,
        mirror: Option<Mirror>,
    ) -> Result<Outcome, ChangeError> {
        let task = Task::Command {
            session: shared.number,
            prepared,
            mirror,
        };
        match self.carry_out(shared, task).await? {
            Answer::Command(outcome) => Ok(outcome?),
            Answer::Undone | Answer::Done => Err(ChangeError::Gone),
        }
    }

    /// What each session costs where it lives.
    fn costs(&self) -> Vec<Cost> {
        let expected = self.threads.expected.lock().expect("no holder panics");
        self.costs_and(&expected)
    }

    /// The same, with what is expected beside it.
    fn costs_and(&self, expected: &[(u32, f64)]) -> Vec<Cost> {
        let lives = self.lives();
        let tool_s = expected_tool_s(&lives);
        let cost = |live: &Live| {
            let shared = &live.shared;
            let held = shared.held_tools();
            let stats = shared.stats.lock().expect("no holder panics");
            let work_s = stats.cost_s(Instant::now(), held, stats.tool_s().unwrap_or(tool_s));
            let own = expected.iter().filter(|kept| kept.0 == shared.number);
            Cost {
                session: shared.number,
                thread: shared.thread(),
                work_s: work_s + own.map(|kept| kept.1).sum::<f64>(),
            }
        };
        lives.iter().map(cost).collect()
    }

    /// The thread for a session that begins.
    ///
    /// # Errors
    /// There is no time for a tool of it beside what others take.
    pub(super) fn find_time_for_another(&self) -> Result<usize, NoTickTime> {
        let more_s = expected_tool_s(&self.lives());
        let late_shares = self.threads.late_shares();
        // No session has this number.
        let another = u32::MAX;
        let costs = self.costs();
        self.threads.admit(&costs, &late_shares, another, more_s)
    }

    /// The thread for a session that is there whether or not there is time.
    pub(super) fn place(&self) -> usize {
        let threads = self.threads.all.len();
        self.threads.budget.place(threads, &self.costs())
    }

    /// Whether the threads have less time than their sessions need, as these are.
    pub(super) fn is_short_of_time(&self) -> bool {
        let costs = self.costs();
        let most_s = self.threads.budget_s();
        (0..self.threads.all.len()).any(|thread| most_s < load_s(thread, &costs))
    }

    /// Finds time for somebody who joins a session, and has it live where that is. The time is kept until what is given
    /// here is dropped.
    pub(super) async fn find_time(self: &Arc<Self>, live: &Live) -> Result<Kept<'_>, NoTickTime> {
        let shared = &live.shared;
        let (to, kept) = {
            let own_s = shared.stats.lock().expect("no holder panics").tool_s();
            let more_s = own_s.unwrap_or_else(|| expected_tool_s(&self.lives()));
            let late_shares = self.threads.late_shares();
            let mut expected = self.threads.expected.lock().expect("no holder panics");
            let costs = self.costs_and(&expected);
            let number = shared.number;
            let to = self.threads.admit(&costs, &late_shares, number, more_s)?;
            expected.push((number, more_s));
            let kept = Kept {
                threads: &self.threads,
                session: number,
                more_s,
            };
            (to, kept)
        };
        if to != shared.thread()
            && let Err(error) = self.relocate(live, to).await
        {
            // Then the loop does not answer, and the join will not be carried out either.
            tracing::warn!(session = %live.id(), %error, "does not move to a thread with more time");
        }
        Ok(kept)
    }

    /// Has a session live on another thread. It is done to the end, whether or not somebody waits for it.
    async fn relocate(self: &Arc<Self>, live: &Live, to: usize) -> Result<(), ChangeError> {
        let (inner, live) = (Arc::clone(self), live.clone());
        let relocated = tokio::spawn(async move {
            let shared = &live.shared;
            let alone = timeout(ORDER_TIMEOUT, shared.moving.write()).await;
            let _alone = alone.map_err(|_| ChangeError::Timeout)?;
            let from = shared.thread();
            if from == to {
                return Ok(());
            }
            let session = shared.number;
            let task = Task::Move { session, to };
            match inner.threads.carry_out(from, task).await? {
                Answer::Done => {}
                Answer::Undone | Answer::Command(_) => return Err(ChangeError::Gone),
            }
            // Its first record from there says that orders find it there. Until then they wait.
            let is_told = || {
                let record = shared.last_record();
                0 < record.ticks && record.thread == to
            };
            while live.is_there() && !is_told() {
                sleep(TICK).await;
            }
            shared.has_moved(to);
            tracing::debug!(session = %live.id(), from, to, "lives on another thread");
            Ok(())
        });
        // It is not joined only where the server ends.
        relocated.await.map_err(|_| ChangeError::Gone)?
    }

    fn lives(&self) -> Vec<Live> {
        let entries = self.entries();
        entries.values().map(|entry| entry.live.clone()).collect()
    }
}

impl Directory {
    /// Has a session live on another tick thread from one of its next ticks on; threads are numbered from 0. Its hands
    /// feel nothing of it.
    ///
    /// # Errors
    /// There is no such session or thread, or the loop does not answer.
    pub async fn move_to(&self, id: &SessionId, thread: usize) -> Result<(), ChangeError> {
        let live = self.session(id).ok_or(ChangeError::Gone)?;
        self.0.relocate(&live, thread).await
    }

    /// Moves sessions from thread to thread for as long as the server runs, one at a time and seldom.
    pub(crate) async fn keep_balanced(&self) {
        let threads = self.0.threads.all.len();
        if threads < 2 {
            return;
        }
        loop {
            sleep(BALANCED_EVERY).await;
            let budget = &self.0.threads.budget;
            let Some(relocation) = budget.rebalance(threads, &self.0.costs()) else {
                continue;
            };
            let Some(live) = self.live_by_number(relocation.session) else {
                continue;
            };
            if let Err(error) = self.0.relocate(&live, relocation.to).await {
                tracing::warn!(session = %live.id(), %error, "does not move to a thread with more time");
            }
        }
    }

    /// How often there was no time for a session or a join.
    pub fn tick_time_refusals(&self) -> u64 {
        self.0.threads.refusals.load(Ordering::Relaxed)
    }

    /// How each tick thread does.
    pub fn threads(&self) -> Vec<ThreadReport> {
        let (threads, costs) = (&self.0.threads, self.0.costs());
        let report = |(number, thread): (usize, &TickThread)| {
            let stats = thread.stats.lock().expect("no holder panics");
            let own = costs.iter().filter(|cost| cost.thread == number);
            ThreadReport {
                lateness: stats.lateness.tick_quantiles(),
                late_ticks: stats.late_ticks,
                rate_hz: stats.rate_hz,
                sessions: own.count(),
                load: load_s(number, &costs) / threads.budget_s(),
            }
        };
        threads.all.iter().enumerate().map(report).collect()
    }
}

/// What a tool takes of a tick, as the sessions where some are held tell, s.
fn expected_tool_s(lives: &[Live]) -> f64 {
    let told = lives.iter().filter_map(|live| {
        let stats = live.shared.stats.lock().expect("no holder panics");
        stats.tool_s()
    });
    let (count, sum_s) = told.fold((0_u32, 0.0), |(count, sum_s), tool_s| {
        (count + 1, sum_s + tool_s)
    });
    if count == 0 {
        EXPECTED_TOOL_S
    } else {
        sum_s / f64::from(count)
    }
}
