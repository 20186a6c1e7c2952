//! Bytes and hashes of every message against another implementation's: rosbags writes `reference/messages.json` from
//! the same values (`tests/python/ros_messages.py`).

use std::collections::BTreeMap;

use serde_json::Value;
use teleclay_ros::own::{
    Clay, Corrections, Energy, Event, HandleFrame, Link, Record, SetSchemeRequest,
    SetSchemeResponse, Settings, TickTime,
};
use teleclay_ros::standard::{
    DiagnosticArray, DiagnosticStatus, Header, KeyValue, Point, Pose, PoseStamped, Quaternion,
    SetBoolRequest, SetBoolResponse, Text, TfMessage, Time, Transform, TransformStamped,
    TriggerRequest, TriggerResponse, Twist, TwistStamped, Vector3, Wrench, WrenchStamped,
};
use teleclay_ros::{FromCdr, Message, from_cdr, interfaces, to_cdr, type_hash};

const STAMP: Time = Time {
    sec: 1_700_000_000,
    nanosec: 123_456_789,
};
const HEADER: Header<'_> = Header {
    stamp: STAMP,
    frame_id: "teleclay/demo",
};
const QUATERNION: Quaternion = Quaternion {
    x: 0.0,
    y: 0.6,
    z: 0.0,
    w: 0.8,
};
const NEAR: [f64; 3] = [0.25, -1.5, 3e-4];
const FAR: [f64; 3] = [-7.0, 0.0, 1e9];

fn cases() -> BTreeMap<String, (String, Option<Vec<u8>>)> {
    let cases: Vec<Value> = serde_json::from_str(include_str!("reference/messages.json")).unwrap();
    let cases = cases.iter().map(|case| {
        let text = |key: &str| case[key].as_str().map(str::to_owned);
        let bytes = text("cdr").map(|digits| {
            let digits = digits.as_bytes().chunks(2);
            digits
                .map(|pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap())
                .collect()
        });
        (text("name").unwrap(), (text("hash").unwrap(), bytes))
    });
    cases.collect()
}

/// Compares messages with the reference, and counts which ones were.
struct Compared(BTreeMap<String, Vec<u8>>);

