//! Whatever comes over a wire, nothing panics, and the hand meets no more than the pointer's own law.

use proptest::prelude::*;
use serde_json::{Value, json};
use teleclay_impedance::GraspState;
use teleclay_pointer::{MadePath, Mode, PROFILE, Pointer, PointerSetup, Refused};
use teleclay_proto::frame::{Header, LoopStatus, MAX_FRAME, ToolFrame};
use teleclay_proto::http::ClayShape;
use teleclay_proto::join::{ClayDescription, Granted, LoopParameters};
use teleclay_proto::{NodeName, Scheme};
use teleclay_seal::{Channel, Keys, Purpose};
use teleclay_wire::{FramesKind, FramesWriter};

const TICK_NS: u64 = 1_000_000;

fn keys() -> Keys {
    Keys::new([1; 32], [2; 32])
}

fn granted(parameters: LoopParameters) -> Granted {
    Granted {
        lease: 7,
        ownership_epoch: 1,
        node: NodeName::new("lab").unwrap(),
        tool: 1,
        lease_s: 5.0,
        parameters,
        clay: ClayDescription {
            shape: ClayShape::Block { size_m: [0.032; 3] },
            voxel_size_m: 2e-3,
            epoch: 1,
            revision: 0,
        },
        slow_endpoint: None,
    }
}

fn bytes(value: &impl serde::Serialize) -> Vec<u8> {
    serde_json::to_vec(value).unwrap()
}

fn pointer(granted: &Granted) -> Result<Pointer, Refused> {
    Pointer::new(0, PointerSetup::default(), &bytes(granted), &keys())
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|part| part * part).sum::<f64>().sqrt()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    norm(std::array::from_fn(|axis| a[axis] - b[axis]))
}

/// Frames as the server of the lease seals them.
struct Server {
    channel: Channel,
    writer: FramesWriter,
    sequence: u32,
}

impl Server {
    fn new() -> Self {
        Self {
            channel: Channel::of_server(&keys()),
            writer: FramesWriter::new(FramesKind::Tool),
            sequence: 0,
        }
    }

    fn message(&mut self, now_ns: u64, frame: ToolFrame, ahead: u32) -> Vec<u8> {
        self.sequence = self.sequence.wrapping_add(ahead);
        let frame = ToolFrame {
            header: Header {
                lease: 7,
                ownership_epoch: 1,
                sequence: self.sequence,
                sent_ns: now_ns,
                ..frame.header
            },
            ..frame
        };
        let mut buffer = [0; MAX_FRAME];
        let bytes = frame.encode(&mut buffer);
        let trailer = self.channel.trailer(Purpose::Frame, bytes);
        self.writer.restart();
        self.writer.push([bytes, &trailer[..]]).unwrap();
        self.writer.message().unwrap().to_vec()
    }
}

/// One tick with the hand on its path, held to the pointer's own law.
fn tick(pointer: &mut Pointer, now_ns: u64, place_m: Option<[f64; 3]>) {
    let before = *pointer.view();
    if let Some(place_m) = place_m {
        pointer.handle_sample(now_ns, now_ns, place_m);
    }
    pointer.advance(now_ns);
    let view = *pointer.view();
    let slew_n = PROFILE.slew_n_per_s * 1e-3 + 1e-9;
    for (now, then) in [
        (view.felt_force_n, before.felt_force_n),
        (view.hand_force_n, before.hand_force_n),
        (view.device_force_n, before.device_force_n),
    ] {
        assert!(norm(now) <= PROFILE.force_n + 1e-9, "{view:?}");
        assert!(distance(now, then) <= slew_n, "{before:?} {view:?}");
    }
    let way_m = distance(view.handle_m, before.handle_m);
    assert!(way_m <= PROFILE.speed_m_s * 1e-3 + 1e-9, "{view:?}");
}

/// Often what a loop could mean, and often the end of what may be said.
fn number(least: f64, most: f64) -> impl Strategy<Value = f64> {
    prop_oneof![
        2 => (0.0..=1.0f64).prop_map(move |share| least + share * (most - least)),
        1 => Just(least),
        1 => Just(most),
    ]
}

