//! Voyages and flights: the origin of the local frame moves with the vehicle, however far it goes.

#![allow(clippy::unwrap_used)]

use std::convert::Infallible;

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use northing_core::earth::Geodetic;
use northing_core::earth::wgs84::{LocalFrame, Radii};
use northing_core::geometry::{rotation, so3};
use northing_evaluation::navigation::{
    AidKind, NavigationEstimate, NavigationKind, NavigationObserver, NavigationOptions,
    NavigationSummary, ScoredPoint, run_navigation,
};
use northing_recording::{
    Event, GnssPosition, GnssQuality, GnssVelocity, Reference, Sample, TrueHeading, WaterVelocity,
    WorldFrame,
};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

const GRAVITY: f64 = 9.806_65;
const STEP_S: f64 = 0.1;
const POSITION_STD: [f64; 3] = [1.0, 1.0, 2.0];
const VELOCITY_STD: f64 = 0.1;

/// Where a vehicle is that goes where it points: no rotation of the Earth.
#[derive(Clone, Copy)]
struct Truth {
    place: Geodetic,
    course: f64,
    speed: f64,
    /// How fast the course turns at most, rad/s.
    winding: f64,
}

impl Truth {
    /// Moves on along the ellipsoid, with a course that winds slowly about the great circle.
    fn step(&mut self, t: f64, dt: f64) {
        let winding = self.winding * (0.05 * (t + 0.5 * dt)).cos() * dt;
        // With course and latitude of mid-step.
        let begins = *self;
        self.course += 0.5 * winding;
        let way = 0.5 * self.speed * dt;
        self.go(way);
        let (course, latitude) = (self.course, self.place.latitude_rad);
        *self = Self { course, ..begins };
        self.place.latitude_rad = latitude;
        self.go(2.0 * way);
        self.place.latitude_rad += begins.place.latitude_rad - latitude;
        self.course += 0.5 * winding;
    }

    /// So many metres on along a great circle, as course and latitude of now have it.
    fn go(&mut self, way: f64) {
        let (sin, cos) = self.course.sin_cos();
        let radii = Radii::at(self.place.latitude_rad);
        let longitude = way * sin
            / ((radii.prime_vertical_m + self.place.height_m) * self.place.latitude_rad.cos());
        // The course of a great circle turns by the convergence of the meridians.
        self.course += longitude * self.place.latitude_rad.sin();
        self.place.latitude_rad += way * cos / (radii.meridian_m + self.place.height_m);
        self.place.longitude_rad += longitude;
    }

    /// `ecef_from_ned`.
    fn axes(&self) -> Rotation3<f64> {
        Rotation3::from_matrix_unchecked(self.place.ned_from_ecef().transpose())
    }

    fn ned_from_body(&self) -> UnitQuaternion<f64> {
        rotation::from_yaw_pitch_roll([self.course, 0.0, 0.0])
    }

    fn ecef_from_body(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_rotation_matrix(&self.axes()) * self.ned_from_body()
    }

    fn velocity(&self) -> Vector3<f64> {
        Vector3::new(self.course.cos(), self.course.sin(), 0.0) * self.speed
    }

    fn fix(&self, off: &Vector3<f64>) -> GnssPosition {
        let place = LocalFrame::new(self.place).geodetic(off);
        GnssPosition {
            latitude_rad: place.latitude_rad,
            longitude_rad: place.longitude_rad,
            height_m: Some(place.height_m),
            std_m: Some(POSITION_STD),
            quality: GnssQuality::Autonomous,
            ..GnssPosition::default()
        }
    }
}

/// A flight at `speed` from one place, seen by an inertial unit at 10 Hz and a receiver at 1 Hz; from some
/// second on over another place.
struct Flight {
    speed: f64,
    winding: f64,
    duration_s: f64,
    begins: [f64; 2],
    elsewhere: Option<(f64, [f64; 2])>,
}

impl Flight {
    fn begin(&self, [latitude, longitude]: [f64; 2]) -> Truth {
        Truth {
            place: Geodetic::from_degrees(latitude, longitude, 9000.0).unwrap(),
            course: 1.0,
            speed: self.speed,
            winding: self.winding,
        }
    }