impl Compared {
    fn check<'a, M: FromCdr<'a> + PartialEq + std::fmt::Debug>(&'a self, message: &M) -> &'a str {
        let (name, wanted) = self
            .0
            .get_key_value(M::NAME)
            .unwrap_or_else(|| panic!("no reference for {}", M::NAME));
        let mut written = vec![7; 3];
        to_cdr(message, &mut written);
        assert_eq!(&written, wanted, "{name}");
        assert_eq!(&from_cdr::<M>(wanted).unwrap(), message, "{name}");
        for end in 4..wanted.len() {
            // A request without fields has a byte that means nothing.
            let is_without_meaning = M::NAME == TriggerRequest::NAME;
            assert!(
                is_without_meaning || from_cdr::<M>(&wanted[..end]).is_err(),
                "{name} of {end} bytes"
            );
        }
        name
    }
}

#[test]
fn bytes_are_those_of_another_implementation_and_read_back() {
    let with_bytes = cases()
        .into_iter()
        .filter_map(|(name, (_, bytes))| Some((name, bytes?)));
    let reference = Compared(with_bytes.collect());
    let mut compared = standard(&reference);
    compared.extend(diagnostics(&reference));
    compared.extend(services(&reference));
    compared.extend(own(&reference));
    compared.sort_unstable();
    let all: Vec<&str> = reference.0.keys().map(String::as_str).collect();
    assert_eq!(compared, all, "left was compared, right is there");
}

fn standard(reference: &Compared) -> Vec<&str> {
    let pose = Pose {
        position: NEAR.into(),
        orientation: QUATERNION,
    };
    let twist = Twist {
        linear: NEAR.into(),
        angular: FAR.into(),
    };
    let wrench = Wrench {
        force: FAR.into(),
        torque: NEAR.into(),
    };
    let transform = Transform {
        translation: NEAR.into(),
        rotation: QUATERNION,
    };
    let tool = TransformStamped {
        header: HEADER,
        child_frame_id: "teleclay/demo/tool_1",
        transform,
    };
    let early = TransformStamped {
        header: Header {
            stamp: Time {
                sec: -1,
                nanosec: 999_999_999,
            },
            frame_id: "",
        },
        child_frame_id: "é",
        transform,
    };
    vec![
        reference.check(&Text { data: "hello" }),
        reference.check(&STAMP),
        reference.check(&HEADER),
        reference.check(&Point::from(NEAR)),
        reference.check(&Vector3::from(FAR)),
        reference.check(&QUATERNION),
        reference.check(&pose),
        reference.check(&PoseStamped {
            header: HEADER,
            pose,
        }),
        reference.check(&twist),
        reference.check(&TwistStamped {
            header: HEADER,
            twist,
        }),
        reference.check(&wrench),
        reference.check(&WrenchStamped {
            header: HEADER,
            wrench,
        }),
        reference.check(&transform),
        reference.check(&tool),
        reference.check(&TfMessage {
            transforms: vec![tool, early],
        }),
    ]
}

fn diagnostics(reference: &Compared) -> Vec<&str> {
    let rtt = KeyValue {
        key: "rtt_s",
        value: "0.08",
    };
    let late = DiagnosticStatus {
        level: DiagnosticStatus::WARN,
        name: "loop",
        message: "late",
        hardware_id: "local",
        values: vec![
            rtt,
            KeyValue {
                key: "",
                value: "1",
            },
        ],
    };
    let stale = DiagnosticStatus {
        level: DiagnosticStatus::STALE,
        ..DiagnosticStatus::default()
    };
    vec![
        reference.check(&rtt),
        reference.check(&late),
        reference.check(&DiagnosticArray {
            header: HEADER,
            status: vec![late, stale],
        }),
    ]
}

fn services(reference: &Compared) -> Vec<&str> {
    let (success, message) = (true, "paused");
    vec![
        reference.check(&SetBoolRequest { data: true }),
        reference.check(&SetBoolResponse { success, message }),
        reference.check(&TriggerRequest),
        reference.check(&TriggerResponse { success, message }),
        reference.check(&SetSchemeRequest { scheme: "replica" }),
        reference.check(&SetSchemeResponse { success, message }),
    ]
}

fn own(reference: &Compared) -> Vec<&str> {
    vec![
        reference.check(&Clay {
            epoch: 3,
            hash: (1 << 63) + 5,
            format: "a",
            bytes: &[1, 2, 3],
        }),
        reference.check(&Corrections {
            stamp: STAMP,
            step_n: 0.5,
            held_n: 0.125,
        }),
        reference.check(&Energy {
            stamp: STAMP,
            handle_j: 1.5,
            tool_j: -0.5,
        }),
        reference.check(&Event {
            stamp: STAMP,
            level: Event::ERROR,
            text: "a tool rests",
        }),
        reference.check(&HandleFrame {
            arrived_ns: (1 << 40) + 1,
            bytes: &[9, 8, 7, 6, 5],
        }),
        reference.check(&Link {
            stamp: STAMP,
            rtt_s: 0.08,
            age_s: 0.001,
            connected: true,
            operator_name: "Ada",
        }),
        reference.check(&Record { bytes: &[] }),
        reference.check(&Settings {
            stamp: STAMP,
            revision: 7,
            json: r#"{"axes":2}"#,
        }),
        reference.check(&TickTime {
            tick: 1,
            now_ns: 2,
            dropped: 3,
        }),
    ]
}

#[test]
fn hashes_are_those_of_another_implementation() {
    let cases = cases();
    for name in interfaces() {
        assert!(cases.contains_key(name), "{name} is in no case");
    }
    for (name, (hash, _)) in &cases {
        assert_eq!(type_hash(name).as_ref(), Some(hash), "{name}");
    }
}

/// As `ros2 topic info --verbose` and the files of ROS 2 Jazzy give them.
#[test]
fn hashes_are_those_that_ros_2_installs() {
    #[rustfmt::skip]
    let published = [
        ("std_msgs/msg/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
        ("std_msgs/msg/Header", "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"),
        ("builtin_interfaces/msg/Time", "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197"),
        ("geometry_msgs/msg/PoseStamped", "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"),
        ("geometry_msgs/msg/TwistStamped", "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"),
        ("tf2_msgs/msg/TFMessage", "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
        ("service_msgs/msg/ServiceEventInfo", "41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45"),
        ("std_srvs/srv/SetBool", "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a"),
        ("std_srvs/srv/SetBool_Request", "c62fbb99d94e1b25e8ef9e109f9581956bb1b3361a45a4e5810c36a90d29932e"),
        ("std_srvs/srv/SetBool_Response", "d0814e7f7b4880ab77e9c57426c7aa1562ab69f11eef8e2e968812f9cbd0b059"),
        ("std_srvs/srv/SetBool_Event", "3c4c20015afb4303eafd347b1d6a786f171a89c814726961a9593ef10df878cf"),
        ("std_srvs/srv/Trigger", "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"),
    ];
    for (name, digits) in published {
        assert_eq!(type_hash(name), Some(format!("RIHS01_{digits}")), "{name}");
    }
}

#[test]
fn what_nobody_knows_has_no_hash() {
    for name in ["std_msgs/String", "geometry_msgs/msg/Nothing", "", "_Event"] {
        assert_eq!(type_hash(name), None, "{name}");
    }
}
