//! A replica whose hand feels another clay than its copy: the copy without what another's tool has cut by now, as far
//! as that can be foreseen.
//!
//! The replica itself runs underneath as it is, so what is sent, merged and compared is the same to the last bit. The
//! felt clay is a second field. In every tick the bricks that a forecast had touched, and those that changed in the
//! copy, are taken from the copy again, and the present forecast is cut out of them. What the tool met before that and
//! what it meets after goes through a correction limiter of the same kind and limits as the copy's own.

use std::sync::{Arc, Mutex};

use teleclay_clay::{
    BRICK_VOXELS, Blade, BladeDimensions, BrickIndex, BrickView, Clay, ContactState, Motion, Pose,
    SOLID, Sweep, ToolShape,
};
use teleclay_link::Vec3;
use teleclay_link::deadband::Signal;
use teleclay_link::motion_limiter::{MotionLimiter, Recovery, Setpoint};
use teleclay_link::replica::{
    Copy, CorrectionLimiter, CorrectionLimits, Cut, Novelty, SweepInbox, ToolSetup,
};
use teleclay_link::round_trip;
use teleclay_link::safety::capped;
use teleclay_link::scheme::replica::ReplicaHandle;
use teleclay_link::scheme::{
    ClayCopy, Controllers, Coupling, HandleController, HandlePort, SchemeContext, ToolController,
    tool_controller,
};
use teleclay_link::time::Timestamp;
use teleclay_proto::Scheme;
use teleclay_proto::frame::{HandleFrame, LoopStatus, ToolFrame};

use crate::forecast::{Forecast, Law};

/// Edge of a voxel in every block of this comparison, m.
const VOXEL_M: f64 = 1e-3;
/// Area that a tool meets before it counts as in contact, m².
const CONTACT_M2: f64 = 1e-6;

/// What the limiter of one hand did, and what forecasts came to.
#[derive(Clone, Debug, Default)]
pub(crate) struct Told {
    /// Steps of the felt force by corrections in ticks that had one, N.
    pub(crate) steps_n: Vec<f64>,
    /// Energy that corrections brought into the hand, J.
    pub(crate) injected_j: f64,
    /// Energy that the hand spent on cutting, J.
    pub(crate) earned_j: f64,
    /// How far corrections moved the felt force, N.
    pub(crate) moved_n: f64,
    /// Clay that came back because a forecast was changed, counted each time, in units of 1/255 voxel.
    pub(crate) given_back_units: u64,
    /// The block without all that was ever foreseen, right or wrong.
    pub(crate) foreseen: Option<Clay>,
    /// Hash of the felt clay, as of the last tick.
    pub(crate) felt_hash: Option<u64>,
}

/// Makes the controllers of the replica with a forecast.
pub(crate) struct Foreseeing {
    law: Law,
    told: Mutex<Vec<Arc<Mutex<Told>>>>,
}

impl Foreseeing {
    /// With this law.
    pub(crate) fn new(law: Law) -> Self {
        Self {
            law,
            told: Mutex::default(),
        }
    }

    /// What each hand has told, in the order in which they joined.
    pub(crate) fn told(&self) -> Vec<Told> {
        let told = self.told.lock().expect(ALONE);
        told.iter()
            .map(|told| told.lock().expect(ALONE).clone())
            .collect()
    }
}

const ALONE: &str = "a rig runs in one thread";

impl Controllers for Foreseeing {
    fn handle(&self, context: &SchemeContext) -> Box<dyn HandleController> {
        let told = Arc::new(Mutex::new(Told::default()));
        self.told.lock().expect(ALONE).push(Arc::clone(&told));
        Box::new(Handle::new(context, self.law, told))
    }

    fn tool(&self, context: &SchemeContext) -> Box<dyn ToolController> {
        tool_controller(Scheme::Replica, context)
    }
}

