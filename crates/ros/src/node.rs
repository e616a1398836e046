//! The node: topics in, topics out, and the threads between.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use futures_util::StreamExt as _;
use northing_evaluation::UsedParameter;
use northing_evaluation::by_name::text;
use northing_recording::Event;
use northing_recording::mcap::{EstimateTopic, Mounting, Role, frame_id, measured};
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, NodeName, NodeOptions, ParameterValue,
    Publisher, QosProfile, Subscription,
};
use serde_json::Value as Json;
use tokio::runtime::Runtime;

use crate::bytes::{AnyBytes, Bytes};
use crate::diagnostics::{self, Diagnostics};
use crate::messages::Message;
use crate::mounted::Mounted;

/// Messages that wait for the estimator, and that the middleware keeps of a topic: 1 s at 1 kHz.
const QUEUE: usize = 1000;
/// The topic of static transforms, unless another is named.
pub const TRANSFORMS: &str = "tf_static";
/// The type of its messages.
const TRANSFORM: &str = "tf2_msgs/msg/TFMessage";
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
#[derive(Debug, Clone)]
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
    /// Where static transforms are listened to.
    pub transforms: String,
    /// The parameters that `ros2 param` shows and sets.
    pub parameters: Vec<UsedParameter>,
    /// Says why a value of a parameter is refused.
    pub check: Check,
}

/// Checks `NAME=VALUE` of a parameter, and says why it is refused.
#[derive(Clone)]
pub struct Check(pub Arc<Checker>);

type Checker = dyn Fn(&str) -> Result<(), String> + Send + Sync;

impl std::fmt::Debug for Check {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Check").finish_non_exhaustive()
    }
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
            transforms: TRANSFORMS.to_owned(),
            parameters: Vec::new(),
            check: Check(Arc::new(|_| Ok(()))),
        }
    }
}

/// What comes to the node.
#[derive(Debug, Clone)]
pub(crate) enum Heard {
    /// Of a sensor.
    Message(Message),
    /// The bytes of a message on `tf_static`.
    Transforms(Vec<u8>),
    /// `NAME=VALUE` of a parameter that was set and found good.
    Setting(String),
}

/// What is published.
#[derive(Clone)]
pub(crate) struct Publishers {
    topics: Arc<Mutex<BTreeMap<EstimateTopic, Publisher<Bytes>>>>,
}

impl Publishers {
    /// Publishes a message, without waiting for a peer that is slow or gone; whether the middleware took it. It takes none while
    /// so many as the queue holds are not acknowledged.
    pub(crate) fn publish(&self, topic: EstimateTopic, bytes: Vec<u8>) -> bool {
        let topics = self.topics.lock().unwrap_or_else(PoisonError::into_inner);
        (topics.get(&topic)).is_some_and(|publisher| publisher.publish(Bytes(bytes)).is_ok())
    }
}

/// A running node.
pub struct Node {
    runtime: Runtime,
    node: Option<ros2_client::Node>,
    heard: Receiver<Heard>,
    /// What was heard and is to be heard again.
    unread: Mutex<Option<Heard>>,
    pub(crate) publishers: Publishers,
    diagnostics: Arc<Mutex<Diagnostics>>,
    mounted: Arc<Mutex<Mounted>>,
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
        let (sender, heard) = mpsc::channel();
        // They are declared with the values that they have.
        let node = telling(|| context.new_node(name, options_of(config, sender.clone())));
        let mut node = node.map_err(|error| network(error.to_string()))?;
        let spinner = node.spinner().map_err(|error| network(error.to_string()))?;
        runtime.spawn(spinner.spin());
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
        // They are published once, and kept for whoever comes later.
        let latched = QosProfile::subscription_default()
            .reliability_reliable(WhenFull::DEFAULT)
            .durability(Durability::TransientLocal)
            .history(queue());
        let name = topic_name(&config.namespace, &config.transforms)?;
        let subscription = node
            .create_topic(&name, type_name(TRANSFORM), &latched)
            .and_then(|topic| node.create_subscription::<Bytes>(&topic, None))
            .map_err(|error| network(error.to_string()))?;
        runtime.spawn(listen_to_transforms(subscription, sender));
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
            heard,
            unread: Mutex::new(None),
            publishers: Publishers {
                topics: Arc::new(Mutex::new(topics)),
            },
            diagnostics: health,
            mounted: Arc::default(),
        })
    }

    /// How the sensors are mounted, as far as it is known.
    #[must_use]
    pub fn mounting(&self) -> Mounting {
        self.mounted().mounting.clone()
    }

    pub(crate) fn mounted(&self) -> MutexGuard<'_, Mounted> {
        self.mounted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Shows parameters that the node itself has changed.
    pub fn tell_parameters<'a>(&self, parameters: impl IntoIterator<Item = &'a UsedParameter>) {
        let Some(node) = &self.node else {
            return;
        };
        for used in parameters {
            // One whose type would change stays as it is shown.
            let _ = telling(|| node.set_parameter(&used.name, parameter_value(&used.value)));
        }
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

    pub(crate) fn told(&self) -> MutexGuard<'_, Diagnostics> {
        self.diagnostics
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// What is heard next, waiting for it at most so long.
    pub(crate) fn next(&self, patience: Duration) -> Option<Heard> {
        let unread = self.unread.lock();
        let unread = unread.unwrap_or_else(PoisonError::into_inner).take();
        unread.or_else(|| self.heard.recv_timeout(patience).ok())
    }

    /// Keeps what was heard for the next run.
    pub(crate) fn unread(&self, heard: Heard) {
        let unread = self.unread.lock();
        *unread.unwrap_or_else(PoisonError::into_inner) = Some(heard);
    }

    /// Leaves the network, so that peers know at once.
    pub fn stop(mut self) {
        drop(self.node.take());
        self.runtime.shutdown_timeout(FAREWELL);
    }
}

