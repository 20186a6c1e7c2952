//! Settings: defaults, then a file, then `TELECLAY_*`, then flags; the last one wins.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context as _, bail, ensure};
use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use figment::Figment;
use figment::providers::{Env, Format as _, Serialized, Toml};
use serde::{Deserialize, Serialize};
use teleclay_offline::Offline;
use teleclay_proto::{NodeName, RealmName};
use teleclay_ros2::{Commands, Config as Ros2Config};
use teleclay_shell::endpoint::{Endpoint, Protocol};
use teleclay_shell::log::LogFormat;
use teleclay_shell::ticker::Scheduling;

use crate::doors::certificates::{self, Source};
use crate::doors::command::{InviteCommand, InvitesCommand, default_data_dir};
use crate::engine::{MAX_THREADS, TICK};
use crate::past::HistoryCommand;
use crate::placing::{Budget, threads_by_rule};

/// A networked haptic tele-presence server: it holds the clay and the tool side of the loop.
#[derive(Debug, Parser)]
#[command(
    name = "teleclay-server",
    version,
    args_conflicts_with_subcommands = true
)]
pub struct Arguments {
    /// What else this program does
    #[command(subcommand)]
    pub aside: Option<Aside>,
    /// Address of the HTTP API and the dashboard (default: 127.0.0.1:8080)
    #[arg(long, value_name = "ADDRESS:PORT")]
    listen: Option<SocketAddr>,
    /// Zenoh endpoint for handles, tcp, udp, tls or quic; slow state uses the next port (default:
    /// tcp/127.0.0.1:7547)
    #[arg(long, value_name = "PROTOCOL/ADDRESS:PORT")]
    zenoh_listen: Option<String>,
    /// A folder for the server's data: sessions, its authority, invites, the audit log (default: a folder of the
    /// user's)
    #[arg(long, value_name = "DIR")]
    data_dir: Option<PathBuf>,
    /// A TOML file with the same settings, e.g. `listen = "127.0.0.1:9000"`
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Keep nothing: sessions end with the process
    #[arg(long)]
    ephemeral: bool,
    /// Start without the session `demo`
    #[arg(long)]
    no_demo_session: bool,
    /// Memory for the clay of all sessions, MiB: a session that wants more than is left is refused (default: 4096)
    #[arg(long, value_name = "MIB")]
    clay_memory: Option<u64>,
    /// Name of the realm on Zenoh: of the servers that share sessions (default: local)
    #[arg(long)]
    realm: Option<String>,
    /// Name of this server, for people to read (default: local)
    #[arg(long)]
    node: Option<String>,
    /// Origins besides the server's own whose pages may use the API; may be given several times
    #[arg(long = "allow-origin", value_name = "ORIGIN")]
    allow_origins: Vec<String>,
    /// What to ask the scheduler for: fifo or normal (default: fifo)
    #[arg(long)]
    scheduling: Option<Scheduling>,
    /// Last microseconds of each wait that are spun instead of slept (default: 0)
    #[arg(long)]
    spin_us: Option<u64>,
    /// Threads that run the loop; sessions are spread over them as they take time (default: half as many as there are
    /// processors, from 1 to 8)
    #[arg(long, value_name = "NUMBER")]
    tick_threads: Option<usize>,
    /// What the sessions of a thread may take of each tick before others are refused, in parts of it; 0 refuses nobody
    /// (default: 0.6)
    #[arg(long, value_name = "SHARE")]
    tick_budget: Option<f64>,
    /// A certificate in PEM, with those that vouch for it, instead of one of the server's own authority
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Its private key in PEM
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// A name or address by which others reach the server: it stands in the certificate, and the first in invites; may
    /// be given several times
    #[arg(long = "host", value_name = "NAME")]
    hosts: Vec<String>,
    /// Speak in the clear beyond loopback: only where something else encrypts
    #[arg(long)]
    without_tls: bool,
    /// Zenoh router of ROS 2, such as tcp/127.0.0.1:7447: sessions are told of there; without it nothing is
    #[arg(long, value_name = "PROTOCOL/ADDRESS:PORT")]
    ros2: Option<String>,
    /// Domain of ROS 2, as ROS_DOMAIN_ID (default: 0)
    #[arg(long, value_name = "NUMBER")]
    ros2_domain: Option<u32>,
    /// Let ROS 2 pause sessions, change their scheme and renew their clay: whoever reaches the router may
    #[arg(long)]
    ros2_commands: bool,
    /// Let motion and forces go to a router beyond loopback in the clear
    #[arg(long)]
    ros2_in_the_clear: bool,
    /// How the log is written on standard error: text or json (default: text)
    #[arg(long)]
    log_format: Option<LogFormat>,
    /// Ask a running server on --listen whether it is healthy, and exit with 0 or 1
    #[arg(long)]
    pub health_check: bool,
}

