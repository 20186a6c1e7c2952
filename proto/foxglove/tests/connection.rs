//! A connection, on virtual time.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use teleclay_foxglove::Connection;
use teleclay_foxglove::client::ClientBinary;
use teleclay_foxglove::connection::{Flow, Message, Rate};
use teleclay_foxglove::server::{Channel, ServerBinary, ServerText, Service, ServiceMessage};

/// Time between the samples of a loop that runs at 1 kHz and tells every fourth tick.
const PERIOD_NS: u64 = 4_000_000;

const WRENCH: u32 = 1;
const POSE: u32 = 2;
const EVENTS: u32 = 3;
const PAUSE: u32 = 1;

/// A client, what it has read so far, and the server at its other end.
struct Client {
    connection: Connection<u64>,
    texts: Vec<ServerText>,
    sample: u64,
}

impl Client {
    fn at_rate(hz: f64) -> Self {
        let info = ServerText::ServerInfo {
            name: "test".to_owned(),
            capabilities: Vec::new(),
            supported_encodings: Vec::new(),
            metadata: BTreeMap::new(),
            session_id: String::new(),
        };
        let mut connection = Connection::new(&info, Rate::new(hz).unwrap());
        let channel = |id, topic: &str, flow| (channel(id, topic), flow);
        connection.offer(
            vec![
                channel(WRENCH, "/wrench", Flow::Samples),
                channel(POSE, "/pose", Flow::Samples),
                channel(EVENTS, "/events", Flow::State),
            ],
            vec![service(PAUSE, "/pause")],
        );
        let mut client = Self {
            connection,
            texts: Vec::new(),
            sample: 0,
        };
        client.read_state();
        client
    }

    fn subscribed_at(hz: f64) -> Self {
        let mut client = Self::at_rate(hz);
        let subscriptions =
            [WRENCH, POSE, EVENTS].map(|id| json!({ "id": 10 * id, "channelId": id }));
        client.say(&json!({ "op": "subscribe", "subscriptions": subscriptions }));
        client
    }

    fn say(&mut self, text: &Value) {
        self.connection.handle_text(&text.to_string());
    }

    /// The loop runs on for so long, and nobody reads.
    fn run_s(&mut self, time_s: f64) {
        for _ in 0..(time_s * 250.0).round() as u64 {
            let time_ns = self.sample * PERIOD_NS;
            for channel in [WRENCH, POSE] {
                let at_s = self.sample as f64 * 0.004;
                self.connection
                    .push_sample(channel, at_s, time_ns, self.sample);
            }
            self.sample += 1;
        }
    }

    /// Reads everything that may not be lost: data by subscription.
    fn read_state(&mut self) -> Vec<(u32, Vec<u8>)> {
        let mut data = Vec::new();
        while let Some(message) = self.connection.poll_state() {
            match message {
                Message::Text(text) => self.texts.push(serde_json::from_str(&text).unwrap()),
                Message::Binary(bytes) => {
                    if let ServerBinary::MessageData {
                        subscription_id,
                        payload,
                        ..
                    } = ServerBinary::parse(&bytes).unwrap()
                    {
                        data.push((subscription_id, payload.to_vec()));
                    }
                }
            }
        }
        data
    }

    /// Reads the samples that wait: times of one subscription, ns.
    fn read_samples(&mut self, subscription: u32) -> Vec<u64> {
        let read = std::iter::from_fn(|| self.connection.poll_sample());
        read.filter(|read| read.subscription_id == subscription)
            .map(|read| read.time_ns)
            .collect()
    }

    fn last_status(&mut self) -> String {
        self.read_state();
        match self.texts.last() {
            Some(ServerText::Status { message, .. }) => message.clone(),
            other => panic!("{other:?}"),
        }
    }

    fn values(&mut self, names: &[&str]) -> BTreeMap<String, Value> {
        self.say(&json!({ "op": "getParameters", "parameterNames": names, "id": "q" }));
        self.read_state();
        match self.texts.last() {
            Some(ServerText::ParameterValues { parameters, id }) if id.as_deref() == Some("q") => {
                parameters
                    .iter()
                    .map(|parameter| (parameter.name.clone(), parameter.value.clone().unwrap()))
                    .collect()
            }
            other => panic!("{other:?}"),
        }
    }
}

