//! Random scenes for trackers of many targets: pedestrians, boats, ships and aircraft, drawn from one seed, wider than life.
//!
//! A scene is a [`SceneSensor`] on an own ship, targets that move, and what goes wrong. All is drawn from the seed and the scene's number
//! alone; classes follow one another, so that any run of numbers has equal shares. What a scene has stands in its
//! [`SceneDescription`]; a tracker is given [`TrackingScene::recording`], whose true positions are for the score.
//!
//! | drawn | range |
//! |---|---|
//! | sensor | by class: a scan each 0.05 to 12 s, ranges to 15 m to 200 km, 0.02 to 150 m and 0.05 to 2 deg (one sigma) |
//! | targets | 1 to 16: standing, straight, turning, changing speed; a third come late, a quarter leave, some in pairs |
//! | detections | probability 0.6 to 0.98, in some scenes falling with the range or zero in a shadow; in three of ten scenes echoes drift on the hull, over 3 to 50 scans |
//! | false detections | 0.3 to 30 a scan, even over the area or crowded near the own ship |
//! | own ship | at rest or moving; in half of the scenes its pose is wrong by a slowly changing error, which is told, or (rarely) not |
//! | told wrongly | in a third of the scenes noise by 0.6 to 1.6, misses by up to 2, false detections by up to 3 |
//!
//! Axes are north and east from an origin at the own ship's start.

mod description;
mod motion;
mod own_ship;
mod sensor;

#[cfg(test)]
mod tests;

use northing_recording::tracking::{
    Detection, OwnShipPose, Scan, TargetTruth, TrackingEvent, TrackingIssues, TrackingRecording,
    TrackingSample,
};
use serde::Serialize;

pub use own_ship::OwnShipError;
pub use sensor::{SceneSensor, SensorTold};

use self::motion::{Fleet, Place, Target};
use self::own_ship::OwnShip;
use crate::random::run_seed;
use crate::signals::Draws;

/// What is tracked, by what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SceneClass {
    /// Persons on foot before a laser scanner.
    Pedestrians,
    /// Boats in a harbour before a small radar.
    Boats,
    /// Ships off a coast before a ship's radar.
    Ships,
    /// Aircraft before a surveillance radar.
    Aircraft,
}

impl SceneClass {
    /// All, in the order of the scenes' numbers.
    pub const ALL: [Self; 4] = [Self::Pedestrians, Self::Boats, Self::Ships, Self::Aircraft];

    /// The class of the scene with this number.
    #[must_use]
    pub const fn of(number: u64) -> Self {
        Self::ALL[(number % Self::ALL.len() as u64) as usize]
    }

    /// Its name on the command line and in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pedestrians => "pedestrians",
            Self::Boats => "boats",
            Self::Ships => "ships",
            Self::Aircraft => "aircraft",
        }
    }

    /// The class of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|class| class.name() == name)
    }

    /// All names, for messages.
    #[must_use]
    pub fn names() -> String {
        Self::ALL.map(Self::name).join(", ")
    }
}

/// What a scene has.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneDescription {
    /// Its number.
    pub number: u64,
    /// What is tracked.
    pub class: SceneClass,
    /// Scans.
    pub scans: usize,
    /// How many targets there are, over all its time.
    pub targets: usize,
    /// Whether some of them go in pairs.
    pub pairs: bool,
    /// The sensor.
    pub sensor: SceneSensor,
    /// What the tracker is told of it.
    pub told: SensorTold,
    /// The error of the own ship's pose; none: it is exact.
    pub own_ship_error: Option<OwnShipError>,
    /// Distance beyond which a track is no track of a target, m: four standard deviations of a detection's place, the own ship's error with
    /// it, at the targets' root mean square range.
    pub cutoff_m: f64,
}

/// A scene: what the tracker is given, with the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackingScene {
    /// What it has.
    pub description: SceneDescription,
    /// Scans, the own ship's poses as they are told, and true positions of the targets in range.
    pub recording: TrackingRecording,
}

