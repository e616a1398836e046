//! Sentences as receivers send them, damaged ones, and what becomes of a night.

use std::format;
use std::string::String;

use super::*;

/// The sentence of a body, with its checksum.
fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}")
}

fn understood(body: &str) -> Option<Sentence> {
    read(sentence(body).as_bytes())
}

fn fix_at(time: &str) -> [String; 2] {
    [
        format!("GPGGA,{time},5307.0380,N,02308.6040,E,1,08,0.90,142.3,M,34.2,M,,"),
        format!("GPRMC,{time},A,5307.0380,N,02308.6040,E,2.50,84.40,230394,,,A"),
    ]
}

#[test]
fn the_two_sentences_of_an_instant_make_one_fix() {
    let mut receiver = Receiver::default();
    let [gga, rmc] = fix_at("123519.000");
    assert_eq!(receiver.take(&understood(&gga).unwrap(), 0), None);
    let fix = receiver.take(&understood(&rmc).unwrap(), 1).unwrap();
    let expected = Fix {
        utc_ms: 45_319_000,
        latitude_e7: 531_173_000,
        longitude_e7: 231_434_000,
        height_mm: 176_500,
        satellites: 8,
        hdop_hundredths: 90,
        speed_course: Some((1286, 8440)),
    };
    assert_eq!(fix, expected);
    // The same instant again, in either order, is held and not new.
    for body in [&gga, &rmc, &gga] {
        assert_eq!(receiver.take(&understood(body).unwrap(), 2), None);
    }
    assert_eq!(receiver.poll(u32::MAX), None);
}

#[test]
fn rmc_may_come_first_or_not_at_all_and_midnight_is_an_instant_like_any() {
    let mut receiver = Receiver::default();
    let [gga, rmc] = fix_at("235959.000");
    assert_eq!(receiver.take(&understood(&rmc).unwrap(), 0), None);
    assert!(receiver.take(&understood(&gga).unwrap(), 0).is_some());
    let [gga, _] = fix_at("000000.000");
    let came_us = u32::MAX - 1000;
    assert_eq!(receiver.take(&understood(&gga).unwrap(), came_us), None);
    assert_eq!(receiver.poll(came_us.wrapping_add(RMC_WAIT_US - 1)), None);
    let fix = receiver.poll(came_us.wrapping_add(RMC_WAIT_US)).unwrap();
    assert_eq!((fix.utc_ms, fix.speed_course), (0, None));
}

#[test]
fn other_constellations_and_sides_are_read() {
    let body = "GNGGA,000001.00,3351.5000,S,15112.40001,W,2,12,1.2,-3.5,M,,M,,";
    let Some(Sentence::Gga(1000, Some(fix))) = understood(body) else {
        panic!("{:?}", understood(body));
    };
    assert_eq!(
        (fix.latitude_e7, fix.longitude_e7),
        (-338_583_333, -1_512_066_668)
    );
    assert_eq!((fix.height_mm, fix.satellites), (-3500, 12));
    assert_eq!(understood("GPGSV,1,1,00"), Some(Sentence::Other));
    assert_eq!(
        understood("GPGGA,,,,,,0,00,,,M,,M,,"),
        Some(Sentence::Other)
    );
}

#[test]
fn a_fix_that_is_not_good_enough_is_refused_and_the_next_must_be_better() {
    let gga = |time: &str, quality: u8, satellites: u8, hdop: &str| {
        format!("GPGGA,{time},5307.0380,N,02308.6040,E,{quality},{satellites:02},{hdop},1,M,2,M,,")
    };
    let mut receiver = Receiver::default();
    let mut fixes = |time: &str, gga: &str, status: char| {
        let rmc = format!("GPRMC,{time},{status},5307.0,N,02308.6,E,0.0,,230394,,,A");
        let before = receiver.refused;
        let first = receiver.take(&understood(gga).unwrap(), 0);
        let second = receiver.take(&understood(&rmc).unwrap(), 0);
        (first.or(second).is_some(), receiver.refused - before)
    };
    assert_eq!(fixes("000001", &gga("000001", 1, 4, "4.0"), 'A'), (true, 0));
    assert_eq!(
        fixes("000002", &gga("000002", 0, 8, "1.0"), 'A'),
        (false, 1)
    );
    assert_eq!(
        fixes("000003", &gga("000003", 1, 4, "1.0"), 'A'),
        (false, 1)
    );
    assert_eq!(
        fixes("000004", &gga("000004", 1, 8, "1.0"), 'V'),
        (false, 1)
    );
    assert_eq!(
        fixes("000005", &gga("000005", 1, 8, "4.1"), 'A'),
        (false, 1)
    );
    assert_eq!(fixes("000006", &gga("000006", 1, 5, "1.0"), 'A'), (true, 0));
    assert_eq!(fixes("000007", &gga("000007", 1, 4, "1.0"), 'A'), (true, 0));
}

#[test]
fn damaged_sentences_are_refused() {
    let [gga, rmc] = fix_at("123519.000");
    for body in [&gga, &rmc] {
        let whole = sentence(body);
        assert!(read(whole.as_bytes()).is_some());
        for length in 0..whole.len() {
            assert_eq!(read(&whole.as_bytes()[..length]), None, "{length}");
        }
        for place in 1..whole.len() - 3 {
            let mut bytes = whole.clone().into_bytes();
            bytes[place] ^= 1;
            assert_eq!(read(&bytes), None, "{place}");
        }
    }
    for body in [
        "GPGGA,123519,5307.0380,N,02308.6040,X,1,08,0.9,142.3,M,34.2,M,,",
        "GPGGA,123519,9107.0380,N,02308.6040,E,1,08,0.9,142.3,M,34.2,M,,",
        "GPGGA,123519,5360.0000,N,02308.6040,E,1,08,0.9,142.3,M,34.2,M,,",
        "GPGGA,243519,5307.0380,N,02308.6040,E,1,08,0.9,142.3,M,34.2,M,,",
        "GPGGA,123519,7.0380,N,02308.6040,E,1,08,0.9,142.3,M,34.2,M,,",
        "GPGGA,123519,5307.0380,N,02308.6040,E,1,08,,142.3,M,34.2,M,,",
        "GPGGA,123519,5307.0380,N",
        "GPRMC,123519,A,5307.0380,N,02308.6040,E,-1,84,230394,,,A",
        "GPRMC,123519,A,5307.0380,N,02308.6040,E,1,384,230394,,,A",
    ] {
        assert_eq!(understood(body), None, "{body}");
    }
}
