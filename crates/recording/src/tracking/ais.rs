//! AIS reports and own-ship positions: tables of decoded reports, and NMEA 0183 sentences.
//!
//! A file of sentences may hold `!AIVDM` (other ships), `TTM` (a radar's targets, `ttm.rs`), `RMC`, `GGA` and `HDT` (own
//! ship). The time of a sentence is that of its tag block (`\c:1452603731*hh\`), or else of the last `RMC`.

use std::io::BufReader;
use std::path::Path;

use ::ais::messages::{self, AisMessage};
use ::ais::{AisFragments, AisParser};
use nmea::ParseResult;

use super::manifest::{AisColumns, AisFile, TrackingManifest};
use super::plane::LocalPlane;
use super::plausibility::Latitudes;
use super::sample::{AisReport, Detection, OwnShipPose, Scan, TrackingEvent, TrackingSample};
use super::tables::{Table, whole};
use super::ttm::{self, RadarTarget};
use super::{TrackingIssues, TrackingRecording};
use crate::error::{RecordingError, Result};
use crate::limits::LOG_LINE;
use crate::options::KNOT;
use crate::stamp;
use crate::text::{open_file, read_line};

/// Name of the sensor that `TTM` sentences are of.
pub(super) const RADAR: &str = "ttm";

/// Reads the file of AIS reports.
pub(super) fn read(
    manifest: &TrackingManifest,
    wanted: &AisFile,
    file: &str,
    folder: &Path,
    out: &mut TrackingRecording,
) -> Result<()> {
    let plane = manifest.plane.ok_or_else(|| {
        RecordingError::manifest(
            file,
            "[ais] needs [plane] with latitude_deg and longitude_deg",
        )
    })?;
    match &wanted.columns {
        Some(columns) => read_table(columns, wanted, folder, &plane, out),
        None => read_sentences(wanted, folder, &plane, out),
    }
}

/// A report at a position, or `None` when it has none.
fn report(
    plane: &LocalPlane,
    mmsi: u32,
    [latitude, longitude]: [f64; 2],
    course_deg: Option<f64>,
    speed_knots: Option<f64>,
) -> Option<AisReport> {
    // 91 and 181 degrees mean "not available"
    let known = latitude.abs() <= 90.0 && longitude.abs() <= 180.0;
    let (north_m, east_m) = plane.place(latitude, longitude);
    known.then_some(AisReport {
        mmsi,
        north_m,
        east_m,
        course_rad: course_deg
            .filter(|c| (0.0..360.0).contains(c))
            .map(f64::to_radians),
        speed_m_s: speed_knots
            .filter(|v| (0.0..102.25).contains(v))
            .map(|v| v * KNOT),
    })
}

fn read_table(
    columns: &AisColumns,
    wanted: &AisFile,
    folder: &Path,
    plane: &LocalPlane,
    out: &mut TrackingRecording,
) -> Result<()> {
    let mut table = Table::open(folder, &wanted.file)?;
    let (time, mmsi) = (table.column(&columns.time)?, table.column(&columns.mmsi)?);
    let latitude = table.column(&columns.latitude_deg)?;
    let longitude = table.column(&columns.longitude_deg)?;
    let course = table.optional(columns.course_deg.as_ref())?;
    let speed = table.optional(columns.speed_knots.as_ref())?;
    let mut latitudes = Latitudes::default();
    while table.advance()? {
        // Course and speed may be missing in a report: an empty cell.
        let maybe = |column: Option<usize>| column.and_then(|c| table.text(c).parse().ok());
        let time_ns = table.time_ns(time)?;
        let id = whole(table.text(mmsi));
        let id = id.ok_or_else(|| table.bad_cell(mmsi, "an MMSI of up to 9 digits"))?;
        let place = [table.number(latitude)?, table.number(longitude)?];
        latitudes.take(place);
        match report(plane, id, place, maybe(course), maybe(speed)) {
            Some(report) => {
                let sample = TrackingSample::Ais(report);
                out.add(TrackingEvent { time_ns, sample }, table.file())?;
            }
            None => out.issues.reports_without_position += 1,
        }
    }
    latitudes.check(table.file(), &columns.latitude_deg)
}

/// The message of a sentence, if it is of a type that has a position (1, 2, 3, 18, 19); the others are
/// not even decoded.
fn position_report(sentence: &[u8]) -> std::result::Result<Option<AisMessage>, ()> {
    let parsed = AisParser::new().parse(sentence, false).map_err(drop)?;
    let AisFragments::Complete(sentence) = parsed else {
        return Ok(None);
    };
    let bits = messages::unarmor(&sentence.data, usize::from(sentence.fill_bit_count));
    let bits = bits.map_err(drop)?;
    // the type is the first six bits
    match bits.first().map(|byte| byte >> 2) {
        Some(1..=3 | 18 | 19) => messages::parse(&bits).map(Some).map_err(drop),
        _ => Ok(None),
    }
}

