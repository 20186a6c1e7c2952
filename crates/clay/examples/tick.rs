//! Times one clay tick (cut, contact, force) on grids of different sizes:
//! `cargo run --release -p teleclay-clay --example tick`.
//!
//! A ball of 12.8 voxels radius moves a quarter of a voxel per tick through fresh clay, half sunk into the top of the
//! block and wholly inside it; the paper's blade cuts a centimetre deep. A cylinder of that radius and a loop of that
//! ring do what they are made for: the one cuts a centimetre deep, the other is drawn flat through the clay. A cube as
//! wide as the ball is cut and felt as a mesh.
#![allow(clippy::print_stdout)] // a program's output

use std::time::Instant;

use teleclay_clay::{
    Clay, ContactState, Cylinder, Material, MeshTool, MeshToolError, Motion, Operation, Pose,
    PoseError, STEPS_PER_METRE, Shape, Sweep, Tool, ToolShape, WireLoop,
};

const VOXEL_M: f64 = 5e-4;

#[derive(Clone)]
enum Cutter {
    Shape(ToolShape),
    Mesh(MeshTool),
}

struct Stroke {
    name: &'static str,
    tool: Cutter,
    voxels: usize,
    /// Height of the tool's pose above the middle of the block, in voxels.
    height: f64,
    direction: [f64; 3],
    operation: Operation,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let ball = Cutter::Shape(ToolShape::ball(12.8 * VOXEL_M)?);
    let blade = Cutter::Shape(ToolShape::paper_blade());
    let cylinder = Cylinder::new(12.8 * VOXEL_M, 40.0 * VOXEL_M)?;
    let cylinder = Cutter::Shape(ToolShape::Cylinder(cylinder));
    let wire = WireLoop::new(12.8 * VOXEL_M, 4.0 * VOXEL_M)?;
    let wire = Cutter::Shape(ToolShape::Loop(wire));
    let cube = Cutter::Mesh(cube(25.6 * VOXEL_M)?);
    let along = [1.0, 0.0, 0.0];
    let up = [0.0, 0.0, 1.0];
    let diagonal = [0.6, 0.64, 0.48];
    for voxels in [64, 128, 256, 512, 1024] {
        let edge = voxels.min(512) as f64;
        for stroke in [
            Stroke {
                name: "ball inside, along x",
                tool: ball.clone(),
                voxels,
                height: 0.0,
                direction: along,
                operation: Operation::Cut,
            },
            Stroke {
                name: "ball inside, along z",
                tool: ball.clone(),
                voxels,
                height: 0.0,
                direction: up,
                operation: Operation::Cut,
            },
            Stroke {
                name: "ball inside, diagonal",
                tool: ball.clone(),
                voxels,
                height: 0.0,
                direction: diagonal,
                operation: Operation::Cut,
            },
            Stroke {
                name: "ball half sunk, along x",
                tool: ball.clone(),
                voxels,
                height: 0.5 * edge,
                direction: along,
                operation: Operation::Cut,
            },
            Stroke {
                name: "blade 1 cm deep",
                tool: blade.clone(),
                voxels,
                height: 0.5 * edge - 20.0,
                direction: along,
                operation: Operation::Cut,
            },
            Stroke {
                name: "cylinder 1 cm deep",
                tool: cylinder.clone(),
                voxels,
                height: 0.5 * edge - 20.0,
                direction: along,
                operation: Operation::Cut,
            },
            Stroke {
                name: "cylinder, diagonal",
                tool: cylinder.clone(),
                voxels,
                height: 0.0,
                direction: diagonal,
                operation: Operation::Cut,
            },
            Stroke {
                name: "loop inside, along x",
                tool: wire.clone(),
                voxels,
                height: 0.0,
                direction: along,
                operation: Operation::Cut,
            },
            Stroke {
                name: "loop inside, diagonal",
                tool: wire.clone(),
                voxels,
                height: 0.0,
                direction: diagonal,
                operation: Operation::Cut,
            },
            Stroke {
                name: "mesh inside, along x",
                tool: cube.clone(),
                voxels,
                height: 0.0,
                direction: along,
                operation: Operation::Cut,
            },
            Stroke {
                name: "mesh inside, diagonal",
                tool: cube.clone(),
                voxels,
                height: 0.0,
                direction: diagonal,
                operation: Operation::Cut,
            },
            Stroke {
                name: "ball in air",
                tool: ball.clone(),
                voxels,
                height: edge,
                direction: along,
                operation: Operation::Cut,
            },
            Stroke {
                name: "ball adds, along x",
                tool: ball.clone(),
                voxels,
                height: 0.0,
                direction: along,
                operation: Operation::Add,
            },
            Stroke {
                name: "ball smooths, diagonal",
                tool: ball.clone(),
                voxels,
                height: 0.0,
                direction: diagonal,
                operation: Operation::Smooth,
            },
        ] {
            stroke.run()?;
        }
    }
    Ok(())
}

