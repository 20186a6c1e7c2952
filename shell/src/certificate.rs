//! Certificates, looked at before Zenoh is: Zenoh tries again and again in silence where a certificate is not the one
//! that is wanted, and takes those of every public authority beside it.

use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use quinn::crypto::rustls::QuicClientConfig;
use rustls::client::WebPkiServerVerifier;
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::{CryptoProvider, verify_tls12_signature, verify_tls13_signature};
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::{
    CertificateError, ClientConfig, DigitallySignedStruct, Error, RootCertStore, SignatureScheme,
};
use sha2::{Digest as _, Sha256};
use teleclay_proto::invite::Fingerprint;
use tokio::net::{TcpStream, lookup_host};
use tokio::time::{sleep, timeout};

use crate::endpoint::{Endpoint, Protocol};

/// A server answers within this, or is not there.
const PATIENCE: Duration = Duration::from_secs(5);
/// A connection that was only for a look stays this long.
const STAYS: Duration = Duration::from_millis(500);
/// What Zenoh's QUIC speaks, release by release: each is offered, so that every one is found.
const ZENOH_PROTOCOLS: [&[u8]; 5] = [b"zenoh-ms-mr", b"zenoh-mr", b"zenoh-ms", b"zenoh", b"hq-29"];

/// Why a server's certificate is not known.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProbeError {
    /// Nobody answers there now.
    #[error("{endpoint} does not answer: {reason}")]
    Unreachable {
        /// The endpoint, as it was given.
        endpoint: String,
        /// Why, in the system's words.
        reason: String,
    },
    /// Somebody answers, and must not be spoken to.
    #[error("the certificate of {endpoint} is not acceptable: {reason}")]
    Unacceptable {
        /// The endpoint, as it was given.
        endpoint: String,
        /// What is wrong with it.
        reason: String,
    },
}

/// Looks at the certificate that the server at `endpoint` shows, and gives the one, in PEM, that Zenoh is to trust: the
/// one of its chain that has the fingerprint `pin`. Without a pin a public authority must vouch for the server, and
/// there is nothing to be told. Either way the certificate must be for the endpoint's host, and good today. Protocols
/// in the clear have no certificate.
///
/// # Errors
/// Nobody answers, or the certificate is another one, for another host, expired, or not good yet.
pub async fn trusted(
    endpoint: &Endpoint,
    pin: Option<Fingerprint>,
) -> Result<Option<String>, ProbeError> {
    if !endpoint.protocol.is_secure() {
        return Ok(None);
    }
    let verifier = Arc::new(Verifier::new(pin, &endpoint.to_string())?);
    let unreachable = |reason: String| ProbeError::Unreachable {
        endpoint: endpoint.to_string(),
        reason,
    };
    let met = timeout(PATIENCE, meet(endpoint, &verifier)).await;
    if let Some(reason) = verifier.refusal() {
        return Err(ProbeError::Unacceptable {
            endpoint: endpoint.to_string(),
            reason,
        });
    }
    match met {
        Ok(Ok(())) => Ok(verifier.trusted_pem()),
        Ok(Err(reason)) => Err(unreachable(reason)),
        Err(_) => Err(unreachable(format!(
            "nothing within {} s",
            PATIENCE.as_secs()
        ))),
    }
}

/// Shakes hands with whoever is there, and leaves.
async fn meet(endpoint: &Endpoint, verifier: &Arc<Verifier>) -> Result<(), String> {
    let at = (endpoint.bare_host(), endpoint.port);
    let words = |error: &dyn std::fmt::Display| error.to_string();
    let address = lookup_host(at).await.map_err(|error| words(&error))?.next();
    let address = address.ok_or("the name has no address")?;
    let mut config = ClientConfig::builder_with_provider(Arc::clone(&verifier.provider))
        .with_safe_default_protocol_versions()
        .map_err(|error| words(&error))?
        .dangerous()
        .with_custom_certificate_verifier(Arc::clone(verifier) as Arc<dyn ServerCertVerifier>)
        .with_no_client_auth();
    if endpoint.protocol == Protocol::Tls {
        let host =
            ServerName::try_from(endpoint.bare_host().to_owned()).map_err(|error| words(&error))?;
        let stream = TcpStream::connect(address)
            .await
            .map_err(|error| words(&error))?;
        let connector = tokio_rustls::TlsConnector::from(Arc::new(config));
        return connector
            .connect(host, stream)
            .await
            .map(drop)
            .map_err(|error| words(&error));
    }
    config.alpn_protocols = ZENOH_PROTOCOLS.map(<[u8]>::to_vec).to_vec();
    let config = QuicClientConfig::try_from(config).map_err(|error| words(&error))?;
    let any: SocketAddr = match address {
        SocketAddr::V4(_) => (Ipv4Addr::UNSPECIFIED, 0).into(),
        SocketAddr::V6(_) => (Ipv6Addr::UNSPECIFIED, 0).into(),
    };
    let socket = quinn::Endpoint::client(any).map_err(|error| words(&error))?;
    let config = quinn::ClientConfig::new(Arc::new(config));
    let met = socket
        .connect_with(config, address, endpoint.bare_host())
        .map_err(|error| words(&error))?
        .await;
    match met {
        Ok(connection) => {
            // Closed at once, it would be told to whoever looks after the server as a connection that has failed.
            tokio::spawn(async move {
                sleep(STAYS).await;
                connection.close(0_u8.into(), b"only looking");
                socket.wait_idle().await;
            });
            Ok(())
        }
        Err(error) => {
            // So that the other end hears what was wrong, too.
            socket.wait_idle().await;
            Err(words(&error))
        }
    }
}

