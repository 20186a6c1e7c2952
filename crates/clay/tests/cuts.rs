//! Cuts are facts: the clay that results does not depend on their order, number, or on how they were worked out, and
//! not a unit of volume gets lost.

use proptest::prelude::*;
use teleclay_clay::{
    Ball, Blade, BladeDimensions, BrickView, Clay, Cylinder, Pose, Shape, SteppedBlock, Sweep,
    ToolShape, UNITS_PER_VOXEL, WireLoop,
};

const VOXEL_M: f64 = 1e-3;

fn block() -> Clay {
    // Not whole bricks, and not whole voxels along y.
    Clay::new(
        &Shape::Block {
            size_m: [0.052, 0.0405, 0.036],
        },
        VOXEL_M,
    )
    .unwrap()
}

fn tool() -> impl Strategy<Value = ToolShape> {
    prop_oneof![
        (1.0..14.0).prop_map(|radius| ToolShape::Ball(Ball::new(radius * VOXEL_M).unwrap())),
        (2.0..12.0, 2.0..20.0, 2.0..6.0).prop_map(|(width, height, thickness)| {
            ToolShape::Blade(
                Blade::new(BladeDimensions {
                    width_m: width * VOXEL_M,
                    height_m: height * VOXEL_M,
                    thickness_m: thickness * VOXEL_M,
                })
                .unwrap(),
            )
        }),
        (1.0..12.0, 2.0..20.0).prop_map(|(radius, height)| {
            let [radius_m, height_m] = [radius, height].map(|length| length * VOXEL_M);
            ToolShape::Cylinder(Cylinder::new(radius_m, height_m).unwrap())
        }),
        (6.0..12.0, 2.0..6.0).prop_map(|(ring, wire)| {
            let [ring_m, wire_m] = [ring, wire].map(|length| length * VOXEL_M);
            ToolShape::Loop(WireLoop::new(ring_m, wire_m).unwrap())
        }),
    ]
}

fn place() -> impl Strategy<Value = [f64; 3]> {
    [-0.01..0.06, -0.01..0.05, -0.01..0.045]
}

/// Ways that begin anywhere and go on in steps from far less than a voxel to many.
fn way() -> impl Strategy<Value = Vec<Pose>> {
    let length = prop_oneof![
        Just(2e-7),
        Just(1e-5),
        Just(2e-4),
        Just(1e-3),
        Just(6e-3),
        Just(3e-2)
    ];
    let direction = prop_oneof![
        3 => [-1.0..1.0, -1.0..1.0, -1.0..1.0],
        1 => prop::sample::select(vec![
            [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0], [1.0, 1.0, 0.0], [0.0, -1.0, 1.0], [1.0, 0.0, 1e-3], [0.0, 0.0, 0.0],
        ]),
    ];
    (place(), prop::collection::vec((length, direction), 1..12)).prop_map(|(start, steps)| {
        let mut at = start;
        let mut way = vec![Pose::quantise(at).unwrap()];
        for (length, direction) in steps {
            at = std::array::from_fn(|axis| at[axis] + length * direction[axis]);
            way.push(Pose::quantise(at).unwrap());
        }
        way
    })
}

fn sweeps_along(shape: ToolShape, way: &[Pose]) -> Vec<Sweep> {
    way.windows(2)
        .map(|ends| Sweep {
            shape,
            from: ends[0],
            to: ends[1],
        })
        .collect()
}

fn same_voxels(a: &Clay, b: &Clay) -> Result<(), TestCaseError> {
    for dense in 0..a.grid().brick_count() as u32 {
        let index = a.grid().brick_index(dense).unwrap();
        prop_assert_eq!(a.brick(index), b.brick(index), "brick {}", dense);
    }
    Ok(())
}

