//! What a client says.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::bytes::{BinaryError, Reader, put_text};

/// A text message of a client.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub enum ClientText {
    /// It wants what comes on some channels.
    Subscribe {
        /// The channels.
        subscriptions: Vec<Subscription>,
    },
    /// It no longer wants that.
    Unsubscribe {
        /// Its own numbers of the subscriptions.
        subscription_ids: Vec<u32>,
    },
    /// It asks for parameters.
    GetParameters {
        /// Their names; all of them where there is none.
        parameter_names: Vec<String>,
        /// What the answer is to carry.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        id: Option<String>,
    },
    /// It wants parameters to be otherwise.
    SetParameters {
        /// Names and values.
        parameters: Vec<Parameter>,
        /// What the answer is to carry; without it none is needed.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        id: Option<String>,
    },
    /// It wants to be told whenever parameters change.
    SubscribeParameterUpdates {
        /// Their names; all of them where there is none.
        parameter_names: Vec<String>,
    },
    /// It no longer wants that.
    UnsubscribeParameterUpdates {
        /// Their names; all of them where there is none.
        parameter_names: Vec<String>,
    },
    /// It would like to publish on channels of its own.
    Advertise {
        /// The channels, as they came.
        channels: Vec<Value>,
    },
    /// It would no longer like that.
    Unadvertise {
        /// Its own numbers of the channels.
        channel_ids: Vec<u32>,
    },
    /// It would like to know who publishes and subscribes.
    SubscribeConnectionGraph {},
    /// It would no longer like that.
    UnsubscribeConnectionGraph {},
    /// It would like a file.
    FetchAsset {
        /// Where the file is.
        uri: String,
        /// What the answer is to carry.
        request_id: u32,
    },
}

/// One subscription.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Subscription {
    /// The client's own number.
    pub id: u32,
    /// The channel.
    pub channel_id: u32,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its value; none takes it back.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<Value>,
    /// How a value is to be read that JSON leaves open, such as `float64`.
    #[serde(rename = "type", default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<String>,
}

impl ClientText {
    /// Reads a message. Fields that the protocol does not name are passed over.
    ///
    /// # Errors
    /// It is not JSON, no message of a client, or a field is missing or of another type.
    pub fn parse(text: &str) -> Result<Self, serde_json::Error> {
        serde_json::from_str(text)
    }
}

const MESSAGE_DATA: u8 = 1;
const SERVICE_CALL: u8 = 2;

/// A binary message of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClientBinary<'a> {
    /// Something that it publishes.
    MessageData {
        /// Its own number of the channel.
        channel_id: u32,
        /// The message.
        payload: &'a [u8],
    },
    /// It calls a service.
    ServiceCall {
        /// The service.
        service_id: u32,
        /// The client's own number of the call.
        call_id: u32,
        /// How the payload is written.
        encoding: &'a str,
        /// The request.
        payload: &'a [u8],
    },
}

impl<'a> ClientBinary<'a> {
    /// Reads a message.
    ///
    /// # Errors
    /// No message begins so, or it ends too early.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, BinaryError> {
        let mut reader = Reader::new(bytes);
        match reader.opcode()? {
            MESSAGE_DATA => Ok(Self::MessageData {
                channel_id: reader.u32()?,
                payload: reader.rest(),
            }),
            SERVICE_CALL => Ok(Self::ServiceCall {
                service_id: reader.u32()?,
                call_id: reader.u32()?,
                encoding: reader.text()?,
                payload: reader.rest(),
            }),
            got => Err(BinaryError::Opcode { got }),
        }
    }

    /// The bytes of the message.
    #[must_use]
    pub fn to_bytes(self) -> Vec<u8> {
        let mut out = Vec::new();
        match self {
            Self::MessageData {
                channel_id,
                payload,
            } => {
                out.push(MESSAGE_DATA);
                out.extend(channel_id.to_le_bytes());
                out.extend(payload);
            }
            Self::ServiceCall {
                service_id,
                call_id,
                encoding,
                payload,
            } => {
                out.push(SERVICE_CALL);
                out.extend(service_id.to_le_bytes());
                out.extend(call_id.to_le_bytes());
                put_text(encoding, &mut out);
                out.extend(payload);
            }
        }
        out
    }
}
