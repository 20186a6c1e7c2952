//! The messages, as the specification lays them out.

use serde_json::{Value, json};
use teleclay_foxglove::client::{ClientBinary, ClientText, Parameter, Subscription};
use teleclay_foxglove::server::{Channel, ServerBinary, ServerText, Service, ServiceMessage};

fn written(text: &ServerText) -> Value {
    serde_json::from_str(&text.to_json()).unwrap()
}

/// Field names and values as the specification has them.
#[test]
fn what_a_server_says_is_named_as_the_specification_names_it() {
    let info = ServerText::ServerInfo {
        name: "clay".to_owned(),
        capabilities: vec!["services".to_owned()],
        supported_encodings: vec!["cdr".to_owned()],
        metadata: [("key".to_owned(), "value".to_owned())].into(),
        session_id: "7".to_owned(),
    };
    let channel = Channel {
        id: 3,
        topic: "/a".to_owned(),
        encoding: "cdr".to_owned(),
        schema_name: "std_msgs/msg/String".to_owned(),
        schema: "string data".to_owned(),
        schema_encoding: "ros2msg".to_owned(),
    };
    let message = |name: &str| ServiceMessage {
        encoding: "cdr".to_owned(),
        schema_name: name.to_owned(),
        schema_encoding: "ros2msg".to_owned(),
        schema: String::new(),
    };
    let service = Service {
        id: 4,
        name: "/b".to_owned(),
        kind: "std_srvs/srv/Trigger".to_owned(),
        request: message("Q"),
        response: message("A"),
    };
    let said = [
        (
            info,
            json!({ "op": "serverInfo", "name": "clay", "capabilities": ["services"], "supportedEncodings": ["cdr"],
                "metadata": { "key": "value" }, "sessionId": "7" }),
        ),
        (
            ServerText::Status {
                level: 2,
                message: "no".to_owned(),
            },
            json!({ "op": "status", "level": 2, "message": "no" }),
        ),
        (
            ServerText::Advertise {
                channels: vec![channel],
            },
            json!({ "op": "advertise", "channels": [{ "id": 3, "topic": "/a", "encoding": "cdr",
                "schemaName": "std_msgs/msg/String", "schema": "string data", "schemaEncoding": "ros2msg" }] }),
        ),
        (
            ServerText::Unadvertise {
                channel_ids: vec![3],
            },
            json!({ "op": "unadvertise", "channelIds": [3] }),
        ),
        (
            ServerText::AdvertiseServices {
                services: vec![service],
            },
            json!({ "op": "advertiseServices", "services": [{ "id": 4, "name": "/b", "type": "std_srvs/srv/Trigger",
                "request": { "encoding": "cdr", "schemaName": "Q", "schemaEncoding": "ros2msg", "schema": "" },
                "response": { "encoding": "cdr", "schemaName": "A", "schemaEncoding": "ros2msg", "schema": "" } }] }),
        ),
        (
            ServerText::UnadvertiseServices {
                service_ids: vec![4],
            },
            json!({ "op": "unadvertiseServices", "serviceIds": [4] }),
        ),
        (
            ServerText::ServiceCallFailure {
                service_id: 4,
                call_id: 9,
                message: "no".to_owned(),
            },
            json!({ "op": "serviceCallFailure", "serviceId": 4, "callId": 9, "message": "no" }),
        ),
        (
            ServerText::ParameterValues {
                parameters: vec![Parameter {
                    name: "p".to_owned(),
                    value: Some(json!(3.0)),
                    kind: Some("float64".to_owned()),
                }],
                id: Some("q".to_owned()),
            },
            json!({ "op": "parameterValues", "parameters": [{ "name": "p", "value": 3.0, "type": "float64" }], "id": "q" }),
        ),
    ];
    for (text, wanted) in said {
        assert_eq!(written(&text), wanted);
        assert_eq!(
            serde_json::from_str::<ServerText>(&text.to_json()).unwrap(),
            text
        );
    }
}

#[test]
fn what_a_client_says_is_read_as_the_specification_writes_it() {
    let heard = [
        (
            r#"{"op":"subscribe","subscriptions":[{"id":0,"channelId":3},{"id":1,"channelId":5}]}"#,
            ClientText::Subscribe {
                subscriptions: vec![
                    Subscription {
                        id: 0,
                        channel_id: 3,
                    },
                    Subscription {
                        id: 1,
                        channel_id: 5,
                    },
                ],
            },
        ),
        (
            r#"{"op":"unsubscribe","subscriptionIds":[0,1]}"#,
            ClientText::Unsubscribe {
                subscription_ids: vec![0, 1],
            },
        ),
        (
            r#"{"op":"getParameters","parameterNames":["/a"],"id":"request-123"}"#,
            ClientText::GetParameters {
                parameter_names: vec!["/a".to_owned()],
                id: Some("request-123".to_owned()),
            },
        ),
        (
            r#"{"op":"setParameters","parameters":[{"name":"/a","value":3,"type":"float64"},{"name":"/b"}]}"#,
            ClientText::SetParameters {
                parameters: vec![
                    Parameter {
                        name: "/a".to_owned(),
                        value: Some(json!(3)),
                        kind: Some("float64".to_owned()),
                    },
                    Parameter {
                        name: "/b".to_owned(),
                        value: None,
                        kind: None,
                    },
                ],
                id: None,
            },
        ),
        (
            r#"{"op":"subscribeConnectionGraph"}"#,
            ClientText::SubscribeConnectionGraph {},
        ),
        (
            r#"{"op":"fetchAsset","uri":"package://a","requestId":123,"more":true}"#,
            ClientText::FetchAsset {
                uri: "package://a".to_owned(),
                request_id: 123,
            },
        ),
    ];
    for (text, wanted) in heard {
        assert_eq!(ClientText::parse(text).unwrap(), wanted, "{text}");
    }
    for wrong in [
        "",
        "[]",
        "{}",
        r#"{"op":"dance"}"#,
        r#"{"op":"unsubscribe","subscriptionIds":[-1]}"#,
    ] {
        assert!(ClientText::parse(wrong).is_err(), "{wrong}");
    }
}

/// Opcode, fields in their order, each little-endian.
#[test]
fn binary_messages_are_laid_out_as_in_the_specification() {
    let data = ServerBinary::MessageData {
        subscription_id: 0x0403_0201,
        time_ns: 0x0c0b_0a09_0807_0605,
        payload: &[0xaa, 0xbb],
    };
    assert_eq!(
        data.to_bytes(),
        [1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0xaa, 0xbb]
    );
    assert_eq!(
        ServerBinary::Time { time_ns: 1 }.to_bytes(),
        [2, 1, 0, 0, 0, 0, 0, 0, 0]
    );
    let answer = ServerBinary::ServiceResponse {
        service_id: 1,
        call_id: 2,
        encoding: "cdr",
        payload: &[9],
    };
    let fields = [1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, b'c', b'd', b'r', 9];
    assert_eq!(answer.to_bytes(), [&[3][..], &fields].concat());
    let asset = ServerBinary::Asset {
        request_id: 5,
        content: Err("no"),
    };
    assert_eq!(asset.to_bytes(), [4, 5, 0, 0, 0, 1, 2, 0, 0, 0, b'n', b'o']);
    let call = [&[2][..], &fields].concat();
    assert_eq!(
        ClientBinary::parse(&call),
        Ok(ClientBinary::ServiceCall {
            service_id: 1,
            call_id: 2,
            encoding: "cdr",
            payload: &[9]
        })
    );
}
