//! How many connections there may be, and how long a silent one is kept.
//!
//! A client that connects and says nothing, stops in the middle, or never reads its answers costs a
//! place and nothing else, and loses it after a while.

use std::collections::HashMap;
use std::future::Future;
use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll};
use std::time::Duration;

use axum_server::accept::Accept;
use axum_server::tls_rustls::RustlsAcceptor;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::time::{Instant, Sleep, sleep_until, timeout};

use crate::lab::lock;

/// How patient a listener is.
#[derive(Debug, Clone, Copy)]
pub struct Patience {
    /// For the encryption to be agreed on.
    pub handshake: Duration,
    /// For the first byte of the first request.
    pub first_byte: Duration,
    /// For the next byte later on; WebSockets are kept alive by pings.
    pub idle: Duration,
    /// For the client to take what was sent.
    pub write: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self {
            handshake: Duration::from_secs(10),
            first_byte: Duration::from_secs(10),
            idle: Duration::from_secs(60),
            write: Duration::from_secs(20),
        }
    }
}

/// So many connections any address may have while there are places.
const FEW: usize = 4;

/// The places for connections of one or more listeners. A quarter of them is for addresses that hold few, so that
/// no two or three can keep newcomers off.
#[derive(Debug)]
pub struct Places {
    all: usize,
    per_peer: usize,
    taken: Mutex<HashMap<IpAddr, usize>>,
}

impl Places {
    /// So many connections in all, and so many of one address.
    #[must_use]
    pub fn new(all: usize, per_peer: usize) -> Arc<Self> {
        Arc::new(Self {
            all,
            per_peer,
            taken: Mutex::default(),
        })
    }

    fn take(self: &Arc<Self>, peer: IpAddr) -> Option<Place> {
        let mut taken = lock(&self.taken);
        let all: usize = taken.values().sum();
        let own = taken.get(&peer).copied().unwrap_or(0);
        let room = match own {
            own if own < FEW || self.per_peer == self.all => self.all,
            _ => self.all - self.all / 4,
        };
        if all >= room || own >= self.per_peer {
            return None;
        }
        taken.insert(peer, own + 1);
        Some(Place {
            places: self.clone(),
            peer,
        })
    }
}

/// The place of one connection, given back when it is dropped.
#[derive(Debug)]
struct Place {
    places: Arc<Places>,
    peer: IpAddr,
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut taken = lock(&self.places.taken);
        match taken.get_mut(&self.peer) {
            Some(count) if *count > 1 => *count -= 1,
            _ => {
                taken.remove(&self.peer);
            }
        }
    }
}

/// Accepts connections while there are places, and watches those it has accepted.
#[derive(Debug, Clone)]
pub struct Gate {
    tls: Option<RustlsAcceptor>,
    places: Arc<Places>,
    patience: Patience,
}

impl Gate {
    /// With or without encryption.
    #[must_use]
    pub fn new(tls: Option<RustlsAcceptor>, places: Arc<Places>, patience: Patience) -> Self {
        Self {
            tls,
            places,
            patience,
        }
    }
}

/// Bytes both ways.
pub trait Stream: AsyncRead + AsyncWrite + Unpin + Send {}

impl<T: AsyncRead + AsyncWrite + Unpin + Send> Stream for T {}

impl<S: Send + 'static> Accept<TcpStream, S> for Gate {
    type Stream = Watched<Box<dyn Stream>>;
    type Service = S;
    type Future = Pin<Box<dyn Future<Output = io::Result<(Self::Stream, S)>> + Send>>;

    fn accept(&self, stream: TcpStream, service: S) -> Self::Future {
        let unknown = IpAddr::V4(Ipv4Addr::UNSPECIFIED);
        let peer = stream.peer_addr().map_or(unknown, |address| address.ip());
        let Some(place) = self.places.take(peer) else {
            let full = io::Error::new(io::ErrorKind::ConnectionRefused, "too many connections");
            return Box::pin(std::future::ready(Err(full)));
        };
        // Answers are short and wanted at once; without this option they are only later.
        let _ = stream.set_nodelay(true);
        let (tls, patience) = (self.tls.clone(), self.patience);
        Box::pin(async move {
            let (stream, service): (Box<dyn Stream>, S) = match tls {
                None => (Box::new(stream), service),
                Some(tls) => {
                    let agreed = timeout(patience.handshake, tls.accept(stream, service));
                    let (stream, service) = agreed.await.map_err(|_| late("the handshake"))??;
                    (Box::new(stream), service)
                }
            };
            Ok((Watched::new(stream, place, patience), service))
        })
    }
}

