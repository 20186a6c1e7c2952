//! Cylinder and loop: swept volumes and engaged areas against closed forms, and nothing left standing behind them.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use teleclay_clay::{
    Clay, ContactState, Cylinder, Material, Motion, Pose, Shape, Sweep, Tool, ToolShape, WireLoop,
};

const VOXEL_M: f64 = 5e-4;
const EDGE_M: f64 = 0.064;

fn at(position_m: [f64; 3]) -> Pose {
    Pose::quantise(position_m).unwrap()
}

fn cube() -> Clay {
    let shape = Shape::Block {
        size_m: [EDGE_M; 3],
    };
    Clay::new(&shape, VOXEL_M).unwrap()
}

fn cylinder(radius_m: f64, height_m: f64) -> ToolShape {
    ToolShape::Cylinder(Cylinder::new(radius_m, height_m).unwrap())
}

fn wire_loop(ring_radius_m: f64, wire_diameter_m: f64) -> ToolShape {
    ToolShape::Loop(WireLoop::new(ring_radius_m, wire_diameter_m).unwrap())
}

/// What a sweep removes from the cube, m³.
fn removed_m3(shape: ToolShape, from_m: [f64; 3], to_m: [f64; 3]) -> f64 {
    let mut clay = cube();
    let (from, to) = (at(from_m), at(to_m));
    clay.carve(&Sweep { shape, from, to });
    clay.removed_volume_m3()
}

fn assert_near(got: f64, want: f64, error: f64, what: &str) {
    assert!(
        (got / want - 1.0).abs() <= error,
        "{what}: {got}, wanted {want} within {error}"
    );
}

/// The ramp's second moment adds `h^2 / 3` to the mean square radius: 0.3 % at 9 voxels.
#[test]
fn a_cylinder_drills_its_section_and_mills_its_width() {
    let (radius_m, height_m) = (0.0064, 0.0203);
    let end_mill = cylinder(radius_m, height_m);
    // Down along its axis, off the voxels, to a depth of 30.3 mm.
    let [x_m, y_m] = [0.0321, 0.0317];
    let bottom_m = EDGE_M - 0.0303;
    let drilled_m3 = removed_m3(end_mill, [x_m, y_m, 0.08], [x_m, y_m, bottom_m]);
    assert_near(
        drilled_m3,
        PI * radius_m * radius_m * 0.0303,
        6e-3,
        "drilled",
    );
    // Across it, from wall to wall, 10 mm deep.
    let depth_m = 0.01;
    let z_m = EDGE_M - depth_m;
    for (from_m, to_m) in [
        ([-0.02, y_m, z_m], [0.09, y_m, z_m]),
        ([x_m, 0.09, z_m], [x_m, -0.02, z_m]),
    ] {
        let milled_m3 = removed_m3(end_mill, from_m, to_m);
        assert_near(milled_m3, 2.0 * radius_m * depth_m * EDGE_M, 5e-3, "milled");
    }
    // Wholly inside, by a stadium, and by a slanting way: the hull of two upright rods has this volume whatever the
    // slant, by Cavalieri: its section across z is the disc, moved by as much as the way has gone meanwhile.
    let (from_m, to_m) = ([0.02, 0.024, 0.02], [0.041, 0.037, 0.02]);
    let way_m = f64::hypot(0.021, 0.013);
    let stadium_m2 = PI * radius_m * radius_m + 2.0 * radius_m * way_m;
    let got_m3 = removed_m3(end_mill, from_m, to_m);
    assert_near(got_m3, stadium_m2 * height_m, 5e-3, "a stadium");
    let rise_m = 0.0151;
    let slanted_m3 = removed_m3(end_mill, from_m, [0.041, 0.037, 0.02 + rise_m]);
    // Minkowski sum of rod and segment: the rod, its section times the rise, and its outline times the way across it.
    let want_m3 =
        PI * radius_m * radius_m * (height_m + rise_m) + 2.0 * radius_m * way_m * height_m;
    assert_near(slanted_m3, want_m3, 5e-3, "slanted");
}

