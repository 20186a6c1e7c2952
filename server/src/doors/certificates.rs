//! What the server shows of itself: a certificate of its own authority, or one that it was given.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use anyhow::Context as _;
use teleclay_doors::{Authority, Identity};
use teleclay_front::Security;
use tokio::sync::watch;

/// A certificate that was given is looked at again this often.
pub(crate) const LOOK_EVERY: Duration = Duration::from_secs(10);

/// Where the certificate comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// The server's own authority, which lies in the data folder.
    Own,
    /// Files in PEM: the certificate with those that vouch for it, and the private key.
    Given {
        /// The certificate.
        chain: PathBuf,
        /// The private key.
        key: PathBuf,
    },
}

impl Source {
    /// A certificate, for a server that goes by these names.
    ///
    /// # Errors
    /// A file cannot be read or written, or holds something else.
    pub fn identity(&self, data: &Path, names: &[String]) -> anyhow::Result<Identity> {
        match self {
            Self::Own => Ok(Authority::open(data)?.issue(names)?),
            Self::Given { chain, key } => Ok(Identity::read(chain, key)?),
        }
    }

    /// Tells of each certificate that is put in place of the one that was given, for as long as it is waited for, and
    /// shows it on the page; looks again `every` so often, and whenever it is `asked` to.
    pub(crate) async fn follow(
        self,
        security: Option<Security>,
        every: Duration,
        mut asked: watch::Receiver<()>,
        tell: impl Fn(Identity, When),
    ) {
        let Self::Given { chain, key } = self else {
            return std::future::pending().await;
        };
        let changed = |path: &Path| {
            std::fs::metadata(path)
                .and_then(|file| file.modified())
                .ok()
        };
        let version =
            || -> (Option<SystemTime>, Option<SystemTime>) { (changed(&chain), changed(&key)) };
        let mut shown = version();
        loop {
            let when = tokio::select! {
                () = tokio::time::sleep(every) => When::Free,
                Ok(()) = asked.changed() => When::Now,
            };
            let now = version();
            if now == shown && when == When::Free {
                continue;
            }
            let read = Identity::read(&chain, &key).context("its files");
            match read.and_then(|identity| show(identity, security.as_ref())) {
                Ok(identity) => {
                    shown = now;
                    tracing::info!("there is a new certificate, and {when}");
                    tell(identity, when);
                }
                // It may be half written; it is looked at again.
                Err(error) => tracing::warn!(
                    "the certificate has changed, and the new one cannot be shown: {error:#}"
                ),
            }
        }
    }
}

/// When handles are to see a certificate. Their lines are down for a moment then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum When {
    /// Once nobody holds a tool over Zenoh.
    Free,
    /// At once.
    Now,
}

impl std::fmt::Display for When {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Free => "handles see it once nobody holds a tool over Zenoh",
            Self::Now => "handles see it at once",
        })
    }
}

/// Shows a certificate on the page, where that is encrypted.
///
/// # Errors
/// It is none, or the key is not its own.
fn show(identity: Identity, security: Option<&Security>) -> anyhow::Result<Identity> {
    match security {
        Some(security) => security.replace(&identity.chain_pem, &identity.key_pem)?,
        None => drop(Security::new(&identity.chain_pem, &identity.key_pem)?),
    }
    Ok(identity)
}

/// An address of this machine that others may reach, if it has one.
pub(crate) fn own_address() -> Option<String> {
    let interfaces = pnet_datalink::interfaces();
    let mut addresses = interfaces.iter().flat_map(|interface| &interface.ips);
    let others = addresses.find(|network| network.is_ipv4() && !network.ip().is_loopback());
    others.map(|network| network.ip().to_string())
}

/// Every name and address by which the server may be reached: what it was told, and what this machine has.
pub fn names(told: &[String]) -> Vec<String> {
    let mut names: BTreeSet<String> = told.iter().cloned().collect();
    names.insert("localhost".to_owned());
    names.extend(
        std::fs::read_to_string("/proc/sys/kernel/hostname")
            .ok()
            .map(|name| name.trim().to_owned()),
    );
    let interfaces = pnet_datalink::interfaces();
    let addresses = interfaces.iter().flat_map(|interface| &interface.ips);
    names.extend(addresses.map(|network| network.ip().to_string()));
    // A machine's name may be one that no certificate can have.
    names.retain(|name| is_name(name));
    names.into_iter().collect()
}

