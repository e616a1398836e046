//! Bags whose topics were not written in the order of their stamps: each is read by itself, and all are merged by their stamps.
//!
//! A converter may write one topic after the other, and a receiver's fix is logged a tenth of a second after the instant that
//! its stamp says. Nothing but one event of each topic is kept in memory, whatever the order; the file is read
//! once for each topic that is used.

use super::ros_source::Read;
use crate::error::{Result, join};
use crate::event::{Event, SensorKind};
use crate::false_stamps::FalseStamps;
use crate::issues::Issues;
use crate::merge::Merged;
use crate::recording::EventSource;

const KINDS: usize = SensorKind::ALL.len();

/// What a first reading of all events shows.
#[derive(Debug, Default)]
struct Survey {
    latest_ns: Option<i64>,
    of_kind: [OfKind; KINDS],
}

#[derive(Debug, Default, Clone, Copy)]
struct OfKind {
    latest_ns: Option<i64>,
    /// Stamps that are earlier than one before them of the same sensor.
    back: u64,
    /// The same of any sensor.
    behind: u64,
    /// By how much at most, ns.
    most_behind_ns: i64,
}

impl Survey {
    /// Looks at all events, but for those with false stamps.
    fn of(source: impl EventSource) -> Result<Self> {
        let (mut source, mut issues) = (FalseStamps::new(source), Issues::default());
        let mut survey = Self::default();
        while let Some(event) = source.next_event(&mut issues)? {
            survey.take(&event);
        }
        Ok(survey)
    }

    fn take(&mut self, event: &Event) {
        let now = event.time_ns;
        let of_kind = &mut self.of_kind[event.sample.kind().order()];
        let latest = of_kind.latest_ns.unwrap_or(now);
        of_kind.back += u64::from(now < latest);
        of_kind.latest_ns = Some(now.max(latest));
        let latest = self.latest_ns.unwrap_or(now);
        let behind = latest.saturating_sub(now);
        of_kind.behind += u64::from(behind > 0);
        of_kind.most_behind_ns = of_kind.most_behind_ns.max(behind);
        self.latest_ns = Some(now.max(latest));
    }

    fn kinds(&self) -> impl Iterator<Item = (SensorKind, OfKind)> {
        let kinds = SensorKind::ALL.into_iter();
        kinds.map(|kind| (kind, self.of_kind[kind.order()]))
    }

    fn sensors(&self) -> Vec<SensorKind> {
        let seen = self.kinds().filter(|(_, of)| of.latest_ns.is_some());
        seen.map(|(kind, _)| kind).collect()
    }

    /// What there is to tell where fewer stamps go back when each topic is read by itself.
    fn disorder(&self) -> Option<String> {
        let apart = self.kinds().filter(|(_, of)| of.back < of.behind);
        let apart: Vec<String> = apart
            .map(|(kind, of)| {
                let behind_s = of.most_behind_ns as f64 * 1e-9;
                format!("{} (by up to {behind_s:.3} s)", kind.name())
            })
            .collect();
        (!apart.is_empty()).then(|| {
            format!(
                "Logged behind later stamps of other topics: {}; the topics are merged by their stamps.",
                join(apart.iter().map(String::as_str))
            )
        })
    }
}

/// A bag as its events.
pub(super) struct InOrder {
    pub(super) sensors: Vec<SensorKind>,
    pub(super) source: Box<dyn EventSource>,
    /// What there is to tell of the order.
    pub(super) note: Option<String>,
}

/// The events of `reads` in the order of their stamps, as far as each topic is in order; `open` begins a reading of some of
/// them.
pub(super) fn in_order<S: EventSource + 'static>(
    reads: &[Read],
    open: impl Fn(&[Read]) -> Result<S>,
) -> Result<InOrder> {
    let survey = Survey::of(open(reads)?)?;
    let note = survey.disorder();
    let source: Box<dyn EventSource> = match &note {
        None => Box::new(open(reads)?),
        Some(_) => {
            let mut streams: Vec<Box<dyn EventSource>> = Vec::new();
            for read in reads {
                let stream = open(std::slice::from_ref(read))?;
                streams.push(Box::new(FalseStamps::new(stream)));
            }
            Box::new(Merged::new(streams))
        }
    };
    Ok(InOrder {
        sensors: survey.sensors(),
        source,
        note,
    })
}
