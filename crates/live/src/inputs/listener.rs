//! Apps that connect to this computer and send lines: Sensor Fusion (Linköping), HyperIMU, SensorStreamer.
//!
//! They know no token, so anybody in the network can send: such a port is open only on request, takes
//! few connections, and gives each its own device.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use tokio::io::AsyncReadExt;
use tokio::net::{TcpListener, TcpStream, UdpSocket};
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::InputState;
use super::link::{Ended, Feed, LineCutter, Link};
use super::spec::{Address, InputKind};
use crate::lab::lock;

/// Most connections at a time, and most senders of datagrams.
const MOST_CONNECTIONS: usize = 16;
/// A connection that says nothing for so long is closed: the phone has left.
const IDLE: Duration = Duration::from_secs(60);
/// Bytes read at once.
const CHUNK: usize = 16 * 1024;
/// How often it is said who delivers.
const SAY_INTERVAL: Duration = Duration::from_secs(1);
/// A sender of datagrams that says nothing for so long is forgotten.
const SENDER_GONE: Duration = Duration::from_secs(5);

/// Listens until the port breaks off.
pub(super) async fn listening(link: &Link) -> Ended {
    let (tcp, udp) = bind(link).await?;
    Err(serve(link, &tcp, udp.as_ref()).await)
}

/// HyperIMU sends lines or datagrams; the others only lines.
async fn bind(link: &Link) -> Result<(TcpListener, Option<UdpSocket>), String> {
    let Address::Listen { ip, port } = *link.address() else {
        return Err("this kind of input listens on a port".to_owned());
    };
    let default = if link.reach().is_none() {
        Ipv4Addr::LOCALHOST
    } else {
        Ipv4Addr::UNSPECIFIED
    };
    let address = SocketAddr::new(ip.unwrap_or(IpAddr::V4(default)), port);
    let taken = |error: std::io::Error| format!("port {port} cannot be used: {error}");
    let tcp = TcpListener::bind(address).await.map_err(taken)?;
    let udp = match (link.kind(), tcp.local_addr()) {
        (InputKind::HyperImu, Ok(bound)) => Some(UdpSocket::bind(bound).await.map_err(taken)?),
        _ => None,
    };
    Ok((tcp, udp))
}

/// What those who deliver are doing, by device.
type News = Arc<Mutex<BTreeMap<String, String>>>;

async fn serve(link: &Link, tcp: &TcpListener, udp: Option<&UdpSocket>) -> String {
    let waiting = waiting(link, tcp.local_addr().ok());
    link.say(InputState::Waiting, waiting.as_str());
    let news = News::default();
    let mut taken: BTreeSet<String> = BTreeSet::new();
    let mut connections: JoinSet<String> = JoinSet::new();
    let mut senders = Senders::default();
    let mut datagram = vec![0; CHUNK];
    let mut tick = tokio::time::interval(SAY_INTERVAL);
    loop {
        tokio::select! {
            accepted = tcp.accept() => match accepted {
                Ok((stream, peer)) if taken.len() < MOST_CONNECTIONS => {
                    let name = free_name(peer.ip(), &taken);
                    taken.insert(name.clone());
                    let connection = connection(stream, link.feed(&name), name, news.clone());
                    connections.spawn(connection);
                }
                // Dropping it closes it.
                Ok(_) => {}
                Err(error) => return format!("the port broke off: {error}"),
            },
            Some(ended) = connections.join_next() => {
                // A connection task does not panic; if one did, its name stays taken.
                if let Ok(name) = ended {
                    taken.remove(&name);
                    lock(&news).remove(&name);
                }
            }
            received = receive(udp, &mut datagram) => match received {
                Ok((length, peer)) => senders.take(link, peer.ip(), &datagram[..length], &news),
                Err(error) => return format!("the port broke off: {error}"),
            },
            _ = tick.tick() => {
                senders.forget(&news);
                let said: Vec<String> = lock(&news).iter().map(|(n, t)| format!("{n}: {t}")).collect();
                if said.is_empty() {
                    link.say(InputState::Waiting, waiting.as_str());
                } else {
                    link.say(InputState::Connected, said.join("; "));
                }
            }
        }
    }
}

