//! How much one device, one connection and one address may send.

use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use axum::extract::connect_info::Connected;

use crate::lab::lock;

/// Requests and bytes: a second, and in a burst.
#[derive(Debug, Clone, Copy)]
pub struct Rates {
    requests: [f64; 2],
    bytes: [f64; 2],
}

/// A device: a phone that comes back sends what it has kept.
pub const DEVICE: Rates = Rates {
    requests: [50.0, 250.0],
    bytes: [2e6, 8e6],
};
/// A connection: one device, or a few behind one relay.
pub const CONNECTION: Rates = Rates {
    requests: [200.0, 1000.0],
    bytes: [4e6, 16e6],
};
/// An address: a class may be behind one.
pub const ADDRESS: Rates = Rates {
    requests: [2000.0, 8000.0],
    bytes: [16e6, 64e6],
};
/// Addresses that are remembered; those that have been quiet go first.
const MOST_ADDRESSES: usize = 4096;
/// Bytes that may wait for one device, and for all together.
const QUEUED_BYTES: [usize; 2] = [4 << 20, 64 << 20];

/// Two buckets that fill with time and are emptied by what arrives.
#[derive(Debug)]
pub struct RateLimit {
    rates: Rates,
    at: Instant,
    requests: f64,
    bytes: f64,
}

impl RateLimit {
    /// Full buckets.
    #[must_use]
    pub fn new(rates: Rates, now: Instant) -> Self {
        Self {
            rates,
            at: now,
            requests: rates.requests[1],
            bytes: rates.bytes[1],
        }
    }

    /// Whether one more request of `bytes` is within the limits; it counts if so.
    pub fn admits(&mut self, now: Instant, bytes: usize) -> bool {
        self.fill(now);
        let bytes = bytes as f64;
        if self.requests < 1.0 || self.bytes < bytes {
            return false;
        }
        self.requests -= 1.0;
        self.bytes -= bytes;
        true
    }

    fn fill(&mut self, now: Instant) {
        let seconds = now.saturating_duration_since(self.at).as_secs_f64();
        let Rates { requests, bytes } = self.rates;
        self.at = now;
        self.requests = (self.requests + seconds * requests[0]).min(requests[1]);
        self.bytes = (self.bytes + seconds * bytes[0]).min(bytes[1]);
    }

    /// Whether nothing has come for so long that the buckets are full again.
    fn is_full(&mut self, now: Instant) -> bool {
        self.fill(now);
        self.requests >= self.rates.requests[1] && self.bytes >= self.rates.bytes[1]
    }
}

/// The limits of all addresses.
#[derive(Debug, Default)]
pub struct Addresses(Mutex<HashMap<IpAddr, RateLimit>>);

impl Addresses {
    fn admits(&self, peer: IpAddr, now: Instant, bytes: usize) -> bool {
        let mut known = lock(&self.0);
        if known.len() >= MOST_ADDRESSES && !known.contains_key(&peer) {
            known.retain(|_, limit| !limit.is_full(now));
            if known.len() >= MOST_ADDRESSES {
                return false;
            }
        }
        let limit = known.entry(peer);
        let limit = limit.or_insert_with(|| RateLimit::new(ADDRESS, now));
        limit.admits(now, bytes)
    }
}

/// The other end of a connection.
#[derive(Debug, Clone)]
pub struct Peer {
    /// Its address.
    pub address: IpAddr,
    limit: Arc<Mutex<RateLimit>>,
}

impl Peer {
    fn new(address: IpAddr) -> Self {
        let limit = RateLimit::new(CONNECTION, Instant::now());
        Self {
            address,
            limit: Arc::new(Mutex::new(limit)),
        }
    }

    /// Whether one more request of `bytes` is within the limits of this connection and its address.
    /// To be asked before anything is read or parsed.
    #[must_use]
    pub fn admits(&self, addresses: &Addresses, bytes: usize) -> bool {
        let now = Instant::now();
        lock(&self.limit).admits(now, bytes) && addresses.admits(self.address, now, bytes)
    }
}

impl Connected<SocketAddr> for Peer {
    fn connect_info(address: SocketAddr) -> Self {
        Self::new(address.ip())
    }
}

/// Bytes that wait to be worked on.
#[derive(Debug, Clone, Default)]
pub struct Queued(Arc<AtomicUsize>);