struct Handle {
    inner: ReplicaHandle,
    coupling: Coupling,
    setup: Arc<ToolSetup>,
    motion_limiter: MotionLimiter,
    gain: f64,
    status: LoopStatus,
    inbox: SweepInbox,
    law: Law,
    forecast: Forecast,
    /// The tool of the forecast.
    foreseen_shape: ToolShape,
    felt: Option<Felt>,
    /// Most by which a forecast may change the clay's force, N, where that is bounded; and then the copy again, a tick
    /// behind it.
    most_n: Option<f64>,
    plain: Option<Felt>,
    limiter: CorrectionLimiter,
    told: Arc<Mutex<Told>>,
}

/// The felt clay.
struct Felt {
    clay: Clay,
    pose: Pose,
    contact: ContactState,
    /// Bricks that the forecast of the last tick touched.
    foreseen: Vec<BrickIndex>,
    /// The copy's revision as of the last tick.
    revision: u64,
}

/// What the felt clay answers in one tick.
struct Forces {
    /// Before the copy's changes and the forecast were taken in, N.
    before: Vec3,
    /// And after, at the same pose and speed, N.
    after: Vec3,
    /// Clay that came back, in units of 1/255 voxel.
    given_back_units: u64,
}

impl Handle {
    fn new(context: &SchemeContext, law: Law, told: Arc<Mutex<Told>>) -> Self {
        let (coupling, setup) = (context.coupling.clone(), Arc::clone(&context.setup));
        let at_device = CorrectionLimits::for_range(setup.force_limit_n);
        Self {
            inner: ReplicaHandle::new(coupling.clone(), Arc::clone(&setup)),
            motion_limiter: MotionLimiter::new(setup.motion_limits),
            gain: 0.0,
            status: LoopStatus::Idle,
            inbox: SweepInbox::default(),
            law,
            forecast: Forecast::new(law),
            foreseen_shape: if law.is_narrow() {
                narrowed(setup.tool.shape(), VOXEL_M)
            } else {
                *setup.tool.shape()
            },
            felt: None,
            most_n: law
                .most_share()
                .map(|share| share * setup.force_limit_n * -coupling.force_ratio),
            plain: None,
            limiter: CorrectionLimiter::new(CorrectionLimits {
                step_n: at_device.step_n * -coupling.force_ratio,
                tank_j: if law.is_at_once() {
                    0.0
                } else {
                    at_device.tank_j * coupling.power_ratio()
                },
            }),
            coupling,
            setup,
            told,
        }
    }

    fn take_relayed(&mut self, now: Timestamp, frame: &ToolFrame) {
        self.inbox.skip_to(frame.relayed.oldest_unacknowledged);
        for record in &frame.relayed {
            if self.inbox.on_sweep(record.sequence) == Novelty::New {
                self.forecast.on_sweep(now, &record);
            }
        }
    }

    /// Velocity of the tool in this tick, just as the replica has it, m/s.
    fn velocity(&mut self, port: &HandlePort) -> Vec3 {
        let tick_s = self.setup.motion_limits.tick_s;
        let works = matches!(self.status, LoopStatus::Running | LoopStatus::Idle);
        let change = tick_s / self.setup.ramp_s;
        self.gain = (self.gain + if works { change } else { -change }).clamp(0.0, 1.0);
        let before = self.motion_limiter.at();
        let reference = port.position * self.coupling.position_ratio;
        let setpoint = Setpoint {
            reference,
            recovery: Recovery::Absolute,
            lift_m: self.setup.is_lifted.then_some(reference.z),
        };
        (self.motion_limiter.step(setpoint, self.gain) - before) / tick_s
    }

    fn is_other_in_contact(&self, now: Timestamp, copy: &Clay) -> bool {
        let (Some(at), Some(velocity)) =
            (self.forecast.newest(), self.forecast.present_velocity(now))
        else {
            return false;
        };
        CONTACT_M2 < copy.engaged_area_m2(&self.setup.tool, at, velocity.into())
    }
}

impl Felt {
    /// The copy as it is.
    fn of(copy: &Copy) -> Self {
        Self {
            clay: copy.clay().clone(),
            pose: copy.pose(),
            contact: ContactState::default(),
            foreseen: Vec::new(),
            revision: copy.clay().revision(),
        }
    }

