//! Consistency of stated noise: a verdict in words for each sensor, from its NIS.
//!
//! When the covariance `S` that a filter expects of its residuals is right, the NIS is chi-square
//! distributed. Its median tells by which factor the bulk of the residuals is larger than stated,
//! unmoved by outliers and by a gate; its mean and its tails tell of outliers; its correlation from
//! one sample to the next tells whether white noise is the right picture at all. As `S` is mostly
//! the sensor's `R` once a filter has settled, that factor is named as the factor of `R`.
//!
//! Values on a grid coarser than the noise have no such distribution: NIS takes a few values, and its median is one of
//! them. They are judged by the mean. What explains innovations better than R is found by
//! [`verdict`](super::verdict), and named first.

use northing_recording::SensorKind;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use crate::statistics::nis::{NisSummary, UpdateCounts, chi_square_quantile};

/// What the NIS of a sensor says about its stated noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum NoiseVerdict {
    /// Residuals are about as large as stated.
    Consistent,
    /// The bulk of the residuals is larger than stated.
    TooSmall,
    /// The bulk of the residuals is smaller than stated.
    TooLarge,
    /// The bulk is as stated, but far more samples than chance allows are far out.
    Outliers,
    /// The residuals say nothing about R: they are alike from one sample to the next for so long, or their values lie on a
    /// grid that hides the noise.
    Undetermined,
    /// Too few samples to tell.
    TooFew,
}

/// The verdict on one sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct SensorVerdict {
    /// The sensor.
    pub sensor: SensorKind,
    /// The verdict in a word.
    pub verdict: NoiseVerdict,
    /// By how much the variance of the bulk of the residuals differs from what was stated: 9 means
    /// that `R` is about 9 times too small. `None` with too few samples.
    pub variance_factor: Option<f64>,
    /// The mean NIS that it is judged by: of the samples that nothing else explains.
    #[serde(skip)]
    #[cfg_attr(feature = "typescript", ts(skip))]
    pub mean_nis: f64,
    /// 0 to 1: one less the probability that a consistent R shows as large a mean NIS by chance; for a consistent R that
    /// probability.
    pub confidence: f64,
    /// 95 % band of the mean NIS for consistent noise, widened for the residuals' correlation.
    pub mean_nis_band: [f64; 2],
    /// The verdict in sentences, the most important first.
    pub sentences: Vec<String>,
}

/// Below this many samples nothing is said.
const FEWEST_SAMPLES: u64 = 30;
/// A variance this many times off is still called consistent: 12 % of the standard deviation.
const CONSISTENT_FACTOR: f64 = 1.25;
/// Correlation from one residual to the next above which white noise is the wrong picture.
const STRONG_CORRELATION: f64 = 0.5;
/// Independent samples that a mean NIS must be worth before correlated residuals are judged by it.
const FEWEST_INDEPENDENT: f64 = 10.0;
/// Share of refused samples above which the gate is named.
const LARGE_GATED_SHARE: f64 = 0.05;

/// A mean NEES per degree of freedom between these is called consistent: a standard deviation that is
/// right within 30 %.
const CONSISTENT_NEES: [f64; 2] = [1.0 / 1.7, 1.7];

/// Whether a mean NEES per degree of freedom is consistent.
#[must_use]
pub fn is_consistent_nees(nees: f64) -> bool {
    (CONSISTENT_NEES[0]..=CONSISTENT_NEES[1]).contains(&nees)
}

/// A mean NEES per degree of freedom in words: whether the covariance is consistent.
#[must_use]
pub fn nees_in_words(nees: f64) -> String {
    let [low, high] = CONSISTENT_NEES;
    let verdict = if nees > high {
        format!(
            "the stated uncertainty is about {:.1} times too small",
            nees.sqrt()
        )
    } else if nees < low {
        format!(
            "the stated uncertainty is about {:.1} times too large",
            nees.sqrt().recip()
        )
    } else {
        "the stated uncertainty is consistent".to_owned()
    };
    format!("mean NEES {nees:.2} per degree of freedom (1 is ideal): {verdict}")
}

/// What is known of a sensor beside its NIS.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JudgeBy {
    /// How long its errors are already taken to last, s.
    pub correlation_time_s: f64,
    /// Whether its values lie on a grid that is coarser than the noise stated.
    pub is_coarse: bool,
}

