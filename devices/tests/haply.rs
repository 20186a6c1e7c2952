//! The protocol of the Haply Inverse Service against a stand-in that is written from its public messages, on virtual
//! time and without a socket.

#![allow(
    clippy::float_cmp,
    reason = "what is passed on is compared to the last bit, and no force is exactly none"
)]

use proptest::prelude::*;
use serde_json::{Value, json};
use teleclay_devices::haply::{End, Law, Machine};

const MS: u64 = 1_000_000;

/// What the stand-in tells of the force's spelling by the kind of its inventory.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Version {
    Old,
    New,
}

/// The service: an inventory once, a state for each message. Takes forces in either spelling.
struct Service {
    version: Version,
    position_m: [f64; 3],
    /// The motors' force, and how often each spelling was used.
    force_n: [f64; 3],
    vectors: u32,
    values: u32,
    profile: Option<String>,
}

impl Service {
    fn new(version: Version) -> Self {
        Self {
            version,
            position_m: [0.0, -0.12, 0.16],
            force_n: [f64::NAN; 3],
            vectors: 0,
            values: 0,
            profile: None,
        }
    }

    fn device(&self) -> Value {
        let [x, y, z] = self.position_m;
        json!({
            "device_id": "049D",
            "state": {
                "cursor_position": { "x": x, "y": y, "z": z },
                "cursor_velocity": { "x": 0.0, "y": 0.0, "z": 0.0 },
                "control_mode": "force"
            },
            "status": { "calibrated": true, "in_use": true, "power_supply": true, "ready": true, "started": true }
        })
    }

    fn inventory(&self) -> Value {
        let mut device = self.device();
        device["config"] = json!({ "type": "inverse3", "port": "COM12", "handedness": "right" });
        let mut inventory = json!({ "verse_grip": [], "wireless_verse_grip": [] });
        if self.version == Version::New {
            device["config"]["preset"] = json!("defaults");
            device["config"]["filters"] =
                json!({ "force_gate": { "gain": 0.3 }, "damping": { "scalar": 2.0 } });
            inventory["session_id"] = json!(7);
        }
        inventory["inverse3"] = json!([device]);
        inventory
    }

    fn state(&self) -> Value {
        json!({ "inverse3": [self.device()] })
    }

    fn take(&mut self, text: &str) {
        let told: Value = serde_json::from_str(text).unwrap();
        if let Some(name) = told.pointer("/session/configure/profile/name") {
            self.profile = name.as_str().map(str::to_owned);
        }
        assert_eq!(told["inverse3"][0]["device_id"], "049D");
        let command = &told["inverse3"][0]["commands"]["set_cursor_force"];
        let force = match (command.get("vector"), command.get("values")) {
            (Some(vector), None) => {
                self.vectors += 1;
                vector
            }
            (None, Some(values)) => {
                self.values += 1;
                values
            }
            _ => panic!("{told}"),
        };
        self.force_n = ["x", "y", "z"].map(|axis| force[axis].as_f64().unwrap());
    }
}

/// Machine and service on one clock, the answer a quarter of a millisecond after the question.
struct Bench {
    machine: Machine,
    service: Service,
    now_ns: u64,
    exchanges: u64,
}

impl Bench {
    fn new(version: Version) -> Self {
        let mut bench = Self {
            machine: Machine::default(),
            service: Service::new(version),
            now_ns: 0,
            exchanges: 0,
        };
        let inventory = bench.service.inventory().to_string();
        bench.machine.handle_message(0, inventory.as_bytes());
        assert_eq!(bench.machine.why(), None);
        bench
    }

    fn ask(&mut self, force_n: [f64; 3]) -> bool {
        let asked = self.machine.poll(self.now_ns, force_n);
        if let Some(text) = &asked {
            self.service.take(text);
        }
        asked.is_some()
    }

    fn answer(&mut self, state: &Value) {
        let text = state.to_string();
        self.machine.handle_message(self.now_ns, text.as_bytes());
    }

    fn exchange(&mut self, force_n: [f64; 3]) {
        assert!(self.ask(force_n), "a message is due");
        assert!(!self.ask(force_n), "one message, one answer");
        self.now_ns += MS / 4;
        let state = self.service.state();
        self.answer(&state);
        self.exchanges += 1;
        self.now_ns += 3 * MS / 4;
    }