/// What the program does instead of serving.
#[derive(Clone, Debug, Subcommand)]
#[expect(clippy::large_enum_variant, reason = "there is one, for a moment")]
pub enum Aside {
    /// The theory, answered without a server
    #[command(flatten)]
    Offline(Offline),
    /// Invite somebody to a session: prints a link for a browser and, for operators, a line for a handle
    Invite(InviteCommand),
    /// List invites, or take one back
    Invites(InvitesCommand),
    /// Look into the history of a session: its strokes, its clay at any moment, whether its files are sound
    History(HistoryCommand),
}

impl Arguments {
    /// Reads the command line of this process; ends it where that asks for help or cannot be read.
    pub fn of_this_process() -> Self {
        let mut command = teleclay_offline::rounded_off(Self::command());
        let matches = command.get_matches_mut();
        Self::from_arg_matches(&matches).unwrap_or_else(|error| error.format(&mut command).exit())
    }
}

/// The raw shape: what a file or the environment may say.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    listen: SocketAddr,
    zenoh_listen: String,
    data_dir: Option<PathBuf>,
    demo_session: bool,
    ephemeral: bool,
    clay_memory: u64,
    realm: String,
    node: String,
    token: Option<String>,
    allow_origins: Vec<String>,
    scheduling: String,
    spin_us: u64,
    tick_threads: Option<usize>,
    tick_budget: f64,
    tls_cert: Option<PathBuf>,
    tls_key: Option<PathBuf>,
    hosts: Vec<String>,
    without_tls: bool,
    ros2: Option<String>,
    ros2_domain: u32,
    ros2_commands: bool,
    ros2_in_the_clear: bool,
    log_format: String,
}

impl Default for Raw {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            zenoh_listen: "tcp/127.0.0.1:7547".to_owned(),
            data_dir: None,
            demo_session: true,
            ephemeral: false,
            clay_memory: 4096,
            realm: "local".to_owned(),
            node: "local".to_owned(),
            token: None,
            allow_origins: Vec::new(),
            scheduling: Scheduling::default().to_string(),
            spin_us: 0,
            tick_threads: None,
            tick_budget: 0.6,
            tls_cert: None,
            tls_key: None,
            hosts: Vec::new(),
            without_tls: false,
            ros2: None,
            ros2_domain: 0,
            ros2_commands: false,
            ros2_in_the_clear: false,
            log_format: LogFormat::default().to_string(),
        }
    }
}

/// Proven settings.
#[derive(Clone, Debug)]
pub struct Settings {
    /// HTTP address.
    pub listen: SocketAddr,
    /// Zenoh endpoint of the control session.
    pub zenoh_control: Endpoint,
    /// Zenoh endpoint of the slow session.
    pub zenoh_slow: Endpoint,
    /// A folder for the server's data.
    pub data_dir: PathBuf,
    /// Where certificates come from.
    pub certificate: Source,
    /// Whether the HTTP address is encrypted.
    pub is_https: bool,
    /// Names and addresses by which others reach the server, as it was told.
    pub hosts: Vec<String>,
    /// Whether to make the session `demo`, if it is not there.
    pub demo_session: bool,
    /// Whether sessions end with the process.
    pub is_ephemeral: bool,
    /// Memory for the clay of all sessions, bytes.
    pub clay_bytes: u64,
    /// Name of the realm on Zenoh.
    pub realm: RealmName,
    /// Name of this server.
    pub node: NodeName,
    /// Token that clients must show.
    pub token: Option<String>,
    /// Where sessions are told of on ROS 2, if they are.
    pub ros2: Option<Ros2Config>,
    /// Foreign origins that may use the API.
    pub allow_origins: Vec<String>,
    /// What to ask the scheduler for.
    pub scheduling: Scheduling,
    /// Spun part of each wait.
    pub spin: Duration,
    /// Threads that run the loop.
    pub tick_threads: usize,
    /// What the sessions of a thread may take of each tick, in parts of it; nobody is refused with 0.
    pub tick_budget: f64,
    /// How the log is written.
    pub log_format: LogFormat,
}