/// Judges one sensor.
#[must_use]
pub fn judge(
    sensor: SensorKind,
    nis: &NisSummary,
    counts: &UpdateCounts,
    by: JudgeBy,
) -> SensorVerdict {
    let correlation_time_s = by.correlation_time_s;
    let band = mean_band(nis);
    let median = chi_square_quantile(nis.degrees_of_freedom, 0.5);
    let factor = match by.is_coarse {
        true => nis.mean / f64::from(nis.degrees_of_freedom.max(1)),
        false => nis.median / median,
    };
    let verdict = match classify(nis, factor, band) {
        // A value that repeats says nothing of the noise below its step.
        NoiseVerdict::TooLarge if by.is_coarse => NoiseVerdict::Undetermined,
        verdict => verdict,
    };
    let enough = verdict != NoiseVerdict::TooFew;
    let mut sentences = vec![main_sentence(sensor, nis, verdict, factor, by.is_coarse)];
    if enough && is_correlated(nis) && verdict != NoiseVerdict::Undetermined {
        sentences.push(correlation_sentence(sensor, nis, correlation_time_s));
    }
    if enough && counts.gated_share() > LARGE_GATED_SHARE {
        sentences.push(format!(
            "Its gate refuses {:.0} % of the samples, where a consistent filter refuses 1 %: \
             either its noise is larger than stated, or it was disturbed that often.",
            100.0 * counts.gated_share()
        ));
    }
    SensorVerdict {
        sensor,
        verdict,
        variance_factor: (enough && verdict != NoiseVerdict::Undetermined).then_some(factor),
        mean_nis: nis.mean,
        confidence: confidence(nis, verdict),
        mean_nis_band: band,
        sentences,
    }
}

/// A standard deviation off by more than this factor is named where errors are known to last, as those of fixes do.
const FAR_OFF: f64 = 2.0;

/// What the NIS of an aid of a navigation filter says, where its residuals are far from what was expected of them; `None`
/// otherwise, and with too few samples to tell.
#[must_use]
pub fn aid_in_words(name: &str, nis: &NisSummary) -> Option<String> {
    let [low, high] = mean_band(nis);
    let off = (nis.mean / f64::from(nis.degrees_of_freedom.max(1))).sqrt();
    let is_far = !(1.0 / FAR_OFF..=FAR_OFF).contains(&off);
    if nis.samples < FEWEST_SAMPLES || (low..=high).contains(&nis.mean) || !is_far {
        return None;
    }
    let (times, which) = if off > 1.0 {
        (off, "larger")
    } else {
        (off.recip(), "smaller")
    };
    Some(format!(
        "The residuals of {name} are about {} times {which} than the filter expects: mean NIS {} for {}.",
        rounded(times),
        significant(nis.mean),
        degrees_of_freedom(nis)
    ))
}

/// Two figures, however small.
fn significant(value: f64) -> String {
    let digits = (1.0 - value.abs().max(1e-12).log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.digits$}")
}

fn is_correlated(nis: &NisSummary) -> bool {
    nis.lag1_autocorrelation > STRONG_CORRELATION
}

fn classify(nis: &NisSummary, factor: f64, [low, high]: [f64; 2]) -> NoiseVerdict {
    let consistent = 1.0 / CONSISTENT_FACTOR..=CONSISTENT_FACTOR;
    let mean_factor = nis.mean / f64::from(nis.degrees_of_freedom.max(1));
    let in_band = (low..=high).contains(&nis.mean);
    if nis.samples < FEWEST_SAMPLES {
        NoiseVerdict::TooFew
    } else if factor <= CONSISTENT_FACTOR && nis.mean > high && mean_factor > CONSISTENT_FACTOR {
        // The bulk is no larger than stated.
        NoiseVerdict::Outliers
    } else if is_correlated(nis) && nis.effective_samples < FEWEST_INDEPENDENT && in_band {
        // The band is so wide that it excuses anything.
        NoiseVerdict::Undetermined
    } else if in_band || consistent.contains(&factor) || consistent.contains(&mean_factor) {
        NoiseVerdict::Consistent
    } else if mean_factor > 1.0 {
        NoiseVerdict::TooSmall
    } else {
        NoiseVerdict::TooLarge
    }
}

/// 95 % band of a mean of NIS values that are worth [`NisSummary::effective_samples`] independent ones.
fn mean_band(nis: &NisSummary) -> [f64; 2] {
    let dof = f64::from(nis.degrees_of_freedom.max(1));
    let total = nis.effective_samples.max(1.0) * dof;
    let bounds = match ChiSquared::new(total) {
        Ok(sum) if total < 1e4 => [0.025, 0.975].map(|p| sum.inverse_cdf(p) / total),
        // A sum of so many is normal to all figures that matter.
        _ => [-1.96, 1.96].map(|z: f64| 1.0 + z * (2.0 / total).sqrt()),
    };
    bounds.map(|ratio| dof * ratio)
}

