//! What a handle asks the server for while it works: parameters that have changed, and snapshots of the clay.
//!
//! The tick only says what it wants ([`Wanted`]); here it is fetched, checked and built, on threads that may take their
//! time. Nothing that a server answers is trusted: a snapshot that shows another block, misses bricks or holds clay
//! where none can be is no snapshot.

use std::sync::Arc;
use std::time::Duration;

use teleclay_bilateral::{NotReceived, ReceivedClay, lower, tool_setup};
use teleclay_channel::Purpose;
use teleclay_clay::Clay;
use teleclay_device::DeviceProfile;
use teleclay_link::replica::ToolSetup;
use teleclay_link::scheme::replica::{Snapshot, WantedSnapshot};
use teleclay_proto::Scheme;
use teleclay_proto::http::Validate;
use teleclay_proto::join::LoopParameters;
use tokio::time::Instant;
use zenoh::Session;

use crate::grant::JoinGrant;
use crate::question::Question;

/// After an answer, or none, nothing is asked for this long: what came has reached the tick by then, and a server that
/// has just made a fresh block shows it in its mirror.
pub(crate) const PAUSE: Duration = Duration::from_millis(100);
/// A snapshot of the largest block takes seconds on its way.
const TIMEOUT: Duration = Duration::from_secs(10);
/// Longer descriptions are not read: one of a session with the most tools and steps has a fifth of it.
const LONGEST_TEXT: usize = 64 * 1024;

/// Nor are longer snapshots: the largest block has 2²⁷ voxels of a byte each, and a packed brick is at most a hundredth
/// longer.
const LONGEST_SNAPSHOT: usize = (1 << 27) / 100 * 102;

/// What the tick would like to know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wanted {
    /// Revision that the session is at.
    pub(crate) revision: u32,
    /// The snapshot of the clay that it lacks.
    pub(crate) snapshot: Option<WantedSnapshot>,
    /// The scheme of which it lacks a controller.
    pub(crate) controller: Option<Scheme>,
}

/// Parameters, of which some can change while a handle works.
pub(crate) struct Changed {
    pub(crate) parameters: LoopParameters,
    /// Where, with what and in what the tool works under them.
    pub(crate) setup: Arc<ToolSetup>,
}

/// What came.
pub(crate) struct Fresh {
    /// Parameters of the revision that was asked for, or of a later one.
    pub(crate) parameters: Option<Changed>,
    /// The snapshot that was asked for.
    pub(crate) snapshot: Option<Snapshot>,
    /// What that took on the way and to build.
    pub(crate) took: Duration,
}

/// Fetches what is wanted. Parameters come first: a snapshot is of use only where tool and place are known.
///
/// # Errors
/// Nobody answers, or nonsense; in words.
pub(crate) async fn refresh(
    slow: Session,
    grant: JoinGrant,
    profile: DeviceProfile,
    known: u32,
    wanted: Wanted,
) -> Result<Fresh, String> {
    let began = Instant::now();
    let parameters = if wanted.revision == known {
        None
    } else {
        Some(parameters(&slow, &grant, profile).await?)
    };
    let snapshot = match wanted.snapshot {
        None => None,
        Some(wanted) => Some(snapshot(&slow, &grant, wanted.epoch).await?),
    };
    Ok(Fresh {
        parameters,
        snapshot,
        took: began.elapsed(),
    })
}

async fn parameters(
    slow: &Session,
    grant: &JoinGrant,
    profile: DeviceProfile,
) -> Result<Changed, String> {
    let mut parameters: LoopParameters = text(slow, grant, Purpose::Parameters).await?;
    parameters
        .validate()
        .map_err(|error| format!("parameters: {error}"))?;
    lower(&mut parameters, profile);
    let setup = tool_setup(&parameters).map_err(|error| format!("parameters: {error}"))?;
    Ok(Changed { parameters, setup })
}

async fn snapshot(slow: &Session, grant: &JoinGrant, epoch: u32) -> Result<Snapshot, String> {
    let described: teleclay_proto::http::Session = text(slow, grant, Purpose::State).await?;
    let clay = described.clay;
    if clay.epoch != epoch {
        return Err(format!(
            "the server describes block {}, wanted {epoch}",
            clay.epoch
        ));
    }
    let spec = teleclay_proto::http::ClaySpec {
        shape: clay.shape,
        voxel_size_m: clay.voxel_size_m,
        // Its classes come with the bricks.
        layers: Vec::new(),
    };
    let key = grant.keys.clay_snapshot();
    let bricks = question(slow, grant, Purpose::ClaySnapshot, &key)
        .ask_for_parts()
        .await?;
    let built = tokio::task::spawn_blocking(move || build(&spec, epoch, &bricks));
    // It fails only where the program ends.
    let clay = built.await.map_err(|error| error.to_string())?;
    let clay = clay.map_err(|error| error.to_string())?;
    Ok(Snapshot { clay, epoch })
}

/// The block of `spec` as the messages show it.
fn build(
    spec: &teleclay_proto::http::ClaySpec,
    epoch: u32,
    messages: &[Vec<u8>],
) -> Result<Box<Clay>, NotReceived> {
    let mut received = ReceivedClay::begin(spec, epoch)?;
    messages
        .iter()
        .try_for_each(|message| received.take_in(message))?;
    received.finish()
}

async fn text<T: serde::de::DeserializeOwned>(
    slow: &Session,
    grant: &JoinGrant,
    purpose: Purpose,
) -> Result<T, String> {
    let key = match purpose {
        Purpose::Parameters => grant.keys.parameters(),
        _ => grant.keys.state(),
    };
    let answer = question(slow, grant, purpose, &key).ask().await?;
    serde_json::from_slice(&answer).map_err(|error| format!("`{key}`: {error}"))
}

fn question<'a>(
    slow: &'a Session,
    grant: &'a JoinGrant,
    purpose: Purpose,
    key: &'a str,
) -> Question<'a> {
    Question {
        session: slow,
        key,
        purpose,
        channel: &grant.channel,
        lease: grant.granted.lease,
        within: TIMEOUT,
        longest: match purpose {
            Purpose::ClaySnapshot => LONGEST_SNAPSHOT,
            _ => LONGEST_TEXT,
        },
    }
}
