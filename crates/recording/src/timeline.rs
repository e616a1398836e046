//! Time order: drops repeated and backward stamps, counts gaps and non-finite samples.

use crate::error::{RecordingError, Result};
use crate::event::{Event, SensorKind};
use crate::issues::Issues;
use crate::stamp::format_s;

const SENSORS: usize = SensorKind::ALL.len();

/// After this many stamps of a sensor a recording that mostly goes back is refused at once; shorter
/// ones are judged at their end.
const ENOUGH_STAMPS: u64 = 100;

/// Stamps that are dates: from 1990 to 2100, seconds since 1970.
const DATES_S: std::ops::Range<i64> = 631_152_000..4_102_444_800;

const SORT_ROWS: &str = "sort the rows by time, or check the time column and its unit";
/// With fewer stamps too early for each step back the rows are out of order.
const STAMPS_PER_STEP: u64 = 10;
const SORT_BAG: &str = "within one topic the messages or their stamps are out of order: check the clock that stamps them, or sort \
     the bag by the time of its log, e.g. with `mcap sort`, or with `pip install rosbags` and `rosbags-convert`";
/// The formats of bags, whose topics are put in order before.
const BAGS: [&str; 3] = ["mcap", "rosbag2-sqlite", "rosbag-ros1"];

/// Decides event by event what fits into the order of time. Constant memory.
///
/// A stamp that repeats the last one of the same sensor is a duplicate; a stamp earlier than the
/// latest delivered one of any sensor goes back. Both are refused and counted.
#[derive(Debug, Clone)]
pub struct Timeline {
    gap_limit_ns: i64,
    /// What to do about a recording that goes back.
    advice: &'static str,
    first_ns: Option<i64>,
    latest_ns: i64,
    last_of_sensor_ns: [Option<i64>; SENSORS],
    seen: [u64; SENSORS],
    back: [u64; SENSORS],
    steps: [Steps; SENSORS],
}

/// Where the stamps of a sensor step back.
#[derive(Debug, Clone, Copy, Default)]
struct Steps {
    /// The stamp before, delivered or not.
    before_ns: Option<i64>,
    count: u64,
    /// From where and to where the first one goes.
    first_ns: Option<[i64; 2]>,
}

impl Steps {
    fn see(&mut self, now_ns: i64) {
        let before = self.before_ns.replace(now_ns);
        if let Some(before) = before.filter(|before| now_ns < *before) {
            self.count += 1;
            self.first_ns.get_or_insert([before, now_ns]);
        }
    }

    /// What to do about steps behind which the stamps go on in order, `back` of them too early; `None` of rows out of order.
    fn advice(&self, back: u64) -> Option<String> {
        let is_in_order = self.count * STAMPS_PER_STEP <= back;
        let [from, to] = self.first_ns.filter(|_| is_in_order)?.map(format_s);
        let (steps, there) = match self.count {
            1 => ("one step back".to_owned(), "there"),
            count => (format!("{count} steps back, the first"), "at each"),
        };
        Some(format!(
            "there is {steps} from {from} s to {to} s: divide the file {there} if these are several recordings, or put the \
             stamps behind it right if the clock was set or started again"
        ))
    }
}

impl Timeline {
    /// A timeline that counts pauses of the gyroscope longer than `gap_limit_s` (s) as gaps.
    #[must_use]
    pub fn new(gap_limit_s: f64) -> Self {
        Self {
            // Saturates for absurd limits, which then never trigger.
            gap_limit_ns: (gap_limit_s * 1e9) as i64,
            advice: SORT_ROWS,
            first_ns: None,
            latest_ns: i64::MIN,
            last_of_sensor_ns: [None; SENSORS],
            seen: [0; SENSORS],
            back: [0; SENSORS],
            steps: [Steps::default(); SENSORS],
        }
    }

    /// The timeline of a recording of this format, which says what to do when it goes back.
    #[must_use]
    pub(crate) fn of_format(self, format: &str) -> Self {
        let is_bag = BAGS.contains(&format);
        let advice = if is_bag { SORT_BAG } else { SORT_ROWS };
        Self { advice, ..self }
    }

    /// Whether the event fits; counts what does not.
    ///
    /// # Errors
    /// [`RecordingError::TimeGoesBack`] when most stamps of a sensor go back.
    pub fn admit(&mut self, event: &Event, issues: &mut Issues, file: &str) -> Result<bool> {
        let kind = event.sample.kind();
        let sensor = kind.order();
        let now = event.time_ns;
        self.seen[sensor] += 1;
        self.steps[sensor].see(now);
        if now < self.latest_ns {
            self.back[sensor] += 1;
            Issues::count(&mut issues.stamps_going_back, kind);
            if self.seen[sensor] >= ENOUGH_STAMPS {
                self.judge(kind, file)?;
            }
            return Ok(false);
        }
        let previous = self.last_of_sensor_ns[sensor];
        if previous == Some(now) {
            Issues::count(&mut issues.duplicate_stamps, kind);
            return Ok(false);
        }
        let first = *self.first_ns.get_or_insert(now);
        if kind == SensorKind::Gyroscope {
            if issues.gyroscope_stamps == 0 {
                issues.stamps_are_dates = DATES_S.contains(&(now / 1_000_000_000));
            }
            issues.gyroscope_stamps += 1;
            if let Some(previous) = previous {
                issues.gyroscope_span_s += now.saturating_sub(previous) as f64 * 1e-9;
                self.note_gap(previous, now, first, issues);
            }
        }
        if !event.sample.is_finite() {
            Issues::count(&mut issues.non_finite_samples, kind);
        }
        self.latest_ns = now;
        self.last_of_sensor_ns[sensor] = Some(now);
        Ok(true)
    }

