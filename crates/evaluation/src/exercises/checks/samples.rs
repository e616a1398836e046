//! Checks about what was recorded: its rate, whole turns, a magnet near it.

use nalgebra::Vector3;
use northing_core::geometry::rotation::angle_between;
use northing_recording::{Event, Sample};

use super::{Found, answered, chosen, demand, moved};
use crate::RunObserver;
use crate::attitude::alterations::Alterations;
use crate::attitude::{EstimateRecord, EstimatorKind};
use crate::exercises::cards::Card;
use crate::exercises::judgement::{Judgement, decimals};
use crate::exercises::turning::{rates, rests, turned};
use crate::exercises::work::Work;
use crate::statistics::median;

/// Integration that is so far from that of all samples has failed, deg.
pub(in crate::exercises) const FAILED_DEG: f64 = 5.0;
/// A scale error is found within this, percent.
pub(in crate::exercises) const SCALE_PERCENT: f64 = 0.3;
/// A whole turn may be off by so much before it is none, deg, and several together by so much.
pub(in crate::exercises) const WHOLE_TURN_DEG: f64 = 30.0;
const MOST_OFF_DEG: f64 = 90.0;
/// Both rests of a whole turn point the same way within this, deg.
pub(in crate::exercises) const SAME_POSE_DEG: f64 = 3.0;
/// A field that differs by less than this is the room's, microtesla.
pub(in crate::exercises) const LEAST_MAGNET_UT: f64 = 5.0;
/// A time is read from a plot within this, s.
pub(in crate::exercises) const READ_S: f64 = 1.0;

/// Attitudes of a run by their time.
#[derive(Default)]
struct Ends(Vec<(i64, nalgebra::UnitQuaternion<f64>)>);

impl RunObserver for Ends {
    fn estimate(&mut self, record: &EstimateRecord) {
        self.0.push((record.time_ns, record.attitude));
    }
}

/// How far integration at a rate is from that of all samples at the end, deg.
fn integration_off(work: &Work<'_>, rate_hz: f64) -> Option<f64> {
    let last = |events: &[Event]| {
        let mut ends = Ends::default();
        work.run(events, EstimatorKind::Integration, &mut ends)
            .ok()?;
        ends.0.last().map(|(_, attitude)| *attitude)
    };
    let slower = Alterations {
        rate_hz: Some(rate_hz),
        ..Alterations::default()
    };
    let (all, some) = (last(work.events)?, last(&slower.apply(work.events))?);
    Some(angle_between(&all, &some).to_degrees())
}

pub(in crate::exercises) fn rate(work: &Work<'_>, judgement: &mut Judgement) -> Found {
    moved(work, judgement)?;
    let theirs = answered(work, judgement, Card::Rate, "rate")?;
    let rates = rates(work.events);
    let seconds = rates.last()?.0.saturating_sub(rates.first()?.0) as f64 * 1e-9;
    let recorded = (rates.len() - 1) as f64 / seconds;
    demand(
        judgement,
        theirs > 0.0 && theirs < 0.9 * recorded,
        "reason.rateRange",
        [
            ("answer", decimals(theirs, 1)),
            ("recorded", decimals(recorded, 1)),
        ],
    )?;
    let (Some(at), Some(twice)) = (
        integration_off(work, theirs),
        integration_off(work, 2.0 * theirs),
    ) else {
        return demand(
            judgement,
            false,
            "reason.noRun",
            [("error", "integration".to_owned())],
        );
    };
    let values = || {
        [
            ("rate", decimals(theirs, 1)),
            ("off", decimals(at, 1)),
            ("most", decimals(FAILED_DEG, 0)),
        ]
    };
    demand(judgement, at > FAILED_DEG, "reason.rateFails", values())?;
    let values = [
        ("rate", decimals(2.0 * theirs, 1)),
        ("off", decimals(twice, 1)),
        ("most", decimals(FAILED_DEG, 0)),
    ];
    demand(judgement, twice <= FAILED_DEG, "reason.rateTwice", values)
}