    /// The stated end, with nothing left in the motors.
    fn ends(&mut self, end: &End) {
        assert_eq!(self.machine.why(), Some(end));
        self.ask([5.0, 5.0, 5.0]);
        assert_eq!(self.service.force_n, [0.0; 3], "{end:?}");
        assert!(!self.ask([5.0, 5.0, 5.0]), "nothing follows the end");
        self.answer(&json!({ "inverse3": [] }));
        assert_eq!(self.machine.why(), Some(end), "an end is an end");
    }
}

fn pushed(version: Version) -> Bench {
    let mut bench = Bench::new(version);
    for _ in 0..10 {
        bench.exchange([1.0, -2.0, 0.5]);
    }
    assert_eq!(bench.service.force_n, [1.0, -2.0, 0.5]);
    bench
}

#[test]
fn a_minute_at_a_thousand_exchanges_a_second_in_either_spelling() {
    for version in [Version::Old, Version::New] {
        let mut bench = Bench::new(version);
        let mut heard = 0_u64;
        for step in 0..60_000_u64 {
            let x_m = 0.05 * (step as f64 * 1e-3).sin();
            bench.service.position_m[0] = x_m;
            let force_n = [-20.0 * x_m, 0.25, 0.0];
            bench.exchange(force_n);
            let news = bench.machine.take_news().unwrap();
            assert!((news.position_m[0] - x_m).abs() < 1e-12);
            assert!(news.position_m[1].abs() < 1e-12 && news.position_m[2].abs() < 1e-12);
            // The first message asks for a state, and gives no force before one is known.
            assert_eq!(
                bench.service.force_n,
                if step == 0 { [0.0; 3] } else { force_n }
            );
            heard += 1;
        }
        assert_eq!((heard, bench.now_ns), (60_000, 60_000 * MS));
        let spelled = (bench.service.vectors, bench.service.values);
        let profile = bench.service.profile.as_deref();
        match version {
            Version::New => {
                assert_eq!((spelled, profile), ((60_000, 0), Some("teleclay:handle")));
            }
            Version::Old => assert_eq!((spelled, profile), ((0, 60_000), None)),
        }
        assert_eq!(
            bench.machine.close().map(|text| bench.service.take(&text)),
            Some(())
        );
        assert_eq!(bench.service.force_n, [0.0; 3]);
    }
}

#[test]
fn what_the_service_does_to_a_force_is_said() {
    let law = Bench::new(Version::New).machine.law().unwrap();
    let want = Law {
        force_gate_gain: Some(0.3),
        damping_n_s_per_m: Some(2.0),
    };
    assert_eq!(law, want);
    let said = law.sentences();
    assert!(
        said[0].contains("gain 0.3") && said[1].contains("2 N·s/m"),
        "{said:?}"
    );
    let old = Bench::new(Version::Old).machine.law().unwrap();
    assert_eq!(old.sentences(), Vec::<String>::new());
}

#[test]
fn a_service_that_would_drive_the_hand_is_not_joined() {
    for (pointer, value) in [
        ("/inverse3/0/config/filters/damping/scalar", -0.5),
        ("/inverse3/0/config/filters/force_gate/gain", 3.0),
    ] {
        let mut inventory = Service::new(Version::New).inventory();
        *inventory.pointer_mut(pointer).unwrap() = json!(value);
        let mut machine = Machine::default();
        machine.handle_message(0, inventory.to_string().as_bytes());
        assert!(matches!(machine.why(), Some(End::BadLaw(_))), "{pointer}");
        assert_eq!(machine.poll(0, [1.0; 3]), None, "it was given no force yet");
    }
}

#[test]
fn an_inventory_without_a_device_or_with_one_that_cannot_be_used_is_an_end_in_words() {
    let said = |inventory: &Value| {
        let mut machine = Machine::default();
        machine.handle_message(0, inventory.to_string().as_bytes());
        machine.why().map(ToString::to_string).unwrap_or_default()
    };
    assert_eq!(
        said(&json!({ "session_id": 1 })),
        "the service knows of no Inverse3"
    );
    for (field, what) in [
        ("power_supply", "its motors have no power"),
        ("calibrated", "it is not calibrated"),
        ("ready", "the service says that it is not ready"),
    ] {
        let mut inventory = Service::new(Version::New).inventory();
        inventory["inverse3"][0]["status"][field] = json!(false);
        assert_eq!(said(&inventory), format!("it cannot be used: {what}"));
    }
    let mut machine = Machine::default();
    assert_eq!(
        machine.poll(5 * MS, [1.0; 3]),
        None,
        "before the inventory nothing is said"
    );
    assert_eq!(machine.poll(2005 * MS, [1.0; 3]), None);
    assert_eq!(machine.why(), Some(&End::NoInventory));
}

