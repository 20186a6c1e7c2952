//! One session as everybody but the tick has it: what it is, and every way to change it.

use std::sync::{Arc, Mutex, Weak};
use std::time::Instant;

use teleclay_channel::{Forged, Purpose};
use teleclay_clay::Clay;
use teleclay_proto::SessionId;
use teleclay_proto::http::{ClayReset, Session, SessionPatch};
use teleclay_proto::join::{ClayDescription, Granted, JoinRequest, LoopParameters, RefusalCode};
use teleclay_proto::watch::Level;
use teleclay_session::{Command, Operator, Outcome, Prepared, Refusal, Rules, Settings, Snapshot};
use tokio::sync::broadcast;

use super::Inner;
use super::not_granted::NotGranted;
use super::orders::{ChangeError, ORDER_TIMEOUT};
use crate::doors::{Channels, LeaseChannel};
use crate::engine::{Mirror, TICK};
use crate::session::{Event, Sample, SessionShared, tool_id};
use crate::state::{self, ThreadState};
use crate::statistics::LoopStats;

/// Settings change once in a while for reasons of the session's own; a command that was overtaken by that is prepared
/// anew so many times.
const PREPARATIONS: usize = 4;

/// A session that is there.
#[derive(Clone)]
pub struct Live {
    pub(super) shared: Arc<SessionShared>,
    pub(super) directory: Weak<Inner>,
}

impl Live {
    pub(super) fn new(shared: Arc<SessionShared>, directory: Weak<Inner>) -> Self {
        Self { shared, directory }
    }

    /// The session as it is.
    pub fn state(&self) -> Session {
        let shared = &self.shared;
        match self.directory.upgrade() {
            Some(inner) => {
                let (threads, thread) = (&inner.threads, shared.thread());
                let found = ThreadState {
                    stats: threads.stats(thread),
                    scheduler: threads.scheduler(thread),
                    budget_s: threads.budget_s(),
                };
                state::session(shared, &found)
            }
            None => state::session(
                shared,
                &ThreadState {
                    stats: &Mutex::new(LoopStats::default()),
                    scheduler: "gone",
                    budget_s: TICK.as_secs_f64(),
                },
            ),
        }
    }

    /// Changes what is in the patch, all of it in one tick.
    ///
    /// # Errors
    /// A field cannot be, the session refuses or is gone, or the loop does not answer. Then nothing has changed.
    pub async fn patch(&self, patch: SessionPatch) -> Result<Session, ChangeError> {
        self.change(Command::Patch { patch }).await
    }

    /// A fresh block, for whoever may change the session; with a `lease`, for its holder.
    ///
    /// # Errors
    /// A field cannot be, nobody holds the lease, the session is gone, or the loop does not answer. Then nothing has
    /// changed.
    pub async fn reset(
        &self,
        reset: ClayReset,
        lease: Option<u32>,
    ) -> Result<Session, ChangeError> {
        let inner = self.directory.upgrade().ok_or(ChangeError::Gone)?;
        let fresh = self.settings().with_fresh_block(&reset);
        let voxels = fresh.and_then(|settings| settings.voxels());
        inner.check_memory(voxels.map_err(ChangeError::Field)?, Some(self.id()))?;
        self.change(Command::Reset { reset, lease }).await
    }

    /// Whoever sealed a question.
    ///
    /// # Errors
    /// None of those who hold tools did, or the question was heard before.
    pub(crate) fn asker(
        &self,
        purpose: Purpose,
        sealed: &[u8],
    ) -> Result<Arc<LeaseChannel>, Forged> {
        let asker = self.shared.channels.asker(purpose, sealed);
        if asker.is_err() {
            self.count_unheard();
        }
        asker
    }

    /// How the holders of its tools are told from everybody else.
    pub(crate) fn channels(&self) -> &Channels {
        &self.shared.channels
    }

    /// A message came that no holder of a tool wrote.
    pub(crate) fn count_unheard(&self) {
        if let Some(count) = self.shared.channels.count_unheard() {
            let messages = if count == 1 { "message" } else { "messages" };
            self.shared.emit(
                Level::Warning,
                format!("{count} {messages} came that no holder of a tool wrote, or that had come before"),
            );
        }
    }

