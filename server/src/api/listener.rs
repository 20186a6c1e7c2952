//! Connections: how many there may be, how long one may take to ask, and how much may wait in one.

use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::time::{sleep, timeout};

use super::linger::{Lingering, Patience};
use super::stall::Impatient;

/// Connections at once. More wait to be accepted; each watcher has one, and each page a handful besides.
const MAX_CONNECTIONS: usize = 512;

/// Bytes that the operating system may hold for a reader, about half a second of a watcher's budget. It would otherwise
/// grow to megabytes, and a slow watcher would see the clay of half a minute ago. Linux takes the double, for its own
/// bookkeeping.
const SEND_BUFFER: u32 = 128 * 1024;

/// Connections that may wait to be accepted.
const BACKLOG: u32 = 256;

/// A request's head comes within this, or the connection is closed. It is also how long an idle connection is kept.
const HEAD_TIMEOUT: Duration = Duration::from_secs(30);

/// Longest head of a request, bytes: RFC 9112 §3 recommends 8000 for its first line alone.
const MAX_HEAD: usize = 32 * 1024;

/// A connection to which nothing can be written for this long is broken off.
const STALL_TIMEOUT: Duration = Duration::from_secs(20);

/// After a stop, requests under way may take this long.
const GRACE: Duration = Duration::from_secs(3);

/// Between attempts to accept while the process has no file handles left.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Listens.
///
/// # Errors
/// The address is taken or not this machine's.
pub fn bind(listen: SocketAddr) -> io::Result<TcpListener> {
    let socket = match listen {
        SocketAddr::V4(_) => TcpSocket::new_v4()?,
        SocketAddr::V6(_) => TcpSocket::new_v6()?,
    };
    // A server that is started again at once must not wait for the connections of the last one to be forgotten.
    socket.set_reuseaddr(true)?;
    // Accepted connections inherit it.
    socket.set_send_buffer_size(SEND_BUFFER)?;
    socket.bind(listen)?;
    socket.listen(BACKLOG)
}

/// Serves until `stop` is done, then lets requests under way finish for a few seconds. Streams do not hold it up.
pub async fn serve(listener: TcpListener, router: Router, stop: impl Future<Output = ()>) {
    let places = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let (stopping, stopped) = watch::channel(());
    let mut stop = pin!(stop);
    loop {
        let next = accept(&listener, &places);
        let (connection, place) = tokio::select! {
            next = next => next,
            () = &mut stop => break,
        };
        tokio::spawn(converse(connection, router.clone(), stopped.clone(), place));
    }
    drop((listener, stopped));
    stopping.send_replace(());
    // Done once every connection has dropped its end.
    timeout(GRACE, stopping.closed()).await.ok();
}

async fn accept(
    listener: &TcpListener,
    places: &Arc<Semaphore>,
) -> (TcpStream, OwnedSemaphorePermit) {
    let place = Arc::clone(places)
        .acquire_owned()
        .await
        .expect("nobody closes it");
    loop {
        match listener.accept().await {
            Ok((connection, _)) => return (connection, place),
            // A connection that ended before it was accepted is nobody's loss.
            Err(error) if is_of_one_connection(&error) => {}
            Err(error) => {
                tracing::error!(%error, "no connection can be accepted");
                sleep(ACCEPT_PAUSE).await;
            }
        }
    }
}

fn is_of_one_connection(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::ConnectionAborted
            | io::ErrorKind::ConnectionRefused
            | io::ErrorKind::ConnectionReset
    )
}

async fn converse(
    connection: TcpStream,
    router: Router,
    mut stopped: watch::Receiver<()>,
    place: OwnedSemaphorePermit,
) {
    // What is written is meant to be sent: a message that waited for the last one's receipt would wait for tens of
    // milliseconds. A connection that is gone already says so when it is read.
    connection.set_nodelay(true).ok();
    let service = TowerToHyperService::new(router);
    let mut conversation = pin!(
        http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEAD_TIMEOUT)
            .max_buf_size(MAX_HEAD)
            .serve_connection(
                TokioIo::new(Impatient::new(
                    Lingering::new(connection, place, Patience::USUAL),
                    STALL_TIMEOUT
                )),
                service
            )
            .with_upgrades()
    );
    let ended = tokio::select! {
        ended = &mut conversation => ended,
        _ = stopped.changed() => {
            conversation.as_mut().graceful_shutdown();
            conversation.await
        }
    };
    if let Err(error) = ended {
        tracing::debug!(%error, "a connection broke");
    }
    drop(stopped);
}