#[test]
fn a_loop_takes_away_the_ribbon_that_passes_through_it() {
    let (ring_m, wire_m) = (0.0085, 0.0021);
    let tool = wire_loop(ring_m, wire_m);
    let disc_m = ring_m + 0.5 * wire_m;
    let [y_m, z_m] = [0.0321, 0.0317];
    let ribbon_m3 = removed_m3(tool, [-0.02, y_m, z_m], [0.09, y_m, z_m]);
    assert_near(ribbon_m3, PI * disc_m * disc_m * EDGE_M, 4e-3, "a ribbon");
    // Half of it out of the block: half a ribbon.
    let half_m3 = removed_m3(tool, [-0.02, y_m, EDGE_M], [0.09, y_m, EDGE_M]);
    assert_near(
        half_m3,
        0.5 * PI * disc_m * disc_m * EDGE_M,
        4e-3,
        "half a ribbon",
    );
    // Edgewise it opens a slot of the wire's thickness.
    let slot_m3 = removed_m3(tool, [0.0321, -0.02, z_m], [0.0321, 0.09, z_m]);
    assert_near(slot_m3, 2.0 * disc_m * wire_m * EDGE_M, 8e-3, "a slot");
}

/// Wherever the middle of the solid has passed by more than the ramp, nothing is left.
#[test]
fn nothing_stands_behind_a_fast_sweep() {
    for (shape, depth) in [
        (cylinder(0.0032, 0.011), [0.0, 0.0, 0.5 * 0.011]),
        (cylinder(0.0011, 0.011), [0.0, 0.0, 0.5 * 0.011]),
        (wire_loop(0.006, 0.0011), [0.0; 3]),
    ] {
        for way_m in [
            [0.05, 0.0, 0.0],
            [0.0, 0.0, 0.045],
            [0.05, 0.04, 0.03],
            [0.003, -0.02, 0.045],
            [-0.05, 0.0007, -0.001],
            [0.05, 0.03, 0.0003],
        ] {
            let mut clay = cube();
            let from_m: [f64; 3] = std::array::from_fn(|axis| 0.5 * (EDGE_M - way_m[axis]));
            let to_m: [f64; 3] = std::array::from_fn(|axis| from_m[axis] + way_m[axis]);
            let (from, to) = (at(from_m), at(to_m));
            clay.carve(&Sweep { shape, from, to });
            for step in 0..=4000 {
                let share = f64::from(step) / 4000.0;
                let voxel: [i32; 3] = std::array::from_fn(|axis| {
                    let place_m = from_m[axis] + share * way_m[axis] + depth[axis];
                    (place_m / VOXEL_M) as i32
                });
                // A voxel's centre is up to half its diagonal from the way, so a little of a thin tool's ramp is left.
                let left = clay.occupancy(voxel);
                assert!(left <= 100, "{shape:?} {way_m:?} {voxel:?}: {left}");
            }
        }
    }
}

/// In one sweep, in ten and in a thousand the same is cut, but for rounding.
#[test]
fn a_straight_way_may_be_cut_in_parts() {
    for shape in [cylinder(0.005, 0.012), wire_loop(0.006, 0.002)] {
        for to_m in [
            [0.05, 0.047, 0.035],
            [0.05, 0.012, 0.02],
            [0.012, 0.013, 0.04],
        ] {
            let from_m = [0.01, 0.012, 0.02];
            let mut whole = cube();
            let (from, to) = (at(from_m), at(to_m));
            whole.carve(&Sweep { shape, from, to });
            for parts in [10, 1000] {
                let mut clay = cube();
                let place = |part: u32| {
                    let share = f64::from(part) / f64::from(parts);
                    at(std::array::from_fn(|axis| {
                        from_m[axis] + share * (to_m[axis] - from_m[axis])
                    }))
                };
                for part in 0..parts {
                    let (from, to) = (place(part), place(part + 1));
                    clay.carve(&Sweep { shape, from, to });
                }
                let (a, b) = (clay.removed_volume_m3(), whole.removed_volume_m3());
                assert_near(a, b, 2e-4, &format!("{shape:?} {to_m:?} in {parts}"));
            }
        }
    }
}

