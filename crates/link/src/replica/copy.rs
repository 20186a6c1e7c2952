//! The copy of the clay at the handle's side: a tool that cuts it and feels it at once, and the corrections that come
//! later.
//!
//! A tick goes in this order: pieces of a snapshot that is being brought up to date, the tool's own motion, corrections
//! near the tool. What the tool met before the corrections and what it meets after them differ at the same pose and
//! speed; that difference goes through the [`CorrectionLimiter`].

use teleclay_clay::{Clay, ContactState, Material, Motion, Pose, Sweep, Tool};

use super::correction_limiter::{CorrectionLimiter, CorrectionLimits};
use crate::Vec3;
use crate::motion_limiter::MotionLimits;

/// Corrections that wait for their turn at most. What does not fit is not noted as come, so the sender repeats it.
pub const CORRECTIONS_WAITING: usize = 1024;
/// Corrections carried out in one tick at most, about a third of a millisecond of work.
const CORRECTIONS_A_TICK: usize = 32;

/// Straight way of a tool through the clay, between two lattice positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Where the tool was.
    pub from: Pose,
    /// Where it came to.
    pub to: Pose,
}

/// Where a tool works, with what, and in what: what both sides have to agree on before their copies of the clay can be
/// one.
#[derive(Clone, Debug)]
pub struct ToolSetup {
    /// Image of the handle's home in the clay's frame, m.
    pub home: Vec3,
    /// Bounds of the tool's motion.
    pub motion_limits: MotionLimits,
    /// Whether the third axis is only lifted.
    pub is_lifted: bool,
    /// The tool.
    pub tool: Tool,
    /// What the clay resists with.
    pub material: Material,
    /// Greatest force of the device, N.
    pub force_limit_n: f64,
    /// In this time forces and motion ramp to rest and back, s.
    pub ramp_s: f64,
}

impl ToolSetup {
    /// The part of a force, or of a motion that it does work on, that reaches the hand.
    fn felt(&self, vector: Vec3) -> Vec3 {
        let z = if self.is_lifted { 0.0 } else { vector.z };
        Vec3::new(vector.x, vector.y, z)
    }

    /// Whether a sweep is one that this tool can have made in a tick: within reach, and no faster than allowed. Both to
    /// a lattice step, for the lattice rounds.
    ///
    /// # Errors
    /// Which of the two it is not.
    pub fn check(&self, cut: &Cut) -> Result<(), Impossible> {
        const STEP_M: f64 = 1.0 / teleclay_clay::STEPS_PER_METRE;
        let [least, greatest] = self.motion_limits.reach;
        for pose in [cut.from, cut.to] {
            let at = Vec3::from(pose.position_m()) - self.home;
            let is_within = (0..3).all(|axis| {
                least[axis] - STEP_M <= at[axis] && at[axis] <= greatest[axis] + STEP_M
            });
            if !is_within {
                return Err(Impossible::OutOfReach);
            }
        }
        let way = Vec3::from(cut.to.displacement_from_m(cut.from)).norm();
        if self.motion_limits.speed_m_s * self.motion_limits.tick_s + 2.0 * STEP_M < way {
            return Err(Impossible::TooFast);
        }
        Ok(())
    }
}

/// Why a sweep cannot have been made by this tool in one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Impossible {
    /// It leaves the tool's reach.
    OutOfReach,
    /// It is longer than the fastest tick.
    TooFast,
}

/// Whether the tool cuts what it meets, or only feels it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edge {
    /// It cuts.
    Cutting,
    /// It is held back from cutting: the clay is felt and stays.
    Blunt,
}

/// What a tick of the copy gave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worked {
    /// Force of the clay on the tool after the correction limiter, N.
    pub force: Vec3,
    /// What the tool cut or passed through, if it moved and cuts.
    pub cut: Option<Cut>,
    /// Whether that changed the clay.
    pub has_changed_clay: bool,
}

