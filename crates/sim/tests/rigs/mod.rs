//! Rigs that several tests share.
#![allow(dead_code, reason = "each test uses a part")]

use std::time::Duration;

use teleclay_clay::{Clay, Shape};
use teleclay_link::conditioner::{Bursts, Impairment, Outages};
use teleclay_operator::{Intent, Reach};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Material, Scheme, ToolDescription};
use teleclay_session::Lines;
use teleclay_sim::rig::{Rig, Setup};

pub(crate) const TICK: Duration = Duration::from_millis(1);
pub(crate) const TICK_S: f64 = 1e-3;

/// Room of the cutting intent over the default block.
pub(crate) const REACH: Reach = Reach {
    x_m: 0.045,
    y_m: 0.018,
    depth_m: 0.020,
};

pub(crate) fn viscous(pa_s_per_m: f64) -> Material {
    material(pa_s_per_m, 0.0, 0.0)
}

pub(crate) fn material(
    viscosity_pa_s_per_m: f64,
    yield_stress_pa: f64,
    stiffness_pa: f64,
) -> Material {
    Material {
        viscosity_pa_s_per_m,
        yield_stress_pa,
        stiffness_pa,
    }
}

/// A ball over the middle of a block, its lowest point on the surface.
pub(crate) fn carving(
    parameters: LoopParameters,
    intent: Intent,
    material: Material,
    lines: Lines,
) -> Rig {
    let radius_m = 0.0064;
    Rig::new(Setup {
        parameters: LoopParameters {
            home_m: [0.064, 0.032, 0.064 + radius_m],
            tool: ToolDescription::Ball { radius_m },
            material,
            ..parameters
        },
        clay: Clay::new(
            &Shape::Block {
                size_m: [0.128, 0.064, 0.064],
            },
            1e-3,
        )
        .unwrap(),
        intent,
        lines,
    })
    .unwrap()
}

/// The blade of the cutting experiment wholly inside a block, 30 mm of it below the surface: 3 cm² of clay on either
/// side.
pub(crate) fn embedded(
    parameters: LoopParameters,
    intent: Intent,
    material: Material,
    lines: Lines,
) -> Rig {
    Rig::new(Setup {
        parameters: LoopParameters {
            home_m: [0.064, 0.032, 0.034],
            reach_m: [[-0.1, -0.1, -0.1], [0.3, 0.2, 0.2]],
            material,
            ..parameters
        },
        clay: Clay::new(
            &Shape::Block {
                size_m: [0.128, 0.064, 0.064],
            },
            1e-3,
        )
        .unwrap(),
        intent,
        lines,
    })
    .unwrap()
}

pub(crate) fn running(scheme: Scheme) -> LoopParameters {
    LoopParameters {
        scheme,
        ..LoopParameters::default()
    }
}

pub(crate) fn cutting() -> Intent {
    Intent::cutting(REACH).unwrap()
}

/// A hand that shakes: 3 Hz, hard enough to reverse through the clay.
pub(crate) fn shaking() -> Intent {
    Intent::sinusoid([4.0, 2.0, 0.0], 3.0).unwrap()
}

pub(crate) fn both_ways(line: Impairment, seed: u64) -> Lines {
    Lines {
        up: line,
        up_seed: seed,
        down: line,
        down_seed: seed + 1000,
    }
}

pub(crate) fn line(delay_ms: u32, jitter_ratio: f64, loss: f64) -> Impairment {
    let delay = TICK * delay_ms;
    Impairment {
        delay,
        jitter: delay.mul_f64(jitter_ratio),
        loss,
        ..Impairment::default()
    }
}

/// Runs of ten lost frames, an eleventh of all.
pub(crate) const BURSTS: Bursts = Bursts {
    enter: 0.01,
    leave: 0.1,
    loss: 1.0,
};

/// 200 ms without a line, every three seconds.
pub(crate) const OUTAGES: Outages = Outages {
    every: Duration::from_secs(3),
    length: Duration::from_millis(200),
};

pub(crate) fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

pub(crate) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    norm(std::array::from_fn(|axis| a[axis] - b[axis]))
}
