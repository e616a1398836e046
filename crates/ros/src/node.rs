//! The node: topics in, topics out, and the threads between.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use futures_util::StreamExt as _;
use northing_evaluation::UsedParameter;
use northing_recording::mcap::{EstimateTopic, Role, frame_id, measured};
use ros2_client::qos::{History, WhenFull};
use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, NodeName, NodeOptions, ParameterValue,
    Publisher, QosProfile, Subscription,
};
use serde_json::Value as Json;
use tokio::runtime::Runtime;

use crate::bytes::{AnyBytes, Bytes};
use crate::diagnostics::{self, Diagnostics};
use crate::messages::Message;

/// Messages that wait for the estimator, and that the middleware keeps of a topic: 1 s at 1 kHz.
const QUEUE: usize = 1000;
/// How often diagnostics are published.
const DIAGNOSTICS_EVERY: Duration = Duration::from_secs(1);
/// How long a peer has to hear that the node leaves.
const FAREWELL: Duration = Duration::from_millis(300);

/// What stops a node from starting.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// A name is none of ROS.
    #[error(
        "{what} `{name}` is no name of ROS 2: {why}; expected letters, digits and _ between slashes, e.g. {example}"
    )]
    Name {
        /// What is named.
        what: &'static str,
        /// The name.
        name: String,
        /// What is wrong with it.
        why: String,
        /// A good one.
        example: &'static str,
    },
    /// The network refused.
    #[error("the node cannot start in domain {domain}: {why}")]
    Network {
        /// The domain.
        domain: u16,
        /// What the middleware says.
        why: String,
    },
}

/// The topic of an input, unless another is named; relative names are in the namespace of the node.
#[must_use]
pub const fn usual_topic(role: Role) -> &'static str {
    match role {
        Role::Inertial => "imu/data_raw",
        Role::Field => "imu/mag",
        Role::Fix => "fix",
        Role::Velocity => "fix_velocity",
        Role::Pressure => "pressure",
        Role::Reference => "reference/orientation",
        Role::DeviceOrientation => "device/orientation",
        Role::LocalPosition | Role::Position => "pose",
        Role::ForwardSpeed => "odom",
    }
}

/// What subscriptions ask for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Reliability {
    /// Messages may be lost, and every publisher is heard: what drivers of sensors use.
    #[default]
    BestEffort,
    /// None is lost; publishers of best effort are not heard.
    Reliable,
}

/// How to start a node.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeConfig {
    /// Its name. Default `northing`.
    pub name: String,
    /// Its namespace. Default `/`.
    pub namespace: String,
    /// The domain of DDS. Default 0.
    pub domain: u16,
    /// What is listened to, and where; by default attitude's `Imu` and `MagneticField`.
    pub inputs: Vec<(Role, String)>,
    /// Of the topics in.
    pub reliability: Reliability,
    /// The parameters that `ros2 param` shows, which cannot be set while it runs.
    pub parameters: Vec<UsedParameter>,
}

impl Default for NodeConfig {
    fn default() -> Self {
        Self {
            name: "northing".to_owned(),
            namespace: "/".to_owned(),
            domain: 0,
            inputs: [Role::Inertial, Role::Field]
                .map(|role| (role, usual_topic(role).to_owned()))
                .to_vec(),
            reliability: Reliability::default(),
            parameters: Vec::new(),
        }
    }
}

/// What is published.
#[derive(Clone)]
pub(crate) struct Publishers {
    topics: Arc<Mutex<BTreeMap<EstimateTopic, Publisher<Bytes>>>>,
}

impl Publishers {
    /// Publishes a message; a peer that is slow, or gone, costs at most the patience of the middleware.
    pub(crate) fn publish(&self, topic: EstimateTopic, bytes: Vec<u8>) {
        let topics = self.topics.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(publisher) = topics.get(&topic) {
            let _ = publisher.publish(Bytes(bytes));
        }
    }
}