/// Whether a certificate can be for it.
pub fn is_name(name: &str) -> bool {
    let label = |label: &str| {
        (1..=63).contains(&label.len())
            && label
                .bytes()
                .all(|byte| byte.is_ascii_alphanumeric() || byte == b'-')
            && !label.starts_with('-')
            && !label.ends_with('-')
    };
    name.parse::<std::net::IpAddr>().is_ok() || (name.len() <= 253 && name.split('.').all(label))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_goes_by_its_addresses_and_by_what_it_is_told() {
        let names = names(&["lab.example".to_owned(), "not a name".to_owned()]);
        for expected in ["localhost", "127.0.0.1", "lab.example"] {
            assert!(names.iter().any(|name| name == expected), "{names:?}");
        }
        assert!(!names.iter().any(|name| name.contains(' ')));
    }

    #[test]
    fn names_that_no_certificate_can_have_are_told_from_the_rest() {
        for good in ["lab.example", "a", "192.0.2.7", "2001:db8::1", "xn--abc"] {
            assert!(is_name(good), "{good}");
        }
        for bad in ["", "my_box", "-a", "a..b", "a b", "lab.example."] {
            assert!(!is_name(bad), "{bad}");
        }
    }

    #[tokio::test]
    async fn a_certificate_that_is_put_in_place_of_the_one_that_was_given_is_shown_without_a_restart()
     {
        let folder = std::env::temp_dir();
        let folder = folder.join(format!("teleclay-follow-{}", std::process::id()));
        let [one, other] = ["one", "other"].map(|name| {
            let authority = Authority::open(&folder.join(name)).unwrap();
            authority.issue(&["127.0.0.1".to_owned()]).unwrap()
        });
        let (chain, key) = (folder.join("chain.pem"), folder.join("key.pem"));
        let put = |identity: &Identity| {
            std::fs::write(&chain, &identity.chain_pem).unwrap();
            std::fs::write(&key, &identity.key_pem).unwrap();
        };
        put(&one);
        let security = Security::new(&one.chain_pem, &one.key_pem).unwrap();
        let listener = teleclay_front::bind(([127, 0, 0, 1], 0).into()).unwrap();
        let port = listener.local_addr().unwrap().port();
        let served = teleclay_front::serve(
            listener,
            axum::Router::new(),
            Some(security.clone()),
            std::future::pending(),
        );
        tokio::spawn(served);
        let source = Source::Given {
            chain: chain.clone(),
            key: key.clone(),
        };
        let (told, mut heard) = tokio::sync::mpsc::unbounded_channel();
        let tell = move |identity: Identity, when| told.send((identity.fingerprint, when)).unwrap();
        let (ask, asked) = watch::channel(());
        let every = Duration::from_millis(5);
        tokio::spawn(source.follow(Some(security), every, asked, tell));
        let endpoint = format!("tls/127.0.0.1:{port}").parse().unwrap();
        let shows = async |identity: &Identity| {
            let looked =
                teleclay_shell::certificate::trusted(&endpoint, Some(identity.fingerprint));
            looked.await.is_ok()
        };
        assert!(shows(&one).await && !shows(&other).await);
        // Half of it is no certificate, and changes nothing.
        std::fs::write(&chain, &other.chain_pem[..other.chain_pem.len() / 3]).unwrap();
        assert!(shows(&one).await);
        put(&other);
        let began = std::time::Instant::now();
        while !shows(&other).await {
            assert!(
                began.elapsed() < Duration::from_secs(30),
                "it is never shown"
            );
        }
        assert!(!shows(&one).await);
        assert_eq!(heard.recv().await, Some((other.fingerprint, When::Free)));
        ask.send_replace(());
        assert_eq!(heard.recv().await, Some((other.fingerprint, When::Now)));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
