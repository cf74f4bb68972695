//! A connection that ends: one whose peer takes nothing of an answer is given up, and one that is closed while its peer still sends lets the answer
//! arrive first.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep, sleep};

/// How long a peer is waited for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    /// Time in which it must take at least a byte of what is sent.
    pub(super) stalled: Duration,
    /// Time for which what it sends is taken after the last answer.
    pub(super) lingering: Duration,
    /// Time after which a peer that sends nothing more has sent all, after the last answer.
    pub(super) silent: Duration,
}

/// A stream of bytes in both directions whose peer may be slow, but not for ever.
#[derive(Debug)]
pub(super) struct Connection<S> {
    stream: S,
    patience: Patience,
    /// Runs while the peer takes nothing.
    stalled: Option<Pin<Box<Sleep>>>,
    /// Runs once nothing more is sent.
    lingering: Option<Lingering>,
}

#[derive(Debug)]
struct Lingering {
    until: Pin<Box<Sleep>>,
    silence: Pin<Box<Sleep>>,
}

impl<S> Connection<S> {
    pub(super) fn new(stream: S, patience: Patience) -> Self {
        Self { stream, patience, stalled: None, lingering: None }
    }

    /// Passes on what writing came to, unless it has come to nothing for too long.
    fn unless_stalled(&mut self, written: Poll<io::Result<usize>>, context: &mut Context<'_>) -> Poll<io::Result<usize>> {
        if written.is_ready() {
            self.stalled = None;
            return written;
        }
        let patience = self.patience.stalled;
        ready!(self.stalled.get_or_insert_with(|| Box::pin(sleep(patience))).as_mut().poll(context));
        let text = format!("nothing of the answer was taken for {} s", patience.as_secs());
        Poll::Ready(Err(io::Error::new(io::ErrorKind::TimedOut, text)))
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Connection<S> {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, buffer: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl<S: AsyncRead + AsyncWrite + Unpin> AsyncWrite for Connection<S> {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.unless_stalled(written, context)
    }

    fn poll_write_vectored(mut self: Pin<&mut Self>, context: &mut Context<'_>, pieces: &[io::IoSlice<'_>]) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(context, pieces);
        self.unless_stalled(written, context)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    /// Says that nothing more comes, then takes what the peer still sends until it ends, too: closing a socket with unread bytes resets it, and a
    /// reset takes the answer away from a peer that looks at it only after sending (RFC 9112, 9.6).
    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let connection = &mut *self;
        if connection.lingering.is_none() {
            ready!(Pin::new(&mut connection.stream).poll_shutdown(context))?;
        }
        let Patience { lingering, silent, .. } = connection.patience;
        let lingering =
            connection.lingering.get_or_insert_with(|| Lingering { until: Box::pin(sleep(lingering)), silence: Box::pin(sleep(silent)) });
        let mut unread = [0; 8192];
        // The time limit goes first: who sends without end is left.
        while lingering.until.as_mut().poll(context).is_pending() {
            let mut buffer = ReadBuf::new(&mut unread);
            match Pin::new(&mut connection.stream).poll_read(context, &mut buffer) {
                Poll::Ready(Ok(())) if !buffer.filled().is_empty() => lingering.silence.as_mut().reset(Instant::now() + silent),
                // The peer has ended, or is gone: all the same by now.
                Poll::Ready(_) => break,
                Poll::Pending => {
                    ready!(lingering.silence.as_mut().poll(context));
                    break;
                }
            }
        }
        Poll::Ready(Ok(()))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use tokio::io::{AsyncReadExt, AsyncWriteExt, duplex};

    use super::*;

    const LONG: Duration = Duration::from_secs(600);
    const SHORT: Duration = Duration::from_millis(200);

    #[tokio::test]
    async fn who_takes_nothing_is_given_up_and_who_takes_little_is_not() {
        let (ours, mut theirs) = duplex(16);
        let mut connection = Connection::new(ours, Patience { stalled: 2 * SHORT, lingering: LONG, silent: LONG });
        let start = Instant::now();
        // A byte at a time, more slowly than once in the time for all: slow, and heard.
        let reader = tokio::spawn(async move {
            for _ in 0..5 {
                tokio::time::sleep(SHORT).await;
                theirs.read_u8().await.unwrap();
            }
            theirs
        });
        let error = connection.write_all(&[7; 1000]).await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
        assert!(start.elapsed() >= 5 * SHORT + 2 * SHORT);
        drop(reader.await.unwrap());
    }

    #[tokio::test]
    async fn the_answer_arrives_at_who_sends_first_and_looks_later() {
        let (ours, mut theirs) = duplex(16);
        let mut connection = Connection::new(ours, Patience { stalled: LONG, lingering: LONG, silent: LONG });
        let peer = tokio::spawn(async move {
            theirs.write_all(&[1; 1000]).await.unwrap();
            let mut answer = [0; 2];
            theirs.read_exact(&mut answer).await.unwrap();
            answer
        });
        connection.write_all(b"no").await.unwrap();
        // Ends by itself: the peer is gone once it has the answer.
        connection.shutdown().await.unwrap();
        assert_eq!(peer.await.unwrap(), *b"no");
    }

    #[tokio::test]
    async fn nobody_is_waited_for_without_end() {
        let (ours, _silent) = duplex(16);
        let start = Instant::now();
        Connection::new(ours, Patience { stalled: LONG, lingering: LONG, silent: SHORT }).shutdown().await.unwrap();
        assert!(start.elapsed() >= SHORT);

        let (ours, mut theirs) = duplex(16);
        let talker = tokio::spawn(async move { while theirs.write_all(b"more").await.is_ok() {} });
        let start = Instant::now();
        let mut connection = Connection::new(ours, Patience { stalled: LONG, lingering: SHORT, silent: LONG });
        connection.shutdown().await.unwrap();
        assert!(start.elapsed() >= SHORT);
        drop(connection);
        talker.await.unwrap();
    }
}
