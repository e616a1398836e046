//! How much one device may send.

use std::time::Instant;

/// Requests a second, and in a burst: a phone that comes back sends what it has kept.
const REQUESTS: [f64; 2] = [50.0, 250.0];
/// Bytes a second, and in a burst.
const BYTES: [f64; 2] = [2e6, 8e6];

/// Two buckets that fill with time and are emptied by what arrives.
#[derive(Debug)]
pub struct RateLimit {
    at: Instant,
    requests: f64,
    bytes: f64,
}

impl RateLimit {
    /// Full buckets.
    #[must_use]
    pub fn new(now: Instant) -> Self {
        Self {
            at: now,
            requests: REQUESTS[1],
            bytes: BYTES[1],
        }
    }

    /// Whether one more request of `bytes` is within the limits; it counts if so.
    pub fn admits(&mut self, now: Instant, bytes: usize) -> bool {
        let seconds = now.saturating_duration_since(self.at).as_secs_f64();
        self.at = now;
        self.requests = (self.requests + seconds * REQUESTS[0]).min(REQUESTS[1]);
        self.bytes = (self.bytes + seconds * BYTES[0]).min(BYTES[1]);
        let bytes = bytes as f64;
        if self.requests < 1.0 || self.bytes < bytes {
            return false;
        }
        self.requests -= 1.0;
        self.bytes -= bytes;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_flood_is_held_back_and_a_steady_stream_is_not() {
        let start = Instant::now();
        let mut limit = RateLimit::new(start);
        let flood = (0..1000).filter(|_| limit.admits(start, 100)).count();
        assert_eq!(flood, 250);
        let steady = (0..2000).map(|k| start + Duration::from_millis(5000 + k * 25));
        assert!(steady.into_iter().all(|now| limit.admits(now, 10_000)));
        assert!(!limit.admits(start + Duration::from_secs(100), 10_000_000));
    }
}
