//! Tells when a robot comes to its fence and when it is clear of it again.

use teleclay_operator::RobotState;

use crate::event::Event;

/// A hand that works along the fence touches it again and again; it is clear once it has not for this long, ns.
const CLEAR_AFTER_NS: u64 = 500_000_000;

/// Watches how near a robot is to its fence; holds what was told last.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SingularityMonitor {
    /// The time of the last tick at the fence, while that has been told.
    held_at_ns: Option<u64>,
}

impl SingularityMonitor {
    /// What one tick of a robot gives to tell.
    pub(crate) fn watch(&mut self, at_ns: u64, robot: &RobotState) -> Option<Event> {
        if robot.is_held {
            let was_told = self.held_at_ns.replace(at_ns).is_some();
            return (!was_told).then_some(Event::AtFence {
                nearest: robot.nearest,
                clearance: robot.clearance,
            });
        }
        self.held_at_ns
            .take_if(|held_at_ns| CLEAR_AFTER_NS < at_ns.saturating_sub(*held_at_ns))
            .map(|_| Event::ClearOfFence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use teleclay_operator::Singularity;

    #[test]
    fn coming_to_the_fence_is_told_once_and_leaving_it_after_a_while() {
        let mut robot = RobotState {
            joints_rad: [0.5; 3],
            rates_rad_s: [0.0; 3],
            torques_n_m: [0.0; 3],
            clearance: 0.42,
            nearest: Singularity::Serial { arm: 2 },
            is_held: false,
            is_slowed: false,
            is_overpowered: false,
        };
        let mut monitor = SingularityMonitor::default();
        let mut told = Vec::new();
        for ms in 0..4_000_u64 {
            // Along the fence for two seconds, with gaps; then away.
            robot.is_held = (100..2_000).contains(&ms) && ms % 400 < 300;
            if let Some(event) = monitor.watch(ms * 1_000_000, &robot) {
                told.push((ms, event.to_string()));
            }
        }
        assert_eq!(told.len(), 2, "{told:?}");
        assert_eq!(told[0].0, 100);
        assert!(
            told[0].1.contains("arm 2 is stretched or folded") && told[0].1.contains("0.42"),
            "{told:?}"
        );
        assert_eq!(told[1].0, 1_899 + 501);
    }
}
