//! Rows that need no network: clay, the tool-side step, virtual time.

use std::hint::black_box;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use teleclay_bilateral::{HandleSide, Lease, Permission, ToolSide};
use teleclay_clay::{
    Ball, Clay, ContactState, Material, Motion, Operation, Pose, Shape, Tool, ToolShape,
};
use teleclay_link::conditioner::Impairment;
use teleclay_link::time::Timestamp;
use teleclay_operator::{Axes, Intent, Reach, SimulatedHandle};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Scheme, ToolDescription};
use teleclay_session::Lines;
use teleclay_sim::rig::{Rig, Setup};

use crate::row::{Row, quantile};

const VOXEL_M: f64 = 5e-4;
/// 12.8 voxels.
const BALL_M: f64 = 0.0064;
const TICK_S: f64 = 1e-3;

/// Contact, cut and force of one tick in a 256^3 block, the ball half sunk in and moving a quarter of a voxel; and that
/// it costs the same in a larger grid.
pub(crate) fn clay() -> anyhow::Result<Vec<Row>> {
    let mut here = tick_times(256)?;
    let mut larger = tick_times(512)?;
    let (p50, p99) = (quantile(&mut here, 0.5), quantile(&mut here, 0.99));
    Ok(vec![
        Row::new("clay_tick_p50_s", "s", 5e-6, p50),
        Row::new("clay_tick_p99_s", "s", 20e-6, p99),
        // "Does not grow" with room for the caches' part in it.
        Row::new(
            "clay_tick_512_p50_s",
            "s",
            1.5 * p50,
            quantile(&mut larger, 0.5),
        )
        .beside(p50),
    ])
}

fn tick_times(voxels: u32) -> anyhow::Result<Vec<u64>> {
    let edge = f64::from(voxels) * VOXEL_M;
    let mut clay = Clay::new(&Shape::Block { size_m: [edge; 3] }, VOXEL_M)?;
    let tool = Tool::new(ToolShape::Ball(Ball::new(BALL_M)?));
    let (material, mut contact) = (Material::default(), ContactState::default());
    let mut times = Vec::new();
    let step = 0.25 * VOXEL_M;
    let lanes = 5;
    for lane in 0..lanes {
        let y = edge * (0.2 + 0.6 * f64::from(lane) / f64::from(lanes));
        let z = edge - 0.5 * BALL_M * f64::from(lane + 1) / f64::from(lanes);
        let mut x = 0.1 * edge;
        while x < 0.9 * edge {
            let from = Pose::quantise([x, y, z])?;
            let to = Pose::quantise([x + step, y, z])?;
            let motion = Motion::new(from, to, [step / TICK_S, 0.0, 0.0])?;
            let started = Instant::now();
            black_box(clay.work(&tool, &material, black_box(&motion), &mut contact));
            times.push(started.elapsed().as_nanos() as u64);
            x += step;
        }
    }
    Ok(times)
}

fn parameters() -> LoopParameters {
    LoopParameters {
        scheme: Scheme::ForceExchange,
        home_m: [0.064, 0.032, 0.064 + BALL_M],
        tool: ToolDescription::Ball { radius_m: BALL_M },
        ..LoopParameters::default()
    }
}

fn block() -> anyhow::Result<Clay> {
    Ok(Clay::new(
        &Shape::Block {
            size_m: [0.128, 0.064, 0.064],
        },
        VOXEL_M,
    )?)
}

fn cutting() -> anyhow::Result<Intent> {
    Ok(Intent::cutting(Reach {
        x_m: 0.045,
        y_m: 0.018,
        depth_m: 0.02,
    })?)
}

/// Handle side and tool side in one process, cutting.
pub(crate) struct Working {
    handle: HandleSide,
    tool: ToolSide,
    device: SimulatedHandle,
    clay: Clay,
    material: Material,
    ticks: u64,
}

impl Working {
    pub(crate) fn new() -> anyhow::Result<Self> {
        let parameters = parameters();
        Ok(Self {
            handle: HandleSide::new(
                &parameters,
                Lease {
                    number: 1,
                    ownership_epoch: 0,
                },
            )?,
            tool: ToolSide::new(&parameters, 1)?,
            device: SimulatedHandle::new(Axes::Two, TICK_S, cutting()?)?,
            clay: block()?,
            material: Material::default(),
            ticks: 0,
        })
    }

    /// One tick of both sides; returns the time that the tool side took, ns.
    pub(crate) fn timed_tick(&mut self) -> u64 {
        self.ticks += 1;
        let now = Timestamp::from_nanos(self.ticks * 1_000_000);
        let step = self.handle.step(now, &self.device.sample());
        self.device.command(step.command_m);
        let started = Instant::now();
        self.tool.handle_frame(now, self.handle.frame());
        black_box(self.tool.step(
            now,
            &mut self.clay,
            &self.material,
            Operation::Cut,
            Permission::Work,
        ));
        let took = started.elapsed().as_nanos() as u64;
        self.handle.handle_frame(now, self.tool.frame());
        took
    }

    pub(crate) fn tick(&mut self) {
        self.timed_tick();
    }
}

/// The whole tool-side step while cutting, and the sessions a core could step in a tick at that rate.
pub(crate) fn tool_side() -> anyhow::Result<Vec<Row>> {
    let mut working = Working::new()?;
    let mut times: Vec<u64> = (0..40_000).map(|_| working.timed_tick()).collect();
    anyhow::ensure!(0 < working.clay.removed_units(), "the tool cut nothing");
    let mean = times.iter().sum::<u64>() as f64 * 1e-9 / times.len() as f64;
    let p50 = quantile(&mut times, 0.5);
    Ok(vec![
        Row::new("tool_side_step_p50_s", "s", 10e-6, p50),
        Row::new(
            "tool_side_step_p99_s",
            "s",
            50e-6,
            quantile(&mut times, 0.99),
        ),
        Row::new("sessions_per_core", "sessions", 60.0, TICK_S / mean),
    ])
}

/// The whole rig, cutting across 10 ms each way.
pub(crate) fn virtual_time() -> anyhow::Result<Vec<Row>> {
    let line = Impairment {
        delay: Duration::from_millis(10),
        ..Impairment::default()
    };
    let mut rig = Rig::new(Setup {
        parameters: parameters(),
        clay: block()?,
        intent: cutting()?,
        lines: Lines {
            up: line,
            up_seed: 1,
            down: line,
            down_seed: 2,
        },
    })
    .context("the rig")?;
    let virtual_time = Duration::from_secs(60);
    let started = Instant::now();
    rig.run_for(virtual_time);
    let ratio = virtual_time.as_secs_f64() / started.elapsed().as_secs_f64();
    anyhow::ensure!(
        0 < rig.session().clay().removed_units(),
        "the rig cut nothing"
    );
    Ok(vec![Row::new(
        "rig_times_real_time",
        "x real time",
        200.0,
        ratio,
    )])
}
