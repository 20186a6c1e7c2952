//! Connections that are closed so that the other end can read what was said last.
//!
//! A connection that is closed while something of the other end's is unread, or still on its way, is reset, and a reset
//! takes along what the other end has not read yet: the reason why it was closed. So a connection is closed in one
//! direction first; what still comes is thrown away, for a while and up to a limit.

use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, ReadBuf};
use tokio::runtime::Handle;
use tokio::time::timeout;

/// How long, and for how much, a connection lingers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patience {
    /// Whoever is still sending sends something within this.
    pause: Duration,
    /// Nobody is listened to for longer.
    longest: Duration,
    /// Most that is thrown away, bytes.
    most: usize,
}

impl Patience {
    /// A thousand times the longest message that is read; and as long as it takes to send a megabyte over a slow link,
    /// with pauses as long as the slowest round trip that a loop bears.
    pub(crate) const USUAL: Self = Self {
        pause: Duration::from_secs(2),
        longest: Duration::from_secs(10),
        most: 16 * 1024 * 1024,
    };
}

/// Thrown away at once, bytes.
const PART: usize = 16 * 1024;

/// A connection that lingers once nobody holds it any more. `K` is kept for as long, such as a place among the
/// connections.
pub(crate) struct Lingering<C, K>
where
    C: AsyncRead + AsyncWrite + Send + Unpin + 'static,
    K: Send + 'static,
{
    /// There until this is dropped.
    held: Option<(C, K)>,
    patience: Patience,
    hangs_up: Arc<AtomicBool>,
}

impl<C, K> Lingering<C, K>
where
    C: AsyncRead + AsyncWrite + Send + Unpin + 'static,
    K: Send + 'static,
{
    pub(crate) fn new(connection: C, kept: K, patience: Patience) -> Self {
        Self {
            held: Some((connection, kept)),
            patience,
            hangs_up: Arc::default(),
        }
    }

    /// Once this is set, the connection no longer lingers: it ends when it is dropped.
    pub(crate) fn hangs_up(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.hangs_up)
    }

    fn connection(&mut self) -> io::Result<Pin<&mut C>> {
        match &mut self.held {
            Some((connection, _)) => Ok(Pin::new(connection)),
            None => Err(io::ErrorKind::NotConnected.into()),
        }
    }
}

impl<C, K> Drop for Lingering<C, K>
where
    C: AsyncRead + AsyncWrite + Send + Unpin + 'static,
    K: Send + 'static,
{
    fn drop(&mut self) {
        if self.hangs_up.load(Ordering::Relaxed) {
            return;
        }
        // Without a runtime the process is about to end, and its connections with it.
        if let (Some((connection, kept)), Ok(runtime)) = (self.held.take(), Handle::try_current()) {
            let patience = self.patience;
            runtime.spawn(async move {
                // It has ended one way or the other.
                timeout(patience.longest, linger(connection, patience))
                    .await
                    .ok();
                drop(kept);
            });
        }
    }
}

async fn linger(mut connection: impl AsyncRead + AsyncWrite + Unpin, patience: Patience) {
    if connection.shutdown().await.is_err() {
        return;
    }
    let mut part = vec![0; PART];
    let mut left = patience.most;
    while 0 < left {
        match timeout(patience.pause, connection.read(&mut part)).await {
            Ok(Ok(read)) if 0 < read => left = left.saturating_sub(read),
            _ => return,
        }
    }
}

impl<C, K> AsyncRead for Lingering<C, K>
where
    C: AsyncRead + AsyncWrite + Send + Unpin + 'static,
    K: Send + Unpin + 'static,
{
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        self.get_mut().connection()?.poll_read(context, buffer)
    }
}

impl<C, K> AsyncWrite for Lingering<C, K>
where
    C: AsyncRead + AsyncWrite + Send + Unpin + 'static,
    K: Send + Unpin + 'static,
{
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.get_mut().connection()?.poll_write(context, bytes)
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        self.get_mut()
            .connection()?
            .poll_write_vectored(context, slices)
    }

    fn is_write_vectored(&self) -> bool {
        self.held
            .as_ref()
            .is_some_and(|(connection, _)| connection.is_write_vectored())
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.get_mut().connection()?.poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.get_mut().connection()?.poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::duplex;
    use tokio::time::Instant;

    use super::*;

    /// A pipe holds less than is sent: the other end could not finish if nobody read.
    const PIPE: usize = 1024;

    const PATIENCE: Patience = Patience {
        pause: Duration::from_millis(50),
        longest: Duration::from_millis(250),
        most: 64 * PART,
    };

    #[tokio::test]
    async fn who_still_sends_can_finish_and_reads_what_was_said_last() {
        let (ours, mut theirs) = duplex(PIPE);
        let mut ours = Lingering::new(ours, (), PATIENCE);
        ours.write_all(b"the reason").await.unwrap();
        drop(ours);
        theirs.write_all(&vec![7; 100 * PIPE]).await.unwrap();
        theirs.shutdown().await.unwrap();
        let mut said = Vec::new();
        theirs.read_to_end(&mut said).await.unwrap();
        assert_eq!(said, b"the reason");
    }

    #[tokio::test]
    async fn what_is_kept_is_kept_while_it_lingers_and_no_longer() {
        let place = Arc::new(());
        let (ours, mut theirs) = duplex(PIPE);
        drop(Lingering::new(ours, Arc::clone(&place), PATIENCE));
        assert_eq!(Arc::strong_count(&place), 2);
        // The other end says nothing and stays. It sees the end of what is said to it at once, and the end of all after
        // a pause.
        assert_eq!(theirs.read(&mut [0; 8]).await.unwrap(), 0);
        let began = Instant::now();
        while Arc::strong_count(&place) == 2 {
            tokio::task::yield_now().await;
            assert!(
                began.elapsed() < 100 * PATIENCE.longest,
                "it lingers for ever"
            );
        }
    }

    #[tokio::test]
    async fn who_never_ends_is_left() {
        // A trickle is left by the clock.
        let (ours, mut theirs) = duplex(PIPE);
        drop(Lingering::new(ours, (), PATIENCE));
        let began = Instant::now();
        while theirs.write_all(&[7]).await.is_ok() {
            assert!(
                began.elapsed() < 100 * PATIENCE.longest,
                "it listens for ever"
            );
            tokio::task::yield_now().await;
        }
        assert!(PATIENCE.longest <= began.elapsed());
        // A flood is left for its amount.
        let (ours, mut theirs) = duplex(PART);
        drop(Lingering::new(ours, (), PATIENCE));
        let mut sent = 0;
        while theirs.write_all(&[7; PART]).await.is_ok() {
            sent += PART;
            assert!(sent <= 2 * PATIENCE.most, "it listens to everything");
        }
        assert!(PATIENCE.most <= sent, "{sent}");
    }
}
