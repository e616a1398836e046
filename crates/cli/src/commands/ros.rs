//! `northing ros`: a node of ROS 2, without ROS.

use std::convert::Infallible;
use std::sync::{Arc, PoisonError};

use anyhow::{Context, Result, bail};
use clap::Args;
use northing_evaluation::attitude::EstimatorKind;
use northing_evaluation::navigation::{NavigationKind, NavigationOptions, run_navigation};
use northing_evaluation::{Origin, RunEstimator, RunOptions, UsedParameter, run_live};
use northing_recording::mcap::Role;
use northing_recording::{BodyAxes, Frames as Axes, Metadata, WorldFrame};
use northing_ros::{
    AttitudePublisher, Check, Ended, Frames, Messages, NavigationPublisher, Node, NodeConfig,
    Reliability, TRANSFORMS, usual_topic,
};

use crate::arguments::settings::SettingArgs;
use crate::files::output::print;
use crate::interrupt;
use crate::text::{advice, attitude, navigation};

/// Arguments of `ros`.
#[derive(Debug, Args)]
#[command(
    long_about = "Runs an estimator as a node of ROS 2, over DDS and without an installation of ROS: it listens to \
                  sensor_msgs/Imu, MagneticField, NavSatFix and FluidPressure and to the velocity of a receiver, and publishes /imu/data \
                  (orientation with covariance), /tf, with a navigation estimator /odometry and /gps/filtered, and \
                  /diagnostics once a second. Axes are those of REP 103: the world east, north, up, the sensors forward, \
                  left, up. Stamps are those of the messages, so simulated time needs nothing; a message with a stamp of 0 has the time \
                  of its arrival. Ctrl-C ends it and prints what a run over a recording prints.",
    after_help = "\
Examples:
  northing ros                                             # /imu/data_raw in, /imu/data and /tf out
  northing ros --estimator error-state --fix /gps/fix --velocity /gps/vel
  northing ros --namespace /robot_1 --domain 7 --body-frame base_link
  northing ros --estimator mekf --set gyroscope_noise_density=0.002
  northing ros --config params.yaml                        # northing: ros__parameters: ..., as launch files have it

docs/ros.md compares it with imu_tools and robot_localization, topic by topic and parameter by parameter."
)]
pub(crate) struct RosArgs {
    /// Estimator; `northing estimators` lists them; without it bounded-velocity, with the lab profile mekf
    #[arg(long, value_name = "NAME")]
    estimator: Option<RunEstimator>,
    /// Name of the node
    #[arg(long, value_name = "NAME", default_value = "northing")]
    name: String,
    /// Namespace of the node; topics without a leading slash are in it
    #[arg(long, value_name = "NAMESPACE", default_value = "/")]
    namespace: String,
    /// Domain of DDS [default: that of ROS_DOMAIN_ID, otherwise 0]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=i64::from(MOST_DOMAINS)))]
    domain: Option<u16>,
    /// Topic of sensor_msgs/Imu [default: imu/data_raw]
    #[arg(long, value_name = "TOPIC")]
    imu: Option<String>,
    /// Topic of sensor_msgs/MagneticField [default: imu/mag]
    #[arg(long, value_name = "TOPIC")]
    mag: Option<String>,
    /// Topic of sensor_msgs/NavSatFix [default: fix]
    #[arg(long, value_name = "TOPIC")]
    fix: Option<String>,
    /// Topic of the receiver's velocity, geometry_msgs/TwistStamped or TwistWithCovarianceStamped [default: fix_velocity]
    #[arg(long, value_name = "TOPIC")]
    velocity: Option<String>,
    /// Topic of sensor_msgs/FluidPressure [default: pressure]
    #[arg(long, value_name = "TOPIC")]
    pressure: Option<String>,
    /// Topic of static transforms: how the sensors are mounted
    #[arg(long, value_name = "TOPIC", default_value = TRANSFORMS)]
    tf_static: String,
    /// Ask publishers to send again what is lost; those of best effort, as most drivers are, are then not heard
    #[arg(long)]
    reliable: bool,
    /// The level frame in what is published
    #[arg(long, value_name = "FRAME", default_value = "map")]
    map_frame: String,
    /// The body's frame in what is published [default: base_link where static transforms lead from the Imu to it, otherwise the
    /// frame of the Imu]
    #[arg(long, value_name = "FRAME")]
    body_frame: Option<String>,
    /// Publish no transforms
    #[arg(long)]
    no_tf: bool,
    /// Positions in a second at most, of a navigation estimator; attitudes come with every sample
    #[arg(long, value_name = "HZ", default_value = "50", value_parser = rate)]
    rate: f64,
    #[command(flatten)]
    settings: SettingArgs,
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (0.01..=10_000.0).contains(&rate) => Ok(rate),
        _ => Err("expected positions in a second, 0.01 to 10000, e.g. 50".to_owned()),
    }
}

/// What is run.
enum Asked {
    Attitude(Box<RunOptions>),
    Navigation(Box<NavigationOptions>),
}

