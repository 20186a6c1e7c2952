//! A client of Foxglove's protocol, read with patience.

use std::collections::BTreeMap;
use std::net::TcpStream;
use std::time::Instant;

use serde_json::{Value, json};
use teleclay_foxglove::SUBPROTOCOLS;
use teleclay_foxglove::client::ClientBinary;
use teleclay_foxglove::server::{Channel, ServerBinary, ServerText, Service};
use teleclay_ros::{Message as RosMessage, to_cdr};
use tokio_tungstenite::tungstenite::handshake::client::generate_key;
use tokio_tungstenite::tungstenite::http::Request;
use tokio_tungstenite::tungstenite::{Error, Message, WebSocket, client};

use crate::rig::PATIENCE;
use crate::wire::Site;

/// Where the protocol is spoken.
pub(crate) const PATH: &str = "/foxglove";

/// A client, and what it was told there is.
pub(crate) struct Client {
    pub(crate) socket: WebSocket<TcpStream>,
    pub(crate) protocol: String,
    pub(crate) channels: BTreeMap<u32, Channel>,
    pub(crate) services: BTreeMap<u32, Service>,
    pub(crate) info: Option<ServerText>,
    /// Texts that are neither of these.
    pub(crate) texts: Vec<ServerText>,
    /// Data by the client's number of its subscription: when, and what.
    data: Vec<(u32, u64, Vec<u8>)>,
    answers: Vec<(u32, Vec<u8>)>,
    next: u32,
}

impl Client {
    pub(crate) fn open(site: &Site) -> Self {
        Self::offering(&format!("other, {}", SUBPROTOCOLS[0]), PATH, site)
    }

    pub(crate) fn offering(offered: &str, path: &str, site: &Site) -> Self {
        let request = Request::builder()
            .uri(format!("ws://{}{path}", site.address))
            .header("Host", site.address.to_string())
            .header("Connection", "Upgrade")
            .header("Upgrade", "websocket")
            .header("Sec-WebSocket-Version", "13")
            .header("Sec-WebSocket-Key", generate_key())
            .header("Sec-WebSocket-Protocol", offered)
            .body(())
            .unwrap();
        let (socket, answer) = client(request, site.connect()).unwrap();
        let protocol = answer.headers()["sec-websocket-protocol"].to_str().unwrap();
        Self {
            protocol: protocol.to_owned(),
            socket,
            channels: BTreeMap::new(),
            services: BTreeMap::new(),
            info: None,
            texts: Vec::new(),
            data: Vec::new(),
            answers: Vec::new(),
            next: 1,
        }
    }

    /// Takes one message in.
    fn read(&mut self) -> Result<(), Error> {
        match self.socket.read()? {
            Message::Text(text) => match serde_json::from_str(&text).unwrap() {
                info @ ServerText::ServerInfo { .. } => self.info = Some(info),
                ServerText::Advertise { channels } => {
                    let channels = channels.into_iter();
                    self.channels
                        .extend(channels.map(|channel| (channel.id, channel)));
                }
                ServerText::Unadvertise { channel_ids } => {
                    self.channels.retain(|id, _| !channel_ids.contains(id));
                }
                ServerText::AdvertiseServices { services } => {
                    let services = services.into_iter();
                    self.services
                        .extend(services.map(|service| (service.id, service)));
                }
                ServerText::UnadvertiseServices { service_ids } => {
                    self.services.retain(|id, _| !service_ids.contains(id));
                }
                text => self.texts.push(text),
            },
            Message::Binary(bytes) => match ServerBinary::parse(&bytes).unwrap() {
                ServerBinary::MessageData {
                    subscription_id,
                    time_ns,
                    payload,
                } => self.data.push((subscription_id, time_ns, payload.to_vec())),
                ServerBinary::ServiceResponse {
                    call_id, payload, ..
                } => self.answers.push((call_id, payload.to_vec())),
                other => panic!("{other:?}"),
            },
            _ => {}
        }
        Ok(())
    }

    /// Reads on until something holds.
    pub(crate) fn until<T>(
        &mut self,
        what: &str,
        mut found: impl FnMut(&mut Self) -> Option<T>,
    ) -> T {
        let began = Instant::now();
        loop {
            if let Some(found) = found(self) {
                return found;
            }
            assert!(began.elapsed() < PATIENCE, "waited in vain: {what}");
            self.read().unwrap();
        }
    }

    /// Knows of everything that a session offers.
    pub(crate) fn until_session(&mut self, session: &str) {
        let pause = format!("/teleclay/{session}/pause");
        self.until("the session's services", |client| {
            let mut services = client.services.values();
            services.any(|service| service.name == pause).then_some(())
        });
    }

    pub(crate) fn has_service(&self, name: &str) -> bool {
        let mut services = self.services.values();
        services.any(|service| service.name == name)
    }

    pub(crate) fn say(&mut self, text: &Value) {
        self.socket.send(Message::text(text.to_string())).unwrap();
    }

    pub(crate) fn channel(&self, topic: &str) -> Option<u32> {
        let mut channels = self.channels.values();
        channels.find_map(|channel| (channel.topic == topic).then_some(channel.id))
    }

    /// Subscribes; the number of the subscription.
    pub(crate) fn subscribe(&mut self, topic: &str) -> u32 {
        let channel = self
            .channel(topic)
            .unwrap_or_else(|| panic!("{topic} is not offered"));
        let id = self.next;
        self.next += 1;
        self.say(
            &json!({ "op": "subscribe", "subscriptions": [{ "id": id, "channelId": channel }] }),
        );
        id
    }

    /// The next message of a subscription: when, ns, and its bytes.
    pub(crate) fn message(&mut self, subscription: u32) -> (u64, Vec<u8>) {
        self.until("a message", |client| {
            let at = client
                .data
                .iter()
                .position(|(id, ..)| *id == subscription)?;
            let (_, time_ns, payload) = client.data.remove(at);
            Some((time_ns, payload))
        })
    }

    pub(crate) fn status(&mut self) -> String {
        self.until("a status", |client| {
            client.texts.pop().map(|text| match text {
                ServerText::Status { message, .. } => message,
                other => panic!("{other:?}"),
            })
        })
    }

    /// Calls a service: its response, or why there is none.
    pub(crate) fn call(
        &mut self,
        name: &str,
        request: &impl RosMessage,
    ) -> Result<Vec<u8>, String> {
        let mut services = self.services.values();
        let service = services.find(|service| service.name == name);
        let service_id = service
            .unwrap_or_else(|| panic!("{name} is not offered"))
            .id;
        let call_id = self.next;
        self.next += 1;
        let mut payload = Vec::new();
        to_cdr(request, &mut payload);
        let call = ClientBinary::ServiceCall {
            service_id,
            call_id,
            encoding: "cdr",
            payload: &payload,
        };
        self.socket.send(Message::binary(call.to_bytes())).unwrap();
        self.until("an answer", |client| {
            if let Some((_, payload)) = client.answers.pop() {
                return Some(Ok(payload));
            }
            let failure = client.texts.pop()?;
            match failure {
                ServerText::ServiceCallFailure { message, .. } => Some(Err(message)),
                other => panic!("{other:?}"),
            }
        })
    }

    /// Reads the rest; the code that the server closes with.
    pub(crate) fn ending(mut self) -> u16 {
        let began = Instant::now();
        loop {
            assert!(began.elapsed() < PATIENCE, "the socket does not end");
            if let Message::Close(frame) = self.socket.read().unwrap() {
                self.socket.flush().ok();
                return frame.expect("a reason").code.into();
            }
        }
    }
}
