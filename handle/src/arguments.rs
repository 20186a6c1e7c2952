//! The command line of `teleclay-handle`. Parsed once; what comes out can be run.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, ValueEnum};
use teleclay_device::DeviceProfile;
use teleclay_devices::haply::ServiceAddress;
use teleclay_devices::haply::socket::EVENTS_PORT;
use teleclay_proto::http::{MAX_NAME, check_name};
use teleclay_proto::invite::{Fingerprint, InviteLine};
use teleclay_proto::{RealmName, SessionId};
use teleclay_shell::Drift;
use teleclay_shell::endpoint::{Endpoint, EndpointError, FORM};
use teleclay_shell::log::LogFormat;
use teleclay_shell::ticker::Scheduling;

use crate::device::{DeviceChoice, DeviceKind};
use crate::intent::{Intent, WaypointsError, parse_triple, parse_waypoints};
use crate::run::EXIT_CODES;

/// Most of a wait that can be spun, us: the whole of it.
const MAX_SPIN_US: u64 = 1000;
/// The operator of nobody in particular.
const NOBODY: &str = "operator";
/// A path has this many corners at most; more are a mistake.
const LONGEST_WAYPOINTS: u64 = 1 << 20;

/// Holds a handle: joins a session of a teleclay server and lets its operator feel and cut the clay.
#[derive(Clone, Debug, Parser)]
#[command(name = "teleclay-handle", version, after_help = EXIT_CODES)]
pub struct Arguments {
    /// Zenoh endpoint of the server
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:7547", value_parser = endpoint)]
    pub connect: Endpoint,
    /// What the certificate of a tls or quic endpoint is known by, 64 hexadecimal digits: SHA-256 of the server's
    /// certificate, or of one that vouches for it. Without it, a public authority must vouch for the server
    #[arg(long, value_name = "DIGITS")]
    pub fingerprint: Option<Fingerprint>,
    /// Everything of the above and below that says where to and who, on one line, as teleclay-server invite prints it
    #[arg(long, value_name = "LINE", env = "TELECLAY_INVITE", hide_env_values = true,
        conflicts_with_all = ["connect", "fingerprint", "session", "realm"])]
    pub invite: Option<InviteLine>,
    /// The session to join
    #[arg(long, value_name = "NAME", default_value = "demo")]
    pub session: SessionId,
    /// The realm that the session belongs to: the servers that share sessions have one name
    #[arg(long, value_name = "NAME", default_value = "local")]
    pub realm: RealmName,
    /// Who holds the handle, for people to read (default: USER@HOST)
    #[arg(long, value_name = "NAME", value_parser = operator)]
    pub operator: Option<String>,
    /// The server's token, when it asks for one; with it, no server is joined that does not know it
    #[arg(long, env = "TELECLAY_TOKEN", hide_env_values = true)]
    pub token: Option<String>,
    /// The device: simulated (the paper's servos, one per axis), robot (the same on the three arms of the parallel
    /// robot, with joint limits), gamepad (sticks and rumble), joystick (force on 2 axes) or haply (Inverse3); list
    /// shows which are there
    #[arg(long, value_name = "DEVICE", default_value_t)]
    pub device: DeviceChoice,
    /// Where the Haply Inverse Service listens, on this machine
    #[arg(long, value_name = "URL", default_value_t)]
    pub haply_url: ServiceAddress,
    /// The port of its event channel
    #[arg(long, value_name = "PORT", default_value_t = EVENTS_PORT, value_parser = clap::value_parser!(u16).range(1..))]
    pub haply_events_port: u16,
    /// Greatest force on the hand, N: lowers what the device allows, never raises it
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = bound)]
    pub force_limit_n: Option<f64>,
    /// Greatest change of that force, N/s, likewise
    #[arg(long, value_name = "N/S", allow_negative_numbers = true, value_parser = bound)]
    pub slew_limit_n_per_s: Option<f64>,
    /// Greatest speed at which the handle is sent anywhere, m/s, likewise
    #[arg(long, value_name = "M/S", allow_negative_numbers = true, value_parser = bound)]
    pub speed_limit_m_s: Option<f64>,
    /// Greatest power into the hand, W, likewise
    #[arg(long, value_name = "W", allow_negative_numbers = true, value_parser = bound)]
    pub power_limit_w: Option<f64>,
    /// What the operator of a simulated device does [default: cutting]
    #[arg(long, value_enum)]
    pub intent: Option<IntentName>,
    /// Force in N, for constant-force and sensor-force; amplitude, for sinusoid
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = parse_triple)]
    pub force_n: Option<[f64; 3]>,
    /// Frequency in Hz, for sinusoid
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, value_parser = frequency)]
    pub frequency_hz: Option<f64>,
    /// Corners in m and speeds in m/s, for trajectory: a file or a list such as 0.02,0,0@0.05;0,0,0@0.05
    #[arg(long, value_name = "FILE|LIST", allow_hyphen_values = true)]
    pub waypoints: Option<String>,
    /// End after this many seconds (default: never)
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = seconds)]
    pub seconds: Option<Duration>,
    /// What to ask the scheduler for: fifo or normal
    #[arg(long, value_name = "POLICY", default_value_t = Scheduling::Fifo)]
    pub scheduling: Scheduling,
    /// The last microseconds of each wait that are spun: punctuality for processor time
    #[arg(long, value_name = "US", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..=MAX_SPIN_US))]
    pub spin_us: u64,
    /// Let a simulated operator take hold again by itself once a stop is cleared; without this it ends with the stop. A
    /// device that a hand is on waits anyway, and moves nothing before the hand takes hold anew
    #[arg(long)]
    pub resume_after_stop: bool,
    /// Write every tick to this CSV file: time, state of the link, motion, forces
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Let the handle's clock run fast by this much, to see what another machine's crystal does
    #[arg(long, value_name = "PPM", default_value = "0", allow_negative_numbers = true, value_parser = drift)]
    pub clock_drift_ppm: Drift,
    /// Print a line of JSON each second and one at the end, instead of the summary in words
    #[arg(long)]
    pub json: bool,
    /// What to log to stderr, as in RUST_LOG: info, debug, teleclay_handle=debug,zenoh=warn, …
    #[arg(
        long,
        value_name = "FILTER",
        env = "TELECLAY_LOG",
        default_value = "info,zenoh=off"
    )]
    pub log: String,
    /// How the log is written on standard error: text or json
    #[arg(long, env = "TELECLAY_LOG_FORMAT", default_value_t)]
    pub log_format: LogFormat,
}

