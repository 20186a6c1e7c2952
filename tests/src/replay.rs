//! What a handle wrote down, swept through fresh blocks by the clay alone, without scheme, line or clock: what a copy
//! of the clay promises is judged against it, to the last bit.

use anyhow::{Context as _, Result, ensure};
use teleclay_bilateral::{clay_shape, material, tool_shape};
use teleclay_clay::{Clay, ContactState, Motion, Pose, Sweep, Tool};
use teleclay_proto::http::Session;

use crate::recording::{Row, norm};

/// What the handle's ticks come to in blocks of their own.
#[derive(Debug)]
pub struct Replay {
    /// What is left of the last block.
    pub clay: Clay,
    /// Which one that was, counted by the server.
    pub epoch: u32,
    /// Root mean square of felt force less the clay's answer, over the greatest answer.
    pub force_nrmse: f64,
    /// Ticks that cut.
    pub ticks: usize,
}

/// The force of a copy that was stale comes back by the ramp, 50 ticks.
const RETURN_TICKS: u32 = 50;

/// Sweeps fresh blocks of the session along the way that the handle wrote down, each for as long as its copy was of
/// that one, but for where it was felt only, until the pause. Before it has a copy the server's tool follows it; at
/// home, where nobody moves yet. Whoever asks for fresh clay stands outside of it meanwhile.
///
/// # Errors
/// The recording ends without a pause, or holds what no clay can be swept with.
pub fn replay(session: &Session, rows: &[Row]) -> Result<Replay> {
    let shape = clay_shape(&session.clay.shape)?;
    let mut clay = Clay::new(&shape, session.clay.voxel_size_m)?;
    let tool = Tool::new(tool_shape(&session.tool)?);
    let material = material(&session.material)?;
    let home_m = session.tools[0].home_m;
    let place_m = |row: &Row| {
        std::array::from_fn(|axis| home_m[axis] + session.position_ratio * row.position_m[axis])
    };
    let mut contact = ContactState::default();
    let (mut squares, mut greatest_n, mut ticks) = (0.0, 0.0_f64, 0);
    let mut since_stale = u32::MAX / 2;
    let mut epoch = rows.first().map_or(0, |row| row.clay_epoch);
    let pause = rows.iter().position(|row| row.link_state == "paused");
    for pair in rows[..pause.context("it did not end with a pause")?].windows(2) {
        if pair[1].clay_epoch != epoch {
            epoch = pair[1].clay_epoch;
            clay = Clay::new(&shape, session.clay.voxel_size_m)?;
            contact = ContactState::default();
            since_stale = 0;
        }
        if pair[1].copy == "stale" {
            since_stale = 0;
            continue;
        }
        since_stale += 1;
        let [from_m, to_m]: [[f64; 3]; 2] = [place_m(&pair[0]), place_m(&pair[1])];
        let velocity: [f64; 3] = std::array::from_fn(|axis| (to_m[axis] - from_m[axis]) / 1e-3);
        let (from, to) = (Pose::quantise(from_m)?, Pose::quantise(to_m)?);
        let motion = Motion::new(from, to, velocity)?;
        let worked = clay.work(&tool, &material, &motion, &mut contact);
        let answer_n = worked.response.force_n;
        // The third axis is lifted and reflects nothing.
        let error_n = norm([
            pair[1].felt_force_n[0] - answer_n[0],
            pair[1].felt_force_n[1] - answer_n[1],
            0.0,
        ]);
        if RETURN_TICKS < since_stale {
            squares += error_n * error_n;
            greatest_n = greatest_n.max(norm([answer_n[0], answer_n[1], 0.0]));
            ticks += 1;
        }
        // What `work` cut is the sweep from place to place; a sweep again changes nothing, as cuts have no order and no
        // count.
        let again = Sweep {
            shape: *tool.shape(),
            from,
            to,
        };
        ensure!(
            clay.carve(&again) == 0,
            "a sweep that was made removes clay again"
        );
    }
    Ok(Replay {
        clay,
        epoch,
        force_nrmse: (squares / ticks as f64).sqrt() / greatest_n,
        ticks,
    })
}
