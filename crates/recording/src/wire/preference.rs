//! Two sources of one quantity: the worse is used only while the better is silent.

/// How long the better source must be silent before the other takes over, ns.
const SILENCE_NS: i64 = 500_000_000;
/// How long the better source is given to appear, ns.
const WAIT_NS: i64 = 1_000_000_000;

/// Which of two sources of one quantity is alive, by sensor time.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Preference {
    better_ns: Option<i64>,
    worse_since_ns: Option<i64>,
}

impl Preference {
    /// The better source has a reading.
    pub(super) fn better(&mut self, time_ns: i64) {
        self.better_ns = self.better_ns.max(Some(time_ns));
    }

    /// Whether a reading of the worse source is to be used, when the better may have been seen
    /// already if it exists.
    pub(super) fn take_worse(self, time_ns: i64) -> bool {
        self.better_ns
            .is_none_or(|better| time_ns.saturating_sub(better) > SILENCE_NS)
    }

    /// The same for sources that come reading by reading: the better is given time to appear.
    pub(super) fn take_worse_after_wait(&mut self, time_ns: i64) -> bool {
        let since = *self.worse_since_ns.get_or_insert(time_ns);
        time_ns.saturating_sub(since) > WAIT_NS && self.take_worse(time_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::Preference;

    const MS: i64 = 1_000_000;

    #[test]
    fn the_worse_source_fills_in_when_the_better_falls_silent() {
        let mut preference = Preference::default();
        assert!(preference.take_worse(0));
        preference.better(100 * MS);
        assert!(!preference.take_worse(50 * MS));
        assert!(!preference.take_worse(600 * MS));
        assert!(preference.take_worse(601 * MS));
        preference.better(700 * MS);
        assert!(!preference.take_worse(750 * MS));
    }

    #[test]
    fn the_better_source_is_waited_for() {
        let mut preference = Preference::default();
        assert!(!preference.take_worse_after_wait(0));
        assert!(!preference.take_worse_after_wait(900 * MS));
        assert!(preference.take_worse_after_wait(1001 * MS));
        preference.better(1010 * MS);
        assert!(!preference.take_worse_after_wait(1020 * MS));
    }
}
