//! The topics: what each is called, and the messages on it.
//!
//! | topic | message |
//! |---|---|
//! | `/tf` | `foxglove.FrameTransform`: the body in the level frame `map`, x east, y north, z up |
//! | `/position` | `foxglove.LocationFix`: where the antenna is estimated to be |
//! | `/fix` | `foxglove.LocationFix`: what the receiver said |
//! | `/attitude`, `/velocity`, `/gyroscope_bias` | JSON, with standard deviations where they are stated |
//! | `/innovations/SENSOR` | JSON: residual, its standard deviation, NIS, degrees of freedom, outcome |
//! | `/lamps/SENSOR`, `/lamps/position` | JSON: tone and sentence |
//! | `/log` | `foxglove.Log`: the sentence of a lamp when its tone changes |

use std::collections::BTreeMap;
use std::sync::Arc;

use foxglove::messages::location_fix::PositionCovarianceType;
use foxglove::messages::log::Level;
use foxglove::messages::{FrameTransform, LocationFix, Log, Quaternion, Timestamp, Vector3};
use foxglove::{Channel, ChannelBuilder, Context, PartialMetadata, RawChannel, Schema, SinkId};
use nalgebra::{UnitQuaternion, Vector3 as Vector};
use northing_core::geometry::rotation;
use northing_core::kalman::Innovation;
use northing_evaluation::attitude::observer::angles_covariance;
use northing_evaluation::statistics::lamp::Tone;
use northing_recording::{PoseEstimate, TrackPoint};
use serde_json::{Map, Value as Json, json};

/// The level frame.
const MAP: &str = "map";

/// Something that an estimator told.
#[derive(Debug, Clone)]
pub enum Told {
    /// Attitude, position and velocity, as far as they are estimated.
    Pose(Box<PoseEstimate>),
    /// The attitude alone: `enu_from_body` and the standard deviations of yaw, pitch and roll, deg.
    Attitude(UnitQuaternion<f64>, Option<[f64; 3]>),
    /// Gyroscope bias and its standard deviation, deg/s, body axes.
    GyroscopeBias([f64; 3], Option<[f64; 3]>),
    /// A fix of the receiver.
    Fix(TrackPoint),
    /// A measurement of a sensor and what it told.
    Innovation(&'static str, InnovationTold),
    /// What is to be said of a sensor, or of the position.
    Lamp {
        /// The sensor.
        sensor: &'static str,
        /// How welcome it is.
        tone: Tone,
        /// In a sentence.
        text: String,
        /// Mean NIS of the last samples, and what it is when the stated noise is consistent.
        nis: Option<(f64, u8)>,
    },
}

/// A measurement and what it told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InnovationTold {
    /// Measured minus predicted, and its standard deviation as the filter expects it, in the sensor's unit.
    pub residual: [f64; 3],
    /// See `residual`.
    pub std: [f64; 3],
    /// Normalised innovation squared.
    pub nis: f64,
    /// Degrees of freedom; 0 where nothing was compared, and the three before say nothing.
    pub degrees_of_freedom: u8,
    /// `fused`, `inflated`, `gated` or `skipped`.
    pub outcome: &'static str,
}

impl From<&Innovation<f64>> for InnovationTold {
    fn from(innovation: &Innovation<f64>) -> Self {
        Self {
            residual: innovation.residual.into(),
            std: innovation.residual_std().into(),
            nis: innovation.nis,
            degrees_of_freedom: innovation.degrees_of_freedom,
            outcome: innovation.outcome.name(),
        }
    }
}

impl Told {
    /// What it is about: the newest of each subject shows the state of a moment.
    pub(crate) fn subject(&self) -> (u8, &'static str) {
        match self {
            Self::Pose(_) | Self::Attitude(..) => (0, ""),
            Self::GyroscopeBias(..) => (1, ""),
            Self::Fix(_) => (2, ""),
            Self::Innovation(sensor, _) => (3, sensor),
            Self::Lamp { sensor, .. } => (4, sensor),
        }
    }
}

/// A topic that has been advertised.
enum Topic {
    Transform(Channel<FrameTransform>),
    Fix(Channel<LocationFix>),
    Log(Channel<Log>),
    Json(Arc<RawChannel>),
}

/// Publishes to every viewer; a topic is advertised when there is something to say on it.
pub struct Topics {
    context: Arc<Context>,
    topics: BTreeMap<String, Topic>,
    /// Before every topic but `/tf`, which all devices share.
    prefix: String,
    /// The frame of the body in transforms.
    body: String,
    audience: Audience,
    /// The newest tone of each lamp.
    tones: BTreeMap<&'static str, Tone>,
}