fn channel(id: u32, topic: &str) -> Channel {
    Channel {
        id,
        topic: topic.to_owned(),
        encoding: "cdr".to_owned(),
        schema_name: "std_msgs/msg/String".to_owned(),
        schema: "string data".to_owned(),
        schema_encoding: "ros2msg".to_owned(),
    }
}

fn service(id: u32, name: &str) -> Service {
    let message = ServiceMessage {
        encoding: "cdr".to_owned(),
        schema_name: "std_srvs/srv/SetBool_Request".to_owned(),
        schema_encoding: "ros2msg".to_owned(),
        schema: "bool data".to_owned(),
    };
    Service {
        id,
        name: name.to_owned(),
        kind: "std_srvs/srv/SetBool".to_owned(),
        request: message.clone(),
        response: message,
    }
}

#[test]
fn the_server_speaks_first_and_describes_what_there_is() {
    let client = Client::at_rate(60.0);
    assert!(matches!(client.texts[0], ServerText::ServerInfo { .. }));
    let topics: Vec<&str> = client
        .texts
        .iter()
        .filter_map(|text| match text {
            ServerText::Advertise { channels } => Some(channels),
            _ => None,
        })
        .flatten()
        .map(|channel| channel.topic.as_str())
        .collect();
    assert_eq!(topics, ["/wrench", "/pose", "/events"]);
}

#[test]
fn samples_come_at_the_rate_that_was_asked_for_on_each_topic() {
    let mut client = Client::subscribed_at(50.0);
    client.say(&json!({ "op": "setParameters", "parameters": [{ "name": "teleclay.rate_hz./pose", "value": 20 }] }));
    let (mut wrench, mut pose) = (0, 0);
    for _ in 0..500 {
        client.run_s(0.02);
        for read in std::iter::from_fn(|| client.connection.poll_sample()) {
            match read.subscription_id {
                10 => wrench += 1,
                20 => pose += 1,
                other => panic!("{other}"),
            }
        }
    }
    assert_eq!((wrench, pose), (500, 200), "ten seconds");
    let values = client.values(&[
        "teleclay.rate_hz",
        "teleclay.rate_hz./pose",
        "teleclay.rate_hz./wrench",
        "other",
    ]);
    assert_eq!(
        values,
        [
            ("teleclay.rate_hz", 50.0),
            ("teleclay.rate_hz./pose", 20.0),
            ("teleclay.rate_hz./wrench", 50.0)
        ]
        .map(|(name, hz)| (name.to_owned(), json!(hz)))
        .into()
    );
    assert_eq!(client.connection.take_left_out(), 0);
}

/// Ten seconds without a reader: what waits is the last quarter of a second, and all that has happened.
#[test]
fn after_a_stall_there_is_no_flood_and_no_state_is_missing() {
    let mut client = Client::subscribed_at(100.0);
    for event in 0..250_u8 {
        client.run_s(0.04);
        client.connection.push_state(EVENTS, 0, &[event]);
    }
    let events: Vec<u8> = client
        .read_state()
        .iter()
        .map(|(_, payload)| payload[0])
        .collect();
    assert_eq!(events, (0..250).collect::<Vec<u8>>());
    let times_ns = client.read_samples(10);
    assert_eq!(times_ns.len(), 25);
    let now_ns = client.sample * PERIOD_NS;
    assert!(
        times_ns
            .iter()
            .all(|time_ns| now_ns - time_ns <= 260_000_000),
        "{times_ns:?}"
    );
    assert!(times_ns.is_sorted());
    assert_eq!(client.connection.take_left_out(), 2 * (1000 - 25));
    // It goes on as before.
    client.run_s(0.1);
    assert_eq!(client.read_samples(10).len(), 10);
}

#[test]
fn samples_leave_in_the_order_in_which_they_were_taken() {
    let mut client = Client::subscribed_at(250.0);
    client.run_s(0.1);
    let times: Vec<u64> = std::iter::from_fn(|| client.connection.poll_sample())
        .map(|read| read.time_ns)
        .collect();
    assert_eq!(times.len(), 50);
    assert!(times.is_sorted());
}

#[test]
fn a_client_that_takes_no_state_is_to_be_closed_before_it_loses_any() {
    let mut client = Client::subscribed_at(60.0);
    let mut events = 0;
    while !client.connection.is_overfull() {
        client.connection.push_state(EVENTS, 0, &[0; 1000]);
        events += 1;
    }
    assert!(events < 10_000);
    assert_eq!(client.read_state().len(), events);
}