async fn receive(
    udp: Option<&UdpSocket>,
    buffer: &mut [u8],
) -> std::io::Result<(usize, SocketAddr)> {
    match udp {
        Some(socket) => socket.recv_from(buffer).await,
        None => std::future::pending().await,
    }
}

/// Where to connect, and who can.
fn waiting(link: &Link, bound: Option<SocketAddr>) -> String {
    let port = bound.map_or(0, |bound| bound.port());
    if bound.is_some_and(|bound| bound.ip().is_loopback()) {
        return format!("waiting on port {port} of this computer alone; phones cannot reach it");
    }
    let own = link.reach().map(|reach| reach.hosts()).unwrap_or_default();
    format!(
        "waiting on port {port}: enter {} and this port in the app; it has no token, so anybody in the network can send",
        own.join(" or ")
    )
}

/// A phone that connects again is the same device; a second one at the same address is another.
fn free_name(ip: IpAddr, taken: &BTreeSet<String>) -> String {
    let names = std::iter::once(ip.to_string()).chain((2..).map(|n| format!("{ip} ({n})")));
    let mut free = names.filter(|name| !taken.contains(name));
    free.next().unwrap_or_default()
}

/// One connection until it ends; returns the name it had.
async fn connection(mut stream: TcpStream, mut feed: Feed, name: String, news: News) -> String {
    lock(&news).insert(name.clone(), "connected".to_owned());
    let mut cutter = LineCutter::default();
    let mut chunk = vec![0; CHUNK];
    // Ends with the connection, with silence, or when there is no room for the device.
    while let Ok(Ok(length)) = timeout(IDLE, stream.read(&mut chunk)).await {
        if length == 0 {
            break;
        }
        let lines = cutter.push(&chunk[..length]);
        if lines.is_empty() {
            feed.pace(length).await;
        } else if let Err(why) = feed.give(lines).await {
            lock(&news).insert(name.clone(), why);
            tokio::time::sleep(SAY_INTERVAL * 2).await;
            break;
        }
        if let Some(mut text) = feed.news() {
            if cutter.left_out > 0 {
                text.push_str("; it sends lines without an end: is this the right app?");
            }
            lock(&news).insert(name.clone(), text);
        } else if cutter.left_out > 0 {
            let text = "sends lines without an end: is this the right app?";
            lock(&news).insert(name.clone(), text.to_owned());
        }
    }
    name
}

/// Those who send datagrams.
#[derive(Debug, Default)]
struct Senders {
    feeds: HashMap<IpAddr, (Feed, Instant)>,
}

impl Senders {
    fn take(&mut self, link: &Link, ip: IpAddr, datagram: &[u8], news: &News) {
        if self.feeds.len() >= MOST_CONNECTIONS && !self.feeds.contains_key(&ip) {
            return;
        }
        let feed = || (link.feed(&format!("{ip} (UDP)")), Instant::now());
        let (feed, last) = self.feeds.entry(ip).or_insert_with(feed);
        *last = Instant::now();
        // Datagrams are whole lines; some apps leave out the end of the last one.
        let mut lines = datagram.to_vec();
        lines.push(b'\n');
        // A sender of datagrams cannot be throttled: what is too much is left out, and said.
        feed.try_give(Bytes::from(lines));
        if let Some(text) = feed.news() {
            lock(news).insert(format!("{ip} (UDP)"), text);
        }
    }

    fn forget(&mut self, news: &News) {
        self.feeds.retain(|ip, (_, last)| {
            let stays = last.elapsed() < SENDER_GONE;
            if !stays {
                lock(news).remove(&format!("{ip} (UDP)"));
            }
            stays
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phone_that_comes_back_has_its_old_name_and_two_at_once_have_two() {
        let ip = IpAddr::from([192, 168, 1, 7]);
        let mut taken = BTreeSet::new();
        assert_eq!(free_name(ip, &taken), "192.168.1.7");
        taken.insert("192.168.1.7".to_owned());
        assert_eq!(free_name(ip, &taken), "192.168.1.7 (2)");
        taken.clear();
        assert_eq!(free_name(ip, &taken), "192.168.1.7");
    }
}
