//! The texts of all interfaces, and what they say: the fields of each, in order.
//!
//! A service is three messages: what is asked, what is answered, and an event that tells of either, which nobody writes
//! down and which counts in the service's hash.

use std::collections::BTreeSet;

macro_rules! own {
    ($name:literal) => {
        (
            concat!("teleclay_msgs/msg/", $name),
            include_str!(concat!("../../../ros2/teleclay_msgs/msg/", $name, ".msg")),
        )
    };
}

/// Messages by name, each with its text. Comments mean nothing to a reader.
const MESSAGES: &[(&str, &str)] = &[
    ("builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec\n"),
    (
        "std_msgs/msg/Header",
        "builtin_interfaces/Time stamp\nstring frame_id\n",
    ),
    ("std_msgs/msg/String", "string data\n"),
    (
        "geometry_msgs/msg/Point",
        "float64 x\nfloat64 y\nfloat64 z\n",
    ),
    (
        "geometry_msgs/msg/Vector3",
        "float64 x\nfloat64 y\nfloat64 z\n",
    ),
    (
        "geometry_msgs/msg/Quaternion",
        "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    ),
    (
        "geometry_msgs/msg/Pose",
        "Point position\nQuaternion orientation\n",
    ),
    (
        "geometry_msgs/msg/PoseStamped",
        "std_msgs/Header header\nPose pose\n",
    ),
    (
        "geometry_msgs/msg/Twist",
        "Vector3 linear\nVector3 angular\n",
    ),
    (
        "geometry_msgs/msg/TwistStamped",
        "std_msgs/Header header\nTwist twist\n",
    ),
    (
        "geometry_msgs/msg/Wrench",
        "Vector3 force\nVector3 torque\n",
    ),
    (
        "geometry_msgs/msg/WrenchStamped",
        "std_msgs/Header header\nWrench wrench\n",
    ),
    (
        "geometry_msgs/msg/Transform",
        "Vector3 translation\nQuaternion rotation\n",
    ),
    (
        "geometry_msgs/msg/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\nTransform transform\n",
    ),
    (
        "tf2_msgs/msg/TFMessage",
        "geometry_msgs/TransformStamped[] transforms\n",
    ),
    ("diagnostic_msgs/msg/KeyValue", "string key\nstring value\n"),
    (
        "diagnostic_msgs/msg/DiagnosticStatus",
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\n\
         string hardware_id\nKeyValue[] values\n",
    ),
    (
        "diagnostic_msgs/msg/DiagnosticArray",
        "std_msgs/Header header\nDiagnosticStatus[] status\n",
    ),
    (
        "service_msgs/msg/ServiceEventInfo",
        "uint8 event_type\nbuiltin_interfaces/Time stamp\nchar[16] client_gid\nint64 sequence_number\n",
    ),
    own!("Clay"),
    own!("Corrections"),
    own!("Energy"),
    own!("Event"),
    own!("HandleFrame"),
    own!("Link"),
    own!("Record"),
    own!("Settings"),
    own!("TickTime"),
];

/// Services by name, each with its text: what is asked, three dashes, what is answered.
const SERVICES: &[(&str, &str)] = &[
    (
        "std_srvs/srv/SetBool",
        "bool data\n---\nbool success\nstring message\n",
    ),
    (
        "std_srvs/srv/Trigger",
        "---\nbool success\nstring message\n",
    ),
    (
        "teleclay_msgs/srv/SetScheme",
        include_str!("../../../ros2/teleclay_msgs/srv/SetScheme.srv"),
    ),
];

/// Between two types of a definition.
const BETWEEN_TYPES: usize = 80;

/// A field of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) count: Count,
}

/// What a field holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A value of the language's own, by its number in ROS 2's descriptions of types.
    Plain(u8),
    /// A message.
    Nested(String),
}

/// How many of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Count {
    One,
    Exactly(u64),
    AtMost(u64),
    Any,
}

/// The names of every message and service that is known.
pub fn names() -> impl Iterator<Item = &'static str> {
    MESSAGES.iter().chain(SERVICES).map(|(name, _)| *name)
}

/// The text of a message, or of one half of a service (`std_srvs/srv/SetBool_Request`), with those of all messages in
/// it: MCAP's and Foxglove's `ros2msg`. None where there is no such message.
#[must_use]
pub fn definition(name: &str) -> Option<String> {
    let mut text = text(name)?.to_owned();
    let mut told = BTreeSet::new();
    let mut next = vec![name.to_owned()];
    while let Some(name) = next.pop() {
        for nested in nested_in(&fields(&name)?) {
            if !told.insert(nested.clone()) {
                continue;
            }
            text += &"=".repeat(BETWEEN_TYPES);
            text += "\nMSG: ";
            text += &nested.replace("/msg/", "/");
            text += "\n";
            text += self::text(&nested)?;
            next.push(nested);
        }
    }
    Some(text)
}