/// Who is told.
#[derive(Default)]
enum Audience {
    #[default]
    All,
    /// One viewer, of one topic.
    One(String, SinkId),
    /// Nobody: topics are advertised.
    Nobody,
}

impl std::fmt::Debug for Topics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.topics.keys()).finish()
    }
}

impl Topics {
    pub(crate) fn new(context: Arc<Context>, prefix: &str, body: &str) -> Self {
        Self {
            context,
            topics: BTreeMap::new(),
            prefix: prefix.to_owned(),
            body: body.to_owned(),
            audience: Audience::All,
            tones: BTreeMap::new(),
        }
    }

    /// Publishes once more what was told, on one topic and to one viewer.
    pub(crate) fn show(&mut self, topic: &str, viewer: SinkId, time_ns: i64, told: &Told) {
        self.audience = Audience::One(topic.to_owned(), viewer);
        self.publish(time_ns, told, false);
        self.audience = Audience::All;
    }

    /// Makes the topics of what will be told known, so that viewers miss nothing of it.
    pub(crate) fn advertise(&mut self, told: &Told) {
        self.audience = Audience::Nobody;
        self.publish(0, told, true);
        self.tones.clear();
        self.audience = Audience::All;
    }

    /// Publishes what was told at a time of the recording, ns; `is_new` unless it is shown once more.
    pub fn publish(&mut self, time_ns: i64, told: &Told, is_new: bool) {
        match told {
            Told::Pose(pose) => self.pose(time_ns, pose),
            Told::Attitude(attitude, std_deg) => {
                self.attitude(time_ns, attitude, &Vector::zeros(), *std_deg);
            }
            Told::GyroscopeBias(bias, std) => {
                let mut value = json!({ "bias_deg_s": xyz(bias) });
                if let Some(std) = std {
                    value["std_deg_s"] = xyz(std);
                }
                self.json(time_ns, "/gyroscope_bias", &schemas::bias(), &value);
            }
            Told::Fix(place) => self.fix(time_ns, "/fix", place, None),
            Told::Innovation(sensor, innovation) => {
                let topic = format!("/innovations/{sensor}");
                let value = innovation_json(innovation);
                self.json(time_ns, &topic, &schemas::innovation(), &value);
            }
            Told::Lamp {
                sensor,
                tone,
                text,
                nis,
            } => {
                let mut value = json!({ "tone": tone.name(), "text": text });
                if let Some((mean, expected)) = nis {
                    value["nis_mean"] = json!(mean);
                    value["nis_expected"] = json!(expected);
                }
                let topic = format!("/lamps/{sensor}");
                self.json(time_ns, &topic, &schemas::lamp(), &value);
                let before = is_new.then(|| self.tones.insert(sensor, *tone));
                if before.is_some_and(|before| before != Some(*tone)) {
                    self.log(time_ns, sensor, *tone, text);
                }
            }
        }
    }

    fn pose(&mut self, time_ns: i64, pose: &PoseEstimate) {
        if let Some((attitude, covariance)) = &pose.attitude {
            let position = pose.position.map_or(Vector::zeros(), |(p, _)| p);
            let std_deg = covariance.map(|about_world| {
                let axes = attitude.to_rotation_matrix().into_inner();
                let body = axes.transpose() * about_world * axes;
                let angles = angles_covariance(attitude, &body).diagonal();
                angles.map(|v| v.max(0.0).sqrt().to_degrees()).into()
            });
            self.attitude(time_ns, attitude, &position, std_deg);
        }
        if let Some((velocity, covariance)) = &pose.velocity {
            let mut value =
                json!({ "velocity_m_s": enu(velocity.as_slice()), "speed_m_s": velocity.norm() });
            if let Some(p) = covariance {
                let std = p.diagonal().map(|v| v.max(0.0).sqrt());
                value["std_m_s"] = enu(std.as_slice());
            }
            self.json(time_ns, "/velocity", &schemas::velocity(), &value);
        }
        if let Some(place) = &pose.place {
            let covariance = pose.position.and_then(|(_, covariance)| covariance);
            let covariance = covariance.map(|p| p.transpose().as_slice().to_vec());
            self.fix(time_ns, "/position", place, covariance);
        }
    }