    fn events(&self) -> impl Iterator<Item = Event> + use<> {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut noise = move |std: f64| {
            Vector3::from_fn(|_, _| {
                let drawn: f64 = StandardNormal.sample(&mut random);
                drawn * std
            })
        };
        let mut now = self.begin(self.begins);
        let mut before = now;
        let elsewhere = self
            .elsewhere
            .map(|(from_s, place)| (from_s, self.begin(place)));
        let steps = (self.duration_s / STEP_S) as i64;
        (0..steps).flat_map(move |k| {
            let t = k as f64 * STEP_S;
            if let Some((from_s, place)) = elsewhere
                && t >= from_s
                && t < from_s + STEP_S
            {
                (now, before) = (place, place);
            }
            let mut after = now;
            after.step(t, STEP_S);
            // At the instant, from both sides.
            let velocity = |truth: &Truth| truth.axes() * truth.velocity();
            let gained = (velocity(&after) - velocity(&before)) / (2.0 * STEP_S);
            let down = now.axes() * Vector3::z() * GRAVITY;
            let body = now.ecef_from_body().inverse();
            let force = body * (gained - down) + noise(0.05) + Vector3::new(0.03, -0.02, 0.01);
            let turned = before.ecef_from_body().inverse() * after.ecef_from_body();
            let rate = so3::log(&turned) / (2.0 * STEP_S) + noise(0.002) + Vector3::repeat(1e-3);
            let mut samples = vec![Sample::AngularRate(rate), Sample::SpecificForce(force)];
            if k % 10 == 0 {
                let [across, _, down] = POSITION_STD;
                let off = noise(1.0).component_mul(&Vector3::new(across, across, down));
                let moved = now.velocity() + noise(VELOCITY_STD);
                samples.push(Sample::GnssPosition(now.fix(&off)));
                samples.push(Sample::GnssVelocity(GnssVelocity {
                    north_m_s: moved.x,
                    east_m_s: moved.y,
                    down_m_s: Some(moved.z),
                    std_m_s: Some([VELOCITY_STD; 3]),
                }));
                samples.push(Sample::ReferencePosition(now.fix(&Vector3::zeros())));
                samples.push(Sample::Reference(Reference {
                    attitude: now.ned_from_body(),
                    scored: true,
                }));
            }
            (before, now) = (now, after);
            let time_ns = (t * 1e9).round() as i64;
            samples
                .into_iter()
                .map(move |sample| Event { time_ns, sample })
        })
    }
}

fn run(
    events: impl Iterator<Item = Event>,
    estimator: NavigationKind,
    smooth: bool,
    observer: &mut dyn NavigationObserver,
) -> NavigationSummary {
    let options = NavigationOptions {
        estimator,
        smooth,
        score_from_s: 60.0,
        ..NavigationOptions::default()
    };
    let events = events.map(Ok::<_, Infallible>);
    run_navigation(events, "flight", WorldFrame::Ned, &options, observer).unwrap()
}

/// The way, as the estimates tell it: its ends, and the largest step between two of them.
#[derive(Default)]
struct Way {
    first: Option<Geodetic>,
    last: Option<Geodetic>,
    last_ecef: Option<Vector3<f64>>,
    furthest_from_origin_m: f64,
    longest_step_m: f64,
    last_error_m: f64,
}

impl NavigationObserver for Way {
    fn interval_ns(&self) -> i64 {
        1_000_000_000
    }

    fn scored(&mut self, point: &ScoredPoint) {
        self.last_error_m = point.error.xy().norm();
    }

    fn estimate(&mut self, estimate: &NavigationEstimate) {
        if estimate.time_ns < 60_000_000_000 {
            return;
        }
        let place = estimate.frame.geodetic(&estimate.position);
        self.first.get_or_insert(place);
        self.last = Some(place);
        let ecef = place.to_ecef();
        if let Some(last) = self.last_ecef.replace(ecef) {
            self.longest_step_m = self.longest_step_m.max((ecef - last).norm());
        }
        let away = estimate.position.xy().norm();
        self.furthest_from_origin_m = self.furthest_from_origin_m.max(away);
    }
}

#[test]
fn a_flight_of_3000_km_is_followed_to_its_end() {
    let flight = Flight {
        speed: 250.0,
        winding: 0.02,
        duration_s: 12_000.0,
        begins: [48.0, 2.0],
        elsewhere: None,
    };
    let mut way = Way::default();
    let summary = run(flight.events(), NavigationKind::ErrorState, false, &mut way);
    let ends = [way.first, way.last].map(|place| place.unwrap().to_ecef());
    assert!((ends[1] - ends[0]).norm() > 2.8e6);
    assert!(way.furthest_from_origin_m < 1500.0);
    assert!(way.longest_step_m < 420.0, "{} m", way.longest_step_m);
    let position = summary.position.clone().unwrap();
    println!(
        "{position:?}, heading {:?}, tilt {:?}, {:?}",
        summary.heading, summary.tilt_rmse_deg, summary.validity
    );
    assert!(position.horizontal_rmse_m < 1.41, "{position:?}");
    assert!(position.vertical_rmse_m.unwrap() < 1.5, "{position:?}");
    assert!(position.inside_95 > 0.9, "{position:?}");
    let heading = summary.heading_rmse_deg.unwrap();
    assert!(heading < 1.5, "{heading} deg");
    assert!(summary.tilt_rmse_deg.unwrap() < 0.6);
    assert!(summary.velocity_rmse_m_s.unwrap_or(0.0) < 0.2);
    assert_eq!(summary.issues, Vec::<String>::new());
    assert_eq!(summary.fixes_given, 12_000);
    for (kind, aid) in &summary.aids {
        let (updates, nis) = (&aid.updates, aid.nis.as_ref());
        assert!(updates.gated <= 2, "{kind:?}: {updates:?}");
        if matches!(kind, AidKind::GnssPosition | AidKind::GnssVelocity) {
            let nis = nis.unwrap();
            let share = nis.mean / f64::from(nis.degrees_of_freedom);
            assert!((0.5..1.3).contains(&share), "{kind:?}: {nis:?}");
            assert!(nis.share_above_99 < 0.02, "{kind:?}: {nis:?}");
        }
    }
}

