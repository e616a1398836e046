//! How often a secret may be guessed: so often by one address, and so often by all of them together.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::Mutex;
use std::time::Instant;

use crate::lab::lock;

/// Wrong guesses in a row, and how many more a second after that: of one address, behind which a class may be.
const ADDRESS: Allowance = Allowance::new(20.0, 0.5);
/// Of all addresses.
const ALL: Allowance = Allowance::new(200.0, 5.0);
/// Addresses that are remembered; those that have not guessed for long go first.
const MOST_ADDRESSES: usize = 1024;

/// So many at once, and so many a second.
#[derive(Debug, Clone, Copy)]
struct Allowance {
    burst: f64,
    a_second: f64,
}

impl Allowance {
    const fn new(burst: f64, a_second: f64) -> Self {
        Self { burst, a_second }
    }
}

/// What is left of an allowance.
#[derive(Debug)]
struct Left {
    of: Allowance,
    count: f64,
    at: Instant,
}

impl Left {
    fn new(of: Allowance, now: Instant) -> Self {
        let count = of.burst;
        Self { of, count, at: now }
    }

    fn at(&mut self, now: Instant) -> f64 {
        let seconds = now.saturating_duration_since(self.at).as_secs_f64();
        self.at = self.at.max(now);
        self.count = (self.count + seconds * self.of.a_second).min(self.of.burst);
        self.count
    }
}

/// Counts guesses.
#[derive(Debug)]
pub(crate) struct Guesses(Mutex<Counts>);

#[derive(Debug)]
struct Counts {
    all: Left,
    addresses: HashMap<IpAddr, Left>,
}

impl Guesses {
    /// Nobody has guessed yet.
    pub(crate) fn new(now: Instant) -> Self {
        Self(Mutex::new(Counts {
            all: Left::new(ALL, now),
            addresses: HashMap::new(),
        }))
    }

    /// Looks at a guess of `peer`: what `check` gives is right, and costs nothing. `Err` when there were too many wrong
    /// ones: then nothing is looked at.
    pub(crate) fn look<T>(
        &self,
        peer: IpAddr,
        now: Instant,
        check: impl FnOnce() -> Option<T>,
    ) -> Result<Option<T>, TooMany> {
        // Taken before it is looked at, so that many guesses at once are no more than many in a row.
        lock(&self.0).take(peer, now)?;
        let found = check();
        if found.is_some() {
            lock(&self.0).give_back(peer);
        }
        Ok(found)
    }
}

/// Too many wrong guesses of late.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TooMany;

impl Counts {
    fn take(&mut self, peer: IpAddr, now: Instant) -> Result<(), TooMany> {
        if self.all.at(now) < 1.0 {
            return Err(TooMany);
        }
        if self.addresses.len() >= MOST_ADDRESSES && !self.addresses.contains_key(&peer) {
            self.addresses
                .retain(|_, left| left.at(now) < left.of.burst);
            if self.addresses.len() >= MOST_ADDRESSES {
                return Err(TooMany);
            }
        }
        let own = self.addresses.entry(peer);
        let own = own.or_insert_with(|| Left::new(ADDRESS, now));
        if own.at(now) < 1.0 {
            return Err(TooMany);
        }
        own.count -= 1.0;
        self.all.count -= 1.0;
        Ok(())
    }

    fn give_back(&mut self, peer: IpAddr) {
        self.all.count += 1.0;
        if let Some(own) = self.addresses.get_mut(&peer) {
            own.count += 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn wrong(guesses: &Guesses, peer: IpAddr, now: Instant) -> bool {
        guesses.look::<()>(peer, now, || None).is_ok()
    }

    #[test]
    fn who_guesses_wrong_is_slowed_and_others_are_not() {
        let start = Instant::now();
        let guesses = Guesses::new(start);
        let [rude, polite] = [[10, 0, 0, 1], [10, 0, 0, 2]].map(IpAddr::from);
        let looked = (0..1000).filter(|_| wrong(&guesses, rude, start)).count();
        assert_eq!(looked, 20);
        assert_eq!(guesses.look(polite, start, || Some(1)), Ok(Some(1)));
        // Not even the right one is looked at, until some time has passed.
        assert_eq!(guesses.look(rude, start, || Some(1)), Err(TooMany));
        let later = start + Duration::from_secs(2);
        assert_eq!(guesses.look(rude, later, || Some(1)), Ok(Some(1)));
        let hour = (0..36_000).map(|k| later + Duration::from_millis(100 * k));
        let looked = hour.filter(|now| wrong(&guesses, rude, *now)).count();
        assert!((1790..1830).contains(&looked), "{looked}");
    }

    #[test]
    fn right_ones_cost_nothing() {
        let (start, peer) = (Instant::now(), IpAddr::from([10, 0, 0, 1]));
        let guesses = Guesses::new(start);
        let right = |_| guesses.look(peer, start, || Some(())) == Ok(Some(()));
        assert!((0..1000).all(right));
    }

    #[test]
    fn many_addresses_together_are_slowed_in_bounded_memory() {
        let start = Instant::now();
        let guesses = Guesses::new(start);
        let peer = |k: u32| IpAddr::from(k.to_be_bytes());
        let looked = (0..10_000).filter(|k| wrong(&guesses, peer(*k), start));
        assert_eq!(looked.count(), 200);
        assert_eq!(lock(&guesses.0).addresses.len(), 200);
        // An hour of new addresses: those that have not guessed for long are forgotten.
        let hour = (0..36_000_u32).map(|k| (k, start + Duration::from_millis(u64::from(k) * 100)));
        let looked = hour.filter(|(k, now)| wrong(&guesses, peer(20_000 + k), *now));
        assert!((17_900..18_100).contains(&looked.count()));
        assert!(lock(&guesses.0).addresses.len() <= MOST_ADDRESSES);
    }
}