    fn attitude(
        &mut self,
        time_ns: i64,
        attitude: &UnitQuaternion<f64>,
        position: &Vector<f64>,
        std_deg: Option<[f64; 3]>,
    ) {
        let [w, x, y, z] = rotation::to_wxyz(attitude);
        let transform = FrameTransform {
            timestamp: Some(timestamp(time_ns)),
            parent_frame_id: MAP.to_owned(),
            child_frame_id: self.body.clone(),
            translation: Some(vector(position)),
            rotation: Some(Quaternion { x, y, z, w }),
        };
        let advertised = self.topic("/tf", |builder| Topic::Transform(builder.build()));
        if let Some((Topic::Transform(channel), viewer)) = advertised {
            channel.log_with_meta_to_sink(&transform, at(time_ns), viewer);
        }
        let [yaw, pitch, roll] = rotation::to_yaw_pitch_roll(attitude).map(f64::to_degrees);
        let mut value = json!({ "yaw_deg": yaw, "pitch_deg": pitch, "roll_deg": roll });
        for (name, std) in ["yaw", "pitch", "roll"]
            .iter()
            .zip(std_deg.iter().flatten())
        {
            value[format!("{name}_std_deg")] = json!(std);
        }
        self.json(time_ns, "/attitude", &schemas::attitude(), &value);
    }

    fn fix(&mut self, time_ns: i64, topic: &str, place: &TrackPoint, covariance: Option<Vec<f64>>) {
        let of_std = || {
            let [north, east, down] = place.std_m?;
            let variances = Vector::new(east * east, north * north, down * down);
            let known = variances.iter().all(|v| v.is_finite());
            known.then(|| {
                nalgebra::Matrix3::from_diagonal(&variances)
                    .as_slice()
                    .to_vec()
            })
        };
        let kind = match &covariance {
            Some(_) => PositionCovarianceType::Known,
            None if of_std().is_some() => PositionCovarianceType::DiagonalKnown,
            None => PositionCovarianceType::Unknown,
        };
        let fix = LocationFix {
            timestamp: Some(timestamp(time_ns)),
            frame_id: self.body.clone(),
            latitude: place.latitude_rad.to_degrees(),
            longitude: place.longitude_rad.to_degrees(),
            // NaN where it is not known.
            altitude: place.height_m,
            position_covariance: covariance.or_else(of_std).unwrap_or_default(),
            position_covariance_type: kind as i32,
            ..LocationFix::default()
        };
        if let Some((Topic::Fix(channel), viewer)) =
            self.topic(topic, |builder| Topic::Fix(builder.build()))
        {
            channel.log_with_meta_to_sink(&fix, at(time_ns), viewer);
        }
    }

    fn log(&mut self, time_ns: i64, sensor: &str, tone: Tone, text: &str) {
        let level = match tone {
            Tone::Good | Tone::Info | Tone::Idle => Level::Info,
            Tone::Warn => Level::Warning,
            Tone::Bad => Level::Error,
        };
        let message = Log {
            timestamp: Some(timestamp(time_ns)),
            level: level as i32,
            message: text.to_owned(),
            name: sensor.to_owned(),
            ..Log::default()
        };
        if let Some((Topic::Log(channel), viewer)) =
            self.topic("/log", |builder| Topic::Log(builder.build()))
        {
            channel.log_with_meta_to_sink(&message, at(time_ns), viewer);
        }
    }

    fn json(&mut self, time_ns: i64, topic: &str, schema: &schemas::Schema, value: &Json) {
        let make = |builder: ChannelBuilder| {
            let text = schema.text().into_bytes();
            let schema = Schema::new(schema.name, "jsonschema", text);
            // It fails without an encoding only.
            let channel = builder.message_encoding("json").schema(schema).build_raw();
            Topic::Json(channel.unwrap_or_else(|_| unreachable!("it has an encoding")))
        };
        if let Some((Topic::Json(channel), viewer)) = self.topic(topic, make) {
            let text = value.to_string();
            channel.log_with_meta_to_sink(text.as_bytes(), at(time_ns), viewer);
        }
    }

