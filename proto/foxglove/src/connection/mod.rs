//! One client: what it is told there is, what it wants, what waits for it.

mod parameters;
mod rate;
mod waiting;

use std::collections::{BTreeMap, VecDeque};

use serde_json::Value;

use self::parameters::Parameters;
use self::rate::Pace;
use self::waiting::{Samples, State};
use crate::client::{ClientBinary, ClientText, Parameter, Subscription};
use crate::server::{Channel, ServerBinary, ServerText, Service};

pub use self::parameters::{RATE, RATE_OF};
pub use self::rate::{Rate, RateError};
pub use self::waiting::Message;

/// Calls that wait to be carried out; while so many do, nothing more is heard.
const MOST_CALLS: usize = 16;

/// Messages of state that wait while the client is heard: one that says much and reads nothing waits for itself.
const MOST_STATE_WHILE_HEARD: usize = 64;

/// Bytes of state that may wait for a client. The description of as many sessions as a server may have takes half.
const MOST_STATE_BYTES: usize = 8 << 20;

/// Channels that one message describes: a schema takes a kilobyte or two.
const CHANNELS_IN_A_MESSAGE: usize = 32;

/// How much of what a client wrote is repeated to it, bytes.
const MOST_REPEATED: usize = 200;

/// How requests of services are written.
pub const SERVICE_ENCODING: &str = "cdr";

/// What comes on a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Samples of something that moves: at a rate, and the newest count.
    Samples,
    /// Something that has changed or happened: each message counts.
    State,
}

/// A call of a service.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Call {
    /// The service.
    pub service_id: u32,
    /// The client's own number of the call.
    pub call_id: u32,
    /// The request, in [`SERVICE_ENCODING`].
    pub payload: Vec<u8>,
}

/// A sample on its way.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampled<P> {
    /// The client's own number of its subscription.
    pub subscription_id: u32,
    /// When it was, ns since 1970.
    pub time_ns: u64,
    /// The sample, which is written when its turn has come.
    pub sample: P,
}

/// A connection to one client, without its socket. `P` is a sample before it is written.
///
/// | call | when |
/// |---|---|
/// | [`offer`](Self::offer), [`withdraw`](Self::withdraw), [`set_facts`](Self::set_facts) | there is more, less or something else to be had |
/// | [`handle_text`](Self::handle_text), [`handle_binary`](Self::handle_binary) | something came, and [`may_hear`](Self::may_hear) |
/// | [`poll_subscribed`](Self::poll_subscribed), [`poll_call`](Self::poll_call) | after each of those, until there is none |
/// | [`push_state`](Self::push_state), [`push_sample`](Self::push_sample), [`answer`](Self::answer) | there is something to be sent |
/// | [`poll_state`](Self::poll_state), then [`poll_sample`](Self::poll_sample) | the socket takes a message |
#[derive(Debug)]
pub struct Connection<P> {
    channels: BTreeMap<u32, Offered>,
    /// Names by number.
    services: BTreeMap<u32, String>,
    /// By the client's own numbers.
    subscriptions: BTreeMap<u32, Subscribed<P>>,
    /// The client's number for each channel that it is subscribed to.
    by_channel: BTreeMap<u32, u32>,
    parameters: Parameters,
    /// Channels that were subscribed to just now.
    subscribed: VecDeque<u32>,
    calls: VecDeque<Call>,
    state: State,
    left_out: u64,
}

#[derive(Debug)]
struct Offered {
    topic: String,
    flow: Flow,
}

#[derive(Debug)]
struct Subscribed<P> {
    channel_id: u32,
    pace: Pace,
    samples: Samples<P>,
}

impl<P> Connection<P> {
    /// A connection that begins with what the server says of itself; samples come at this rate unless the client asks
    /// for another one.
    #[must_use]
    pub fn new(info: &ServerText, rate: Rate) -> Self {
        let mut state = State::default();
        state.push(Message::Text(info.to_json()));
        Self {
            channels: BTreeMap::new(),
            services: BTreeMap::new(),
            subscriptions: BTreeMap::new(),
            by_channel: BTreeMap::new(),
            parameters: Parameters::new(rate),
            subscribed: VecDeque::new(),
            calls: VecDeque::new(),
            state,
            left_out: 0,
        }
    }

