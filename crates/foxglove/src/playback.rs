//! Play, pause, seek and speed, apart from any clock: whoever plays says how much time has passed.

use std::time::Duration;

/// Slower and faster than this nothing is played.
const SPEEDS: [f64; 2] = [0.01, 1000.0];

/// Whether time passes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Status {
    Playing,
    Paused,
    /// The end of the recording is reached.
    Ended,
}

/// The place in a recording.
#[derive(Debug, Clone)]
pub(crate) struct Playback {
    span_ns: [i64; 2],
    now_ns: i64,
    /// What of a nanosecond has passed.
    rest: f64,
    speed: f64,
    status: Status,
}

impl Playback {
    /// At the start, paused.
    pub(crate) fn new(span_ns: [i64; 2]) -> Self {
        Self {
            span_ns,
            now_ns: span_ns[0],
            rest: 0.0,
            speed: 1.0,
            status: Status::Paused,
        }
    }

    pub(crate) fn now_ns(&self) -> i64 {
        self.now_ns
    }

    pub(crate) fn speed(&self) -> f64 {
        self.speed
    }

    pub(crate) fn status(&self) -> Status {
        self.status
    }

    /// Goes on; from the end, begins anew, and then it has jumped: `true`.
    pub(crate) fn play(&mut self) -> bool {
        let anew = self.now_ns >= self.span_ns[1];
        if anew {
            self.now_ns = self.span_ns[0];
        }
        self.status = Status::Playing;
        anew
    }

    pub(crate) fn pause(&mut self) {
        if self.status == Status::Playing {
            self.status = Status::Paused;
        }
    }

    /// Jumps, within the recording.
    pub(crate) fn seek(&mut self, time_ns: i64) {
        self.now_ns = time_ns.clamp(self.span_ns[0], self.span_ns[1]);
        self.rest = 0.0;
        if self.status == Status::Ended {
            self.status = Status::Paused;
        }
    }

    /// Recording seconds a second; what is no speed changes nothing.
    pub(crate) fn set_speed(&mut self, speed: f64) {
        if speed.is_finite() && speed > 0.0 {
            self.speed = speed.clamp(SPEEDS[0], SPEEDS[1]);
        }
    }

    /// Time passes: what lies after the first instant and not after the second is due.
    pub(crate) fn advance(&mut self, elapsed: Duration) -> Option<[i64; 2]> {
        if self.status != Status::Playing {
            return None;
        }
        let from = self.now_ns;
        let step = elapsed.as_secs_f64() * 1e9 * self.speed + self.rest;
        let whole = step.floor();
        self.rest = step - whole;
        self.now_ns = from.saturating_add(whole as i64).min(self.span_ns[1]);
        if self.now_ns >= self.span_ns[1] {
            self.status = Status::Ended;
            self.rest = 0.0;
        }
        Some([from, self.now_ns])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    #[test]
    fn it_begins_paused_and_time_passes_while_it_plays() {
        let mut playback = Playback::new([5 * SECOND, 10 * SECOND]);
        assert_eq!(playback.advance(Duration::from_secs(3)), None);
        assert!(!playback.play());
        let due = playback.advance(Duration::from_millis(1500));
        assert_eq!(due, Some([5 * SECOND, 6 * SECOND + SECOND / 2]));
        playback.pause();
        assert_eq!(playback.advance(Duration::from_secs(3)), None);
        assert_eq!(playback.now_ns(), 6 * SECOND + SECOND / 2);
    }

    #[test]
    fn small_steps_at_an_odd_speed_lose_nothing() {
        let mut playback = Playback::new([0, 1000 * SECOND]);
        playback.set_speed(0.3);
        playback.play();
        for _ in 0..30_000 {
            playback.advance(Duration::from_nanos(333_333));
        }
        let expected = (30_000.0 * 333_333.0 * 0.3) as i64;
        assert!((playback.now_ns() - expected).abs() <= 1);
    }

    #[test]
    fn it_ends_at_the_end_and_play_begins_anew() {
        let mut playback = Playback::new([0, SECOND]);
        playback.set_speed(4.0);
        playback.play();
        assert_eq!(playback.advance(Duration::from_secs(1)), Some([0, SECOND]));
        assert_eq!(playback.status(), Status::Ended);
        playback.pause();
        assert_eq!(playback.status(), Status::Ended);
        assert!(playback.play());
        assert_eq!((playback.now_ns(), playback.status()), (0, Status::Playing));
    }

    #[test]
    fn a_jump_stays_inside_and_nonsense_is_no_speed() {
        let mut playback = Playback::new([0, SECOND]);
        playback.seek(i64::MAX);
        assert_eq!(
            (playback.now_ns(), playback.status()),
            (SECOND, Status::Paused)
        );
        playback.seek(i64::MIN);
        assert_eq!(playback.now_ns(), 0);
        for nonsense in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            playback.set_speed(nonsense);
            assert_eq!(playback.speed().to_bits(), 1.0_f64.to_bits());
        }
        playback.set_speed(1e9);
        assert_eq!(playback.speed().to_bits(), SPEEDS[1].to_bits());
    }
}