thread_local! {
    /// Whether this thread tells values of parameters, which others need not be told of.
    static TELLS: Cell<bool> = const { Cell::new(false) };
}

/// Tells values of parameters: callbacks run within the call.
fn telling<T>(tell: impl FnOnce() -> T) -> T {
    TELLS.set(true);
    let told = tell();
    TELLS.set(false);
    told
}

/// The parameters: what others set is checked and handed over.
fn options_of(config: &NodeConfig, sender: Sender<Heard>) -> NodeOptions {
    let check = config.check.clone();
    let known: Vec<String> = config.parameters.iter().map(|p| p.name.clone()).collect();
    let is_set = move |name: &str| !TELLS.get() && known.iter().any(|known| known == name);
    let to_check = is_set.clone();
    let validator = move |name: &str, value: &ParameterValue| match to_check(name) {
        true => (check.0)(&setting(name, value)?),
        false => Ok(()),
    };
    let action = move |name: &str, value: &ParameterValue| {
        if is_set(name) {
            // Without a taker the node is about to stop.
            let _ = sender.send(Heard::Setting(setting(name, value)?));
        }
        Ok(())
    };
    let mut options = NodeOptions::new().enable_rosout(false);
    for used in &config.parameters {
        options = options.declare_parameter(&used.name, parameter_value(&used.value));
    }
    options
        .parameter_validator(Box::new(validator))
        .parameter_set_action(Box::new(action))
}

/// `NAME=VALUE` of a parameter.
fn setting(name: &str, value: &ParameterValue) -> Result<String, String> {
    let value = match value {
        ParameterValue::Boolean(flag) => Json::from(*flag),
        ParameterValue::Integer(count) => Json::from(*count),
        ParameterValue::Double(number) => Json::from(*number),
        ParameterValue::String(word) => Json::from(word.as_str()),
        ParameterValue::DoubleArray(numbers) => Json::from(numbers.as_slice()),
        ParameterValue::IntegerArray(numbers) => Json::from(numbers.as_slice()),
        _ => {
            return Err(format!(
                "{name}: expected a number, a list of numbers, true or false, or a word"
            ));
        }
    };
    Ok(format!("{name}={}", text(&value)))
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
    messages: Sender<Heard>,
) {
    let mut stream = Box::pin(subscription.async_stream_seed(AnyBytes));
    while let Some(heard) = stream.next().await {
        // What cannot be read is counted where it is taken.
        let bytes = heard.map_or(Vec::new(), |(bytes, _)| bytes.0);
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        let now_ns = now.map_or(0, |since| i64::try_from(since.as_nanos()).unwrap_or(0));
        let events = measured(role, schema, &bytes, now_ns, None);
        let events: Option<Vec<Event>> = events.map(Iterator::collect);
        // A stamp of zero was replaced by the time of arrival.
        let is_now = |events: &Vec<Event>| events.iter().any(|event| event.time_ns == now_ns);
        let message = Message {
            role,
            frame: frame_id(&bytes).map(str::to_owned),
            is_unstamped: events.as_ref().is_some_and(is_now),
            events,
        };
        if messages.send(Heard::Message(message)).is_err() {
            return;
        }
    }
}

/// Hands over static transforms, until the node stops.
async fn listen_to_transforms(subscription: Subscription<Bytes>, sender: Sender<Heard>) {
    let mut stream = Box::pin(subscription.async_stream_seed(AnyBytes));
    while let Some(heard) = stream.next().await {
        if let Ok((bytes, _)) = heard
            && sender.send(Heard::Transforms(bytes.0)).is_err()
        {
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
            // Where it is not taken there is nobody to tell: this is how a peer is told.
            let _ = publisher.publish(Bytes(bytes));
        }
    }
}
