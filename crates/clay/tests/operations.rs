//! Adding and smoothing: against closed forms and the written rule, the balance, the order, and what the hand feels.

mod solid;

use std::f64::consts::PI;

use solid::{Noise, Solid, at, clay_of};
use teleclay_clay::{
    BrickView, Clay, Coefficients, ContactState, Cylinder, Material, Motion, Operation, Pose,
    SOLID, Shape, Sweep, Tool, ToolShape, WireLoop,
};

const VOXEL_M: f64 = 1e-3;

fn block(edge_m: f64) -> Clay {
    let shape = Shape::Block {
        size_m: [edge_m; 3],
    };
    Clay::new(&shape, VOXEL_M).unwrap()
}

fn ball(radius_m: f64) -> ToolShape {
    ToolShape::ball(radius_m).unwrap()
}

fn sweep(shape: ToolShape, from_m: [f64; 3], to_m: [f64; 3]) -> Sweep {
    Sweep {
        shape,
        from: at(from_m),
        to: at(to_m),
    }
}

/// What a voxel has of a capsule, by the formula in the documentation and in double precision.
fn covered_by_capsule(voxel: [usize; 3], from_m: [f64; 3], to_m: [f64; 3], radius_m: f64) -> f64 {
    let here = voxel.map(|at| (at as f64 + 0.5) * VOXEL_M);
    let way: [f64; 3] = std::array::from_fn(|axis| to_m[axis] - from_m[axis]);
    let off: [f64; 3] = std::array::from_fn(|axis| here[axis] - from_m[axis]);
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let along = (dot(off, way) / dot(way, way).max(1e-30)).clamp(0.0, 1.0);
    let apart: [f64; 3] = std::array::from_fn(|axis| off[axis] - along * way[axis]);
    let outside = (dot(apart, apart).sqrt() - radius_m) / VOXEL_M;
    (0.5 - outside / 2.0).clamp(0.0, 1.0) * f64::from(SOLID)
}

#[test]
fn adding_puts_a_capsule_where_air_was() {
    let mut clay = block(0.044);
    // A hollow that is larger than what is added.
    clay.carve(&sweep(ball(0.016), [0.022; 3], [0.022; 3]));
    let hollow = clay.clone();
    let (from_m, to_m) = ([0.017, 0.021, 0.024], [0.0262, 0.0243, 0.0215]);
    let added = clay.operate(Operation::Add, &sweep(ball(0.005), from_m, to_m));
    assert_eq!(
        clay.remaining_units(),
        hollow.remaining_units() + added,
        "the balance is exact"
    );
    for z in 0..44 {
        for y in 0..44 {
            for x in 0..44 {
                let voxel = [x, y, z];
                let signed = voxel.map(|at| at as i32);
                let before = f64::from(hollow.occupancy(signed));
                let want = before.max(covered_by_capsule(voxel, from_m, to_m, 0.005));
                let got = f64::from(clay.occupancy(signed));
                assert!((got - want).abs() <= 0.75, "{voxel:?}: {got}, want {want}");
            }
        }
    }
    let length_m = (0..3).map(|axis| to_m[axis] - from_m[axis]);
    let length_m = length_m.map(|way| way * way).sum::<f64>().sqrt();
    // The mean over radii from a voxel less to a voxel more, which is what a ramp comes to.
    let (radius_m, ramp_m) = (0.005_f64, VOXEL_M);
    let square = radius_m.powi(2) + ramp_m.powi(2) / 3.0;
    let cube = radius_m.powi(3) + radius_m * ramp_m.powi(2);
    let capsule_m3 = PI * (square * length_m + 4.0 / 3.0 * cube);
    let error = added as f64 * clay.unit_volume_m3() / capsule_m3 - 1.0;
    assert!(error.abs() < 0.003, "volume off by {error}");
    assert_eq!(
        clay.operate(Operation::Add, &sweep(ball(0.005), from_m, to_m)),
        0,
        "what stands already is not added again"
    );
}