    /// Gives a tool to an operator.
    ///
    /// # Errors
    /// Why not.
    pub(super) async fn grant(
        &self,
        request: &JoinRequest,
        inner: &Arc<Inner>,
    ) -> Result<Granted, NotGranted> {
        // Whoever has a tool already, and has lost its line, takes no more than before.
        let _kept = if self.holders().contains(&request.operator) {
            None
        } else {
            let found = inner.find_time(self).await.map_err(|error| {
                let reason = format!("session `{}`: {error}", self.shared.id);
                NotGranted::because(RefusalCode::NoTickTime, reason)
            });
            Some(found?)
        };
        let operator = Operator {
            name: request.operator.clone(),
            device: request.device.clone(),
        };
        let outcome = self
            .carry_out(Command::Join { operator })
            .await
            .map_err(|error| self.why_not(&error))?;
        let granted = outcome.granted.expect("a join that is carried out grants");
        let ownership_epoch = self.shared.snapshot().ownership_epoch;
        let settings = self.shared.settings();
        let mirror = self.shared.mirror.lock().expect("no holder panics");
        Ok(Granted {
            lease: granted.lease,
            ownership_epoch,
            node: inner.node.clone(),
            tool: tool_id(granted.slot),
            lease_s: Rules::default().lease.as_secs_f64(),
            parameters: settings.parameters_at(outcome.revision),
            clay: ClayDescription {
                shape: settings.spec.clay.shape.clone(),
                voxel_size_m: settings.spec.clay.voxel_size_m,
                epoch: mirror.epoch,
                revision: mirror.clay.revision(),
            },
            slow_endpoint: inner.slow_endpoint.clone(),
        })
    }

    /// The session's name.
    pub fn id(&self) -> &SessionId {
        &self.shared.id
    }

    /// Tells it from others of the same name, before and after it.
    pub(crate) fn number(&self) -> u32 {
        self.shared.number
    }

    /// What its events have come to.
    pub(crate) fn snapshot(&self) -> Snapshot {
        self.shared.snapshot().clone()
    }

    /// The watchers' copy of the clay.
    pub fn clay(&self) -> ClayView {
        ClayView {
            shared: Arc::clone(&self.shared),
        }
    }

    /// Samples from now on.
    pub fn telemetry(&self) -> broadcast::Receiver<Sample> {
        self.shared.telemetry()
    }

    /// Events from now on.
    pub fn events(&self) -> broadcast::Receiver<Event> {
        self.shared.events()
    }

    /// Whether the session is still in the directory.
    pub fn is_there(&self) -> bool {
        self.directory.upgrade().is_some_and(|inner| {
            inner
                .entries()
                .get(&self.shared.id)
                .is_some_and(|entry| entry.live.shared.number == self.shared.number)
        })
    }

    pub(crate) fn loop_parameters(&self) -> LoopParameters {
        let snapshot = self.shared.snapshot();
        snapshot.settings.parameters_at(snapshot.revision)
    }

    /// Carries a command out and gives the session as it is then, under the revision that the command made.
    async fn change(&self, command: Command) -> Result<Session, ChangeError> {
        let outcome = self.carry_out(command).await?;
        Ok(Session {
            revision: outcome.revision,
            ..self.state()
        })
    }

    async fn carry_out(&self, command: Command) -> Result<Outcome, ChangeError> {
        self.carry_out_prepared(move |settings| Prepared::new(&command, settings))
            .await
    }

    /// Carries out a command that is made from the settings as they are.
    pub(super) async fn carry_out_prepared(
        &self,
        prepare: impl Fn(&Settings) -> Result<Prepared, Refusal> + Send + Sync + 'static,
    ) -> Result<Outcome, ChangeError> {
        let _one_at_a_time = self.shared.preparing.lock().await;
        let prepare = Arc::new(prepare);
        for _ in 1..PREPARATIONS {
            match self.try_to_carry_out(Arc::clone(&prepare)).await {
                Err(ChangeError::Refused(
                    Refusal::Overtaken { .. }
                    | Refusal::OtherClay { .. }
                    | Refusal::CutMeanwhile { .. },
                )) => {}
                done => return done,
            }
        }
        self.try_to_carry_out(prepare).await
    }

