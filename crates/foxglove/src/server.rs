//! The server: viewers connect, see topics, and read and set parameters.

use std::net::SocketAddr;
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use foxglove::websocket::{
    AnyClient, Capability, GetParametersResponder, Parameter, ParameterHandler, ParameterValue,
    PlaybackState, ServerListener, SetParametersResponder, Status,
};
use foxglove::{Context, FoxgloveError, WebSocketServer, WebSocketServerHandle};
use serde_json::{Map, Value as Json};

use crate::topics::{Topics, protocol_ns};

/// Messages that wait for a slow viewer; the oldest are dropped then.
const BACKLOG: usize = 8192;
/// The status that tells what became of a setting.
const SETTING: &str = "northing-setting";

/// What stops the server from starting.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// Nothing can listen there.
    #[error("nothing can listen on {address}: {why}; name another, e.g. --foxglove=127.0.0.1:8766")]
    Address {
        /// The address.
        address: SocketAddr,
        /// What the system says.
        why: String,
    },
    /// The server refuses.
    #[error("the server for Foxglove cannot start: {0}")]
    Other(FoxgloveError),
}

/// A parameter and its value.
pub type Setting = (String, Json);

/// Parameters that a viewer wants to have.
#[derive(Debug)]
pub struct SetRequest {
    /// What is to be set.
    pub settings: Vec<Setting>,
    responder: SetParametersResponder,
}

/// What viewers read and set.
struct Parameters {
    now: Mutex<Vec<Parameter>>,
    requests: Mutex<Sender<SetRequest>>,
}

impl Parameters {
    fn now(&self) -> Vec<Parameter> {
        let now = self.now.lock();
        now.unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl ParameterHandler for Parameters {
    fn get(
        &self,
        _: AnyClient,
        names: Vec<String>,
        _: Option<String>,
        responder: GetParametersResponder,
    ) {
        let mut parameters = self.now();
        parameters.retain(|parameter| names.is_empty() || names.contains(&parameter.name));
        responder.respond(parameters);
    }

    fn set(
        &self,
        _: AnyClient,
        parameters: Vec<Parameter>,
        _: Option<String>,
        responder: SetParametersResponder,
    ) {
        let settings = parameters.iter().filter_map(setting).collect();
        let request = SetRequest {
            settings,
            responder,
        };
        let requests = self.requests.lock();
        // Without a taker the server is about to stop.
        let _ = requests
            .unwrap_or_else(PoisonError::into_inner)
            .send(request);
    }
}

/// A running server.
pub struct Server {
    handle: WebSocketServerHandle,
    context: Arc<Context>,
    parameters: Arc<Parameters>,
    requests: Mutex<Receiver<SetRequest>>,
    address: SocketAddr,
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut text = f.debug_struct("Server");
        text.field("address", &self.address).finish_non_exhaustive()
    }
}

impl Server {
    /// Starts one under this name; port 0 takes a free one. `playback`: the span that can be played, ns, and who plays it.
    ///
    /// # Errors
    /// Nothing can listen there.
    pub(crate) fn start(
        address: SocketAddr,
        name: &str,
        parameters: &[Setting],
        playback: Option<([i64; 2], Arc<dyn ServerListener>)>,
    ) -> Result<Self, ServerError> {
        let context = Context::new();
        let (sender, requests) = mpsc::channel();
        let parameters = Arc::new(Parameters {
            now: Mutex::new(parameters.iter().map(parameter).collect()),
            requests: Mutex::new(sender),
        });
        let mut server = WebSocketServer::new()
            .name(name)
            .bind(address.ip().to_string(), address.port())
            .context(&context)
            .message_backlog_size(BACKLOG)
            .parameter_handler(Arc::clone(&parameters) as Arc<dyn ParameterHandler>);
        if let Some(([start_ns, end_ns], listener)) = playback {
            server = server
                .capabilities([Capability::Time])
                .playback_time_range(protocol_ns(start_ns), protocol_ns(end_ns))
                .listener(listener);
        }
        let handle = server.start_blocking().map_err(|error| match error {
            FoxgloveError::Bind(why) => ServerError::Address {
                address,
                why: why.to_string(),
            },
            other => ServerError::Other(other),
        })?;
        let address = SocketAddr::new(address.ip(), handle.port());
        Ok(Self {
            handle,
            context,
            parameters,
            requests: Mutex::new(requests),
            address,
        })
    }

    /// Starts one that is live: nothing can be paused, and stamps are of now.
    ///
    /// # Errors
    /// Nothing can listen there.
    pub fn live(address: SocketAddr, name: &str) -> Result<Self, ServerError> {
        Self::start(address, name, &[], None)
    }

    /// Where viewers connect.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Topics of this server whose names begin with `prefix`, the body named `body` in transforms.
    #[must_use]
    pub fn topics(&self, prefix: &str, body: &str) -> Topics {
        Topics::new(Arc::clone(&self.context), prefix, body)
    }

