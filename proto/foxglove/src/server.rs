//! What a server says.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::bytes::{BinaryError, Reader, put_text};
use crate::client::Parameter;

/// A text message of a server.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub enum ServerText {
    /// What the server is and can do; the first message of all.
    ServerInfo {
        /// Who it is, for people.
        name: String,
        /// What it offers beside channels.
        capabilities: Vec<String>,
        /// How requests of services may be written.
        supported_encodings: Vec<String>,
        /// What else there is to know of it.
        metadata: BTreeMap<String, String>,
        /// Another one for each run of the server.
        session_id: String,
    },
    /// Something that whoever uses the client should know.
    Status {
        /// 0 tells, 1 warns, 2 is an error.
        level: u8,
        /// What there is to know, for people.
        message: String,
    },
    /// There are channels.
    Advertise {
        /// The channels.
        channels: Vec<Channel>,
    },
    /// There are channels no longer.
    Unadvertise {
        /// Their numbers.
        channel_ids: Vec<u32>,
    },
    /// What parameters are.
    ParameterValues {
        /// Names and values.
        parameters: Vec<Parameter>,
        /// What the request carried.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        id: Option<String>,
    },
    /// There are services.
    AdvertiseServices {
        /// The services.
        services: Vec<Service>,
    },
    /// There are services no longer.
    UnadvertiseServices {
        /// Their numbers.
        service_ids: Vec<u32>,
    },
    /// A service was not called, or could not do what it was asked for.
    ServiceCallFailure {
        /// The service.
        service_id: u32,
        /// The client's number of the call.
        call_id: u32,
        /// Why, for people.
        message: String,
    },
}

/// A channel: a topic with messages of one type.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Channel {
    /// Its number.
    pub id: u32,
    /// What it is called.
    pub topic: String,
    /// How its messages are written.
    pub encoding: String,
    /// The type of its messages.
    pub schema_name: String,
    /// What that type is.
    pub schema: String,
    /// How that is written.
    pub schema_encoding: String,
}

/// A service.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Service {
    /// Its number.
    pub id: u32,
    /// What it is called.
    pub name: String,
    /// The type of the service.
    #[serde(rename = "type")]
    pub kind: String,
    /// What it is asked.
    pub request: ServiceMessage,
    /// What it answers.
    pub response: ServiceMessage,
}

/// One side of a service.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct ServiceMessage {
    /// How it is written.
    pub encoding: String,
    /// Its type.
    pub schema_name: String,
    /// How what that type is is written.
    pub schema_encoding: String,
    /// What that type is.
    pub schema: String,
}

impl ServerText {
    /// The message as it is sent.
    ///
    /// # Panics
    /// Never: every map in it has strings as keys.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("every map in it has strings as keys")
    }
}

const MESSAGE_DATA: u8 = 1;
const TIME: u8 = 2;
const SERVICE_RESPONSE: u8 = 3;
const ASSET: u8 = 4;

/// A binary message of a server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServerBinary<'a> {
    /// A message on a channel.
    MessageData {
        /// The client's number of its subscription.
        subscription_id: u32,
        /// When, ns since 1970.
        time_ns: u64,
        /// The message.
        payload: &'a [u8],
    },
    /// What time it is, for servers whose time is not everybody's.
    Time {
        /// Time, ns.
        time_ns: u64,
    },
    /// What a service answers.
    ServiceResponse {
        /// The service.
        service_id: u32,
        /// The client's number of the call.
        call_id: u32,
        /// How the payload is written.
        encoding: &'a str,
        /// The answer.
        payload: &'a [u8],
    },
    /// A file, or why there is none.
    Asset {
        /// What the request carried.
        request_id: u32,
        /// The file.
        content: Result<&'a [u8], &'a str>,
    },
}

impl<'a> ServerBinary<'a> {
    /// Reads a message.
    ///
    /// # Errors
    /// No message begins so, or it ends too early.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, BinaryError> {
        let mut reader = Reader::new(bytes);
        match reader.opcode()? {
            MESSAGE_DATA => Ok(Self::MessageData {
                subscription_id: reader.u32()?,
                time_ns: reader.u64()?,
                payload: reader.rest(),
            }),
            TIME => Ok(Self::Time {
                time_ns: reader.u64()?,
            }),
            SERVICE_RESPONSE => Ok(Self::ServiceResponse {
                service_id: reader.u32()?,
                call_id: reader.u32()?,
                encoding: reader.text()?,
                payload: reader.rest(),
            }),
            ASSET => {
                let (request_id, status) = (reader.u32()?, reader.u8()?);
                let reason = reader.text()?;
                let content = if status == 0 {
                    Ok(reader.rest())
                } else {
                    Err(reason)
                };
                Ok(Self::Asset {
                    request_id,
                    content,
                })
            }
            got => Err(BinaryError::Opcode { got }),
        }
    }

    /// The bytes of the message.
    #[must_use]
    pub fn to_bytes(self) -> Vec<u8> {
        let mut out = Vec::new();
        match self {
            Self::MessageData {
                subscription_id,
                time_ns,
                payload,
            } => {
                out.reserve_exact(13 + payload.len());
                out.push(MESSAGE_DATA);
                out.extend(subscription_id.to_le_bytes());
                out.extend(time_ns.to_le_bytes());
                out.extend(payload);
            }
            Self::Time { time_ns } => {
                out.push(TIME);
                out.extend(time_ns.to_le_bytes());
            }
            Self::ServiceResponse {
                service_id,
                call_id,
                encoding,
                payload,
            } => {
                out.push(SERVICE_RESPONSE);
                out.extend(service_id.to_le_bytes());
                out.extend(call_id.to_le_bytes());
                put_text(encoding, &mut out);
                out.extend(payload);
            }
            Self::Asset {
                request_id,
                content,
            } => {
                out.push(ASSET);
                out.extend(request_id.to_le_bytes());
                match content {
                    Ok(content) => {
                        out.push(0);
                        put_text("", &mut out);
                        out.extend(content);
                    }
                    Err(reason) => {
                        out.push(1);
                        put_text(reason, &mut out);
                    }
                }
            }
        }
        out
    }
}