/// A running node.
pub struct Node {
    runtime: Runtime,
    node: Option<ros2_client::Node>,
    messages: Receiver<Message>,
    pub(crate) publishers: Publishers,
    diagnostics: Arc<Mutex<Diagnostics>>,
    full_name: String,
}

impl std::fmt::Debug for Node {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut text = f.debug_struct("Node");
        text.field("name", &self.full_name).finish_non_exhaustive()
    }
}

/// The pair of a package and a type: `sensor_msgs/msg/Imu`.
fn type_name(schema: &str) -> MessageTypeName {
    let (package, name) = schema.split_once("/msg/").unwrap_or(("", schema));
    MessageTypeName::new(package, name)
}

/// A topic by its name, in this namespace unless it begins with a slash.
fn topic_name(namespace: &str, name: &str) -> Result<Name, NodeError> {
    let full = match name.starts_with('/') {
        true => name.to_owned(),
        false => format!("{}/{name}", namespace.trim_end_matches('/')),
    };
    Name::parse(&full).map_err(|error| NodeError::Name {
        what: "the topic",
        name: full,
        why: error.to_string(),
        example: "imu/data_raw",
    })
}

fn queue() -> History {
    History::KeepLast { depth: QUEUE }
}

/// What publishers promise: every subscription can hear them.
fn published() -> QosProfile {
    QosProfile::publisher_default()
        .history(queue())
        .reliability_reliable(WhenFull::Fail)
}

impl Node {
    /// Starts it: from now on messages wait to be taken.
    ///
    /// # Errors
    /// A name is none of ROS, or there is no network.
    pub fn start(config: &NodeConfig) -> Result<Self, NodeError> {
        let network = |why: String| NodeError::Network {
            domain: config.domain,
            why,
        };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .map_err(|error| network(error.to_string()))?;
        let options = ContextOptions::new().domain_id(config.domain);
        let context = Context::with_options(options).map_err(|error| network(error.to_string()))?;
        let name = NodeName::new(&config.namespace, &config.name);
        let name = name.map_err(|error| NodeError::Name {
            what: "the node",
            name: format!("{}/{}", config.namespace, config.name),
            why: error.to_string(),
            example: "/robot_1/northing",
        })?;
        let runs = Arc::new(AtomicBool::new(false));
        let mut node = context
            .new_node(name, options_of(config, Arc::clone(&runs)))
            .map_err(|error| network(error.to_string()))?;
        runs.store(true, Ordering::Relaxed);
        let spinner = node.spinner().map_err(|error| network(error.to_string()))?;
        runtime.spawn(spinner.spin());
        let (sender, messages) = mpsc::channel();
        let qos = match config.reliability {
            Reliability::BestEffort => QosProfile::subscription_default(),
            Reliability::Reliable => {
                QosProfile::subscription_default().reliability_reliable(WhenFull::DEFAULT)
            }
        };
        let qos = qos.history(queue());
        for (role, topic) in &config.inputs {
            let name = topic_name(&config.namespace, topic)?;
            for schema in role.schemas() {
                let topic = node.create_topic(&name, type_name(schema), &qos);
                let subscription = topic
                    .and_then(|topic| node.create_subscription::<Bytes>(&topic, None))
                    .map_err(|error| network(error.to_string()))?;
                runtime.spawn(listen(subscription, *role, schema, sender.clone()));
            }
        }
        let mut topics = BTreeMap::new();
        for topic in EstimateTopic::ALL {
            let name = topic_name(&config.namespace, topic.name().trim_start_matches('/'))?;
            let publisher = node
                .create_topic(&name, type_name(topic.schema()), &published())
                .and_then(|topic| node.create_publisher::<Bytes>(&topic, None))
                .map_err(|error| network(error.to_string()))?;
            topics.insert(topic, publisher);
        }
        let health = Arc::new(Mutex::new(Diagnostics::new(
            &node.fully_qualified_name(),
            config,
        )));
        let publisher = node
            .create_topic(
                &topic_name(&config.namespace, diagnostics::TOPIC)?,
                type_name(diagnostics::SCHEMA),
                &published(),
            )
            .and_then(|topic| node.create_publisher::<Bytes>(&topic, None))
            .map_err(|error| network(error.to_string()))?;
        runtime.spawn(tell(publisher, Arc::clone(&health)));
        Ok(Self {
            runtime,
            full_name: node.fully_qualified_name(),
            node: Some(node),
            messages,
            publishers: Publishers {
                topics: Arc::new(Mutex::new(topics)),
            },
            diagnostics: health,
        })
    }

