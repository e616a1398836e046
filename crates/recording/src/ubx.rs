//! u-blox receivers' binary logs: `NAV-PVT` as fixes, velocities and headings.
//!
//! Read first: u-blox, *Interface Description*, UBX-NAV-PVT. Other messages, NMEA and RTCM in the same
//! stream are passed over.

use std::collections::VecDeque;

use chrono::NaiveDate;
use ublox::nav_pvt::common::{NavPvtFlags, NavPvtValidFlags};
use ublox::proto23::{PacketRef, Proto23};
use ublox::{GnssFixType, Parser, ParserError, UbxPacket};

use crate::error::{RecordingError, Result};
use crate::event::{Event, Sample, SensorKind, TrueHeading};
use crate::gnss::{GnssPosition, GnssQuality, GnssVelocity};
use crate::issues::Issues;
use crate::metadata::Metadata;
use crate::recording::{Opened, Pieces};
use crate::text::{Input, read_piece};

/// What begins a frame.
const SYNC: [u8; 2] = [0xb5, 0x62];

/// Why something was left out, in words that complete "Left out: 3 ...".
mod reason {
    pub(super) const CHECKSUM: &str =
        "UBX frame(s) with a wrong checksum; the stream was disturbed";
    pub(super) const CUT_OFF: &str = "UBX frame(s) cut off at the end of the file";
    pub(super) const NO_TIME: &str =
        "UBX NAV-PVT message(s) from before the receiver knew date and time";
}

/// Whether there is a whole frame with a right checksum among the first bytes.
pub(crate) fn recognises(head: &[u8]) -> bool {
    head.windows(SYNC.len())
        .enumerate()
        .filter(|(_, bytes)| *bytes == SYNC)
        .any(|(at, _)| is_frame(&head[at..]))
}

fn is_frame(bytes: &[u8]) -> bool {
    let Some(&[low, high]) = bytes.get(4..6) else {
        return false;
    };
    let end = 6 + usize::from(u16::from_le_bytes([low, high]));
    let (Some(summed), Some(&[a, b])) = (bytes.get(2..end), bytes.get(end..end + 2)) else {
        return false;
    };
    // Fletcher's checksum of 8 bits.
    let sums = summed.iter().fold((0_u8, 0_u8), |(a, b), byte| {
        let a = a.wrapping_add(*byte);
        (a, b.wrapping_add(a))
    });
    sums == (a, b)
}

/// Opens a log.
pub(crate) fn open(input: Input, file: &str, metadata: Metadata) -> Opened {
    let sensors = [
        SensorKind::GnssPosition,
        SensorKind::GnssVelocity,
        SensorKind::TrueHeading,
    ];
    let source = Box::new(UbxSource {
        file: file.to_owned(),
        input,
        parser: Parser::new(Vec::new()),
        events: VecDeque::new(),
        at_end: false,
    });
    Opened::ned("ubx", metadata, &sensors, source)
}

struct UbxSource {
    file: String,
    input: Input,
    parser: Parser<Vec<u8>, Proto23>,
    events: VecDeque<Event>,
    at_end: bool,
}

impl Pieces for UbxSource {
    fn ready(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        if self.at_end {
            return Ok(false);
        }
        let mut piece = [0; 1 << 14];
        let read = read_piece(&mut self.input, &mut piece);
        let read = read.map_err(|error| RecordingError::io(&self.file, "read it", error))?;
        if read == 0 {
            self.at_end = true;
            // A frame that waits for its rest hides those behind it: what is lacking is filled up.
            let filling = vec![0; usize::from(u16::MAX) + 8];
            self.parse(&filling, reason::CUT_OFF, issues);
        } else {
            self.parse(&piece[..read], reason::CHECKSUM, issues);
        }
        Ok(true)
    }
}