/// Shorter tokens can be guessed.
const LEAST_TOKEN: usize = 16;
/// A spin as long as the tick would never sleep.
const MOST_SPIN_US: u64 = 900;

/// The last domain that every system of ROS 2 takes.
const MOST_ROS2_DOMAIN: u32 = 232;

/// Settings that a variable `TELECLAY_…` may give, beside the token.
const FROM_ENVIRONMENT: [&str; 22] = [
    "listen",
    "zenoh_listen",
    "data_dir",
    "demo_session",
    "ephemeral",
    "clay_memory",
    "realm",
    "node",
    "allow_origins",
    "scheduling",
    "spin_us",
    "tick_threads",
    "tick_budget",
    "tls_cert",
    "tls_key",
    "hosts",
    "without_tls",
    "ros2",
    "ros2_domain",
    "ros2_commands",
    "ros2_in_the_clear",
    "log_format",
];

impl Settings {
    /// Reads file and environment, lets flags win, checks.
    ///
    /// # Errors
    /// An unknown or impossible setting; a listener beyond loopback without a token, or in the clear.
    pub fn read(arguments: &Arguments) -> anyhow::Result<Self> {
        let mut figment = Figment::from(Serialized::defaults(Raw::default()));
        if let Some(file) = &arguments.config {
            ensure!(
                file.is_file(),
                "there is no configuration file {}",
                file.display()
            );
            figment = figment.merge(Toml::file_exact(file));
        }
        // Only what is a setting: other programs of this project have variables of their own.
        figment = figment.merge(Env::prefixed("TELECLAY_").only(&FROM_ENVIRONMENT));
        let mut raw: Raw = figment.extract().context("settings")?;
        // Read as it is: a token of digits is no number.
        if let Ok(token) = std::env::var("TELECLAY_TOKEN") {
            raw.token = Some(token);
        }
        if let Some(listen) = arguments.listen {
            raw.listen = listen;
        }
        if let Some(endpoint) = &arguments.zenoh_listen {
            raw.zenoh_listen.clone_from(endpoint);
        }
        if let Some(folder) = &arguments.data_dir {
            raw.data_dir = Some(folder.clone());
        }
        if let Some(realm) = &arguments.realm {
            raw.realm.clone_from(realm);
        }
        if let Some(node) = &arguments.node {
            raw.node.clone_from(node);
        }
        if let Some(scheduling) = arguments.scheduling {
            raw.scheduling = scheduling.to_string();
        }
        if let Some(format) = arguments.log_format {
            raw.log_format = format.to_string();
        }
        if let Some(spin_us) = arguments.spin_us {
            raw.spin_us = spin_us;
        }
        raw.tick_threads = arguments.tick_threads.or(raw.tick_threads);
        raw.tick_budget = arguments.tick_budget.unwrap_or(raw.tick_budget);
        if arguments.tls_cert.is_some() {
            raw.tls_cert.clone_from(&arguments.tls_cert);
            raw.tls_key.clone_from(&arguments.tls_key);
        }
        raw.hosts.splice(0..0, arguments.hosts.iter().cloned());
        raw.without_tls |= arguments.without_tls;
        if arguments.ros2.is_some() {
            raw.ros2.clone_from(&arguments.ros2);
        }
        raw.ros2_domain = arguments.ros2_domain.unwrap_or(raw.ros2_domain);
        raw.ros2_commands |= arguments.ros2_commands;
        raw.ros2_in_the_clear |= arguments.ros2_in_the_clear;
        raw.ephemeral |= arguments.ephemeral;
        if let Some(mib) = arguments.clay_memory {
            raw.clay_memory = mib;
        }
        raw.demo_session &= !arguments.no_demo_session;
        raw.allow_origins
            .extend(arguments.allow_origins.iter().cloned());
        Self::prove(raw)
    }

