//! Solutions of RTKLIB, tables of EuRoC, GPX and trajectories of any bytes: read or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{Format, OpenOptions, read_bytes};

const RTKLIB: &[u8] = b"%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n";
const EUROC: &[u8] = b"#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
const GPX: &[u8] = b"<gpx version=\"1.1\" creator=\"x\"><trk><trkseg>";

fuzz_target!(|bytes: &[u8]| {
    let kinds: [(Format, &[u8]); 4] = [
        (Format::Rtklib, RTKLIB),
        (Format::Euroc, EUROC),
        (Format::Gpx, GPX),
        (Format::Tum, b""),
    ];
    for (format, head) in kinds {
        let options = OpenOptions {
            format: Some(format),
            ..OpenOptions::default()
        };
        for bytes in [bytes.to_vec(), [head, bytes].concat()] {
            if let Ok(recording) = read_bytes(bytes, "fuzz.txt", &options) {
                let _ = recording.map_while(Result::ok).count();
            }
        }
    }
});
