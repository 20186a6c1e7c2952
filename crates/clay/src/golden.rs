//! One number that depends on every bit of a fixed piece of work, to compare machines by.

use crate::clay::Clay;
use crate::engage::Tool;
use crate::hash;
use crate::law::{Coefficients, ContactState, Material, Motion};
use crate::mesh_tool::MeshTool;
use crate::operation::Operation;
use crate::pose::Pose;
use crate::shape::{Shape, SteppedBlock};
use crate::sweep::Sweep;
use crate::tool::{Blade, BladeDimensions, Cylinder, ToolShape, WireLoop};

/// What [`digest`] must return on every machine.
pub const DIGEST: u64 = 0xd8360f13847396f8;
/// What [`rods`] must return on every machine.
pub const RODS: u64 = 0x3f93beac72aca6c4;

/// What [`mesh`] must return on every machine.
pub const MESH: u64 = 0x55a9f06b64eb9cb2;
/// What [`operations`] must return on every machine.
pub const OPERATIONS: u64 = 0x3cbdc7d98066e6d9;

/// Cuts, feels and hashes by a fixed plan: strokes of a ball and of a blade, short and long, along the grid and across
/// it, starting where the last one ended and out of nowhere, inside the clay and past it. The bits of every force and
/// every hash go into the digest.
///
/// # Panics
/// Never: the plan's numbers are valid.
#[must_use]
pub fn digest() -> u64 {
    let blade = BladeDimensions {
        width_m: 0.007,
        height_m: 0.019,
        thickness_m: 0.0023,
    };
    digest_of([
        ToolShape::ball(0.0061).expect("radius is in range"),
        ToolShape::Blade(Blade::new(blade).expect("dimensions are in range")),
    ])
}

/// The same by a cylinder and a loop.
///
/// # Panics
/// Never: the plan's numbers are valid.
#[must_use]
pub fn rods() -> u64 {
    digest_of([
        ToolShape::Cylinder(Cylinder::new(0.0053, 0.017).expect("lengths are in range")),
        ToolShape::Loop(WireLoop::new(0.0072, 0.0024).expect("lengths are in range")),
    ])
}

/// The same of a mesh: what is baked of it, and a stroke.
///
/// # Panics
/// Never: the mesh is closed.
#[must_use]
pub fn mesh() -> u64 {
    // A wedge, its edge forward, standing on its position.
    let vertices_m = [
        [0.0071, 0.0, 0.0003],
        [0.0071, 0.0, 0.0121],
        [-0.0043, -0.0052, 0.0],
        [-0.0043, -0.0052, 0.0117],
        [-0.0043, 0.0061, 0.0],
        [-0.0043, 0.0061, 0.0131],
    ];
    let triangles = [
        [0, 4, 1],
        [1, 4, 5],
        [0, 1, 2],
        [1, 3, 2],
        [2, 3, 4],
        [3, 5, 4],
        [0, 2, 4],
        [1, 5, 3],
    ];
    let tool = MeshTool::new(&vertices_m, &triangles).expect("it is closed");
    let block = Shape::Block {
        size_m: [0.048, 0.032, 0.024],
    };
    let mut clay = Clay::new(&block, 1e-3).expect("it fits");
    let (material, mut contact) = (Material::default(), ContactState::default());
    let mut digest = hash::fold(0, tool.digest());
    for tick in 0..60 {
        let at = |tick: i32| {
            Pose::from_steps([9_000 * tick, 260_000 + 900 * tick, 210_000 - 700 * tick])
        };
        let velocity_m_s = [9.0, 0.9, -0.7].map(|k_steps| k_steps * 1e6 / 16_777_216.0);
        let motion = Motion::new(at(tick), at(tick + 1), velocity_m_s).expect("the tool is slow");
        let worked = clay.work_mesh(&tool, &material, &motion, &mut contact);
        for force_n in worked.response.force_n {
            digest = hash::fold(digest, force_n.to_bits());
        }
    }
    hash::fold(digest, clay.hash())
}