    /// The copy's tool went on, and cut; some of the copy may have changed besides. Nothing for a motion that is none.
    fn tick(
        &mut self,
        copy: &Copy,
        setup: &ToolSetup,
        velocity: Vec3,
        cuts: &[Sweep],
    ) -> Option<Forces> {
        let from = std::mem::replace(&mut self.pose, copy.pose());
        let motion = Motion::new(from, copy.pose(), velocity.into()).ok()?;
        let contact = self.contact;
        let worked = self
            .clay
            .work(&setup.tool, &setup.material, &motion, &mut self.contact);
        let given_back_units = self.follow(copy.clay(), cuts);
        self.contact = contact;
        let after = self
            .clay
            .feel(&setup.tool, &setup.material, &motion, &mut self.contact);
        Some(Forces {
            before: worked.response.force_n.into(),
            after: after.force_n.into(),
            given_back_units,
        })
    }

    /// Takes the copy's bricks where they may differ, and cuts the forecast out of them. Tells what came back, in units
    /// of 1/255 voxel.
    fn follow(&mut self, copy: &Clay, cuts: &[Sweep]) -> u64 {
        let foreseen = std::mem::take(&mut self.foreseen);
        let before: Vec<_> = foreseen
            .iter()
            .map(|&brick| units(self.clay.brick(brick)))
            .collect();
        let changed = copy.changed_after(self.revision);
        for brick in foreseen.iter().copied().chain(changed) {
            self.clay
                .replace_brick(brick, copy.brick(brick))
                .expect("the copy's bricks fit the grid of its own clone");
        }
        self.revision = copy.revision();
        let revision = self.clay.revision();
        for cut in cuts {
            self.clay.carve(cut);
        }
        if !cuts.is_empty() {
            self.foreseen.extend(self.clay.changed_after(revision));
        }
        let came_back = foreseen.iter().zip(&before).map(|(&brick, before)| {
            let now = units(self.clay.brick(brick));
            let more = before.iter().zip(&*now);
            more.map(|(before, now)| u64::from(now.saturating_sub(*before)))
                .sum::<u64>()
        });
        came_back.sum()
    }
}

