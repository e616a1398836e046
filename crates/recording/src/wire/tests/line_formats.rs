//! The line protocols: Linköping, HyperIMU, SensorStreamer.

use super::{said, vectors};
use crate::event::{Sample, SensorKind};
use crate::wire::hyperimu::HyperImu;
use crate::wire::linkoping::Linkoping;
use crate::wire::sensorstreamer::SensorStreamer;

#[test]
fn linkoping_lines_become_events() {
    let text = "1000\tACC\t0\t1.5\t9.8\r\n1000\tGYR\t0,25\t0\t-1e-3\n1001\tMAG\t1\t2\t3\n\
        1001\tPRS\t1013.25\n1002\tORI\t0.6\t0\t0\n1002\tRSSWIFI\tx\ty\n";
    let out = Linkoping::default().push(text.as_bytes());
    assert_eq!(vectors(&out, SensorKind::Accelerometer), [[0.0, 1.5, 9.8]]);
    assert_eq!(vectors(&out, SensorKind::Gyroscope), [[0.25, 0.0, -1e-3]]);
    assert_eq!(vectors(&out, SensorKind::Magnetometer), [[1.0, 2.0, 3.0]]);
    assert!(
        out.events
            .iter()
            .any(|e| e.sample == Sample::Pressure(101_325.0))
    );
    let Some(Sample::DeviceOrientation(q)) = out.events.last().map(|e| e.sample) else {
        panic!("no orientation");
    };
    approx::assert_relative_eq!(q.w, 0.8, epsilon = 1e-12);
    assert_eq!(out.events[0].time_ns, 1_000_000_000);
    assert!(out.notices.is_empty(), "{:?}", out.notices);
}

#[test]
fn linkoping_lines_that_cannot_be_used_are_said() {
    let out =
        Linkoping::default().push(b"GET / HTTP/1.1\n5\tACC\t1\t2\n6\tXYZ\t1\n7\tACC\t0\t0\t9.8\n");
    assert_eq!(out.events.len(), 1);
    assert!(said(&out, "does not start with a time"));
    assert!(said(&out, "a number is missing"));
    assert!(said(&out, "XYZ is not used"));
}

#[test]
fn hyperimu_takes_the_users_order() {
    let mut decoder = HyperImu::with_order(&[SensorKind::Gyroscope, SensorKind::Accelerometer]);
    let out = decoder.push_datagram(b"1500,1,2,3,4,5,6,7,8,9");
    assert_eq!(vectors(&out, SensorKind::Gyroscope), [[1.0, 2.0, 3.0]]);
    assert_eq!(vectors(&out, SensorKind::Accelerometer), [[4.0, 5.0, 6.0]]);
    assert_eq!(out.events[0].time_ns, 1_500_000_000);
    let out = decoder.push_datagram(b"1600,1,2,3,4\nx\n");
    assert_eq!(out.events.len(), 1);
    assert!(said(&out, "a number is missing") && said(&out, "time in ms"));
    let out = decoder.push_datagram(b"{\"Gyroscope\":[1,2,3]}");
    assert!(said(&out, "no `Timestamp`"));
}

#[test]
fn sensorstreamer_names_its_sensors() {
    let text = "{\"gyroscope\":{\"value\":[1,2,3],\"timestamp\":7},\"light\":{\"value\":[1],\"timestamp\":7},\
        \"accelerometer\":{\"value\":[1,2,3]}}\n{\"rotationVector\":{\"value\":[0,0,1,0],\"timestamp\":8}}\nnonsense\n";
    let out = SensorStreamer::default().push(text.as_bytes());
    assert_eq!(vectors(&out, SensorKind::Gyroscope), [[1.0, 2.0, 3.0]]);
    assert_eq!(out.events.len(), 2);
    for part in [
        "light is not used",
        "accelerometer was left out",
        "not JSON",
    ] {
        assert!(said(&out, part), "{part}: {:?}", out.notices);
    }
}
