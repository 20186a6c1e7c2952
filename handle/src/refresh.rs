//! What a handle asks the server for while it works: parameters that have changed, and snapshots of the clay.
//!
//! The tick only says what it wants ([`Wanted`]); here it is fetched, checked and built, on threads that may take their
//! time. Nothing that a server answers is trusted: a snapshot that shows another block, misses bricks or holds clay
//! where none can be is no snapshot.

use std::sync::Arc;
use std::time::Duration;

use teleclay_bilateral::{clay_shape, tool_setup};
use teleclay_channel::Purpose;
use teleclay_clay::{BrickView, Clay};
use teleclay_device::DeviceProfile;
use teleclay_link::replica::ToolSetup;
use teleclay_link::scheme::replica::{Snapshot, WantedSnapshot};
use teleclay_proto::Scheme;
use teleclay_proto::http::Validate;
use teleclay_proto::join::LoopParameters;
use teleclay_proto::watch::{BRICK_VOXELS, BrickBody, BricksView};
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

/// Takes what a server says about the force on the hand, and about when it is let go, only below what the device
/// allows.
pub(crate) fn lower(parameters: &mut LoopParameters, profile: DeviceProfile) {
    parameters.force_limit_n = parameters.force_limit_n.min(profile.force_n);
    parameters.slew_limit_n_per_s = parameters.slew_limit_n_per_s.min(profile.slew_n_per_s);
    parameters.silence_s = parameters.silence_s.min(profile.silence_s);
    parameters.ramp_s = parameters.ramp_s.min(profile.ramp_s);
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
    };
    spec.validate().map_err(|error| format!("clay: {error}"))?;
    let key = grant.keys.clay_snapshot();
    let bricks = question(slow, grant, Purpose::ClaySnapshot, &key)
        .ask_for_parts()
        .await?;
    let built = tokio::task::spawn_blocking(move || build(&spec, epoch, &bricks));
    // It fails only where the program ends.
    let clay = built.await.map_err(|error| error.to_string())??;
    Ok(Snapshot { clay, epoch })
}

