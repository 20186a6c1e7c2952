//! Texts and keys.

use serde::Serialize;
use serde_json::{Value, json};

use teleclay_proto::frame::{CopyState, SweepRefusal};
use teleclay_proto::http::{
    Burst, ClayHash, ClayReset, ClayShape, ClaySpec, ClayState, CorrectionsState, FieldError,
    Impairment, JitterDistribution, Layer, LoopState, Material, Network, NewSession, Operation,
    Outage, Preset, Problem, Quantiles, Session, SessionPatch, SessionState, Stop, StorageReport,
    StorageState, TickQuantiles, ToolState, parse,
};
use teleclay_proto::invite::InviteId;
use teleclay_proto::join::{
    ChallengeReply, ChallengeRequest, ClayDescription, Farewell, FreshReply, Granted, JoinReply,
    JoinRequest, LeaseRequest, LeaveReply, LoopParameters, RefusalCode, SealedJoin, SealedReply,
};
use teleclay_proto::keys::{Key, Leaf, SessionKeys};
use teleclay_proto::watch::{ClientText, Level, ServerText, Switch};
use teleclay_proto::{Axes, NodeName, PROTOCOL, RealmName, Scheme, SessionId, ToolDescription};

pub(super) fn server_texts() -> Value {
    let session = session();
    let id = session.id.clone();
    let hello = ServerText::Hello {
        protocol: PROTOCOL,
        session: id,
        server_version: "0.1.0".to_owned(),
    };
    let event = ServerText::Event {
        level: Level::Warning,
        text: "no frame for 0.1 s".to_owned(),
        time_s: 12.5,
    };
    let problem = ServerText::Problem {
        problem: FieldError::new(
            "/session/network/up/delay_s",
            "3 is not a number from 0 to 2",
        )
        .into(),
    };
    let busy = ServerText::Problem {
        problem: Problem::new("busy", "the server is busy", 503, "eight sessions run"),
    };
    texts(
        "text messages from the server",
        &[
            ("hello", hello),
            (
                "state",
                ServerText::State {
                    session: Box::new(session),
                },
            ),
            ("event", event),
            ("a problem with a field", problem),
            ("a problem without a field", busy),
            ("pong", ServerText::Pong { nonce: u32::MAX }),
            (
                "state of a session that is stopped",
                ServerText::State {
                    session: Box::new(stopped_session()),
                },
            ),
            (
                "state with a tool that is kept for somebody",
                ServerText::State {
                    session: Box::new(handed_over()),
                },
            ),
        ],
    )
}

