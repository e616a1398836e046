//! A walk along a figure of eight, as a Razor board and a GNSS receiver send it: 50 Hz and 1 Hz.
//!
//! Ten seconds at rest, then the pace rises to about 1.5 m/s. Sensors are those of the paper's board:
//! 0.2 deg/s, 0.03 m/s^2, biases of 0.5 deg/s and 0.05 m/s^2; fixes are off by 2.5 m on each horizontal
//! axis. Everything follows from the seed.

use std::f64::consts::TAU;

use northing_core::nalgebra::{UnitQuaternion, Vector3};
use northing_simulation::random::{Stream, normal_vector, stream};
use northing_simulation::sensors::{ErrorModel, SensorErrors};
use northing_simulation::trajectory::mean_rate;

use crate::Tick;

/// From frame to frame, s.
const INTERVAL_S: f64 = 0.02;
const REST_S: f64 = 10.0;
/// The pace rises for so long, s.
const RAMP_S: f64 = 5.0;
/// Half axes of the figure, m, and how long once round takes, s.
const SIZE_M: [f64; 2] = [60.0, 20.0];
const ROUND_S: f64 = 200.0;
/// How long the walk takes until it is back where it began, s.
pub const ONCE_ROUND_S: f64 = REST_S + RAMP_S / 2.0 + ROUND_S;
/// The seed of the walk whose figures are shown.
pub const SEED: u64 = 7;
/// Where the walk begins: degrees, and metres above the ellipsoid.
pub const ORIGIN: [f64; 3] = [53.117_3, 23.143_4, 176.5];
/// Separation of the geoid, m.
const GEOID_M: f64 = 34.2;
const GRAVITY: f64 = 9.806_65;
/// Squared eccentricity and semi-major axis of the ellipsoid.
const ECCENTRICITY_SQUARED: f64 = 6.694_379_99e-3;
const SEMI_MAJOR_M: f64 = 6_378_137.0;

/// Truth at one frame: north, east, down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// `ned_from_body`.
    pub attitude: UnitQuaternion<f64>,
    /// m.
    pub position: Vector3<f64>,
    /// m/s.
    pub velocity: Vector3<f64>,
}

/// The walk.
#[derive(Debug)]
pub struct Walk {
    /// One a frame.
    pub ticks: Vec<Tick>,
    /// Truth at each.
    pub truth: Vec<Truth>,
}

impl Walk {
    /// So many seconds of it.
    #[must_use]
    pub fn new(seed: u64, duration_s: f64) -> Self {
        let frames = (duration_s / INTERVAL_S).round() as u32;
        let mut sensors = Sensors::new(seed);
        let mut walk = Self {
            ticks: Vec::new(),
            truth: Vec::new(),
        };
        let mut before = truth(0.0).0;
        for frame in 1..=frames {
            let (now, acceleration) = truth(f64::from(frame) * INTERVAL_S);
            let rate = mean_rate(&before.attitude, &now.attitude, INTERVAL_S);
            let force = now.attitude.inverse() * (acceleration - Vector3::z() * GRAVITY);
            let imu = sensors.frame(&now, &rate, &force).into_bytes();
            let gnss = if frame % 50 == 0 {
                sensors.fix(frame / 50, &now).into_bytes()
            } else {
                Vec::new()
            };
            walk.ticks.push(Tick { ms: 20, imu, gnss });
            walk.truth.push(now);
            before = now;
        }
        walk
    }
}

/// The angle along the figure (rad) at `since` seconds after the rest, and its two derivatives.
fn along(since: f64) -> [f64; 3] {
    let w = TAU / ROUND_S;
    if since <= 0.0 {
        [0.0; 3]
    } else if since < RAMP_S {
        let growth = w / RAMP_S;
        [growth * since * since / 2.0, growth * since, growth]
    } else {
        [w * (since - RAMP_S / 2.0), w, 0.0]
    }
}

/// Truth and acceleration at `t_s`.
fn truth(t_s: f64) -> (Truth, Vector3<f64>) {
    let since = t_s - REST_S;
    let [angle, pace, growth] = along(since);
    let [north, east] = SIZE_M;
    let place = Vector3::new(north * angle.sin(), east * (2.0 * angle).sin(), 0.0);
    let slope = Vector3::new(north * angle.cos(), 2.0 * east * (2.0 * angle).cos(), 0.0);
    let bend = Vector3::new(-place.x, -4.0 * place.y, 0.0);
    // Steps: two a second, 4 cm up and down at full pace, and a body that sways.
    let step = TAU * 1.9;
    let share = pace * ROUND_S / TAU;
    let (up, up_rate) = (
        0.04 * (step * since).sin(),
        0.04 * step * (step * since).cos(),
    );
    let roll = 0.05 + 0.06 * share * (step / 2.0 * since).sin();
    let pitch = -0.08 + 0.04 * share * (step * since).sin();
    let truth = Truth {
        attitude: UnitQuaternion::from_euler_angles(roll, pitch, slope.y.atan2(slope.x)),
        position: place + Vector3::z() * (share * up),
        velocity: slope * pace + Vector3::z() * (share * up_rate),
    };
    let bounce = Vector3::z() * (-share * step * step * up);
    (truth, slope * growth + bend * pace * pace + bounce)
}

