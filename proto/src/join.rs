//! Joining, leaving and asking for a fresh block: queries with JSON both ways.
//!
//! A handle asks on `…/challenge`, then on `…/join`, gets a lease and everything it needs to run its side of the loop,
//! and then sends frames under that lease. A lease lives as long as frames come and ends `lease_s` after the last one.
//! [`JoinRequest`] and [`JoinReply`] cross inside of the messages of a handshake, which nobody else can read.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::http::{ClayShape, check_name};
use crate::invite::InviteId;
use crate::legible::{check_text, fitted};
use crate::scheme::MAX_DEADBAND;
use crate::validate::{FieldError, Validate, check};
use crate::word::words;
use crate::{Axes, Material, NodeName, Scheme, ToolDescription};

/// Longest word of farewell, in characters.
const MAX_FAREWELL: usize = 256;

/// Asks for a challenge. Anybody may.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChallengeRequest {
    /// The protocol that the handle speaks, [`PROTOCOL`](crate::PROTOCOL).
    pub protocol: u32,
}

/// What a server says to a [`ChallengeRequest`], to anybody.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "snake_case", deny_unknown_fields)]
pub enum ChallengeReply {
    /// A join may name this challenge.
    Given {
        /// 32 bytes.
        #[serde(with = "hex::serde")]
        challenge: [u8; 32],
        /// Whether a join must show that it knows the server's token.
        needs_token: bool,
    },
    /// No join can be granted.
    Refused {
        /// Why, for programs.
        code: RefusalCode,
        /// Why, for people.
        reason: String,
    },
}

/// A join as it crosses.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SealedJoin {
    /// The challenge that the server gave.
    #[serde(with = "hex::serde")]
    pub challenge: [u8; 32],
    /// First message of the handshake, with a [`JoinRequest`] in it.
    #[serde(with = "hex::serde")]
    pub message: Vec<u8>,
    /// The invite whose token the handle knows; left out by a handle with the server's own token, or none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub invite: Option<InviteId>,
}

/// The answer to a join as it crosses.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "snake_case", deny_unknown_fields)]
pub enum SealedReply {
    /// The server has heard the request.
    Answered {
        /// Second message of the handshake, with a [`JoinReply`] in it.
        #[serde(with = "hex::serde")]
        message: Vec<u8>,
    },
    /// It has not. Anybody can say so: only where nobody says anything better is it worth something.
    Refused {
        /// Why, for programs.
        code: RefusalCode,
        /// Why, for people.
        reason: String,
    },
}

/// Asks for a lease.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JoinRequest {
    /// The protocol that the handle speaks, [`PROTOCOL`](crate::PROTOCOL).
    pub protocol: u32,
    /// Who holds the handle, for people to read; 1 to 64 characters.
    pub operator: String,
    /// What the handle is, for people to read; 1 to 64 characters.
    pub device: String,
}

/// What the server says to a [`JoinRequest`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "snake_case", deny_unknown_fields)]
pub enum JoinReply {
    /// Come in.
    Granted(Box<Granted>),
    /// Stay out.
    Refused {
        /// Why, for programs.
        code: RefusalCode,
        /// Why, for people.
        reason: String,
        /// Who holds the tool, where the code is [`RefusalCode::NoFreeTool`]; for whom it is kept, where it is
        /// [`RefusalCode::Reserved`]; who has stopped the session, where it is [`RefusalCode::Stopped`].
        #[serde(default, skip_serializing_if = "Option::is_none")]
        holder: Option<String>,
    },
}

impl JoinReply {
    /// A refusal that names nobody.
    #[must_use]
    pub const fn refused(code: RefusalCode, reason: String) -> Self {
        Self::Refused {
            code,
            reason,
            holder: None,
        }
    }
}