fn sum_of_occupancies(clay: &Clay) -> u64 {
    let [x, y, z] = clay.grid().voxels().map(i32::from);
    let mut sum = 0;
    for k in 0..z {
        for j in 0..y {
            for i in 0..x {
                sum += u64::from(clay.occupancy([i, j, k]));
            }
        }
    }
    sum
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Cut in order, every sweep starts where the last one ended and only looks ahead of itself. Cut in reverse, none
    /// does, and each looks at everything. Both must agree to the last bit; so must any other order with any
    /// repetitions.
    #[test]
    fn order_and_repetition_leave_no_trace(
        first in tool(),
        second in tool(),
        first_way in way(),
        second_way in way(),
        shuffle in prop::collection::vec(any::<prop::sample::Index>(), 40),
    ) {
        let mut sweeps = sweeps_along(first, &first_way);
        sweeps.extend(sweeps_along(second, &second_way));
        let mut in_order = block();
        for sweep in &sweeps {
            in_order.carve(sweep);
        }
        let mut in_reverse = block();
        for sweep in sweeps.iter().rev() {
            in_reverse.carve(sweep);
        }
        same_voxels(&in_order, &in_reverse)?;
        let mut shuffled = block();
        for index in &shuffle {
            shuffled.carve(index.get(&sweeps));
        }
        for sweep in &sweeps {
            shuffled.carve(sweep);
        }
        same_voxels(&in_order, &shuffled)?;
        prop_assert_eq!(in_order.hash(), in_reverse.hash());
        prop_assert_eq!(in_order.hash(), shuffled.hash());
        prop_assert_eq!(in_order.remaining_units(), shuffled.remaining_units());
        for sweep in &sweeps {
            prop_assert_eq!(in_order.carve(sweep), 0, "a sweep cut twice removes nothing");
        }
    }

    /// Tools at work in turns, as several operators are, cut what each would alone.
    #[test]
    fn tools_working_in_turns_do_not_disturb_each_other(shape in tool(), ways in prop::collection::vec(way(), 2..12)) {
        let mut in_turns = block();
        let longest = ways.iter().map(Vec::len).max().unwrap();
        for step in 1..longest {
            for way in ways.iter().filter(|way| step < way.len()) {
                in_turns.carve(&Sweep { shape, from: way[step - 1], to: way[step] });
            }
        }
        let mut in_reverse = block();
        for sweep in ways.iter().flat_map(|way| sweeps_along(shape, way)).collect::<Vec<_>>().iter().rev() {
            in_reverse.carve(sweep);
        }
        same_voxels(&in_turns, &in_reverse)?;
    }

    /// Every unit is either there or was reported as removed, also through bricks that were full, are emptied, or end
    /// outside the grid.
    #[test]
    fn volume_is_conserved_exactly(shape in tool(), way in way()) {
        let mut clay = block();
        let mut removed = 0;
        for sweep in sweeps_along(shape, &way) {
            removed += clay.carve(&sweep);
            prop_assert_eq!(clay.remaining_units(), sum_of_occupancies(&clay));
            prop_assert_eq!(clay.initial_units(), clay.remaining_units() + removed);
            prop_assert_eq!(clay.removed_units(), removed);
            let (initial, left, gone) =
                (clay.initial_volume_m3(), clay.remaining_volume_m3(), clay.removed_volume_m3());
            prop_assert_eq!((left + gone).to_bits(), initial.to_bits());
            let exact_m3 = removed as f64 * VOXEL_M.powi(3) / UNITS_PER_VOXEL as f64;
            prop_assert!((gone - exact_m3).abs() <= 1e-12 * initial);
        }
    }

    /// Short steps of a ball leave the capsule about its way, to a quarter of a unit.
    #[test]
    fn a_short_step_is_as_good_as_the_capsule(
        radius in 2.0..14.0_f64,
        from in place(),
        direction in [-1.0..1.0, -1.0..1.0, -1.0..1.0],
        share in 0.3..1.0,
    ) {
        let shape = ToolShape::ball(radius * VOXEL_M).unwrap();
        let ToolShape::Ball(ball) = shape else { unreachable!() };
        let length = direction.iter().map(|d: &f64| d * d).sum::<f64>().sqrt().max(1e-3);
        let longest = VOXEL_M * (0.25 * 8.0 / 127.5 * (radius - 1.0)).sqrt();
        let step: [f64; 3] = direction.map(|d| d / length * share * longest);
        prop_assume!(is_short(&ball, step));
        let to = std::array::from_fn(|axis| from[axis] + step[axis]);
        let (from, to) = (Pose::quantise(from).unwrap(), Pose::quantise(to).unwrap());
        let fresh = block();
        let mut clay = block();
        clay.carve(&Sweep { shape, from, to });
        let [x, y, z] = clay.grid().voxels().map(i32::from);
        let step = to.displacement_from_m(from);
        let squared = step.iter().map(|d| d * d).sum::<f64>();
        for k in 0..z {
            for j in 0..y {
                for i in 0..x {
                    let centre_m = [i, j, k].map(|at| (f64::from(at) + 0.5) * VOXEL_M);
                    let way: [f64; 3] = std::array::from_fn(|axis| centre_m[axis] - from.position_m()[axis]);
                    let along = (0..3).map(|axis| way[axis] * step[axis]).sum::<f64>() / squared.max(1e-30);
                    let off: [f64; 3] = std::array::from_fn(|axis| way[axis] - along.clamp(0.0, 1.0) * step[axis]);
                    let outside = off.iter().map(|d| d * d).sum::<f64>().sqrt() / VOXEL_M - radius;
                    let share = (0.5 + 0.5 * outside).clamp(0.0, 1.0) * 255.0;
                    let want = share.min(f64::from(fresh.occupancy([i, j, k])));
                    let got = f64::from(clay.occupancy([i, j, k]));
                    prop_assert!(-0.52 <= got - want && got - want <= 0.77, "voxel {i} {j} {k}: {got}, wanted {want}");
                }
            }
        }
    }

    /// What is left over agrees with the signed distance worked out in double precision by textbook formulas.
    #[test]
    fn what_is_left_follows_the_distance_to_the_swept_solid(shape in tool(), from in place(), to in place(), short in 0.0..1.0_f64) {
        // Long ways and, by squaring, many short ones.
        let to: [f64; 3] = std::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * short * short);
        let (from, to) = (Pose::quantise(from).unwrap(), Pose::quantise(to).unwrap());
        let fresh = block();
        let mut clay = block();
        clay.carve(&Sweep { shape, from, to });
        let [x, y, z] = clay.grid().voxels().map(i32::from);
        for k in 0..z {
            for j in 0..y {
                for i in 0..x {
                    let centre_m = [i, j, k].map(|at| (f64::from(at) + 0.5) * VOXEL_M);
                    let outside = distance_m(&shape, from, to, centre_m) / VOXEL_M;
                    let share = (0.5 + 0.5 * outside).clamp(0.0, 1.0) * 255.0;
                    let want = share.min(f64::from(fresh.occupancy([i, j, k])));
                    let got = f64::from(clay.occupancy([i, j, k]));
                    prop_assert!((got - want).abs() <= 0.52, "voxel {i} {j} {k}: {got}, wanted {want}");
                }
            }
        }
    }
}

