//! Who did what to which session: one line of JSON each, written by a thread of its own so that nobody waits for a
//! disk.

use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::net::IpAddr;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;

use crate::files::{self, At as _, DoorError};

/// Deeds that may wait to be written; more are counted and not kept.
const WAITING: usize = 1024;
/// A file that is longer is put aside, bytes.
const LONGEST_FILE: u64 = 8 << 20;
/// Of what was refused, so much is written at once, and then one each so often: whoever is refused again and again
/// could otherwise push everybody else's deeds out of the log.
const REFUSALS: u32 = 60;
const REFUSAL_EVERY: Duration = Duration::from_secs(1);
/// Files that were put aside are kept up to this number: `audit.jsonl.1` is the newest.
const KEPT: u32 = 4;

/// Something that somebody did, or was kept from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Deed {
    /// Who: `token`, `invite <number>`, `lease <number>`, or `nobody`.
    pub who: String,
    /// Where they asked from, where that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<IpAddr>,
    /// What they did, such as `PATCH /api/v1/sessions/demo` or `join`.
    pub did: String,
    /// The session, where it was one's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub session: Option<String>,
    /// What came of it.
    pub outcome: String,
}

#[derive(Serialize)]
struct Line<'a> {
    at: &'a str,
    #[serde(flatten)]
    deed: &'a Deed,
    /// Deeds before this one that were not kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    missing: Option<u64>,
}

/// Where deeds are told. Copies are the same log; with the last of them the thread ends, once it has written all.
#[derive(Clone, Debug)]
pub struct Audit {
    told: SyncSender<Told>,
    missing: Arc<AtomicU64>,
    /// When every refusal so far has had its share of time.
    refused_until: Arc<Mutex<Instant>>,
}

#[derive(Debug)]
enum Told {
    Deed(OffsetDateTime, Deed),
    /// Everything before this is written once the other end is gone.
    Settled(#[expect(dead_code, reason = "dropping it is the answer")] SyncSender<()>),
}

impl Audit {
    /// Writes to the data folder from now on.
    ///
    /// # Errors
    /// The file cannot be written to, or no thread can be started.
    pub fn open(data: &Path) -> Result<Self, DoorError> {
        let path = files::folder(data)?.join("audit.jsonl");
        let file = append_to(&path).at(&path)?;
        let (tell, told) = sync_channel(WAITING);
        let missing = Arc::new(AtomicU64::new(0));
        let log = Log {
            file,
            missing: Arc::clone(&missing),
            has_failed: false,
            path: path.clone(),
        };
        std::thread::Builder::new()
            .name("teleclay-audit".to_owned())
            .spawn(move || log.write_all(&told))
            .at(&path)?;
        Ok(Self {
            told: tell,
            missing,
            refused_until: Arc::new(Mutex::new(Instant::now())),
        })
    }

    /// Tells of something that was refused, as far as there is room for refusals. Never waits.
    pub fn tell_refused(&self, now: Instant, deed: Deed) {
        let mut until = self
            .refused_until
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let next = (*until).max(now) + REFUSAL_EVERY;
        if REFUSALS * REFUSAL_EVERY < next - now {
            self.missing.fetch_add(1, Ordering::Relaxed);
            return;
        }
        *until = next;
        drop(until);
        self.tell(deed);
    }