fn late(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::TimedOut, format!("{what} took too long"))
}

/// How HTTP/2 begins without having been agreed on. It is refused: there no head has to come in time, and WebSockets need
/// HTTP/1.
const HTTP_2: &[u8] = b"PRI";

/// A connection that ends with an error when its client is silent, does not read, or speaks HTTP/2.
#[derive(Debug)]
pub struct Watched<I> {
    inner: I,
    patience: Patience,
    /// Until when something must have been read or written.
    alive: Timer,
    /// Until when what waits must have been written.
    writing: Option<Timer>,
    /// How much of the beginning of HTTP/2 has come; `None` once it was something else.
    http_2: Option<usize>,
    _place: Place,
}

/// A point in time that can be moved; the clock is only told when it matters.
#[derive(Debug)]
struct Timer {
    until: Instant,
    sleep: Pin<Box<Sleep>>,
}

impl Timer {
    fn new(after: Duration) -> Self {
        let until = Instant::now() + after;
        Self {
            until,
            sleep: Box::pin(sleep_until(until)),
        }
    }

    fn is_over(&mut self, context: &mut Context<'_>) -> bool {
        while self.sleep.as_mut().poll(context).is_ready() {
            if Instant::now() >= self.until {
                return true;
            }
            self.sleep.as_mut().reset(self.until);
        }
        false
    }
}

impl<I> Watched<I> {
    fn new(inner: I, place: Place, patience: Patience) -> Self {
        Self {
            inner,
            patience,
            alive: Timer::new(patience.first_byte),
            writing: None,
            http_2: Some(0),
            _place: place,
        }
    }

    /// Whether what the client says, with these bytes, begins as HTTP/2 does.
    fn is_http_2(&mut self, bytes: &[u8]) -> bool {
        let Some(before) = self.http_2 else {
            return false;
        };
        let rest = &HTTP_2[before..];
        let length = rest.len().min(bytes.len());
        let is_same = bytes[..length] == rest[..length];
        self.http_2 = is_same.then_some(before + length);
        self.http_2 == Some(HTTP_2.len())
    }

    fn is_alive(&mut self) {
        self.alive.until = Instant::now() + self.patience.idle;
    }

    /// What became of something written, or that the client does not read.
    fn written<T>(
        &mut self,
        context: &mut Context<'_>,
        polled: Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        if polled.is_ready() {
            self.writing = None;
            self.is_alive();
            return polled;
        }
        let patience = self.patience.write;
        let writing = self.writing.get_or_insert_with(|| Timer::new(patience));
        if writing.is_over(context) {
            return Poll::Ready(Err(late("a client to read its answer")));
        }
        Poll::Pending
    }
}

impl<I: AsyncRead + Unpin> AsyncRead for Watched<I> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let this = &mut *self;
        let before = buffer.filled().len();
        let polled = Pin::new(&mut this.inner).poll_read(context, buffer);
        if polled.is_ready() {
            this.is_alive();
            if this.is_http_2(&buffer.filled()[before..]) {
                let refused = "HTTP/2 is not spoken here";
                return Poll::Ready(Err(io::Error::new(io::ErrorKind::InvalidData, refused)));
            }
        } else if this.alive.is_over(context) {
            return Poll::Ready(Err(late("a client to say something")));
        }
        polled
    }
}

