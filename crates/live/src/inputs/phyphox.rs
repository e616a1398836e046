//! phyphox with remote access: we ask its server for what is new, fifteen times a second.

use std::time::Duration;

use axum::body::Bytes;
use http_body_util::{BodyExt, Empty, Limited};
use hyper::client::conn::http1::{SendRequest, handshake};
use hyper::{Request, StatusCode, header};
use hyper_util::rt::TokioIo;
use northing_recording::wire::phyphox::{LONGEST_ANSWER_BYTES, Phyphox};
use tokio::net::TcpStream;
use tokio::time::{MissedTickBehavior, timeout};

use super::InputState;
use super::link::{Ended, Feed, Link, in_words, not_reached};
use super::spec::Address;

/// Time between two questions.
const INTERVAL: Duration = Duration::from_millis(66);
/// An answer must be there within so long.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);
/// Answers without anything new after which that is said: about three seconds.
const NOTHING_NEW: u32 = 45;

/// The experiment on the phone: its description, and what of it is known already.
pub(super) struct Experiment {
    config: Bytes,
    decoder: Phyphox,
}

/// Asks again and again until an answer fails.
pub(super) async fn connected(
    link: &Link,
    feed: &mut Feed,
    experiment: &mut Option<Experiment>,
    delivered: &mut bool,
) -> Ended {
    link.connecting("connecting to");
    let mut server = Server {
        address: link.address(),
        connection: None,
    };
    let decoder = begin(&mut server, feed, experiment).await?;
    poll(link, feed, &mut server, decoder, delivered).await
}

/// Asks for the description of the experiment. The same one as before goes on where it was.
async fn begin<'a>(
    server: &mut Server<'_>,
    feed: &mut Feed,
    experiment: &'a mut Option<Experiment>,
) -> Result<&'a mut Phyphox, String> {
    let config = server.get("/config").await?;
    if experiment.as_ref().is_none_or(|e| e.config != config) {
        let decoder = Phyphox::from_config(&config).map_err(|error| error.to_string())?;
        // The device's decoder learns it from the same bytes.
        feed.give(config.clone()).await?;
        *experiment = Some(Experiment { config, decoder });
    }
    let known = experiment.as_mut().map(|e| &mut e.decoder);
    known.ok_or_else(|| "there is no experiment".to_owned())
}

async fn poll(
    link: &Link,
    feed: &mut Feed,
    server: &mut Server<'_>,
    decoder: &mut Phyphox,
    delivered: &mut bool,
) -> Ended {
    link.say(InputState::Connected, "connected");
    let mut tick = tokio::time::interval(INTERVAL);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut nothing_new = 0;
    loop {
        tick.tick().await;
        let answer = server.get(&decoder.request_path()).await?;
        // Decoded here only to know what to ask for next.
        let decoded = decoder.push(&answer);
        if decoded.events.is_empty() {
            nothing_new += 1;
            if nothing_new % NOTHING_NEW == 0 {
                let told = decoded.notices.first().map(|notice| notice.text.as_str());
                let text = told.unwrap_or("nothing new comes: press the play button in the app");
                link.say(InputState::Connected, format!("connected, but {text}"));
            }
            continue;
        }
        nothing_new = 0;
        feed.give(answer).await?;
        *delivered = true;
        if let Some(text) = feed.news() {
            link.say(InputState::Connected, text);
        }
    }
}

/// An HTTP server on a phone: one connection, kept while it lasts.
struct Server<'a> {
    address: &'a Address,
    connection: Option<SendRequest<Empty<Bytes>>>,
}

impl Server<'_> {
    /// The body of the answer to a GET.
    async fn get(&mut self, path: &str) -> Result<Bytes, String> {
        match timeout(ANSWER_TIMEOUT, self.get_without_end(path)).await {
            Ok(answer) => answer,
            Err(_) => {
                self.connection = None;
                Err(not_reached(self.address))
            }
        }
    }

    async fn get_without_end(&mut self, path: &str) -> Result<Bytes, String> {
        let address = self.address;
        let broken = |error: hyper::Error| format!("{address} broke the connection off: {error}");
        let kept = self.connection.take();
        let fresh = kept.is_none();
        let mut connection = match kept {
            Some(connection) => connection,
            None => self.connect().await?,
        };
        if !fresh && connection.ready().await.is_err() {
            // Small servers close after each answer or after a while.
            connection = self.connect().await?;
        }
        let request = Request::get(path)
            .header(header::HOST, address.to_string())
            .body(Empty::new())
            .map_err(|error| format!("the request for {address}: {error}"))?;
        let answer = connection.send_request(request).await.map_err(broken)?;
        if answer.status() != StatusCode::OK {
            let status = answer.status();
            return Err(format!(
                "{address} answers with {status}: is this phyphox with remote access?"
            ));
        }
        let body = Limited::new(answer.into_body(), LONGEST_ANSWER_BYTES).collect();
        let body = body.await.map_err(|error| {
            format!(
                "{address}: the answer cannot be read ({error}); clear the experiment in the app"
            )
        })?;
        self.connection = Some(connection);
        Ok(body.to_bytes())
    }

    async fn connect(&self) -> Result<SendRequest<Empty<Bytes>>, String> {
        let stream = TcpStream::connect(self.address.to_string()).await;
        let stream = stream.map_err(|error| in_words(&error, self.address))?;
        // Without it questions wait for acknowledgements; where it cannot be set they do.
        let _ = stream.set_nodelay(true);
        let (sender, connection) = handshake(TokioIo::new(stream))
            .await
            .map_err(|error| format!("{}: {error}", self.address))?;
        // It ends with its sender.
        tokio::spawn(connection);
        Ok(sender)
    }
}