fn parameters() -> impl Strategy<Value = LoopParameters> {
    let plant = (
        number(1e-3, 1e3),
        number(0.0, 1e5),
        number(1e-3, 1e3),
        number(1e-3, 1e3),
        number(1e-3, 1e5),
    );
    let limits = (
        number(0.0, 1e3),
        number(0.0, 1e6),
        number(0.0, 10.0),
        number(1e-3, 10.0),
        number(1e-3, 10.0),
    );
    let scheme = proptest::sample::select(Scheme::ALL);
    (plant, limits, scheme, any::<bool>()).prop_map(|(plant, limits, scheme, is_usual)| {
        let limited = LoopParameters {
            scheme,
            force_limit_n: limits.0,
            slew_limit_n_per_s: limits.1,
            speed_limit_m_s: limits.2,
            silence_s: limits.3,
            ramp_s: limits.4,
            reach_m: [[-10.0; 3], [10.0; 3]],
            ..LoopParameters::default()
        };
        if is_usual {
            return limited;
        }
        LoopParameters {
            virtual_mass_kg: plant.0,
            virtual_damping_n_s_per_m: plant.1,
            position_ratio: plant.2,
            force_ratio: plant.3,
            wave_impedance_n_s_per_m: plant.4,
            ..limited
        }
    })
}

fn frames() -> impl Strategy<Value = Vec<(u32, Scheme, [f64; 6])>> {
    let size = prop_oneof![
        8 => -30.0..30.0f64, 4 => -1e3..1e3f64, 2 => -1e6..1e6f64, 1 => any::<f64>()
    ];
    let ahead = prop_oneof![9 => Just(1_u32), 2 => 0..5_u32, 1 => any::<u32>()];
    let scheme = proptest::sample::select(Scheme::ALL);
    let frame = (ahead, scheme, proptest::array::uniform6(size));
    proptest::collection::vec(frame, 1..30)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// A server that was joined and says whatever does most harm.
    #[test]
    fn no_server_makes_a_hand_meet_more_than_the_pointers_own_law(
        parameters in parameters(), frames in frames(), keeps_its_scheme in any::<bool>(),
    ) {
        let Ok(mut pointer) = pointer(&granted(parameters)) else { return Ok(()) };
        let mut server = Server::new();
        pointer.hold();
        for number in 0..600_u64 {
            let now_ns = (number + 1) * TICK_NS;
            let (ahead, scheme, [p, v, f, w, e, s]) = frames[number as usize % frames.len()];
            let frame = ToolFrame {
                header: Header {
                    scheme: if keeps_its_scheme { parameters.scheme } else { scheme },
                    clay_epoch: 1,
                    ..Header::default()
                },
                status: LoopStatus::Running,
                position_m: [p, v, f],
                velocity_m_s: [v, w, p],
                force_n: [f, p, s],
                wave: [w, e, v],
                wave_integral: [s, w, e],
                energy_in_j: [e, s, w],
                ..ToolFrame::default()
            };
            let message = server.message(now_ns, frame, ahead);
            pointer.handle_frames(now_ns, &message).unwrap();
            tick(&mut pointer, now_ns, Some(MadePath::at(now_ns)));
            pointer.tidy();
        }
    }

    /// Whoever lacks the keys, and whoever sends noise.
    #[test]
    fn what_the_server_did_not_write_moves_no_hand(
        noise in proptest::collection::vec(any::<u8>(), 0..400),
        flips in proptest::collection::vec((any::<prop::sample::Index>(), 1..=255_u8), 1..4),
    ) {
        let mut pointer = pointer(&granted(LoopParameters::default())).unwrap();
        let mut server = Server::new();
        pointer.hold();
        for number in 1..100_u64 {
            let now_ns = number * TICK_NS;
            let pushing = ToolFrame {
                header: Header { clay_epoch: 1, ..Header::default() },
                status: LoopStatus::Running,
                force_n: [50.0; 3],
                ..ToolFrame::default()
            };
            let mut message = server.message(now_ns, pushing, 1);
            for (at, flip) in &flips {
                let at = at.index(message.len());
                message[at] ^= flip;
            }
            // Two flips of one byte may undo each other.
            if message != server.writer.message().unwrap() {
                let _ = pointer.handle_frames(now_ns, &message);
            }
            let _ = pointer.handle_frames(now_ns, &noise);
            let _ = pointer.begin_snapshot(&noise);
            let _ = pointer.handle_bricks(&noise);
            let _ = pointer.finish_snapshot();
            let _ = pointer.handle_parameters(&noise);
            let _ = pointer.renew(now_ns, &noise, &keys());
            tick(&mut pointer, now_ns, Some([0.01, 0.0, 0.0]));
            let view = pointer.view();
            prop_assert!(norm(view.handle_m) <= 0.0 && norm(view.felt_force_n) <= 0.0);
            prop_assert_eq!(view.mode, Mode::Coupled);
        }
    }
}

