//! What a command needs built before the tick, and what it leaves to be dropped after it.
//!
//! A tick neither allocates nor drops what is large. So whoever has a command for a session makes it a [`Prepared`]
//! first, on a thread that may take its time; the tick exchanges what was built for what it replaces; and the same
//! [`Prepared`] carries that away again.

use std::sync::Arc;

use teleclay_bilateral::{LoopModel, ToolSide, tool_setup};
use teleclay_clay::{Clay, Material, ToolShape};
use teleclay_link::replica::ToolSetup;
use teleclay_link::scheme::{ToolController, tool_controller};
use teleclay_proto::http::{FieldError, MAX_TOOLS, Stop, check_name, check_reason};

use crate::command::{Command, Operator, Refusal};
use crate::event::{Exchange, StopSnapshot};
use crate::settings::{Lines, Settings};

/// A command with everything that it needs. After it was carried out, it holds what it has replaced.
pub struct Prepared {
    /// Revision of the settings that it was made from; a command that does not depend on settings names none.
    pub(crate) prepared_from: Option<u64>,
    /// The lease under which it is asked for, where that has to be held.
    pub(crate) asked_by: Option<u32>,
    pub(crate) parts: Parts,
}

pub(crate) enum Parts {
    Patch(Box<PatchParts>),
    Reset(Box<ResetParts>),
    Join(Box<JoinParts>),
    Exchange(Box<ExchangeParts>),
    Leave {
        lease: u32,
        side: Option<Box<ToolSide>>,
    },
    Stop(Box<StopParts>),
    ClearStop {
        by: Arc<str>,
        /// Gets the stop that was.
        before: Option<StopSnapshot>,
    },
    Control(Box<ControlParts>),
}

pub(crate) struct StopParts {
    pub(crate) by: Arc<str>,
    pub(crate) reason: Arc<str>,
    /// Gets the sides that were held. Has room for every tool.
    pub(crate) sides: Vec<Box<ToolSide>>,
    /// Gets the names for whom tools were kept. Has room for every tool.
    pub(crate) names: Vec<Arc<str>>,
}

/// What is wanted of one tool.
pub(crate) struct ControlParts {
    /// Its number, from 1.
    pub(crate) tool: u32,
    /// The lease under which it has to be held, if it matters.
    pub(crate) lease: Option<u32>,
    pub(crate) wish: Wish,
    /// Gets the side that was held.
    pub(crate) side: Option<Box<ToolSide>>,
    /// Gets a name that is of no use any more.
    pub(crate) name: Option<Arc<str>>,
}

pub(crate) enum Wish {
    Request {
        operator: Arc<str>,
    },
    Withdraw {
        operator: Arc<str>,
    },
    Grant {
        operator: Arc<str>,
    },
    Deny {
        operator: Arc<str>,
        reason: Arc<str>,
    },
    Release,
}

pub(crate) struct PatchParts {
    pub(crate) settings: Arc<Settings>,
    pub(crate) material: Option<Material>,
    pub(crate) lines: Option<Lines>,
    pub(crate) deadband: Option<f64>,
    /// One for each tool, where the scheme changes.
    pub(crate) controllers: Controllers,
    /// Keeps alive, until it is dropped with the rest, what the controllers were built with.
    _setup: Option<Arc<ToolSetup>>,
}

pub(crate) struct ResetParts {
    pub(crate) settings: Arc<Settings>,
    pub(crate) clay: Clay,
    pub(crate) setup: Arc<ToolSetup>,
    /// Gets what the tools had before. Has room for every tool.
    pub(crate) before: Vec<Arc<ToolSetup>>,
    /// Hash of the block, if it is not the one that the settings describe.
    pub(crate) given: Option<u64>,
}

pub(crate) struct ExchangeParts {
    /// The clay that comes; afterwards the one that went.
    pub(crate) clay: Clay,
    /// The block whose strokes it was made from.
    pub(crate) clay_epoch: u32,
    pub(crate) exchange: Exchange,
    pub(crate) as_of_tick: u64,
    pub(crate) shape: ToolShape,
}