    /// There are these channels and services, too. Their numbers are new ones.
    pub fn offer(&mut self, channels: Vec<(Channel, Flow)>, services: Vec<Service>) {
        let mut described = Vec::new();
        for (channel, flow) in channels {
            let topic = channel.topic.clone();
            self.channels.insert(channel.id, Offered { topic, flow });
            described.push(channel);
            if described.len() == CHANNELS_IN_A_MESSAGE {
                let channels = std::mem::take(&mut described);
                self.say(&ServerText::Advertise { channels });
            }
        }
        if !described.is_empty() {
            self.say(&ServerText::Advertise {
                channels: described,
            });
        }
        if !services.is_empty() {
            let names = services.iter();
            self.services
                .extend(names.map(|service| (service.id, service.name.clone())));
            self.say(&ServerText::AdvertiseServices { services });
        }
    }

    /// There are these channels and services no longer, nor subscriptions to them.
    pub fn withdraw(&mut self, channel_ids: Vec<u32>, service_ids: Vec<u32>) {
        for id in &channel_ids {
            if let Some(subscription) = self.by_channel.remove(id) {
                self.subscriptions.remove(&subscription);
            }
            if let Some(offered) = self.channels.remove(id) {
                self.parameters.rates.remove(&offered.topic);
            }
        }
        for id in &service_ids {
            self.services.remove(id);
        }
        if !channel_ids.is_empty() {
            self.say(&ServerText::Unadvertise { channel_ids });
        }
        if !service_ids.is_empty() {
            self.say(&ServerText::UnadvertiseServices { service_ids });
        }
    }

    /// What is shown as parameters that cannot be set.
    pub fn set_facts(&mut self, facts: BTreeMap<String, Value>) {
        let parameters = self.parameters.set_facts(facts);
        self.tell_values(parameters, None);
    }

    /// Whether the next message of the client may be taken in. It may not while what the last ones asked for waits.
    #[must_use]
    pub fn may_hear(&self) -> bool {
        self.calls.len() < MOST_CALLS && self.state.count() < MOST_STATE_WHILE_HEARD
    }

    /// A text came.
    pub fn handle_text(&mut self, text: &str) {
        match ClientText::parse(text) {
            Ok(ClientText::Subscribe { subscriptions }) => {
                for subscription in subscriptions {
                    self.subscribe(subscription);
                }
            }
            Ok(ClientText::Unsubscribe { subscription_ids }) => {
                for id in subscription_ids {
                    match self.subscriptions.remove(&id) {
                        Some(subscribed) => {
                            self.by_channel.remove(&subscribed.channel_id);
                        }
                        None => self.warn(format!("there is no subscription {id}")),
                    }
                }
            }
            Ok(ClientText::GetParameters {
                parameter_names,
                id,
            }) => {
                let values = self.values(&parameter_names);
                self.say(&ServerText::ParameterValues {
                    parameters: values,
                    id,
                });
            }
            Ok(ClientText::SetParameters { parameters, id }) => self.set(parameters, id),
            Ok(ClientText::SubscribeParameterUpdates { parameter_names }) => {
                self.parameters.tell(parameter_names);
            }
            Ok(ClientText::UnsubscribeParameterUpdates { parameter_names }) => {
                self.parameters.tell_no_longer(&parameter_names);
            }
            Ok(ClientText::Advertise { .. } | ClientText::Unadvertise { .. }) => {
                self.warn("this server takes no messages on channels of its clients".to_owned());
            }
            Ok(
                ClientText::SubscribeConnectionGraph {} | ClientText::UnsubscribeConnectionGraph {},
            ) => self.warn("this server shows no connection graph".to_owned()),
            Ok(ClientText::FetchAsset { request_id, uri }) => {
                let reason = format!("this server has no files, and `{}` neither", cut(&uri));
                self.send(ServerBinary::Asset {
                    request_id,
                    content: Err(&reason),
                });
            }
            Err(error) => self.say(&ServerText::Status {
                level: 2,
                message: cut(&format!("the message is not understood: {error}")).to_owned(),
            }),
        }
    }

