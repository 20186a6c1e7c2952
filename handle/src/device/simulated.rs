//! The handle of \[KHMH03\] in software, held by somebody who follows an intent.

use teleclay_operator::{Axes, DeviceSample, Reach, SimulatedHandle};
use teleclay_proto::ToolDescription;

use super::{Device, DeviceCommand, DeviceError, DeviceRequest, Workplace};
use crate::intent::Wish;

/// Strokes of a cutting operator reach this far to either side of home, m, where there is room: two thirds of the default block, so that
/// walls stay standing and the picture shows what was cut.
const STROKE_M: f64 = 0.045;
/// And across the strokes.
const ACROSS_M: f64 = 0.018;
/// The deepest level lies this far below home: five levels, a third of the default block.
const DEPTH_M: f64 = 0.020;
/// What stays of the block below the deepest level, m.
const FLOOR_M: f64 = 0.004;
/// A room narrower than this is none, m: two voxels of the default block.
const LEAST_ROOM_M: f64 = 0.001;

/// A simulated handle, and its operator's wish for fresh clay after each finished round of cutting.
#[derive(Debug)]
pub struct SimulatedDevice {
    handle: SimulatedHandle,
    rounds_asked_for: u64,
}

impl SimulatedDevice {
    /// A handle at rest at home.
    ///
    /// # Errors
    /// The intent cannot be had in this workplace, or the tick is no sample time.
    pub fn new(wish: &Wish, workplace: &Workplace) -> Result<Self, DeviceError> {
        let axes = match workplace.axes {
            teleclay_proto::Axes::Two => Axes::Two,
            teleclay_proto::Axes::Three => Axes::Three,
        };
        let intent = wish.intent(cutting_room(workplace))?;
        Ok(Self {
            handle: SimulatedHandle::new(axes, workplace.tick_s, intent)?,
            rounds_asked_for: 0,
        })
    }
}

impl Device for SimulatedDevice {
    fn name(&self) -> &str {
        "simulated"
    }

    fn sample(&mut self) -> Result<DeviceSample, DeviceError> {
        Ok(self.handle.sample())
    }

    fn command(&mut self, command: &DeviceCommand) -> Result<(), DeviceError> {
        self.handle.command(command.position_m);
        Ok(())
    }

    fn poll_request(&mut self) -> Option<DeviceRequest> {
        let finished = self.handle.finished_rounds();
        if finished <= self.rounds_asked_for {
            return None;
        }
        self.rounds_asked_for = finished;
        Some(DeviceRequest::FreshClay)
    }
}

/// The room for cutting strokes, as displacement of the handle: the default one, or what the tool's reach and the block leave of it. The
/// tool stays half its width away from the block's sides, when its home lies over the block at all.
fn cutting_room(workplace: &Workplace) -> Reach {
    let [half_x_m, half_y_m, below_m] = half_extent_m(&workplace.tool);
    let [least, greatest] = workplace.reach_m;
    let [x, y, z] = workplace.home_m;
    let block = workplace.block_m;
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
    let room = |default: f64, tool_m: f64| {
        default
            .min(tool_m / workplace.position_ratio)
            .max(LEAST_ROOM_M)
    };
    Reach {
        x_m: room(STROKE_M, to_sides(0, x, half_x_m)),
        y_m: room(ACROSS_M, to_sides(1, y, half_y_m)),
        depth_m: room(DEPTH_M, down),
    }
}

/// How far the tool reaches from its position: to either side along x and y, and down.
fn half_extent_m(tool: &ToolDescription) -> [f64; 3] {
    match *tool {
        ToolDescription::Ball { radius_m } => [radius_m; 3],
        ToolDescription::Blade {
            width_m,
            thickness_m,
            ..
        } => [thickness_m / 2.0, width_m / 2.0, 0.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn carving() -> Workplace {
        Workplace {
            tick_s: 1e-3,
            axes: teleclay_proto::Axes::Two,
            position_ratio: 1.0,
            home_m: [0.064, 0.032, 0.064 + 0.0064],
            reach_m: [[-0.1, -0.1, -0.1], [0.25, 0.2, 0.2]],
            tool: ToolDescription::Ball { radius_m: 0.0064 },
            block_m: [0.128, 0.064, 0.064],
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
    fn a_small_block_keeps_its_walls_and_its_floor() {
        let small = Workplace {
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
        let near = Workplace {
            reach_m: [[0.034, 0.0, 0.06], [0.25, 0.2, 0.2]],
            position_ratio: 2.0,
            ..carving()
        };
        let room = cutting_room(&near);
        assert!((room.x_m - 0.015).abs() < 1e-12, "{room:?}");
        assert!((room.depth_m - 0.0104 / 2.0).abs() < 1e-12, "{room:?}");
    }

    #[test]
    fn no_workplace_leaves_no_room_at_all() {
        let cramped = Workplace {
            reach_m: [[0.0; 3], [0.0; 3]],
            home_m: [0.0; 3],
            tool: ToolDescription::Ball { radius_m: 0.1 },
            ..carving()
        };
        assert!(SimulatedDevice::new(&Wish::Cutting, &cramped).is_ok());
    }

    #[test]
    fn a_finished_round_asks_once_for_fresh_clay() {
        let mut device = SimulatedDevice::new(&Wish::Cutting, &carving()).unwrap();
        let round_s = Wish::Cutting
            .intent(cutting_room(&carving()))
            .unwrap()
            .round_s()
            .unwrap();
        let mut asked_at_s = Vec::new();
        for tick in 0..(2.5 * round_s / 1e-3) as u32 {
            device.command(&DeviceCommand::default()).unwrap();
            if device.poll_request() == Some(DeviceRequest::FreshClay) {
                asked_at_s.push(f64::from(tick + 1) * 1e-3);
            }
        }
        assert_eq!(asked_at_s.len(), 2, "{asked_at_s:?}");
        assert!(
            (asked_at_s[0] - round_s).abs() < 2e-3 && (asked_at_s[1] - 2.0 * round_s).abs() < 2e-3
        );
    }
}