/// Areas over some voxels of a way that is well under way.
fn areas_m2(shape: ToolShape, middle_m: [f64; 3], direction: [f64; 3]) -> Vec<f64> {
    let mut clay = cube();
    let tool = Tool::new(shape);
    let (material, mut contact) = (Material::default(), ContactState::default());
    let place = |way_m: f64| {
        at(std::array::from_fn(|axis| {
            middle_m[axis] + way_m * direction[axis]
        }))
    };
    clay.carve(&Sweep {
        shape,
        from: place(-0.03),
        to: place(0.0),
    });
    let step_m = 0.23 * VOXEL_M;
    (0..40_u32)
        .map(|tick| {
            let (from, to) = (
                place(f64::from(tick) * step_m),
                place(f64::from(tick + 1) * step_m),
            );
            let velocity_m_s = direction.map(|d| d * step_m / 1e-3);
            let motion = Motion::new(from, to, velocity_m_s).unwrap();
            clay.work(&tool, &material, &motion, &mut contact);
            clay.engaged_area_m2(&tool, to, direction)
        })
        .collect()
}

fn assert_area(areas_m2: &[f64], want_m2: f64, error: f64, what: &str) {
    for &area_m2 in areas_m2 {
        assert_near(area_m2, want_m2, error, what);
    }
}

#[test]
fn a_cylinder_in_clay_is_felt_by_its_outline() {
    let (radius_m, height_m) = (0.0064, 0.0203);
    let tool = cylinder(radius_m, height_m);
    let middle_m = [0.0321, 0.0317, 0.0203];
    for direction in [
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0],
        [0.8, -0.6, 0.0],
    ] {
        // Wholly in the clay, and as an end mill at three depths of cut.
        let want_m2 = 2.0 * radius_m * height_m;
        assert_area(
            &areas_m2(tool, middle_m, direction),
            want_m2,
            0.01,
            "inside",
        );
        for depth_m in [0.005, 0.010, 0.0153] {
            let at_depth_m = [0.0321, 0.0317, EDGE_M - depth_m];
            let areas_m2 = areas_m2(tool, at_depth_m, direction);
            let what = format!("{depth_m} m deep, {direction:?}");
            assert_area(&areas_m2, 2.0 * radius_m * depth_m, 0.03, &what);
        }
    }
    // Plunging: its end.
    let down = [0.0, 0.0, -1.0];
    assert_area(
        &areas_m2(tool, middle_m, down),
        PI * radius_m * radius_m,
        0.01,
        "down",
    );
    let askew = [0.48, 0.64, 0.6];
    let want_m2 = 2.0 * radius_m * height_m * 0.8 + PI * radius_m * radius_m * 0.6;
    assert_area(&areas_m2(tool, middle_m, askew), want_m2, 0.02, "askew");
}

#[test]
fn a_loop_in_clay_is_felt_by_its_wire_alone() {
    for (ring_m, wire_m) in [(0.0085, 0.0021), (0.012, 0.0011), (0.0085, 0.006)] {
        let tool = wire_loop(ring_m, wire_m);
        let middle_m = [0.0321, 0.0317, 0.0323];
        // Drawn flat: the ring of the wire, not the disc that goes.
        let flat_m2 = 2.0 * PI * ring_m * wire_m;
        for ahead in [1.0, -1.0] {
            let areas_m2 = areas_m2(tool, middle_m, [ahead, 0.0, 0.0]);
            assert_area(
                &areas_m2,
                flat_m2,
                0.015,
                &format!("flat {ring_m} {wire_m}"),
            );
        }
        // Edgewise: what the wire's front shows, a bar with round ends; its rear runs in the slot.
        let edgewise_m2 = 2.0 * ring_m * wire_m + 0.25 * PI * wire_m * wire_m;
        for direction in [
            [0.0, 1.0, 0.0],
            [0.0, 0.0, -1.0],
            [0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2],
        ] {
            let areas_m2 = areas_m2(tool, middle_m, direction);
            let what = format!("edgewise {ring_m} {wire_m} {direction:?}");
            assert_area(&areas_m2, edgewise_m2, 0.03, &what);
        }
    }
}

#[test]
fn a_loop_half_sunk_is_felt_by_half_its_wire() {
    let (ring_m, wire_m) = (0.0085, 0.0021);
    let tool = wire_loop(ring_m, wire_m);
    let areas_m2 = areas_m2(tool, [0.0321, 0.0317, EDGE_M], [1.0, 0.0, 0.0]);
    assert_area(&areas_m2, PI * ring_m * wire_m, 0.03, "half sunk");
}