impl UbxSource {
    fn parse(&mut self, bytes: &[u8], broken: &'static str, issues: &mut Issues) {
        let mut packets = self.parser.consume_ubx(bytes);
        while let Some(packet) = packets.next() {
            match packet {
                Ok(UbxPacket::Proto23(PacketRef::NavPvt(pvt))) => {
                    // Validity bits, fix type and flags as the receiver sent them.
                    match time_ns(&pvt) {
                        Some(time_ns) => {
                            let samples = samples(&pvt).into_iter().flatten();
                            let events = samples.map(|sample| Event { time_ns, sample });
                            self.events.extend(events);
                        }
                        None => issues.reject(reason::NO_TIME),
                    }
                }
                Err(ParserError::InvalidChecksum { .. }) => issues.reject(broken),
                // Other messages, among them those of newer receivers that the parser does not know.
                Ok(_) | Err(_) => {}
            }
        }
    }
}

type Pvt<'a> = ublox::nav_pvt::proto23::NavPvtRef<'a>;

/// Nanoseconds since 1970, UTC; `None` while the receiver does not know it.
fn time_ns(pvt: &Pvt<'_>) -> Option<i64> {
    let valid = pvt.valid();
    if !valid.contains(NavPvtValidFlags::VALID_DATE | NavPvtValidFlags::VALID_TIME) {
        return None;
    }
    let date = NaiveDate::from_ymd_opt(
        i32::from(pvt.year()),
        u32::from(pvt.month()),
        u32::from(pvt.day()),
    )?;
    // The sixtieth second of a leap second is the first one of the next minute.
    let of_day = i64::from(pvt.hour()) * 3600 + i64::from(pvt.min()) * 60 + i64::from(pvt.sec());
    let midnight = date.and_hms_opt(0, 0, 0)?.and_utc().timestamp_nanos_opt()?;
    midnight
        .checked_add(of_day * 1_000_000_000)?
        .checked_add(i64::from(pvt.nanosec()))
}

/// Fix, velocity and, of a receiver that knows it, the heading of the vehicle.
fn samples(pvt: &Pvt<'_>) -> [Option<Sample>; 3] {
    let quality = quality(pvt);
    let is_flat = pvt.fix_type() == GnssFixType::Fix2D;
    // The horizontal accuracy is a radius.
    let horizontal = pvt.horizontal_accuracy() * std::f64::consts::FRAC_1_SQRT_2;
    let fix = GnssPosition {
        latitude_rad: pvt.latitude().to_radians(),
        longitude_rad: pvt.longitude().to_radians(),
        height_m: (!is_flat).then(|| pvt.height_above_ellipsoid()),
        std_m: Some([horizontal, horizontal, pvt.vertical_accuracy()]),
        hdop: None,
        satellites: Some(pvt.num_satellites()),
        quality,
    };
    let velocity = GnssVelocity {
        north_m_s: pvt.vel_north(),
        east_m_s: pvt.vel_east(),
        down_m_s: (!is_flat).then(|| pvt.vel_down()),
        std_m_s: Some([pvt.speed_accuracy(); 3]),
    };
    let heading = TrueHeading {
        heading_rad: pvt.heading_vehicle().to_radians(),
        std_rad: Some(pvt.heading_accuracy().to_radians()),
    };
    let is_valid = quality != GnssQuality::Invalid;
    let has_heading = is_valid && pvt.flags().contains(NavPvtFlags::HEAD_VEH_VALID);
    [
        Some(Sample::GnssPosition(fix)),
        is_valid.then_some(Sample::GnssVelocity(velocity)),
        has_heading.then_some(Sample::TrueHeading(heading)),
    ]
}

