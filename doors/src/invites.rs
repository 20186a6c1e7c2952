//! Who was invited: a file that the server reads again whenever it has changed, and that a command changes while the
//! server runs.

use std::collections::BTreeMap;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use teleclay_channel::Secret;
use teleclay_proto::SessionId;
use teleclay_proto::invite::{InviteId, InviteToken, Role};

use crate::files::{self, At as _, DoorError};

/// Invites that are kept at most.
const MOST: usize = 4096;
/// An invite that is over is kept in the list for this long, for people to see.
const KEPT_FOR: Duration = Duration::from_secs(30 * 24 * 3600);

/// An invite, but for its secret.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Invite {
    /// The session that it is to.
    pub session: SessionId,
    /// What its holder may do there.
    pub role: Role,
    /// When it was made, s since 1970 (UTC).
    pub made_at: u64,
    /// When it ends, likewise; never if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expires_at: Option<u64>,
    /// When it was taken back, likewise, if it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revoked_at: Option<u64>,
}

impl Invite {
    /// Whether it lets somebody in.
    #[must_use]
    pub fn is_good(&self, now: SystemTime) -> bool {
        let is_over = self.ended_at().is_some_and(|ended| ended <= seconds(now));
        !is_over
    }

    fn ended_at(&self) -> Option<u64> {
        match (self.revoked_at, self.expires_at) {
            (Some(revoked), Some(expires)) => Some(revoked.min(expires)),
            (revoked, expires) => revoked.or(expires),
        }
    }
}

/// Somebody with a good invite.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Guest {
    /// The session that they were invited to.
    pub session: SessionId,
    /// What they may do there.
    pub role: Role,
    /// What they have to know.
    pub secret: Secret,
}

/// A line of the file.
#[derive(Clone, Serialize, Deserialize)]
struct Record {
    #[serde(flatten)]
    invite: Invite,
    /// What the token stands for: it lets in, but the token cannot be had from it.
    #[serde(with = "hex::serde")]
    secret: [u8; 32],
}

type Records = BTreeMap<InviteId, Record>;

/// A file as it was when it was read.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Version {
    inode: u64,
    changed: (i64, i64),
    length: u64,
}

/// All invites of a server.
pub struct Invites {
    path: PathBuf,
    lock: PathBuf,
    known: Mutex<Known>,
}

/// What the file held when it was read last.
#[derive(Default)]
struct Known {
    version: Option<Version>,
    records: Records,
}

/// What the file holds.
struct Current<'a>(MutexGuard<'a, Known>);

impl std::ops::Deref for Current<'_> {
    type Target = Records;

    fn deref(&self) -> &Records {
        &self.0.records
    }
}

impl Invites {
    /// Those that are kept in the data folder.
    ///
    /// # Errors
    /// The folder cannot be made, or the file cannot be read.
    pub fn open(data: &Path) -> Result<Self, DoorError> {
        let folder = files::folder(data)?;
        let invites = Self {
            path: folder.join("invites.json"),
            lock: folder.join("invites.lock"),
            known: Mutex::default(),
        };
        invites.read()?;
        Ok(invites)
    }

    /// Invites somebody, for a while or until the invite is revoked. The token is not kept: it is told this once.
    ///
    /// # Errors
    /// The file cannot be read or written, or there are too many invites.
    ///
    /// # Panics
    /// The system has no randomness.
    pub fn make(
        &self,
        now: SystemTime,
        session: SessionId,
        role: Role,
        lasts: Option<Duration>,
    ) -> Result<InviteToken, DoorError> {
        let _lock = files::lock(&self.lock)?;
        let mut records = self.read()?.clone();
        records.retain(|_, record| {
            let ended = record.invite.ended_at();
            ended.is_none_or(|ended| seconds(now) < ended + KEPT_FOR.as_secs())
        });
        if MOST <= records.len() {
            return Err(DoorError::TooMany { most: MOST });
        }
        let id = loop {
            let id = InviteId::new(u32::from_le_bytes(random()));
            if !records.contains_key(&id) {
                break id;
            }
        };
        let token = InviteToken::new(id, random());
        let invite = Invite {
            session,
            role,
            made_at: seconds(now),
            expires_at: lasts.map(|lasts| seconds(now) + lasts.as_secs()),
            revoked_at: None,
        };
        let secret = *Secret::of_token(&token.to_string()).as_bytes();
        records.insert(id, Record { invite, secret });
        self.write(records)?;
        Ok(token)
    }

    /// Takes an invite back. Gives it, or nothing where there is none of this number.
    ///
    /// # Errors
    /// The file cannot be read or written.
    pub fn revoke(&self, now: SystemTime, id: InviteId) -> Result<Option<Invite>, DoorError> {
        let _lock = files::lock(&self.lock)?;
        let mut records = self.read()?.clone();
        let Some(record) = records.get_mut(&id) else {
            return Ok(None);
        };
        record.invite.revoked_at.get_or_insert(seconds(now));
        let invite = record.invite.clone();
        self.write(records)?;
        Ok(Some(invite))
    }