/// A lease and all that the handle needs to use it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Granted {
    /// Goes into every frame. Never 0, and never given twice in one session.
    pub lease: u32,
    /// Goes into every frame: counts the servers that have run the session.
    pub ownership_epoch: u32,
    /// The server that runs the session, for people to read.
    pub node: NodeName,
    /// The tool that the lease drives.
    pub tool: u32,
    /// The lease ends this long after the last frame, s.
    pub lease_s: f64,
    /// How to run the loop.
    pub parameters: LoopParameters,
    /// The clay that the tool cuts.
    pub clay: ClayDescription,
    /// Zenoh endpoint of the session for bricks and slow state, when it is another than the one joined on.
    pub slow_endpoint: Option<String>,
}

/// The clay, but for its voxels: those come with the answer of `…/clay/snapshot`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClayDescription {
    /// What the block started as.
    pub shape: ClayShape,
    /// Edge of a voxel, m.
    pub voxel_size_m: f64,
    /// Counts the fresh blocks.
    pub epoch: u32,
    /// Counts the changes since the fresh block.
    pub revision: u64,
}

words! {
    /// Why a handle may not join.
    pub enum RefusalCode: "refusal" {
        /// The two sides speak different protocols.
        ProtocolMismatch "protocol_mismatch",
        /// The request has a field that is not acceptable.
        BadRequest "bad_request",
        /// The server asks for a token and the handle has none.
        TokenRequired "token_required",
        /// The token is not the server's.
        TokenRejected "token_rejected",
        /// The token is the server's, and this is not among what it is good for.
        NotAllowed "not_allowed",
        /// The server has no time for another tool beside those that are held: ticks would start late.
        NoTickTime "no_tick_time",
        /// Every tool of the session is held.
        NoFreeTool "no_free_tool",
        /// Somebody has stopped the session: nobody gets a tool until that is over.
        Stopped "stopped",
        /// The tool that is free is kept for another operator, for a moment.
        Reserved "reserved",
        /// There is no such session.
        NoSuchSession "no_such_session",
        /// The server is about to stop.
        ShuttingDown "shutting_down",
        /// The session's loop does not take the request up now; it may, a moment later.
        Busy "busy",
    }
}

/// What every question under a lease says: give it back, put a fresh block in place of the one that was cut (the same
/// shape, the same material), tell the parameters of the loop, the clay, the session's state. What is asked is in the
/// key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeaseRequest {
    /// The lease.
    pub lease: u32,
}

/// What the server says to whoever gives a lease back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "snake_case", deny_unknown_fields)]
pub enum LeaveReply {
    /// The tool is free again.
    Left,
    /// Nobody holds this lease (any more).
    NoSuchLease,
}

/// The server's last word to whoever holds a tool, once it has taken the tool away.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Farewell {
    /// The lease that is over.
    pub lease: u32,
    /// Why, for people.
    pub reason: String,
}

impl Farewell {
    /// A farewell whose words fit, whatever names stand in them.
    #[must_use]
    pub fn fitting(lease: u32, reason: &str) -> Self {
        Self {
            lease,
            reason: fitted(reason, MAX_FAREWELL, "the tool was taken away"),
        }
    }
}

/// What the server says to whoever asks for a fresh block.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "snake_case", deny_unknown_fields)]
pub enum FreshReply {
    /// The block is fresh.
    Fresh {
        /// Counts the fresh blocks, as [`ClayDescription::epoch`] does.
        epoch: u32,
    },
    /// The block stays as it is.
    Refused {
        /// Why, for people.
        reason: String,
    },
}

