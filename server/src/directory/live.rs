//! One session as everybody but the tick has it: what it is, every change of it, and who holds its tools.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, Weak};
use std::time::Instant;

use teleclay_bilateral::{FreshBlock, ParameterError, ToolSide, tool_setup};
use teleclay_clay::Clay;
use teleclay_link::scheme::replica::Generation;
use teleclay_proto::SessionId;
use teleclay_proto::http::{
    ClayReset, ClaySpec, FieldError, NewSession, Session, SessionPatch, Validate,
};
use teleclay_proto::join::{ClayDescription, Granted, JoinRequest, LoopParameters, RefusalCode};
use teleclay_proto::watch::Level;
use tokio::sync::broadcast;

use super::Inner;
use super::orders::{ChangeError, ORDER_TIMEOUT};
use crate::collector::LoopStats;
use crate::convert;
use crate::engine::{Order, SessionRecord, TICK};
use crate::session::{Event, Mirror, Sample, SessionShared, Settings, parameters, tool_id};

/// A session that is there.
#[derive(Clone)]
pub struct Live {
    pub(super) shared: Arc<SessionShared>,
    directory: Weak<Inner>,
}

impl Live {
    pub(super) fn new(shared: Arc<SessionShared>, directory: Weak<Inner>) -> Self {
        Self { shared, directory }
    }

    /// The session as it is.
    pub fn state(&self) -> Session {
        let directory = self.directory.upgrade();
        let (stats, scheduler) = directory.as_ref().map_or_else(
            || (Arc::new(Mutex::new(LoopStats::default())), "gone"),
            |inner| (Arc::clone(&inner.loop_stats), inner.scheduler()),
        );
        self.shared.state(&stats, scheduler)
    }

    /// Changes what is in the patch.
    ///
    /// # Errors
    /// A field cannot be, the session is gone, or the loop does not answer.
    pub async fn patch(&self, patch: SessionPatch) -> Result<Session, ChangeError> {
        patch.validate().map_err(ChangeError::Field)?;
        let _one_at_a_time = self.shared.changes.lock().await;
        self.still_there()?;
        let session = self.shared.number;
        if let Some(scheme) = patch.scheme {
            let revision = self.revise(|settings| {
                settings.spec.scheme = scheme;
                settings.parameters.scheme = scheme;
            });
            self.order(Order::SetScheme {
                session,
                scheme,
                revision,
            })
            .await?;
        }
        if let Some(change) = patch.material {
            let wanted = change.apply(self.shared.settings().spec.material);
            let material = convert::material(&wanted).map_err(ChangeError::Field)?;
            let revision = self.revise(|settings| {
                settings.spec.material = wanted;
                settings.parameters.material = wanted;
            });
            self.order(Order::SetMaterial {
                session,
                material,
                revision,
            })
            .await?;
        }
        if let Some(fraction) = patch.deadband {
            let revision = self.revise(|settings| {
                settings.spec.deadband = fraction;
                settings.parameters.deadband = fraction;
            });
            self.order(Order::SetDeadband {
                session,
                fraction,
                revision,
            })
            .await?;
        }
        if let Some(change) = patch.network {
            let wanted = change.apply(self.shared.settings().spec.network);
            wanted
                .validate()
                .map_err(|error| ChangeError::Field(error.under("/network")))?;
            self.order(Order::SetLines {
                session,
                lines: convert::lines(&wanted),
            })
            .await?;
            self.shared.settings().spec.network = wanted;
        }
        if let Some(paused) = patch.paused {
            self.order(if paused {
                Order::Pause { session }
            } else {
                Order::Resume { session }
            })
            .await?;
            self.shared.settings().is_paused = paused;
        }
        self.still_there()?;
        Ok(self.state())
    }

    /// Changes the settings, as a new revision of the parameters.
    fn revise(&self, change: impl FnOnce(&mut Settings)) -> u16 {
        let mut settings = self.shared.settings();
        change(&mut settings);
        settings.next_revision()
    }

    /// A fresh block.
    ///
    /// # Errors
    /// A field cannot be, the session is gone, or the loop does not answer.
    pub async fn reset(&self, reset: ClayReset) -> Result<Session, ChangeError> {
        reset.validate().map_err(ChangeError::Field)?;
        let _one_at_a_time = self.shared.changes.lock().await;
        self.still_there()?;
        let mut spec = self.shared.settings().spec.clone();
        if let Some(shape) = reset.shape {
            spec.clay.shape = shape;
        }
        if let Some(material) = reset.material {
            spec.material = material;
        }
        let built = {
            let spec = spec.clone();
            tokio::task::spawn_blocking(move || build_clay(&spec.clay, &spec)).await
        };
        let (clay, mirror) = built
            .map_err(|_| ChangeError::Gone)?
            .map_err(ChangeError::Field)?;
        let session = self.shared.number;
        let moved = parameters(&spec);
        let setup = tool_setup(&moved)
            .map_err(|error| ChangeError::Field(FieldError::new("/shape", error.to_string())))?;
        let clay_epoch = {
            let mut held = self.shared.mirror.lock().expect("no holder panics");
            let epoch = held.epoch.wrapping_add(1);
            *held = Mirror {
                clay: mirror,
                shape: spec.clay.shape.clone(),
                epoch,
            };
            epoch
        };
        let (revision, slots) = {
            let mut settings = self.shared.settings();
            let revision = settings.next_revision();
            settings.parameters = LoopParameters { revision, ..moved };
            settings.spec = spec;
            (revision, settings.slots.len())
        };
        self.order(Order::ReplaceClay {
            session,
            fresh: Box::new(FreshBlock {
                clay,
                setup,
                generation: Generation {
                    since_revision: revision,
                    epoch: clay_epoch,
                },
                before: Vec::with_capacity(slots),
            }),
        })
        .await?;
        self.shared.emit(Level::Info, "a fresh block".to_owned());
        self.record_of_epoch(clay_epoch).await;
        self.still_there()?;
        Ok(self.state())
    }

