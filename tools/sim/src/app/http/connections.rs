//! Limits the number of connections to the HTTP server, and the time for which a connection can be of no use.

use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep, timeout};

/// Most connections that are served at the same time.
pub const MOST: usize = 64;
/// Most connections that are being refused at the same time. Further connections are closed without a reply.
const MOST_REFUSED: usize = 64;
/// A connection over which the server could send nothing for this long is closed: its client sends no request, does not
/// send it to its end, or does not read the reply. The server sends something on a stream of events every 15 s.
pub const PATIENCE: Duration = Duration::from_secs(60);
/// Time in which a refused client must read the reply.
const FAREWELL: Duration = Duration::from_secs(2);

/// A listener with a limited number of connections.
pub struct Bounded {
    listener: TcpListener,
    free: Arc<Semaphore>,
    free_to_refuse: Arc<Semaphore>,
    patience: Duration,
}

impl Bounded {
    /// Limits the connections of `listener`. A connection over which nothing can be sent for `patience` is closed.
    pub fn new(listener: TcpListener, patience: Duration) -> Self {
        Self {
            listener,
            free: Arc::new(Semaphore::new(MOST)),
            free_to_refuse: Arc::new(Semaphore::new(MOST_REFUSED)),
            patience,
        }
    }
}

impl Listener for Bounded {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        loop {
            let (stream, address) = Listener::accept(&mut self.listener).await;
            if let Ok(permit) = Arc::clone(&self.free).try_acquire_owned() {
                return (
                    Connection {
                        stream,
                        patience: self.patience,
                        end: Box::pin(sleep(self.patience)),
                        _permit: permit,
                    },
                    address,
                );
            }
            if let Ok(permit) = Arc::clone(&self.free_to_refuse).try_acquire_owned() {
                tokio::spawn(async move {
                    let _ = timeout(FAREWELL, refuse(stream)).await;
                    drop(permit);
                });
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

async fn refuse(mut stream: TcpStream) -> io::Result<()> {
    let body = format!("{{\"error\":\"too many connections: {MOST} are open\"}}");
    let head = format!(
        "HTTP/1.1 503 Service Unavailable\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
        body.len()
    );
    stream.write_all((head + &body).as_bytes()).await?;
    stream.shutdown().await?;
    // Read the request to its end. Closing the connection earlier would reset it, and the client might lose the reply.
    let mut dropped = [0; 512];
    while stream.read(&mut dropped).await? > 0 {}
    Ok(())
}

/// A connection. Dropping it makes room for another one.
pub struct Connection {
    stream: TcpStream,
    patience: Duration,
    /// Ends when nothing could be sent for `patience`.
    end: Pin<Box<Sleep>>,
    _permit: OwnedSemaphorePermit,
}

impl Connection {
    /// Returns what `polled` is, or an error if it is pending and the time of this connection is over.
    fn or_end<T>(
        &mut self,
        polled: Poll<io::Result<T>>,
        context: &mut Context<'_>,
    ) -> Poll<io::Result<T>> {
        match polled {
            Poll::Pending => {
                let over = self.end.as_mut().poll(context);
                over.map(|()| Err(io::ErrorKind::TimedOut.into()))
            }
            ready => ready,
        }
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let polled = Pin::new(&mut self.stream).poll_read(context, buffer);
        self.or_end(polled, context)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let polled = Pin::new(&mut self.stream).poll_write(context, bytes);
        if let Poll::Ready(Ok(1..)) = polled {
            let end = Instant::now() + self.patience;
            self.end.as_mut().reset(end);
        }
        self.or_end(polled, context)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