/// Clay that is cut, added and smoothed in turns by every kind of tool.
///
/// # Panics
/// Never: the plan's numbers are valid.
#[must_use]
pub fn operations() -> u64 {
    let block = Shape::Block {
        size_m: [0.048, 0.040, 0.036],
    };
    let mut clay = Clay::new(&block, 1e-3).expect("it fits");
    let tools = [
        ToolShape::ball(0.0057).expect("radius is in range"),
        ToolShape::paper_blade(),
        ToolShape::Cylinder(Cylinder::new(0.0043, 0.013).expect("lengths are in range")),
        ToolShape::Loop(WireLoop::new(0.0062, 0.0027).expect("lengths are in range")),
    ]
    .map(Tool::new);
    let material = Material::default();
    let mut plan = Plan(0x736d_6f6f_7468_6564);
    let mut digest = 0;
    for stroke in 0..36 {
        let operation = [Operation::Cut, Operation::Add, Operation::Smooth][stroke % 3];
        let tool = &tools[stroke / 3 % tools.len()];
        let mut contact = ContactState::default();
        let mut at = plan.steps_within([0.046, 0.038, 0.034]);
        let step = plan.steps_within([6e-4; 3]).map(|step| step - 5_000);
        for _ in 0..16 {
            let from = Pose::from_steps(at);
            at = std::array::from_fn(|axis| at[axis] + step[axis]);
            let velocity_m_s = step.map(|step| f64::from(step) * 1e3 / 16_777_216.0);
            let motion =
                Motion::new(from, Pose::from_steps(at), velocity_m_s).expect("the tool is slow");
            let worked = clay.work_as(operation, tool, &material, &motion, &mut contact);
            digest = hash::fold(digest, worked.moved_units);
            for force_n in worked.response.force_n {
                digest = hash::fold(digest, force_n.to_bits());
            }
        }
        digest = hash::fold(digest, clay.hash());
    }
    digest
}

fn digest_of(shapes: [ToolShape; 2]) -> u64 {
    let mut clay = Clay::new(&Shape::Stepped(SteppedBlock::paper()), 1e-3)
        .expect("the paper's block fits a grid of millimetres");
    let material = Material::new(Coefficients {
        viscosity_pa_s_per_m: 2e5,
        yield_stress_pa: 3e3,
        stiffness_pa: 4e5,
    })
    .expect("coefficients are in range");
    let tools = shapes.map(Tool::new);
    let mut plan = Plan(0x7465_6C65_636C_6179);
    let mut digest = hash::fold(0, clay.hash());
    for stroke in 0..24 {
        let tool = &tools[stroke % 2];
        let mut contact = ContactState::default();
        let mut at = plan.steps_within([0.125, 0.070, 0.045]);
        let velocity_m_s = plan
            .steps_within([0.4, 0.4, 0.2])
            .map(|steps| f64::from(steps) / 16_777_216.0 - 0.1);
        for _ in 0..40 {
            let from = Pose::from_steps(at);
            at = std::array::from_fn(|axis| at[axis] + (velocity_m_s[axis] * 16_777.216) as i32);
            let motion =
                Motion::new(from, Pose::from_steps(at), velocity_m_s).expect("the tool is slow");
            let worked = clay.work(tool, &material, &motion, &mut contact);
            for force_n in worked.response.force_n {
                digest = hash::fold(digest, force_n.to_bits());
            }
        }
        let sweep = Sweep {
            shape: *tool.shape(),
            from: Pose::from_steps(at),
            to: Pose::from_steps(plan.steps_within([0.125, 0.070, 0.045])),
        };
        clay.carve(&sweep);
        digest = hash::fold(digest, clay.hash());
    }
    digest
}

/// A fixed sequence of numbers, by Knuth's linear congruential generator for 64 bits.
struct Plan(u64);

impl Plan {
    fn steps_within(&mut self, size_m: [f64; 3]) -> [i32; 3] {
        size_m.map(|size_m| {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let share = (self.0 >> 33) as f64 / 2_147_483_648.0;
            (share * size_m * 16_777_216.0) as i32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_gets_the_same_bits_as_every_other() {
        assert_eq!(digest(), DIGEST, "got {:#018x}", digest());
        assert_eq!(rods(), RODS, "got {:#018x}", rods());
        assert_eq!(mesh(), MESH, "got {:#018x}", mesh());
        assert_eq!(operations(), OPERATIONS, "got {:#018x}", operations());
    }
}