    /// Bytes came.
    pub fn handle_binary(&mut self, bytes: &[u8]) {
        match ClientBinary::parse(bytes) {
            Ok(ClientBinary::MessageData { .. }) => {
                self.warn("this server takes no messages on channels of its clients".to_owned());
            }
            Ok(ClientBinary::ServiceCall {
                service_id,
                call_id,
                encoding,
                payload,
            }) => {
                let call = Call {
                    service_id,
                    call_id,
                    payload: payload.to_vec(),
                };
                if !self.services.contains_key(&service_id) {
                    let reason = format!("there is no service {service_id}");
                    self.answer(&call, Err(&reason));
                } else if encoding != SERVICE_ENCODING {
                    let reason = format!(
                        "the request is written as `{}`, wanted {SERVICE_ENCODING}",
                        cut(encoding)
                    );
                    self.answer(&call, Err(&reason));
                } else {
                    self.calls.push_back(call);
                }
            }
            Err(error) => self.say(&ServerText::Status {
                level: 2,
                message: format!("the message is not understood: {error}"),
            }),
        }
    }

    /// A channel that was subscribed to just now, and whose state the client is to be told.
    pub fn poll_subscribed(&mut self) -> Option<u32> {
        self.subscribed.pop_front()
    }

    /// A call that is to be carried out.
    pub fn poll_call(&mut self) -> Option<Call> {
        self.calls.pop_front()
    }

    /// What came of a call: the response, or why there is none.
    pub fn answer(&mut self, call: &Call, answer: Result<&[u8], &str>) {
        match answer {
            Ok(payload) => self.send(ServerBinary::ServiceResponse {
                service_id: call.service_id,
                call_id: call.call_id,
                encoding: SERVICE_ENCODING,
                payload,
            }),
            Err(reason) => self.say(&ServerText::ServiceCallFailure {
                service_id: call.service_id,
                call_id: call.call_id,
                message: reason.to_owned(),
            }),
        }
    }

    /// Whether the client is subscribed to this channel.
    #[must_use]
    pub fn wants(&self, channel_id: u32) -> bool {
        self.by_channel.contains_key(&channel_id)
    }

    /// Something has changed or happened; for whoever is subscribed.
    pub fn push_state(&mut self, channel_id: u32, time_ns: u64, payload: &[u8]) {
        if let Some(&subscription_id) = self.by_channel.get(&channel_id) {
            self.send(ServerBinary::MessageData {
                subscription_id,
                time_ns,
                payload,
            });
        }
    }

    /// A sample was taken, at `time_s` of its session; it waits if it is due and anybody is subscribed.
    pub fn push_sample(&mut self, channel_id: u32, time_s: f64, time_ns: u64, sample: P) {
        let Some(id) = self.by_channel.get(&channel_id) else {
            return;
        };
        if let Some(subscribed) = self.subscriptions.get_mut(id)
            && subscribed.pace.is_due(time_s)
        {
            self.left_out += subscribed.samples.push(time_ns, sample);
        }
    }

    /// The next message that may not be lost.
    pub fn poll_state(&mut self) -> Option<Message> {
        self.state.pop()
    }

    /// The oldest sample that still waits, to be asked for where no state waits.
    pub fn poll_sample(&mut self) -> Option<Sampled<P>> {
        let waiting = self.subscriptions.iter_mut();
        let waiting = waiting.filter_map(|(id, subscribed)| {
            let oldest_ns = subscribed.samples.oldest_ns()?;
            Some((oldest_ns, *id, subscribed))
        });
        let (_, subscription_id, subscribed) = waiting.min_by_key(|(oldest_ns, ..)| *oldest_ns)?;
        let (time_ns, sample) = subscribed.samples.pop()?;
        Some(Sampled {
            subscription_id,
            time_ns,
            sample,
        })
    }

    /// Samples that had to be left out since this was asked last: the client was too slow for them.
    pub fn take_left_out(&mut self) -> u64 {
        std::mem::take(&mut self.left_out)
    }

    /// Whether so much state waits that the client is to be closed: it may lose none, and nothing waits without bound.
    #[must_use]
    pub const fn is_overfull(&self) -> bool {
        MOST_STATE_BYTES < self.state.bytes()
    }