#[test]
fn a_device_that_is_gone_from_the_states_is_unplugged() {
    let mut bench = pushed(Version::New);
    bench.ask([1.0, 0.0, 0.0]);
    bench.answer(&json!({ "inverse3": [] }));
    bench.ends(&End::Unplugged);
}

#[test]
fn events_end_what_they_are_about() {
    let event = |name: &str, device_id: &str, safety: Option<&str>, level: &str| {
        json!({
            "name": name,
            "category": "device",
            "level": level,
            "data": { "device_family": "inverse", "device_id": device_id, "safety_type": safety },
            "message": "as it says"
        })
    };
    let safety = "device-safety-triggered";
    for (event, end) in [
        (
            event(safety, "049D", Some("ebrake_triggered"), "error"),
            End::Brake,
        ),
        (
            event(safety, "049D", Some("stall_detected"), "warning"),
            End::Stall,
        ),
        (
            event("device-disconnected", "049D", None, "warning"),
            End::Unplugged,
        ),
        (event("device-busy", "049D", None, "warning"), End::Busy),
        (
            event("system-fault", "049D", None, "panic"),
            End::Alarm("as it says".to_owned()),
        ),
    ] {
        let mut bench = pushed(Version::New);
        bench.machine.handle_event(event.to_string().as_bytes());
        bench.ends(&end);
    }
    let mut bench = pushed(Version::New);
    for event in [
        event(safety, "other", Some("ebrake_triggered"), "error"),
        event("device-disconnected", "grip", None, "warning"),
        event(safety, "049D", Some("ebrake_released"), "notice"),
        event("device-connected", "049D", None, "info"),
    ] {
        bench.machine.handle_event(event.to_string().as_bytes());
    }
    bench.exchange([1.0, 0.0, 0.0]);
    assert_eq!(bench.machine.why(), None, "none of these ends anything");
    bench.machine.handle_event(b"{");
    assert!(matches!(bench.machine.why(), Some(End::Garbage(_))));
}

#[test]
fn a_late_answer_finds_no_force_and_a_service_that_never_answers_is_silent() {
    let mut bench = pushed(Version::New);
    assert!(bench.ask([4.0, 0.0, 0.0]));
    bench.now_ns += 19 * MS;
    assert!(!bench.ask([4.0, 0.0, 0.0]));
    bench.now_ns += 2 * MS;
    assert!(bench.ask([4.0, 0.0, 0.0]));
    assert_eq!(bench.service.force_n, [0.0; 3], "late: without force");
    // Both answers come, and it goes on.
    let state = bench.service.state();
    bench.answer(&state);
    bench.now_ns += MS;
    assert!(
        !bench.ask([4.0, 0.0, 0.0]),
        "the other answer is still to come"
    );
    bench.answer(&state);
    bench.now_ns += MS;
    assert!(bench.ask([4.0, 0.0, 0.0]));
    assert_eq!(bench.service.force_n, [4.0, 0.0, 0.0]);
    for _ in 0..300 {
        bench.now_ns += MS;
        if bench.machine.why().is_some() {
            break;
        }
        bench.ask([4.0, 0.0, 0.0]);
    }
    assert_eq!(bench.machine.why(), Some(&End::Silent));
    assert_eq!(bench.service.force_n, [0.0; 3]);
}

#[test]
fn places_that_no_arm_reaches_and_numbers_that_are_none_are_an_end() {
    for (place, is_number) in [
        ("1e30", true),
        ("-2.5", true),
        ("NaN", false),
        ("1e999", false),
    ] {
        let mut bench = pushed(Version::New);
        bench.ask([1.0, 0.0, 0.0]);
        let text = format!(
            r#"{{"inverse3":[{{"device_id":"049D","state":{{"cursor_position":{{"x":{place},"y":0,"z":0}}}}}}]}}"#
        );
        bench.machine.handle_message(bench.now_ns, text.as_bytes());
        let end = bench.machine.why().cloned().unwrap();
        assert_eq!(matches!(end, End::Implausible), is_number, "{end:?}");
        assert_eq!(matches!(end, End::Garbage(_)), !is_number, "{end:?}");
        bench.ends(&end);
    }
}

