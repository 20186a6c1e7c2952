//! The driver on real sockets of the loopback, against a stand-in for the service that the test steps.

#![allow(
    clippy::float_cmp,
    reason = "what is passed on is compared to the last bit, and no force is exactly none"
)]

use std::net::{TcpListener, TcpStream};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use teleclay_device::DeviceCommand;
use teleclay_devices::haply::{HaplyDriver, ServiceAddress};
use teleclay_devices::thread::{Driver, DriverThread};
use teleclay_devices::{Coupled, DeviceFault, Hardware, SessionNeeds};
use tungstenite::{Message, WebSocket};

/// A test that hangs is a test that fails.
const PATIENCE: Duration = Duration::from_secs(10);

struct Service {
    listener: TcpListener,
    events: TcpListener,
}

impl Service {
    fn listening() -> Self {
        let bind = || TcpListener::bind("127.0.0.1:0").unwrap();
        Self {
            listener: bind(),
            events: bind(),
        }
    }

    fn address(&self) -> ServiceAddress {
        let port = |listener: &TcpListener| listener.local_addr().unwrap().port();
        let url = format!("ws://127.0.0.1:{}", port(&self.listener));
        let address: ServiceAddress = url.parse().unwrap();
        address.with_events_at(port(&self.events))
    }

    /// Accepts both channels and sends the inventory.
    fn serve(self, inventory: Value) -> JoinHandle<Channels> {
        std::thread::spawn(move || {
            let accept = |listener: &TcpListener| {
                let (stream, _) = listener.accept().unwrap();
                stream.set_read_timeout(Some(PATIENCE)).unwrap();
                tungstenite::accept(stream).unwrap()
            };
            let mut simulation = accept(&self.listener);
            let events = accept(&self.events);
            simulation
                .send(Message::text(inventory.to_string()))
                .unwrap();
            Channels { simulation, events }
        })
    }
}

struct Channels {
    simulation: WebSocket<TcpStream>,
    events: WebSocket<TcpStream>,
}

impl Channels {
    /// The force of the next message.
    fn force_n(&mut self) -> [f64; 3] {
        let Message::Text(text) = self.simulation.read().unwrap() else {
            panic!("a text");
        };
        let told: Value = serde_json::from_str(&text).unwrap();
        let force = &told["inverse3"][0]["commands"]["set_cursor_force"]["vector"];
        ["x", "y", "z"].map(|axis| force[axis].as_f64().unwrap())
    }

    fn answer(&mut self) {
        self.simulation
            .send(Message::text(state().to_string()))
            .unwrap();
    }
}

fn state() -> Value {
    json!({ "inverse3": [{
        "device_id": "049D",
        "state": { "cursor_position": { "x": 0.01, "y": -0.12, "z": 0.16 } },
        "status": { "calibrated": true, "power_supply": true, "ready": true }
    }] })
}

fn inventory() -> Value {
    let mut inventory = state();
    inventory["session_id"] = json!(3);
    inventory
}

/// A driver and its service, with a force of 2 N in the motors; the driver's time so far, ms.
fn at_work() -> (HaplyDriver, Channels, u64) {
    let service = Service::listening();
    let address = service.address();
    let serving = service.serve(inventory());
    let mut driver = HaplyDriver::open(&address).unwrap();
    let mut channels = serving.join().unwrap();
    let mut now_ms = 0;
    driver.step(0, [2.0, 0.0, 0.0]).unwrap();
    let mut given = channels.force_n();
    assert_eq!(given, [0.0; 3]);
    while given <= [0.0; 3] {
        channels.answer();
        // The clock is the test's: it stands still while the loopback carries.
        now_ms += 1;
        let mut news = None;
        while news.is_none() {
            news = driver.step(now_ms * 1_000_000, [2.0, 0.0, 0.0]).unwrap();
        }
        assert!((news.unwrap().position_m[0] - 0.01).abs() < 1e-12);
        given = channels.force_n();
    }
    (driver, channels, now_ms)
}

/// Steps a driver until it is lost, and brings it to rest.
fn until_lost(driver: &mut HaplyDriver, now_ms: u64) -> DeviceFault {
    let fault = loop {
        match driver.step(now_ms * 1_000_000, [2.0, 0.0, 0.0]) {
            Ok(_) => std::thread::yield_now(),
            Err(fault) => break fault,
        }
    };
    driver.rest();
    fault
}

#[test]
fn forces_and_places_are_exchanged_and_the_end_leaves_none() {
    let (mut driver, mut channels, _) = at_work();
    driver.rest();
    assert_eq!(channels.force_n(), [0.0; 3]);
    assert!(matches!(
        channels.simulation.read().unwrap(),
        Message::Close(_)
    ));
}

#[test]
fn the_emergency_brake_ends_it_without_force() {
    let (mut driver, mut channels, now_ms) = at_work();
    let event = json!({
        "name": "device-safety-triggered",
        "category": "device",
        "level": "error",
        "data": { "device_family": "inverse", "device_id": "049D", "safety_type": "ebrake_triggered" },
        "message": ""
    });
    channels
        .events
        .send(Message::text(event.to_string()))
        .unwrap();
    let fault = until_lost(&mut driver, now_ms);
    assert_eq!(
        fault.to_string(),
        "the haply is lost: the emergency brake was put on"
    );
    assert_eq!(channels.force_n(), [0.0; 3]);
}

