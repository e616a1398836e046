//! A navigation world as the events of a recording: samples, fixes, and the true place of the antenna.

use northing_core::earth::wgs84::{Geodetic, LocalFrame};
use northing_recording::{Event, GnssPosition, GnssQuality, GnssVelocity, Sample};
use northing_simulation::navigation_world::{NavigationWorld, WorldFix, WorldSample};

/// Where the worlds of navigation lie: gravity there is that of the worlds.
const LATITUDE_RAD: f64 = 0.793_5;
const LONGITUDE_RAD: f64 = 0.15;
/// Between two positions of the truth, s.
const TRUTH_EVERY_S: f64 = 0.1;

/// The local frame whose origin is that of the worlds.
#[must_use]
pub fn world_frame() -> LocalFrame {
    LocalFrame::new(Geodetic {
        latitude_rad: LATITUDE_RAD,
        longitude_rad: LONGITUDE_RAD,
        height_m: 0.0,
    })
}

/// Samples, fixes and truth of a world as a recording has them.
#[must_use]
pub fn events(world: &NavigationWorld) -> Vec<Event> {
    let frame = world_frame();
    let mut events: Vec<Event> = Vec::with_capacity(3 * world.samples.len());
    let mut next_s = 0.0;
    for sample in &world.samples {
        let time_ns = sample.stamp_ns;
        let measured = [
            Sample::AngularRate(sample.angular_rate),
            Sample::SpecificForce(sample.specific_force),
        ];
        events.extend(measured.map(|sample| Event { time_ns, sample }));
        if sample.time_s + 1e-9 >= next_s {
            next_s += TRUTH_EVERY_S;
            events.push(truth(&frame, sample));
        }
    }
    events.extend(world.fixes.iter().flat_map(|fix| fixes(&frame, fix)));
    events.sort_by_key(Event::place);
    events
}

fn truth(frame: &LocalFrame, sample: &WorldSample) -> Event {
    Event {
        time_ns: sample.stamp_ns,
        sample: Sample::ReferencePosition(position(frame, &sample.antenna, None)),
    }
}

fn fixes(frame: &LocalFrame, fix: &WorldFix) -> impl Iterator<Item = Event> + use<> {
    let [place, std] = fix.position;
    let position = Sample::GnssPosition(position(frame, &place, Some(std.into())));
    let velocity = fix.velocity.map(|[velocity, std]| {
        Sample::GnssVelocity(GnssVelocity {
            north_m_s: velocity.x,
            east_m_s: velocity.y,
            down_m_s: Some(velocity.z),
            std_m_s: Some(std.into()),
        })
    });
    let time_ns = fix.stamp_ns;
    let samples = core::iter::once(position).chain(velocity);
    samples.map(move |sample| Event { time_ns, sample })
}

fn position(
    frame: &LocalFrame,
    ned: &nalgebra::Vector3<f64>,
    std_m: Option<[f64; 3]>,
) -> GnssPosition {
    let place = frame.geodetic(ned);
    GnssPosition {
        latitude_rad: place.latitude_rad,
        longitude_rad: place.longitude_rad,
        height_m: Some(place.height_m),
        std_m,
        hdop: None,
        satellites: None,
        quality: GnssQuality::Autonomous,
    }
}