/// Short steps and one long sweep put the same clay there, to a unit a voxel.
#[test]
fn adding_step_by_step_is_adding_at_once() {
    let mut at_once = block(0.044);
    at_once.carve(&sweep(ball(0.016), [0.022; 3], [0.022; 3]));
    let mut by_steps = at_once.clone();
    let place = |share: f64| [0.016 + 0.012 * share, 0.020 + 0.003 * share, 0.022];
    at_once.operate(Operation::Add, &sweep(ball(0.004), place(0.0), place(1.0)));
    for step in 0..60 {
        let [from, to] = [step, step + 1].map(|step| place(f64::from(step) / 60.0));
        by_steps.operate(Operation::Add, &sweep(ball(0.004), from, to));
    }
    for z in 0..44 {
        for y in 0..44 {
            for x in 0..44 {
                let voxel = [x, y, z];
                let apart = at_once.occupancy(voxel).abs_diff(by_steps.occupancy(voxel));
                assert!(apart <= 1, "{voxel:?} differs by {apart}");
            }
        }
    }
}

#[test]
fn nothing_is_added_that_was_not_removed() {
    let mut clay = block(0.032);
    let whole = sweep(ball(0.012), [0.016; 3], [0.016; 3]);
    assert_eq!(clay.operate(Operation::Add, &whole), 0);
    // The hollow holds less than the ball that is added elsewhere wants.
    let removed = clay.carve(&sweep(ball(0.004), [0.016; 3], [0.016; 3]));
    clay.carve(&sweep(ball(0.009), [0.016; 3], [0.016; 3]));
    let open = clay.removed_units();
    let added = clay.operate(Operation::Add, &sweep(ball(0.006), [0.016; 3], [0.018; 3]));
    assert!(removed < added && added < open);
    clay.operate(Operation::Add, &sweep(ball(0.010), [0.016; 3], [0.016; 3]));
    assert!(clay.remaining_units() <= clay.initial_units());
    let mut emptied = block(0.032);
    emptied.carve(&sweep(ball(0.003), [0.004, 0.004, 0.004], [0.004; 3]));
    let open = emptied.removed_units();
    emptied.carve(&whole);
    let all = emptied.removed_units();
    // Everything comes back, and not a unit more.
    let mut added = 0;
    for shift in [0.0, 0.002, 0.004] {
        let place = [0.016 - shift, 0.016, 0.016];
        added += emptied.operate(Operation::Add, &sweep(ball(0.015), place, place));
    }
    assert_eq!(
        emptied.remaining_units() + (all - added),
        emptied.initial_units()
    );
    assert!(all - open < added + all / 2);
}

/// A tool that was known to stand in cleared clay stands in clay once some was added, or came over from smoothing.
#[test]
fn what_was_put_back_is_cut_again_from_where_the_tool_stands() {
    let here = sweep(ball(0.006), [0.016; 3], [0.016; 3]);
    for operation in [Operation::Add, Operation::Smooth] {
        let mut clay = block(0.032);
        clay.carve(&here);
        clay.carve(&here);
        let moved = clay.operate(operation, &sweep(ball(0.008), [0.014; 3], [0.018; 3]));
        assert!(0 < moved, "{operation:?}");
        let mut anew = Clay::from_bricks(*clay.grid(), clay.initial_units(), |brick| {
            clay.brick(brick)
        })
        .unwrap();
        let removed = clay.carve(&here);
        assert_eq!(removed, anew.carve(&here), "{operation:?}");
        assert!(0 < removed, "{operation:?}");
        assert_eq!(clay.hash(), anew.hash());
    }
}

/// Clay with a wave on top: its height goes by the cosine of x.
fn wavy(amplitude: f64, voxels_a_wave: f64, middle: f64) -> Clay {
    clay_of([64, 24, 40], VOXEL_M, |[x, _, z]| {
        let height = middle + amplitude * (2.0 * PI * (x as f64 + 0.5) / voxels_a_wave).cos();
        let inside = 0.5 + (height - (z as f64 + 0.5)) / 2.0;
        (inside.clamp(0.0, 1.0) * f64::from(SOLID)).round() as u8
    })
}

/// Height of the clay over a column, in voxels: all that is in it.
fn height(clay: &Clay, x: i32, y: i32) -> f64 {
    (0..40)
        .map(|z| f64::from(clay.occupancy([x, y, z])) / f64::from(SOLID))
        .sum()
}