    fn subscribe(&mut self, Subscription { id, channel_id }: Subscription) {
        let Some(offered) = self.channels.get(&channel_id) else {
            return self.warn(format!("there is no channel {channel_id}"));
        };
        if self.subscriptions.contains_key(&id) {
            return self.warn(format!("there is a subscription {id} already"));
        }
        if let Some(other) = self.by_channel.get(&channel_id) {
            let topic = &offered.topic;
            return self.warn(format!("{topic} is subscribed to already, as {other}"));
        }
        let rate = self.parameters.rate(&offered.topic);
        self.subscriptions.insert(
            id,
            Subscribed {
                channel_id,
                pace: Pace::new(rate),
                samples: Samples::at_most(rate.waiting()),
            },
        );
        self.by_channel.insert(channel_id, id);
        self.subscribed.push_back(channel_id);
    }

    fn values(&self, names: &[String]) -> Vec<Parameter> {
        self.parameters
            .named(names, |topic| self.has_samples(topic))
    }

    fn has_samples(&self, topic: &str) -> bool {
        let mut channels = self.channels.values();
        channels.any(|offered| offered.flow == Flow::Samples && offered.topic == topic)
    }

    fn set(&mut self, parameters: Vec<Parameter>, id: Option<String>) {
        let names: Vec<String> = parameters.iter().map(|set| set.name.clone()).collect();
        for parameter in parameters {
            if let Err(reason) = self.set_one(&parameter) {
                self.warn(reason);
            }
        }
        self.take_rates_up();
        // What they are now, also where that is not what was wanted.
        let values = self.values(&names);
        let told = |value: &Parameter| self.parameters.tells(&value.name);
        let update: Vec<Parameter> = values.iter().filter(|value| told(value)).cloned().collect();
        match id {
            Some(id) => self.tell_values(values, Some(id)),
            None => self.tell_values(update, None),
        }
    }

    fn set_one(&mut self, Parameter { name, value, .. }: &Parameter) -> Result<(), String> {
        let rate = || match value {
            None | Some(Value::Null) => Ok(None),
            Some(value) => match value.as_f64() {
                Some(hz) => Rate::new(hz).map(Some).map_err(|error| error.to_string()),
                None => Err(format!("{} is no number", cut(&value.to_string()))),
            },
        };
        if name == RATE {
            self.parameters.usual = rate()?.unwrap_or(self.parameters.first);
            return Ok(());
        }
        if let Some(topic) = name.strip_prefix(RATE_OF) {
            if !self.has_samples(topic) {
                return Err(format!("no samples come on a topic `{}`", cut(topic)));
            }
            match rate()? {
                Some(rate) => self.parameters.rates.insert(topic.to_owned(), rate),
                None => self.parameters.rates.remove(topic),
            };
            return Ok(());
        }
        let name = cut(name);
        Err(if self.parameters.is_fact(name) {
            format!("`{name}` is only shown here: services change sessions")
        } else {
            format!("there is no parameter `{name}`")
        })
    }

    /// Lets every subscription come at the rate that it has now.
    fn take_rates_up(&mut self) {
        for subscribed in self.subscriptions.values_mut() {
            let Some(offered) = self.channels.get(&subscribed.channel_id) else {
                continue;
            };
            let rate = self.parameters.rate(&offered.topic);
            if subscribed.pace.rate() != rate {
                subscribed.pace = Pace::new(rate);
                subscribed.samples = Samples::at_most(rate.waiting());
            }
        }
    }

    /// Tells values of parameters: in answer to a request, or where there are any.
    fn tell_values(&mut self, parameters: Vec<Parameter>, id: Option<String>) {
        if id.is_some() || !parameters.is_empty() {
            self.say(&ServerText::ParameterValues { parameters, id });
        }
    }

    /// Tells whoever uses the client something that they should know.
    pub fn warn(&mut self, message: String) {
        self.say(&ServerText::Status { level: 1, message });
    }

    fn say(&mut self, text: &ServerText) {
        self.state.push(Message::Text(text.to_json()));
    }

    fn send(&mut self, message: ServerBinary<'_>) {
        self.state.push(Message::Binary(message.to_bytes()));
    }
}

/// The beginning of a text, no longer than is repeated.
fn cut(text: &str) -> &str {
    let mut end = text.len().min(MOST_REPEATED);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    &text[..end]
}