impl<I: AsyncWrite + Unpin> AsyncWrite for Watched<I> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let polled = Pin::new(&mut self.inner).poll_write(context, bytes);
        self.written(context, polled)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let polled = Pin::new(&mut self.inner).poll_write_vectored(context, parts);
        self.written(context, polled)
    }

    fn is_write_vectored(&self) -> bool {
        self.inner.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let polled = Pin::new(&mut self.inner).poll_flush(context);
        if polled.is_ready() {
            // A flush with nothing to do is no sign of life.
            self.writing = None;
            return polled;
        }
        self.written(context, polled)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let polled = Pin::new(&mut self.inner).poll_shutdown(context);
        self.written(context, polled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    fn patience(millis: u64) -> Patience {
        let all = Duration::from_millis(millis);
        Patience {
            handshake: all,
            first_byte: all,
            idle: all,
            write: all,
        }
    }

    fn watched<I>(inner: I, millis: u64) -> Watched<I> {
        let place = Places::new(1, 1).take(IpAddr::from([10, 0, 0, 1]));
        Watched::new(inner, place.unwrap(), patience(millis))
    }

    #[test]
    fn places_are_counted_in_all_and_per_address_and_given_back() {
        let places = Places::new(3, 2);
        let [a, b] = [[10, 0, 0, 1], [10, 0, 0, 2]].map(IpAddr::from);
        let mut held = vec![places.take(a).unwrap(), places.take(a).unwrap()];
        assert!(places.take(a).is_none());
        held.push(places.take(b).unwrap());
        assert!(places.take(b).is_none());
        held.clear();
        assert!(places.take(a).is_some() && lock(&places.taken).is_empty());
    }

    #[test]
    fn two_addresses_do_not_keep_newcomers_off() {
        let places = Places::new(512, 256);
        let mut held = Vec::new();
        for last in [1, 2] {
            let address = IpAddr::from([10, 0, 0, last]);
            held.extend(std::iter::from_fn(|| places.take(address)));
        }
        assert_eq!(held.len(), 384);
        for last in 3..35 {
            let address = IpAddr::from([10, 0, 0, last]);
            let own: Vec<_> = std::iter::from_fn(|| places.take(address)).collect();
            assert_eq!(own.len(), FEW, "{address}");
            held.extend(own);
        }
        // A class behind one address has half of all.
        held.clear();
        let class = IpAddr::from([10, 0, 0, 1]);
        held.extend(std::iter::from_fn(|| places.take(class)));
        assert_eq!(held.len(), 256);
    }

    #[tokio::test]
    async fn a_silent_client_is_given_up_and_one_that_speaks_is_not() {
        let (mut client, server) = tokio::io::duplex(64);
        let mut server = watched(server, 200);
        let mut byte = [0];
        for _ in 0..4 {
            tokio::time::sleep(Duration::from_millis(80)).await;
            client.write_all(b"x").await.unwrap();
            server.read_exact(&mut byte).await.unwrap();
        }
        let error = server.read_exact(&mut byte).await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }

    #[tokio::test]
    async fn http_2_is_refused_in_whatever_pieces_it_comes_and_other_requests_are_not() {
        for (pieces, refused) in [
            (&[&b"PRI * HTTP/2.0\r\n"[..]][..], true),
            (&[b"P", b"R", b"I"], true),
            (&[b"POST / HTTP/1.1\r\n"], false),
            (&[b"P", b"PRI"], false),
            (&[b"GET /PRI", b"PRI"], false),
        ] {
            let (mut client, server) = tokio::io::duplex(64);
            let mut server = watched(server, 1000);
            let mut result = Ok(0);
            for piece in pieces {
                client.write_all(piece).await.unwrap();
                result = server.read(&mut [0; 32]).await;
            }
            assert_eq!(result.is_err(), refused, "{pieces:?}");
        }
    }

    #[tokio::test]
    async fn a_client_that_does_not_read_is_given_up() {
        let (client, server) = tokio::io::duplex(64);
        let mut server = watched(server, 100);
        let error = server.write_all(&[0; 1000]).await.unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
        drop(client);
    }
}
