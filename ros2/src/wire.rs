//! `rmw_zenoh`'s keys, tokens and attachments: the form that its design document and its sources have, of ROS 2 Jazzy
//! and later. Pure functions.
//!
//! | | |
//! |---|---|
//! | messages and calls | `<domain>/<topic>/<type>/<hash>` |
//! | node | `@ros2_lv/<domain>/<zid>/<node>/<node>/NN/%/%/<name>` |
//! | its ends of topics and services | `@ros2_lv/<domain>/<zid>/<node>/<end>/<kind>/%/%/<name>/<topic>/<type>/<hash>/<qos>` |
//! | attachment | sequence number and time of day in ns, `i64` each, then 16 and a name of 16 bytes |
//!
//! In tokens `%` stands for `/`; a lone `%` is the root namespace, and no enclave. `<type>` is the name that DDS has
//! for it, such as `std_msgs::msg::dds_::String_`.

use std::fmt;

use sha2::{Digest as _, Sha256};
use teleclay_ros::type_hash;

/// A name of an end that messages of it carry. It only has to be its own.
pub(crate) type Gid = [u8; 16];

/// Length of an attachment.
const ATTACHMENT: usize = 8 + 8 + 1 + 16;

/// What an end of a topic or service does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Publisher,
    Subscriber,
    Service,
    Client,
}

impl Kind {
    const ALL: [(Self, &str, &str); 4] = [
        (Self::Publisher, "MP", "publisher"),
        (Self::Subscriber, "MS", "subscriber"),
        (Self::Service, "SS", "service"),
        (Self::Client, "SC", "client"),
    ];

    fn code(self) -> &'static str {
        let mut all = Self::ALL.into_iter();
        all.find(|(kind, ..)| *kind == self)
            .map_or("", |(_, code, _)| code)
    }

    fn of_code(code: &str) -> Option<Self> {
        let mut all = Self::ALL.into_iter();
        all.find(|(_, known, _)| *known == code)
            .map(|(kind, ..)| kind)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut all = Self::ALL.into_iter();
        let word = all.find(|(kind, ..)| kind == self);
        f.write_str(word.map_or("", |(.., word)| word))
    }
}

/// How messages of a topic go: ROS 2's quality of service, as tokens spell what differs from the default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quality {
    /// The newest counts, lost ones are lost.
    BestEffort,
    /// Ten are kept until they have gone: events, and services.
    Reliable,
}

impl Quality {
    fn code(self) -> &'static str {
        match self {
            Self::BestEffort => "2::,10:,:,:,,",
            Self::Reliable => "::,10:,:,:,,",
        }
    }
}

/// A topic or service with the type that both ends have to mean.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Typed {
    /// Its name, with the leading slash.
    pub(crate) name: String,
    /// The type as DDS names it.
    pub(crate) dds_type: String,
    /// The type's hash.
    pub(crate) hash: String,
}

impl Typed {
    /// # Panics
    /// `interface` is none of ours.
    pub(crate) fn new(name: &str, interface: &str) -> Self {
        Self {
            name: name.to_owned(),
            dds_type: dds_name(interface),
            hash: type_hash(interface).expect("only interfaces that are known are spoken"),
        }
    }

    /// The key that its messages or calls go by.
    pub(crate) fn key(&self, domain: u32) -> String {
        let name = self.name.trim_matches('/');
        format!("{domain}/{name}/{}/{}", self.dds_type, self.hash)
    }
}

/// A node of the graph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NodeName {
    pub(crate) domain: u32,
    /// Id of its Zenoh session.
    pub(crate) zid: String,
    pub(crate) name: String,
}

impl NodeName {
    /// The token that shows the node.
    pub(crate) fn token(&self) -> String {
        format!(
            "@ros2_lv/{}/{}/0/0/NN/%/%/{}",
            self.domain, self.zid, self.name
        )
    }

    /// The token that shows an end of it.
    pub(crate) fn token_of(&self, end: u32, kind: Kind, typed: &Typed, quality: Quality) -> String {
        format!(
            "@ros2_lv/{}/{}/0/{end}/{}/%/%/{}/{}/{}/{}/{}",
            self.domain,
            self.zid,
            kind.code(),
            self.name,
            typed.name.replace('/', "%"),
            typed.dds_type.replace('/', "%"),
            typed.hash,
            quality.code(),
        )
    }
}

/// The tokens of a whole domain.
pub(crate) fn every_token(domain: u32) -> String {
    format!("@ros2_lv/{domain}/**")
}

/// An end of a topic or service, as its token shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct End {
    /// Id of its Zenoh session.
    pub(crate) zid: String,
    /// Name of its node, with the namespace.
    pub(crate) node: String,
    pub(crate) kind: Kind,
    pub(crate) typed: Typed,
}

impl End {
    /// Reads a token. None where it is that of a node, or no token at all.
    pub(crate) fn of_token(token: &str) -> Option<Self> {
        let parts: Vec<&str> = token.split('/').collect();
        let [
            "@ros2_lv",
            _domain,
            zid,
            _node,
            _end,
            kind,
            _enclave,
            namespace,
            node,
            topic,
            dds_type,
            hash,
            ..,
        ] = parts[..]
        else {
            return None;
        };
        let namespace = namespace.replace('%', "/");
        Some(Self {
            zid: zid.to_owned(),
            node: format!("{}/{node}", namespace.trim_end_matches('/')),
            kind: Kind::of_code(kind)?,
            typed: Typed {
                name: topic.replace('%', "/"),
                dds_type: dds_type.replace('%', "/"),
                hash: hash.to_owned(),
            },
        })
    }
}

