use super::*;
use crate::gnss::{GnssPosition, GnssQuality, GnssVelocity};
use crate::options::{Format, OpenOptions};
use crate::recording::Recording;
use proptest::prelude::*;

/// Adds the checksum.
fn summed(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

fn log(bodies: &[&str]) -> String {
    bodies.iter().map(|body| summed(body)).collect()
}

fn read(text: &str) -> (Vec<Event>, Issues) {
    let options = OpenOptions {
        format: Some(Format::Nmea),
        ..OpenOptions::default()
    };
    let mut recording: Recording =
        crate::read_bytes(text.as_bytes().to_vec(), "test.nmea", &options).unwrap();
    let events = recording.by_ref().map_while(Result::ok).collect();
    (events, recording.issues().clone())
}

fn fixes(events: &[Event]) -> Vec<(i64, GnssPosition)> {
    let fix = |event: &Event| match event.sample {
        Sample::GnssPosition(fix) => Some((event.time_ns, fix)),
        _ => None,
    };
    events.iter().filter_map(fix).collect()
}

fn velocities(events: &[Event]) -> Vec<GnssVelocity> {
    let velocity = |event: &Event| match event.sample {
        Sample::GnssVelocity(v) => Some(v),
        _ => None,
    };
    events.iter().filter_map(velocity).collect()
}

const GGA: &str = "GPGGA,123519.50,4807.038,N,01131.324,W,4,08,0.9,545.4,M,46.9,M,,";
const RMC: &str = "GPRMC,123519.50,A,4807.038,N,01131.324,W,022.4,090.0,230394,003.1,W";

#[test]
fn the_sentences_of_one_time_are_one_fix() {
    let text = log(&[
        GGA,
        RMC,
        "GPVTG,091.0,T,,M,005.5,N,010.2,K",
        "GPGSA,A,3,04,05,,09,12,,,24,,,,,2.5,1.3,2.1",
    ]);
    let (events, issues) = read(&text);
    assert!(issues.is_empty(), "{issues:?}");
    let [(time_ns, fix)] = fixes(&events)[..] else {
        panic!("{events:?}")
    };
    // 23 March 1994, 12:35:19.5.
    assert_eq!(time_ns, 764_426_119_500_000_000);
    approx::assert_relative_eq!(
        fix.latitude_rad.to_degrees(),
        48.0 + 7.038 / 60.0,
        epsilon = 1e-12
    );
    approx::assert_relative_eq!(
        fix.longitude_rad.to_degrees(),
        -(11.0 + 31.324 / 60.0),
        epsilon = 1e-12
    );
    approx::assert_relative_eq!(fix.height_m.unwrap(), 592.3, epsilon = 1e-4);
    assert_eq!(
        (fix.quality, fix.satellites),
        (GnssQuality::RtkFixed, Some(8))
    );
    approx::assert_relative_eq!(fix.hdop.unwrap(), 0.9, epsilon = 1e-6);
    let [velocity] = velocities(&events)[..] else {
        panic!("{events:?}")
    };
    // The speed of RMC, which came first.
    approx::assert_relative_eq!(velocity.east_m_s, 22.4 * 1852.0 / 3600.0, epsilon = 1e-6);
    approx::assert_abs_diff_eq!(velocity.north_m_s, 0.0, epsilon = 1e-6);
}

#[test]
fn an_invalid_fix_is_counted_and_never_seen() {
    let good = log(&["GPGGA,123520,4807.038,N,01131.324,E,1,08,0.9,545.4,M,46.9,M,,"]);
    for bad in [
        "GPGGA,123519,4807.038,N,01131.324,E,0,00,,,M,,M,,",
        "GPGGA,123519,4807.038,N,01131.324,E,7,08,0.9,545.4,M,46.9,M,,",
        "GPRMC,123519,V,4807.038,N,01131.324,E,022.4,084.4,230394,003.1,W",
        "GPRMC,123519,A,4807.038,N,01131.324,E,022.4,084.4,230394,003.1,W,N",
        "GPGLL,4807.038,N,01131.324,E,123519,V,N",
    ] {
        let (events, issues) = read(&format!("{}{good}", log(&[bad])));
        assert_eq!(events.len(), 1, "{bad}: {events:?}");
        assert_eq!(issues.invalid_fixes[&SensorKind::GnssPosition], 1, "{bad}");
    }
    // Of an invalid epoch the sentence that does not know it is not accepted either.
    let mixed = log(&[GGA, "GPRMC,123519.50,V,,,,,,,230394,,"]);
    let (events, issues) = read(&format!("{mixed}{good}"));
    assert_eq!((events.len(), issues.invalid_fixes.len()), (1, 1));
    // Two-dimensional: the height is not observed.
    let flat = log(&[GGA, "GPGSA,A,2,04,05,,09,,,,,,,,,2.5,1.3,2.1"]);
    assert_eq!(fixes(&read(&flat).0)[0].1.height_m, None);
    // One system of satellites in three dimensions, another not in use.
    let systems = [
        GGA,
        "GPGSA,A,3,04,05,,09,,,,,,,,,2.5,1.3,2.1",
        "BDGSA,A,1,,,,,,,,,,,,,,,",
    ];
    let (events, issues) = read(&log(&systems));
    assert!(issues.invalid_fixes.is_empty());
    assert!(fixes(&events)[0].1.height_m.is_some());
}

#[test]
fn what_is_damaged_is_counted_by_reason() {
    let damaged = [
        (GGA.replace("4807", "4817"), reason::CHECKSUM),
        (format!("${}", &GGA[..30]), reason::CUT_OFF),
        ("$GPGGA,1".to_owned() + &"2".repeat(110), reason::TOO_LONG),
        ("hello".to_owned(), reason::NO_SENTENCE),
        (
            summed("GPGGA,123519,9907.038,N,01131.324,E,1,08,0.9,545.4,M,46.9,M,,"),
            reason::GARBLED,
        ),
        (summed("GPGGA,123519,4807.038,N,01131"), reason::GARBLED),
        (
            summed("GPGGA,123520,,,,,0,00,,,M,,M,,"),
            reason::NO_POSITION,
        ),
        (summed("GPHDT,abc,T"), reason::GARBLED),
    ];
    let sum = GGA.bytes().fold(0, |sum, byte| sum ^ byte);
    let good = summed(GGA);
    let mut text = good;
    for (line, reason) in &damaged {
        let line = if *reason == reason::CHECKSUM {
            format!("${line}*{sum:02X}")
        } else {
            line.clone()
        };
        text += line.trim_end();
        text += "\r\n";
    }
    let (events, issues) = read(&text);
    assert_eq!(fixes(&events).len(), 1);
    let counted: u64 = issues.rejected.values().sum();
    assert_eq!(counted, damaged.len() as u64, "{:?}", issues.rejected);
    for (line, reason) in damaged {
        assert!(issues.rejected.contains_key(reason), "{line} {reason}");
    }
    let told = issues.sentences();
    assert!(
        told.iter()
            .any(|s| s.starts_with("Left out: 1 NMEA sentence(s) with a wrong checksum")),
        "{told:?}"
    );
}

#[test]
fn unknown_talkers_and_kinds_are_no_harm() {
    let any = GGA.replacen("GP", "ZZ", 1);
    let (events, issues) = read(&log(&[
        &any,
        "GPXXX,1,2",
        "PGRME,15.0,M,45.0,M,25.0,M",
        "GPGSV,1,1,00",
        "IIHDT,,T",
    ]));
    assert_eq!(events.len(), 1);
    assert!(issues.is_empty(), "{issues:?}");
}

#[test]
fn midnight_and_old_forms_without_checksum_or_time() {
    let text = "$GPZDA,235959,01,08,2014,7\n$GPGLL,2200.097,S,01756.346,W\n$GPVTG,220.6,T,,M,009.7,N,018.0,K\n\
        $GPZDA,000000,02,08,2014,7\n$GPGLL,2200.099,S,01756.348,W\n$GPVTG,220.3,T,,M,009.6,N,017.7,K\n";
    let (events, issues) = read(text);
    assert!(issues.is_empty(), "{issues:?}");
    let fixes = fixes(&events);
    assert_eq!(fixes.len(), 2);
    assert_eq!(fixes[1].0 - fixes[0].0, 1_000_000_000);
    assert_eq!(fixes[0].0, 1_406_937_599_000_000_000);
    assert_eq!(velocities(&events).len(), 2);
}

#[test]
fn headings_of_an_epoch_follow_each_other_as_they_arrived() {
    let at = |second: &str, body: &str| format!("2014-08-01T00:00:{second}Z {}", summed(body));
    let text = [
        at(
            "00.300",
            "INGGA,000000.10,2200.110899,S,01756.359432,W,1,12,0.7,-2.76,M,4.67,M,,",
        ),
        at("00.500", "INHDT,218.26,T"),
        at("00.600", "PSXN,23,0.35,-1.74,218.26,0.58"),
        at("00.700", "INHDT,218.27,T"),
        at(
            "01.300",
            "INGGA,000001.10,2200.110899,S,01756.359432,W,1,12,0.7,-2.76,M,4.67,M,,",
        ),
    ]
    .concat();
    let (events, issues) = read(&text);
    assert!(issues.is_empty(), "{issues:?}");
    let start = events[0].time_ns;
    let told: Vec<_> = events
        .iter()
        .map(|e| ((e.time_ns - start) / 1_000_000, e.sample.kind()))
        .collect();
    use SensorKind::{DeviceOrientation, GnssPosition, TrueHeading};
    let expected = [
        (0, DeviceOrientation),
        (0, GnssPosition),
        (0, TrueHeading),
        (200, TrueHeading),
        (1000, GnssPosition),
    ];
    assert_eq!(told, expected);
    let Sample::DeviceOrientation(attitude) = events[0].sample else {
        panic!("{events:?}")
    };
    let (roll, pitch, yaw) = attitude.euler_angles();
    approx::assert_relative_eq!(roll.to_degrees(), 0.35, epsilon = 1e-9);
    approx::assert_relative_eq!(pitch.to_degrees(), -1.74, epsilon = 1e-9);
    approx::assert_relative_eq!(yaw.to_degrees(), 218.26 - 360.0, epsilon = 1e-9);
}

#[test]
fn a_doppler_log_tells_the_way_through_the_water_along_the_bow() {
    let line = "2014-08-01T00:00:00.186000Z $PUHAW,UVH,-4.87,-6.04,219.2\n";
    let (events, _) = read(line);
    let Sample::WaterVelocity(water) = events[0].sample else {
        panic!("{events:?}")
    };
    let knots = 1852.0 / 3600.0;
    approx::assert_relative_eq!(water.forward_m_s / knots, 7.7585, epsilon = 1e-3);
    approx::assert_abs_diff_eq!(water.starboard_m_s.unwrap() / knots, -0.043, epsilon = 1e-2);
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_counted(lines in proptest::collection::vec(
        prop_oneof![
            "[ -~]{0,90}",
            "(GP|IN|PS)(GGA|RMC|GSA|VTG|GLL|GNS|ZDA|HDT|THS|VHW|XN)(,[0-9.NSEWAVT-]{0,9}){0,16}",
            "GPGGA,[0-2][0-9][0-5][0-9][0-5][0-9],[0-9]{4}[.][0-9]{3},N,[01][0-9]{4}[.][0-9]{3},E,[0-8],08,0.9,5.4,M,46.9,M,,",
        ],
        0..40,
    ), cut in any::<u16>()) {
        let text: String = lines.iter().map(|line| summed(line)).collect();
        let text: String = text.chars().take(usize::from(cut).max(1)).collect();
        let (events, _) = read(&text);
        for event in &events {
            prop_assert!(event.sample.is_finite(), "{event:?}");
        }
        prop_assert!(events.windows(2).all(|pair| pair[0].time_ns <= pair[1].time_ns));
    }
}