impl Asked {
    fn estimator(&self) -> &'static str {
        match self {
            Self::Attitude(options) => options.estimator.name(),
            Self::Navigation(options) => options.estimator.name(),
        }
    }

    fn parameters(&self) -> Vec<UsedParameter> {
        match self {
            Self::Attitude(options) => options.parameters(),
            Self::Navigation(options) => options.used_parameters(),
        }
    }
}

impl Asked {
    /// Whether a value fits the parameter for which it is set while the node runs.
    fn check(&self) -> Check {
        Check(match self {
            Self::Attitude(options) => {
                let options = options.clone();
                Arc::new(move |setting| {
                    let mut options = options.clone();
                    let checked = options.set(setting).and_then(|()| options.check());
                    checked.map_err(|error| error.to_string())
                })
            }
            Self::Navigation(options) => {
                let options = options.clone();
                Arc::new(move |setting| {
                    let mut options = options.clone();
                    let set = options.set_from(setting, Origin::Set);
                    let checked = set.and_then(|()| options.check());
                    checked.map_err(|error| error.to_string())
                })
            }
        })
    }
}

/// Domains of DDS have ports up to this one.
const MOST_DOMAINS: u16 = 232;

/// The world of ROS, and the axes of its sensors.
const AXES: Axes = Axes {
    world: WorldFrame::Enu,
    body: BodyAxes::Flu,
};

impl RosArgs {
    /// What is run, with what is known of the mounting and was set while the node runs.
    fn asked(&self, lever_arm_m: Option<[f64; 3]>, set: &[String]) -> Result<Asked> {
        let metadata = Metadata {
            gnss_lever_arm_m: lever_arm_m,
            ..Metadata::default()
        };
        let named = match self.estimator {
            None => self.settings.estimator()?,
            named => named,
        };
        match named {
            Some(RunEstimator::Navigation(kind)) => {
                if !matches!(
                    kind,
                    NavigationKind::ErrorState | NavigationKind::AxisFilters
                ) {
                    bail!(
                        "`{kind}` needs measurements that the node does not listen to; expected error-state, axis-filters or \
                         an estimator of the attitude"
                    );
                }
                let mut options = NavigationOptions::of_recording(kind, &metadata);
                self.settings.navigation_parameters(&mut options)?;
                for setting in set {
                    options.set_from(setting, Origin::Set)?;
                }
                options.check()?;
                Ok(Asked::Navigation(Box::new(options)))
            }
            Some(RunEstimator::Attitude(kind)) => self.attitude(Some(kind), set),
            None => self.attitude(None, set),
        }
    }

    fn attitude(&self, kind: Option<EstimatorKind>, set: &[String]) -> Result<Asked> {
        let mut options = self.settings.options(kind)?;
        self.settings.check_effect(options.estimator)?;
        self.check_attitude(options.estimator)?;
        for setting in set {
            options.set(setting)?;
        }
        options.world_frame = AXES.world;
        options.check()?;
        Ok(Asked::Attitude(Box::new(options)))
    }

    /// Refuses what an estimator of the attitude would leave unsaid.
    fn check_attitude(&self, kind: EstimatorKind) -> Result<()> {
        if kind == EstimatorKind::Device {
            bail!(
                "`device` is the orientation that a device states itself, which the node would only repeat; choose an estimator, e.g. \
                 --estimator mekf (`northing estimators` lists them)"
            );
        }
        let of_navigation = [
            ("--fix", &self.fix),
            ("--velocity", &self.velocity),
            ("--pressure", &self.pressure),
        ];
        let named = of_navigation.into_iter().find(|(_, topic)| topic.is_some());
        if let Some((option, _)) = named {
            bail!(
                "{option}: `{}` estimates the attitude and does not listen to it; leave {option} out, or choose --estimator error-state \
                 or axis-filters",
                kind.name()
            );
        }
        Ok(())
    }

    /// What an estimator listens to.
    fn inputs(&self, asked: &Asked) -> Vec<(Role, String)> {
        let inputs = [
            (Role::Inertial, &self.imu),
            (Role::Field, &self.mag),
            (Role::Fix, &self.fix),
            (Role::Velocity, &self.velocity),
            (Role::Pressure, &self.pressure),
        ];
        let heard = match asked {
            Asked::Attitude(_) => &inputs[..2],
            Asked::Navigation(_) => &inputs[..],
        };
        let topic = |(role, topic): &(Role, &Option<String>)| {
            let usual = || usual_topic(*role).to_owned();
            (*role, Option::clone(topic).unwrap_or_else(usual))
        };
        heard.iter().map(topic).collect()
    }

    /// As other nodes of this computer find it.
    fn domain(&self) -> Result<u16> {
        if let Some(domain) = self.domain {
            return Ok(domain);
        }
        let Some(text) = std::env::var_os("ROS_DOMAIN_ID").filter(|text| !text.is_empty()) else {
            return Ok(0);
        };
        let number = text.to_str().and_then(|text| text.parse().ok());
        let domain = number.filter(|domain| *domain <= MOST_DOMAINS);
        domain.with_context(|| {
            let text = text.display();
            format!("ROS_DOMAIN_ID is `{text}`; expected a number from 0 to {MOST_DOMAINS}")
        })
    }

