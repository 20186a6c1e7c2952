//! Times the surface of cut blocks: `cargo run --release -p teleclay-clay --example surface`.
#![allow(clippy::print_stdout)] // a program's output

use std::time::Instant;

use teleclay_clay::{Clay, Mesh, Pose, Shape, Sweep, ToolShape, stl};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for (name, voxel_m) in [
        ("fresh", 5e-4),
        ("cut", 5e-4),
        ("cut", 1e-3),
        ("cut", 2.5e-4),
    ] {
        let mut clay = Clay::new(&Shape::default(), voxel_m)?;
        let shape = ToolShape::ball(0.0064)?;
        let corner = |number: i32| -> Result<Pose, Box<dyn std::error::Error>> {
            let share = |step: i32, size_m: f64| f64::from(number * step % 17) / 16.0 * size_m;
            Ok(Pose::quantise([
                share(5, 0.128),
                share(7, 0.064),
                0.02 + share(3, 0.048),
            ])?)
        };
        if name == "cut" {
            for number in 0..40 {
                let (from, to) = (corner(number)?, corner(number + 1)?);
                clay.carve(&Sweep { shape, from, to });
            }
        }
        let mut best_s = f64::INFINITY;
        let mut mesh = Mesh::default();
        for _ in 0..7 {
            let started = Instant::now();
            mesh = Mesh::of(&clay);
            best_s = best_s.min(started.elapsed().as_secs_f64());
        }
        let started = Instant::now();
        let bytes = stl::encode(&mesh).len();
        let encode_s = started.elapsed().as_secs_f64();
        println!(
            "{name:>5} {:?} voxels: mesh {:6.1} ms, STL {:5.1} ms, {} triangles, {bytes} bytes, volume {:+.4} %",
            clay.grid().voxels(),
            1e3 * best_s,
            1e3 * encode_s,
            mesh.triangles.len(),
            100.0 * (mesh.volume_m3() / clay.remaining_volume_m3() - 1.0),
        );
    }
    Ok(())
}
