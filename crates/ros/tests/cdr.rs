//! The bytes, worked by hand; and bytes that are no message.

use proptest::prelude::*;
use teleclay_ros::own::{Clay, Link};
use teleclay_ros::standard::{Header, KeyValue, TfMessage, Time};
use teleclay_ros::{CdrError, from_cdr, names, to_cdr};

#[test]
fn numbers_stand_at_multiples_of_their_size_counted_from_behind_the_header() {
    let mut bytes = Vec::new();
    let header = Header {
        stamp: Time {
            sec: -2,
            nanosec: 5,
        },
        frame_id: "ab",
    };
    to_cdr(&header, &mut bytes);
    #[rustfmt::skip]
    assert_eq!(bytes, [
        0, 1, 0, 0,
        0xfe, 0xff, 0xff, 0xff,
        5, 0, 0, 0,
        3, 0, 0, 0, b'a', b'b', 0,
    ]);
    let link = Link {
        stamp: Time { sec: 1, nanosec: 0 },
        rtt_s: 1.0,
        age_s: 2.0,
        connected: true,
        operator_name: "",
    };
    to_cdr(&link, &mut bytes);
    #[rustfmt::skip]
    assert_eq!(bytes, [
        0, 1, 0, 0,
        1, 0, 0, 0,
        0, 0, 0, 0,
        0, 0, 0, 0, 0, 0, 0xf0, 0x3f,
        0, 0, 0, 0, 0, 0, 0, 0x40,
        1, 0, 0, 0,
        1, 0, 0, 0, 0,
    ]);
    let clay = Clay {
        epoch: 1,
        hash: 2,
        format: "x",
        bytes: &[9],
    };
    to_cdr(&clay, &mut bytes);
    #[rustfmt::skip]
    assert_eq!(bytes, [
        0, 1, 0, 0,
        1, 0, 0, 0, 0, 0, 0, 0,
        2, 0, 0, 0, 0, 0, 0, 0,
        2, 0, 0, 0, b'x', 0, 0, 0,
        1, 0, 0, 0, 9,
    ]);
}

#[test]
fn a_text_ends_where_the_other_side_ends_it() {
    let mut bytes = Vec::new();
    to_cdr(
        &KeyValue {
            key: "a\0b",
            value: "",
        },
        &mut bytes,
    );
    assert_eq!(from_cdr::<KeyValue<'_>>(&bytes).unwrap().key, "a");
}

#[test]
fn times_are_split_at_the_second() {
    let time = |sec, nanosec| Time { sec, nanosec };
    assert_eq!(Time::from_ns(0), time(0, 0));
    assert_eq!(Time::from_ns(1_999_999_999), time(1, 999_999_999));
    assert_eq!(Time::from_ns(u64::MAX).sec, i32::MAX);
}

#[test]
fn other_encodings_and_other_texts_are_refused() {
    let big_endian = [0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0];
    assert!(matches!(
        from_cdr::<Time>(&big_endian),
        Err(CdrError::Header { .. })
    ));
    assert!(matches!(
        from_cdr::<Time>(&[0, 1]),
        Err(CdrError::Header { .. })
    ));
    let unended = [0, 1, 0, 0, 1, 0, 0, 0, b'a', 0, 0, 0, 1, 0, 0, 0, 0];
    assert!(matches!(
        from_cdr::<KeyValue<'_>>(&unended),
        Err(CdrError::Text { .. })
    ));
    let long = [0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff];
    assert!(matches!(
        from_cdr::<TfMessage<'_>>(&long),
        Err(CdrError::Truncated { .. })
    ));
}

proptest! {
    /// Whatever comes, it is read or refused.
    #[test]
    fn a_reader_never_panics(mut bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = from_cdr::<TfMessage<'_>>(&bytes);
        for (at, byte) in [0, 1, 0, 0].into_iter().enumerate().take(bytes.len()) {
            bytes[at] = byte;
        }
        let _ = from_cdr::<TfMessage<'_>>(&bytes);
        let _ = from_cdr::<Link<'_>>(&bytes);
        let _ = from_cdr::<Clay<'_>>(&bytes);
    }

    /// The rule of rmw's `rmw_validate_full_topic_name`, and no name that lists hide.
    #[test]
    fn every_session_has_names_that_ros_2_takes(id in "[a-z0-9_-]{1,64}", tool in 1_u32..9) {
        let topics = names::topics(&id, tool);
        let session = names::session_topics(&id);
        let service = names::service(&id, "set_scheme");
        let all = topics.iter().chain(session.iter()).map(|topic| topic.name.as_str());
        for name in all.chain([service.as_str()]) {
            prop_assert!(name.starts_with("/teleclay/"));
            for part in name[1..].split('/') {
                prop_assert!(part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'), "{name}");
                prop_assert!(part.starts_with(|c: char| c.is_ascii_alphabetic()), "{name}");
            }
        }
    }
}

#[test]
fn names_are_those_that_scripts_rely_on() {
    let topics = names::topics("demo", 2);
    assert_eq!(topics.handle_pose.name, "/teleclay/demo/tool_2/handle_pose");
    assert_eq!(topics.handle_pose.message, "geometry_msgs/msg/PoseStamped");
    assert_eq!(topics.energy.message, "teleclay_msgs/msg/Energy");
    assert_eq!(topics.iter().count(), 11);
    assert_eq!(
        names::session_topics("a-b").events.name,
        "/teleclay/a_b/events"
    );
    assert_eq!(names::service("2nd", "pause"), "/teleclay/s2nd/pause");
    assert_eq!(names::handle_frame("demo", 1), "teleclay/demo/handle_1");
    assert_eq!(names::tf().message, "tf2_msgs/msg/TFMessage");
}