fn read_sentences(
    wanted: &AisFile,
    folder: &Path,
    plane: &LocalPlane,
    out: &mut TrackingRecording,
) -> Result<()> {
    let path = folder.join(&wanted.file);
    let file = path.display().to_string();
    let mut input = BufReader::new(open_file(&path, &file)?);
    let mut log = Sentences::new(*plane);
    if let Some(radar) = out.sensors.iter().position(|(name, _)| name == RADAR) {
        log = log.with_radar(radar);
    }
    let takes_reports = out.sensors.iter().any(|(name, _)| name == "ais");
    let mut line = Vec::new();
    while read_line(&mut input, LOG_LINE, &mut line, &file)? {
        let Some(event) = log.take(line.trim_ascii(), &mut out.issues) else {
            continue;
        };
        if matches!(event.sample, TrackingSample::Ais(_)) && !takes_reports {
            out.issues.scans_of_unknown_sensors += 1;
        } else {
            out.add(event, &file)?;
        }
    }
    Ok(())
}

/// A log of NMEA sentences, line by line: what is known from those before.
#[derive(Debug, Clone)]
pub struct Sentences {
    plane: LocalPlane,
    time_ns: Option<i64>,
    own: OwnShipPose,
    positioned: bool,
    has_heading: bool,
    /// Place of the radar among the sensors of the recording, and the number of its next target.
    radar: Option<usize>,
    next: i64,
}

impl Sentences {
    /// A log of which nothing is known yet; positions become places in this plane.
    #[must_use]
    pub fn new(plane: LocalPlane) -> Self {
        Self {
            plane,
            time_ns: None,
            own: OwnShipPose::default(),
            positioned: false,
            has_heading: false,
            radar: None,
            // Below the numbers of any table of scans.
            next: i64::MIN,
        }
    }

    /// The same with a radar, at this place among the sensors, whose targets (`TTM`) are detections.
    #[must_use]
    pub fn with_radar(mut self, sensor: usize) -> Self {
        self.radar = Some(sensor);
        self
    }

    /// The event of one line, if it makes one; lines that say nothing are counted in `issues`.
    pub fn take(&mut self, line: &[u8], issues: &mut TrackingIssues) -> Option<TrackingEvent> {
        if line.is_empty() {
            return None;
        }
        let sample = self.sample(line, issues);
        match (sample, self.time_ns) {
            (Ok(Some(sample)), Some(time_ns)) => Some(TrackingEvent { time_ns, sample }),
            (Ok(None), _) => None,
            _ => {
                issues.sentences_unusable += 1;
                None
            }
        }
    }

    /// What a line says; an error is a line that says nothing.
    fn sample(
        &mut self,
        line: &[u8],
        issues: &mut TrackingIssues,
    ) -> std::result::Result<Option<TrackingSample>, ()> {
        if !line.is_ascii() {
            return Err(());
        }
        let sentence = self.tag_block(line).ok_or(())?;
        if sentence.first() == Some(&b'!') {
            return self.other_ship(sentence, issues);
        }
        let text = std::str::from_utf8(sentence).map_err(drop)?;
        if let Some(target) = ttm::parse(text)? {
            return self.radar_target(&target, issues);
        }
        let (latitude, longitude) = match nmea::parse_str(text) {
            Ok(ParseResult::RMC(rmc)) => {
                let stamp = rmc
                    .fix_date
                    .zip(rmc.fix_time)
                    .map(|(date, time)| date.and_time(time));
                if let Some(time_ns) = stamp.and_then(|s| s.and_utc().timestamp_nanos_opt()) {
                    self.time_ns = Some(time_ns);
                }
                (rmc.lat, rmc.lon)
            }
            Ok(ParseResult::GGA(gga)) => (gga.latitude, gga.longitude),
            Ok(ParseResult::HDT(hdt)) => {
                let heading = hdt.heading.filter(|h| h.is_finite()).ok_or(())?;
                self.own.heading_rad = f64::from(heading).to_radians();
                self.has_heading = true;
                return Ok(self.positioned.then_some(TrackingSample::OwnShip(self.own)));
            }
            // A sentence of another kind is none of our business.
            Err(nmea::Error::DisabledSentence | nmea::Error::Unsupported(_)) => return Ok(None),
            Ok(_) => return Ok(None),
            Err(_) => return Err(()),
        };
        let (Some(latitude), Some(longitude)) = (latitude, longitude) else {
            return Ok(None);
        };
        (self.own.north_m, self.own.east_m) = self.plane.place(latitude, longitude);
        self.positioned = true;
        Ok(Some(TrackingSample::OwnShip(self.own)))
    }