    /// The topic, and who alone hears of it; `None` where nobody does.
    fn topic(
        &mut self,
        name: &str,
        make: impl FnOnce(ChannelBuilder) -> Topic,
    ) -> Option<(&Topic, Option<SinkId>)> {
        let full = match name {
            "/tf" => name.to_owned(),
            _ => format!("{}{name}", self.prefix),
        };
        if matches!(&self.audience, Audience::One(only, _) if *only != full) {
            return None;
        }
        if !self.topics.contains_key(&full) {
            let builder = ChannelBuilder::new(&full).context(&self.context);
            self.topics.insert(full.clone(), make(builder));
        }
        let viewer = match &self.audience {
            Audience::All => None,
            Audience::One(_, viewer) => Some(*viewer),
            Audience::Nobody => return None,
        };
        Some((&self.topics[&full], viewer))
    }
}

/// Stamps of the protocol count from 0.
pub(crate) fn protocol_ns(time_ns: i64) -> u64 {
    u64::try_from(time_ns).unwrap_or(0)
}

fn at(time_ns: i64) -> PartialMetadata {
    PartialMetadata {
        log_time: Some(protocol_ns(time_ns)),
    }
}

fn timestamp(time_ns: i64) -> Timestamp {
    let ns = protocol_ns(time_ns);
    let seconds = u32::try_from(ns / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new_checked(seconds, (ns % 1_000_000_000) as u32).unwrap_or(Timestamp::MAX)
}

fn vector(v: &Vector<f64>) -> Vector3 {
    Vector3 {
        x: v.x,
        y: v.y,
        z: v.z,
    }
}

fn named(names: [&str; 3], values: &[f64]) -> Json {
    let pairs = names.into_iter().zip(values);
    let object: Map<String, Json> = pairs.map(|(n, v)| (n.to_owned(), json!(v))).collect();
    Json::Object(object)
}

fn xyz(values: &[f64]) -> Json {
    named(["x", "y", "z"], values)
}

fn enu(values: &[f64]) -> Json {
    named(["east", "north", "up"], values)
}

fn innovation_json(told: &InnovationTold) -> Json {
    let mut value = json!({
        "outcome": told.outcome,
        "degrees_of_freedom": told.degrees_of_freedom,
    });
    if told.degrees_of_freedom > 0 {
        value["residual"] = xyz(&told.residual);
        value["std"] = xyz(&told.std);
        value["nis"] = json!(told.nis);
    }
    value
}

/// JSON schemas of the messages, so that a viewer offers their fields.
mod schemas {
    use serde_json::{Map, Value as Json, json};

    /// Name and fields of a message.
    pub(super) struct Schema {
        pub(super) name: &'static str,
        fields: Json,
    }

    impl Schema {
        pub(super) fn text(&self) -> String {
            json!({ "title": self.name, "type": "object", "properties": self.fields }).to_string()
        }
    }

    fn numbers<const N: usize>(names: [&str; N]) -> Map<String, Json> {
        let number = |name: &str| (name.to_owned(), json!({ "type": "number" }));
        names.into_iter().map(number).collect()
    }

    fn three(names: [&str; 3]) -> Json {
        json!({ "type": "object", "properties": numbers(names) })
    }

    pub(super) fn attitude() -> Schema {
        let names = [
            "yaw_deg",
            "pitch_deg",
            "roll_deg",
            "yaw_std_deg",
            "pitch_std_deg",
            "roll_std_deg",
        ];
        Schema {
            name: "northing.Attitude",
            fields: Json::Object(numbers(names)),
        }
    }

    pub(super) fn velocity() -> Schema {
        let axes = ["east", "north", "up"];
        Schema {
            name: "northing.Velocity",
            fields: json!({ "velocity_m_s": three(axes), "std_m_s": three(axes), "speed_m_s": { "type": "number" } }),
        }
    }

    pub(super) fn bias() -> Schema {
        let axes = ["x", "y", "z"];
        Schema {
            name: "northing.GyroscopeBias",
            fields: json!({ "bias_deg_s": three(axes), "std_deg_s": three(axes) }),
        }
    }

    pub(super) fn innovation() -> Schema {
        let axes = ["x", "y", "z"];
        Schema {
            name: "northing.Innovation",
            fields: json!({
                "residual": three(axes), "std": three(axes), "nis": { "type": "number" },
                "degrees_of_freedom": { "type": "integer" },
                "outcome": { "type": "string", "enum": ["fused", "inflated", "gated", "skipped"] },
            }),
        }
    }

    pub(super) fn lamp() -> Schema {
        Schema {
            name: "northing.Lamp",
            fields: json!({
                "tone": { "type": "string", "enum": ["good", "info", "warn", "bad", "idle"] },
                "text": { "type": "string" },
                "nis_mean": { "type": "number" }, "nis_expected": { "type": "integer" },
            }),
        }
    }
}