/// The intents by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum IntentName {
    /// A hand that rests
    Idle,
    /// A steady push from the muscles: --force-n
    ConstantForce,
    /// A steady force at the sensor, as in the cutting experiment: --force-n
    SensorForce,
    /// A swinging push: --force-n, --frequency-hz
    Sinusoid,
    /// Follow a path once and stay at its end: --waypoints
    Trajectory,
    /// Strokes over the block, level by level, then again on a fresh block
    #[default]
    Cutting,
}

impl IntentName {
    /// The word on the command line.
    const fn word(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::ConstantForce => "constant-force",
            Self::SensorForce => "sensor-force",
            Self::Sinusoid => "sinusoid",
            Self::Trajectory => "trajectory",
            Self::Cutting => "cutting",
        }
    }

    /// The options that it needs; it takes no other.
    const fn needs(self) -> &'static [&'static str] {
        match self {
            Self::Idle | Self::Cutting => &[],
            Self::ConstantForce | Self::SensorForce => &["--force-n"],
            Self::Sinusoid => &["--force-n", "--frequency-hz"],
            Self::Trajectory => &["--waypoints"],
        }
    }
}

/// Why an intent cannot be made of its options.
#[derive(Debug, thiserror::Error)]
pub enum IntentOptionError {
    /// An option is missing.
    #[error("--intent {intent} needs {option}")]
    Missing {
        /// The intent.
        intent: &'static str,
        /// The option.
        option: &'static str,
    },
    /// An option is there that would change nothing.
    #[error("{option} does not go with --intent {intent}")]
    Unused {
        /// The intent.
        intent: &'static str,
        /// The option.
        option: &'static str,
    },
    /// A hand has intents of its own.
    #[error("{option} is for simulated devices, and --device {device} is held by a hand")]
    Held {
        /// The option.
        option: &'static str,
        /// The device.
        device: DeviceKind,
    },
    /// The waypoints are none.
    #[error("--waypoints: {0}")]
    Waypoints(#[from] WaypointsError),
    /// The text is neither a list nor a file.
    #[error("--waypoints `{got}` is neither a file nor a list: {source}")]
    NeitherFileNorList {
        /// As given.
        got: String,
        /// Why it is no list.
        source: WaypointsError,
    },
    /// The file cannot be read.
    #[error("--waypoints {path}: {source}")]
    File {
        /// Its path.
        path: String,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// The file is too large to be a path.
    #[error("--waypoints {path} has {got} bytes, want {LONGEST_WAYPOINTS} at most")]
    TooLong {
        /// Its path.
        path: String,
        /// Its length.
        got: u64,
    },
}

impl Arguments {
    /// Where the service of an Inverse3 listens.
    pub fn haply(&self) -> ServiceAddress {
        let address = self.haply_url.clone();
        address.with_events_at(self.haply_events_port)
    }

    /// Reads the command line of this process.
    ///
    /// # Errors
    /// As clap words them; asking for help or the version is one too.
    pub fn read() -> Result<(Self, Intent), clap::Error> {
        Self::read_from(std::env::args_os())
    }

    /// Reads a command line, the program's name first.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_from<I>(words: I) -> Result<(Self, Intent), clap::Error>
    where
        I: IntoIterator,
        I::Item: Into<std::ffi::OsString> + Clone,
    {
        let mut arguments = Self::try_parse_from(words)?;
        if let Some(invite) = arguments.invite.clone() {
            arguments.follow(invite).map_err(|error| {
                let words = format!("the invite: {error}\n");
                Self::command().error(ErrorKind::ValueValidation, words)
            })?;
        }
        let intent = arguments.read_intent().map_err(|error| {
            let kind = match &error {
                IntentOptionError::Missing { .. } => ErrorKind::MissingRequiredArgument,
                IntentOptionError::Unused { .. } | IntentOptionError::Held { .. } => {
                    ErrorKind::ArgumentConflict
                }
                _ => ErrorKind::ValueValidation,
            };
            Self::command().error(kind, error)
        })?;
        Ok((arguments, intent))
    }

    /// The operator's name: as given, or who and where this process is.
    pub fn operator_name(&self) -> String {
        self.operator.clone().unwrap_or_else(user_at_host)
    }

    /// What the device may do to the hand: its own bounds, lowered to those that were given.
    pub fn profile(&self) -> DeviceProfile {
        self.device.kind().profile().lowered_to(DeviceProfile {
            force_n: self.force_limit_n.unwrap_or(f64::INFINITY),
            slew_n_per_s: self.slew_limit_n_per_s.unwrap_or(f64::INFINITY),
            speed_m_s: self.speed_limit_m_s.unwrap_or(f64::INFINITY),
            power_w: self.power_limit_w.unwrap_or(f64::INFINITY),
            silence_s: f64::INFINITY,
            ramp_s: f64::INFINITY,
        })
    }

    /// Goes where the invite says, with what it says.
    fn follow(&mut self, invite: InviteLine) -> Result<(), EndpointError> {
        self.connect = invite.endpoint.parse()?;
        self.fingerprint = invite.fingerprint;
        self.session = invite.session;
        self.realm = invite.realm;
        self.token = Some(invite.token.to_string());
        Ok(())
    }

    fn read_intent(&self) -> Result<Intent, IntentOptionError> {
        let device = self.device.kind();
        if let (DeviceKind::Held(_), Some(_)) = (device, self.intent) {
            let option = "--intent";
            return Err(IntentOptionError::Held { option, device });
        }
        let name = self.intent.unwrap_or_default();
        let intent = name.word();
        let given = [
            ("--force-n", self.force_n.is_some()),
            ("--frequency-hz", self.frequency_hz.is_some()),
            ("--waypoints", self.waypoints.is_some()),
        ];
        for (option, is_given) in given {
            match (name.needs().contains(&option), is_given) {
                (true, false) => return Err(IntentOptionError::Missing { intent, option }),
                (false, true) if matches!(device, DeviceKind::Held(_)) => {
                    return Err(IntentOptionError::Held { option, device });
                }
                (false, true) => return Err(IntentOptionError::Unused { intent, option }),
                _ => {}
            }
        }
        // What is needed was found above, so no default is ever taken.
        let force_n = self.force_n.unwrap_or_default();
        Ok(match name {
            IntentName::Idle => Intent::Idle,
            IntentName::ConstantForce => Intent::ConstantForce { force_n },
            IntentName::SensorForce => Intent::SensorForce { force_n },
            IntentName::Sinusoid => Intent::Sinusoid {
                amplitude_n: force_n,
                frequency_hz: self.frequency_hz.unwrap_or_default(),
            },
            IntentName::Trajectory => Intent::Trajectory {
                waypoints: waypoints(self.waypoints.as_deref().unwrap_or_default())?,
            },
            IntentName::Cutting => Intent::Cutting,
        })
    }
}

fn waypoints(got: &str) -> Result<Vec<teleclay_operator::Waypoint>, IntentOptionError> {
    let Ok(file) = Path::new(got).metadata() else {
        return parse_waypoints(got).map_err(|source| IntentOptionError::NeitherFileNorList {
            got: got.to_owned(),
            source,
        });
    };
    let path = got.to_owned();
    if LONGEST_WAYPOINTS < file.len() {
        return Err(IntentOptionError::TooLong {
            path,
            got: file.len(),
        });
    }
    match std::fs::read_to_string(got) {
        Ok(text) => Ok(parse_waypoints(&text)?),
        Err(source) => Err(IntentOptionError::File { path, source }),
    }
}

fn endpoint(text: &str) -> Result<Endpoint, String> {
    text.parse().map_err(|error| match error {
        EndpointError::Form { .. } => format!("want {FORM}"),
        error => error.to_string(),
    })
}

fn operator(text: &str) -> Result<String, String> {
    match check_name("", text) {
        Ok(()) => Ok(text.to_owned()),
        Err(error) => Err(error.detail),
    }
}

fn bound(text: &str) -> Result<f64, String> {
    let bound = text
        .parse::<f64>()
        .ok()
        .filter(|bound| bound.is_finite() && 0.0 < *bound);
    bound.ok_or_else(|| "want a finite number above zero".to_owned())
}

fn frequency(text: &str) -> Result<f64, String> {
    let hz = text
        .parse::<f64>()
        .ok()
        .filter(|hz| hz.is_finite() && 0.0 < *hz);
    hz.ok_or_else(|| "want a finite number above zero".to_owned())
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text
        .parse::<f64>()
        .ok()
        .filter(|seconds| seconds.is_finite() && 0.0 < *seconds);
    let duration = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    duration.ok_or_else(|| "want a number of seconds above zero".to_owned())
}

fn drift(text: &str) -> Result<Drift, String> {
    let ppm = text
        .parse()
        .map_err(|_| "want a whole number of parts per million".to_owned())?;
    Drift::from_ppm(ppm).map_err(|error| error.to_string())
}

fn user_at_host() -> String {
    let user = ["USER", "LOGNAME", "USERNAME"]
        .iter()
        .find_map(|name| std::env::var(name).ok());
    let host =
        std::fs::read_to_string("/proc/sys/kernel/hostname").or_else(|_| std::env::var("HOSTNAME"));
    let host = host.map(|host| host.trim().to_owned()).unwrap_or_default();
    let name = match user {
        Some(user) if host.is_empty() => user,
        Some(user) => format!("{user}@{host}"),
        None if host.is_empty() => NOBODY.to_owned(),
        None => format!("{NOBODY}@{host}"),
    };
    let name: String = name.chars().take(MAX_NAME).collect();
    operator(&name).unwrap_or_else(|_| NOBODY.to_owned())
}

#[cfg(test)]
mod tests;
