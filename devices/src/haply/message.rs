//! The service's messages, as far as they are needed. Fields that are not named here are passed over.

use serde::{Deserialize, Serialize};

/// A longer message is none: the inventory of a dozen devices has a tenth of it.
pub const LONGEST: usize = 64 * 1024;

/// What the simulation channel says: the inventory first, states from then on.
#[derive(Debug, Deserialize)]
pub struct State {
    /// There since version 3.5.
    pub session_id: Option<serde::de::IgnoredAny>,
    /// Every Inverse3, Inverse3x and Minverse.
    #[serde(default)]
    pub inverse3: Vec<Inverse3>,
    /// Grips with a wire: one button.
    #[serde(default)]
    pub verse_grip: Vec<Grip>,
    /// Grips without: three buttons.
    #[serde(default)]
    pub wireless_verse_grip: Vec<Grip>,
    /// Grips that somebody made.
    #[serde(default)]
    pub custom_verse_grip: Vec<Grip>,
}

/// One device with arms.
#[derive(Debug, Deserialize)]
pub struct Inverse3 {
    /// Its number.
    pub device_id: String,
    /// In the inventory alone.
    pub config: Option<Config>,
    /// Where it is.
    pub state: Option<Cursor>,
    /// How it is.
    pub status: Option<Status>,
}

/// How a device is set up.
#[derive(Debug, Deserialize)]
pub struct Config {
    /// Where the origin is.
    pub preset: Option<String>,
    /// What is done to a force; there since version 3.5.
    pub filters: Option<Filters>,
}

/// What is done to a force on its way.
#[derive(Debug, Deserialize)]
pub struct Filters {
    /// Weakens forces while it sees an oscillation.
    pub force_gate: Option<ForceGate>,
    /// Adds viscous damping.
    pub damping: Option<Damping>,
}

/// See [`Filters`].
#[derive(Debug, Deserialize)]
pub struct ForceGate {
    /// 0 to 1.
    pub gain: Option<f64>,
}

/// See [`Filters`].
#[derive(Debug, Deserialize)]
pub struct Damping {
    /// What it adds along every axis, N·s/m.
    pub scalar: Option<f64>,
}

/// Where the cursor is.
#[derive(Debug, Deserialize)]
pub struct Cursor {
    /// Place of the cursor, m.
    pub cursor_position: Option<Vector>,
}

/// Three numbers.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub struct Vector {
    /// To the right.
    pub x: f64,
    /// Away from the hand.
    pub y: f64,
    /// Against gravity.
    pub z: f64,
}

impl From<[f64; 3]> for Vector {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<Vector> for [f64; 3] {
    fn from(Vector { x, y, z }: Vector) -> Self {
        [x, y, z]
    }
}

/// How a device is.
#[derive(Debug, Deserialize)]
pub struct Status {
    /// Whether it knows where its arms are.
    pub calibrated: Option<bool>,
    /// Whether its motors have power.
    pub power_supply: Option<bool>,
    /// Whether it can be used.
    pub ready: Option<bool>,
}

/// A grip.
#[derive(Debug, Deserialize)]
pub struct Grip {
    /// What it says.
    pub state: Option<GripState>,
}

/// What a grip says.
#[derive(Debug, Deserialize)]
pub struct GripState {
    /// Of a grip with a wire.
    pub button: Option<bool>,
    /// Of a grip without.
    pub buttons: Option<Buttons>,
}

/// Buttons of a grip, from the front.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(default)]
pub struct Buttons {
    /// The first.
    pub a: bool,
    /// The second.
    pub b: bool,
    /// The third.
    pub c: bool,
}

/// What the event channel says.
#[derive(Debug, Deserialize)]
pub struct Event {
    /// What happened.
    pub name: String,
    /// How bad it is.
    pub level: Option<String>,
    /// To whom.
    pub data: Option<EventData>,
    /// In words.
    pub message: Option<String>,
}

/// To whom something happened.
#[derive(Debug, Deserialize)]
pub struct EventData {
    /// Number of the device.
    pub device_id: Option<String>,
    /// What a safety event is about.
    pub safety_type: Option<String>,
}

/// How a force is spelled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spelling {
    /// `vector`, since version 3.5.
    Vector,
    /// `values`, before.
    Values,
}

#[derive(Serialize)]
struct Request<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    session: Option<Session>,
    inverse3: [Told<'a>; 1],
}

#[derive(Serialize)]
struct Session {
    configure: Configure,
}

#[derive(Serialize)]
struct Configure {
    profile: Profile,
}

#[derive(Serialize)]
struct Profile {
    name: &'static str,
}

#[derive(Serialize)]
struct Told<'a> {
    device_id: &'a str,
    commands: Commands,
}

#[derive(Serialize)]
struct Commands {
    set_cursor_force: Force,
}

#[derive(Serialize)]
#[serde(rename_all = "lowercase")]
enum Force {
    Vector(Vector),
    Values(Vector),
}

/// A force for a device, N; the first message of a session since version 3.5 says who speaks, too.
#[must_use]
pub fn set_force(
    device_id: &str,
    force_n: [f64; 3],
    spelling: Spelling,
    greeting: Greeting,
) -> String {
    let profile = Profile {
        name: "teleclay:handle",
    };
    let session = Session {
        configure: Configure { profile },
    };
    let force = Vector::from(force_n);
    let request = Request {
        session: (greeting == Greeting::First).then_some(session),
        inverse3: [Told {
            device_id,
            commands: Commands {
                set_cursor_force: match spelling {
                    Spelling::Vector => Force::Vector(force),
                    Spelling::Values => Force::Values(force),
                },
            },
        }],
    };
    serde_json::to_string(&request).expect("three finite numbers and two names are JSON")
}

/// Whether a message is the first of its session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Greeting {
    /// It says who speaks.
    First,
    /// It does not.
    Later,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_is_spelled_as_the_services_pages_spell_it() {
        let later = |spelling| set_force("049D", [1.0, -0.5, 0.0], spelling, Greeting::Later);
        assert_eq!(
            later(Spelling::Vector),
            r#"{"inverse3":[{"device_id":"049D","commands":{"set_cursor_force":{"vector":{"x":1.0,"y":-0.5,"z":0.0}}}}]}"#
        );
        assert_eq!(
            later(Spelling::Values),
            r#"{"inverse3":[{"device_id":"049D","commands":{"set_cursor_force":{"values":{"x":1.0,"y":-0.5,"z":0.0}}}}]}"#
        );
        let first = set_force("049D", [0.0; 3], Spelling::Vector, Greeting::First);
        assert!(
            first
                .starts_with(r#"{"session":{"configure":{"profile":{"name":"teleclay:handle"}}},"#)
        );
    }
}