    async fn try_to_carry_out(
        &self,
        prepare: Arc<impl Fn(&Settings) -> Result<Prepared, Refusal> + Send + Sync + 'static>,
    ) -> Result<Outcome, ChangeError> {
        let snapshot = self.shared.snapshot().clone();
        // What a command needs may take milliseconds to build, a large block seconds.
        let prepared = tokio::task::spawn_blocking(move || {
            let prepared = prepare(&snapshot.settings)?;
            let mirror = prepared.fresh().map(|(settings, clay)| Mirror {
                clay: clay.clone(),
                shape: settings.spec.clay.shape.clone(),
                epoch: snapshot.clay_epoch.wrapping_add(1),
            });
            Ok::<_, Refusal>((prepared, mirror))
        });
        // It fails only where the server ends.
        let (prepared, mirror) = prepared.await.map_err(|_| ChangeError::Gone)??;
        self.command(prepared, mirror).await
    }

    /// Has the tick carry out what was prepared.
    pub(super) async fn command(
        &self,
        prepared: Prepared,
        mirror: Option<Mirror>,
    ) -> Result<Outcome, ChangeError> {
        let inner = self.directory.upgrade().ok_or(ChangeError::Gone)?;
        if !self.is_there() {
            return Err(ChangeError::Gone);
        }
        inner.command(&self.shared, prepared, mirror).await
    }

    /// How many voxels its block has, clay or air.
    pub(super) fn voxels(&self) -> u64 {
        let counts = self.clay().with(|clay, _| clay.grid().voxels());
        counts.iter().map(|count| u64::from(*count)).product()
    }

    /// What the session was told to be.
    pub(crate) fn settings(&self) -> Settings {
        Settings::clone(&self.shared.snapshot().settings)
    }

    fn why_not(&self, error: &ChangeError) -> NotGranted {
        let id = &self.shared.id;
        let (code, reason, holder) = match error {
            ChangeError::Refused(Refusal::NoFreeTool { tools }) => {
                let holders = self.holders();
                let by = match &holders[..] {
                    [] => String::new(),
                    names => format!(", by {}", names.join(" and ")),
                };
                (
                    RefusalCode::NoFreeTool,
                    format!("all {tools} tools of session `{id}` are held{by}"),
                    holders.into_iter().next(),
                )
            }
            ChangeError::Refused(refusal @ Refusal::Stopped { by, .. }) => (
                RefusalCode::Stopped,
                format!("session `{id}`: {refusal}"),
                Some(by.to_string()),
            ),
            ChangeError::Refused(refusal @ Refusal::Reserved { holder }) => (
                RefusalCode::Reserved,
                format!("session `{id}`: {refusal}"),
                Some(holder.to_string()),
            ),
            ChangeError::Field(error) => (RefusalCode::BadRequest, error.to_string(), None),
            ChangeError::Gone => (
                RefusalCode::NoSuchSession,
                format!("there is no session `{id}` on this server any more"),
                None,
            ),
            ChangeError::Refused(_) | ChangeError::NoMemory(_) | ChangeError::Timeout => {
                (RefusalCode::Busy, error.to_string(), None)
            }
        };
        NotGranted {
            code,
            reason,
            holder,
        }
    }

    /// The names of those who hold its tools.
    fn holders(&self) -> Vec<String> {
        let snapshot = self.shared.snapshot();
        let holders = snapshot.tools.iter();
        let holders = holders.filter_map(|tool| tool.holder.as_ref());
        holders.map(|holder| holder.operator.name.clone()).collect()
    }

    /// Waits until the statistics know of the session at all.
    pub(super) async fn first_record(&self) {
        let started = Instant::now();
        while self.shared.last_record().ticks == 0 && started.elapsed() < ORDER_TIMEOUT {
            tokio::time::sleep(TICK).await;
        }
    }
}

/// A look at the watchers' copy of the clay.
#[derive(Clone)]
pub struct ClayView {
    shared: Arc<SessionShared>,
}

impl ClayView {
    /// Calls `look` with the clay and its epoch. Keep it short: the copy is locked meanwhile.
    pub fn with<T>(&self, look: impl FnOnce(&Clay, u32) -> T) -> T {
        let mirror = self.shared.mirror.lock().expect("no holder panics");
        look(&mirror.clay, mirror.epoch)
    }
}