#[test]
fn what_nobody_is_subscribed_to_waits_nowhere() {
    let mut client = Client::at_rate(60.0);
    client.run_s(1.0);
    client.connection.push_state(EVENTS, 0, &[1]);
    assert!(client.read_state().is_empty() && client.read_samples(10).is_empty());
    client.say(&json!({ "op": "subscribe", "subscriptions": [{ "id": 7, "channelId": EVENTS }] }));
    assert_eq!(client.connection.poll_subscribed(), Some(EVENTS));
    client.connection.push_state(EVENTS, 0, &[2]);
    assert_eq!(client.read_state(), [(7, vec![2])]);
    client.say(&json!({ "op": "unsubscribe", "subscriptionIds": [7] }));
    client.connection.push_state(EVENTS, 0, &[3]);
    assert!(client.read_state().is_empty());
}

#[test]
fn what_cannot_be_subscribed_to_is_told_in_words() {
    let mut client = Client::subscribed_at(60.0);
    for (subscription, channel, words) in [
        (1, 99, "no channel 99"),
        (10, 1, "subscription 10"),
        (5, 1, "/wrench"),
    ] {
        client.say(&json!({ "op": "subscribe", "subscriptions": [{ "id": subscription, "channelId": channel }] }));
        let said = client.last_status();
        assert!(said.contains(words), "{said}");
    }
    client.say(&json!({ "op": "unsubscribe", "subscriptionIds": [4] }));
    assert!(client.last_status().contains("no subscription 4"));
    client.say(&json!({ "op": "advertise", "channels": [{ "id": 1, "topic": "/x", "encoding": "cdr", "schemaName": "y" }] }));
    assert!(client.last_status().contains("takes no messages"));
    client.connection.handle_text("{");
    assert!(client.last_status().contains("not understood"));
    client.connection.handle_binary(&[9]);
    assert!(client.last_status().contains("byte 9"));
}

#[test]
fn a_session_that_goes_takes_its_subscriptions_and_rates_with_it() {
    let mut client = Client::subscribed_at(60.0);
    client.say(&json!({ "op": "setParameters", "parameters": [{ "name": "teleclay.rate_hz./pose", "value": 20 }] }));
    client.connection.withdraw(vec![POSE], vec![PAUSE]);
    client.run_s(0.1);
    assert!(client.read_samples(20).is_empty());
    client.read_state();
    let [.., gone, silent] = &client.texts[..] else {
        panic!()
    };
    assert_eq!(
        gone,
        &ServerText::Unadvertise {
            channel_ids: vec![POSE]
        }
    );
    assert_eq!(
        silent,
        &ServerText::UnadvertiseServices {
            service_ids: vec![PAUSE]
        }
    );
    assert!(client.values(&["teleclay.rate_hz./pose"]).is_empty());
    // The number is free again.
    client
        .connection
        .offer(vec![(channel(9, "/pose"), Flow::Samples)], Vec::new());
    client.say(&json!({ "op": "subscribe", "subscriptions": [{ "id": 20, "channelId": 9 }] }));
    client.connection.push_sample(9, 0.0, 0, 0);
    assert_eq!(client.read_samples(20).len(), 1);
}

#[test]
fn a_rate_that_cannot_be_is_refused_and_what_holds_is_told() {
    let mut client = Client::subscribed_at(60.0);
    for value in [json!(0), json!(-3), json!(251), json!("fast"), json!([1])] {
        let set = json!([{ "name": "teleclay.rate_hz./pose", "value": value }]);
        client.say(&json!({ "op": "setParameters", "parameters": set, "id": "s" }));
        client.read_state();
        let [.., warned, told] = &client.texts[..] else {
            panic!()
        };
        assert!(
            matches!(warned, ServerText::Status { level: 1, .. }),
            "{warned:?}"
        );
        let ServerText::ParameterValues { parameters, id } = told else {
            panic!("{told:?}")
        };
        assert_eq!(
            (id.as_deref(), &parameters[0].value),
            (Some("s"), &Some(json!(60.0)))
        );
    }
    client.say(&json!({ "op": "setParameters", "parameters": [{ "name": "teleclay.rate_hz./events", "value": 1 }] }));
    assert!(client.last_status().contains("/events"));
    // Taken back, a rate is what it was to begin with.
    for (value, holds) in [(json!(30), 30.0), (json!(null), 60.0)] {
        client.say(&json!({ "op": "setParameters", "parameters": [{ "name": "teleclay.rate_hz", "value": value }] }));
        assert_eq!(
            client.values(&["teleclay.rate_hz"])["teleclay.rate_hz"],
            json!(holds)
        );
    }
}

