//! Sensor faults: a wrapper that takes what a sensor would have said and gives what arrives.
//!
//! A fault acts between two instants. It draws nothing, so a run with a fault differs from the run
//! without it by that fault alone.

use serde::{Deserialize, Serialize};

/// What happens to a sample.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum FaultKind {
    /// It is lost.
    Drop,
    /// It repeats the last one from before the fault.
    Freeze,
    /// Its first component is not a number.
    NotANumber,
    /// These are added to its components, in the sensor's unit; missing ones are zero.
    Offset {
        /// What is added.
        value: Vec<f64>,
    },
    /// All components are multiplied.
    Scale {
        /// By what.
        factor: f64,
    },
}

/// A fault and when it acts.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// What happens.
    pub kind: FaultKind,
    /// From when on, s.
    pub from_s: f64,
    /// Until when, s; not included.
    pub until_s: f64,
}

/// A sensor's faults, in the order in which they act.
#[derive(Debug, Clone, Default)]
pub struct FaultInjector<const N: usize> {
    faults: Vec<Fault>,
    last_good: Option<[f64; N]>,
}

impl<const N: usize> FaultInjector<N> {
    /// Wraps a sensor in these faults.
    #[must_use]
    pub fn new(faults: Vec<Fault>) -> Self {
        Self {
            faults,
            last_good: None,
        }
    }

    /// What arrives of the sample of `t_s`; `None` when it is lost.
    pub fn apply(&mut self, t_s: f64, mut sample: [f64; N]) -> Option<[f64; N]> {
        let mut acted = false;
        for fault in &self.faults {
            if !(fault.from_s..fault.until_s).contains(&t_s) {
                continue;
            }
            acted = true;
            match &fault.kind {
                FaultKind::Drop => return None,
                FaultKind::Freeze => sample = self.last_good.unwrap_or(sample),
                FaultKind::NotANumber => {
                    if let Some(first) = sample.first_mut() {
                        *first = f64::NAN;
                    }
                }
                FaultKind::Offset { value } => {
                    for (x, add) in sample.iter_mut().zip(value) {
                        *x += add;
                    }
                }
                FaultKind::Scale { factor } => sample = sample.map(|x| x * factor),
            }
        }
        if !acted {
            self.last_good = Some(sample);
        }
        Some(sample)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(kind: FaultKind) -> FaultInjector<2> {
        FaultInjector::new(vec![Fault {
            kind,
            from_s: 2.0,
            until_s: 4.0,
        }])
    }

    fn outputs(mut injector: FaultInjector<2>) -> Vec<Option<[f64; 2]>> {
        (0..6)
            .map(|k| injector.apply(f64::from(k), [f64::from(k), 10.0]))
            .collect()
    }

    #[test]
    fn a_fault_acts_in_its_time_and_not_outside() {
        let clean = outputs(FaultInjector::default());
        assert_eq!(clean[3], Some([3.0, 10.0]));
        for (kind, expected) in [
            (FaultKind::Drop, None),
            (FaultKind::Freeze, Some([1.0, 10.0])),
            (FaultKind::Offset { value: vec![0.5] }, Some([3.5, 10.0])),
            (FaultKind::Scale { factor: 2.0 }, Some([6.0, 20.0])),
        ] {
            let faulty = outputs(fault(kind));
            assert_eq!(faulty[3], expected);
            assert_eq!([&faulty[..2], &faulty[4..]], [&clean[..2], &clean[4..]]);
        }
        let nan = outputs(fault(FaultKind::NotANumber))[2].unwrap();
        assert!(nan[0].is_nan() && !nan[1].is_nan());
    }
}
