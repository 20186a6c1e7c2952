//! Certificates: of the server's own authority, or of somebody else's.

use std::path::Path;

use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa,
    Issuer, KeyPair, KeyUsagePurpose, SerialNumber,
};
use rustls_pki_types::pem::PemObject as _;
use rustls_pki_types::{CertificateDer, PrivateKeyDer};
use sha2::{Digest as _, Sha256};
use teleclay_proto::invite::Fingerprint;
use time::{Duration, OffsetDateTime};

use crate::files::{self, At as _, DoorError};

/// The name that every such authority has. Handles tell them apart by their fingerprints.
const NAME: &str = "teleclay server authority";
/// An authority is good for so long: invites name it.
const AUTHORITY_LASTS: Duration = Duration::days(20 * 365);
/// A certificate is good for so long: the most that every browser takes of a private authority. A new one is issued at
/// each start.
const CERTIFICATE_LASTS: Duration = Duration::days(800);
/// Clocks of others may be late by this much.
const EARLIER: Duration = Duration::days(1);

/// What a server shows of itself, and the key to it.
#[derive(Clone)]
pub struct Identity {
    /// The certificate, then those that vouch for it, in PEM.
    pub chain_pem: String,
    /// The private key, in PEM.
    pub key_pem: String,
    /// What the last certificate of the chain is known by. Handles that were invited take no other.
    pub fingerprint: Fingerprint,
}

impl std::fmt::Debug for Identity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Identity({})", self.fingerprint)
    }
}

impl Identity {
    /// From files in PEM, as other authorities give them: the certificate and those that vouch for it; the private key.
    ///
    /// # Errors
    /// A file cannot be read, or holds none.
    pub fn read(chain: &Path, key: &Path) -> Result<Self, DoorError> {
        let chain_pem = std::fs::read_to_string(chain).at(chain)?;
        let key_pem = std::fs::read_to_string(key).at(key)?;
        PrivateKeyDer::from_pem_slice(key_pem.as_bytes())
            .map_err(|error| DoorError::content(key, error))?;
        Ok(Self {
            fingerprint: last_fingerprint(&chain_pem)
                .map_err(|reason| DoorError::content(chain, reason))?,
            chain_pem,
            key_pem,
        })
    }
}

/// What the last certificate of a chain is known by.
fn last_fingerprint(chain_pem: &str) -> Result<Fingerprint, String> {
    let mut last = None;
    for certificate in CertificateDer::pem_slice_iter(chain_pem.as_bytes()) {
        last = Some(certificate.map_err(|error| error.to_string())?);
    }
    let last = last.ok_or("there is no certificate in it")?;
    Ok(fingerprint(&last))
}

/// What a certificate is known by: SHA-256 of its DER.
#[must_use]
pub fn fingerprint(certificate: &CertificateDer<'_>) -> Fingerprint {
    Fingerprint::new(Sha256::digest(certificate).into())
}

/// The server's own authority.
pub struct Authority {
    pem: String,
    issuer: Issuer<'static, KeyPair>,
}

impl Authority {
    /// The one that is kept in the data folder; where there is none, a new one, which is kept from then on.
    ///
    /// # Errors
    /// A file cannot be read or written, or holds something else; no key can be made.
    pub fn open(data: &Path) -> Result<Self, DoorError> {
        let folder = files::folder(data)?;
        let _lock = files::lock(&folder.join("authority.lock"))?;
        let (path, key_path) = (folder.join("authority.pem"), folder.join("authority.key"));
        let kept = (files::read(&path)?, files::read(&key_path)?);
        let (pem, key) = match kept {
            (Some(pem), Some(key)) => {
                let key = KeyPair::from_pem(&key)
                    .map_err(|error| DoorError::content(&key_path, error))?;
                check_pair(&pem, &key).map_err(|reason| DoorError::content(&path, reason))?;
                (pem, key)
            }
            // The key is written first: without the other file nobody has seen the authority yet.
            (None, _) => {
                let key = KeyPair::generate()?;
                let pem = of_authority(OffsetDateTime::now_utc())
                    .self_signed(&key)?
                    .pem();
                files::replace(&key_path, &key.serialize_pem())?;
                files::replace(&path, &pem)?;
                (pem, key)
            }
            (Some(_), None) => {
                return Err(DoorError::content(
                    &key_path,
                    "it is gone, and without it no certificate can be issued: bring it back, or take authority.pem \
                     away for a new authority, which ends every invite",
                ));
            }
        };
        let issuer = Issuer::new(of_authority(OffsetDateTime::now_utc()), key);
        Ok(Self { pem, issuer })
    }

