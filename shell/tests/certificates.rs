//! A server's certificate is looked at before anything is said to it, and what is wrong is said at once, over TLS and
//! QUIC alike.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use rcgen::{CertificateParams, Issuer, KeyPair};
use rustls::ServerConfig;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use teleclay_doors::authority::fingerprint;
use teleclay_doors::{Authority, Identity};
use teleclay_proto::invite::Fingerprint;
use teleclay_shell::certificate::{ProbeError, trusted};
use teleclay_shell::endpoint::Endpoint;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};

const LOOPBACK: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

/// A server that does nothing but shake hands, and tells what came of each.
struct Server {
    endpoint: Endpoint,
    outcomes: UnboundedReceiver<Result<(), String>>,
}

fn config(identity: &Identity) -> ServerConfig {
    let chain = CertificateDer::pem_slice_iter(identity.chain_pem.as_bytes());
    let chain = chain.map(Result::unwrap).collect();
    let key = PrivateKeyDer::from_pem_slice(identity.key_pem.as_bytes()).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(chain, key)
        .unwrap()
}

async fn over_tls(identity: &Identity) -> Server {
    let listener = tokio::net::TcpListener::bind(LOOPBACK).await.unwrap();
    let port = listener.local_addr().unwrap().port();
    let acceptor = tokio_rustls::TlsAcceptor::from(Arc::new(config(identity)));
    let (tell, outcomes) = unbounded_channel();
    tokio::spawn(async move {
        while let Ok((stream, _)) = listener.accept().await {
            let shaken = match acceptor.accept(stream).await {
                // What the other end thinks of the certificate is heard once something is read.
                Ok(mut stream) => tokio::io::AsyncReadExt::read(&mut stream, &mut [0])
                    .await
                    .map(drop),
                Err(error) => Err(error),
            };
            let _ = tell.send(shaken.map_err(|error| error.to_string()));
        }
    });
    Server {
        endpoint: format!("tls/127.0.0.1:{port}").parse().unwrap(),
        outcomes,
    }
}

async fn over_quic(identity: &Identity) -> Server {
    let mut config = config(identity);
    config.alpn_protocols = vec![b"zenoh-mr".to_vec()];
    let config = quinn::crypto::rustls::QuicServerConfig::try_from(config).unwrap();
    let config = quinn::ServerConfig::with_crypto(Arc::new(config));
    let socket = quinn::Endpoint::server(config, LOOPBACK).unwrap();
    let port = socket.local_addr().unwrap().port();
    let (tell, outcomes) = unbounded_channel();
    tokio::spawn(async move {
        while let Some(incoming) = socket.accept().await {
            let shaken = incoming.await;
            let _ = tell.send(shaken.map(drop).map_err(|error| error.to_string()));
        }
    });
    Server {
        endpoint: format!("quic/127.0.0.1:{port}").parse().unwrap(),
        outcomes,
    }
}