/// Of a verdict, from how likely a mean NIS as far off is.
fn confidence(nis: &NisSummary, verdict: NoiseVerdict) -> f64 {
    let dof = f64::from(nis.degrees_of_freedom.max(1));
    let total = nis.effective_samples.max(1.0) * dof;
    let below = ChiSquared::new(total).map_or(0.5, |sum| sum.cdf(nis.mean / dof * total));
    let by_chance = 2.0 * below.min(1.0 - below);
    match verdict {
        NoiseVerdict::Consistent => by_chance,
        NoiseVerdict::TooFew => 0.0,
        _ => 1.0 - by_chance,
    }
}

fn main_sentence(
    sensor: SensorKind,
    nis: &NisSummary,
    verdict: NoiseVerdict,
    factor: f64,
    is_coarse: bool,
) -> String {
    let name = sensor.name();
    let your = if is_correlated(nis) {
        "Sample by sample, your"
    } else {
        "Your"
    };
    match verdict {
        NoiseVerdict::TooFew => format!(
            "Only {} {name} sample(s) were used: too few to judge its R.",
            nis.samples
        ),
        NoiseVerdict::Consistent => format!(
            "{your} {name} R is consistent: the mean NIS is {:.2} for {}.",
            nis.mean,
            degrees_of_freedom(nis)
        ),
        NoiseVerdict::TooSmall => format!(
            "{your} {name} R is about {} times too small \
             (its standard deviation should be about {} times larger).",
            rounded(factor),
            rounded(factor.sqrt())
        ),
        NoiseVerdict::TooLarge => format!(
            "{your} {name} R is about {} times too large \
             (its standard deviation should be about {} times smaller).",
            rounded(1.0 / factor),
            rounded((1.0 / factor).sqrt())
        ),
        NoiseVerdict::Undetermined if is_coarse => format!(
            "Your {name} R cannot be judged from below: the values come in steps that hide a smaller noise (mean NIS {:.2} for {}).",
            nis.mean,
            degrees_of_freedom(nis)
        ),
        NoiseVerdict::Undetermined => format!(
            "Your {name} R cannot be judged: its residuals are strongly correlated ({:.2} from one sample to the next), so {} of \
             them are worth {:.0}. Such errors last, and no R is consistent for them.",
            nis.lag1_autocorrelation, nis.samples, nis.effective_samples
        ),
        NoiseVerdict::Outliers => format!(
            "{your} {name} R fits the bulk of the samples, but {:.1} % of them lie beyond the 99 % \
             bound, where 1 % should: disturbances, which a gate keeps out and a larger R does not.",
            100.0 * nis.share_above_99
        ),
    }
}

fn degrees_of_freedom(nis: &NisSummary) -> String {
    match nis.degrees_of_freedom {
        1 => "1 degree of freedom".to_owned(),
        n => format!("{n} degrees of freedom"),
    }
}

fn correlation_sentence(sensor: SensorKind, nis: &NisSummary, correlation_time_s: f64) -> String {
    let parameter = match sensor {
        SensorKind::Accelerometer => "accelerometer_correlation_time_s",
        SensorKind::CompassHeading => "compass_correlation_time_s",
        _ => "magnetometer_correlation_time_s",
    };
    let start = format!(
        "But its residuals are strongly correlated ({:.2} from one sample to the next): errors that \
         last are no white noise, and no R is consistent for them",
        nis.lag1_autocorrelation
    );
    if correlation_time_s > 0.0 {
        format!("{start}; {parameter} = {correlation_time_s} allows for it.")
    } else {
        format!("{start}: the covariance is too small. State how long they last: {parameter}.")
    }
}