/// Clay that is to take the place of a session's, and what it was made from.
pub struct ExchangedClay {
    /// The clay.
    pub clay: Clay,
    /// The block that it was made from: the session's `clay_epoch` then.
    pub clay_epoch: u32,
    /// What is different.
    pub exchange: Exchange,
    /// It has everything that was cut up to this tick and not undone.
    pub as_of_tick: u64,
}

pub(crate) struct JoinParts {
    pub(crate) operator: Arc<Operator>,
    /// The side for the operator; afterwards the side of whoever held the tool before, if anybody did.
    pub(crate) side: Option<Box<ToolSide>>,
    /// Gets the name for whom the tool was kept.
    pub(crate) name: Option<Arc<str>>,
}

impl Prepared {
    /// Checks a command and builds what it needs.
    ///
    /// # Errors
    /// A field of the command cannot be. Nothing was changed then, because nothing was told to the session.
    pub fn new(command: &Command, settings: &Settings) -> Result<Self, Refusal> {
        let parts = match command {
            Command::Patch { patch } => {
                let patched = settings.patched(patch).map_err(Refusal::Field)?;
                let is_other_scheme = patched.spec.scheme != settings.spec.scheme;
                let (controllers, setup) = if is_other_scheme {
                    controllers(&patched)?
                } else {
                    (Vec::new(), None)
                };
                Parts::Patch(Box::new(PatchParts {
                    material: patch.material.map(|_| patched.material()),
                    lines: patch.network.map(|_| patched.lines()),
                    deadband: patch.deadband,
                    settings: Arc::new(patched),
                    controllers,
                    _setup: setup,
                }))
            }
            Command::Reset { reset, lease } => {
                let fresh = settings.with_fresh_block(reset).map_err(Refusal::Field)?;
                let clay = fresh.fresh_block().map_err(Refusal::Field)?;
                let mut prepared = Self::fresh_block(fresh, clay, settings.revision)?;
                prepared.asked_by = *lease;
                return Ok(prepared);
            }
            Command::Join { operator } => {
                let side = ToolSide::new(&settings.parameters, 0).map_err(no_loop)?;
                return Ok(Self::join(operator, side, Some(settings.revision)));
            }
            Command::Leave { lease } => {
                return Ok(Self::of_any_settings(Parts::Leave {
                    lease: *lease,
                    side: None,
                }));
            }
            Command::Stop { by, reason } => return Ok(Self::stop(by, reason)),
            Command::ClearStop { by } => {
                check_name("/by", by).map_err(Refusal::Field)?;
                return Ok(Self::of_any_settings(Parts::ClearStop {
                    by: by.as_str().into(),
                    before: None,
                }));
            }
            Command::Request { tool, operator } => {
                let operator = name(operator)?;
                return Ok(Self::control(*tool, None, Wish::Request { operator }));
            }
            Command::Withdraw { tool, operator } => {
                let operator = name(operator)?;
                return Ok(Self::control(*tool, None, Wish::Withdraw { operator }));
            }
            Command::Grant {
                tool,
                operator,
                lease,
            } => {
                let operator = name(operator)?;
                return Ok(Self::control(*tool, *lease, Wish::Grant { operator }));
            }
            Command::Deny {
                tool,
                operator,
                reason,
                lease,
            } => {
                check_reason("/reason", reason).map_err(Refusal::Field)?;
                let wish = Wish::Deny {
                    operator: name(operator)?,
                    reason: reason.as_str().into(),
                };
                return Ok(Self::control(*tool, *lease, wish));
            }
            Command::Release { tool, lease } => {
                return Ok(Self::control(*tool, *lease, Wish::Release));
            }
        };
        Ok(Self {
            prepared_from: Some(settings.revision),
            asked_by: None,
            parts,
        })
    }

    /// A stop. It needs no settings, and its words are made to fit: whoever has no time for more takes this.
    pub fn stop(by: &str, reason: &str) -> Self {
        let Stop { by, reason } = Stop::fitting(by, reason);
        Self::of_any_settings(Parts::Stop(Box::new(StopParts {
            by: by.into(),
            reason: reason.into(),
            sides: Vec::with_capacity(MAX_TOOLS.into()),
            names: Vec::with_capacity(MAX_TOOLS.into()),
        })))
    }