    /// The next parameters that a viewer sets, waiting for them at most so long.
    #[must_use]
    pub fn next_request(&self, patience: Duration) -> Option<SetRequest> {
        let requests = self.requests.lock();
        let requests = requests.unwrap_or_else(PoisonError::into_inner);
        requests.recv_timeout(patience).ok()
    }

    /// Tells the viewer that asked which values are in force now.
    pub fn answer(&self, request: SetRequest) {
        let mut parameters = self.parameters.now();
        parameters.retain(|p| request.settings.iter().any(|(name, _)| *name == p.name));
        request.responder.respond(parameters);
    }

    /// The parameters in force, for all viewers that follow them.
    pub fn publish_parameters(&self, parameters: &[Setting]) {
        let parameters: Vec<Parameter> = parameters.iter().map(parameter).collect();
        let now = self.parameters.now.lock();
        now.unwrap_or_else(PoisonError::into_inner)
            .clone_from(&parameters);
        self.handle.publish_parameter_values(parameters);
    }

    /// Those that stay in force, for viewers that show what they had asked for.
    pub(crate) fn republish_parameters(&self) {
        self.handle.publish_parameter_values(self.parameters.now());
    }

    /// What became of a setting, in a sentence; it stays until the next one.
    pub fn publish_outcome(&self, outcome: Result<String, String>) {
        let status = match outcome {
            Ok(text) => Status::info(text),
            Err(text) => Status::error(text),
        };
        self.handle.publish_status(status.with_id(SETTING));
    }

    pub(crate) fn publish_time(&self, now_ns: i64) {
        self.handle.broadcast_time(protocol_ns(now_ns));
    }

    pub(crate) fn publish_playback(&self, state: PlaybackState) {
        self.handle.broadcast_playback_state(state);
    }

    /// Ends it; viewers are told.
    pub fn stop(self) {
        self.handle.stop().wait_blocking();
    }
}

/// A parameter as viewers see it.
fn parameter((name, value): &Setting) -> Parameter {
    match value {
        Json::Bool(flag) => Parameter::bool(name, *flag),
        Json::String(word) => Parameter::string(name, word.as_str()),
        Json::Number(number) => match number.as_f64() {
            Some(number) => Parameter::float64(name, number),
            None => Parameter::empty(name),
        },
        Json::Array(items) => Parameter::float64_array(name, items.iter().filter_map(Json::as_f64)),
        Json::Null | Json::Object(_) => Parameter::empty(name),
    }
}

/// What a viewer asks for; `None` of a parameter without a value.
fn setting(parameter: &Parameter) -> Option<Setting> {
    Some((parameter.name.clone(), json(parameter.value.as_ref()?)))
}

fn json(value: &ParameterValue) -> Json {
    match value {
        ParameterValue::Integer(number) => Json::from(*number),
        ParameterValue::Float64(number) => Json::from(*number),
        ParameterValue::Bool(flag) => Json::from(*flag),
        ParameterValue::String(word) => Json::from(word.as_str()),
        ParameterValue::Array(items) => items.iter().map(json).collect(),
        // No parameter has such a value, and it is refused with what was expected.
        ParameterValue::Dict(_) => Json::Object(Map::new()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::by_name::text;
    use northing_evaluation::{Profile, RunOptions, attitude::EstimatorKind};

    /// What a viewer reads and sends back changes nothing.
    #[test]
    fn every_parameter_of_every_estimator_comes_back_as_it_was() {
        let mut compared = 0;
        for kind in EstimatorKind::ALL {
            let options = RunOptions::new(kind, Profile::default());
            let mut again = options.clone();
            for used in options.parameters() {
                let (name, value) = setting(&parameter(&(used.name, used.value))).unwrap();
                let setting = format!("{name}={}", text(&value));
                again
                    .set(&setting)
                    .unwrap_or_else(|e| panic!("{kind}: {setting}: {e}"));
                compared += 1;
            }
            for (before, after) in options.parameters().iter().zip(again.parameters()) {
                assert_eq!(before.value, after.value, "{kind}: {}", before.name);
            }
        }
        assert!(compared > 50, "{compared}");
    }

    #[test]
    fn a_value_of_no_kind_is_refused_by_name() {
        let dict = Parameter::dict("accelerometer_std", Default::default());
        let mut options = RunOptions::new(EstimatorKind::Mekf, Profile::default());
        let (name, value) = setting(&dict).unwrap();
        let refused = options
            .set(&format!("{name}={}", text(&value)))
            .unwrap_err();
        assert!(
            refused.to_string().contains("accelerometer_std"),
            "{refused}"
        );
        assert_eq!(setting(&Parameter::empty("accelerometer_std")), None);
    }
}