/// Whether a ball's step is so short that it is cut as two balls, for that makes no more than a quarter of a unit of
/// difference: `step^2 / 8 d`, `d` the least distance from the way that matters.
fn is_short(ball: &Ball, step_m: [f64; 3]) -> bool {
    let step = step_m.map(|d| d / VOXEL_M);
    let squared = step.iter().map(|d| d * d).sum::<f64>();
    squared * 127.5 / 8.0 <= 0.25 * (ball.radius_m() / VOXEL_M - 1.0)
}

/// Signed distance of a point outside a rod somewhere on its way, m: the least over the way, found by thirds, as the
/// greater of two convex functions is convex. `axis` is the rod's, and the poses are of its middle.
fn rod_distance_m(
    [radius_m, half_m]: [f64; 2],
    axis: usize,
    from: [f64; 3],
    step: [f64; 3],
    point_m: [f64; 3],
) -> f64 {
    let outside = |share: f64| {
        let off: [f64; 3] = std::array::from_fn(|at| point_m[at] - from[at] - share * step[at]);
        let across = off[(axis + 1) % 3].hypot(off[(axis + 2) % 3]);
        (across - radius_m).max(off[axis].abs() - half_m)
    };
    // Far outside, or well within halfway there, it does not matter by how much.
    let reach_m = 0.5 * step.iter().map(|d| d * d).sum::<f64>().sqrt();
    let halfway_m = outside(0.5);
    if 2.0 * VOXEL_M < halfway_m - reach_m || halfway_m < -2.0 * VOXEL_M {
        return halfway_m;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..44 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if outside(a) < outside(b) {
            high = b;
        } else {
            low = a;
        }
    }
    [0.0, 0.5 * (low + high), 1.0]
        .map(outside)
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

/// Signed distance of a point outside a swept tool, m. Outside the edges of a blade it is the distance to the farthest
/// plane.
fn distance_m(shape: &ToolShape, from: Pose, to: Pose, point_m: [f64; 3]) -> f64 {
    let (from, to) = (from.position_m(), to.position_m());
    let sub =
        |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|axis| a[axis] - b[axis]) };
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let step = sub(to, from);
    match shape {
        ToolShape::Ball(ball) => {
            let way = sub(point_m, from);
            let mut share = if 0.0 < dot(step, step) {
                (dot(way, step) / dot(step, step)).clamp(0.0, 1.0)
            } else {
                0.0
            };
            if is_short(ball, step) {
                // The nearer of the two balls.
                share = share.round();
            }
            let off = sub(way, step.map(|d| d * share));
            dot(off, off).sqrt() - ball.radius_m()
        }
        ToolShape::Blade(blade) => {
            let half = [
                0.5 * blade.thickness_m(),
                0.5 * blade.width_m(),
                0.5 * blade.height_m(),
            ];
            let middle = std::array::from_fn(|axis| {
                0.5 * (from[axis] + to[axis]) + if axis == 2 { half[2] } else { 0.0 }
            });
            let lifted = |pose: [f64; 3]| [pose[0], pose[1], pose[2] + half[2]];
            // Half the width of the swept box seen along a normal, and of the box alone.
            let support = |normal: [f64; 3]| {
                normal
                    .iter()
                    .zip(half)
                    .map(|(n, h)| n.abs() * h)
                    .sum::<f64>()
            };
            let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let [x, y, z] = step;
            let askew = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]];
            let mut hull = f64::NEG_INFINITY;
            for normal in axes.into_iter().chain(askew) {
                let length = dot(normal, normal).sqrt();
                if length <= 0.0 {
                    continue;
                }
                let normal = normal.map(|n| n / length);
                let outside = dot(normal, sub(point_m, middle)).abs()
                    - support(normal)
                    - 0.5 * dot(normal, step).abs();
                hull = hull.max(outside);
            }
            // Outside an edge, a box by itself counts by its own planes.
            let alone = |pose: [f64; 3]| {
                axes.iter()
                    .map(|&axis| dot(axis, sub(point_m, lifted(pose))).abs() - support(axis))
                    .fold(f64::NEG_INFINITY, f64::max)
            };
            hull.min(alone(from)).min(alone(to))
        }
        ToolShape::Cylinder(cylinder) => {
            let half_m = 0.5 * cylinder.height_m();
            let middle = [from[0], from[1], from[2] + half_m];
            rod_distance_m([cylinder.radius_m(), half_m], 2, middle, step, point_m)
        }
        ToolShape::Loop(wire_loop) => {
            let wire_m = 0.5 * wire_loop.wire_diameter_m();
            let disc = [wire_loop.ring_radius_m() + wire_m, wire_m];
            rod_distance_m(disc, 0, from, step, point_m)
        }
    }
}