/// A low wave, within a tool that covers all of it, falls at each quarter way by a quarter of what a mean over
/// neighbours takes off it: that is `(1 + cos k) / 2` for `k` radians a voxel.
#[test]
fn smoothing_damps_a_wave_as_the_mean_does() {
    for (voxels_a_wave, times) in [(8.0, 12), (12.0, 16), (16.0, 24)] {
        let mut clay = wavy(0.6, voxels_a_wave, 20.3);
        let amplitude = |clay: &Clay| {
            let share = |x: i32| (2.0 * PI * (f64::from(x) + 0.5) / voxels_a_wave).cos();
            // Whole waves in the middle, where the tool covers everything.
            let count = (24.0 / voxels_a_wave).floor() * voxels_a_wave;
            let first = (32.0 - count / 2.0) as i32;
            let all = (first..first + count as i32).map(|x| share(x) * height(clay, x, 12));
            2.0 * all.sum::<f64>() / count
        };
        let before = amplitude(&clay);
        assert!((before - 0.6).abs() < 0.02, "{before}");
        let units = clay.remaining_units();
        let tool = ball(0.026);
        for step in 0..times {
            // A plane each time, to and fro.
            let [from, to] = [step % 2, (step + 1) % 2]
                .map(|side: i32| [0.032, 0.012, 0.0201 + 0.00025 * f64::from(side)]);
            assert!(0 < clay.operate(Operation::Smooth, &sweep(tool, from, to)));
        }
        assert_eq!(clay.remaining_units(), units, "the volume stays");
        let a_time = 1.0 - 0.25 * (1.0 - (1.0 + (2.0 * PI / voxels_a_wave).cos()) / 2.0);
        let want = before * a_time.powi(times);
        let got = amplitude(&clay);
        assert!(
            (got / want - 1.0).abs() < 0.12,
            "{voxels_a_wave}: {got}, want {want}"
        );
    }
}

/// Faces with the ramp that cutting leaves stay to the last bit, level or steep, wherever the tool rubs.
#[test]
fn a_flat_face_stays_as_it_is() {
    for offset in [0.0, 0.17, 0.5, 0.81] {
        let flat = wavy(0.0, 8.0, 20.0 + offset);
        let mut clay = flat.clone();
        for step in 0..40 {
            let place = |step: i32| [0.020 + 0.0004 * f64::from(step), 0.012, 0.021];
            clay.operate(
                Operation::Smooth,
                &sweep(ball(0.006), place(step), place(step + 1)),
            );
        }
        let apart = (0..64).flat_map(|x| (0..24).map(move |y| (x, y)));
        let apart = apart.map(|(x, y)| (height(&clay, x, y) - height(&flat, x, y)).abs());
        let most = apart.fold(0.0, f64::max);
        assert!(most < 0.02, "{offset}: moved by {most} voxels");
    }
}

/// A tool that stands, or passes no plane, does nothing; how much one does does not depend on its speed.
#[test]
fn smoothing_goes_by_the_way() {
    let mut clay = wavy(1.0, 8.0, 20.3);
    let still = [0.032, 0.012, 0.0201];
    assert_eq!(
        clay.operate(Operation::Smooth, &sweep(ball(0.008), still, still)),
        0
    );
    let near = [0.03201, 0.01201, 0.02011];
    assert_eq!(
        clay.operate(Operation::Smooth, &sweep(ball(0.008), still, near)),
        0
    );
    let roughness = |clay: &Clay| {
        let heights = (28..36).map(|x| height(clay, x, 12));
        heights.clone().fold(0.0, f64::max) - heights.fold(f64::INFINITY, f64::min)
    };
    let left: Vec<f64> = [0.000_02, 0.000_1, 0.000_25]
        .map(|step_m| {
            let mut clay = clay.clone();
            let steps = (0.024 / step_m) as i32;
            let place = |step: i32| [0.020 + step_m * f64::from(step), 0.012, 0.0201];
            for step in 0..steps {
                clay.operate(
                    Operation::Smooth,
                    &sweep(ball(0.008), place(step), place(step + 1)),
                );
            }
            roughness(&clay)
        })
        .into();
    assert!(left[0] < 0.6 * roughness(&clay), "{left:?}");
    for one in &left {
        assert!((one / left[0] - 1.0).abs() < 0.15, "{left:?}");
    }
}