fn quality(pvt: &Pvt<'_>) -> GnssQuality {
    let flags = pvt.flags();
    let is_fix = matches!(
        pvt.fix_type(),
        GnssFixType::Fix2D | GnssFixType::Fix3D | GnssFixType::GPSPlusDeadReckoning
    );
    if pvt.fix_type() == GnssFixType::DeadReckoningOnly {
        GnssQuality::Estimated
    } else if !is_fix || !flags.contains(NavPvtFlags::GPS_FIX_OK) {
        GnssQuality::Invalid
    } else if flags.contains(NavPvtFlags::CARR_SOLN_FIXED) {
        GnssQuality::RtkFixed
    } else if flags.contains(NavPvtFlags::CARR_SOLN_FLOAT) {
        GnssQuality::RtkFloat
    } else if flags.contains(NavPvtFlags::DIFF_SOLN) {
        GnssQuality::Differential
    } else {
        GnssQuality::Autonomous
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{Format, OpenOptions};
    use proptest::prelude::*;

    /// A frame with its checksum.
    fn frame(class: u8, id: u8, payload: &[u8]) -> Vec<u8> {
        let mut frame = vec![class, id];
        frame.extend_from_slice(&(payload.len() as u16).to_le_bytes());
        frame.extend_from_slice(payload);
        let (a, b) = frame.iter().fold((0_u8, 0_u8), |(a, b), byte| {
            let a = a.wrapping_add(*byte);
            (a, b.wrapping_add(a))
        });
        [&SYNC[..], &frame, &[a, b]].concat()
    }

    /// NAV-PVT of 2020-06-01 12:30:`second` at 47 N, 8 W, with these validity bits, fix type and flags.
    fn pvt(second: u8, valid: u8, fix_type: u8, flags: u8) -> Vec<u8> {
        let mut payload = [0_u8; 92];
        let mut put =
            |at: usize, bytes: &[u8]| payload[at..at + bytes.len()].copy_from_slice(bytes);
        put(4, &2020_u16.to_le_bytes());
        put(6, &[6, 1, 12, 30, second, valid]);
        put(16, &(-250_000_000_i32).to_le_bytes());
        put(20, &[fix_type, flags, 0, 11]);
        put(24, &(-80_000_000_i32).to_le_bytes());
        put(28, &470_000_000_i32.to_le_bytes());
        put(32, &512_345_i32.to_le_bytes());
        put(40, &2000_u32.to_le_bytes());
        put(44, &3000_u32.to_le_bytes());
        put(48, &1500_i32.to_le_bytes());
        put(52, &(-2500_i32).to_le_bytes());
        put(56, &100_i32.to_le_bytes());
        put(68, &50_u32.to_le_bytes());
        put(72, &100_000_u32.to_le_bytes());
        put(84, &9_000_000_i32.to_le_bytes());
        frame(1, 7, &payload)
    }

    fn read(bytes: &[u8]) -> (Vec<Event>, Issues) {
        let options = OpenOptions {
            format: Some(Format::Ubx),
            ..OpenOptions::default()
        };
        let mut recording = crate::read_bytes(bytes.to_vec(), "test.ubx", &options).unwrap();
        let events = recording
            .by_ref()
            .map_while(std::result::Result::ok)
            .collect();
        (events, recording.issues().clone())
    }

    #[test]
    fn a_solution_is_a_fix_a_velocity_and_a_heading() {
        let bytes = pvt(10, 7, 3, 0x01 | 0x20 | 0x80);
        assert!(recognises(&bytes));
        let (events, issues) = read(&bytes);
        assert!(issues.is_empty(), "{issues:?}");
        assert_eq!(events.len(), 3);
        assert!(
            events
                .iter()
                .all(|e| e.time_ns == 1_591_014_609_750_000_000)
        );
        let Sample::GnssPosition(fix) = events[0].sample else {
            panic!("{events:?}")
        };
        approx::assert_relative_eq!(fix.latitude_rad.to_degrees(), 47.0, epsilon = 1e-9);
        approx::assert_relative_eq!(fix.longitude_rad.to_degrees(), -8.0, epsilon = 1e-9);
        approx::assert_relative_eq!(fix.height_m.unwrap(), 512.345, epsilon = 1e-9);
        approx::assert_relative_eq!(fix.std_m.unwrap()[0], 2_f64.sqrt(), epsilon = 1e-9);
        approx::assert_relative_eq!(fix.std_m.unwrap()[2], 3.0, epsilon = 1e-9);
        assert_eq!(
            (fix.satellites, fix.quality),
            (Some(11), GnssQuality::RtkFixed)
        );
        let Sample::GnssVelocity(v) = events[1].sample else {
            panic!("{events:?}")
        };
        approx::assert_relative_eq!(v.north_m_s, 1.5);
        approx::assert_relative_eq!(v.east_m_s, -2.5);
        approx::assert_relative_eq!(v.down_m_s.unwrap(), 0.1);
        let Sample::TrueHeading(h) = events[2].sample else {
            panic!("{events:?}")
        };
        approx::assert_relative_eq!(h.heading_rad.to_degrees(), 90.0, epsilon = 1e-9);
        approx::assert_relative_eq!(h.std_rad.unwrap().to_degrees(), 1.0, epsilon = 1e-9);
    }

    #[test]
    fn invalid_fixes_and_unknown_times_are_counted() {
        let bytes = [
            pvt(1, 7, 3, 0),    // not within the receiver's own masks
            pvt(2, 7, 0, 1),    // no fix
            pvt(3, 7, 5, 1),    // time only
            pvt(4, 1, 3, 1),    // the time is not known
            pvt(5, 7, 1, 1),    // dead reckoning
            pvt(6, 7, 2, 1),    // two-dimensional
            pvt(7, 7, 3, 0x43), // RTK float
        ]
        .concat();
        let (events, issues) = read(&bytes);
        assert_eq!(issues.invalid_fixes[&SensorKind::GnssPosition], 3);
        assert_eq!(issues.rejected[reason::NO_TIME], 1);
        let fixes: Vec<GnssPosition> = events
            .iter()
            .filter_map(|e| match e.sample {
                Sample::GnssPosition(fix) => Some(fix),
                _ => None,
            })
            .collect();
        use GnssQuality::{Autonomous, Estimated, RtkFloat};
        let qualities: Vec<_> = fixes.iter().map(|fix| fix.quality).collect();
        assert_eq!(qualities, [Estimated, Autonomous, RtkFloat]);
        assert!(!fixes[0].is_usable());
        assert_eq!(fixes[1].height_m, None);
    }

    #[test]
    fn other_protocols_and_damage_are_passed_over() {
        let mut broken = pvt(2, 7, 3, 1);
        broken[30] ^= 1;
        // A header that promises more than there is, with a whole frame inside.
        let promise = [&SYNC[..], &[1, 7, 200, 0], &pvt(4, 7, 3, 1)].concat();
        let bytes = [
            &b"$GPGGA,123519,4807.038,N,01131.324,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n\xd3\x00\x13"[..],
            &pvt(1, 7, 3, 1),
            &broken,
            &frame(0x0a, 4, b"ROM CORE"),
            &pvt(3, 7, 3, 1),
            &promise,
        ]
        .concat();
        let (events, issues) = read(&bytes);
        let seconds: Vec<i64> = events
            .iter()
            .filter(|e| e.sample.kind() == SensorKind::GnssPosition)
            .map(|e| (e.time_ns / 250_000_000 - 6_364_058_400) / 4)
            .collect();
        assert_eq!(seconds.len(), 3, "{events:?}");
        assert_eq!(issues.rejected[reason::CHECKSUM], 1);
        assert_eq!(issues.rejected[reason::CUT_OFF], 1);
    }

    #[test]
    fn texts_and_tables_are_no_frames() {
        for text in [
            &b""[..],
            b"\xb5\x62",
            b"\xb5\x62\x01\x07\x00\x00\x00\x00",
            b"t_s,gyro_x_rad_s\n",
        ] {
            assert!(!recognises(text), "{text:?}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_counted(
            pieces in proptest::collection::vec(
                (any::<bool>(), proptest::collection::vec(any::<u8>(), 0..60), any::<[u8; 4]>()),
                0..12,
            ),
        ) {
            let mut bytes = Vec::new();
            for (whole, noise, [second, valid, fix, flags]) in pieces {
                if whole {
                    bytes.extend(pvt(second, valid, fix, flags));
                }
                bytes.extend(noise);
            }
            let _ = recognises(&bytes);
            let (events, _) = read(&bytes);
            prop_assert!(events.iter().all(|event| event.sample.is_finite()));
        }
    }
}