/// What is sealed as it should be does push: up to the law and no further.
#[test]
fn what_the_server_wrote_is_felt_up_to_the_law() {
    let parameters = LoopParameters {
        scheme: Scheme::ForceExchange,
        force_limit_n: 1e3,
        slew_limit_n_per_s: 1e6,
        ..LoopParameters::default()
    };
    let mut pointer = pointer(&granted(parameters)).unwrap();
    let mut server = Server::new();
    let mut most = 0.0_f64;
    for number in 1..400_u64 {
        let now_ns = number * TICK_NS;
        let pushing = ToolFrame {
            header: Header {
                clay_epoch: 1,
                scheme: Scheme::ForceExchange,
                ..Header::default()
            },
            status: LoopStatus::Running,
            force_n: [500.0, 0.0, 0.0],
            ..ToolFrame::default()
        };
        let message = server.message(now_ns, pushing, 1);
        pointer.handle_frames(now_ns, &message).unwrap();
        tick(&mut pointer, now_ns, None);
        most = most.max(norm(pointer.view().felt_force_n));
    }
    assert!((most - PROFILE.force_n).abs() < 1e-9, "{most}");
    assert!(0.01 < norm(pointer.view().handle_m));
}

/// A server that would have the hand wait for ten seconds and let go within ten more.
#[test]
fn a_server_that_falls_silent_lets_go_as_soon_as_the_device_says() {
    let parameters = LoopParameters {
        scheme: Scheme::ForceExchange,
        silence_s: 10.0,
        ramp_s: 10.0,
        ..LoopParameters::default()
    };
    let mut pointer = pointer(&granted(parameters)).unwrap();
    let mut server = Server::new();
    for number in 1..600_u64 {
        let now_ns = number * TICK_NS;
        if number < 400 {
            let pushing = ToolFrame {
                header: Header {
                    clay_epoch: 1,
                    scheme: Scheme::ForceExchange,
                    ..Header::default()
                },
                status: LoopStatus::Running,
                force_n: [5.0, 0.0, 0.0],
                ..ToolFrame::default()
            };
            let message = server.message(now_ns, pushing, 1);
            pointer.handle_frames(now_ns, &message).unwrap();
        }
        tick(&mut pointer, now_ns, None);
        let felt_n = norm(pointer.view().felt_force_n);
        match number {
            399 => assert!(4.0 < felt_n, "{felt_n}"),
            // 100 ms of silence and 50 ms of ramp after the last frame.
            551.. => assert!(felt_n <= 0.0, "{felt_n} N at {number}"),
            _ => {}
        }
    }
}