    /// A target of the radar: a scan of its own, because a sentence tells of one. Where the own ship is, and for a bearing
    /// from the bow its heading, is known before.
    fn radar_target(
        &mut self,
        target: &RadarTarget,
        issues: &mut TrackingIssues,
    ) -> std::result::Result<Option<TrackingSample>, ()> {
        let Some(sensor) = self.radar else {
            issues.scans_of_unknown_sensors += 1;
            return Ok(None);
        };
        if !self.positioned || (target.from_bow && !self.has_heading) {
            return Err(());
        }
        let detection = if target.from_bow {
            Detection::RangeBearing {
                range_m: target.range_m,
                bearing_rad: target.bearing_rad,
            }
        } else {
            let (east, north) = target.bearing_rad.sin_cos();
            Detection::Relative {
                north_m: target.range_m * north,
                east_m: target.range_m * east,
            }
        };
        let id = self.next;
        self.next += 1;
        Ok(Some(TrackingSample::Scan(Scan {
            id,
            sensor,
            detections: vec![detection],
        })))
    }

    fn other_ship(
        &self,
        sentence: &[u8],
        issues: &mut TrackingIssues,
    ) -> std::result::Result<Option<TrackingSample>, ()> {
        // Positions come in one sentence; what needs several (names, voyages) is not looked at.
        if sentence.split(|byte| *byte == b',').nth(1) != Some(b"1") {
            return Ok(None);
        }
        let place = match position_report(sentence)? {
            Some(AisMessage::PositionReport(r)) => {
                let motion = [r.course_over_ground, r.speed_over_ground];
                self.placed(r.mmsi, r.latitude, r.longitude, motion)
            }
            Some(AisMessage::StandardClassBPositionReport(r)) => {
                let motion = [r.course_over_ground, r.speed_over_ground];
                self.placed(r.mmsi, r.latitude, r.longitude, motion)
            }
            Some(AisMessage::ExtendedClassBPositionReport(r)) => {
                let motion = [r.course_over_ground, r.speed_over_ground];
                self.placed(r.mmsi, r.latitude, r.longitude, motion)
            }
            _ => return Ok(None),
        };
        if place.is_none() {
            issues.reports_without_position += 1;
        }
        Ok(place.map(TrackingSample::Ais))
    }

    /// A report with its course (deg) and speed (knots), if it says where it is.
    fn placed(
        &self,
        mmsi: u32,
        latitude: Option<f32>,
        longitude: Option<f32>,
        [course, speed]: [Option<f32>; 2],
    ) -> Option<AisReport> {
        let place = [f64::from(latitude?), f64::from(longitude?)];
        let (course, speed) = (course.map(f64::from), speed.map(f64::from));
        report(&self.plane, mmsi, place, course, speed)
    }

