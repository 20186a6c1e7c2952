//! Connections that are encrypted: the certificate that is shown, which can be exchanged while others talk, and what
//! is said to whoever asks in the clear.

use std::io;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use axum::Router;
use axum::extract::{OriginalUri, Request};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::any;
use rustls::ServerConfig;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use tower::ServiceExt as _;

/// What the first byte of an encrypted connection is: a record with a handshake in it, RFC 8446 §5.1.
const HANDSHAKE: u8 = 22;

/// Why a certificate cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum SecurityError {
    /// The certificate, or one that vouches for it.
    #[error("the certificate: {0}")]
    Certificate(String),
    /// The private key.
    #[error("the private key: {0}")]
    Key(String),
    /// Both are there, and do not belong together.
    #[error("certificate and private key: {0}")]
    Pair(#[from] rustls::Error),
}

/// What a listener shows of itself. Copies are the same.
#[derive(Clone)]
pub struct Security(Arc<RwLock<TlsAcceptor>>);

impl Security {
    /// Shows the first certificate of `chain_pem`, and those after it as what vouches for it.
    ///
    /// # Errors
    /// A text holds none, or the key is another certificate's.
    pub fn new(chain_pem: &str, key_pem: &str) -> Result<Self, SecurityError> {
        Ok(Self(Arc::new(RwLock::new(acceptor(chain_pem, key_pem)?))))
    }

    /// Shows another certificate to whoever comes from now on.
    ///
    /// # Errors
    /// A text holds none, or the key is another certificate's: then nothing has changed.
    pub fn replace(&self, chain_pem: &str, key_pem: &str) -> Result<(), SecurityError> {
        let next = acceptor(chain_pem, key_pem)?;
        *self.0.write().unwrap_or_else(PoisonError::into_inner) = next;
        Ok(())
    }

    pub(crate) async fn accept<C>(
        &self,
        connection: C,
        within: Duration,
    ) -> io::Result<TlsStream<C>>
    where
        C: AsyncRead + AsyncWrite + Unpin,
    {
        let acceptor = self
            .0
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        timeout(within, acceptor.accept(connection))
            .await
            .map_err(|_| io::Error::from(io::ErrorKind::TimedOut))?
    }
}

impl std::fmt::Debug for Security {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Security")
    }
}

fn acceptor(chain_pem: &str, key_pem: &str) -> Result<TlsAcceptor, SecurityError> {
    let chain: Vec<CertificateDer<'static>> = CertificateDer::pem_slice_iter(chain_pem.as_bytes())
        .collect::<Result<_, _>>()
        .map_err(|error| SecurityError::Certificate(error.to_string()))?;
    if chain.is_empty() {
        return Err(SecurityError::Certificate("there is none".to_owned()));
    }
    let key = PrivateKeyDer::from_pem_slice(key_pem.as_bytes())
        .map_err(|error| SecurityError::Key(error.to_string()))?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()?
        .with_no_client_auth()
        .with_single_cert(chain, key)?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(TlsAcceptor::from(Arc::new(config)))
}

/// Whether a connection begins as an encrypted one does.
pub(crate) async fn is_encrypted(connection: &TcpStream, within: Duration) -> io::Result<bool> {
    let mut first = [0];
    let peeked = timeout(within, connection.peek(&mut first)).await;
    match peeked.map_err(|_| io::Error::from(io::ErrorKind::TimedOut))?? {
        0 => Err(io::ErrorKind::UnexpectedEof.into()),
        _ => Ok(first == [HANDSHAKE]),
    }
}

/// What is answered in the clear: whether the server is well, which is for everybody. Whoever asks for anything else is
/// sent to the same place, encrypted.
pub(crate) fn elsewhere(house: &Router) -> Router {
    let house = house.clone();
    let health = any(move |request: Request| house.clone().oneshot(request));
    Router::new().route("/healthz", health).fallback(redirect)
}

async fn redirect(OriginalUri(asked): OriginalUri, headers: HeaderMap) -> Response {
    let host = headers
        .get(header::HOST)
        .and_then(|host| Authority::try_from(host.as_bytes()).ok())
        .filter(|host| !host.as_str().contains('@'));
    let Some(host) = host else {
        return (StatusCode::BAD_REQUEST, "this port speaks HTTPS\n").into_response();
    };
    let rest = asked.path_and_query().map_or("/", |rest| rest.as_str());
    let location = format!("https://{host}{rest}");
    (
        StatusCode::PERMANENT_REDIRECT,
        [
            (header::LOCATION, location),
            (header::CONNECTION, "close".to_owned()),
        ],
        "this port speaks HTTPS\n",
    )
        .into_response()
}
