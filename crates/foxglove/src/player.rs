//! A run behind a server: it begins to play when the first viewer connects; viewers pause, seek and set parameters, and a
//! changed parameter runs the estimator over the recording again.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use foxglove::SinkId;
use foxglove::websocket::{
    ChannelView, Client, PlaybackCommand, PlaybackControlRequest, PlaybackState, PlaybackStatus,
    ServerListener,
};
use northing_evaluation::{UsedParameter, by_name};

use crate::playback::{Playback, Status};
use crate::played_run::PlayedRun;
use crate::server::{Server, ServerError, SetRequest, Setting};
use crate::topics::protocol_ns;

/// How often what is due is published.
const TICK: Duration = Duration::from_millis(10);
/// What is shown after a jump waits so long: viewers hear of the jump first.
const AFTER_JUMP: Duration = Duration::from_millis(20);
/// How often it is looked whether the program ends.
const LOOK: Duration = Duration::from_millis(100);
/// The frame of the body in transforms.
const BODY: &str = "base_link";

/// What can be run again.
pub trait Source {
    /// Runs with these settings, each `NAME=VALUE`, changed: what it told, and the parameters that it used.
    ///
    /// # Errors
    /// A setting, or the run, in a sentence; nothing has changed then.
    fn run_with(&mut self, settings: &[String]) -> Result<(PlayedRun, Vec<UsedParameter>), String>;
}

struct State {
    run: Arc<PlayedRun>,
    playback: Playback,
    /// A viewer has been there.
    begun: bool,
    /// From when on the state of the moment is to be shown.
    show_at: Option<Instant>,
    /// Who has subscribed to a topic since it was last looked.
    newcomers: Vec<(String, SinkId)>,
    /// What changed without a viewer asking for it is to be told; `true`: it was a jump.
    tell: Option<bool>,
    ends: bool,
}

impl State {
    fn show(&mut self) {
        self.show_at = Some(Instant::now() + AFTER_JUMP);
    }

    fn told(&self, did_seek: bool) -> PlaybackState {
        PlaybackState {
            status: match self.playback.status() {
                Status::Playing => PlaybackStatus::Playing,
                Status::Paused => PlaybackStatus::Paused,
                Status::Ended => PlaybackStatus::Ended,
            },
            current_time: protocol_ns(self.playback.now_ns()),
            playback_speed: self.playback.speed() as f32,
            did_seek,
            request_id: None,
        }
    }
}

/// The state, shared by the player, its thread and the server.
struct Shared(Mutex<State>);

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ServerListener for Shared {
    fn on_client_connect(&self) {
        let mut state = self.lock();
        if !state.begun {
            state.begun = true;
            state.playback.play();
        }
        state.tell = Some(false);
    }

    fn on_subscribe(&self, viewer: Client, channel: ChannelView<'_>) {
        // What does not change soon would otherwise not be seen until it does.
        if let Some(viewer) = viewer.sink_id() {
            let topic = channel.topic().to_owned();
            self.lock().newcomers.push((topic, viewer));
        }
    }

    fn on_playback_control_request(&self, asked: PlaybackControlRequest) -> Option<PlaybackState> {
        let mut state = self.lock();
        state.begun = true;
        state.playback.set_speed(f64::from(asked.playback_speed));
        let mut has_jumped = false;
        if let Some(time_ns) = asked.seek_time {
            state
                .playback
                .seek(i64::try_from(time_ns).unwrap_or(i64::MAX));
            has_jumped = true;
        }
        match asked.playback_command {
            PlaybackCommand::Play => has_jumped |= state.playback.play(),
            PlaybackCommand::Pause => state.playback.pause(),
        }
        if has_jumped {
            state.show();
        }
        Some(state.told(has_jumped))
    }
}

/// A run that viewers play.
pub struct Player {
    server: Arc<Server>,
    shared: Arc<Shared>,
    thread: JoinHandle<()>,
}

impl std::fmt::Debug for Player {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.server.fmt(f)
    }
}

impl Player {
    /// Starts a server for a run; `name` is what viewers call it.
    ///
    /// # Errors
    /// As [`ServerError`].
    pub fn start(
        address: SocketAddr,
        name: &str,
        run: PlayedRun,
        parameters: &[UsedParameter],
    ) -> Result<Self, ServerError> {
        let span_ns = run.span_ns().unwrap_or_default();
        let shared = Arc::new(Shared(Mutex::new(State {
            run: Arc::new(run),
            playback: Playback::new(span_ns),
            begun: false,
            show_at: Some(Instant::now()),
            newcomers: Vec::new(),
            tell: None,
            ends: false,
        })));
        let listener = Arc::clone(&shared) as Arc<dyn ServerListener>;
        let server = Server::start(
            address,
            name,
            &values(parameters),
            Some((span_ns, listener)),
        )?;
        let server = Arc::new(server);
        let thread = {
            let (server, shared) = (Arc::clone(&server), Arc::clone(&shared));
            std::thread::spawn(move || play(&server, &shared))
        };
        Ok(Self {
            server,
            shared,
            thread,
        })
    }

