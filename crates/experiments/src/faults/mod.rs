//! Fault campaign: what a fault of a sensor costs every estimator, how soon it recovers, and whether it is consistent afterwards.
//!
//! A [`Campaign`] lays each fault of the catalogue (`northing_simulation::fault_injection`) over clean [`Stream`]s: simulated worlds
//! with healthy sensors, and recordings. Every estimator runs on the clean stream and on each faulty one; the difference is the fault.
//! Attitude and navigation are judged by the same rules (`judge.rs`); a [`CampaignOutcome`] has a row a fault and estimator.
//!
//! # What is scored
//!
//! Ten times a second from five seconds on. Attitude: the angle of the whole error, its NEES with three degrees of freedom; without anything
//! that says where north is, the tilt, and the NEES of tilt and heading's drift. Navigation: the horizontal error against the truth or, on
//! recordings without a reference, against every other fix, which the estimator is not given.
//!
//! # Limits
//!
//! - One bad sample costs at most [1.2 times](MOST_COST) the root mean square of the clean run.
//! - After any other fault the error is within [5 deg](RECOVERED_DEG), or within [three times](RECOVERED_RATIO) the clean root mean
//!   square of the position, [ten seconds](RECOVERY_S) after samples are normal again, and stays there for a minute; a step of a bias
//!   stays, and counts from its beginning. The mean NEES per degree of freedom is below [3](MOST_NEES) in the minute after
//!   those ten seconds.
//!
//! **Detected** is a fault that is found in the right sensor within [ten seconds](RECOVERY_S) of its beginning; what is found in a clean run
//! is a **false alarm**.
//!
//! A run is not blamed for what the clean run has as well: an error within 1.2 times the clean error at the same instant is recovered,
//! and so is a NEES within 1.2 times the clean one. What states no covariance is judged by its error alone.

mod attitude;
mod judge;
mod navigation;
mod outcome;
mod stream;

pub use judge::{Detected, Instant, Judgement, Track};
pub use outcome::{AlarmRow, CampaignOutcome, FaultRow, Part};
pub use stream::{Origin, Stream};

use northing_evaluation::EstimatorKind;
use northing_evaluation::navigation::NavigationKind;
use northing_evaluation::registry::Question;
use northing_simulation::fault_injection::{CATALOGUE, InjectedFault, InjectionTarget, onset};
use northing_simulation::random::run_seed;
use rayon::prelude::*;

use crate::attitude_worlds::every_estimator;

/// One bad sample costs at most so many times the clean root mean square.
pub const MOST_COST: f64 = 1.2;
/// An attitude within this has recovered, deg.
pub const RECOVERED_DEG: f64 = 5.0;
/// A position within so many times the clean root mean square has recovered.
pub const RECOVERED_RATIO: f64 = 3.0;
/// So long an estimator has for it, s.
pub const RECOVERY_S: f64 = 10.0;
/// Mean NEES per degree of freedom after that.
pub const MOST_NEES: f64 = 3.0;

/// An estimator of either question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Subject {
    /// Of attitude.
    Attitude(EstimatorKind),
    /// Of position.
    Navigation(NavigationKind),
}

impl Subject {
    /// Every one that runs on sensor samples, the defaults first.
    #[must_use]
    pub fn every() -> Vec<Self> {
        let navigation = NavigationKind::ALL
            .into_iter()
            .filter(|kind| *kind != NavigationKind::Device);
        let attitude = every_estimator().into_iter().map(Self::Attitude);
        attitude.chain(navigation.map(Self::Navigation)).collect()
    }

    /// The one of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::every()
            .into_iter()
            .find(|subject| subject.name() == name)
    }

    /// All names, for messages.
    #[must_use]
    pub fn names() -> String {
        let names: Vec<_> = Self::every().into_iter().map(Self::name).collect();
        names.join(", ")
    }

    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Attitude(kind) => kind.name(),
            Self::Navigation(kind) => kind.name(),
        }
    }

    /// What it estimates.
    #[must_use]
    pub const fn question(self) -> Question {
        match self {
            Self::Attitude(_) => Question::Attitude,
            Self::Navigation(_) => Question::Navigation,
        }
    }

    /// What it makes of a stream; an estimator that cannot run has no instants.
    fn run(self, stream: &Stream, events: &[northing_recording::Event]) -> Track {
        match self {
            Self::Attitude(kind) => attitude::track(kind, stream, events),
            Self::Navigation(kind) => navigation::track(kind, stream, events),
        }
    }
}

/// Which faults, estimators and streams.
#[derive(Debug, Clone)]
pub struct Campaign {
    /// Seed of all that is drawn.
    pub seed: u64,
    /// So many simulated worlds of each question.
    pub runs: u64,
    /// The estimators.
    pub subjects: Vec<Subject>,
    /// The faults.
    pub faults: Vec<&'static InjectedFault>,
    /// Recordings, beside the worlds.
    pub recordings: Vec<Stream>,
}

/// A run that is drawn: the same estimator on the clean and on the faulty stream.
#[derive(Debug, Clone)]
pub struct DrawnRun {
    /// How it is judged.
    pub judgement: Judgement,
    /// Without the fault.
    pub clean: Track,
    /// With it.
    pub faulty: Track,
}

impl Campaign {
    /// Every fault and estimator over so many worlds.
    #[must_use]
    pub fn of_worlds(seed: u64, runs: u64) -> Self {
        Self {
            seed,
            runs,
            subjects: Subject::every(),
            faults: CATALOGUE.iter().collect(),
            recordings: Vec::new(),
        }
    }