impl HandleController for Handle {
    fn on_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        self.inner.on_frame(now, frame);
        self.status = frame.status;
        let header = &frame.header;
        if let Some(round_trip) = round_trip::of_exchange(now, header.echo_ns, header.echo_hold_ns)
        {
            self.forecast.on_round_trip(round_trip);
        }
        self.take_relayed(now, frame);
    }

    fn on_late_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        self.inner.on_late_frame(now, frame);
        self.take_relayed(now, frame);
    }

    fn on_stale_frame(&mut self, now: Timestamp, frame: &ToolFrame) {
        self.inner.on_stale_frame(now, frame);
        self.take_relayed(now, frame);
    }

    fn on_news_again(&mut self) {
        self.inner.on_news_again();
    }

    fn on_another_peer(&mut self) {
        self.inner.on_another_peer();
        self.inbox.restart();
    }

    fn reaction(&mut self, now: Timestamp, port: &HandlePort) -> Vec3 {
        let without = self.inner.reaction(now, port);
        let velocity = self.velocity(port);
        let Some(copy) = self.inner.copy() else {
            return without;
        };
        // Asked for only where it counts.
        let is_in_contact =
            self.law == Law::InContact && self.is_other_in_contact(now, copy.clay());
        let cuts = self.forecast.cuts(now, is_in_contact);
        let is_quiet = copy.hash().is_some() && cuts.is_empty();
        let setup = &*self.setup;
        let sweep = |cut: &Cut| Sweep {
            shape: self.foreseen_shape,
            from: cut.from,
            to: cut.to,
        };
        let near: Vec<Sweep> = cuts
            .iter()
            .filter(|cut| touches(setup, cut, copy.pose(), copy.clay().grid().voxel_size_m()))
            .map(sweep)
            .collect();
        let felt = self.felt.get_or_insert_with(|| Felt::of(copy));
        let Some(mut forces) = felt.tick(copy, setup, velocity, &near) else {
            return without;
        };
        if let Some(most_n) = self.most_n {
            let plain = self.plain.get_or_insert_with(|| Felt::of(copy));
            let Some(known) = plain.tick(copy, setup, velocity, &[]) else {
                return without;
            };
            forces.before = known.before + capped(forces.before - known.before, most_n);
            forces.after = known.after + capped(forces.after - known.after, most_n);
        }
        let after = forces.after;
        self.limiter
            .on_correction(reflected(setup, forces.before), reflected(setup, after));
        let tick_s = setup.motion_limits.tick_s;
        let force = self.limiter.step(after, reflected(setup, velocity), tick_s);
        let mut told = self.told.lock().expect(ALONE);
        if 0.0 < self.limiter.step_n() {
            told.steps_n.push(self.limiter.step_n());
        }
        told.injected_j = self.limiter.injected_j();
        told.earned_j = self.limiter.earned_j();
        told.moved_n = self.limiter.moved_n();
        told.given_back_units += forces.given_back_units;
        let foreseen = told.foreseen.get_or_insert_with(|| copy.clay().clone());
        // Every tenth tick of so slow a motion tells as much as every one.
        if (now.as_nanos() / 1_000_000).is_multiple_of(10) {
            for cut in &cuts {
                foreseen.carve(&sweep(cut));
            }
        }
        if is_quiet {
            told.felt_hash = Some(felt.clay.hash());
        }
        self.coupling.felt(force)
    }

    fn needs_frames(&self) -> bool {
        self.inner.needs_frames()
    }

    fn fill(&mut self, frame: &mut HandleFrame) {
        self.inner.fill(frame);
    }

    fn has_urgent_news(&self) -> bool {
        self.inner.has_urgent_news()
    }

    fn on_sent(&mut self, frame: &HandleFrame) {
        self.inner.on_sent(frame);
    }

    fn signal(&self, frame: &HandleFrame) -> Option<Signal> {
        self.inner.signal(frame)
    }

    fn clay_copy(&self) -> Option<&dyn ClayCopy> {
        self.inner.clay_copy()
    }

    fn clay_copy_mut(&mut self) -> Option<&mut dyn ClayCopy> {
        self.inner.clay_copy_mut()
    }
}

fn units(view: BrickView<'_>) -> Box<[u8; BRICK_VOXELS]> {
    Box::new(match view {
        BrickView::Empty => [0; BRICK_VOXELS],
        BrickView::Full => [SOLID; BRICK_VOXELS],
        BrickView::Voxels(voxels) => *voxels,
    })
}

/// The tool without an edge of so much all around; as it is, where nothing would be left.
fn narrowed(shape: &ToolShape, by_m: f64) -> ToolShape {
    match shape {
        ToolShape::Ball(ball) => ToolShape::ball(ball.radius_m() - by_m).unwrap_or(*shape),
        ToolShape::Blade(blade) => Blade::new(BladeDimensions {
            width_m: blade.width_m() - 2.0 * by_m,
            height_m: blade.height_m(),
            thickness_m: blade.thickness_m(),
        })
        .map_or(*shape, ToolShape::Blade),
        // No motion here has another one.
        ToolShape::Cylinder(_) | ToolShape::Loop(_) => *shape,
    }
}

/// Whether a cut can change what a tool at `pose` feels, as the copy has it for corrections.
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

/// The part of a force, or of a motion, that reaches the hand.
fn reflected(setup: &ToolSetup, vector: Vec3) -> Vec3 {
    let z = if setup.is_lifted { 0.0 } else { vector.z };
    Vec3::new(vector.x, vector.y, z)
}

/// How much more clay there is in `more` than in `less`, voxel by voxel, in units of 1/255 voxel.
pub(crate) fn more_units(less: &Clay, more: &Clay) -> u64 {
    let [x, y, z] = more.grid().voxels().map(i32::from);
    let mut units = 0;
    for z in 0..z {
        for y in 0..y {
            for x in 0..x {
                let (less, more) = (less.occupancy([x, y, z]), more.occupancy([x, y, z]));
                units += u64::from(more.saturating_sub(less));
            }
        }
    }
    units
}