    /// Where viewers connect.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// Runs again whenever a viewer sets a parameter, until `is_stopped`.
    pub fn serve(self, source: &mut dyn Source, is_stopped: &dyn Fn() -> bool) {
        while !is_stopped() {
            let Some(first) = self.server.next_request(LOOK) else {
                continue;
            };
            // A slider asks for every value on its way: one run answers what waits.
            let mut requests = vec![first];
            while let Some(next) = self.server.next_request(Duration::ZERO) {
                requests.push(next);
            }
            self.run_again(source, requests, is_stopped);
        }
        self.shared.lock().ends = true;
        let _ = self.thread.join();
        if let Some(server) = Arc::into_inner(self.server) {
            server.stop();
        }
    }

    fn run_again(
        &self,
        source: &mut dyn Source,
        requests: Vec<SetRequest>,
        is_stopped: &dyn Fn() -> bool,
    ) {
        let settings = requests.iter().flat_map(|request| &request.settings);
        let settings = newest(settings.cloned());
        let settings: Vec<String> = settings.into_iter().map(named).collect();
        match source.run_with(&settings) {
            Ok((run, parameters)) => {
                let mut state = self.shared.lock();
                state.run = Arc::new(run);
                state.tell = Some(true);
                state.show();
                drop(state);
                let settings = settings.join(", ");
                let told = format!("The estimator ran again with {settings}.");
                self.server.publish_outcome(Ok(told));
                self.server.publish_parameters(&values(&parameters));
            }
            // Nobody waits for an answer any more.
            Err(_) if is_stopped() => {}
            Err(problem) => {
                self.server.publish_outcome(Err(problem));
                self.server.republish_parameters();
            }
        }
        for request in requests {
            self.server.answer(request);
        }
    }
}

/// As `--set` takes it.
fn named((name, value): Setting) -> String {
    format!("{name}={}", by_name::text(&value))
}

fn values(parameters: &[UsedParameter]) -> Vec<Setting> {
    let value = |used: &UsedParameter| (used.name.clone(), used.value.clone());
    parameters.iter().map(value).collect()
}

/// Of settings of one name the last.
fn newest(settings: impl IntoIterator<Item = Setting>) -> Vec<Setting> {
    let mut newest: Vec<Setting> = Vec::new();
    for setting in settings {
        newest.retain(|(name, _)| *name != setting.0);
        newest.push(setting);
    }
    newest
}

/// Publishes what is due until the player ends.
fn play(server: &Server, shared: &Shared) {
    let mut topics = server.topics("", BODY);
    let mut last = Instant::now();
    let mut known = None;
    loop {
        std::thread::sleep(TICK);
        let now = Instant::now();
        let mut state = shared.lock();
        if state.ends {
            return;
        }
        let before_ns = state.playback.now_ns();
        let due = state.playback.advance(now - last);
        last = now;
        if due.is_some() && state.playback.status() == Status::Ended {
            state.tell = Some(state.tell.unwrap_or(false));
        }
        let playback = state.tell.take().map(|did_seek| state.told(did_seek));
        let shows = state.show_at.is_some_and(|at| at <= now);
        if shows {
            state.show_at = None;
        }
        let newcomers = std::mem::take(&mut state.newcomers);
        let (run, now_ns) = (Arc::clone(&state.run), state.playback.now_ns());
        drop(state);
        // What a run tells another may not.
        if known.as_ref().is_none_or(|known| !Arc::ptr_eq(known, &run)) {
            for (_, told) in run.state_at(i64::MAX) {
                topics.advertise(told);
            }
            known = Some(Arc::clone(&run));
        }
        if let Some(playback) = playback {
            server.publish_playback(playback);
        }
        if shows {
            for (time_ns, told) in run.state_at(before_ns) {
                topics.publish(*time_ns, told, false);
            }
        }
        for (topic, viewer) in &newcomers {
            for (time_ns, told) in run.state_at(before_ns) {
                topics.show(topic, *viewer, *time_ns, told);
            }
        }
        for (time_ns, told) in due.map_or(&[][..], |due| run.between(due)) {
            topics.publish(*time_ns, told, true);
        }
        if shows || due.is_some() {
            server.publish_time(now_ns);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_slider_on_its_way_only_the_last_value_is_run() {
        let asked = [("a", 1), ("b", 2), ("a", 3), ("b", 4)];
        let asked = asked.map(|(name, value)| (name.to_owned(), value.into()));
        let named: Vec<String> = newest(asked).into_iter().map(named).collect();
        assert_eq!(named, ["a=3", "b=4"]);
    }
}
