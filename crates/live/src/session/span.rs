//! How far something is that lasts so many seconds of the device's time.

/// A span of the device's time, from its first sample on.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    /// How long it lasts, s.
    pub seconds: f64,
    since_ns: Option<i64>,
    now_ns: i64,
}

impl Span {
    /// A span that has not begun.
    #[must_use]
    pub const fn new(seconds: f64) -> Self {
        Self {
            seconds,
            since_ns: None,
            now_ns: i64::MIN,
        }
    }

    /// Begins, unless it has begun.
    pub fn begin(&mut self, time_ns: i64) {
        self.since_ns.get_or_insert(time_ns);
    }

    /// The time is this, or later. Returns when the span has begun, if it has.
    pub fn reach(&mut self, time_ns: i64) -> Option<i64> {
        let since = self.since_ns?;
        self.now_ns = self.now_ns.max(time_ns);
        Some(since)
    }

    /// When it has begun.
    #[must_use]
    pub const fn since_ns(&self) -> Option<i64> {
        self.since_ns
    }

    /// Seconds since it began.
    #[must_use]
    pub fn elapsed_s(&self) -> f64 {
        let since = self.since_ns.unwrap_or(self.now_ns);
        self.now_ns.saturating_sub(since) as f64 * 1e-9
    }

    /// How far it is: 0 to 1.
    #[must_use]
    pub fn progress(&self) -> f64 {
        (self.elapsed_s() / self.seconds).clamp(0.0, 1.0)
    }

    /// Seconds still to come.
    #[must_use]
    pub fn remaining_s(&self) -> f64 {
        (self.seconds - self.elapsed_s()).max(0.0)
    }
}
