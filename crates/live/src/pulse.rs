//! Keeps a WebSocket alive, and notices when nobody is at its other end.

use std::time::Duration;

use tokio::time::{Instant, Interval, MissedTickBehavior, interval};

/// How often the other end is asked for a sign of life.
const INTERVAL: Duration = Duration::from_secs(10);
/// After so long without one it counts as gone.
const LONGEST_SILENCE: Duration = Duration::from_secs(30);

/// The sign of life of one WebSocket.
#[derive(Debug)]
pub(crate) struct Pulse {
    tick: Interval,
    last: Instant,
    longest_silence: Duration,
}

impl Pulse {
    pub(crate) fn new() -> Self {
        Self::with(INTERVAL, LONGEST_SILENCE)
    }

    fn with(every: Duration, longest_silence: Duration) -> Self {
        let mut tick = interval(every);
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        Self {
            tick,
            last: Instant::now(),
            longest_silence,
        }
    }

    /// Whatever comes is a sign of life.
    pub(crate) fn felt<T>(&mut self, received: T) -> T {
        self.last = Instant::now();
        received
    }

    /// Waits until a ping is due. Returns whether the other end is still there.
    pub(crate) async fn beat(&mut self) -> bool {
        self.tick.tick().await;
        self.last.elapsed() < self.longest_silence
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_long_silence_is_the_end_and_a_sign_of_life_is_not() {
        let longest = Duration::from_millis(200);
        let mut pulse = Pulse::with(Duration::from_millis(10), longest);
        let start = Instant::now();
        while start.elapsed() < 2 * longest {
            pulse.felt(());
            pulse.beat().await;
        }
        pulse.felt(());
        let since = Instant::now();
        while pulse.beat().await {}
        assert!(since.elapsed() >= longest);
    }
}