    /// The session's name.
    pub fn id(&self) -> &SessionId {
        &self.shared.id
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

    /// Whether a change of it is one. An order about a session that was deleted is carried out by doing nothing.
    fn still_there(&self) -> Result<(), ChangeError> {
        if self.is_there() {
            Ok(())
        } else {
            Err(ChangeError::Gone)
        }
    }

    pub(crate) fn loop_parameters(&self) -> LoopParameters {
        self.shared.settings().parameters
    }

    /// Whether `lease` is held in this session, and where.
    pub(crate) fn slot_of(&self, lease: u32) -> Option<usize> {
        let settings = self.shared.settings();
        settings
            .slots
            .iter()
            .position(|held| held.as_ref().is_some_and(|held| held.lease == lease))
    }

    pub(crate) async fn end_lease(&self, slot: usize, lease: u32, because: &str) {
        let ended = {
            let mut settings = self.shared.settings();
            let is_held = settings
                .slots
                .get(slot)
                .and_then(Option::as_ref)
                .is_some_and(|held| held.lease == lease);
            if is_held {
                settings.slots[slot].take()
            } else {
                None
            }
        };
        let Some(ended) = ended else { return };
        self.shared.emit(
            Level::Info,
            format!(
                "{} {because}: tool {} is free",
                ended.operator,
                tool_id(slot)
            ),
        );
        // A loop that does not answer has worse troubles, and says so elsewhere.
        let _ = self
            .order(Order::Detach {
                session: self.shared.number,
                slot,
                lease,
            })
            .await;
    }

    pub(super) async fn grant(
        &self,
        request: &JoinRequest,
        inner: &Inner,
    ) -> Result<Granted, (RefusalCode, String)> {
        // From the parameters that the tool is made with to its attachment: nobody changes them meanwhile.
        let _one_at_a_time = self.shared.changes.lock().await;
        if let Some(field) = self.shared.last_record().fault {
            let reason =
                format!("the session is in fault ({field} is not finite); a fresh block ends it");
            return Err((RefusalCode::Fault, reason));
        }
        let lease = inner.next_lease.fetch_add(1, Ordering::Relaxed);
        let Some(slot) = self.shared.hold_slot(&request.operator, lease) else {
            let reason = format!(
                "all {} tools of session `{}` are held",
                self.shared.settings().slots.len(),
                self.shared.id
            );
            return Err((RefusalCode::NoFreeTool, reason));
        };
        let (loop_parameters, spec) = {
            let settings = self.shared.settings();
            (settings.parameters, settings.spec.clay.clone())
        };
        let unavailable = |reason: String| (RefusalCode::ShuttingDown, reason);
        let side = ToolSide::new(&loop_parameters, lease)
            .map_err(|error: ParameterError| unavailable(error.to_string()))?;
        let attach = Order::Attach {
            session: self.shared.number,
            slot,
            side: Box::new(side),
        };
        if let Err(error) = self.order(attach).await {
            self.shared.settings().slots[slot] = None;
            return Err(unavailable(error.to_string()));
        }
        let (epoch, revision) = {
            let mirror = self.shared.mirror.lock().expect("no holder panics");
            (mirror.epoch, mirror.clay.revision())
        };
        Ok(Granted {
            lease,
            tool: tool_id(slot),
            lease_s: self.shared.lease_s(),
            parameters: loop_parameters,
            clay: ClayDescription {
                shape: spec.shape,
                voxel_size_m: spec.voxel_size_m,
                epoch,
                revision,
            },
            slow_endpoint: inner.slow_endpoint.clone(),
        })
    }

    async fn order(&self, order: Order) -> Result<(), ChangeError> {
        let inner = self.directory.upgrade().ok_or(ChangeError::Gone)?;
        inner.order(order).await
    }

    /// Waits until the statistics know of the session at all.
    pub(super) async fn first_record(&self) {
        self.until(|record| 0 < record.ticks).await;
    }

    async fn record_of_epoch(&self, epoch: u32) {
        self.until(|record| record.clay_epoch == epoch).await;
    }

    async fn until(&self, holds: impl Fn(&SessionRecord) -> bool) {
        let started = Instant::now();
        while started.elapsed() < ORDER_TIMEOUT {
            if holds(&self.shared.last_record()) {
                return;
            }
            tokio::time::sleep(TICK * 4).await;
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

/// The block, its memory committed, and a copy for the watchers.
pub(super) fn build_clay(clay: &ClaySpec, spec: &NewSession) -> Result<(Clay, Clay), FieldError> {
    let shape = convert::shape(&clay.shape)?;
    let mut block = Clay::new(&shape, clay.voxel_size_m)
        .map_err(|error| FieldError::new("/shape", error.to_string()))?;
    let tool = convert::tool(&spec.tool)?;
    block
        .admits(&tool)
        .map_err(|error| FieldError::new("/voxel_size_m", error.to_string()))?;
    let mirror = block.clone();
    block.commit_pages();
    Ok((block, mirror))
}
