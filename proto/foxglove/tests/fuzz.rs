//! Whatever comes, a connection neither panics nor grows without bound.

use proptest::prelude::*;
use teleclay_foxglove::client::ClientBinary;
use teleclay_foxglove::connection::{Flow, Message, Rate};
use teleclay_foxglove::server::{Channel, ServerBinary, ServerText, Service, ServiceMessage};
use teleclay_foxglove::{Connection, client::ClientText};

fn connection() -> Connection<u64> {
    let info = ServerText::Status {
        level: 0,
        message: String::new(),
    };
    let mut connection = Connection::new(&info, Rate::USUAL);
    let channel = |id: u32| Channel {
        id,
        topic: format!("/{id}"),
        encoding: "cdr".to_owned(),
        schema_name: "a/msg/A".to_owned(),
        schema: String::new(),
        schema_encoding: "ros2msg".to_owned(),
    };
    let message = ServiceMessage {
        encoding: "cdr".to_owned(),
        schema_name: "a/srv/A_Request".to_owned(),
        schema_encoding: "ros2msg".to_owned(),
        schema: String::new(),
    };
    let service = Service {
        id: 1,
        name: "/s".to_owned(),
        kind: "a/srv/A".to_owned(),
        request: message.clone(),
        response: message,
    };
    let channels = (1..=8).map(|id| (channel(id), Flow::Samples)).collect();
    connection.offer(channels, vec![service]);
    connection
}

/// What a client may say, rightly for the most part.
fn said() -> impl Strategy<Value = Message> {
    let id = 0_u32..12;
    let subscriptions = prop::collection::vec((id.clone(), id.clone()), 0..4).prop_map(|pairs| {
        let pairs = pairs
            .iter()
            .map(|(id, channel)| format!(r#"{{"id":{id},"channelId":{channel}}}"#));
        format!(
            r#"{{"op":"subscribe","subscriptions":[{}]}}"#,
            pairs.collect::<Vec<_>>().join(",")
        )
    });
    let ids = prop::collection::vec(id.clone(), 0..4)
        .prop_map(|ids| format!(r#"{{"op":"unsubscribe","subscriptionIds":{ids:?}}}"#));
    let name = prop_oneof![
        Just("teleclay.rate_hz".to_owned()),
        id.clone().prop_map(|id| format!("teleclay.rate_hz./{id}")),
        ".{0,300}"
    ];
    let value = prop_oneof![
        any::<f64>().prop_map(|value| serde_json::json!(value)),
        (1_u32..250).prop_map(|value| serde_json::json!(value)),
        Just(serde_json::json!(null)),
        Just(serde_json::json!({ "a": [1, "b"] })),
    ];
    let set = (name.clone(), value).prop_map(|(name, value)| {
        serde_json::json!({ "op": "setParameters", "parameters": [{ "name": name, "value": value }], "id": "x" })
            .to_string()
    });
    let get = prop::collection::vec(name, 0..3).prop_map(|names| {
        serde_json::json!({ "op": "getParameters", "parameterNames": names, "id": "y" }).to_string()
    });
    let text = prop_oneof![
        subscriptions,
        ids,
        set,
        get,
        Just(r#"{"op":"subscribeParameterUpdates","parameterNames":[]}"#.to_owned()),
        Just(r#"{"op":"fetchAsset","uri":"a","requestId":1}"#.to_owned()),
        ".{0,60}",
    ];
    let call = (
        id.clone(),
        id,
        "cdr|json|[a-z]{0,4}",
        prop::collection::vec(any::<u8>(), 0..20),
    )
        .prop_map(|(service_id, call_id, encoding, payload)| {
            let call = ClientBinary::ServiceCall {
                service_id,
                call_id,
                encoding: &encoding,
                payload: &payload,
            };
            Message::Binary(call.to_bytes())
        });
    prop_oneof![
        4 => text.prop_map(Message::Text),
        2 => call,
        1 => prop::collection::vec(any::<u8>(), 0..40).prop_map(Message::Binary),
    ]
}

/// A message with one byte changed, or its end missing.
fn damaged() -> impl Strategy<Value = Message> {
    (
        said(),
        any::<prop::sample::Index>(),
        any::<u8>(),
        any::<bool>(),
    )
        .prop_map(|(message, at, byte, cut)| {
            let damage = |bytes: &mut Vec<u8>| {
                if bytes.is_empty() {
                    return;
                }
                let at = at.index(bytes.len());
                if cut {
                    bytes.truncate(at);
                } else {
                    bytes[at] = byte;
                }
            };
            match message {
                Message::Text(text) => {
                    let mut bytes = text.into_bytes();
                    damage(&mut bytes);
                    Message::Text(String::from_utf8_lossy(&bytes).into_owned())
                }
                Message::Binary(mut bytes) => {
                    damage(&mut bytes);
                    Message::Binary(bytes)
                }
            }
        })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Everything that is sent can be read; samples wait within their bound; a call is answered or handed on.
    #[test]
    fn a_connection_takes_whatever_comes(messages in prop::collection::vec(prop_oneof![said(), damaged()], 0..60)) {
        let mut connection = connection();
        for message in &messages {
            prop_assert!(connection.may_hear());
            match message {
                Message::Text(text) => connection.handle_text(text),
                Message::Binary(bytes) => connection.handle_binary(bytes),
            }
            while let Some(channel) = connection.poll_subscribed() {
                prop_assert!(connection.wants(channel) || matches!(message, Message::Text(_)));
                connection.push_state(channel, 1, &[0; 4]);
            }
            while let Some(call) = connection.poll_call() {
                prop_assert_eq!(call.service_id, 1);
                connection.answer(&call, Ok(&[0, 1, 0, 0]));
            }
            for step in 0_u32..100 {
                for channel in 0..12 {
                    connection.push_sample(channel, f64::from(step) * 0.004, step.into(), 0);
                }
            }
            while let Some(message) = connection.poll_state() {
                match message {
                    Message::Text(text) => prop_assert!(serde_json::from_str::<ServerText>(&text).is_ok(), "{}", text),
                    Message::Binary(bytes) => prop_assert!(ServerBinary::parse(&bytes).is_ok()),
                }
            }
            let waited = std::iter::from_fn(|| connection.poll_sample()).count();
            prop_assert!(waited <= 8 * Rate::MOST.hz().div_euclid(4.0) as usize + 8);
        }
    }

    /// Bytes that are no message are refused, never more.
    #[test]
    fn readers_take_any_bytes(bytes in prop::collection::vec(any::<u8>(), 0..64)) {
        if let Ok(read) = ClientBinary::parse(&bytes) {
            prop_assert_eq!(read.to_bytes(), bytes.clone());
        }
        let _ = ServerBinary::parse(&bytes);
        let _ = ClientText::parse(&String::from_utf8_lossy(&bytes));
    }
}