/// Two figures, so that an estimate does not look exact.
fn rounded(value: f64) -> String {
    let decimals = if value < 9.95 { 1 } else { 0 };
    let text = format!("{value:.decimals$}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::nis::tests::{innovation, of_noise};
    use northing_core::kalman::Outcome;
    use northing_simulation::random::{normal_vector, stream};

    fn verdict(samples: u32, std: f64, correlation: f64) -> SensorVerdict {
        let nis = of_noise(samples, std, correlation).summary().unwrap();
        judge(
            SensorKind::Accelerometer,
            &nis,
            &UpdateCounts::default(),
            JudgeBy::default(),
        )
    }

    #[test]
    fn a_stated_std_three_times_too_small_is_named_nine_times() {
        let verdict = verdict(20_000, 3.0, 0.0);
        assert_eq!(verdict.verdict, NoiseVerdict::TooSmall);
        let factor = verdict.variance_factor.unwrap();
        assert!((factor / 9.0 - 1.0).abs() < 0.05, "{factor}");
        let sentence = &verdict.sentences[0];
        assert!(
            sentence.starts_with("Your accelerometer R is about "),
            "{sentence}"
        );
        assert!(sentence.contains("times too small") && sentence.contains("about 3 times larger"));
        assert_eq!(verdict.sentences.len(), 1);
    }

    #[test]
    fn a_stated_std_twice_too_large_is_named() {
        let verdict = verdict(20_000, 0.5, 0.0);
        assert_eq!(verdict.verdict, NoiseVerdict::TooLarge);
        assert!(
            verdict.sentences[0].contains("about 2 times smaller"),
            "{:?}",
            verdict.sentences
        );
    }

    #[test]
    fn white_noise_as_stated_is_consistent() {
        let verdict = verdict(20_000, 1.0, 0.0);
        assert_eq!(verdict.verdict, NoiseVerdict::Consistent);
        let [low, high] = verdict.mean_nis_band;
        // 3 +- 1.96 sqrt(6 / 20000)
        assert!(
            (low - 2.966).abs() < 0.002 && (high - 3.034).abs() < 0.002,
            "{low} {high}"
        );
        assert_eq!(verdict.sentences.len(), 1, "{:?}", verdict.sentences);
    }

    #[test]
    fn correlation_widens_the_band_and_is_said() {
        let white = verdict(2000, 1.0, 0.0);
        let lasting = verdict(2000, 1.0, 0.95);
        let width = |v: &SensorVerdict| v.mean_nis_band[1] - v.mean_nis_band[0];
        // sqrt((1 + 0.9025) / (1 - 0.9025)) = 4.4
        let ratio = width(&lasting) / width(&white);
        assert!((3.6..5.4).contains(&ratio), "{ratio}");
        assert!(lasting.sentences[1].ends_with("last: accelerometer_correlation_time_s."));
        let nis = of_noise(2000, 1.0, 0.95).summary().unwrap();
        let stated = judge(
            SensorKind::Accelerometer,
            &nis,
            &UpdateCounts::default(),
            JudgeBy {
                correlation_time_s: 0.5,
                ..JudgeBy::default()
            },
        );
        assert!(
            stated.sentences[1].contains("time_s = 0.5 allows for it"),
            "{stated:?}"
        );
    }

    #[test]
    fn disturbed_samples_do_not_blame_r() {
        let mut noise = stream(5, "nis");
        let mut statistics = crate::statistics::nis::NisStatistics::default();
        let mut counts = UpdateCounts::default();
        for k in 0..5000 {
            let (std, outcome) = if k % 10 == 0 {
                (20.0, Outcome::Gated)
            } else {
                (1.0, Outcome::Fused)
            };
            statistics.add(&innovation(normal_vector(&mut noise, std), outcome));
            counts.add(outcome);
        }
        let nis = statistics.summary().unwrap();
        let verdict = judge(SensorKind::Magnetometer, &nis, &counts, JudgeBy::default());
        assert_eq!(verdict.verdict, NoiseVerdict::Outliers);
        assert!(
            verdict.sentences[0].contains("beyond the 99 % bound"),
            "{:?}",
            verdict.sentences
        );
        assert!(
            verdict.sentences[1].contains("refuses 10 %"),
            "{:?}",
            verdict.sentences
        );
    }

    #[test]
    fn a_handful_of_samples_is_not_judged() {
        let verdict = verdict(20, 3.0, 0.0);
        assert_eq!(
            (verdict.verdict, verdict.variance_factor),
            (NoiseVerdict::TooFew, None)
        );
        assert_eq!(verdict.sentences.len(), 1);
    }

    #[test]
    fn factors_are_rounded_to_two_figures() {
        assert_eq!(
            [1.26, 3.02, 9.04, 12.4].map(rounded),
            ["1.3", "3", "9", "12"]
        );
    }

    #[test]
    fn an_aid_far_from_what_is_expected_of_it_is_named() {
        let of = |std| of_noise(500, std, 0.0).summary().unwrap();
        assert_eq!(aid_in_words("gnss-position", &of(1.0)), None);
        assert_eq!(aid_in_words("gnss-position", &of(0.7)), None);
        let small = aid_in_words("gnss-position", &of(0.07)).unwrap();
        assert!(
            small.contains("about 14 times smaller") && small.contains("mean NIS 0.015 for 3"),
            "{small}"
        );
        let large = aid_in_words("gnss-velocity", &of(5.0)).unwrap();
        assert!(
            large.contains("times larger than the filter expects"),
            "{large}"
        );
    }

    #[test]
    fn an_uncertainty_three_times_too_small_is_called_so() {
        assert!(nees_in_words(9.0).contains("3.0 times too small") && !is_consistent_nees(9.0));
        assert!(nees_in_words(0.25).contains("2.0 times too large") && !is_consistent_nees(0.25));
        assert!(nees_in_words(1.1).ends_with("consistent") && is_consistent_nees(1.1));
    }
}
