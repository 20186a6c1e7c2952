//! Encrypted connections: who is spoken to, what is shown, what can be exchanged, and who is kept out by nobody.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::routing::get;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, RootCertStore};
use teleclay_doors::{Authority, Identity};
use teleclay_front::{Security, bind, check_health, serve};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;

const ASK: &[u8] = b"GET /word HTTP/1.1\r\nHost: lab.example:1\r\nConnection: close\r\n\r\n";

fn identity(name: &str) -> Identity {
    let folder = std::env::temp_dir().join(format!("teleclay-front-{name}-{}", std::process::id()));
    let names = ["127.0.0.1".to_owned()];
    let issued = Authority::open(&folder).and_then(|authority| authority.issue(&names));
    std::fs::remove_dir_all(folder).unwrap();
    issued.unwrap()
}

fn house(security: Security) -> SocketAddr {
    let listener = bind(SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 0)).unwrap();
    let address = listener.local_addr().unwrap();
    let router = Router::new().route("/word", get(async || "a secret"));
    tokio::spawn(serve(
        listener,
        router,
        Some(security),
        std::future::pending(),
    ));
    address
}

fn connector(trusted: &Identity) -> TlsConnector {
    let mut roots = RootCertStore::empty();
    let chain = CertificateDer::pem_slice_iter(trusted.chain_pem.as_bytes());
    roots.add(chain.last().unwrap().unwrap()).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    TlsConnector::from(Arc::new(config))
}

async fn ask(address: SocketAddr, trusted: &Identity) -> std::io::Result<String> {
    let stream = TcpStream::connect(address).await?;
    let host = ServerName::from(address.ip());
    let mut stream = connector(trusted).connect(host, stream).await?;
    stream.write_all(ASK).await?;
    let mut said = String::new();
    stream.read_to_string(&mut said).await?;
    Ok(said)
}

async fn ask_in_the_clear(address: SocketAddr, question: &[u8]) -> String {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(question).await.unwrap();
    let mut said = String::new();
    stream.read_to_string(&mut said).await.unwrap();
    said
}

#[tokio::test]
async fn what_is_served_is_served_encrypted_and_to_nobody_else() {
    let identity = identity("served");
    let security = Security::new(&identity.chain_pem, &identity.key_pem).unwrap();
    let address = house(security);
    let said = ask(address, &identity).await.unwrap();
    assert!(
        said.starts_with("HTTP/1.1 200") && said.ends_with("a secret"),
        "{said}"
    );
    // Whoever asks in the clear is sent to the same place, encrypted, and told nothing else.
    let said = ask_in_the_clear(address, ASK).await;
    assert!(said.starts_with("HTTP/1.1 308"), "{said}");
    assert!(
        said.contains("location: https://lab.example:1/word\r\n"),
        "{said}"
    );
    assert!(!said.contains("a secret"));
    let said = ask_in_the_clear(address, b"GET /word HTTP/1.0\r\n\r\n").await;
    assert!(said.starts_with("HTTP/1."), "{said}");
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_looks_after_a_server_is_answered_in_the_clear_whatever_else_is_not() {
    let identity = identity("health");
    let security = Security::new(&identity.chain_pem, &identity.key_pem).unwrap();
    for security in [Some(security), None] {
        let listener = bind(SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 0)).unwrap();
        let address = listener.local_addr().unwrap();
        for (path, is_well) in [("/healthz", true), ("/elsewhere", false)] {
            let router = Router::new().route(path, get(async || "well"));
            let listener = bind(SocketAddr::new(address.ip(), 0)).unwrap();
            let address = listener.local_addr().unwrap();
            tokio::spawn(serve(
                listener,
                router,
                security.clone(),
                std::future::pending(),
            ));
            let asked = tokio::task::spawn_blocking(move || check_health(address));
            assert_eq!(asked.await.unwrap().is_ok(), is_well);
        }
        drop(listener);
        // Nobody is there.
        let asked = tokio::task::spawn_blocking(move || check_health(address));
        assert!(asked.await.unwrap().is_err());
    }
}

#[tokio::test]
async fn the_certificate_is_exchanged_while_it_serves() {
    let (before, after) = (identity("before"), identity("after"));
    let security = Security::new(&before.chain_pem, &before.key_pem).unwrap();
    let address = house(security.clone());
    assert!(ask(address, &before).await.is_ok());
    // A pair that is none changes nothing.
    assert!(security.replace(&after.chain_pem, &before.key_pem).is_err());
    assert!(security.replace("", &before.key_pem).is_err());
    assert!(ask(address, &before).await.is_ok() && ask(address, &after).await.is_err());
    security.replace(&after.chain_pem, &after.key_pem).unwrap();
    assert!(ask(address, &after).await.is_ok() && ask(address, &before).await.is_err());
}

/// Connections that begin a handshake and leave it at that are connections that ask for nothing.
#[tokio::test]
async fn handshakes_that_are_left_half_way_keep_nobody_out() {
    let identity = identity("half");
    let security = Security::new(&identity.chain_pem, &identity.key_pem).unwrap();
    let address = house(security);
    let mut held = Vec::new();
    for number in 0..600 {
        let Ok(mut stream) = TcpStream::connect(address).await else {
            continue;
        };
        // Some say nothing, some begin a record with a handshake, some say what is none.
        let begun: &[u8] = match number % 3 {
            0 => b"",
            1 => &[22, 3, 1, 1, 0],
            _ => &[22, 0xff, 0xff, 0xff, 0xff, 0xff],
        };
        let _ = stream.write_all(begun).await;
        held.push(stream);
    }
    let asked = timeout(Duration::from_secs(20), ask(address, &identity)).await;
    assert!(asked.unwrap().is_ok());
    drop(held);
}