#[test]
fn a_receiver_that_is_switched_on_1100_km_away_is_followed() {
    let flight = Flight {
        speed: 120.0,
        winding: 0.01,
        duration_s: 340.0,
        begins: [48.0, 2.0],
        elsewhere: Some((240.0, [58.0, 3.0])),
    };
    let mut way = Way::default();
    let summary = run(flight.events(), NavigationKind::ErrorState, false, &mut way);
    assert!(way.last.unwrap().latitude_rad.to_degrees() > 57.9);
    assert!(way.last_error_m < 3.0, "{} m", way.last_error_m);
    assert!(summary.fixes_used > 300, "{}", summary.fixes_used);
    let slow = Flight {
        speed: 2.0,
        ..flight
    };
    for estimator in [NavigationKind::AxisFilters, NavigationKind::DeadReckoning] {
        let mut way = Way::default();
        run(slow.events(), estimator, false, &mut way);
        assert!(way.last.unwrap().latitude_rad.to_degrees() > 57.9);
        assert!(
            way.last_error_m < 10.0,
            "{estimator}: {} m",
            way.last_error_m
        );
    }
}

#[test]
fn estimators_without_attitude_errors_keep_no_far_tangent_plane() {
    for (estimator, speed, most) in [
        (NavigationKind::AxisFilters, 2.0, 4.0),
        (NavigationKind::DeadReckoning, 5.0, 2.0),
    ] {
        let flight = Flight {
            speed,
            winding: 0.0,
            duration_s: 12_000.0,
            begins: [60.0, 5.0],
            elsewhere: None,
        };
        let mut way = Way::default();
        let summary = run(flight.events(), estimator, false, &mut way);
        let position = summary.position.unwrap();
        println!("{estimator}: {position:?}");
        assert!(way.furthest_from_origin_m < 1500.0);
        assert!(
            position.horizontal_rmse_m < most,
            "{estimator}: {position:?}"
        );
    }
}

/// Ten hours by compass and log: 540 km, over which north has turned by 6 degrees.
#[test]
fn a_ship_without_fixes_keeps_to_the_north_of_where_it_is() {
    let flight = Flight {
        speed: 15.0,
        winding: 0.01,
        duration_s: 36_000.0,
        begins: [55.0, 3.0],
        elsewhere: None,
    };
    let mut truth = flight.begin(flight.begins);
    let events: Vec<Event> = (0..flight.duration_s as i64)
        .flat_map(|k| {
            truth.step(k as f64, 1.0);
            let mut samples = vec![
                Sample::TrueHeading(TrueHeading {
                    heading_rad: truth.course,
                    std_rad: Some(0.01),
                }),
                Sample::WaterVelocity(WaterVelocity {
                    forward_m_s: truth.speed,
                    starboard_m_s: Some(0.0),
                }),
            ];
            if k < 300 {
                samples.push(Sample::GnssPosition(truth.fix(&Vector3::zeros())));
            }
            let time_ns = k * 1_000_000_000;
            samples
                .into_iter()
                .map(move |sample| Event { time_ns, sample })
        })
        .collect();
    let mut way = Way::default();
    run(
        events.into_iter(),
        NavigationKind::DeadReckoning,
        false,
        &mut way,
    );
    let off = (way.last.unwrap().to_ecef() - truth.place.to_ecef()).norm();
    assert!(off < 1500.0, "{off} m after {} km", 540);
    assert!(way.furthest_from_origin_m < 1500.0);
}

/// Each kilometre another frame: nothing of it is seen in the smoothed estimates.
#[test]
fn smoothing_goes_on_over_moves_of_the_origin() {
    let flight = Flight {
        speed: 200.0,
        winding: 0.02,
        duration_s: 240.0,
        begins: [62.0, 9.0],
        elsewhere: None,
    };
    let [filtered, smoothed] = [false, true].map(|smooth| {
        let mut way = Way::default();
        let summary = run(
            flight.events(),
            NavigationKind::ErrorState,
            smooth,
            &mut way,
        );
        assert!(
            way.longest_step_m < 25.0 || !smooth,
            "{} m",
            way.longest_step_m
        );
        summary
    });
    let [before, after] = [&filtered, &smoothed].map(|s| s.position.as_ref().unwrap());
    println!("{before:?} {after:?}");
    assert!(after.horizontal_rmse_m < 0.95 * before.horizontal_rmse_m);
    assert!(smoothed.heading_rmse_deg < filtered.heading_rmse_deg);
}
