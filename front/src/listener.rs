//! Connections: how many there may be, how long one may take to ask, and how much may wait in one.

use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Router;
use axum::http::{Method, Request, StatusCode, Uri, header};
use axum::response::{IntoResponse as _, Response};
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use socket2::SockRef;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::sync::watch;
use tokio::time::{sleep, timeout};
use tower::ServiceExt as _;

use crate::linger::{Lingering, Patience};
use crate::security::{self, Security};
use crate::stall::Impatient;
use crate::visitors::{Peer, Place, Visit, Visitors};

/// Bytes that the operating system may hold for a reader, about half a second of a watcher's budget. It would otherwise
/// grow to megabytes, and a slow watcher would see the clay of half a minute ago. Linux takes the double, for its own
/// bookkeeping.
const SEND_BUFFER: u32 = 128 * 1024;

/// Connections that may wait to be accepted.
const BACKLOG: u32 = 256;

/// A request's head comes within this, or the connection is closed. It is also how long an idle connection is kept.
const HEAD_TIMEOUT: Duration = Duration::from_secs(10);

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

/// What is served.
#[derive(Clone)]
pub struct Service {
    /// To every request its answer.
    pub router: Router,
    /// Whether a request is heard even where every place is taken.
    pub is_urgent: fn(&Method, &Uri) -> bool,
}

/// Nothing is urgent.
impl From<Router> for Service {
    fn from(router: Router) -> Self {
        Self {
            router,
            is_urgent: |_, _| false,
        }
    }
}

impl Service {
    async fn answer(self, request: Request<Incoming>, place: Place) -> Response {
        let is_heard = place == Place::Usual || (self.is_urgent)(request.method(), request.uri());
        if !is_heard {
            let close = [(header::CONNECTION, "close"), (header::RETRY_AFTER, "1")];
            let words = "every connection is taken\n";
            return (StatusCode::SERVICE_UNAVAILABLE, close, words).into_response();
        }
        match self.router.oneshot(request).await {
            Ok(answer) => answer,
            Err(never) => match never {},
        }
    }
}

/// What is served, and how.
#[derive(Clone)]
struct House {
    service: Service,
    security: Option<Security>,
    /// For whoever asks in the clear where that is not served.
    elsewhere: Router,
}

/// Serves until `stop` is done, then lets requests under way finish for a few seconds. Streams do not hold it up. With
/// `security` everything is encrypted, and whoever asks in the clear is sent on. Where every place is taken, what is
/// urgent is heard, and whoever asks for something else is told to come again.
pub async fn serve(
    listener: TcpListener,
    service: impl Into<Service>,
    security: Option<Security>,
    stop: impl Future<Output = ()>,
) {
    let visitors = Arc::new(Visitors::default());
    let service = service.into();
    let house = House {
        elsewhere: security::elsewhere(&service.router),
        service,
        security,
    };
    let (stopping, stopped) = watch::channel(());
    let mut stop = pin!(stop);
    loop {
        let (connection, address) = tokio::select! {
            next = accept(&listener) => next,
            () = &mut stop => break,
        };
        // One that finds no place is closed at once.
        if let Some(visit) = visitors.arrive(address.ip()) {
            let guest = Guest {
                address,
                visit: Arc::new(visit),
                stopped: stopped.clone(),
            };
            tokio::spawn(guest.arrive(connection, house.clone()));
        }
    }
    drop((listener, stopped));
    stopping.send_replace(());
    // Done once every connection has dropped its end.
    timeout(GRACE, stopping.closed()).await.ok();
}

async fn accept(listener: &TcpListener) -> (TcpStream, SocketAddr) {
    loop {
        match listener.accept().await {
            Ok(accepted) => return accepted,
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

/// One connection, whatever it speaks.
struct Guest {
    address: SocketAddr,
    visit: Arc<Visit>,
    stopped: watch::Receiver<()>,
}

type Held = Impatient<Lingering<TcpStream, Arc<Visit>>>;

impl Guest {
    async fn arrive(mut self, connection: TcpStream, house: House) {
        // What is written is meant to be sent: a message that waited for the last one's receipt would wait for tens of
        // milliseconds. A connection that is gone already says so when it is read.
        connection.set_nodelay(true).ok();
        // One whose other end has vanished without a word is given up as soon as one whose other end has stopped
        // reading.
        SockRef::from(&connection)
            .set_tcp_user_timeout(Some(STALL_TIMEOUT))
            .ok();
        let Some(security) = &house.security else {
            let (held, hangs_up) = self.hold(connection);
            return self.converse(held, house.service, hangs_up).await;
        };
        let begins = security::is_encrypted(&connection, HEAD_TIMEOUT);
        match self.unless_unwelcome(begins).await {
            Some(Ok(true)) => {}
            Some(Ok(false)) => {
                let (held, hangs_up) = self.hold(connection);
                return self.converse(held, house.elsewhere.into(), hangs_up).await;
            }
            Some(Err(_)) | None => return,
        }
        let (held, hangs_up) = self.hold(connection);
        let shaken = security.accept(held, HEAD_TIMEOUT);
        match self.unless_unwelcome(shaken).await {
            Some(Ok(stream)) => self.converse(stream, house.service, hangs_up).await,
            Some(Err(error)) => {
                tracing::debug!(%error, from = %self.address, "no handshake came about");
            }
            None => hangs_up.store(true, Ordering::Relaxed),
        }
    }

    fn hold(&self, connection: TcpStream) -> (Held, Arc<AtomicBool>) {
        let lingering = Lingering::new(connection, Arc::clone(&self.visit), Patience::USUAL);
        let hangs_up = lingering.hangs_up();
        (Impatient::new(lingering, STALL_TIMEOUT), hangs_up)
    }

    /// What comes of `what`, unless the place is needed for somebody else or the server stops.
    async fn unless_unwelcome<T>(&mut self, what: impl Future<Output = T>) -> Option<T> {
        tokio::select! {
            done = what => Some(done),
            _ = self.visit.must_leave() => None,
            _ = self.stopped.changed() => None,
        }
    }

    async fn converse<C>(mut self, connection: C, house: Service, hangs_up: Arc<AtomicBool>)
    where
        C: AsyncRead + AsyncWrite + Send + Unpin + 'static,
    {
        let (asked, address) = (Arc::clone(&self.visit), self.address);
        let service = service_fn(move |mut request: Request<Incoming>| {
            asked.asks();
            request.extensions_mut().insert(Peer(address.ip()));
            let (house, asked) = (house.clone(), Arc::clone(&asked));
            async move {
                let answer = house.answer(request, asked.place()).await;
                if answer.status() != StatusCode::SWITCHING_PROTOCOLS {
                    asked.is_answered();
                }
                Ok::<_, Infallible>(answer)
            }
        });
        let mut conversation = pin!(
            http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(HEAD_TIMEOUT)
                .max_buf_size(MAX_HEAD)
                .serve_connection(TokioIo::new(connection), service)
                .with_upgrades()
        );
        let ended = tokio::select! {
            ended = &mut conversation => ended,
            has_asked = self.visit.must_leave() => {
                if !has_asked {
                    // Nothing was said that could be lost.
                    hangs_up.store(true, Ordering::Relaxed);
                    return;
                }
                conversation.as_mut().graceful_shutdown();
                conversation.await
            }
            _ = self.stopped.changed() => {
                conversation.as_mut().graceful_shutdown();
                conversation.await
            }
        };
        if let Err(error) = ended {
            tracing::debug!(%error, "a connection broke");
        }
    }
}