/// The copy.
pub struct Copy {
    clay: Box<Clay>,
    epoch: u32,
    contact: ContactState,
    pose: Pose,
    /// Where it was a tick before.
    from: Pose,
    /// The clay's answer in the last tick, before the correction limiter, N.
    answer: Vec3,
    limiter: CorrectionLimiter,
    corrections: Vec<Cut>,
    /// The clay was exchanged for another snapshot since the last tick.
    is_fresh_snapshot: bool,
    hash: Option<u64>,
}

impl Copy {
    /// A copy of the block of `epoch`, with the tool at a pose at rest. `limits` are at the tool, where the ratios of
    /// the coupling have been applied; `corrections` is [room for corrections](Self::room_for_corrections).
    pub fn new(
        clay: Box<Clay>,
        epoch: u32,
        pose: Pose,
        limits: CorrectionLimits,
        mut corrections: Vec<Cut>,
    ) -> Self {
        corrections.clear();
        Self {
            clay,
            epoch,
            contact: ContactState::default(),
            pose,
            from: pose,
            answer: Vec3::zeros(),
            limiter: CorrectionLimiter::new(limits),
            corrections,
            is_fresh_snapshot: false,
            hash: None,
        }
    }

    /// Which block this is a copy of.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// The clay.
    pub fn clay(&self) -> &Clay {
        &self.clay
    }

    /// The limiter of corrections.
    pub fn limiter(&self) -> &CorrectionLimiter {
        &self.limiter
    }

    /// Where the tool is.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// How far the tool moved in the last tick, m.
    pub fn way(&self) -> Vec3 {
        self.pose.displacement_from_m(self.from).into()
    }

    /// The clay's answer in the last tick before the correction limiter, N.
    pub fn answer(&self) -> Vec3 {
        self.answer
    }

    /// Hash of the clay, once it is known again after a change.
    pub fn hash(&self) -> Option<u64> {
        self.hash
    }

    /// Exchanges the clay for another snapshot of the same block; gives back the old one.
    pub fn exchange(&mut self, clay: Box<Clay>) -> Box<Clay> {
        self.hash = None;
        self.is_fresh_snapshot = true;
        std::mem::replace(&mut self.clay, clay)
    }

    /// What it is a copy of counts as this block from now on: the clay there was exchanged.
    pub fn follow(&mut self, epoch: u32) {
        self.epoch = epoch;
        self.hash = None;
    }

    /// Whether a further correction may wait.
    pub fn has_room(&self) -> bool {
        self.corrections.len() < CORRECTIONS_WAITING
    }

    /// Somebody else's cut, to be carried out in one of the next ticks. Look for [room](Self::has_room) first: what
    /// finds none is lost, and the hashes will tell.
    pub fn correct(&mut self, cut: Cut) {
        if self.has_room() {
            self.corrections.push(cut);
        }
    }

    /// Gives up the copy: its clay, and its room for corrections, which the next one may use.
    pub fn into_parts(self) -> (Box<Clay>, Vec<Cut>) {
        (self.clay, self.corrections)
    }

    /// What a copy keeps corrections in that wait. Made beforehand, since a copy begins and ends on a tick.
    pub fn room_for_corrections() -> Vec<Cut> {
        Vec::with_capacity(CORRECTIONS_WAITING)
    }

    /// Whether corrections wait.
    pub fn has_corrections(&self) -> bool {
        !self.corrections.is_empty()
    }

    /// Repeats a cut that the snapshot may not have yet. The force follows in the next [`Copy::step`].
    pub fn carve(&mut self, setup: &ToolSetup, cut: Cut) {
        let removed = self.clay.carve(&sweep(setup, cut));
        if 0 < removed {
            self.hash = None;
            self.is_fresh_snapshot = true;
        }
    }