impl TrackingScene {
    /// The scene with this number under a seed; the same on every machine.
    #[must_use]
    pub fn draw(seed: u64, number: u64) -> Self {
        let seed = run_seed(seed, number);
        let class = SceneClass::of(number);
        let mut echo = Draws::new(seed, "sensor/echo");
        let sensor = SceneSensor::draw(class, &mut Draws::new(seed, "sensor"), &mut echo);
        let told = SensorTold::draw(&sensor, &mut Draws::new(seed, "told"));
        let scans = if class == SceneClass::Pedestrians {
            300
        } else {
            150
        };
        let fleet = Fleet::draw(class, &sensor, scans, &mut Draws::new(seed, "targets"));
        let own = OwnShip::draw(class, &sensor, &mut Draws::new(seed, "own ship"));
        let error = OwnShipError::draw(class, &sensor, &mut Draws::new(seed, "own ship/error"));
        let mut scene = Scene {
            events: Vec::new(),
            squares: Vec::new(),
            noise: Draws::new(seed, "detections"),
            sensor: &sensor,
            echoes: vec![[0.0; 2]; fleet.targets.len()],
        };
        let mut walk = error.map(|error| error.walk(Draws::new(seed, "own ship/walk")));
        for k in 0..scans {
            let pose = own.pose(sensor.scan_interval_s * k as f64);
            let reported = walk.as_mut().map_or(pose, |walk| walk.next(pose));
            scene.scan(k, pose, reported, &fleet);
        }
        let mean_square = scene.squares.iter().sum::<f64>() / scene.squares.len().max(1) as f64;
        let description = SceneDescription {
            number,
            class,
            scans,
            targets: fleet.targets.len(),
            pairs: fleet.pairs,
            sensor,
            told,
            own_ship_error: error,
            cutoff_m: 4.0 * sensor.place_variance(mean_square, error).sqrt(),
        };
        let recording = TrackingRecording {
            plane: None,
            name: format!("{}-{number}", class.name()),
            sensors: vec![("radar".to_owned(), told.settings(&sensor))],
            events: scene.events,
            truth_std_m: 0.0,
            issues: TrackingIssues::default(),
        };
        Self {
            description,
            recording,
        }
    }
}

/// What is put together scan by scan.
struct Scene<'a> {
    events: Vec<TrackingEvent>,
    /// Squared ranges of the targets that are in range, m^2.
    squares: Vec<f64>,
    noise: Draws,
    sensor: &'a SceneSensor,
    /// Where on each target its echo comes from, in standard deviations.
    echoes: Vec<[f64; 2]>,
}

impl Scene<'_> {
    fn scan(&mut self, k: usize, pose: OwnShipPose, reported: OwnShipPose, fleet: &Fleet) {
        let time_ns = (k as f64 * self.sensor.scan_interval_s * 1e9).round() as i64;
        let mut detections = self.sensor.false_detections(&mut self.noise);
        let mut truth = Vec::new();
        for (index, target) in fleet.targets.iter().enumerate() {
            let Some(place) = target.place(k) else {
                continue;
            };
            let range = motion::length([place[0] - pose.north_m, place[1] - pose.east_m]);
            if range > self.sensor.range_m {
                continue;
            }
            self.squares.push(range * range);
            detections.extend(self.detection(k, index, target, pose, place));
            truth.push((index as u32 + 1, place));
        }
        self.noise.shuffle(&mut detections);
        let id = k as i64;
        let mut put = |sample| self.events.push(TrackingEvent { time_ns, sample });
        put(TrackingSample::OwnShip(reported));
        put(TrackingSample::Scan(Scan {
            id,
            sensor: 0,
            detections,
        }));
        for (target, [north_m, east_m]) in truth {
            put(TrackingSample::Truth(TargetTruth {
                scan: id,
                target,
                north_m,
                east_m,
            }));
        }
    }

    /// What the sensor sees of a target, if it does.
    fn detection(
        &mut self,
        k: usize,
        index: usize,
        target: &Target,
        pose: OwnShipPose,
        place: Place,
    ) -> Option<Detection> {
        // Drawn whether it is seen or not: the echo drifts all the same.
        let kept = self.sensor.echo_kept;
        for axis in &mut self.echoes[index] {
            *axis = kept * *axis + (1.0 - kept * kept).sqrt() * self.noise.normal();
        }
        let echo = self.echoes[index].map(|sigmas| self.sensor.extent_std_m * sigmas);
        let from_own = [
            place[0] + echo[0] - pose.north_m,
            place[1] + echo[1] - pose.east_m,
        ];
        let range = motion::length(from_own);
        let probability = self.sensor.probability_at(range);
        let is_seen = self.noise.chance(probability) && !target.is_hidden(k);
        let range_m = range + self.sensor.range_std_m * self.noise.normal();
        let bearing_rad = motion::bearing(from_own) - pose.heading_rad
            + self.sensor.bearing_std_deg.to_radians() * self.noise.normal();
        (is_seen && range_m > 0.0).then_some(Detection::RangeBearing {
            range_m,
            bearing_rad,
        })
    }
}
