//! How a hand takes hold of the handle with an Inverse3.
//!
//! With a grip that has a button, the handle is held while the button is down. Without one it is taken hold of where
//! the cursor comes into the home zone from outside and rests there for a second, and let go of where the cursor leaves
//! the workspace. An arm that lies at home by itself takes hold of nothing.

use super::message::Buttons;
use crate::exchange::Marks;

/// Radius of the home zone, m.
pub const ZONE_M: f64 = 0.02;
/// Rest is a way of no more than this, m,
const REST_M: f64 = 0.005;
/// in so long, ns.
const REST_NS: u64 = 1_000_000_000;
/// Radius of the workspace, m.
pub const WORKSPACE_M: f64 = 0.1;

/// What leads to taking hold.
#[derive(Clone, Copy, Debug, Default)]
pub struct Taking {
    /// Of the grip; `None` as long as no grip with a button was seen.
    buttons: Option<Buttons>,
    /// Whether the cursor has been outside of the home zone since it last took hold.
    was_outside: bool,
    is_beyond: bool,
    /// Where it rests, and since when.
    rest: Option<(u64, [f64; 3])>,
}

impl Taking {
    /// What a state means: displacement from home, m, and the buttons of the grip, if there is one.
    pub fn step(&mut self, now_ns: u64, place_m: [f64; 3], buttons: Option<Buttons>) -> Marks {
        if self.buttons.is_some() || buttons.is_some() {
            // A grip that is gone holds nothing down.
            return self.press(buttons.unwrap_or_default());
        }
        let is_beyond = WORKSPACE_M < length(place_m);
        let lets_go = is_beyond && !self.is_beyond;
        self.is_beyond = is_beyond;
        Marks {
            takes_hold: self.comes_to_rest(now_ns, place_m),
            lets_go,
            ..Marks::default()
        }
    }

    fn press(&mut self, now: Buttons) -> Marks {
        // What is down when a grip is first seen was pressed at nobody knows what.
        let before = self.buttons.replace(now).unwrap_or(now);
        Marks {
            takes_hold: now.a && !before.a,
            lets_go: !now.a && before.a,
            clutches: now.b && !before.b,
            unclutches: !now.b && before.b,
            wants_clay: now.c && !before.c,
        }
    }

    fn comes_to_rest(&mut self, now_ns: u64, place_m: [f64; 3]) -> bool {
        if ZONE_M < length(place_m) {
            self.was_outside = true;
            self.rest = None;
            return false;
        }
        let (since_ns, at_m) = *self.rest.get_or_insert((now_ns, place_m));
        let way = std::array::from_fn(|axis| place_m[axis] - at_m[axis]);
        if REST_M < length(way) {
            self.rest = Some((now_ns, place_m));
            return false;
        }
        let rests = REST_NS <= now_ns.saturating_sub(since_ns);
        rests && std::mem::take(&mut self.was_outside)
    }
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|part| part * part).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const AT_HOME: [f64; 3] = [0.001, 0.0, 0.0];

    fn for_a_while(taking: &mut Taking, from_ms: u64, place_m: [f64; 3]) -> Vec<Marks> {
        let steps = from_ms..from_ms + 1500;
        let marks = steps.map(|ms| taking.step(ms * MS, place_m, None));
        marks.filter(|marks| *marks != Marks::default()).collect()
    }

    #[test]
    fn an_arm_that_lies_at_home_takes_hold_of_nothing_and_one_that_comes_there_does_once() {
        let mut taking = Taking::default();
        assert_eq!(for_a_while(&mut taking, 0, AT_HOME), []);
        assert_eq!(for_a_while(&mut taking, 2000, [0.05, 0.0, 0.0]), []);
        let marks = for_a_while(&mut taking, 4000, AT_HOME);
        assert!(marks.len() == 1 && marks[0].takes_hold, "{marks:?}");
        assert_eq!(for_a_while(&mut taking, 6000, AT_HOME), []);
        let marks = for_a_while(&mut taking, 8000, [0.0, 0.0, 0.11]);
        assert!(marks.len() == 1 && marks[0].lets_go, "{marks:?}");
    }

    #[test]
    fn a_hand_that_passes_through_does_not_take_hold() {
        let mut taking = Taking::default();
        for ms in 0..3000_u64 {
            let x = 0.03 * (ms as f64 * 0.01).sin();
            let marks = taking.step(ms * MS, [x, 0.0, 0.0], None);
            assert_eq!(marks, Marks::default());
        }
    }

    #[test]
    fn a_button_holds_while_it_is_down_and_a_grip_that_is_gone_lets_go() {
        let mut taking = Taking::default();
        let pressed = Buttons {
            a: true,
            ..Buttons::default()
        };
        let mut step = |buttons| taking.step(0, AT_HOME, buttons);
        assert_eq!(
            step(Some(pressed)),
            Marks::default(),
            "down before it was seen"
        );
        step(Some(Buttons::default()));
        assert!(step(Some(pressed)).takes_hold);
        assert_eq!(step(Some(pressed)), Marks::default());
        assert!(step(None).lets_go);
        assert!(step(Some(pressed)).takes_hold);
        assert!(step(Some(Buttons::default())).lets_go);
    }
}
