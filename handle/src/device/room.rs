//! Where a cutting operator has room to move the handle.

use teleclay_operator::Reach;
use teleclay_proto::ToolDescription;

use super::DeviceSetup;

/// Strokes of a cutting operator reach this far to either side of home, m, where there is room: two thirds of the
/// default block, so that walls stay standing and the picture shows what was cut.
const STROKE_M: f64 = 0.045;
/// And across the strokes.
const ACROSS_M: f64 = 0.018;
/// The deepest level lies this far below home: five levels, a third of the default block.
const DEPTH_M: f64 = 0.020;
/// What stays of the block below the deepest level, m.
const FLOOR_M: f64 = 0.004;
/// A room narrower than this is none, m: two voxels of the default block.
const LEAST_ROOM_M: f64 = 0.001;

/// The room for cutting strokes, as displacement of the handle: the default one, or what the tool's reach and the block
/// leave of it. The tool stays half its width away from the block's sides, when its home lies over the block at all.
pub(super) fn cutting_room(setup: &DeviceSetup) -> Reach {
    let [half_x_m, half_y_m, below_m] = half_extent_m(&setup.tool);
    let [least, greatest] = setup.reach_m;
    let [x, y, z] = setup.home_m;
    let block = setup.block_m;
    let to_sides = |axis: usize, home: f64, half: f64| {
        let within_reach = (home - least[axis]).min(greatest[axis] - home);
        let over_block = home.min(block[axis] - home);
        if over_block <= half {
            within_reach
        } else {
            within_reach.min(over_block - half)
        }
    };
    let down = (z - least[2]).min((z - below_m - FLOOR_M).max(LEAST_ROOM_M));
    let room =
        |default: f64, tool_m: f64| default.min(tool_m / setup.position_ratio).max(LEAST_ROOM_M);
    Reach {
        x_m: room(STROKE_M, to_sides(0, x, half_x_m)),
        y_m: room(ACROSS_M, to_sides(1, y, half_y_m)),
        depth_m: room(DEPTH_M, down),
    }
}

/// How far the full deflection of a stick moves the handle to either side of home: over the block to its edges, or to
/// its floor, as far as the tool's reach goes.
pub(super) fn stick_room_m(setup: &DeviceSetup) -> [f64; 3] {
    let [least, greatest] = setup.reach_m;
    let home = setup.home_m;
    std::array::from_fn(|axis| {
        let within_reach = (home[axis] - least[axis]).min(greatest[axis] - home[axis]);
        let to_edge = home[axis]
            .abs()
            .max((setup.block_m[axis] - home[axis]).abs());
        let tool_m = within_reach.min(to_edge).max(LEAST_ROOM_M);
        tool_m / setup.position_ratio
    })
}

/// How far the tool reaches from its position: to either side along x and y, and down.
fn half_extent_m(tool: &ToolDescription) -> [f64; 3] {
    let [x_m, y_m] = tool.beside_position_m();
    [x_m, y_m, tool.below_position_m()]
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// The default block and ball.
    pub(in crate::device) fn carving() -> DeviceSetup {
        DeviceSetup {
            tick_s: 1e-3,
            axes: teleclay_proto::Axes::Two,
            position_ratio: 1.0,
            home_m: [0.064, 0.032, 0.064 + 0.0064],
            reach_m: [[-0.1, -0.1, -0.1], [0.25, 0.2, 0.2]],
            tool: ToolDescription::Ball { radius_m: 0.0064 },
            block_m: [0.128, 0.064, 0.064],
            handle_damping_n_s_per_m: 10.0,
        }
    }

    #[test]
    fn the_default_block_gives_the_default_room() {
        assert_eq!(
            cutting_room(&carving()),
            Reach {
                x_m: 0.045,
                y_m: 0.018,
                depth_m: 0.020
            }
        );
    }

    #[test]
    fn a_stick_reaches_the_edges_of_the_block_and_no_farther_than_the_tool() {
        let room = stick_room_m(&carving());
        for (got, want) in room.into_iter().zip([0.064, 0.032, 0.0704]) {
            assert!((got - want).abs() < 1e-12, "{room:?}");
        }
        let near = DeviceSetup {
            reach_m: [[0.034, 0.0, 0.06], [0.25, 0.2, 0.2]],
            position_ratio: 2.0,
            ..carving()
        };
        let room = stick_room_m(&near);
        for (got, want) in room.into_iter().zip([0.015, 0.016, 0.0052]) {
            assert!((got - want).abs() < 1e-12, "{room:?}");
        }
    }

    #[test]
    fn a_small_block_keeps_its_walls_and_its_floor() {
        let small = DeviceSetup {
            block_m: [0.064, 0.032, 0.020],
            home_m: [0.032, 0.016, 0.0264],
            ..carving()
        };
        let room = cutting_room(&small);
        let close =
            |got: f64, want: f64| assert!((got - want).abs() < 1e-12, "{got}, wanted {want}");
        close(room.x_m, 0.032 - 0.0064);
        close(room.y_m, 0.016 - 0.0064);
        close(room.depth_m, 0.0264 - 0.0064 - 0.004);
    }

    #[test]
    fn the_reach_bounds_the_room_and_the_ratio_scales_it() {
        let near = DeviceSetup {
            reach_m: [[0.034, 0.0, 0.06], [0.25, 0.2, 0.2]],
            position_ratio: 2.0,
            ..carving()
        };
        let room = cutting_room(&near);
        assert!((room.x_m - 0.015).abs() < 1e-12, "{room:?}");
        assert!((room.depth_m - 0.0104 / 2.0).abs() < 1e-12, "{room:?}");
    }
}