/// The block of `spec` as the messages show it.
fn build(
    spec: &teleclay_proto::http::ClaySpec,
    epoch: u32,
    messages: &[Vec<u8>],
) -> Result<Box<Clay>, String> {
    let shape = clay_shape(&spec.shape).map_err(|error| error.to_string())?;
    let mut clay = Clay::new(&shape, spec.voxel_size_m).map_err(|error| error.to_string())?;
    let grid = *clay.grid();
    let mut is_told = vec![false; grid.brick_count()];
    let mut voxels = Box::new([0; BRICK_VOXELS]);
    for message in messages {
        let view = BricksView::decode(message).map_err(|error| format!("bricks: {error}"))?;
        if view.header.clay_epoch != epoch {
            return Err(format!(
                "bricks of block {}, wanted {epoch}",
                view.header.clay_epoch
            ));
        }
        if view.header.bricks_per_axis != grid.bricks() {
            return Err(format!(
                "bricks of a grid of {:?}, wanted {:?}",
                view.header.bricks_per_axis,
                grid.bricks()
            ));
        }
        for brick in view.iter() {
            let index = grid
                .brick_index(brick.index)
                .ok_or_else(|| format!("there is no brick {}", brick.index))?;
            let content = match brick.body {
                BrickBody::Empty => BrickView::Empty,
                BrickBody::Full => BrickView::Full,
                BrickBody::Packed(packed) => {
                    packed.unpack(&mut voxels);
                    BrickView::Voxels(&voxels)
                }
            };
            clay.replace_brick(index, content)
                .map_err(|error| format!("bricks: {error}"))?;
            is_told[brick.index as usize] = true;
        }
    }
    let missing = is_told.iter().filter(|is_told| !**is_told).count();
    if 0 < missing {
        return Err(format!(
            "{missing} of {} bricks did not come",
            is_told.len()
        ));
    }
    // Neither page faults nor hashes of bricks that nobody has touched are the tick's work.
    clay.commit_pages();
    clay.hash();
    Ok(Box::new(clay))
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

#[cfg(test)]
mod tests {
    use super::*;
    use teleclay_clay::{Ball, Pose, Sweep, ToolShape};
    use teleclay_proto::http::{ClayShape, ClaySpec};
    use teleclay_proto::watch::{BrickContent, BricksHeader, BricksWriter};

    fn spec() -> ClaySpec {
        ClaySpec {
            shape: ClayShape::Block {
                size_m: [0.048, 0.032, 0.020],
            },
            voxel_size_m: 1e-3,
        }
    }

    fn cut_block() -> Clay {
        let mut clay = Clay::new(&clay_shape(&spec().shape).unwrap(), 1e-3).unwrap();
        let at = |position_m| Pose::quantise(position_m).unwrap();
        clay.carve(&Sweep {
            shape: ToolShape::Ball(Ball::new(0.006).unwrap()),
            from: at([0.005, 0.016, 0.018]),
            to: at([0.040, 0.012, 0.012]),
        });
        clay
    }

    /// The clay in messages, without the bricks that `is_told` leaves out.
    fn told(clay: &Clay, epoch: u32, is_told: impl Fn(u32) -> bool) -> Vec<Vec<u8>> {
        let header = BricksHeader {
            clay_epoch: epoch,
            bricks_per_axis: clay.grid().bricks(),
            voxel_size_m: 1e-3,
            ..BricksHeader::default()
        };
        // So short that it takes several messages.
        let mut writer = BricksWriter::new(header, 4096);
        for dense in (0..clay.grid().brick_count() as u32).filter(|dense| is_told(*dense)) {
            let index = clay.grid().brick_index(dense).unwrap();
            let content = match clay.brick(index) {
                BrickView::Empty => BrickContent::Empty,
                BrickView::Full => BrickContent::Full,
                BrickView::Voxels(voxels) => BrickContent::Voxels(voxels),
            };
            writer.push(dense, content).unwrap();
        }
        writer.finish()
    }

    #[test]
    fn a_snapshot_is_the_clay_to_the_last_bit() {
        let mut clay = cut_block();
        let messages = told(&clay, 4, |_| true);
        assert!(1 < messages.len());
        let mut built = build(&spec(), 4, &messages).unwrap();
        assert_eq!(built.hash(), clay.hash());
        assert_eq!(built.remaining_units(), clay.remaining_units());
        assert_eq!(built.initial_units(), clay.initial_units());
    }

    #[test]
    fn what_is_no_snapshot_of_this_block_is_refused_with_the_reason() {
        let clay = cut_block();
        let whole = told(&clay, 4, |_| true);
        let why = |messages: &[Vec<u8>]| build(&spec(), 4, messages).map(|_| ()).unwrap_err();
        assert_eq!(
            why(&told(&clay, 5, |_| true)),
            "bricks of block 5, wanted 4"
        );
        assert_eq!(why(&[]), "12 of 12 bricks did not come");
        assert_eq!(
            why(&told(&clay, 4, |dense| dense != 3)),
            "1 of 12 bricks did not come"
        );
        assert!(why(&[whole[0][..20].to_vec()]).starts_with("bricks: "));
        let taller = ClaySpec {
            shape: ClayShape::Block {
                size_m: [0.048, 0.032, 0.040],
            },
            ..spec()
        };
        let said = build(&taller, 4, &whole).map(|_| ()).unwrap_err();
        assert!(said.contains("bricks of a grid of [3, 2, 2]"), "{said}");
    }

    #[test]
    fn clay_where_none_can_be_is_refused() {
        let higher = ClaySpec {
            shape: ClayShape::Block {
                size_m: [0.048, 0.032, 0.024],
            },
            ..spec()
        };
        let clay = Clay::new(&clay_shape(&higher.shape).unwrap(), 1e-3).unwrap();
        let said = build(&spec(), 4, &told(&clay, 4, |_| true))
            .map(|_| ())
            .unwrap_err();
        assert!(said.starts_with("bricks: "), "{said}");
    }
}
