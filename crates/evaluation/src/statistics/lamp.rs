//! Consistency of the last seconds of innovations with the stated noise (NIS), in words: the lamps.

use crate::statistics::consistency::{JudgeBy, NoiseVerdict, judge};
use crate::statistics::nis::{NisStatistics, UpdateCounts};
use northing_core::kalman::Innovation;
use northing_core::navigation::Validity;
use northing_recording::SensorKind;
use serde::Serialize;

/// Samples after which the older half of the window is forgotten.
const HALF: u32 = 250;
/// Samples after which the verdict is made anew: quantiles are not free.
const RENEW: u32 = 25;

/// How welcome something is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Tone {
    /// As it should be.
    Good,
    /// Good to know.
    Info,
    /// Worth a look.
    Warn,
    /// Wrong.
    Bad,
    /// Nothing to judge.
    Idle,
}

impl Tone {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Info => "info",
            Self::Warn => "warn",
            Self::Bad => "bad",
            Self::Idle => "idle",
        }
    }
}

/// A statement with its tone.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Remark {
    /// How welcome it is.
    pub tone: Tone,
    /// One sentence.
    pub text: String,
}

impl Remark {
    /// A remark from its two parts.
    pub fn new(tone: Tone, text: impl Into<String>) -> Self {
        Self {
            tone,
            text: text.into(),
        }
    }
}

impl Remark {
    /// What a position is worth.
    #[must_use]
    pub fn of_validity(validity: Validity) -> Self {
        let (tone, text) = match validity {
            Validity::Aligning => (Tone::Idle, "no position yet"),
            Validity::HeadingUnknown => (
                Tone::Warn,
                "fixes are used; the heading is not known, or the fixes disagree with it",
            ),
            Validity::Aided => (Tone::Good, "fixes are used"),
            Validity::DeadReckoning => (Tone::Warn, "dead reckoning: no fix is used"),
            Validity::Invalid => (
                Tone::Bad,
                "the position is invalid: no fix for too long, or its stated error is too large",
            ),
        };
        Self::new(tone, text)
    }
}

/// The lamp of one sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Lamp {
    /// The sensor.
    pub sensor: SensorKind,
    /// Its colour.
    pub tone: Tone,
    /// What is the matter, or that nothing is.
    pub text: String,
    /// Mean NIS of the window; `None` with nothing to judge.
    pub nis_mean: Option<f64>,
    /// What it is when the stated noise is consistent: the degrees of freedom.
    pub nis_expected: Option<u8>,
}

impl Lamp {
    /// One that judges nothing, for this reason.
    pub fn idle(sensor: SensorKind, text: &str) -> Self {
        Self {
            sensor,
            tone: Tone::Idle,
            text: text.to_owned(),
            nis_mean: None,
            nis_expected: None,
        }
    }
}

/// The innovations of the last 250 to 500 samples of one sensor.
#[derive(Debug, Clone)]
pub struct LampWindow {
    sensor: SensorKind,
    correlation_time_s: f64,
    /// Whether the values lie on a grid that is coarser than what is expected of a residual.
    is_coarse: bool,
    old: (NisStatistics, UpdateCounts),
    new: (NisStatistics, UpdateCounts),
    count: u32,
    lamp: Option<Lamp>,
}

impl LampWindow {
    /// An empty window; the filter takes the sensor's errors to stay alike for `correlation_time_s`.
    #[must_use]
    pub fn new(sensor: SensorKind, correlation_time_s: f64) -> Self {
        Self {
            sensor,
            correlation_time_s,
            is_coarse: false,
            old: Default::default(),
            new: Default::default(),
            count: 0,
            lamp: None,
        }
    }

    /// Takes one innovation of a sensor whose values lie on a grid of this `step`, if on any.
    pub fn add(&mut self, innovation: &Innovation<f64>, step: Option<f64>) {
        if innovation.degrees_of_freedom == 0 {
            return;
        }
        let expected = innovation.residual_std().mean();
        self.is_coarse = step.is_some_and(|step| step > expected);
        // Both windows see it; the older one is read until the newer is half full.
        for (nis, counts) in [&mut self.old, &mut self.new] {
            nis.add(innovation);
            counts.add(innovation.outcome);
        }
        self.count += 1;
        if self.count.is_multiple_of(RENEW) || self.lamp.is_none() {
            self.lamp = self.judge();
        }
        if self.count >= HALF {
            self.old = std::mem::take(&mut self.new);
            self.count = 0;
        }
    }

    /// The lamp; `None` before there was anything to look at.
    #[must_use]
    pub fn lamp(&self) -> Option<&Lamp> {
        self.lamp.as_ref()
    }

    fn judge(&self) -> Option<Lamp> {
        let nis = self.old.0.summary()?;
        let verdict = judge(
            self.sensor,
            &nis,
            &self.old.1,
            JudgeBy {
                correlation_time_s: self.correlation_time_s,
                is_coarse: self.is_coarse,
            },
        );
        let tone = match verdict.verdict {
            NoiseVerdict::Consistent => Tone::Good,
            NoiseVerdict::TooSmall => Tone::Bad,
            NoiseVerdict::Undetermined => Tone::Info,
            NoiseVerdict::TooFew => Tone::Idle,
            _ => Tone::Warn,
        };
        Some(Lamp {
            sensor: self.sensor,
            tone,
            text: verdict.sentences.join(" "),
            nis_mean: (tone != Tone::Idle).then_some(nis.mean),
            nis_expected: Some(nis.degrees_of_freedom),
        })
    }
}
