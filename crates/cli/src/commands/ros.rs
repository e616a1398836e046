//! `northing ros`: a node of ROS 2, without ROS.

use std::convert::Infallible;
use std::sync::PoisonError;

use anyhow::{Context, Result, bail};
use clap::Args;
use northing_evaluation::navigation::{NavigationKind, NavigationOptions, run_navigation};
use northing_evaluation::{RunEstimator, RunOptions, UsedParameter, run_live};
use northing_recording::mcap::Role;
use northing_recording::{BodyAxes, Frames as Axes, Metadata, WorldFrame};
use northing_ros::{
    AttitudePublisher, Ended, Frames, Messages, NavigationPublisher, Node, NodeConfig, Reliability,
    usual_topic,
};

use crate::arguments::settings::SettingArgs;
use crate::files::output::print;
use crate::interrupt;
use crate::text::{attitude, navigation};

/// Arguments of `ros`.
#[derive(Debug, Args)]
#[command(
    long_about = "Runs an estimator as a node of ROS 2, over DDS and without an installation of ROS: it listens to \
                  sensor_msgs/Imu, MagneticField and NavSatFix and to the velocity of a receiver, and publishes /imu/data \
                  (orientation with covariance), /tf, with a navigation estimator /odometry and /gps/filtered, and \
                  /diagnostics once a second. Axes are those of REP 103: the world east, north, up, the sensors forward, \
                  left, up. Stamps are those of the messages, so simulated time needs nothing. Ctrl-C ends it and prints \
                  what a run over a recording prints.",
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
    /// Ask publishers to send again what is lost; those of best effort, as most drivers are, are then not heard
    #[arg(long)]
    reliable: bool,
    /// The level frame in what is published
    #[arg(long, value_name = "FRAME", default_value = "map")]
    map_frame: String,
    /// The body's frame in what is published [default: the frame of the Imu, whose pose is estimated]
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

/// Domains of DDS have ports up to this one.
const MOST_DOMAINS: u16 = 232;

/// The world of ROS, and the axes of its sensors.
const AXES: Axes = Axes {
    world: WorldFrame::Enu,
    body: BodyAxes::Flu,
};

impl RosArgs {
    fn asked(&self) -> Result<Asked> {
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
                let mut options = NavigationOptions::of_recording(kind, &Metadata::default());
                self.settings.navigation_parameters(&mut options)?;
                options.check()?;
                Ok(Asked::Navigation(Box::new(options)))
            }
            Some(RunEstimator::Attitude(kind)) => self.attitude(Some(kind)),
            None => self.attitude(None),
        }
    }

    fn attitude(&self, kind: Option<northing_evaluation::EstimatorKind>) -> Result<Asked> {
        let mut options = self.settings.options(kind)?;
        self.settings.check_effect(options.estimator)?;
        options.world_frame = AXES.world;
        options.check()?;
        Ok(Asked::Attitude(Box::new(options)))
    }

    /// What an estimator listens to.
    fn inputs(&self, asked: &Asked) -> Vec<(Role, String)> {
        let inputs = [
            (Role::Inertial, &self.imu),
            (Role::Field, &self.mag),
            (Role::Fix, &self.fix),
            (Role::Velocity, &self.velocity),
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
            parameters: asked.parameters(),
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
    let asked = args.asked()?;
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
    let ended = loop {
        match run(args, &asked, &node) {
            Ok((Ended::ClockWentBack(back_ns), _)) => print(&format!(
                "The stamps of the Imu went back by {:.3} s: begun anew.\n",
                back_ns as f64 * 1e-9
            ))?,
            other => break other,
        }
    };
    let told = node.diagnostics();
    let told = told.lock().unwrap_or_else(PoisonError::into_inner);
    let mut text = told.sentences().join("\n");
    let heard = told.heard_of(Role::Inertial);
    drop(told);
    node.stop();
    let (_, summary) = ended?;
    if heard == 0 {
        text = format!("No message on {}: nothing was estimated.", topics[0]);
    }
    if let Some(summary) = summary {
        text = format!("{text}\n\n{summary}");
    }
    print(&format!("{text}\n"))
}

/// One run, to the end or until the clock goes back: why it ended, and its summary if there were estimates.
fn run(args: &RosArgs, asked: &Asked, node: &Node) -> Result<(Ended, Option<String>)> {
    let is_stopped = || interrupt::happened();
    let mut messages = Messages::new(node, &is_stopped);
    let told = match asked {
        Asked::Attitude(options) => {
            let mut publisher = AttitudePublisher::new(node, &args.frames());
            let messages = messages.by_ref().map(Ok::<_, Infallible>);
            let options = RunOptions {
                recording: node.name().to_owned(),
                ..(**options).clone()
            };
            let summary = run_live(messages, &options, &mut publisher)?;
            (summary.estimates > 0).then(|| attitude::describe(&summary))
        }
        Asked::Navigation(options) => {
            let mut publisher = NavigationPublisher::new(node, &args.frames(), args.rate);
            let events = messages.by_ref().flatten().map(Ok::<_, Infallible>);
            match run_navigation(events, node.name(), AXES, options, &mut publisher) {
                Ok(summary) => Some(navigation::describe(&summary)),
                // It was ended by the user, and what was heard until then is not enough.
                Err(error) if messages.ended().is_some() => Some(format!("No position: {error}")),
                Err(error) => return Err(error).context(node.name().to_owned()),
            }
        }
    };
    Ok((messages.ended().unwrap_or(Ended::Stopped), told))
}
