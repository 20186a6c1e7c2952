//! Digests of fixed pieces of work, worked out by different machines and compared.
//!
//! Native code and WebAssembly are as different as machines get here: vectors against arrays, the system's mathematics
//! against the compiler's. `cargo verify --only golden` has both work out every digest and fails where they differ.

use std::time::Duration;

use teleclay_clay::{Clay, Mesh, Pose, Shape, SteppedBlock, Sweep, ToolShape};
use teleclay_link::conditioner::Impairment;
use teleclay_operator::{Intent, Reach};
use teleclay_proto::join::LoopParameters;
use teleclay_proto::{Axes, Scheme, ToolDescription};
use teleclay_session::Lines;
use teleclay_sim::pointed::{Pointed, PointedSetup};
use teleclay_sim::rig::{Rig, Setup};

/// A digest's name, and how it is worked out.
pub type Digest = (&'static str, fn() -> u64);

/// Every digest.
pub const DIGESTS: [Digest; 15] = [
    ("clay", teleclay_clay::golden::digest),
    ("clay_rods", teleclay_clay::golden::rods),
    ("clay_mesh", teleclay_clay::golden::mesh),
    ("clay_operations", teleclay_clay::golden::operations),
    ("surface", surface),
    ("loop_force_exchange", || run(Scheme::ForceExchange)),
    ("loop_position_force", || run(Scheme::PositionForce)),
    ("loop_replica", || run(Scheme::Replica)),
    ("loop_tdpa", || run(Scheme::Tdpa)),
    ("loop_wave", || run(Scheme::Wave)),
    ("pointer_force_exchange", || point(Scheme::ForceExchange)),
    ("pointer_position_force", || point(Scheme::PositionForce)),
    ("pointer_replica", || point(Scheme::Replica)),
    ("pointer_tdpa", || point(Scheme::Tdpa)),
    ("pointer_wave", || point(Scheme::Wave)),
];

/// What a WebAssembly module offers to whoever loads it.
#[cfg(target_family = "wasm")]
mod exports {
    // An exported name could clash with another library's; this module is linked with none.
    #![allow(unsafe_code)]

    /// How many digests there are.
    #[unsafe(no_mangle)]
    pub(crate) extern "C" fn digests() -> u32 {
        super::DIGESTS.len() as u32
    }

    /// One of the digests.
    #[unsafe(no_mangle)]
    pub(crate) extern "C" fn digest(number: u32) -> u64 {
        super::DIGESTS[number as usize].1()
    }
}

/// The surface of a block cut by ball and blade: every coordinate, every triangle.
fn surface() -> u64 {
    let mut clay = Clay::new(&Shape::Stepped(SteppedBlock::paper()), 1e-3).expect("it fits");
    let at = |position_m| Pose::quantise(position_m).expect("it is near");
    let ball = ToolShape::ball(0.0077).expect("a ball");
    for (shape, from, to) in [
        (ball, [0.04, -0.01, 0.03], [0.07, 0.08, 0.021]),
        (
            ToolShape::paper_blade(),
            [0.0, 0.031, 0.012],
            [0.11, 0.04, 0.007],
        ),
    ] {
        clay.carve(&Sweep {
            shape,
            from: at(from),
            to: at(to),
        });
    }
    let mesh = Mesh::of(&clay);
    let places = mesh.positions_m.as_flattened().iter();
    let places = places.map(|place_m| u64::from(place_m.to_bits()));
    let corners = mesh.triangles.as_flattened().iter().copied();
    places.chain(corners.map(u64::from)).fold(0, fold)
}

/// What every loop here has between its sides.
fn bad_line() -> Impairment {
    Impairment {
        delay: Duration::from_millis(7),
        jitter: Duration::from_millis(2),
        loss: 0.1,
        duplicate: 0.05,
        ..Impairment::default()
    }
}

/// Two seconds of a pointer on a page that cuts across a bad line: every byte that it sends, every place and force of
/// every tick, and the clay that results.
fn point(scheme: Scheme) -> u64 {
    let line = bad_line();
    let mut pointed = Pointed::new(PointedSetup {
        parameters: LoopParameters {
            scheme,
            home_m: [0.064, 0.032, 0.032 + 0.0064],
            tool: ToolDescription::Ball { radius_m: 0.0064 },
            ..LoopParameters::default()
        },
        size_m: [0.128, 0.064, 0.032],
        voxel_size_m: 1e-3,
        lines: Lines {
            up: line,
            up_seed: 3,
            down: line,
            down_seed: 4,
        },
        wakes_every: 2,
    })
    .expect("a loop");
    let mut digest = 0;
    for _ in 0..2000 {
        pointed.tick();
        let sent = pointed.sent().unwrap_or_default();
        digest = sent.iter().map(|byte| u64::from(*byte)).fold(digest, fold);
        let view = pointed.pointer().view();
        let numbers = [
            view.hand_m,
            view.handle_m,
            view.tool_m,
            view.felt_force_n,
            view.hand_force_n,
        ];
        let numbers = numbers.as_flattened().iter().map(|number| number.to_bits());
        digest = numbers.fold(digest, fold);
        digest = fold(digest, view.clay_hash.unwrap_or_default());
    }
    let clay = pointed.session_mut().clay_mut();
    fold(fold(digest, clay.hash()), clay.removed_units())
}

/// Two seconds of the whole loop on virtual time across a bad line: a person cuts, by ball and by blade. Every pose and
/// every force of every tick, and the clay that results at both ends.
fn run(scheme: Scheme) -> u64 {
    let line = bad_line();
    let tools = [
        (ToolDescription::Ball { radius_m: 0.0064 }, 0.0064),
        (
            ToolDescription::Blade {
                width_m: 0.010,
                height_m: 0.040,
                thickness_m: 0.0021,
            },
            0.0,
        ),
    ];
    let mut digest = 0;
    for (tool, lift_m) in tools {
        let mut rig = Rig::new(Setup {
            parameters: LoopParameters {
                scheme,
                axes: Axes::Two,
                home_m: [0.024, 0.016, 0.016 + lift_m],
                tool,
                ..LoopParameters::default()
            },
            clay: Clay::new(
                &Shape::Block {
                    size_m: [0.048, 0.032, 0.016],
                },
                1e-3,
            )
            .expect("a block"),
            intent: Intent::cutting(Reach {
                x_m: 0.015,
                y_m: 0.006,
                depth_m: 0.008,
            })
            .expect("a reach"),
            lines: Lines {
                up: line,
                up_seed: 3,
                down: line,
                down_seed: 4,
            },
        })
        .expect("a rig");
        for _ in 0..2000 {
            rig.tick();
            let tool = rig.tool().view();
            let numbers = [tool.position_m, tool.force_n, rig.last().felt_force_n];
            let numbers = numbers.as_flattened().iter().map(|number| number.to_bits());
            digest = numbers.fold(digest, fold);
        }
        let clay = rig.session_mut().clay_mut();
        digest = fold(fold(digest, clay.hash()), clay.removed_units());
    }
    digest
}

/// Folds a value into a running digest. The multiplier is odd, with the bits of the golden ratio.
fn fold(digest: u64, value: u64) -> u64 {
    let mixed = (digest ^ value).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    mixed ^ mixed >> 29
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A digest that did not depend on its work would agree on every machine.
    #[test]
    fn digests_differ_and_can_be_repeated() {
        let mut seen = Vec::new();
        for (name, digest) in DIGESTS {
            let got = digest();
            assert_eq!(got, digest(), "{name}");
            assert!(!seen.contains(&got), "{name}");
            seen.push(got);
        }
    }
}