#[test]
fn facts_are_shown_and_told_of_and_not_set() {
    let mut client = Client::at_rate(60.0);
    let facts = |scheme: &str| [("teleclay.demo.scheme".to_owned(), json!(scheme))].into();
    client.connection.set_facts(facts("replica"));
    assert!(client.read_state().is_empty());
    assert_eq!(client.values(&[])["teleclay.demo.scheme"], json!("replica"));
    client.say(
        &json!({ "op": "subscribeParameterUpdates", "parameterNames": ["teleclay.demo.scheme"] }),
    );
    let before = client.texts.len();
    client.connection.set_facts(facts("replica"));
    client.read_state();
    assert_eq!(client.texts.len(), before, "nothing has changed");
    client.connection.set_facts(facts("wave"));
    client.read_state();
    let Some(ServerText::ParameterValues {
        parameters,
        id: None,
    }) = client.texts.last()
    else {
        panic!()
    };
    assert_eq!(parameters[0].value, Some(json!("wave")));
    client.say(&json!({ "op": "setParameters", "parameters": [{ "name": "teleclay.demo.scheme", "value": "tdpa" }] }));
    client.read_state();
    let words = format!("{:?}", client.texts);
    assert!(words.contains("services change sessions"), "{words}");
    assert_eq!(
        client.values(&["teleclay.demo.scheme"])["teleclay.demo.scheme"],
        json!("wave")
    );
}

fn call(service_id: u32, encoding: &str) -> Vec<u8> {
    let call = ClientBinary::ServiceCall {
        service_id,
        call_id: 77,
        encoding,
        payload: &[0, 1, 0, 0, 1],
    };
    call.to_bytes()
}

#[test]
fn a_call_is_handed_on_and_its_answer_comes_under_its_number() {
    let mut client = Client::at_rate(60.0);
    client.connection.handle_binary(&call(PAUSE, "cdr"));
    let call = client.connection.poll_call().unwrap();
    assert_eq!(
        (call.service_id, call.call_id, &call.payload[..]),
        (PAUSE, 77, &[0, 1, 0, 0, 1][..])
    );
    client.connection.answer(&call, Ok(&[5]));
    let Some(Message::Binary(bytes)) = client.connection.poll_state() else {
        panic!()
    };
    assert_eq!(
        ServerBinary::parse(&bytes),
        Ok(ServerBinary::ServiceResponse {
            service_id: PAUSE,
            call_id: 77,
            encoding: "cdr",
            payload: &[5]
        })
    );
    client
        .connection
        .answer(&call, Err("a spectator only watches"));
    client.read_state();
    let Some(ServerText::ServiceCallFailure {
        call_id: 77,
        message,
        ..
    }) = client.texts.last()
    else {
        panic!()
    };
    assert_eq!(message, "a spectator only watches");
}

#[test]
fn a_call_of_nothing_or_in_another_encoding_fails_in_words() {
    let mut client = Client::at_rate(60.0);
    for (bytes, words) in [
        (call(9, "cdr"), "no service 9"),
        (call(PAUSE, "json"), "`json`"),
    ] {
        client.connection.handle_binary(&bytes);
        assert_eq!(client.connection.poll_call(), None);
        client.read_state();
        let Some(ServerText::ServiceCallFailure {
            call_id: 77,
            message,
            ..
        }) = client.texts.last()
        else {
            panic!()
        };
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn a_client_that_asks_and_does_not_read_is_heard_no_longer() {
    let mut client = Client::at_rate(60.0);
    let mut heard = 0;
    while client.connection.may_hear() {
        client.say(&json!({ "op": "getParameters", "parameterNames": [], "id": "q" }));
        heard += 1;
        assert!(heard < 1000);
    }
    client.read_state();
    assert!(client.connection.may_hear());
    while client.connection.may_hear() {
        client.connection.handle_binary(&call(PAUSE, "cdr"));
        heard += 1;
        assert!(heard < 1000);
    }
    client.connection.poll_call().unwrap();
    assert!(client.connection.may_hear());
}