#[test]
fn operations_do_not_commute_with_cuts_and_say_so() {
    let cut = sweep(ball(0.006), [0.016; 3], [0.018; 3]);
    for operation in [Operation::Add, Operation::Smooth] {
        assert!(!operation.commutes());
        let other = sweep(ball(0.008), [0.018; 3], [0.020; 3]);
        let mut one = block(0.032);
        one.carve(&sweep(ball(0.007), [0.020; 3], [0.020; 3]));
        let mut two = one.clone();
        one.carve(&cut);
        one.operate(operation, &other);
        two.operate(operation, &other);
        two.carve(&cut);
        assert_ne!(one.hash(), two.hash());
    }
    assert!(Operation::Cut.commutes());
}

fn content(view: BrickView<'_>) -> Vec<u8> {
    match view {
        BrickView::Empty => vec![0; 4096],
        BrickView::Full => vec![SOLID; 4096],
        BrickView::Voxels(voxels) => voxels.to_vec(),
    }
}

/// Random operations in one order: the balance is exact, the surface closed, and a copy that is cloned on the way, one
/// that gets the same sweeps, and one that is told of changed bricks alone are all equal.
#[test]
fn random_operations_keep_the_balance_and_every_copy() {
    let mut noise = Noise(0x0b5e);
    let mut clay = block(0.027);
    let mut twin = block(0.027);
    let mut told: Vec<Vec<u8>> = vec![vec![SOLID; 4096]; clay.grid().brick_count()];
    for (dense, told) in (0..).zip(&mut told) {
        *told = content(clay.brick(clay.grid().brick_index(dense).unwrap()));
    }
    let mut balance = i64::try_from(clay.initial_units()).unwrap();
    for round in 0..200_000 {
        let share = |word: u64| (word >> 11) as f64 / (1_u64 << 53) as f64;
        let place = |noise: &mut Noise| -> [f64; 3] {
            std::array::from_fn(|_| -0.004 + 0.035 * share(noise.word()))
        };
        let from = place(&mut noise);
        let way = 0.001 + 0.003 * share(noise.word());
        let to = from.map(|at| at + way * (share(noise.word()) - 0.5));
        let shape = match noise.word() % 4 {
            0 => ball(0.0025 + 0.003 * share(noise.word())),
            1 => ToolShape::paper_blade(),
            2 => ToolShape::Cylinder(Cylinder::new(0.003, 0.009).unwrap()),
            _ => ToolShape::Loop(WireLoop::new(0.004, 0.0025).unwrap()),
        };
        let operation = match noise.word() % 4 {
            0 => Operation::Cut,
            1 => Operation::Add,
            _ => Operation::Smooth,
        };
        let one = sweep(shape, from, to);
        let before = clay.remaining_units();
        let moved = clay.operate(operation, &one);
        let signed = i64::try_from(moved).unwrap();
        balance += match operation {
            Operation::Cut => -signed,
            Operation::Add => signed,
            Operation::Smooth => 0,
        };
        assert_eq!(
            i64::try_from(clay.remaining_units()).unwrap(),
            balance,
            "round {round}"
        );
        assert!(clay.remaining_units() <= clay.initial_units());
        assert!(moved == 0 || operation == Operation::Smooth || before != clay.remaining_units());
        assert_eq!(twin.operate(operation, &one), moved);
        if round % 2500 == 1250 {
            twin = clay.clone();
        }
        if round % 800 == 0 {
            clay.drain_changed(usize::MAX, |brick, view| {
                told[brick.as_u32() as usize] = content(view);
            });
            let mut copy = Clay::from_bricks(*clay.grid(), clay.initial_units(), |brick| {
                let voxels: &[u8] = &told[brick.as_u32() as usize];
                BrickView::Voxels(voxels.try_into().unwrap())
            })
            .unwrap();
            assert_eq!(clay.hash(), twin.hash(), "round {round}");
            assert_eq!(clay.hash(), copy.hash(), "round {round}");
        }
        if round % 8000 == 7999 {
            Solid::of(&clay).unwrap_or_else(|error| panic!("round {round}: {error}"));
        }
    }
    assert!(clay.remaining_units() < clay.initial_units());
}

fn clay_that_springs() -> Material {
    Material::new(Coefficients {
        viscosity_pa_s_per_m: 2e5,
        yield_stress_pa: 3e3,
        stiffness_pa: 4e5,
    })
    .unwrap()
}