    /// The authority's certificate, in PEM: for browsers of people who want to trust it.
    #[must_use]
    pub fn pem(&self) -> &str {
        &self.pem
    }

    /// A certificate with a new key, for a server that goes by these names and addresses.
    ///
    /// # Errors
    /// A name is none.
    pub fn issue(&self, names: &[String]) -> Result<Identity, DoorError> {
        let now = OffsetDateTime::now_utc();
        let key = KeyPair::generate()?;
        let mut params = CertificateParams::new(names.to_vec())?;
        params.distinguished_name = named("teleclay server");
        params.serial_number = Some(serial_number());
        params.not_before = now - EARLIER;
        params.not_after = now + CERTIFICATE_LASTS;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
        params.use_authority_key_identifier_extension = true;
        let certificate = params.signed_by(&key, &self.issuer)?;
        let chain_pem = certificate.pem() + &self.pem;
        Ok(Identity {
            fingerprint: last_fingerprint(&chain_pem)
                .map_err(|reason| DoorError::content(Path::new("authority.pem"), reason))?,
            chain_pem,
            key_pem: key.serialize_pem(),
        })
    }
}

impl std::fmt::Debug for Authority {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Authority")
    }
}

fn of_authority(now: OffsetDateTime) -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name = named(NAME);
    params.serial_number = Some(serial_number());
    params.not_before = now - EARLIER;
    params.not_after = now + AUTHORITY_LASTS;
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    params
}

fn named(name: &str) -> DistinguishedName {
    let mut names = DistinguishedName::new();
    names.push(DnType::CommonName, name);
    names
}

/// No two certificates of one issuer have the same, RFC 5280 §4.1.2.2.
fn serial_number() -> SerialNumber {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).expect("the system has randomness");
    // Above zero, and of one length.
    bytes[0] = bytes[0] & 0x3f | 0x40;
    SerialNumber::from_slice(&bytes)
}

/// Whether a certificate is that of a key.
fn check_pair(pem: &str, key: &KeyPair) -> Result<(), String> {
    let certificate =
        CertificateDer::from_pem_slice(pem.as_bytes()).map_err(|error| error.to_string())?;
    let public = rcgen::PublicKeyData::der_bytes(key);
    let holds = certificate.windows(public.len()).any(|part| part == public);
    holds
        .then_some(())
        .ok_or_else(|| "it does not belong to authority.key".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::test_folder;

    #[test]
    fn the_authority_that_was_made_is_the_one_that_is_found_again() {
        let data = test_folder("authority");
        let made = Authority::open(&data).unwrap();
        let found = Authority::open(&data).unwrap();
        assert_eq!(made.pem(), found.pem());
        let names = ["localhost".to_owned(), "192.0.2.7".to_owned()];
        let (one, two) = (made.issue(&names).unwrap(), found.issue(&names).unwrap());
        assert_eq!(one.fingerprint, two.fingerprint);
        assert_ne!(
            (&one.chain_pem, &one.key_pem),
            (&two.chain_pem, &two.key_pem)
        );
        std::fs::remove_dir_all(data).unwrap();
    }

    #[test]
    fn an_authority_whose_files_do_not_belong_together_is_refused_in_words() {
        let (data, other) = (test_folder("mine"), test_folder("other"));
        Authority::open(&data).unwrap();
        Authority::open(&other).unwrap();
        let key = |data: &Path| data.join("doors/authority.key");
        std::fs::copy(key(&other), key(&data)).unwrap();
        let said = Authority::open(&data).unwrap_err().to_string();
        assert!(said.contains("does not belong to authority.key"), "{said}");
        std::fs::remove_file(key(&data)).unwrap();
        let said = Authority::open(&data).unwrap_err().to_string();
        assert!(said.contains("ends every invite"), "{said}");
        for folder in [data, other] {
            std::fs::remove_dir_all(folder).unwrap();
        }
    }

    #[test]
    fn keys_are_nobody_elses_to_read() {
        use std::os::unix::fs::PermissionsExt as _;
        let data = test_folder("modes");
        Authority::open(&data).unwrap();
        for file in ["authority.key", "authority.pem"] {
            let mode = std::fs::metadata(data.join("doors").join(file))
                .unwrap()
                .permissions()
                .mode();
            assert_eq!(mode & 0o777, 0o600, "{file}");
        }
        std::fs::remove_dir_all(data).unwrap();
    }
}