/// Room for bytes that wait; given back when it is dropped.
#[derive(Debug)]
pub struct Room {
    bytes: usize,
    queues: [Queued; 2],
}

impl Queued {
    fn take(&self, bytes: usize, most: usize) -> bool {
        let before = self.0.fetch_add(bytes, Ordering::Relaxed);
        let fits = before.saturating_add(bytes) <= most;
        if !fits {
            self.0.fetch_sub(bytes, Ordering::Relaxed);
        }
        fits
    }
}

impl Room {
    /// Room in a device's queue and in that of all, if both have it.
    #[must_use]
    pub fn take(device: &Queued, all: &Queued, bytes: usize) -> Option<Self> {
        if !device.take(bytes, QUEUED_BYTES[0]) {
            return None;
        }
        if !all.take(bytes, QUEUED_BYTES[1]) {
            device.0.fetch_sub(bytes, Ordering::Relaxed);
            return None;
        }
        Some(Self {
            bytes,
            queues: [device.clone(), all.clone()],
        })
    }
}

impl Drop for Room {
    fn drop(&mut self) {
        for queue in &self.queues {
            queue.0.fetch_sub(self.bytes, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_flood_is_throttled_and_a_steady_stream_is_not() {
        let start = Instant::now();
        let mut limit = RateLimit::new(DEVICE, start);
        let flood = (0..1000).filter(|_| limit.admits(start, 100)).count();
        assert_eq!(flood, 250);
        let steady = (0..2000).map(|k| start + Duration::from_millis(5000 + k * 25));
        assert!(steady.into_iter().all(|now| limit.admits(now, 10_000)));
        assert!(!limit.admits(start + Duration::from_secs(100), 10_000_000));
    }

    /// 64 phones behind one address, ten batches of 4 kB a second each, for ten seconds.
    #[test]
    fn a_class_behind_one_address_is_not_throttled_and_a_flood_is() {
        let (start, addresses) = (Instant::now(), Addresses::default());
        let peer = IpAddr::from([10, 0, 0, 1]);
        for tenth in 0..100 {
            let now = start + Duration::from_millis(tenth * 100);
            assert!((0..64).all(|_| addresses.admits(peer, now, 4000)));
        }
        let later = start + Duration::from_secs(100);
        let flood = (0..10_000).filter(|_| addresses.admits(peer, later, 100_000));
        assert_eq!(flood.count(), 640);
        assert!(addresses.admits(IpAddr::from([10, 0, 0, 2]), later, 100_000));
    }

    #[test]
    fn addresses_are_forgotten_when_they_are_quiet_and_never_grow_without_bound() {
        let (start, addresses) = (Instant::now(), Addresses::default());
        let peer = |k: u32| IpAddr::from(k.to_be_bytes());
        for k in 0..4096 {
            assert!(addresses.admits(peer(k), start, 10));
        }
        assert!(!addresses.admits(peer(5000), start, 10));
        assert!(addresses.admits(peer(5000), start + Duration::from_secs(60), 10));
        assert_eq!(lock(&addresses.0).len(), 1);
    }

    #[test]
    fn one_connection_has_a_limit_of_its_own() {
        let (peer, addresses) = (Peer::new(IpAddr::from([10, 0, 0, 1])), Addresses::default());
        let taken = (0..100)
            .filter(|_| peer.admits(&addresses, 1_000_000))
            .count();
        assert!((16..20).contains(&taken), "{taken}");
    }

    #[test]
    fn bytes_that_wait_are_bounded_per_device_and_in_all() {
        let all = Queued::default();
        let devices: Vec<Queued> = (0..20).map(|_| Queued::default()).collect();
        let mut rooms = Vec::new();
        for device in &devices {
            for _ in 0..20 {
                rooms.extend(Room::take(device, &all, 256 << 10));
            }
        }
        assert_eq!(rooms.len(), 256);
        assert_eq!(devices[0].0.load(Ordering::Relaxed), 4 << 20);
        assert!(Room::take(&devices[19], &all, 1).is_none());
        rooms.clear();
        assert_eq!(all.0.load(Ordering::Relaxed), 0);
        assert!(Room::take(&devices[19], &all, 1).is_some());
    }
}