/// Whatever the tool does, and however it moves: it never gives the hand more than it stored, over any part of the way.
#[test]
fn the_hand_gets_no_energy_from_adding_or_smoothing() {
    for operation in [Operation::Add, Operation::Smooth] {
        for seed in 1..30 {
            let mut noise = Noise(seed);
            let mut clay = block(0.032);
            clay.carve(&sweep(ball(0.011), [0.016; 3], [0.016; 3]));
            let tool = Tool::new(ball(0.004));
            let mut contact = ContactState::default();
            let mut place = [0.016_f64; 3];
            let mut velocity = [0.0_f64; 3];
            let (mut given, mut stored_before) = (0.0, 0.0);
            for _ in 0..600 {
                let from = at(place);
                for axis in 0..3 {
                    let push = (noise.word() >> 11) as f64 / (1_u64 << 53) as f64 - 0.5;
                    velocity[axis] = 0.97 * velocity[axis] + 0.02 * push;
                    place[axis] = (place[axis] + 1e-3 * velocity[axis]).clamp(0.006, 0.026);
                }
                let to = at(place);
                // The velocity that the way was made with, so that power is force by way.
                let way = to.displacement_from_m(from);
                let motion = Motion::new(from, to, way.map(|way| way / 1e-3)).unwrap();
                let worked = clay.work_as(
                    operation,
                    &tool,
                    &clay_that_springs(),
                    &motion,
                    &mut contact,
                );
                let force = worked.response.force_n;
                given -= (0..3).map(|axis| force[axis] * way[axis]).sum::<f64>();
                assert!(
                    worked.response.stored_j - stored_before <= given + 1e-12,
                    "{operation:?}: stored {} of {given}",
                    worked.response.stored_j
                );
                given -= worked.response.stored_j - stored_before;
                stored_before = worked.response.stored_j;
                // What is left is heat; it is never taken back.
                assert!(-1e-12 <= given);
                given = 0.0;
            }
        }
    }
}

/// Ripple of the force on a way at an even speed along a face, as the standard deviation of the mean.
fn ripple(operation: Operation, shape: ToolShape, direction: [f64; 3], speed_m_s: f64) -> f64 {
    let size_m = [0.096, 0.048, 0.032];
    let mut clay = Clay::new(&Shape::Block { size_m }, 5e-4).unwrap();
    // A face within the grid, and clay in stock.
    let plane = ToolShape::Cylinder(Cylinder::new(0.060, 0.030).unwrap());
    clay.carve(&Sweep {
        shape: plane,
        from: at([0.0, 0.024, 0.020]),
        to: at([0.096, 0.024, 0.020]),
    });
    let tool = Tool::new(shape);
    let mut contact = ContactState::default();
    let place = |tick: i32| -> Pose {
        let start = [0.030, 0.020, 0.0213];
        at(std::array::from_fn(|axis| {
            start[axis] + direction[axis] * speed_m_s * 1e-3 * f64::from(tick)
        }))
    };
    let mut forces = Vec::new();
    let ticks = (0.030 / (speed_m_s * 1e-3)) as i32;
    for tick in 0..ticks {
        let velocity = direction.map(|part| part * speed_m_s);
        let motion = Motion::new(place(tick), place(tick + 1), velocity).unwrap();
        let worked = clay.work_as(
            operation,
            &tool,
            &Material::default(),
            &motion,
            &mut contact,
        );
        let [x, y, z] = worked.response.force_n;
        if ticks / 4 < tick {
            forces.push((x * x + y * y + z * z).sqrt());
        }
    }
    let mean = forces.iter().sum::<f64>() / forces.len() as f64;
    assert!(0.0 < mean);
    let square = forces
        .iter()
        .map(|force| (force - mean).powi(2))
        .sum::<f64>();
    (square / forces.len() as f64).sqrt() / mean
}

#[test]
fn adding_and_smoothing_feel_even() {
    let askew = [0.9_f64, 0.43, 0.0];
    let length = (askew[0] * askew[0] + askew[1] * askew[1]).sqrt();
    for operation in [Operation::Add, Operation::Smooth] {
        for direction in [[1.0, 0.0, 0.0], askew.map(|part| part / length)] {
            for speed_m_s in [0.02, 0.05, 0.1] {
                let got = ripple(operation, ball(0.0064), direction, speed_m_s);
                println!(
                    "{operation:?} along {direction:?} at {speed_m_s} m/s: {:.2} %",
                    100.0 * got
                );
                assert!(got < 0.05, "{operation:?} along {direction:?}: {got}");
            }
        }
    }
}