pub(in crate::exercises) fn scale(work: &Work<'_>, judgement: &mut Judgement) -> Found {
    let rates = rates(work.events);
    let rests = rests(&rates);
    demand(judgement, rests.len() >= 2, "reason.twoRests", [])?;
    let (first, last) = (rests.first()?, rests.last()?);
    // The bias of both rests, so that its drift between them is halved.
    let bias = (first.mean_rad_s + last.mean_rad_s) / 2.0;
    let span = [first.core()[1], last.core()[0]];
    let (turn, about) = turned(&rates, span, bias);
    let axis = about.iamax();
    let degrees = about[axis].to_degrees();
    let turns = (degrees / 360.0).round();
    let values = || {
        [
            ("turned", decimals(degrees, 1)),
            ("axis", ["x", "y", "z"][axis].to_owned()),
        ]
    };
    demand(judgement, turns != 0.0, "reason.wholeTurn", values())?;
    // A scale error of the allowed size shows in both; the device back in its pose shows in gravity, too.
    // It grows with the turns: 8 % are 30 degrees of one, and 90 of three.
    let most = (WHOLE_TURN_DEG * turns.abs()).min(MOST_OFF_DEG);
    let is_whole = (degrees - 360.0 * turns).abs() <= most && turn.angle().to_degrees() <= most;
    demand(
        judgement,
        is_whole && same_pose(work.events, span[0], span[1]),
        "reason.backInPose",
        values(),
    )?;
    let chosen = chosen(work, judgement, Card::Scale, "axis")?;
    let name = ["x", "y", "z"][axis];
    demand(
        judgement,
        chosen == name,
        "reason.scaleAxis",
        [("answer", chosen.to_owned()), ("axis", name.to_owned())],
    )?;
    let ours = 100.0 * (degrees / (360.0 * turns) - 1.0);
    let theirs = answered(work, judgement, Card::Scale, "error")?;
    if (theirs - ours).abs() > SCALE_PERCENT && (theirs + ours).abs() <= SCALE_PERCENT {
        return demand(
            judgement,
            false,
            "reason.scaleSign",
            [("answer", decimals(theirs, 2)), ("run", decimals(ours, 2))],
        );
    }
    let values = [
        ("answer", decimals(theirs, 2)),
        ("run", decimals(ours, 2)),
        ("most", decimals(SCALE_PERCENT, 1)),
    ];
    demand(
        judgement,
        (theirs - ours).abs() <= SCALE_PERCENT,
        "reason.scale",
        values,
    )
}

/// Whether gravity points the same way before and after.
fn same_pose(events: &[Event], before_ns: i64, after_ns: i64) -> bool {
    let mean = |inside: &dyn Fn(i64) -> bool| {
        let mut sum = Vector3::zeros();
        for event in events {
            if let Sample::SpecificForce(force) = event.sample
                && inside(event.time_ns)
            {
                sum += force;
            }
        }
        sum
    };
    let (start, end) = (mean(&|t| t <= before_ns), mean(&|t| t >= after_ns));
    start.norm() > 0.0 && end.norm() > 0.0 && start.angle(&end).to_degrees() <= SAME_POSE_DEG
}

pub(in crate::exercises) fn magnet(work: &Work<'_>, judgement: &mut Judgement) -> Found {
    let field = |event: &Event| match event.sample {
        Sample::MagneticField(field) => Some((event.time_ns, field.norm())),
        _ => None,
    };
    let lengths: Vec<(i64, f64)> = work.events.iter().filter_map(field).collect();
    demand(judgement, lengths.len() > 20, "reason.noField", [])?;
    let sorted = |values: &mut dyn Iterator<Item = f64>| {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        median(&values)
    };
    let usual = sorted(&mut lengths.iter().map(|(_, length)| *length))?;
    let scatter = sorted(&mut lengths.iter().map(|(_, length)| (length - usual).abs()))?;
    // 1.4826 times the median deviation is the standard deviation of normal noise.
    let limit = (5.0 * 1.4826 * scatter).max(LEAST_MAGNET_UT);
    let first_ns = work.events.first()?.time_ns;
    let near: Vec<f64> = lengths
        .iter()
        .filter(|(_, length)| (length - usual).abs() > limit)
        .map(|(time_ns, _)| time_ns.saturating_sub(first_ns) as f64 * 1e-9)
        .collect();
    demand(
        judgement,
        near.len() >= 3,
        "reason.noMagnet",
        [("usual", decimals(usual, 1)), ("limit", decimals(limit, 1))],
    )?;
    let theirs = answered(work, judgement, Card::Magnet, "at")?;
    let off = near
        .iter()
        .map(|t| (t - theirs).abs())
        .fold(f64::INFINITY, f64::min);
    let (from, until) = (near.first()?, near.last()?);
    let values = [
        ("answer", decimals(theirs, 1)),
        ("from", decimals(*from, 1)),
        ("until", decimals(*until, 1)),
    ];
    demand(judgement, off <= READ_S, "reason.magnetTime", values)
}
