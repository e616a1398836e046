//! GPX: the points of tracks, as watches, phones and navigation programs write them.
//!
//! Read first: `docs/formats.md`, section "GPX". A point without a time has no place in a recording and is left out. Heights are
//! above the geoid, as the format means them.

use std::io::Read;

use crate::error::{RecordingError, Result};
use crate::event::{Event, Sample, SensorKind};
use crate::gnss::{GnssPosition, GnssQuality};
use crate::limits::Limit;
use crate::metadata::{Metadata, WorldFrame};
use crate::recording::{Events, Opened};
use crate::text::Input;

/// A file is read whole: a week of a fix a second has some 80 MB.
const FILE: Limit = Limit {
    what: "a GPX file",
    most: 1 << 27,
    unit: "bytes",
    advice: "divide the track",
};

/// Whether a text begins as GPX.
pub(crate) fn recognises(text: &str) -> bool {
    let text = text.trim_start();
    text.starts_with('<') && text.contains("<gpx")
}

/// Opens a file.
pub(crate) fn open(mut input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    let mut bytes = Vec::new();
    let read = input.by_ref().take(FILE.most + 1).read_to_end(&mut bytes);
    read.map_err(|error| RecordingError::io(file, "read it", error))?;
    FILE.check(bytes.len() as u64, file, "")?;
    let document = ::gpx::read(&bytes[..])
        .map_err(|error| RecordingError::damaged(file, format!("not GPX: {error}")))?;
    let segments = document.tracks.into_iter().flat_map(|track| track.segments);
    let points: Vec<::gpx::Waypoint> = segments.flat_map(|segment| segment.points).collect();
    let all = points.len();
    let mut events: Vec<Event> = points.iter().filter_map(event).collect();
    let (untimed, metadata) = (
        all - events.len(),
        Metadata {
            format: "gpx".to_owned(),
            world_frame: WorldFrame::Ned,
            ..metadata
        },
    );
    if events.is_empty() {
        let found = match all {
            0 => "a GPX file without a track".to_owned(),
            all => format!("a GPX file whose {all} points have no time"),
        };
        return Err(RecordingError::not_a_recording(file, &found));
    }
    // Tracks of a file may stand in any order.
    events.sort_by_key(|event| event.time_ns);
    let mut opened = Opened::new(
        metadata,
        vec![SensorKind::GnssPosition],
        Box::new(Events(events.into_iter().map(Ok))),
    );
    let has_height =
        |event: &Event| matches!(event.sample, Sample::GnssPosition(fix) if fix.height_m.is_some());
    if points
        .iter()
        .filter_map(event)
        .any(|event| has_height(&event))
    {
        opened
            .notes
            .push("Heights are above the geoid, as GPX means them.".to_owned());
    }
    if untimed > 0 {
        opened.notes.push(format!(
            "Points without a time, which are left out: {untimed}."
        ));
    }
    Ok(opened)
}

fn event(point: &::gpx::Waypoint) -> Option<Event> {
    let time = time::OffsetDateTime::from(point.time?);
    let time_ns = i64::try_from(time.unix_timestamp_nanos()).ok()?;
    let fix = GnssPosition {
        latitude_rad: point.point().y().to_radians(),
        longitude_rad: point.point().x().to_radians(),
        height_m: point.elevation.filter(|height| height.is_finite()),
        std_m: None,
        hdop: point.hdop.filter(|hdop| hdop.is_finite() && *hdop > 0.0),
        satellites: point.sat.and_then(|count| u8::try_from(count).ok()),
        quality: match point.fix {
            Some(::gpx::Fix::DGPS) => GnssQuality::Differential,
            Some(::gpx::Fix::None) => GnssQuality::Invalid,
            Some(_) => GnssQuality::Autonomous,
            None => GnssQuality::Unknown,
        },
    };
    let sample = Sample::GnssPosition(fix);
    Some(Event { time_ns, sample })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OpenOptions;

    const HEAD: &str = "<?xml version=\"1.0\"?>\n<gpx version=\"1.1\" creator=\"x\" xmlns=\"http://www.topografix.com/GPX/1/1\">";

    fn read(body: &str) -> Result<Vec<Event>> {
        let text = format!("{HEAD}{body}</gpx>");
        let recording = crate::read_bytes(text.into_bytes(), "walk.gpx", &OpenOptions::default())?;
        recording.collect()
    }

    #[test]
    fn the_points_of_all_tracks_come_in_the_order_of_time() {
        let events = read(
            "<trk><trkseg><trkpt lat=\"47.5\" lon=\"8.25\"><ele>440.5</ele><time>2024-05-06T07:08:09.5Z</time><fix>dgps</fix>\
             <sat>9</sat><hdop>1.1</hdop></trkpt><trkpt lat=\"47.6\" lon=\"8\"></trkpt></trkseg></trk>\
             <trk><trkseg><trkpt lat=\"-1\" lon=\"-8\"><time>2024-05-06T09:08:09+02:00</time></trkpt></trkseg></trk>",
        )
        .unwrap();
        assert_eq!(events.len(), 2);
        let fix = |event: &Event| match event.sample {
            Sample::GnssPosition(fix) => fix,
            _ => panic!("{event:?}"),
        };
        assert_eq!(events[0].time_ns, 1_714_979_289_000_000_000);
        assert_eq!(events[1].time_ns - events[0].time_ns, 500_000_000);
        let (first, second) = (fix(&events[0]), fix(&events[1]));
        assert_eq!(
            (first.height_m, first.quality),
            (None, GnssQuality::Unknown)
        );
        assert!((second.latitude_rad.to_degrees() - 47.5).abs() < 1e-12);
        assert_eq!((second.height_m, second.satellites), (Some(440.5), Some(9)));
        assert_eq!(second.quality, GnssQuality::Differential);
    }

    #[test]
    fn what_has_no_times_or_is_cut_off_is_refused() {
        let told = |body: &str| read(body).unwrap_err().to_string();
        let untimed = "<trk><trkseg><trkpt lat=\"47.6\" lon=\"8\"></trkpt></trkseg></trk>";
        assert!(
            told(untimed).contains("1 points have no time"),
            "{}",
            told(untimed)
        );
        assert!(told("").contains("without a track"));
        assert!(told("<trk><trkseg>").contains("not GPX"));
    }
}