    /// How many streams there are: steps of [`Self::run`].
    #[must_use]
    pub fn streams(&self) -> u64 {
        let questions = [Question::Attitude, Question::Navigation];
        let asked = questions
            .iter()
            .filter(|q| !self.of(**q).is_empty())
            .count() as u64;
        asked * self.runs + self.recordings.len() as u64
    }

    /// Runs it on all processors; `done` is called after each stream.
    #[must_use]
    pub fn run(&self, done: &(dyn Fn() + Sync)) -> CampaignOutcome {
        let questions = [Question::Attitude, Question::Navigation].into_iter();
        let asked = questions.filter(|question| !self.of(*question).is_empty());
        let worlds = asked.flat_map(|question| (0..self.runs).map(move |n| (question, n)));
        let worlds: Vec<_> = worlds.collect();
        let world = |(question, number): &(Question, u64)| {
            let judged = self.over(&Stream::world(*question, self.seed, *number));
            done();
            judged
        };
        let recording = |stream: &Stream| {
            let judged = self.over(stream);
            done();
            judged
        };
        let simulated = worlds.par_iter().flat_map_iter(world);
        let recorded = self.recordings.par_iter().flat_map_iter(recording);
        CampaignOutcome::of(self.seed, simulated.chain(recorded).collect())
    }

    /// One run again, with its errors over time; `None` where the judgement is not of this campaign.
    #[must_use]
    pub fn again(&self, judgement: &Judgement) -> Option<DrawnRun> {
        let stream = match judgement.origin {
            Origin::Simulated => Stream::world(judgement.question, self.seed, judgement.number),
            Origin::Recorded => {
                let mut recordings = self.recordings.iter();
                recordings
                    .find(|stream| stream.name == judgement.stream)?
                    .clone()
            }
        };
        let subject = Subject::named(judgement.estimator)?;
        let fault = InjectedFault::named(judgement.fault)?;
        let from_ns = onset(&stream.events, self.seed_of(&stream))?;
        let clean = subject.run(&stream, &stream.events);
        let (events, until_ns) = fault.inject(&stream.events, from_ns, self.seed_of(&stream));
        let faulty = subject.run(&stream, &events);
        Some(DrawnRun {
            judgement: Judgement::of(
                &stream,
                subject,
                fault,
                [from_ns, until_ns],
                [&clean, &faulty],
            ),
            clean,
            faulty,
        })
    }

    /// Why nothing would be run on a recording: none of the estimators is of its question, or none of the faults is of what it
    /// holds.
    #[must_use]
    pub fn without_run(&self, stream: &Stream) -> Option<String> {
        if self.of(stream.question).is_empty() {
            let (has, wanted, name) = match stream.question {
                Question::Navigation => ("fixes", "position", NavigationKind::ErrorState.name()),
                _ => ("no fixes", "attitude", EstimatorKind::Mekf.name()),
            };
            return Some(format!(
                "it has {has}, so estimators of the {wanted} run on it, and --estimator names none; add one, e.g. {name}, or \
                 leave --estimator or the recording out"
            ));
        }
        if self.faults.iter().any(|fault| applies(fault, stream)) {
            return None;
        }
        let known = CATALOGUE.iter().filter(|fault| applies(fault, stream));
        let known: Vec<_> = known.map(|fault| fault.name).collect();
        Some(format!(
            "none of the faults that --kind names can be laid over it; expected one of {}",
            known.join(", ")
        ))
    }

    fn of(&self, question: Question) -> Vec<Subject> {
        let of_question = |subject: &&Subject| subject.question() == question;
        self.subjects.iter().filter(of_question).copied().collect()
    }

    fn seed_of(&self, stream: &Stream) -> u64 {
        run_seed(self.seed, stream.number)
    }

    /// Every fault and estimator over one stream.
    fn over(&self, stream: &Stream) -> Vec<Judgement> {
        let subjects = self.of(stream.question);
        let seed = self.seed_of(stream);
        let Some(from_ns) = onset(&stream.events, seed) else {
            return Vec::new();
        };
        let clean: Vec<_> = subjects
            .par_iter()
            .map(|s| s.run(stream, &stream.events))
            .collect();
        let faults = self.faults.iter().filter(|fault| applies(fault, stream));
        let faults: Vec<_> = faults.collect();
        let one = |fault: &&&'static InjectedFault| {
            let (events, until_ns) = fault.inject(&stream.events, from_ns, seed);
            let judged = |(subject, clean): (&Subject, &Track)| {
                let faulty = subject.run(stream, &events);
                Judgement::of(
                    stream,
                    *subject,
                    fault,
                    [from_ns, until_ns],
                    [clean, &faulty],
                )
            };
            subjects.iter().zip(&clean).map(judged).collect::<Vec<_>>()
        };
        faults.par_iter().flat_map_iter(one).collect()
    }
}

/// Whether a fault can be laid over a stream.
fn applies(fault: &InjectedFault, stream: &Stream) -> bool {
    let navigation = stream.question == Question::Navigation;
    let simulated = stream.origin == Origin::Simulated;
    match fault.target {
        _ if fault.needs_simulation() => simulated && !navigation,
        InjectionTarget::Receiver => navigation,
        InjectionTarget::Magnetometer => !navigation && stream.has_north,
        _ => true,
    }
}