    /// Tells a deed. Never waits.
    pub fn tell(&self, deed: Deed) {
        let told = Told::Deed(OffsetDateTime::now_utc(), deed);
        if self.told.try_send(told).is_err() {
            self.missing.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Waits until all that was told is written, for a while at most.
    pub fn settle(&self, within: Duration) {
        let (answer, answered) = sync_channel(0);
        if self.told.try_send(Told::Settled(answer)).is_ok() {
            // Nothing is ever said: the other end goes, or the time.
            let _ = answered.recv_timeout(within);
        }
    }
}

struct Log {
    path: PathBuf,
    file: File,
    missing: Arc<AtomicU64>,
    /// Said once, until it goes again.
    has_failed: bool,
}

impl Log {
    fn write_all(mut self, told: &Receiver<Told>) {
        for told in told {
            let Told::Deed(at, deed) = told else { continue };
            match self.write(at, &deed) {
                Ok(()) => self.has_failed = false,
                Err(error) => {
                    self.missing.fetch_add(1, Ordering::Relaxed);
                    if !std::mem::replace(&mut self.has_failed, true) {
                        tracing::error!(path = %self.path.display(), %error, "the audit log cannot be written");
                    }
                }
            }
        }
    }

    fn write(&mut self, at: OffsetDateTime, deed: &Deed) -> io::Result<()> {
        if LONGEST_FILE < self.file.metadata()?.len() {
            self.put_aside()?;
        }
        let at = at.format(&Rfc3339).map_err(io::Error::other)?;
        let missing = self.missing.swap(0, Ordering::Relaxed);
        let line = Line {
            at: &at,
            deed,
            missing: (0 < missing).then_some(missing),
        };
        let mut text = serde_json::to_vec(&line)?;
        text.push(b'\n');
        let written = self.file.write_all(&text);
        if written.is_err() {
            self.missing.fetch_add(missing, Ordering::Relaxed);
        }
        written
    }

    fn put_aside(&mut self) -> io::Result<()> {
        let numbered = |number: u32| self.path.with_extension(format!("jsonl.{number}"));
        for number in (1..KEPT).rev() {
            match std::fs::rename(numbered(number), numbered(number + 1)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        std::fs::rename(&self.path, numbered(1))?;
        self.file = append_to(&self.path)?;
        Ok(())
    }
}

fn append_to(path: &Path) -> io::Result<File> {
    OpenOptions::new()
        .append(true)
        .create(true)
        .mode(0o600)
        .open(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::test_folder;

    fn deed(did: &str) -> Deed {
        Deed {
            who: "invite 0000001a".to_owned(),
            from: Some(IpAddr::from([192, 0, 2, 7])),
            did: did.to_owned(),
            session: Some("demo".to_owned()),
            outcome: "200".to_owned(),
        }
    }

    #[test]
    fn each_deed_is_one_line_whatever_is_in_it() {
        let data = test_folder("audit");
        let audit = Audit::open(&data).unwrap();
        audit.tell(deed("PATCH /api/v1/sessions/demo"));
        audit.tell(deed("a line\nbreak and a \"quote\""));
        audit.settle(Duration::from_secs(10));
        let text = std::fs::read_to_string(data.join("doors/audit.jsonl")).unwrap();
        let lines: Vec<serde_json::Value> = text
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        assert_eq!(lines.len(), 2);
        assert_eq!(lines[0]["who"], "invite 0000001a");
        assert_eq!(lines[0]["from"], "192.0.2.7");
        assert_eq!(lines[1]["did"], "a line\nbreak and a \"quote\"");
        std::fs::remove_dir_all(data).unwrap();
    }

    #[test]
    fn whoever_is_refused_again_and_again_does_not_push_others_out_of_the_log() {
        let data = test_folder("refusals");
        let audit = Audit::open(&data).unwrap();
        let now = Instant::now();
        for _ in 0..10_000 {
            audit.tell_refused(now, deed("refused"));
        }
        audit.tell(deed("done"));
        let later = now + 3 * REFUSAL_EVERY;
        for _ in 0..10 {
            audit.tell_refused(later, deed("refused later"));
        }
        audit.tell(deed("last"));
        audit.settle(Duration::from_secs(10));
        let text = std::fs::read_to_string(data.join("doors/audit.jsonl")).unwrap();
        let count = |did: &str| text.lines().filter(|line| line.contains(did)).count();
        assert_eq!(count("\"refused\""), 60);
        assert_eq!((count("\"done\""), count("\"refused later\"")), (1, 3));
        // What is left out is counted, in the lines that follow.
        let lines = text
            .lines()
            .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
        let missing: u64 = lines.filter_map(|line| line["missing"].as_u64()).sum();
        assert_eq!(missing, (10_000 - 60) + (10 - 3));
        std::fs::remove_dir_all(data).unwrap();
    }

    #[test]
    fn a_long_file_is_put_aside_and_the_oldest_goes() {
        let data = test_folder("rotation");
        let path = files::folder(&data).unwrap().join("audit.jsonl");
        let mut log = Log {
            file: append_to(&path).unwrap(),
            path: path.clone(),
            missing: Arc::default(),
            has_failed: false,
        };
        for number in 0..KEPT + 2 {
            log.file.set_len(LONGEST_FILE + 1).unwrap();
            log.write(OffsetDateTime::UNIX_EPOCH, &deed(&number.to_string()))
                .unwrap();
        }
        let there = |number: u32| path.with_extension(format!("jsonl.{number}")).exists();
        assert!(path.exists() && (1..=KEPT).all(there) && !there(KEPT + 1));
        std::fs::remove_dir_all(data).unwrap();
    }
}
