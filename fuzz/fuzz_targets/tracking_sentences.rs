//! A log of NMEA sentences: any lines become events with numbers in them or are counted, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::tracking::{
    Detection, LocalPlane, Sentences, TrackingIssues, TrackingSample,
};

/// The checksum is not what is to be found: a sentence gets the right one.
fn with_checksum(line: &[u8]) -> Vec<u8> {
    let sum = line.iter().skip(1).fold(0, |sum, byte| sum ^ byte);
    [line, format!("*{sum:02X}").as_bytes()].concat()
}

fuzz_target!(|bytes: &[u8]| {
    let mut issues = TrackingIssues::default();
    let mut log = Sentences::new(LocalPlane {
        latitude_deg: 50.0,
        longitude_deg: -1.0,
    })
    .with_radar(0);
    for line in bytes.split(|byte| *byte == b'\n') {
        for line in [line.to_vec(), with_checksum(line)] {
            let Some(event) = log.take(&line, &mut issues) else {
                continue;
            };
            match event.sample {
                TrackingSample::Ais(report) => {
                    assert!(report.north_m.is_finite() && report.east_m.is_finite());
                }
                TrackingSample::Scan(scan) => {
                    assert!(scan.detections.iter().all(|seen| match *seen {
                        Detection::RangeBearing {
                            range_m,
                            bearing_rad,
                        } => range_m.is_finite() && range_m > 0.0 && bearing_rad.is_finite(),
                        Detection::Relative { north_m, east_m } => {
                            north_m.is_finite() && east_m.is_finite()
                        }
                        _ => false,
                    }));
                }
                _ => {}
            }
        }
    }
});