struct Sensors {
    gyroscope: SensorErrors,
    accelerometer: SensorErrors,
    magnetometer: SensorErrors,
    fixes: Stream,
}

impl Sensors {
    fn new(seed: u64) -> Self {
        let sensor = |name: &str, noise_std, bias_std, bias_random_walk| {
            let model = ErrorModel {
                noise_std,
                bias_std,
                bias_random_walk,
                ..ErrorModel::default()
            };
            SensorErrors::new(seed, name, &model, 1.0 / INTERVAL_S)
        };
        Self {
            gyroscope: sensor(
                "gyroscope",
                0.2_f64.to_radians(),
                0.5_f64.to_radians(),
                3e-5,
            ),
            accelerometer: sensor("accelerometer", 0.03, 0.05, 0.0),
            magnetometer: sensor("magnetometer", 0.3, 0.0, 0.0),
            fixes: stream(seed, "fixes"),
        }
    }

    /// The three lines of a frame.
    fn frame(&mut self, truth: &Truth, rate: &Vector3<f64>, force: &Vector3<f64>) -> String {
        let field = truth.attitude.inverse() * Vector3::new(19.0, 0.0, 46.0);
        let a = self.accelerometer.measure(force) * (-256.0 / GRAVITY);
        let m = self.magnetometer.measure(&field) * 10.0;
        let g = self.gyroscope.measure(rate) / 0.069_57_f64.to_radians();
        let line =
            |name: char, v: Vector3<f64>| format!("#{name}-C={:.2},{:.2},{:.2}\r\n", v.x, v.y, v.z);
        line('A', a) + &line('M', m) + &line('G', g)
    }

    /// The two sentences of a fix.
    fn fix(&mut self, second: u32, truth: &Truth) -> String {
        let noise = normal_vector(&mut self.fixes, 1.0);
        let off = Vector3::new(2.5 * noise.x, 2.5 * noise.y, 5.0 * noise.z);
        fix_sentences(second, &(truth.position + off), &truth.velocity)
    }
}

/// GGA and RMC of a position and velocity, north, east, down, so many seconds after noon.
#[must_use]
pub fn fix_sentences(second: u32, position: &Vector3<f64>, velocity: &Vector3<f64>) -> String {
    let time = format!(
        "{:02}{:02}{:02}.000",
        (12 + second / 3600) % 24,
        second / 60 % 60,
        second % 60
    );
    let [latitude, longitude, height] = degrees(position);
    let place = format!("{},N,0{},E", minutes(latitude), minutes(longitude));
    let altitude = height - GEOID_M;
    let gga = format!("GPGGA,{time},{place},1,09,0.92,{altitude:.1},M,{GEOID_M:.1},M,,");
    let knots = velocity.xy().norm() * 3600.0 / 1852.0;
    let course = velocity.y.atan2(velocity.x).to_degrees().rem_euclid(360.0);
    let rmc = format!("GPRMC,{time},A,{place},{knots:.2},{course:.2},230394,,,A");
    sentence(&gga) + &sentence(&rmc)
}

/// Latitude and longitude (deg) and height (m) of a position, north, east, down from where the walk begins.
#[must_use]
pub fn degrees(position: &Vector3<f64>) -> [f64; 3] {
    let [latitude, longitude, height] = ORIGIN;
    let [north, east] = metres_per_radian();
    [
        latitude + (position.x / north).to_degrees(),
        longitude + (position.y / east).to_degrees(),
        height - position.z,
    ]
}

/// Metres a radian of latitude and of longitude: over small distances the radii at the origin do.
fn metres_per_radian() -> [f64; 2] {
    let [latitude, _, height] = ORIGIN;
    let (sin, cos) = latitude.to_radians().sin_cos();
    let w2 = 1.0 - ECCENTRICITY_SQUARED * sin * sin;
    let normal = SEMI_MAJOR_M / w2.sqrt();
    let meridian = normal * (1.0 - ECCENTRICITY_SQUARED) / w2;
    [meridian + height, (normal + height) * cos]
}

/// Where a latitude and a longitude (1e-7 deg) are: north and east of where the walk begins, m.
#[must_use]
pub fn place(latitude_e7: f64, longitude_e7: f64) -> [f64; 2] {
    let [latitude, longitude, _] = ORIGIN;
    let [north, east] = metres_per_radian();
    [
        (latitude_e7 * 1e-7 - latitude).to_radians() * north,
        (longitude_e7 * 1e-7 - longitude).to_radians() * east,
    ]
}

/// Degrees as `ddmm.mmmmm`.
fn minutes(degrees: f64) -> String {
    format!("{:02}{:08.5}", degrees.floor(), degrees.fract() * 60.0)
}

/// A sentence with its checksum and end.
#[must_use]
pub fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}