/// The name of an end. `rmw_zenoh` hashes the token by another function; all that counts is that no two are alike.
pub(crate) fn gid(token: &str) -> Gid {
    let digest = Sha256::digest(token);
    let mut gid = Gid::default();
    gid.copy_from_slice(&digest[..16]);
    gid
}

/// What goes beside each message, call and answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Attachment {
    /// Counts what an end has sent, from 1; an answer has that of the call.
    pub(crate) sequence: i64,
    /// When it was sent, ns since 1970.
    pub(crate) sent_ns: i64,
    /// Which end sent it; an answer has that of the call.
    pub(crate) gid: Gid,
}

impl Attachment {
    pub(crate) fn to_bytes(self) -> [u8; ATTACHMENT] {
        let mut bytes = [0; ATTACHMENT];
        bytes[..8].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.sent_ns.to_le_bytes());
        bytes[16] = self.gid.len() as u8;
        bytes[17..].copy_from_slice(&self.gid);
        bytes
    }

    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let bytes: &[u8; ATTACHMENT] = bytes.try_into().ok()?;
        let number = |at: usize| i64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight"));
        let gid: Gid = bytes[17..].try_into().expect("sixteen");
        (usize::from(bytes[16]) == gid.len()).then(|| Self {
            sequence: number(0),
            sent_ns: number(8),
            gid,
        })
    }
}

/// The name that DDS has for an interface: `std_msgs::msg::dds_::String_` for `std_msgs/msg/String`.
fn dds_name(interface: &str) -> String {
    match interface.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => format!("{interface}_"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Taken down from a ROS 2 Jazzy with `rmw_zenoh`: `ros2 topic echo` of a stamped twist, best effort, depth 1.
    const HEARD: &str = "@ros2_lv/0/943f9ebc32acd3e072bfda12ce8c7ed2/0/4/MS/%/%/_ros2cli_31/%cmd_vel/\
        geometry_msgs::msg::dds_::TwistStamped_/RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64/\
        2::,1:,:,:,,";

    #[test]
    fn keys_and_tokens_are_those_that_rmw_zenoh_has() {
        let typed = Typed::new("/cmd_vel", "geometry_msgs/msg/TwistStamped");
        assert_eq!(
            typed.key(0),
            "0/cmd_vel/geometry_msgs::msg::dds_::TwistStamped_/\
             RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"
        );
        let node = NodeName {
            domain: 0,
            zid: "943f9ebc32acd3e072bfda12ce8c7ed2".to_owned(),
            name: "_ros2cli_31".to_owned(),
        };
        assert_eq!(
            node.token(),
            "@ros2_lv/0/943f9ebc32acd3e072bfda12ce8c7ed2/0/0/NN/%/%/_ros2cli_31"
        );
        let token = node.token_of(4, Kind::Subscriber, &typed, Quality::BestEffort);
        assert_eq!(token, HEARD.replace("2::,1:", "2::,10:"));
    }

    #[test]
    fn a_service_is_named_by_its_whole_type() {
        let pause = Typed::new("/teleclay/demo/pause", "std_srvs/srv/SetBool");
        assert_eq!(
            pause.key(7),
            "7/teleclay/demo/pause/std_srvs::srv::dds_::SetBool_/\
             RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a"
        );
    }

    #[test]
    fn what_a_token_says_is_read() {
        let end = End::of_token(HEARD).unwrap();
        assert_eq!(end.node, "/_ros2cli_31");
        assert_eq!(end.kind, Kind::Subscriber);
        let typed = Typed::new("/cmd_vel", "geometry_msgs/msg/TwistStamped");
        assert_eq!(end.typed, typed);
        let elsewhere = HEARD.replace("/MS/%/%/", "/SC/%/%robot%arm/");
        let end = End::of_token(&elsewhere).unwrap();
        assert_eq!(
            (end.node.as_str(), end.kind),
            ("/robot/arm/_ros2cli_31", Kind::Client)
        );
        for other in [
            "@ros2_lv/0/9/0/0/NN/%/%/talker",
            "@ros2_lv/0",
            "a/b",
            &HEARD.replace("MS", "XX"),
        ] {
            assert_eq!(End::of_token(other), None, "{other}");
        }
    }

    #[test]
    fn an_attachment_is_thirty_three_bytes() {
        let attachment = Attachment {
            sequence: 5,
            sent_ns: -2,
            gid: [7; 16],
        };
        let bytes = attachment.to_bytes();
        assert_eq!(bytes[..8], [5, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(bytes[8..17], [0xfe, 255, 255, 255, 255, 255, 255, 255, 16]);
        assert_eq!(bytes[17..], [7; 16]);
        assert_eq!(Attachment::from_bytes(&bytes), Some(attachment));
        assert_eq!(Attachment::from_bytes(&bytes[1..]), None);
        let mut other = bytes;
        other[16] = 15;
        assert_eq!(Attachment::from_bytes(&other), None);
    }
}