    /// Every invite, those that are over for a while, too.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn list(&self) -> Result<Vec<(InviteId, Invite)>, DoorError> {
        let records = self.read()?;
        Ok(records
            .iter()
            .map(|(id, record)| (*id, record.invite.clone()))
            .collect())
    }

    /// Whoever was invited under this number, if the invite is good now.
    ///
    /// # Errors
    /// The file cannot be read: then nobody is let in.
    pub fn guest(&self, now: SystemTime, id: InviteId) -> Result<Option<Guest>, DoorError> {
        let records = self.read()?;
        Ok(records
            .get(&id)
            .filter(|record| record.invite.is_good(now))
            .map(|record| Guest {
                session: record.invite.session.clone(),
                role: record.invite.role,
                secret: Secret::from_bytes(record.secret),
            }))
    }

    fn read(&self) -> Result<Current<'_>, DoorError> {
        let mut known = self.known();
        let now = self.version()?;
        if now.is_none() {
            known.records.clear();
        } else if now != known.version {
            let text = files::read(&self.path)?.unwrap_or_default();
            known.records = serde_json::from_str(&text)
                .map_err(|error| DoorError::content(&self.path, error))?;
        }
        known.version = now;
        Ok(Current(known))
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn version(&self) -> Result<Option<Version>, DoorError> {
        match std::fs::metadata(&self.path) {
            Ok(file) => Ok(Some(Version {
                inode: file.ino(),
                changed: (file.mtime(), file.mtime_nsec()),
                length: file.len(),
            })),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error).at(&self.path),
        }
    }

    fn write(&self, records: Records) -> Result<(), DoorError> {
        let text = serde_json::to_string_pretty(&records).expect("its keys are texts");
        files::replace(&self.path, &(text + "\n"))?;
        let version = self.version()?;
        *self.known() = Known { version, records };
        Ok(())
    }
}

impl std::fmt::Debug for Invites {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Invites")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}

fn seconds(time: SystemTime) -> u64 {
    time.duration_since(UNIX_EPOCH)
        .map_or(0, |since| since.as_secs())
}

fn random<const N: usize>() -> [u8; N] {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).expect("the system has randomness");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::test_folder;

    const HOUR: Duration = Duration::from_secs(3600);

    fn demo() -> SessionId {
        SessionId::new("demo").unwrap()
    }

    #[test]
    fn an_invite_is_good_for_its_time_for_its_session_and_until_it_is_revoked() {
        let data = test_folder("invites");
        let invites = Invites::open(&data).unwrap();
        let now = SystemTime::now();
        let for_an_hour = invites
            .make(now, demo(), Role::Operator, Some(HOUR))
            .unwrap();
        let for_ever = invites.make(now, demo(), Role::Spectator, None).unwrap();
        let guest = |at: SystemTime, token: &InviteToken| invites.guest(at, token.id()).unwrap();
        let operator = guest(now, &for_an_hour).unwrap();
        assert_eq!(
            (operator.role, &operator.session),
            (Role::Operator, &demo())
        );
        assert_eq!(operator.secret, Secret::of_token(&for_an_hour.to_string()));
        assert_ne!(operator.secret, Secret::of_token(&for_ever.to_string()));
        assert_eq!(guest(now + HOUR, &for_an_hour), None);
        assert!(guest(now + 10_000 * HOUR, &for_ever).is_some());
        assert!(invites.revoke(now, for_ever.id()).unwrap().is_some());
        assert_eq!(guest(now, &for_ever), None);
        assert_eq!(invites.guest(now, InviteId::new(1)).unwrap(), None);
        std::fs::remove_dir_all(data).unwrap();
    }

    #[test]
    fn what_one_process_writes_another_reads_and_tokens_are_not_in_the_file() {
        let data = test_folder("shared");
        let (server, command) = (Invites::open(&data).unwrap(), Invites::open(&data).unwrap());
        let now = SystemTime::now();
        let tokens: Vec<InviteToken> = (0..5)
            .map(|_| command.make(now, demo(), Role::Operator, None).unwrap())
            .collect();
        for token in &tokens {
            assert!(server.guest(now, token.id()).unwrap().is_some());
        }
        command.revoke(now, tokens[2].id()).unwrap();
        assert_eq!(server.guest(now, tokens[2].id()).unwrap(), None);
        let text = std::fs::read_to_string(data.join("doors/invites.json")).unwrap();
        for token in &tokens {
            let token = token.to_string();
            let (_, secret) = token.split_once('.').unwrap();
            assert!(!text.contains(secret));
        }
        assert_eq!(server.list().unwrap().len(), 5);
        std::fs::remove_dir_all(data).unwrap();
    }

    #[test]
    fn a_file_that_cannot_be_read_lets_nobody_in_and_is_not_overwritten() {
        let data = test_folder("damaged");
        let invites = Invites::open(&data).unwrap();
        let now = SystemTime::now();
        let token = invites.make(now, demo(), Role::Operator, None).unwrap();
        let path = data.join("doors/invites.json");
        std::fs::write(&path, "{ \"half").unwrap();
        assert!(invites.guest(now, token.id()).is_err());
        assert!(invites.make(now, demo(), Role::Operator, None).is_err());
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "{ \"half");
        std::fs::remove_dir_all(data).unwrap();
    }

    #[test]
    fn those_that_are_long_over_make_room() {
        let data = test_folder("old");
        let invites = Invites::open(&data).unwrap();
        let now = SystemTime::now();
        let old = invites
            .make(now, demo(), Role::Operator, Some(HOUR))
            .unwrap();
        let later = now + 2 * HOUR;
        invites.make(later, demo(), Role::Operator, None).unwrap();
        assert_eq!(invites.list().unwrap().len(), 2);
        let much_later = later + KEPT_FOR;
        invites
            .make(much_later, demo(), Role::Operator, None)
            .unwrap();
        let left = invites.list().unwrap();
        assert!(left.len() == 2 && left.iter().all(|(id, _)| *id != old.id()));
        std::fs::remove_dir_all(data).unwrap();
    }
}