    fn control(tool: u32, lease: Option<u32>, wish: Wish) -> Self {
        Self::of_any_settings(Parts::Control(Box::new(ControlParts {
            tool,
            lease,
            wish,
            side: None,
            name: None,
        })))
    }

    /// Whatever the settings are by then.
    fn of_any_settings(parts: Parts) -> Self {
        Self {
            prepared_from: None,
            asked_by: None,
            parts,
        }
    }

    /// A fresh block that the caller has made, with the settings that hold from then on, made from those of revision
    /// `prepared_from`.
    ///
    /// # Errors
    /// The settings make no loop.
    pub fn fresh_block(
        settings: Settings,
        clay: Clay,
        prepared_from: u64,
    ) -> Result<Self, Refusal> {
        let setup = tool_setup(&settings.parameters).map_err(no_loop)?;
        Ok(Self {
            prepared_from: Some(prepared_from),
            asked_by: None,
            parts: Parts::Reset(Box::new(ResetParts {
                before: Vec::with_capacity(settings.tools()),
                settings: Arc::new(settings),
                clay,
                setup,
                given: None,
            })),
        })
    }

    /// Likewise, of a block that the settings do not describe: whoever keeps the session's history has to keep the
    /// block, by its hash.
    ///
    /// # Errors
    /// The settings make no loop.
    pub fn given_block(
        settings: Settings,
        mut clay: Clay,
        prepared_from: u64,
    ) -> Result<Self, Refusal> {
        let hash = clay.hash();
        let mut prepared = Self::fresh_block(settings, clay, prepared_from)?;
        if let Parts::Reset(parts) = &mut prepared.parts {
            parts.given = Some(hash);
        }
        Ok(prepared)
    }

    /// Clay in the place of the session's, under a new epoch: tools stay where they are, faults stay, and sweeps that
    /// are on their way count. What was cut after its tick is cut in it as well, if that is little; more than little
    /// refuses it ([`Refusal::CutMeanwhile`]).
    pub fn exchange(mut exchanged: ExchangedClay, settings: &Settings) -> Self {
        exchanged.clay.commit_pages();
        Self {
            prepared_from: None,
            asked_by: None,
            parts: Parts::Exchange(Box::new(ExchangeParts {
                clay: exchanged.clay,
                clay_epoch: exchanged.clay_epoch,
                exchange: exchanged.exchange,
                as_of_tick: exchanged.as_of_tick,
                shape: settings.tool_shape(),
            })),
        }
    }

    /// A tool for an operator, with a tool side that the caller has made. With `prepared_from`, it is refused once the
    /// settings have changed since.
    pub fn join(operator: &Operator, side: ToolSide, prepared_from: Option<u64>) -> Self {
        Self {
            prepared_from,
            asked_by: None,
            parts: Parts::Join(Box::new(JoinParts {
                operator: Arc::new(operator.clone()),
                side: Some(Box::new(side)),
                name: None,
            })),
        }
    }

    /// The fresh block that the command brings, if it brings one, and the settings that come with it. Once it was
    /// carried out, these are what it has replaced.
    pub fn fresh(&self) -> Option<(&Settings, &Clay)> {
        match &self.parts {
            Parts::Reset(reset) => Some((&reset.settings, &reset.clay)),
            _ => None,
        }
    }
}

/// A controller for every tool.
type Controllers = Vec<Box<dyn ToolController>>;

/// Controllers of the settings' scheme, and what they were built with.
fn controllers(settings: &Settings) -> Result<(Controllers, Option<Arc<ToolSetup>>), Refusal> {
    let model = LoopModel::new(&settings.parameters).map_err(no_loop)?;
    let context = model.context();
    let controllers = (0..settings.tools())
        .map(|_| tool_controller(settings.parameters.scheme, context))
        .collect();
    Ok((controllers, Some(Arc::clone(&context.setup))))
}

/// An operator's name, checked as that of a join is.
fn name(operator: &str) -> Result<Arc<str>, Refusal> {
    check_name("/operator", operator).map_err(Refusal::Field)?;
    Ok(operator.into())
}

fn no_loop(error: teleclay_bilateral::ParameterError) -> Refusal {
    Refusal::Field(FieldError::new("", error.to_string()))
}