#[test]
fn an_event_channel_that_closes_ends_it_without_force() {
    let (mut driver, mut channels, now_ms) = at_work();
    drop(channels.events);
    let fault = until_lost(&mut driver, now_ms).to_string();
    assert!(fault.contains("the event channel"), "{fault}");
    let Message::Text(text) = channels.simulation.read().unwrap() else {
        panic!("a text");
    };
    assert!(text.contains(r#"{"x":0.0,"y":0.0,"z":0.0}"#), "{text}");
}

#[test]
fn a_service_that_closes_and_a_message_that_is_too_long_are_ends_in_words() {
    let (mut driver, channels, now_ms) = at_work();
    drop(channels);
    let fault = until_lost(&mut driver, now_ms).to_string();
    assert!(
        fault.starts_with("the haply is lost: the service closed the channel"),
        "{fault}"
    );

    let (mut driver, mut channels, now_ms) = at_work();
    let long = Message::text("x".repeat(100_000));
    // Whoever is cut off while it speaks may be told so.
    let _ = channels.simulation.send(long);
    let fault = until_lost(&mut driver, now_ms).to_string();
    assert!(fault.starts_with("the haply is lost:"), "{fault}");
}

/// Answers whatever comes until it is closed: the grip's button goes down, then the arm moves to the right. Returns the
/// greatest force along x that was asked for, and the last one.
fn serve_a_hand(mut channels: Channels) -> (f64, [f64; 3]) {
    let (mut most_n, mut last_n) = (0.0_f64, [0.0; 3]);
    for count in 0_u32.. {
        match channels.simulation.read() {
            Ok(Message::Text(text)) => {
                let told: Value = serde_json::from_str(&text).unwrap();
                let force = &told["inverse3"][0]["commands"]["set_cursor_force"]["vector"];
                last_n = ["x", "y", "z"].map(|axis| force[axis].as_f64().unwrap());
                most_n = most_n.max(-last_n[0]);
            }
            _ => break,
        }
        let mut state = state();
        let moved = f64::from(count.saturating_sub(100).min(300)) * 1e-4;
        state["inverse3"][0]["state"]["cursor_position"]["x"] = json!(moved);
        let button = json!({ "device_id": "g", "state": { "button": 50 < count } });
        state["verse_grip"] = json!([button]);
        if channels
            .simulation
            .send(Message::text(state.to_string()))
            .is_err()
        {
            break;
        }
    }
    (most_n, last_n)
}

/// Everything together, on the clock of this machine: socket, thread, rings, coupling.
#[test]
fn a_hand_that_presses_and_pulls_feels_the_coupling_and_is_let_go_of_at_the_end() {
    let service = Service::listening();
    let address = service.address();
    let serving = service.serve(inventory());
    let driver = HaplyDriver::open(&address).unwrap();
    let serving = std::thread::spawn(move || serve_a_hand(serving.join().unwrap()));
    let hardware = Hardware::Haply;
    let needs = SessionNeeds {
        tick_s: 1e-3,
        axes: 3,
        handle_damping_n_s_per_m: 10.0,
        reach_m: [0.05; 3],
    };
    let profile = hardware.profile();
    let (thread, ends) = DriverThread::spawn(driver, profile.force_n).unwrap();
    let mut coupled = Coupled::new(hardware, &needs, profile, ends).unwrap();
    let began = Instant::now();
    let mut next_ns = 0;
    let mut hand_n = 0.0;
    while hand_n < 1.0 {
        assert!(began.elapsed() < PATIENCE, "no force in {PATIENCE:?}");
        let now_ns = thread.now_ns();
        if now_ns < next_ns {
            std::thread::yield_now();
            continue;
        }
        next_ns = now_ns + 1_000_000;
        hand_n = coupled.sample(now_ns).unwrap().hand_force_n[0];
        // The handle stays at home, whoever pulls.
        coupled.command(now_ns, &DeviceCommand::default());
    }
    drop(thread);
    let (most_n, last_n) = serving.join().unwrap();
    assert!(0.5 < most_n && most_n <= profile.force_n, "{most_n} N");
    assert_eq!(last_n, [0.0; 3]);
}

#[test]
fn no_service_and_no_device_are_said_with_where_and_what_to_do() {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = free.local_addr().unwrap().port();
    drop(free);
    let address: ServiceAddress = format!("ws://127.0.0.1:{port}").parse().unwrap();
    let said = HaplyDriver::open(&address).unwrap_err().to_string();
    assert!(
        said.starts_with(&format!(
            "no Haply Inverse Service at ws://127.0.0.1:{port} ("
        )) && said.contains("systemctl start haply-inverse-service")
            && said.contains("--haply-url"),
        "{said}"
    );

    let service = Service::listening();
    let address = service.address();
    let serving = service.serve(json!({ "session_id": 1, "inverse3": [] }));
    let said = HaplyDriver::open(&address).unwrap_err().to_string();
    serving.join().unwrap();
    assert_eq!(
        said,
        format!(
            "no {} is there, looked in the inventory of the Haply Inverse Service at {address}: plug the Inverse3 in, give it power and wait until the Haply Hub shows it",
            Hardware::Haply.word()
        )
    );
}