    fn prove(raw: Raw) -> anyhow::Result<Self> {
        if let Some(token) = &raw.token {
            ensure!(
                LEAST_TOKEN <= token.len(),
                "the token has {} characters, need {LEAST_TOKEN}",
                token.len()
            );
        }
        let how = "set one with TELECLAY_TOKEN or `token` in the file given by --config";
        let is_inside = raw.listen.ip().is_loopback();
        ensure!(
            is_inside || raw.token.is_some(),
            "listening on {} needs a token: {how}",
            raw.listen
        );
        let zenoh_control: Endpoint = raw.zenoh_listen.parse()?;
        let is_handled_inside = zenoh_control.is_loopback();
        ensure!(
            is_handled_inside || raw.token.is_some(),
            "listening on {zenoh_control} needs a token: {how}"
        );
        ensure!(
            is_handled_inside || zenoh_control.protocol.is_secure() || raw.without_tls,
            "listening on {zenoh_control} would let everybody on the way read motion, forces and clay: take {}/{}:{}, \
             or --without-tls where something else encrypts",
            Protocol::Quic,
            zenoh_control.host,
            zenoh_control.port
        );
        for host in &raw.hosts {
            ensure!(
                certificates::is_name(host),
                "`{host}` is no name or address of a host"
            );
        }
        let ros2 = ros2(&raw)?;
        let certificate = match (raw.tls_cert, raw.tls_key) {
            (Some(chain), Some(key)) => Source::Given { chain, key },
            (None, None) => Source::Own,
            _ => bail!("tls_cert and tls_key go together"),
        };
        ensure!(
            raw.spin_us <= MOST_SPIN_US,
            "spin_us is {}, want {MOST_SPIN_US} at most",
            raw.spin_us
        );
        let tick_threads = raw.tick_threads.unwrap_or_else(threads_of_this_machine);
        ensure!(
            (1..=MAX_THREADS).contains(&tick_threads),
            "tick_threads is {tick_threads}, want 1 to {MAX_THREADS}"
        );
        Budget::new(TICK, raw.tick_budget)?;
        Ok(Self {
            listen: raw.listen,
            zenoh_slow: zenoh_control.neighbour(1)?,
            zenoh_control,
            is_https: certificate != Source::Own || !(is_inside || raw.without_tls),
            certificate,
            hosts: raw.hosts,
            data_dir: raw.data_dir.map_or_else(default_data_dir, Ok)?,
            demo_session: raw.demo_session,
            is_ephemeral: raw.ephemeral,
            clay_bytes: raw.clay_memory.saturating_mul(1 << 20),
            realm: RealmName::new(raw.realm).context("realm")?,
            node: NodeName::new(raw.node).context("node")?,
            token: raw.token,
            ros2,
            allow_origins: raw.allow_origins,
            scheduling: raw
                .scheduling
                .parse()
                .map_err(|error: String| anyhow::anyhow!(error))?,
            spin: Duration::from_micros(raw.spin_us),
            tick_threads,
            tick_budget: raw.tick_budget,
            log_format: raw
                .log_format
                .parse()
                .map_err(|error: String| anyhow::anyhow!(error))?,
        })
    }
}

fn threads_of_this_machine() -> usize {
    // Where nobody can say how many processors there are, one thread does.
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    threads_by_rule(processors, MAX_THREADS)
}