    /// One tick: the tool goes to `to` and has `velocity`, m/s.
    pub fn step(&mut self, setup: &ToolSetup, to: Pose, velocity: Vec3, edge: Edge) -> Worked {
        let from = std::mem::replace(&mut self.pose, to);
        self.from = from;
        let held = Worked {
            force: Vec3::zeros(),
            cut: None,
            has_changed_clay: false,
        };
        // The motion limiter keeps velocities far below what the clay's law takes.
        let Ok(motion) = Motion::new(from, to, velocity.into()) else {
            return held;
        };
        let before = self.contact;
        let (answer, removed) = match edge {
            Edge::Cutting => {
                let worked =
                    self.clay
                        .work(&setup.tool, &setup.material, &motion, &mut self.contact);
                (worked.response, worked.moved_units)
            }
            Edge::Blunt => {
                let felt = self
                    .clay
                    .feel(&setup.tool, &setup.material, &motion, &mut self.contact);
                (felt, 0)
            }
        };
        let mut force = Vec3::from(answer.force_n);
        if std::mem::take(&mut self.is_fresh_snapshot) {
            // The old snapshot is gone: what it answered a tick ago stands for what it would answer now.
            self.limiter
                .on_correction(setup.felt(self.answer), setup.felt(force));
        }
        let (is_near, is_changed) = self.carry_out_corrections(setup, &motion);
        self.clay.commit_ahead();
        if is_near {
            self.contact = before;
            let felt = self
                .clay
                .feel(&setup.tool, &setup.material, &motion, &mut self.contact);
            let after = Vec3::from(felt.force_n);
            self.limiter
                .on_correction(setup.felt(force), setup.felt(after));
            force = after;
        }
        if 0 < removed || is_changed {
            self.hash = None;
        }
        self.refresh_hash();
        self.answer = force;
        Worked {
            force: self
                .limiter
                .step(force, setup.felt(velocity), setup.motion_limits.tick_s),
            // A tool that rests cuts as well, where clay stands in its place.
            cut: (edge == Edge::Cutting && (from != to || 0 < removed)).then_some(Cut { from, to }),
            has_changed_clay: 0 < removed,
        }
    }

    /// Carries out some of the corrections that wait. Says whether one of them changed clay near the tool, and whether
    /// any changed any.
    fn carry_out_corrections(&mut self, setup: &ToolSetup, motion: &Motion) -> (bool, bool) {
        let (mut is_near, mut is_changed) = (false, false);
        let now = self.corrections.len().min(CORRECTIONS_A_TICK);
        for cut in self.corrections.drain(..now) {
            if 0 < self.clay.carve(&sweep(setup, cut)) {
                is_changed = true;
                is_near |= touches(setup, &cut, motion.to(), self.clay.grid().voxel_size_m());
            }
        }
        (is_near, is_changed)
    }

    fn refresh_hash(&mut self) {
        /// Half a microsecond each.
        const BRICKS_A_TICK: usize = 2;
        if self.hash.is_none() && self.clay.refresh_hashes(BRICKS_A_TICK) == 0 {
            self.hash = Some(self.clay.hash());
        }
    }
}

fn sweep(setup: &ToolSetup, cut: Cut) -> Sweep {
    Sweep {
        shape: *setup.tool.shape(),
        from: cut.from,
        to: cut.to,
    }
}

/// Whether a cut can have changed what a tool at `pose` feels: the boxes around the two, with the ramp of a cut's edge
/// and what a tool feels ahead of itself, overlap.
fn touches(setup: &ToolSetup, cut: &Cut, pose: Pose, voxel_size_m: f64) -> bool {
    let extents_m = setup.tool.shape().extents_m();
    let margin_m = (teleclay_clay::LOOK_AHEAD_VOXELS + 3.0) * voxel_size_m;
    let (from, to, at) = (
        cut.from.position_m(),
        cut.to.position_m(),
        pose.position_m(),
    );
    (0..3).all(|axis| {
        let reach_m = extents_m[axis] + margin_m;
        from[axis].min(to[axis]) - reach_m <= at[axis]
            && at[axis] <= from[axis].max(to[axis]) + reach_m
    })
}