/// How to run the loop; both sides run the same. The answer to a query of `…/parameters`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LoopParameters {
    /// Counts the changes of the session, modulo 2³²; tool frames name it, so that a handle sees when these parameters
    /// may be others.
    pub revision: u32,
    /// Length of a tick, s.
    pub tick_s: f64,
    /// How many axes move.
    pub axes: Axes,
    /// The law that couples the two sides.
    pub scheme: Scheme,
    /// `M` of `C_h1 = 1 / (M s² + B s)`, kg.
    pub virtual_mass_kg: f64,
    /// `B` of `C_h1`, N·s/m.
    pub virtual_damping_n_s_per_m: f64,
    /// Tool displacement per handle displacement, `A_h1` of `[KHMH03]`.
    pub position_ratio: f64,
    /// Tool force per hand force, a magnitude: `A_h2` of `[KHMH03]` is its negative.
    pub force_ratio: f64,
    /// `M_t` of `G_t = 1 / (M_t s² + B_t s + K_t)`, kg.
    pub tool_mass_kg: f64,
    /// `B_t` of `G_t`, N·s/m.
    pub tool_damping_n_s_per_m: f64,
    /// `K_t` of `G_t`, N/m.
    pub tool_stiffness_n_per_m: f64,
    /// Line impedance `b` of the wave scheme, N·s/m.
    pub wave_impedance_n_s_per_m: f64,
    /// Share of a force or velocity whose change the hand cannot feel: frames that change less are left out. 0 leaves
    /// none out.
    #[serde(default)]
    pub deadband: f64,
    /// After this long without a frame the other side counts as gone, s.
    pub silence_s: f64,
    /// In this time forces ramp to zero after silence, and back up after it, s.
    pub ramp_s: f64,
    /// Greatest force that a side puts out, N.
    pub force_limit_n: f64,
    /// Greatest rate of change of that force, N/s.
    pub slew_limit_n_per_s: f64,
    /// Tool position in the clay's frame when the handle is at its origin, m.
    pub home_m: [f64; 3],
    /// Least and greatest tool position in the clay's frame, m.
    pub reach_m: [[f64; 3]; 2],
    /// Greatest speed of the tool, m/s.
    pub speed_limit_m_s: f64,
    /// The tool's shape.
    pub tool: ToolDescription,
    /// What the clay resists with.
    pub material: Material,
}

impl Default for LoopParameters {
    /// The controller and tool of `[KHMH03]` and the default block of clay.
    fn default() -> Self {
        Self {
            revision: 0,
            tick_s: 1e-3,
            axes: Axes::default(),
            scheme: Scheme::default(),
            virtual_mass_kg: 1.0,
            virtual_damping_n_s_per_m: 10.0,
            position_ratio: 1.0,
            force_ratio: 1.0,
            tool_mass_kg: 0.5,
            tool_damping_n_s_per_m: 20.0,
            tool_stiffness_n_per_m: 0.0,
            // The tool's own damping: a tool in free air then reflects no wave at low frequency.
            wave_impedance_n_s_per_m: 20.0,
            deadband: 0.0,
            // A hundred ticks: no loss of single packets reaches it, and a hand hardly moves within it.
            silence_s: 0.1,
            ramp_s: 0.05,
            // Ten times the cutting experiment's hand force, and within what desktop devices hold for long.
            force_limit_n: 20.0,
            // From nothing to the limit within 10 ms: faster than a hand reacts, slower than a jolt.
            slew_limit_n_per_s: 2000.0,
            // In front of the block, halfway across it, the blade's edge on top of the stepped block's base.
            home_m: [0.0, 0.032, 0.010],
            // The default block and a handle's travel around it.
            reach_m: [[-0.1, -0.1, -0.1], [0.25, 0.2, 0.2]],
            speed_limit_m_s: 2.0,
            tool: ToolDescription::default(),
            material: Material::default(),
        }
    }
}

impl Validate for JoinRequest {
    /// The protocol is not checked here: a mismatch has a refusal of its own.
    fn validate(&self) -> Result<(), FieldError> {
        check_name("/operator", &self.operator)?;
        check_name("/device", &self.device)
    }
}

impl Validate for JoinReply {
    fn validate(&self) -> Result<(), FieldError> {
        match self {
            Self::Granted(granted) => granted.validate(),
            Self::Refused { .. } => Ok(()),
        }
    }
}