/// Judges a certificate, and keeps what came of it.
#[derive(Debug)]
struct Verifier {
    pin: Option<Fingerprint>,
    provider: Arc<CryptoProvider>,
    public: Arc<WebPkiServerVerifier>,
    judged: Mutex<Judged>,
}

#[derive(Debug, Default)]
struct Judged {
    refusal: Option<String>,
    trusted: Option<CertificateDer<'static>>,
}

impl Verifier {
    fn new(pin: Option<Fingerprint>, endpoint: &str) -> Result<Self, ProbeError> {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let roots = RootCertStore {
            roots: webpki_roots::TLS_SERVER_ROOTS.to_vec(),
        };
        let public =
            WebPkiServerVerifier::builder_with_provider(Arc::new(roots), Arc::clone(&provider))
                .build()
                .map_err(|error| ProbeError::Unreachable {
                    endpoint: endpoint.to_owned(),
                    reason: error.to_string(),
                })?;
        Ok(Self {
            pin,
            provider,
            public,
            judged: Mutex::default(),
        })
    }

    fn judged(&self) -> std::sync::MutexGuard<'_, Judged> {
        self.judged.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn refusal(&self) -> Option<String> {
        self.judged().refusal.clone()
    }

    fn trusted_pem(&self) -> Option<String> {
        let judged = self.judged();
        let trusted = judged.trusted.as_ref();
        trusted.map(|der| pem::encode(&pem::Pem::new("CERTIFICATE", der.to_vec())))
    }

    fn judge(
        &self,
        shown: &CertificateDer<'_>,
        behind: &[CertificateDer<'_>],
        host: &ServerName<'_>,
        now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        let Some(pin) = self.pin else {
            return self
                .public
                .verify_server_cert(shown, behind, host, &[], now);
        };
        let mut chain = behind.iter().chain([shown]);
        let pinned = chain
            .find(|certificate| Sha256::digest(certificate).as_slice() == pin.as_bytes())
            .ok_or_else(|| Error::General(ANOTHER.to_owned()))?;
        let mut roots = RootCertStore::empty();
        roots.add(pinned.clone().into_owned())?;
        let provider = Arc::clone(&self.provider);
        let verifier = WebPkiServerVerifier::builder_with_provider(Arc::new(roots), provider)
            .build()
            .map_err(|error| Error::General(error.to_string()))?;
        let verified = verifier.verify_server_cert(shown, behind, host, &[], now)?;
        self.judged().trusted = Some(pinned.clone().into_owned());
        Ok(verified)
    }
}

/// Said of a server that is not the one that was meant.
const ANOTHER: &str =
    "it is another server's than the fingerprint names, or somebody stands in between";

/// What is wrong with a certificate, for people.
fn in_words(error: &Error) -> String {
    let Error::InvalidCertificate(why) = error else {
        return match error {
            Error::General(words) => words.clone(),
            other => other.to_string(),
        };
    };
    match why {
        CertificateError::Expired | CertificateError::ExpiredContext { .. } => {
            "it has expired, or this machine's clock is wrong".to_owned()
        }
        CertificateError::NotValidYet | CertificateError::NotValidYetContext { .. } => {
            "it is not good yet, or this machine's clock is wrong".to_owned()
        }
        CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. } => {
            "it is not for this address: connect to a name or an address that the server knows to be its own".to_owned()
        }
        CertificateError::UnknownIssuer => {
            "nobody vouches for it whom this machine knows: give --fingerprint, or use an invite".to_owned()
        }
        other => other.to_string(),
    }
}

impl ServerCertVerifier for Verifier {
    fn verify_server_cert(
        &self,
        shown: &CertificateDer<'_>,
        behind: &[CertificateDer<'_>],
        host: &ServerName<'_>,
        _ocsp: &[u8],
        now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        let judged = self.judge(shown, behind, host, now);
        if let Err(error) = &judged {
            self.judged().refusal = Some(in_words(error));
        }
        judged
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls12_signature(message, certificate, signature, algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        let algorithms = &self.provider.signature_verification_algorithms;
        verify_tls13_signature(message, certificate, signature, algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        let algorithms = &self.provider.signature_verification_algorithms;
        algorithms.supported_schemes()
    }
}

pub(crate) fn base64(bytes: &[u8]) -> String {
    use base64::Engine as _;
    base64::engine::general_purpose::STANDARD.encode(bytes)
}