pub(super) fn client_texts() -> Value {
    let full = Network {
        up: impairment(),
        down: Impairment::default(),
    };
    let patch = |text: &str| Box::new(parse(text.as_bytes()).expect("the patch is good"));
    let reset = ClayReset {
        shape: Some(ClayShape::stepped()),
        material: Some(Material::default()),
        layers: None,
    };
    let mut file = texts(
        "text messages to the server",
        &[
            (
                "subscribe",
                ClientText::Subscribe {
                    telemetry: Switch::On,
                    bricks: Switch::Off,
                },
            ),
            (
                "a patch of nothing",
                ClientText::Patch {
                    session: patch("{}"),
                },
            ),
            (
                "a patch of one number",
                ClientText::Patch {
                    session: patch(r#"{"network":{"up":{"delay_s":0.05}}}"#),
                },
            ),
            (
                "a patch that ends bursts",
                ClientText::Patch {
                    session: patch(r#"{"network":{"down":{"burst":null}}}"#),
                },
            ),
            (
                "a patch of everything",
                ClientText::Patch {
                    session: Box::new(SessionPatch {
                        scheme: Some(Scheme::PositionForce),
                        material: Some(
                            Material {
                                viscosity_pa_s_per_m: 4e5,
                                yield_stress_pa: 500.0,
                                stiffness_pa: 2e6,
                            }
                            .into(),
                        ),
                        network: Some(full.into()),
                        deadband: Some(0.07),
                        operation: Some(Operation::Smooth),
                        paused: Some(true),
                    }),
                },
            ),
            (
                "a fresh block as the last",
                ClientText::Reset {
                    clay: ClayReset::default(),
                },
            ),
            ("a fresh block", ClientText::Reset { clay: reset }),
            ("ping", ClientText::Ping { nonce: 0 }),
        ],
    );
    file["refused"] = Value::Array(
        REFUSED_TEXTS
            .iter()
            .map(|(pointer, text)| json!({ "pointer": pointer, "text": text }))
            .collect(),
    );
    file
}

/// Texts that the server refuses, and the field it names; `None` where the text is not JSON at all.
const REFUSED_TEXTS: &[(Option<&str>, &str)] = &[
    (None, ""),
    (None, "{"),
    (None, r#"{"type":"ping","nonce":1} {}"#),
    (None, r#"{"type":"ping","nonce":NaN}"#),
    (Some(""), "[]"),
    (Some(""), r#"{"nonce":1}"#),
    (Some("/type"), r#"{"type":"pong","nonce":1}"#),
    (Some(""), r#"{"type":"ping"}"#),
    (Some("/nonce"), r#"{"type":"ping","nonce":-1}"#),
    (Some("/extra"), r#"{"type":"ping","nonce":1,"extra":1}"#),
    (Some(""), r#"{"type":"ping","nonce":1,"bricks":"on"}"#),
    (
        Some("/bricks"),
        r#"{"type":"subscribe","telemetry":"on","bricks":true}"#,
    ),
    (
        Some("/session/paused"),
        r#"{"type":"patch","session":{"paused":null}}"#,
    ),
    (
        Some("/session/scheme"),
        r#"{"type":"patch","session":{"scheme":"waves"}}"#,
    ),
    (
        Some("/session/network"),
        r#"{"type":"patch","session":{"network":[]}}"#,
    ),
    (
        Some("/session/network/up/delay_s"),
        r#"{"type":"patch","session":{"network":{"up":{"delay_s":2.1}}}}"#,
    ),
    (
        Some("/session/network/down/burst/leave"),
        r#"{"type":"patch","session":{"network":{"down":{"burst":{"enter":0,"leave":2,"loss_in_burst":1}}}}}"#,
    ),
    (
        Some("/session/material/stiffness_pa"),
        r#"{"type":"patch","session":{"material":{"stiffness_pa":-1}}}"#,
    ),
    (
        Some("/clay/shape/size_m/2"),
        r#"{"type":"reset","clay":{"shape":{"kind":"block","size_m":[0.1,0.1,0]}}}"#,
    ),
    (
        Some("/clay/shape/edges_m/2"),
        r#"{"type":"reset","clay":{"shape":{"kind":"stepped","edges_m":[0,0.1,0.1,0.2]}}}"#,
    ),
];

pub(super) fn join() -> Value {
    let request = JoinRequest {
        protocol: PROTOCOL,
        operator: "Ada".to_owned(),
        device: "simulated".to_owned(),
    };
    let granted = granted();
    let refused = JoinReply::Refused {
        code: RefusalCode::NoFreeTool,
        reason: "the only tool of session `demo` is held by Ada".to_owned(),
        holder: None,
    };
    let stopped = JoinReply::Refused {
        code: RefusalCode::Stopped,
        reason: "session `demo` was stopped by Eve: a hand in the way".to_owned(),
        holder: None,
    };
    let reserved = JoinReply::Refused {
        code: RefusalCode::Reserved,
        reason: "the tool of session `demo` that is free is kept for Bob".to_owned(),
        holder: Some("Bob".to_owned()),
    };
    let challenge = std::array::from_fn(|n| n as u8);
    json!({
        "about": "joining, leaving, and asking for a fresh block",
        "requests": [text("a join", &request)],
        "replies": [
            text("granted", &JoinReply::Granted(Box::new(granted))),
            text("refused", &refused),
            text("stopped", &stopped),
            text("reserved", &reserved),
        ],
        "challenge_requests": [text("a challenge", &ChallengeRequest { protocol: PROTOCOL })],
        "challenge_replies": [
            text("given", &ChallengeReply::Given { challenge, needs_token: true }),
            text("refused", &ChallengeReply::Refused {
                code: RefusalCode::NoSuchSession,
                reason: "there is no session `demo` on this server".to_owned(),
            }),
        ],
        "sealed_joins": [
            text("a join as it crosses", &SealedJoin { challenge, message: vec![0, 1, 254, 255], invite: None }),
            text("a guest's", &SealedJoin { challenge, message: vec![7], invite: Some(InviteId::new(0x1a)) }),
        ],
        "farewells": [text("an invite that has ended", &Farewell { lease: 17, reason: "the invite has ended".to_owned() })],
        "sealed_replies": [
            text("answered", &SealedReply::Answered { message: vec![0, 1, 254, 255] }),
            text("refused", &SealedReply::Refused {
                code: RefusalCode::TokenRejected,
                reason: "the token is not the server's".to_owned(),
            }),
        ],
        "lease_requests": [text("under a lease", &LeaseRequest { lease: 17 })],
        "leave_replies": [text("left", &LeaveReply::Left), text("no such lease", &LeaveReply::NoSuchLease)],
        "fresh_replies": [
            text("fresh", &FreshReply::Fresh { epoch: 2 }),
            text("refused", &FreshReply::Refused { reason: "nobody holds lease 17".to_owned() }),
        ],
        "parameters": [
            text("parameters", &LoopParameters { revision: 2, axes: Axes::Three, ..LoopParameters::default() }),
            text("parameters with a loop", &LoopParameters {
                tool: ToolDescription::Loop { ring_radius_m: 0.008, wire_diameter_m: 0.002 },
                ..LoopParameters::default()
            }),
        ],
        "new_sessions": [
            text("every default", &NewSession::new(id("demo"))),
            text("a cylinder", &NewSession {
                tool: ToolDescription::Cylinder { radius_m: 0.004, height_m: 0.03 },
                ..NewSession::new(id("mill"))
            }),
            text("a loop", &NewSession {
                tool: ToolDescription::Loop { ring_radius_m: 0.008, wire_diameter_m: 0.002 },
                ..NewSession::new(id("ribbon"))
            }),
            text("nothing left at its default", &NewSession {
                id: id("carving-2"),
                axes: Axes::Three,
                scheme: Scheme::Tdpa,
                material: Material { viscosity_pa_s_per_m: 1e5, yield_stress_pa: 2e3, stiffness_pa: 3e5 },
                network: Network { up: impairment(), down: impairment() },
                clay: ClaySpec {
                    shape: ClayShape::stepped(),
                    voxel_size_m: 1e-3,
                    layers: vec![Layer { thickness_m: 0.01, material: Preset::Foam.material() }],
                },
                tool: ToolDescription::Ball { radius_m: 0.0064 },
                operation: Operation::Add,
                deadband: 0.07,
                tools: 8,
            }),
        ],
    })
}

pub(super) fn keys() -> Value {
    let realm = RealmName::new("lab-1").expect("the name is good");
    let session = SessionKeys::new(realm, id("demo"));
    let leaves = [
        Leaf::Alive,
        Leaf::Challenge,
        Leaf::Join,
        Leaf::Leave,
        Leaf::Parameters,
        Leaf::ToolUp(1),
        Leaf::ToolDown(u32::MAX),
        Leaf::ClayBricks,
        Leaf::ClaySnapshot,
        Leaf::ClayFresh,
        Leaf::State,
        Leaf::Operator(17),
    ];
    let good = leaves.map(|leaf| {
        let session = session.clone();
        Key { session, leaf }.to_string()
    });
    json!({
        "about": "key expressions of session `demo` in realm `lab-1`",
        "good": good,
        "bad": [
            "",
            "teleclay",
            "teleclay/",
            "teleclay//session/demo/alive",
            "teleclay/lab-1",
            "teleclay/lab-1/",
            "teleclay/lab-1/alive",
            "teleclay/lab-1/session/demo/alive/",
            "teleclay/Lab/session/demo/alive",
            "teleclay/lab-1/session/demo",
            "teleclay/lab-1/session//join",
            "teleclay/lab-1/session/a b/join",
            "teleclay/lab-1/session/demo/tool/up",
            "teleclay/lab-1/session/demo/tool/01/up",
            "teleclay/lab-1/session/demo/tool/+1/up",
            "teleclay/lab-1/session/demo/tool/-1/up",
            "teleclay/lab-1/session/demo/tool/4294967296/up",
            "teleclay/lab-1/session/demo/tool/*/up",
            "teleclay/lab-1/session/demo/operator/",
            "teleclay/*/session/demo/alive",
            "other/lab-1/session/demo/alive",
            "/teleclay/lab-1/session/demo/alive",
        ],
    })
}

pub(super) fn granted() -> Granted {
    Granted {
        lease: 17,
        ownership_epoch: 1,
        node: NodeName::new("lab-1").expect("the name is good"),
        tool: 1,
        lease_s: 5.0,
        parameters: LoopParameters::default(),
        clay: clay(),
        slow_endpoint: Some("tcp/127.0.0.1:7548".to_owned()),
    }
}

pub(super) fn clay() -> ClayDescription {
    ClayDescription {
        shape: ClayShape::default(),
        voxel_size_m: 5e-4,
        epoch: 1,
        revision: 0,
    }
}

fn texts<T: Serialize>(about: &str, cases: &[(&str, T)]) -> Value {
    let cases: Vec<Value> = cases
        .iter()
        .map(|(name, value)| text(name, value))
        .collect();
    json!({ "about": about, "cases": cases })
}

pub(super) fn text(name: &str, value: &impl Serialize) -> Value {
    json!({ "name": name, "value": value })
}

fn id(name: &str) -> SessionId {
    SessionId::new(name).expect("the name is good")
}

fn impairment() -> Impairment {
    Impairment {
        delay_s: 0.04,
        jitter_s: 0.008,
        loss: 0.01,
        seed: (1 << 53) - 1,
        jitter_distribution: JitterDistribution::HeavyTailed,
        duplicate: 0.02,
        reorder: 0.03,
        burst: Some(Burst {
            enter: 0.01,
            leave: 0.25,
            loss_in_burst: 0.9,
        }),
        outage: Some(Outage {
            every_s: 5.0,
            length_s: 0.2,
        }),
    }
}

/// Eve has stopped it: nobody holds a tool.
fn stopped_session() -> Session {
    let mut stopped = session();
    stopped.state = SessionState::Stopped;
    stopped.stop = Some(Stop {
        by: "Eve".to_owned(),
        reason: "a hand in the way".to_owned(),
    });
    free(&mut stopped.tools[0]);
    stopped
}

/// Ada has handed the tool over to Bob, who has not joined yet.
fn handed_over() -> Session {
    let mut handed_over = session();
    handed_over.state = SessionState::Idle;
    let tool = &mut handed_over.tools[0];
    free(tool);
    tool.reserved_for = Some("Bob".to_owned());
    handed_over
}

fn free(tool: &mut ToolState) {
    *tool = ToolState {
        operator: String::new(),
        connected: false,
        requests: Vec::new(),
        ..tool.clone()
    };
}

fn session() -> Session {
    Session {
        id: id("demo"),
        revision: 7,
        scheme: Scheme::Replica,
        axes: Axes::Two,
        state: SessionState::Running,
        fault: None,
        stop: None,
        material: Material::default(),
        network: Network {
            up: impairment(),
            down: Impairment::default(),
        },
        clay: ClayState {
            voxel_size_m: 5e-4,
            initial_volume_m3: 5.24288e-4,
            remaining_volume_m3: 5.24288e-4,
            removed_volume_m3: 0.0,
            initial_units: 1_069_547_520,
            remaining_units: 1_069_547_520,
            removed_units: 0,
            unit_volume_m3: 4.90196078431373e-13,
            hash: ClayHash(0x0123_4567_89ab_cdef),
            shape: ClayShape::default(),
            epoch: 1,
        },
        tool: ToolDescription::default(),
        operation: Operation::Cut,
        deadband: 0.07,
        tools: vec![ToolState {
            id: 1,
            operator: "Ada".to_owned(),
            connected: true,
            requests: vec!["Bob".to_owned(), "Eve".to_owned()],
            reserved_for: None,
            position_m: [0.031, 0.032, 0.01],
            force_n: [-0.5, 0.0, 0.0],
            handle_position_m: [0.031, 0.0, 0.0],
            felt_force_n: [-0.5, 0.0, 0.0],
            hand_force_n: [2.0, 0.0, 0.0],
            home_m: [0.0, 0.032, 0.01],
            copy: CopyState::Live,
            hidden_force_n: [0.0625, 0.0, 0.0],
            sweeps_refused: 2,
            refusal: SweepRefusal::TooFast,
            sweeps_acknowledged: 4711,
            sweeps_durable: 4690,
            corrections: CorrectionsState {
                count: 3,
                moved_n: 1.5,
                held_n: [-0.25, 0.0, 0.0],
                largest_step_n: 0.375,
                injected_j: 0.001953125,
                tank_j: 0.03125,
            },
        }],
        position_ratio: 1.0,
        coordination_m: 2.5e-5,
        storage: StorageReport {
            state: StorageState::Behind,
            durable_revision: 6,
            bytes: 4_194_304,
            reason: None,
        },
        control_loop: LoopState {
            rate_hz: 1000.0,
            ticks: 123_456,
            late_ticks: 3,
            tick_s: TickQuantiles {
                p50: 6e-6,
                p99: 1.2e-5,
                p999: 4e-5,
                max: 1.1e-4,
            },
            thread: 1,
            own_tick_s: TickQuantiles {
                p50: 4e-6,
                p99: 9e-6,
                p999: 2e-5,
                max: 7e-5,
            },
            budget_share: 0.015,
            rtt_s: Quantiles {
                p50: 8e-4,
                p99: 1.6e-3,
            },
            age_s: Quantiles {
                p50: 5e-4,
                p99: 1.1e-3,
            },
            lost: 4,
            duplicates: 5,
            reordered: 6,
            unheard: 5,
            packets_up_per_s: 999.5,
            packets_down_per_s: 1000.0,
            energy_j: 0.0125,
            scheduler: "SCHED_OTHER, SCHED_FIFO was not permitted".to_owned(),
        },
    }
}
