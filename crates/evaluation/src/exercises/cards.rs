//! The cards: what each asks for.

use serde::{Deserialize, Serialize};

use super::checks;
use super::judgement::Judgement;
use super::work::Work;

/// How an answer is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum QuestionKind {
    /// A number.
    Number,
    /// One of several words.
    Choice,
}

/// One thing to answer. Its text is in the catalogue under `card.ID.NAME`, those of its choices under `card.ID.NAME.CHOICE`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Question {
    /// Its name.
    pub name: &'static str,
    /// How it is answered.
    pub kind: QuestionKind,
    /// The unit of a number.
    pub unit: &'static str,
    /// What can be chosen.
    pub choices: &'static [&'static str],
}

const fn number(name: &'static str, unit: &'static str) -> Question {
    Question {
        name,
        kind: QuestionKind::Number,
        unit,
        choices: &[],
    }
}

const fn choice(name: &'static str, choices: &'static [&'static str]) -> Question {
    Question {
        name,
        kind: QuestionKind::Choice,
        unit: "",
        choices,
    }
}

crate::named! {
    /// An exercise, in the order in which a course does them; its name in files and in the catalogue.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
    #[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
    #[serde(rename_all = "kebab-case")]
    pub enum Card {
        /// The experiment of the paper, steps 1 to 11.
        Experiment = "experiment",
        /// The bias of the gyroscope, within 0.02 deg/s of the calibration.
        Bias = "bias",
        /// Q and R with which the NIS of every sensor is consistent.
        Consistent = "consistent",
        /// Which angle suffers without magnetometer, and why.
        NoMagnetometer = "no-magnetometer",
        /// The rate at which "the gyroscope is continuous" fails.
        Rate = "rate",
        /// The gyroscope's scale error, from whole turns.
        Scale = "scale",
        /// When a magnet was near.
        Magnet = "magnet",
    }
}

impl Card {
    /// The minutes to plan for a student who does it for the first time.
    #[must_use]
    pub const fn minutes(self) -> u32 {
        match self {
            Self::Experiment => 15,
            Self::Bias | Self::NoMagnetometer | Self::Magnet => 10,
            Self::Consistent | Self::Rate => 15,
            Self::Scale => 20,
        }
    }

    /// What is to be answered.
    #[must_use]
    pub const fn questions(self) -> &'static [Question] {
        const EXPERIMENT: [Question; 3] = [
            number("calculated", "deg"),
            number("estimated", "deg"),
            choice("verdict", &["consistent", "overconfident", "conservative"]),
        ];
        const BIAS: [Question; 3] = [
            number("x", "deg/s"),
            number("y", "deg/s"),
            number("z", "deg/s"),
        ];
        const NO_MAGNETOMETER: [Question; 2] = [
            choice("axis", &["yaw", "pitch", "roll"]),
            choice("why", &["gravity", "gyroscope", "accelerometer"]),
        ];
        const RATE: [Question; 1] = [number("rate", "Hz")];
        const SCALE: [Question; 2] = [choice("axis", &["x", "y", "z"]), number("error", "%")];
        const MAGNET: [Question; 1] = [number("at", "s")];
        match self {
            Self::Experiment => &EXPERIMENT,
            Self::Bias => &BIAS,
            Self::Consistent => &[],
            Self::NoMagnetometer => &NO_MAGNETOMETER,
            Self::Rate => &RATE,
            Self::Scale => &SCALE,
            Self::Magnet => &MAGNET,
        }
    }

    /// What a question lets choose; nothing where it asks for a number, or there is none of this name.
    #[must_use]
    pub fn choices(self, name: &str) -> &'static [&'static str] {
        let mut questions = self.questions().iter();
        let question = questions.find(|question| question.name == name);
        question.map_or(&[], |question| question.choices)
    }

    /// Judges a work.
    #[must_use]
    pub fn check(self, work: &Work<'_>) -> Judgement {
        let mut judgement = Judgement::default();
        // Each check ends with the first thing that does not hold: what follows would be about something else.
        let _ = match self {
            Self::Experiment => checks::settings::experiment(work, &mut judgement),
            Self::Bias => checks::settings::bias(work, &mut judgement),
            Self::Consistent => checks::settings::consistent(work, &mut judgement),
            Self::NoMagnetometer => checks::settings::no_magnetometer(work, &mut judgement),
            Self::Rate => checks::samples::rate(work, &mut judgement),
            Self::Scale => checks::samples::scale(work, &mut judgement),
            Self::Magnet => checks::samples::magnet(work, &mut judgement),
        };
        judgement.closed()
    }
}