/// A cube about the tool's position as a closed mesh.
fn cube(edge_m: f64) -> Result<MeshTool, MeshToolError> {
    let vertices_m: Vec<[f64; 3]> = (0..8)
        .map(|corner: usize| [0, 1, 2].map(|bit| edge_m * ((corner >> bit & 1) as f64 - 0.5)))
        .collect();
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles: Vec<[u32; 3]> = quads
        .into_iter()
        .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    MeshTool::new(&vertices_m, &triangles)
}

impl Stroke {
    fn run(&self) -> Result<(), Box<dyn std::error::Error>> {
        let size_m = self.voxels as f64 * VOXEL_M;
        // The largest block is half as high.
        let height_m = size_m.min(512.0 * VOXEL_M);
        let mut clay = Clay::new(
            &Shape::Block {
                size_m: [size_m, size_m, height_m],
            },
            VOXEL_M,
        )?;
        clay.commit_pages();
        let tool = match &self.tool {
            Cutter::Shape(shape) => Ok(Tool::new(*shape)),
            Cutter::Mesh(mesh) => Err(mesh),
        };
        let (material, mut contact) = (Material::default(), ContactState::default());
        let step_m = 0.25 * VOXEL_M;
        let ticks = self.voxels * 3;
        let middle_m = [0.5 * size_m, 0.5 * size_m, 0.5 * height_m];
        let place = |tick: usize| {
            let way_m = (tick as f64 - 0.5 * ticks as f64) * step_m;
            let lift_m = self.height * VOXEL_M;
            Pose::quantise(std::array::from_fn(|axis| {
                middle_m[axis] + way_m * self.direction[axis] + if axis == 2 { lift_m } else { 0.0 }
            }))
        };
        if self.operation != Operation::Cut {
            // Through clay that was cut half a voxel lower: there is something to fill, and to flatten.
            let cut = |tick| -> Result<Pose, PoseError> {
                let steps = place(tick)?.steps();
                let lower = (0.5 * VOXEL_M * STEPS_PER_METRE) as i32;
                Ok(Pose::from_steps([steps[0], steps[1], steps[2] - lower]))
            };
            if let Ok(tool) = &tool {
                clay.carve(&Sweep {
                    shape: *tool.shape(),
                    from: cut(0)?,
                    to: cut(ticks)?,
                });
            }
        }
        let velocity_m_s = self.direction.map(|d| d * step_m / 1e-3);
        let mut ticks_s = Vec::with_capacity(ticks);
        let mut force_n = 0.0;
        for tick in 0..ticks {
            let motion = Motion::new(place(tick)?, place(tick + 1)?, velocity_m_s)?;
            let start = Instant::now();
            let worked = match &tool {
                Ok(tool) => clay.work_as(self.operation, tool, &material, &motion, &mut contact),
                Err(mesh) => clay.work_mesh(mesh, &material, &motion, &mut contact),
            };
            ticks_s.push(start.elapsed().as_secs_f64());
            force_n += worked.response.force_n[0];
        }
        ticks_s.sort_by(f64::total_cmp);
        let at = |share: f64| ticks_s[(share * (ticks - 1) as f64) as usize] * 1e6;
        println!(
            "{:>3}^3  {:<24} p50 {:>6.2} us  p99 {:>6.2} us  max {:>7.2} us  (mean force {:.3} N)",
            self.voxels,
            self.name,
            at(0.5),
            at(0.99),
            at(1.0),
            force_n / ticks as f64,
        );
        Ok(())
    }
}