fn authority(name: &str) -> (PathBuf, Authority) {
    let name = format!("teleclay-certificates-{name}-{}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    let authority = Authority::open(&folder).unwrap();
    (folder, authority)
}

fn here() -> Vec<String> {
    vec!["127.0.0.1".to_owned()]
}

/// A certificate of an authority of its own, with dates of its own.
fn dated(from_days: i64, to_days: i64) -> Identity {
    let since = std::time::UNIX_EPOCH.elapsed().unwrap();
    let now = time::OffsetDateTime::UNIX_EPOCH + since;
    let (authority_key, key) = (KeyPair::generate().unwrap(), KeyPair::generate().unwrap());
    let mut of_authority = CertificateParams::default();
    of_authority.is_ca = rcgen::IsCa::Ca(rcgen::BasicConstraints::Unconstrained);
    let root = of_authority.self_signed(&authority_key).unwrap();
    let mut params = CertificateParams::new(here()).unwrap();
    params.not_before = now + time::Duration::days(from_days);
    params.not_after = now + time::Duration::days(to_days);
    let issuer = Issuer::new(of_authority, authority_key);
    let certificate = params.signed_by(&key, &issuer).unwrap();
    Identity {
        chain_pem: certificate.pem() + &root.pem(),
        key_pem: key.serialize_pem(),
        fingerprint: fingerprint(root.der()),
    }
}

async fn both(identity: &Identity) -> [Server; 2] {
    [over_tls(identity).await, over_quic(identity).await]
}

async fn refusal(identity: &Identity, pin: Option<Fingerprint>) -> Vec<String> {
    let mut said = Vec::new();
    for mut server in both(identity).await {
        match trusted(&server.endpoint, pin).await {
            Err(ProbeError::Unacceptable { endpoint, reason }) => {
                assert_eq!(endpoint, server.endpoint.to_string());
                said.push(reason);
            }
            other => panic!("{other:?}"),
        }
        // The other end hears of it as well.
        let outcome = server.outcomes.recv().await.unwrap();
        assert!(outcome.is_err(), "{}: {outcome:?}", server.endpoint);
    }
    said
}

#[tokio::test]
async fn a_server_whose_authority_has_the_fingerprint_is_known_and_its_authority_told() {
    let (folder, authority) = authority("known");
    let identity = authority.issue(&here()).unwrap();
    for server in both(&identity).await {
        let told = trusted(&server.endpoint, Some(identity.fingerprint)).await;
        let told = told.unwrap().unwrap();
        let der = |pem: &str| CertificateDer::from_pem_slice(pem.as_bytes()).unwrap();
        assert_eq!(der(&told), der(authority.pem()));
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[tokio::test]
async fn a_foreign_server_is_named_as_one_whatever_it_is_called() {
    let ((folder, authority), (other_folder, other)) = (authority("one"), authority("other"));
    let pin = authority.issue(&here()).unwrap().fingerprint;
    for said in refusal(&other.issue(&here()).unwrap(), Some(pin)).await {
        assert!(said.contains("another server's"), "{said}");
    }
    for folder in [folder, other_folder] {
        std::fs::remove_dir_all(folder).unwrap();
    }
}

#[tokio::test]
async fn a_foreign_server_that_shows_the_right_authority_behind_its_own_certificate_is_refused() {
    let (folder, authority) = authority("borrowed");
    let genuine = authority.issue(&here()).unwrap();
    // Anybody can show somebody else's certificate; what it has signed is another matter.
    let mut thief = dated(-1, 1);
    let end = "-----END CERTIFICATE-----\n";
    let own = thief.chain_pem.find(end).unwrap() + end.len();
    thief.chain_pem = thief.chain_pem[..own].to_owned() + authority.pem();
    for said in refusal(&thief, Some(genuine.fingerprint)).await {
        assert!(said.contains("nobody vouches"), "{said}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[tokio::test]
async fn dates_and_names_are_looked_at() {
    let (folder, authority) = authority("names");
    let elsewhere = authority.issue(&["192.0.2.7".to_owned()]).unwrap();
    for (identity, words) in [
        (dated(-20, -10), "expired"),
        (dated(10, 20), "not good yet"),
        (elsewhere, "not for this address"),
    ] {
        for said in refusal(&identity, Some(identity.fingerprint)).await {
            assert!(said.contains(words), "{said}");
        }
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[tokio::test]
async fn without_a_fingerprint_a_private_authority_is_not_known() {
    let (folder, authority) = authority("unknown");
    for said in refusal(&authority.issue(&here()).unwrap(), None).await {
        assert!(said.contains("--fingerprint"), "{said}");
    }
    std::fs::remove_dir_all(folder).unwrap();
}

#[tokio::test]
async fn who_is_not_there_may_come_and_who_speaks_in_the_clear_needs_no_certificate() {
    let (folder, authority) = authority("absent");
    let pin = authority.issue(&here()).unwrap().fingerprint;
    let taken = std::net::TcpListener::bind(LOOPBACK).unwrap();
    let port = taken.local_addr().unwrap().port();
    drop(taken);
    let endpoint = format!("tls/127.0.0.1:{port}").parse().unwrap();
    let said = trusted(&endpoint, Some(pin)).await.unwrap_err();
    assert!(matches!(said, ProbeError::Unreachable { .. }), "{said}");
    // Somebody who speaks no TLS is nobody, either.
    let listener = tokio::net::TcpListener::bind(LOOPBACK).await.unwrap();
    let port = listener.local_addr().unwrap().port();
    tokio::spawn(async move {
        while let Ok((mut stream, _)) = listener.accept().await {
            let _ = tokio::io::AsyncWriteExt::write_all(&mut stream, b"hello\r\n").await;
        }
    });
    let endpoint = format!("tls/127.0.0.1:{port}").parse().unwrap();
    let met = tokio::time::timeout(Duration::from_secs(20), trusted(&endpoint, Some(pin)));
    let said = met.await.unwrap().unwrap_err();
    assert!(matches!(said, ProbeError::Unreachable { .. }), "{said}");
    let clear = "tcp/127.0.0.1:1".parse().unwrap();
    assert_eq!(trusted(&clear, Some(pin)).await, Ok(None));
    std::fs::remove_dir_all(folder).unwrap();
}