    /// The verdict at the end of a recording.
    ///
    /// # Errors
    /// [`RecordingError::TimeGoesBack`] when most stamps of a sensor went back.
    pub fn finish(&self, file: &str) -> Result<()> {
        SensorKind::ALL
            .into_iter()
            .try_for_each(|kind| self.judge(kind, file))
    }

    fn judge(&self, kind: SensorKind, file: &str) -> Result<()> {
        let (back, total) = (self.back[kind.order()], self.seen[kind.order()]);
        if 2 * back <= total {
            return Ok(());
        }
        Err(RecordingError::TimeGoesBack {
            file: file.to_owned(),
            sensor: kind.name(),
            back,
            total,
            advice: match self.advice {
                SORT_ROWS => self.steps[kind.order()]
                    .advice(back)
                    .unwrap_or(SORT_ROWS.to_owned()),
                others => others.to_owned(),
            },
        })
    }

    fn note_gap(&self, previous: i64, now: i64, first: i64, issues: &mut Issues) {
        // Readers keep stamps within half the range of i64, so differences do not overflow; events
        // from elsewhere saturate.
        let pause = now.saturating_sub(previous);
        if pause <= self.gap_limit_ns {
            return;
        }
        issues.gaps += 1;
        let pause_s = pause as f64 * 1e-9;
        if pause_s > issues.longest_gap_s {
            issues.longest_gap_s = pause_s;
            issues.longest_gap_start_s = previous.saturating_sub(first) as f64 * 1e-9;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Timeline;
    use crate::error::RecordingError;
    use crate::event::{Event, Sample, SensorKind};
    use crate::issues::Issues;
    use nalgebra::Vector3;

    fn rate(time_ms: i64) -> Event {
        Event {
            time_ns: time_ms * 1_000_000,
            sample: Sample::AngularRate(Vector3::zeros()),
        }
    }

    fn force(time_ms: i64) -> Event {
        Event {
            time_ns: time_ms * 1_000_000,
            sample: Sample::SpecificForce(Vector3::new(0.0, 0.0, f64::NAN)),
        }
    }

    fn admitted(events: &[Event], issues: &mut Issues) -> Vec<bool> {
        let mut timeline = Timeline::new(0.5);
        let verdicts = events
            .iter()
            .map(|event| timeline.admit(event, issues, "test").unwrap())
            .collect();
        timeline.finish("test").unwrap();
        verdicts
    }

    #[test]
    fn duplicates_and_backward_stamps_are_dropped_and_counted() {
        let mut issues = Issues::default();
        let events = [
            rate(0),
            force(0),
            rate(10),
            rate(10),
            force(5),
            force(10),
            rate(20),
        ];
        assert_eq!(
            admitted(&events, &mut issues),
            [true, true, true, false, false, true, true]
        );
        assert_eq!(issues.duplicate_stamps[&SensorKind::Gyroscope], 1);
        assert_eq!(issues.stamps_going_back[&SensorKind::Accelerometer], 1);
        assert_eq!(issues.non_finite_samples[&SensorKind::Accelerometer], 2);
        assert_eq!(issues.gaps, 0);
    }

    #[test]
    fn the_longest_gap_and_its_start_are_found() {
        let mut issues = Issues {
            gap_limit_s: 0.5,
            ..Issues::default()
        };
        admitted(
            &[
                rate(1000),
                rate(1500),
                rate(2100),
                rate(2200),
                rate(4200),
                rate(4900),
            ],
            &mut issues,
        );
        assert_eq!(issues.gaps, 3);
        approx::assert_relative_eq!(issues.longest_gap_s, 2.0);
        approx::assert_relative_eq!(issues.longest_gap_start_s, 1.2);
        assert_eq!(
            issues.sentences(),
            [
                "The gyroscope pauses for more than 0.5 s 3 times; the longest gap lasts 2.000 s and starts 1.200 s into the recording."
            ]
        );
    }

    #[test]
    fn a_recording_that_mostly_goes_back_is_refused() {
        let mut issues = Issues::default();
        let mut timeline = Timeline::new(0.5);
        let refused_at = (0..1000)
            .find(|i| {
                timeline
                    .admit(&rate(1000 - i), &mut issues, "test")
                    .is_err()
            })
            .unwrap();
        assert_eq!(refused_at, 99);

        // Rows that are in order but for one step are not to be sorted.
        let refusal = |stamps: Vec<i64>| {
            let mut timeline = Timeline::new(0.5);
            let refused = stamps.into_iter().find_map(|t| {
                timeline
                    .admit(&rate(t), &mut Issues::default(), "x.csv")
                    .err()
            });
            refused.unwrap().to_string()
        };
        let twice = refusal((5000..5300).chain(1000..1400).collect());
        assert!(
            twice.contains("there is one step back from 5.299 s to 1.0 s: divide the file there")
                && !twice.contains("sort"),
            "{twice}"
        );
        let shuffled = refusal((0..1000).map(|i| 4000 - i).collect());
        assert!(shuffled.contains("sort the rows by time"), "{shuffled}");

        let mut short = Timeline::new(0.5);
        for time_ms in [3, 2, 1] {
            short.admit(&rate(time_ms), &mut issues, "test").unwrap();
        }
        let error = short.finish("short.csv").unwrap_err();
        assert!(matches!(
            error,
            RecordingError::TimeGoesBack {
                back: 2,
                total: 3,
                ..
            }
        ));
        assert!(
            error
                .to_string()
                .starts_with("short.csv: time runs backwards")
        );
    }
}