#[test]
fn a_bore_has_its_closed_form_volume() {
    // 0.5 mm voxels; a ball of 6.4 mm from well before the block to well past it.
    let mut clay = Clay::new(
        &Shape::Block {
            size_m: [0.064, 0.064, 0.064],
        },
        5e-4,
    )
    .unwrap();
    let radius_m = 6.4e-3;
    let sweep = Sweep {
        shape: ToolShape::ball(radius_m).unwrap(),
        from: Pose::quantise([-0.02, 0.0321, 0.0317]).unwrap(),
        to: Pose::quantise([0.084, 0.0321, 0.0317]).unwrap(),
    };
    clay.carve(&sweep);
    let cylinder_m3 = std::f64::consts::PI * radius_m * radius_m * 0.064;
    let error = clay.removed_volume_m3() / cylinder_m3 - 1.0;
    // The ramp's second moment adds h^2 / 3 to the mean square radius: 0.2 % here.
    assert!(error.abs() < 4e-3, "{error}");
}

#[test]
fn the_papers_blade_takes_its_width_times_its_depth() {
    let mut clay = Clay::new(&Shape::Stepped(SteppedBlock::paper()), 5e-4).unwrap();
    let y_m = 0.032;
    let sweep = Sweep {
        shape: ToolShape::paper_blade(),
        from: Pose::quantise([0.0, y_m, 0.010]).unwrap(),
        to: Pose::quantise([0.140, y_m, 0.010]).unwrap(),
    };
    clay.carve(&sweep);
    let cut_m3 = 0.010 * 0.030 * (0.01 + 0.02 + 0.03);
    let error = clay.removed_volume_m3() / cut_m3 - 1.0;
    assert!(error.abs() < 5e-3, "{error}");
}