/// Where sessions are told of on ROS 2, if they are.
fn ros2(raw: &Raw) -> anyhow::Result<Option<Ros2Config>> {
    let Some(router) = &raw.ros2 else {
        ensure!(
            !raw.ros2_commands,
            "ros2_commands lets ROS 2 ask for something, and no router is given: add --ros2 tcp/127.0.0.1:7447"
        );
        return Ok(None);
    };
    let router: Endpoint = router.parse().context("ros2")?;
    ensure!(
        router.is_loopback() || router.protocol.is_secure() || raw.ros2_in_the_clear,
        "telling sessions to {router} would let everybody on the way read motion and forces: take tls or quic, or \
         --ros2-in-the-clear where they may"
    );
    ensure!(
        raw.ros2_domain <= MOST_ROS2_DOMAIN,
        "ros2_domain is {}, want {MOST_ROS2_DOMAIN} at most",
        raw.ros2_domain
    );
    Ok(Some(Ros2Config {
        router: router.for_zenoh(),
        domain: raw.ros2_domain,
        node: format!("teleclay_{}", raw.node),
        commands: if raw.ros2_commands {
            Commands::Taken
        } else {
            Commands::Refused
        },
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proven(change: impl FnOnce(&mut Raw)) -> anyhow::Result<Settings> {
        let mut raw = Raw {
            data_dir: Some(PathBuf::from("data")),
            ..Raw::default()
        };
        change(&mut raw);
        Settings::prove(raw)
    }

    #[test]
    fn the_defaults_are_usable_and_stay_on_loopback() {
        let settings = proven(|_| ()).unwrap();
        assert!(settings.listen.ip().is_loopback() && settings.zenoh_control.is_loopback());
        assert_eq!(settings.zenoh_slow.to_string(), "tcp/127.0.0.1:7548");
        assert!(!settings.is_https);
    }

    #[test]
    fn listening_beyond_loopback_without_a_token_is_refused_and_says_how_to_set_one() {
        let http = proven(|raw| raw.listen = "0.0.0.0:8080".parse().unwrap())
            .unwrap_err()
            .to_string();
        assert!(http.contains("TELECLAY_TOKEN"), "{http}");
        let zenoh = proven(|raw| raw.zenoh_listen = "tcp/0.0.0.0:7547".to_owned())
            .unwrap_err()
            .to_string();
        assert!(zenoh.contains("TELECLAY_TOKEN"), "{zenoh}");
        let token = || Some("a token of good length".to_owned());
        assert!(
            proven(|raw| (raw.listen, raw.token) = ("0.0.0.0:8080".parse().unwrap(), token()))
                .is_ok_and(|settings| settings.is_https)
        );
        assert!(proven(|raw| raw.token = Some("short".to_owned())).is_err());
    }

    #[test]
    fn beyond_loopback_nothing_is_said_in_the_clear_unless_told_to() {
        let on = |endpoint: &str, without_tls: bool| {
            proven(|raw| {
                raw.zenoh_listen = endpoint.to_owned();
                raw.token = Some("a token of good length".to_owned());
                raw.without_tls = without_tls;
            })
        };
        for clear in ["tcp/0.0.0.0:7547", "udp/192.0.2.7:7547"] {
            let said = on(clear, false).unwrap_err().to_string();
            assert!(said.contains("quic/") && said.contains(":7547"), "{said}");
            assert!(on(clear, true).is_ok());
        }
        for secure in ["quic/0.0.0.0:7547", "tls/[::]:7547", "tcp/127.0.0.1:7547"] {
            assert!(on(secure, false).is_ok(), "{secure}");
        }
        let clear = |raw: &mut Raw| {
            raw.listen = "0.0.0.0:8080".parse().unwrap();
            raw.token = Some("a token of good length".to_owned());
            raw.without_tls = true;
        };
        assert!(!proven(clear).unwrap().is_https);
    }

    #[test]
    fn ros_2_hears_nothing_and_commands_nothing_unless_told_so() {
        assert!(proven(|_| ()).unwrap().ros2.is_none());
        let with = |router: &str, change: fn(&mut Raw)| {
            proven(|raw| {
                raw.ros2 = Some(router.to_owned());
                change(raw);
            })
        };
        let ros2 = with("tcp/127.0.0.1:7447", |_| ()).unwrap().ros2.unwrap();
        assert_eq!((ros2.domain, ros2.commands), (0, Commands::Refused));
        let commands = with("tcp/127.0.0.1:7447", |raw| raw.ros2_commands = true);
        assert_eq!(commands.unwrap().ros2.unwrap().commands, Commands::Taken);
        assert!(proven(|raw| raw.ros2_commands = true).is_err());
        let said = with("tcp/192.0.2.7:7447", |_| ()).unwrap_err().to_string();
        assert!(said.contains("--ros2-in-the-clear"), "{said}");
        assert!(with("tcp/192.0.2.7:7447", |raw| raw.ros2_in_the_clear = true).is_ok());
        assert!(with("tls/192.0.2.7:7447", |_| ()).is_ok());
        assert!(with("tcp/127.0.0.1:7447", |raw| raw.ros2_domain = 233).is_err());
    }

    #[test]
    fn threads_and_budget_are_within_their_bounds() {
        let threads = |count| proven(|raw| raw.tick_threads = Some(count));
        assert_eq!(threads(8).unwrap().tick_threads, 8);
        for count in [0, 9] {
            let said = threads(count).unwrap_err().to_string();
            assert!(said.contains("want 1 to 8"), "{said}");
        }
        assert!((1..=8).contains(&proven(|_| ()).unwrap().tick_threads));
        assert!(proven(|raw| raw.tick_budget = 0.0).is_ok());
        assert!(proven(|raw| raw.tick_budget = 1.1).is_err());
    }

    #[test]
    fn a_certificate_comes_with_its_key_and_hosts_are_hosts() {
        assert!(proven(|raw| raw.tls_cert = Some("a.pem".into())).is_err());
        let both = |raw: &mut Raw| {
            (raw.tls_cert, raw.tls_key) = (Some("a.pem".into()), Some("a.key".into()));
        };
        assert!(proven(both).unwrap().is_https, "also on loopback");
        let said = proven(|raw| raw.hosts = vec!["my host".to_owned()]).unwrap_err();
        assert!(said.to_string().contains("`my host`"), "{said}");
    }
}