impl Validate for Granted {
    fn validate(&self) -> Result<(), FieldError> {
        check("/lease_s", self.lease_s, 0.01..=3600.0)?;
        self.parameters.validate_under("/parameters")?;
        self.clay.validate_under("/clay")
    }
}

impl Validate for ClayDescription {
    fn validate(&self) -> Result<(), FieldError> {
        crate::http::ClaySpec {
            shape: self.shape.clone(),
            voxel_size_m: self.voxel_size_m,
            layers: Vec::new(),
        }
        .validate()
    }
}

impl Validate for ChallengeRequest {
    fn validate(&self) -> Result<(), FieldError> {
        Ok(())
    }
}

impl Validate for ChallengeReply {
    fn validate(&self) -> Result<(), FieldError> {
        Ok(())
    }
}

impl Validate for SealedJoin {
    fn validate(&self) -> Result<(), FieldError> {
        Ok(())
    }
}

impl Validate for SealedReply {
    fn validate(&self) -> Result<(), FieldError> {
        Ok(())
    }
}

impl Validate for Farewell {
    fn validate(&self) -> Result<(), FieldError> {
        check_text("/reason", &self.reason, MAX_FAREWELL)
    }
}

impl Validate for LeaseRequest {
    fn validate(&self) -> Result<(), FieldError> {
        Ok(())
    }
}

impl Validate for LeaveReply {
    fn validate(&self) -> Result<(), FieldError> {
        Ok(())
    }
}

impl Validate for FreshReply {
    fn validate(&self) -> Result<(), FieldError> {
        Ok(())
    }
}

impl Validate for LoopParameters {
    /// # Errors
    /// What no loop could run on. The handle checks what the server sends: a force must never rest on trust.
    fn validate(&self) -> Result<(), FieldError> {
        check("/tick_s", self.tick_s, 1e-5..=0.1)?;
        check("/virtual_mass_kg", self.virtual_mass_kg, 1e-3..=1e3)?;
        check(
            "/virtual_damping_n_s_per_m",
            self.virtual_damping_n_s_per_m,
            0.0..=1e5,
        )?;
        check("/position_ratio", self.position_ratio, 1e-3..=1e3)?;
        check("/force_ratio", self.force_ratio, 1e-3..=1e3)?;
        check("/tool_mass_kg", self.tool_mass_kg, 1e-3..=1e3)?;
        check(
            "/tool_damping_n_s_per_m",
            self.tool_damping_n_s_per_m,
            0.0..=1e5,
        )?;
        check(
            "/tool_stiffness_n_per_m",
            self.tool_stiffness_n_per_m,
            0.0..=1e6,
        )?;
        check(
            "/wave_impedance_n_s_per_m",
            self.wave_impedance_n_s_per_m,
            1e-3..=1e5,
        )?;
        check("/deadband", self.deadband, 0.0..=MAX_DEADBAND)?;
        check("/silence_s", self.silence_s, 1e-3..=10.0)?;
        check("/ramp_s", self.ramp_s, 1e-3..=10.0)?;
        check("/force_limit_n", self.force_limit_n, 0.0..=1e3)?;
        check("/slew_limit_n_per_s", self.slew_limit_n_per_s, 0.0..=1e6)?;
        check("/speed_limit_m_s", self.speed_limit_m_s, 0.0..=10.0)?;
        // A sweep's position reaches 128 m; ten leave room for whatever is added on the way.
        let [least, greatest] = self.reach_m;
        for axis in 0..3 {
            check(&format!("/reach_m/0/{axis}"), least[axis], -10.0..=10.0)?;
            check(
                &format!("/reach_m/1/{axis}"),
                greatest[axis],
                least[axis]..=10.0,
            )?;
            check(
                &format!("/home_m/{axis}"),
                self.home_m[axis],
                least[axis]..=greatest[axis],
            )?;
        }
        self.tool.validate_under("/tool")?;
        self.material.validate_under("/material")
    }
}
