//! `teleclay-server invite` and `teleclay-server invites`: they work on the data folder of a server, which reads what
//! they write while it runs.

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use clap::Args;
use serde::{Deserialize, Serialize};
use teleclay_doors::{Invite, Invites};
use teleclay_proto::invite::{Fingerprint, InviteId, InviteLine, InviteToken, Role};
use teleclay_proto::{RealmName, SessionId};

/// Where a running server can be reached, as it writes it into its data folder for these commands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Address {
    /// The page, such as `https://192.0.2.7:8080`.
    pub page: String,
    /// For handles, such as `quic/192.0.2.7:7547`.
    pub endpoint: String,
    /// The realm of its sessions.
    pub realm: RealmName,
    /// What handles know its certificate by, in hexadecimal digits; nothing where they connect in the clear.
    pub fingerprint: Option<String>,
    /// Whether it asks for a token: where it does not, an invite is worth nothing.
    pub needs_token: bool,
}

const FILE: &str = "address.json";

impl Address {
    /// Writes it into the data folder.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, data: &Path) -> io::Result<()> {
        let text = serde_json::to_string_pretty(self).map_err(io::Error::other)?;
        std::fs::write(data.join(FILE), text + "\n")
    }

    /// Writes down by what handles know the certificate from now on, where they connect encrypted.
    pub(crate) fn renew(data: &Path, fingerprint: Fingerprint) -> anyhow::Result<()> {
        let mut address = Self::read(data)?;
        if address.fingerprint.is_some() {
            address.fingerprint = Some(fingerprint.to_string());
            address.write(data)?;
        }
        Ok(())
    }

    fn read(data: &Path) -> anyhow::Result<Self> {
        let path = data.join(FILE);
        let text = std::fs::read_to_string(&path).with_context(|| {
            let path = path.display();
            format!("{path} (a server that was started with this data folder writes it)")
        })?;
        serde_json::from_str(&text).with_context(|| path.display().to_string())
    }
}

/// Which data folder.
#[derive(Clone, Debug, Args)]
pub(crate) struct Folder {
    /// The server's data folder (default: a folder of the user's)
    #[arg(long, value_name = "DIR", env = "TELECLAY_DATA_DIR")]
    data_dir: Option<PathBuf>,
}

impl Folder {
    pub(crate) fn path(&self) -> anyhow::Result<PathBuf> {
        self.data_dir.clone().map_or_else(default_data_dir, Ok)
    }
}

/// Invite somebody to a session: prints a link for a browser and a line for a handle
#[derive(Clone, Debug, Args)]
pub struct InviteCommand {
    /// The session
    session: SessionId,
    /// What they may do: spectator (watch), operator (hold a tool, too), admin (change the session, too)
    #[arg(long, default_value_t = Role::Spectator)]
    role: Role,
    /// How long the invite is good for, such as 90m, 2h or 7d (default: until it is taken back)
    #[arg(long = "for", value_name = "TIME", value_parser = lasting)]
    lasts: Option<Duration>,
    #[command(flatten)]
    folder: Folder,
}

/// List invites, or take one back
#[derive(Clone, Debug, Args)]
pub struct InvitesCommand {
    /// Take back the invite of this number: whoever came by it is let go of
    #[arg(long, value_name = "NUMBER")]
    revoke: Option<InviteId>,
    #[command(flatten)]
    folder: Folder,
}

fn lasting(text: &str) -> Result<Duration, String> {
    let lasts = humantime::parse_duration(text).map_err(|error| error.to_string())?;
    if lasts < Duration::from_secs(1) {
        return Err("want a second at least".to_owned());
    }
    Ok(lasts)
}

impl InviteCommand {
    /// Makes the invite and prints it.
    ///
    /// # Errors
    /// No server has used the folder, it takes anybody, or something cannot be read or written.
    pub fn run(&self, out: &mut impl Write) -> anyhow::Result<()> {
        let data = self.folder.path()?;
        let address = Address::read(&data)?;
        anyhow::ensure!(
            address.needs_token,
            "the server of {} has no token and takes anybody, so an invite would mean nothing: start it with \
             TELECLAY_TOKEN",
            data.display()
        );
        let fingerprint: Option<Fingerprint> =
            address.fingerprint.as_deref().map(str::parse).transpose()?;
        let invites = Invites::open(&data)?;
        let now = SystemTime::now();
        let token = invites.make(now, self.session.clone(), self.role, self.lasts)?;
        let line = InviteLine {
            endpoint: address.endpoint,
            realm: address.realm,
            session: self.session.clone(),
            fingerprint,
            token: token.clone(),
        };
        let until = match self.lasts {
            Some(lasts) => format!("for {}", humantime::format_duration(lasts)),
            None => "until it is taken back".to_owned(),
        };
        writeln!(
            out,
            "invite {}: {} of {}, {until}",
            token.id(),
            self.role,
            self.session
        )?;
        writeln!(out, "{}", link(&address.page, &self.session, &token))?;
        if self.role >= super::TO_HOLD_A_TOOL {
            writeln!(out, "{line}")?;
        }
        Ok(())
    }
}

/// What a browser opens. What stands behind the # is not sent to anybody.
fn link(page: &str, session: &SessionId, token: &InviteToken) -> String {
    format!("{page}/#/live?session={session}&token={token}")
}

impl InvitesCommand {
    /// Does what it says, and prints what came of it.
    ///
    /// # Errors
    /// There is no such invite, or the file cannot be read or written.
    pub fn run(&self, out: &mut impl Write) -> anyhow::Result<()> {
        let invites = Invites::open(&self.folder.path()?)?;
        let now = SystemTime::now();
        if let Some(id) = self.revoke {
            let revoked = invites.revoke(now, id)?;
            let invite = revoked.with_context(|| format!("there is no invite {id}"))?;
            writeln!(out, "{}", row(id, &invite, now))?;
            return Ok(());
        }
        for (id, invite) in invites.list()? {
            writeln!(out, "{}", row(id, &invite, now))?;
        }
        Ok(())
    }
}

fn row(id: InviteId, invite: &Invite, now: SystemTime) -> String {
    let at = |seconds: u64| {
        let at = UNIX_EPOCH + Duration::from_secs(seconds);
        humantime::format_rfc3339_seconds(at).to_string()
    };
    let state = match (invite.revoked_at, invite.expires_at) {
        (Some(revoked), _) => format!("taken back {}", at(revoked)),
        (None, Some(expires)) if invite.is_good(now) => format!("until {}", at(expires)),
        (None, Some(expires)) => format!("ended {}", at(expires)),
        (None, None) => "until it is taken back".to_owned(),
    };
    format!("{id}  {:9}  {}  {state}", invite.role, invite.session)
}

/// The data folder where none is named.
pub(crate) fn default_data_dir() -> anyhow::Result<PathBuf> {
    let set = |name| {
        std::env::var_os(name)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    let base = set("XDG_DATA_HOME").or_else(|| set("HOME").map(|home| home.join(".local/share")));
    Ok(base
        .context("neither XDG_DATA_HOME nor HOME is set: give --data-dir")?
        .join("teleclay"))
}