#[test]
fn far_huge_and_empty_sweeps_are_harmless() {
    let mut clay = block();
    let blade = ToolShape::paper_blade();
    let ball = ToolShape::ball(0.5).unwrap();
    let at = |position_m| Pose::quantise(position_m).unwrap();
    let cylinder = ToolShape::Cylinder(Cylinder::new(0.004, 0.02).unwrap());
    let wire = ToolShape::Loop(WireLoop::new(0.008, 0.003).unwrap());
    for shape in [blade, ToolShape::ball(0.004).unwrap(), cylinder, wire] {
        for (from, to) in [
            (at([127.0; 3]), at([127.5; 3])),
            (at([-127.0, 0.0, 0.0]), at([-127.0, 0.0, 0.0])),
            (at([-127.0, 0.02, 1.0]), at([127.0, 0.02, 1.0])),
            (
                Pose::from_steps([i32::MIN; 3]),
                Pose::from_steps([i32::MIN, i32::MAX, i32::MAX]),
            ),
        ] {
            assert_eq!(clay.carve(&Sweep { shape, from, to }), 0);
        }
    }
    assert_eq!(clay.revision(), 0);
    // A ball of half a metre from a hundred metres away, through the block: nothing is left.
    let sweep = Sweep {
        shape: ball,
        from: at([-100.0, -90.0, 3.0]),
        to: at([100.0, 90.0, -3.0]),
    };
    assert_eq!(clay.carve(&sweep), clay.initial_units());
    assert_eq!(clay.remaining_units(), 0);
    for dense in 0..clay.grid().brick_count() as u32 {
        assert_eq!(
            clay.brick(clay.grid().brick_index(dense).unwrap()),
            BrickView::Empty
        );
    }
    assert_eq!(clay.carve(&sweep), 0);
}

#[test]
fn a_diagonal_through_the_largest_grid_agrees_with_itself() {
    let shape = Shape::Block {
        size_m: [1.024, 1.024, 0.512],
    };
    let mut forth = Clay::new(&shape, 1e-3).unwrap();
    let mut in_parts = Clay::new(&shape, 1e-3).unwrap();
    let ball = ToolShape::ball(0.0128).unwrap();
    let at = |share: f64| {
        Pose::quantise([1.1 * share - 0.04, 1.024 * share, 0.512 - 0.5 * share]).unwrap()
    };
    forth.carve(&Sweep {
        shape: ball,
        from: at(0.0),
        to: at(1.0),
    });
    for part in 0..64 {
        let share = |part: i32| f64::from(part) / 64.0;
        in_parts.carve(&Sweep {
            shape: ball,
            from: at(share(part)),
            to: at(share(part + 1)),
        });
    }
    let ratio = forth.removed_volume_m3() / in_parts.removed_volume_m3();
    assert!((ratio - 1.0).abs() < 1e-4, "{ratio}");
}

#[test]
fn a_tool_too_thin_for_the_voxels_is_named_as_such() {
    let clay = block();
    assert!(clay.admits(&ToolShape::paper_blade()).is_ok());
    let coarse = Clay::new(&Shape::Block { size_m: [0.05; 3] }, 1.5e-3).unwrap();
    assert!(coarse.admits(&ToolShape::paper_blade()).is_err());
    assert!(coarse.admits(&ToolShape::ball(1.5e-3).unwrap()).is_ok());
}