    /// The sentence behind a tag block, whose time is taken; `None` when the block does not end.
    fn tag_block<'a>(&mut self, line: &'a [u8]) -> Option<&'a [u8]> {
        let Some(rest) = line.strip_prefix(b"\\") else {
            return Some(line);
        };
        let end = rest.iter().position(|byte| *byte == b'\\')?;
        let block = rest[..end]
            .split(|byte| *byte == b'*')
            .next()
            .unwrap_or_default();
        let time = block
            .split(|byte| *byte == b',')
            .find_map(|field| field.strip_prefix(b"c:"));
        if let Some(time_ns) = time.and_then(|text| stamp::parse_ns(text, stamp::SECONDS)) {
            self.time_ns = Some(time_ns);
        }
        Some(&rest[end + 1..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PLANE: LocalPlane = LocalPlane {
        latitude_deg: 37.8,
        longitude_deg: -122.4,
    };

    fn with_checksum(body: &str) -> String {
        let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        format!("${body}*{sum:02X}")
    }

    #[test]
    fn other_ships_and_the_own_ship_of_one_log() {
        let mut log = Sentences::new(PLANE);
        let mut issues = TrackingIssues::default();
        let aivdm = "!AIVDM,1,1,,B,15MgK45P3@G?fl0E`JbR0OwT0@MS,0*4D";
        assert_eq!(log.take(aivdm.as_bytes(), &mut issues), None);
        assert_eq!(issues.sentences_unusable, 1, "no time is known yet");

        let rmc = with_checksum("GPRMC,130211.00,A,3748.0000,N,12224.0000,W,0.0,0.0,120116,,,A");
        let own = log.take(rmc.as_bytes(), &mut issues).unwrap();
        assert_eq!(own.time_ns, 1_452_603_731_000_000_000);
        let TrackingSample::OwnShip(pose) = own.sample else {
            panic!("{own:?}")
        };
        assert!(pose.north_m.abs() < 0.2 && pose.east_m.abs() < 0.2);

        let hdt = with_checksum("HEHDT,90.0,T");
        let turned = log.take(hdt.as_bytes(), &mut issues).unwrap().sample;
        let TrackingSample::OwnShip(pose) = turned else {
            panic!("{turned:?}")
        };
        assert!((pose.heading_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-6);

        let tagged = format!("\\s:shore,c:1452603799*00\\{aivdm}");
        let other = log.take(tagged.as_bytes(), &mut issues).unwrap();
        assert_eq!(other.time_ns, 1_452_603_799_000_000_000);
        let TrackingSample::Ais(report) = other.sample else {
            panic!("{other:?}")
        };
        // 37.803803 N, 122.392531 W
        assert_eq!(report.mmsi, 366_730_000);
        assert!((report.north_m - 422.0).abs() < 3.0, "{report:?}");
        assert!((report.east_m - 657.0).abs() < 3.0, "{report:?}");
        assert!(
            (report.speed_m_s.unwrap() - 20.8 * KNOT).abs() < 0.05,
            "{report:?}"
        );
        assert_eq!(issues.sentences_unusable, 1);
    }

    #[test]
    fn targets_of_a_radar_are_detections_from_where_the_own_ship_is() {
        let mut log = Sentences::new(PLANE).with_radar(3);
        let mut issues = TrackingIssues::default();
        let north = with_checksum("RATTM,01,2,90,T,,,,,,K,,T,,,");
        let bow = with_checksum("RATTM,02,1,90,R,,,,,,N,,T,,,");
        let rmc = with_checksum("GPRMC,130211.00,A,3748.0000,N,12224.0000,W,0.0,0.0,120116,,,A");
        let mut take = |line: &str| log.take(line.as_bytes(), &mut issues);
        let mut scan = |line: &str| match take(line)?.sample {
            TrackingSample::Scan(scan) => Some(scan),
            _ => None,
        };
        assert_eq!(scan(&north), None, "nothing is known of the own ship");
        assert_eq!(scan(&rmc), None);
        let seen = scan(&north).unwrap();
        let [Detection::Relative { north_m, east_m }] = seen.detections[..] else {
            panic!("{seen:?}")
        };
        assert_eq!(seen.sensor, 3);
        assert!(north_m.abs() < 1e-9 && (east_m - 2000.0).abs() < 1e-9);
        assert_eq!(scan(&bow), None, "no heading is known");
        assert_eq!(scan(&with_checksum("HEHDT,90.0,T")), None);
        let next = scan(&bow).unwrap();
        assert!(matches!(
            next.detections[..],
            [Detection::RangeBearing {
                range_m: 1852.0,
                ..
            }]
        ));
        assert_ne!(next.id, seen.id);
        assert_eq!(issues.sentences_unusable, 2);
        let mut alone = Sentences::new(PLANE);
        assert_eq!(alone.take(north.as_bytes(), &mut issues), None);
        assert_eq!(issues.scans_of_unknown_sensors, 1);
    }

    #[test]
    fn wrong_checksums_and_broken_blocks_are_counted() {
        let mut log = Sentences::new(PLANE);
        let mut issues = TrackingIssues::default();
        for line in [
            "!AIVDM,1,1,,B,15MgK45P3@G?fl0E`JbR0OwT0@MS,0*00",
            "!AIVDM,1,1,,A,,0*26",
            "$GPRMC,1*00",
            "\\c:12",
            "\u{e9}",
            "hello",
        ] {
            assert_eq!(log.take(line.as_bytes(), &mut issues), None, "{line}");
        }
        assert_eq!(issues.sentences_unusable, 6);
    }

    proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(21), ..ProptestConfig::default() })]
            #[test]
            fn no_line_panics(
                bytes in prop::collection::vec(any::<u8>(), 0..120),
                body in "[ -~]{0,80}", fields in prop::collection::vec("[0-9A-Za-z.:`@?<>-]{0,30}", 0..12),
            ) {
                let mut log = Sentences::new(PLANE).with_radar(0);
                let mut issues = TrackingIssues::default();
                log.take(&bytes, &mut issues);
                let talkers = ["AIVDM,", "GPRMC,", "GPGGA,", "HEHDT,", "GPGSV,", "RATTM,", ""];
                for talker in talkers {
                    for content in [body.clone(), fields.join(",")] {
                        let sentence = with_checksum(&format!("{talker}{content}"));
                        log.take(sentence.as_bytes(), &mut issues);
                        log.take(sentence.replacen('$', "!", 1).as_bytes(), &mut issues);
                        log.take(format!("\\c:1*00\\{sentence}").as_bytes(), &mut issues);
                    }
                }
                let payload = fields.join("");
                for fill in 0..6 {
                    for parts in ["1,1", "2,2", "3,0"] {
                        let sentence = with_checksum(&format!("AIVDM,{parts},,A,{payload},{fill}"));
                        log.take(sentence.replacen('$', "!", 1).as_bytes(), &mut issues);
                    }
                }
            }
        }
}
