//! Excursions: spells in which the innovations of a sensor leave their bounds, and what began them.
//!
//! One sample in a hundred lies beyond the 99 % bound of chi-square by chance, alone. An excursion begins with a
//! few of them close together and lasts until they come no more often than chance lets them. What was met just before
//! it began is taken as its cause.

use northing_core::kalman::Innovation;

use crate::statistics::nis::chi_square_quantile;

/// Something that makes innovations leave their bounds, in the order in which a user should act.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Condition {
    /// The gyroscope had a hole.
    Hole,
    /// The gyroscope was at the end of its range.
    GyroscopeSaturated,
    /// The accelerometer was at the end of its range.
    AccelerometerSaturated,
    /// The magnetometer was at the end of its range.
    MagnetometerSaturated,
    /// The strength of the field was not the usual one.
    Disturbed,
    /// The length of the specific force was not that of gravity.
    Accelerated,
}

/// How many there are.
const CONDITIONS: usize = 6;

/// When each condition was last met, ns.
#[derive(Debug, Clone, Default)]
pub struct Met([Option<i64>; CONDITIONS]);

impl Met {
    /// Notes that a condition is met now.
    pub fn note(&mut self, condition: Condition, is_met: bool, time_ns: i64) {
        if is_met {
            self.0[condition as usize] = Some(time_ns);
        }
    }

    /// The first condition, in the order in which one should act, that was met within `seconds` before.
    fn within(&self, time_ns: i64, seconds: f64) -> Option<Condition> {
        use Condition::{
            Accelerated, AccelerometerSaturated, Disturbed, GyroscopeSaturated, Hole,
            MagnetometerSaturated,
        };
        let all = [
            Hole,
            GyroscopeSaturated,
            AccelerometerSaturated,
            MagnetometerSaturated,
            Disturbed,
            Accelerated,
        ];
        all.into_iter().find(|condition| {
            let met = self.0[*condition as usize];
            met.is_some_and(|at| time_ns.saturating_sub(at) as f64 * 1e-9 <= seconds)
        })
    }
}

/// A sample beyond the 99 % bound counts so much, one within takes this away; ...
const BEYOND: f64 = 1.0;
const WITHIN: f64 = 0.1;
/// ... an excursion begins here, ends at zero, and is not held open for longer by more than this.
const BEGINS: f64 = 2.5;
const MOST: f64 = 6.0;
/// What was met so long before an excursion began may have caused it, s.
const BEFORE_S: f64 = 1.0;

/// How many samples an excursion's cause explains.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Explained {
    /// Excursions.
    pub excursions: u32,
    /// Samples beyond the 99 % bound in them.
    pub beyond: u64,
    /// When the first began, ns.
    pub first_ns: Option<i64>,
}

impl Explained {
    fn take(&mut self, more: &Self) {
        self.excursions += more.excursions;
        self.beyond += more.beyond;
        self.first_ns = self.first_ns.or(more.first_ns);
    }
}

/// The excursions of one sensor.
#[derive(Debug, Clone, Default)]
pub struct Excursions {
    bound: Option<(u8, f64)>,
    level: f64,
    open: Option<Option<Condition>>,
    by: [Explained; CONDITIONS],
    unknown: Explained,
    /// The present one.
    pending: Explained,
    beyond: u64,
    samples: u64,
    last_beyond: Option<Condition>,
}

impl Excursions {
    /// Takes an innovation, what was met before, and what its own sample shows. Returns whether a condition explains it.
    pub fn add(
        &mut self,
        time_ns: i64,
        innovation: &Innovation<f64>,
        met: &Met,
        own: Option<Condition>,
    ) -> bool {
        let dof = innovation.degrees_of_freedom;
        let bound = match self.bound {
            Some((known, bound)) if known == dof => bound,
            _ => chi_square_quantile(dof, 0.99),
        };
        self.bound = Some((dof, bound));
        self.samples += 1;
        let is_beyond = innovation.nis > bound;
        self.beyond += u64::from(is_beyond);
        let step = if is_beyond { BEYOND } else { -WITHIN };
        self.level = (self.level + step).clamp(0.0, MOST);
        if is_beyond && own.is_some() {
            self.last_beyond = own;
        }
        if self.open.is_none() && self.level >= BEGINS {
            let cause = met.within(time_ns, BEFORE_S).or(self.last_beyond);
            self.open = Some(cause);
            self.pending = Explained {
                excursions: 1,
                beyond: 0,
                first_ns: Some(time_ns),
            };
            let begun = self.pending;
            self.explained_mut(cause).take(&begun);
        }
        if self.level <= 0.0 {
            self.open = None;
            self.last_beyond = None;
        }
        if self.open == Some(None) && own.is_some() {
            // What began it shows itself only now.
            self.attribute(own);
        }
        if let Some(cause) = self.open {
            self.pending.beyond += u64::from(is_beyond);
            self.explained_mut(cause).beyond += u64::from(is_beyond);
            return cause.is_some();
        }
        // A single sample that shows its own reason is explained by it.
        let alone = is_beyond && own.is_some();
        if alone {
            self.explained_mut(own).beyond += 1;
        }
        alone
    }

    /// Gives the present excursion, whose cause was not known, to one.
    fn attribute(&mut self, cause: Option<Condition>) {
        let pending = self.pending;
        self.unknown.excursions -= pending.excursions;
        self.unknown.beyond -= pending.beyond;
        self.open = Some(cause);
        self.explained_mut(cause).take(&pending);
    }

    fn explained_mut(&mut self, cause: Option<Condition>) -> &mut Explained {
        match cause {
            Some(condition) => &mut self.by[condition as usize],
            None => &mut self.unknown,
        }
    }

    /// What a condition explains.
    #[must_use]
    pub fn explained_by(&self, condition: Condition) -> Explained {
        self.by[condition as usize]
    }

    /// Excursions without a known cause.
    #[must_use]
    pub fn unknown(&self) -> Explained {
        self.unknown
    }

    /// Share of the samples that lie beyond the 99 % bound.
    #[must_use]
    pub fn share_beyond(&self) -> f64 {
        self.beyond as f64 / self.samples.max(1) as f64
    }

    /// Share of the samples beyond the bound that a condition explains; 0 where chance explains all of them.
    #[must_use]
    pub fn share_explained_by(&self, condition: Condition) -> f64 {
        let by_chance = 0.01 * self.samples as f64;
        let excess = self.beyond as f64 - by_chance;
        if excess <= 3.0 * by_chance.sqrt().max(1.0) {
            return 0.0;
        }
        (self.explained_by(condition).beyond as f64 / excess).min(1.0)
    }
}