/// Every number of a grant as no server means it: an error in words, or a loop that keeps the law.
#[test]
fn grants_with_absurd_parameters_are_refused_or_harmless() {
    let good = serde_json::to_value(granted(LoopParameters::default())).unwrap();
    let absurd = [
        json!(0.0),
        json!(-1.0),
        json!(1e-300),
        json!(1e300),
        json!(9_007_199_254_740_993_u64),
        json!(null),
        json!("1"),
        json!([]),
        json!({}),
    ];
    let mut places = Vec::new();
    leaves(&good, String::new(), &mut places);
    assert!(30 < places.len());
    let (mut refused, mut taken) = (0, 0);
    for place in &places {
        for absurd in &absurd {
            let mut grant = good.clone();
            *grant.pointer_mut(place).unwrap() = absurd.clone();
            match Pointer::new(0, PointerSetup::default(), &bytes(&grant), &keys()) {
                Err(error) => {
                    assert!(!error.to_string().is_empty());
                    refused += 1;
                }
                Ok(mut pointer) => {
                    pointer.hold();
                    for number in 1..300 {
                        let now_ns = number * TICK_NS;
                        tick(
                            &mut pointer,
                            now_ns,
                            Some(MadePath::at(now_ns + 500_000_000)),
                        );
                    }
                    taken += 1;
                }
            }
        }
    }
    assert!(200 < refused && 20 < taken, "{refused} {taken}");
}

fn leaves(value: &Value, place: String, places: &mut Vec<String>) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                leaves(value, format!("{place}/{name}"), places);
            }
        }
        Value::Array(parts) => {
            for (number, value) in parts.iter().enumerate() {
                leaves(value, format!("{place}/{number}"), places);
            }
        }
        _ => places.push(place),
    }
}

#[test]
fn what_is_no_grant_is_refused_and_says_why() {
    let grant = granted(LoopParameters::default());
    assert!(pointer(&grant).is_ok());
    for (json, why) in [
        (&b"{\"outcome\":\"maybe\"}"[..], "unknown field `outcome`"),
        (b"{\"lease\":1}", "missing field `ownership_epoch`"),
    ] {
        let made = Pointer::new(0, PointerSetup::default(), json, &keys()).map(|_| ());
        let said = made.unwrap_err().to_string();
        assert!(said.contains(why), "{said}");
    }
    for (tick_s, rate_hz, why) in [
        (
            1e-5,
            60.0,
            "its loop ticks every 0.00001 s, wanted 0.0005 to 0.002 s",
        ),
        (
            1e-3,
            f64::NAN,
            "the pointer is told NaN times a second, wanted 20 to 1000",
        ),
    ] {
        let grant = granted(LoopParameters {
            tick_s,
            ..LoopParameters::default()
        });
        let setup = PointerSetup {
            rate_hz,
            ..PointerSetup::default()
        };
        let made = Pointer::new(0, setup, &bytes(&grant), &keys()).map(|_| ());
        assert_eq!(made.unwrap_err().to_string(), why);
    }
}

/// Nobody else's frames: those of another lease, of the hand itself, and what comes twice.
#[test]
fn each_frame_of_the_server_is_heard_once_and_no_other_at_all() {
    let mut pointer = pointer(&granted(LoopParameters::default())).unwrap();
    let mut server = Server::new();
    let message = server.message(TICK_NS, ToolFrame::default(), 1);
    for _ in 0..3 {
        pointer.handle_frames(TICK_NS, &message).unwrap();
    }
    assert_eq!(pointer.counts().unheard, 2);
    pointer.advance(TICK_NS);
    assert_eq!(pointer.side().arrivals().received, 1);
    // Its own words, given back.
    let own = pointer.outgoing().unwrap().to_vec();
    assert!(pointer.handle_frames(2 * TICK_NS, &own).is_err());
    assert_eq!(pointer.counts().undecodable, 1);
}

/// A page that stops telling, as one whose thread is blocked does, lets go of the handle, and holds it again by itself.
#[test]
fn a_page_that_is_blocked_lets_go_gently_and_takes_hold_again() {
    let mut pointer = pointer(&granted(LoopParameters::default())).unwrap();
    pointer.hold();
    for number in 1..2000 {
        let now_ns = number * TICK_NS;
        let is_told = !(1000..1300).contains(&number);
        tick(&mut pointer, now_ns, is_told.then(|| MadePath::at(now_ns)));
        let view = pointer.view();
        match number {
            900 | 1900 => assert_eq!(view.grasp, GraspState::Held),
            // 42 ms from the last sample, 50 ms of ramp.
            1095..1300 => assert!(norm(view.hand_force_n) <= 0.0, "{view:?}"),
            _ => {}
        }
    }
}