    /// Namespace and name: `/robot_1/northing`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.full_name
    }

    /// What is published once a second.
    #[must_use]
    pub fn diagnostics(&self) -> Arc<Mutex<Diagnostics>> {
        Arc::clone(&self.diagnostics)
    }

    /// The next message, waiting for it at most so long.
    pub(crate) fn next(&self, patience: Duration) -> Option<Message> {
        self.messages.recv_timeout(patience).ok()
    }

    /// Leaves the network, so that peers know at once.
    pub fn stop(mut self) {
        drop(self.node.take());
        self.runtime.shutdown_timeout(FAREWELL);
    }
}

/// The parameters, which nobody may set any more once the node `runs`.
fn options_of(config: &NodeConfig, runs: Arc<AtomicBool>) -> NodeOptions {
    let refused = move |name: &str, _: &ParameterValue| match runs.load(Ordering::Relaxed) {
        true => Err(format!(
            "{name} is fixed while the node runs: start it again with --set {name}=VALUE"
        )),
        false => Ok(()),
    };
    let mut options = NodeOptions::new().enable_rosout(false);
    for used in &config.parameters {
        options = options.declare_parameter(&used.name, parameter_value(&used.value));
    }
    options.parameter_validator(Box::new(refused))
}

fn parameter_value(value: &Json) -> ParameterValue {
    match value {
        Json::Bool(flag) => ParameterValue::Boolean(*flag),
        Json::String(word) => ParameterValue::String(word.clone()),
        Json::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(count), _) => ParameterValue::Integer(count),
            (None, number) => ParameterValue::Double(number.unwrap_or(f64::NAN)),
        },
        Json::Array(numbers) => {
            ParameterValue::DoubleArray(numbers.iter().filter_map(Json::as_f64).collect())
        }
        Json::Null | Json::Object(_) => ParameterValue::NotSet,
    }
}

/// Hands over what a subscription hears, until the node stops.
async fn listen(
    subscription: Subscription<Bytes>,
    role: Role,
    schema: &'static str,
    messages: Sender<Message>,
) {
    let mut stream = Box::pin(subscription.async_stream_seed(AnyBytes));
    while let Some(heard) = stream.next().await {
        // What cannot be read is counted where it is taken.
        let bytes = heard.map_or(Vec::new(), |(bytes, _)| bytes.0);
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let now_ns = now.map_or(0, |since| i64::try_from(since.as_nanos()).unwrap_or(0));
        let events = measured(role, schema, &bytes, now_ns, None);
        let message = Message {
            role,
            frame: frame_id(&bytes).map(str::to_owned),
            events: events.map(Iterator::collect),
        };
        if messages.send(message).is_err() {
            return;
        }
    }
}

/// Publishes diagnostics, until the node stops.
async fn tell(publisher: Publisher<Bytes>, diagnostics: Arc<Mutex<Diagnostics>>) {
    let mut interval = tokio::time::interval(DIAGNOSTICS_EVERY);
    loop {
        interval.tick().await;
        let bytes = {
            let mut diagnostics = diagnostics.lock().unwrap_or_else(PoisonError::into_inner);
            diagnostics.message()
        };
        if let Some(bytes) = bytes {
            let _ = publisher.publish(Bytes(bytes));
        }
    }
}