/// The fields of a message, of a service, or of a part of a service.
pub(crate) fn fields(name: &str) -> Option<Vec<Field>> {
    if is_service(name) {
        return Some(parts_of_service(name));
    }
    if let Some(service) = name.strip_suffix("_Event").filter(|name| is_service(name)) {
        return Some(event_of_service(service));
    }
    let package = name.split('/').next()?;
    let mut fields: Vec<Field> = text(name)?
        .lines()
        .filter_map(|line| field(package, line))
        .collect();
    if fields.is_empty() {
        // Other languages know no empty structures.
        fields.extend(field(package, "uint8 structure_needs_at_least_one_member"));
    }
    Some(fields)
}

/// The messages among fields.
pub(crate) fn nested_in(fields: &[Field]) -> impl Iterator<Item = String> {
    fields.iter().filter_map(|field| match &field.kind {
        Kind::Nested(name) => Some(name.clone()),
        Kind::Plain(_) => None,
    })
}

/// The text of one message, or of one half of a service.
fn text(name: &str) -> Option<&'static str> {
    let of = |texts: &'static [(&'static str, &'static str)], name: &str| {
        let mut texts = texts.iter();
        texts
            .find(|(known, _)| *known == name)
            .map(|(_, text)| *text)
    };
    if let Some(text) = of(MESSAGES, name) {
        return Some(text);
    }
    let (service, is_request) = match name.strip_suffix("_Request") {
        Some(service) => (service, true),
        None => (name.strip_suffix("_Response")?, false),
    };
    let (request, response) = of(SERVICES, service)?.split_once("---\n")?;
    Some(if is_request { request } else { response })
}

fn is_service(name: &str) -> bool {
    SERVICES.iter().any(|(known, _)| *known == name)
}

fn parts_of_service(name: &str) -> Vec<Field> {
    let part = |field: &str, part: &str| Field {
        name: field.to_owned(),
        kind: Kind::Nested(format!("{name}_{part}")),
        count: Count::One,
    };
    vec![
        part("request_message", "Request"),
        part("response_message", "Response"),
        part("event_message", "Event"),
    ]
}

fn event_of_service(name: &str) -> Vec<Field> {
    let part = |field: &str, kind: String, count: Count| Field {
        name: field.to_owned(),
        kind: Kind::Nested(kind),
        count,
    };
    let info = "service_msgs/msg/ServiceEventInfo".to_owned();
    vec![
        part("info", info, Count::One),
        part("request", format!("{name}_Request"), Count::AtMost(1)),
        part("response", format!("{name}_Response"), Count::AtMost(1)),
    ]
}

/// What a line says, but for comments and constants.
fn field(package: &str, line: &str) -> Option<Field> {
    let line = line.split('#').next()?;
    let mut words = line.split_whitespace();
    let (kind, name) = (words.next()?, words.next()?);
    if line.contains('=') && !kind.contains('=') {
        return None;
    }
    let (kind, count) = match kind.split_once('[') {
        None => (kind, Count::One),
        Some((kind, count)) => (kind, count_in_brackets(count)),
    };
    Some(Field {
        name: name.to_owned(),
        kind: self::kind(package, kind),
        count,
    })
}

fn count_in_brackets(text: &str) -> Count {
    let text = text.trim_end_matches(']');
    let number = |text: &str| text.parse().expect("the texts above have numbers there");
    match text.strip_prefix("<=") {
        Some(most) => Count::AtMost(number(most)),
        None if text.is_empty() => Count::Any,
        None => Count::Exactly(number(text)),
    }
}

fn kind(package: &str, word: &str) -> Kind {
    // The numbers of `type_description_interfaces/msg/FieldType`.
    Kind::Plain(match word {
        "int8" => 2,
        // A character is a byte without sign.
        "uint8" | "char" => 3,
        "int16" => 4,
        "uint16" => 5,
        "int32" => 6,
        "uint32" => 7,
        "int64" => 8,
        "uint64" => 9,
        "float32" => 10,
        "float64" => 11,
        "bool" => 15,
        "byte" => 16,
        "string" => 17,
        _ => {
            let (package, name) = word.split_once('/').unwrap_or((package, word));
            return Kind::Nested(format!("{package}/msg/{name}"));
        }
    })
}