#[test]
fn a_message_that_is_too_long_is_none() {
    let mut bench = pushed(Version::New);
    let text = format!(r#"{{"inverse3":[],"more":"{}"}}"#, "x".repeat(70_000));
    bench.machine.handle_message(bench.now_ns, text.as_bytes());
    let end = bench.machine.why().cloned().unwrap();
    assert!(
        matches!(&end, End::Garbage(what) if what.contains("bytes")),
        "{end:?}"
    );
    bench.ends(&end);
}

#[test]
fn a_service_that_closes_is_told_nothing_more() {
    let mut bench = pushed(Version::New);
    bench.machine.handle_closed("it said goodbye");
    assert_eq!(
        bench.machine.why(),
        Some(&End::Closed("it said goodbye".to_owned()))
    );
    assert_eq!(bench.machine.poll(bench.now_ns, [1.0; 3]), None);
}

#[test]
fn a_force_that_is_no_number_is_sent_as_none() {
    let mut bench = pushed(Version::New);
    bench.exchange([f64::NAN, 1.0, 1.0]);
    assert_eq!(bench.service.force_n, [0.0; 3]);
    bench.exchange([f64::INFINITY, 1.0, 1.0]);
    assert_eq!(bench.service.force_n, [0.0; 3]);
}

#[test]
fn the_button_of_a_grip_takes_hold_while_it_is_down() {
    let mut bench = Bench::new(Version::New);
    let mut marks = Vec::new();
    for step in 0..40 {
        let mut state = bench.service.state();
        let is_down = (10..30).contains(&step);
        state["wireless_verse_grip"] = json!([{
            "device_id": "61576",
            "state": { "buttons": { "a": is_down, "b": false, "c": false }, "hall": 16 }
        }]);
        bench.ask([0.0; 3]);
        bench.answer(&state);
        bench.now_ns += MS;
        marks.push(bench.machine.take_news().unwrap().marks);
    }
    let held: Vec<_> = (0..40).filter(|&step| marks[step].takes_hold).collect();
    let let_go: Vec<_> = (0..40).filter(|&step| marks[step].lets_go).collect();
    assert_eq!((held, let_go), (vec![10], vec![30]));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    /// Whatever bytes come, in whatever order and whenever: no panic, every force sent is finite and was asked for, and
    /// the end leaves none.
    #[test]
    fn no_bytes_break_it(
        steps in prop::collection::vec(
            (prop_oneof![
                Just(None),
                prop::collection::vec(any::<u8>(), 0..40).prop_map(Some),
                "[\\[\\]{}:,\"a-z0-9.eE-]{0,60}".prop_map(|text| Some(text.into_bytes())),
                (-3.0..3.0_f64, any::<bool>()).prop_map(|(x, is_there)| {
                    let device = json!({
                        "device_id": "049D",
                        "state": { "cursor_position": { "x": x, "y": 0.0, "z": 0.0 } }
                    });
                    let devices = if is_there { vec![device] } else { Vec::new() };
                    Some(json!({ "inverse3": devices }).to_string().into_bytes())
                }),
            ],
            0..60_u64,
            any::<[f64; 3]>(),
            any::<bool>()),
            1..80,
        )
    ) {
        let mut bench = Bench::new(Version::New);
        for (bytes, passed_ms, force_n, is_event) in steps {
            bench.now_ns += passed_ms * MS;
            match bytes {
                Some(bytes) if is_event => bench.machine.handle_event(&bytes),
                Some(bytes) => bench.machine.handle_message(bench.now_ns, &bytes),
                None => {}
            }
            if bench.ask(force_n) {
                let given = bench.service.force_n;
                prop_assert!(given == [0.0; 3] || given == force_n, "{:?} of {:?}", given, force_n);
            }
            if let Some(news) = bench.machine.take_news() {
                prop_assert!(news.position_m.iter().all(|part| part.abs() < 3.0));
            }
        }
        if let Some(text) = bench.machine.close() {
            bench.service.take(&text);
        }
        let is_untouched = bench.service.force_n.iter().all(|part| part.is_nan());
        prop_assert!(is_untouched || bench.service.force_n == [0.0; 3]);
    }
}