    fn config(&self, domain: u16, asked: &Asked) -> NodeConfig {
        NodeConfig {
            name: self.name.clone(),
            namespace: self.namespace.clone(),
            domain,
            inputs: self.inputs(asked),
            reliability: match self.reliable {
                true => Reliability::Reliable,
                false => Reliability::BestEffort,
            },
            transforms: self.tf_static.clone(),
            parameters: asked.parameters(),
            check: asked.check(),
        }
    }

    fn frames(&self) -> Frames {
        Frames {
            map: Some(self.map_frame.clone()),
            body: self.body_frame.clone(),
            no_transforms: self.no_tf,
        }
    }
}

/// Runs the node until Ctrl-C.
pub(crate) fn execute(args: &RosArgs) -> Result<()> {
    let mut asked = args.asked(None, &[])?;
    let domain = args.domain()?;
    let config = args.config(domain, &asked);
    let node = Node::start(&config)?;
    let topics: Vec<&str> = config
        .inputs
        .iter()
        .map(|(_, topic)| topic.as_str())
        .collect();
    print(&format!(
        "Node {} in domain {domain}: {} over {}; Ctrl-C ends it.\n",
        node.name(),
        asked.estimator(),
        topics.join(", ")
    ))?;
    // What was set while the node runs.
    let mut set: Vec<String> = Vec::new();
    let ended = loop {
        let ended = run(args, &asked, &node);
        let mut mounting = node.mounting();
        let lever_arm_m = mounting.lever_arm_m(AXES.body);
        match &ended {
            Ok((Ended::ClockWentBack(back_ns), _)) => print(&format!(
                "The stamps of the Imu went back by {:.3} s: begun anew.\n",
                *back_ns as f64 * 1e-9
            ))?,
            Ok((Ended::Mounted, _)) => print(&format!("{}\n", mounting.notes().join("\n")))?,
            Ok((Ended::Set(settings), _)) => {
                print(&format!("Set {}: begun anew.\n", settings.join(", ")))?;
                set.extend(settings.iter().cloned());
            }
            Ok((Ended::Stopped, _)) | Err(_) => break ended,
        }
        let before = asked.parameters();
        asked = args.asked(lever_arm_m, &set)?;
        if matches!(ended, Ok((Ended::Mounted, _))) {
            let now = asked.parameters();
            let is_another = |used: &&UsedParameter| !before.contains(used);
            node.tell_parameters(now.iter().filter(is_another));
        }
    };
    let told = node.diagnostics();
    let told = told.lock().unwrap_or_else(PoisonError::into_inner);
    let mut text = told.sentences().join("\n");
    let heard = told.heard_of(Role::Inertial);
    drop(told);
    node.stop();
    let (_, summary) = ended?;
    match (heard, summary) {
        (0, _) => text = format!("No message on {}: nothing was estimated.", topics[0]),
        (_, Some(summary)) => text = format!("{text}\n\n{summary}"),
        (_, None) => {}
    }
    print(&format!("{text}\n"))
}

/// One run, to the end or until the clock goes back: why it ended, and its summary if there were estimates.
fn run(args: &RosArgs, asked: &Asked, node: &Node) -> Result<(Ended, Option<String>)> {
    let is_stopped = || interrupt::happened();
    // Where nobody reads the console, diagnostics and summary say it, too.
    let tell = |sentence: &str| drop(print(&format!("{sentence}\n")));
    let mut messages = Messages::new(node, &is_stopped).telling(&tell);
    let told = match asked {
        Asked::Attitude(options) => {
            let mut publisher = AttitudePublisher::new(node, &args.frames());
            let messages = messages.by_ref().map(Ok::<_, Infallible>);
            let options = RunOptions {
                recording: node.name().to_owned(),
                ..(**options).clone()
            };
            let summary = run_live(messages, &options, &mut publisher)?;
            (summary.estimates > 0).then(|| attitude::describe_with(&summary, &of_this_command))
        }
        Asked::Navigation(options) => {
            let mut publisher = NavigationPublisher::new(node, &args.frames(), args.rate);
            let events = messages.by_ref().flatten().map(Ok::<_, Infallible>);
            match run_navigation(events, node.name(), AXES, options, &mut publisher) {
                Ok(summary) => Some(navigation::describe_with(&summary, &of_this_command)),
                // It was ended by the user, and what was heard until then is not enough.
                Err(error) if messages.ended().is_some() => Some(format!("No position: {error}")),
                Err(error) => return Err(error).context(node.name().to_owned()),
            }
        }
    };
    Ok((messages.ended().unwrap_or(Ended::Stopped), told))
}

/// A text of a run without advice that names options of other commands.
fn of_this_command(text: &str) -> String {
    let command = RosArgs::augment_args(clap::Command::new("ros"));
    let names: Vec<&str> = command
        .get_arguments()
        .filter_map(clap::Arg::get_long)
        .collect();
    advice::fitting(text, &|name| names.contains(&name))
}
