//! SensorServer (Android): we connect to its WebSocket and take its text frames.

use std::time::Duration;

use axum::body::Bytes;
use futures_util::StreamExt;
use northing_recording::wire::LONGEST_BATCH_BYTES;
use northing_recording::wire::sensorserver::CONNECT_PATH;
use tokio::net::TcpStream;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async_with_config};

use super::InputState;
use super::link::{Ended, Feed, Link, in_words, not_reached};

/// A connection must be there within so long.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// Silence is looked at in steps of this.
const STEP: Duration = Duration::from_secs(1);
/// Steps of silence after which it is said, and after which the connection is given up.
const SILENT: [u32; 2] = [3, 15];

type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// Connects, and listens until the connection breaks off.
pub(super) async fn connected(link: &Link, feed: &mut Feed, delivered: &mut bool) -> Ended {
    link.connecting("connecting to");
    let socket = connect(link).await?;
    listen(link, feed, socket, delivered).await
}

async fn connect(link: &Link) -> Result<Socket, String> {
    let address = link.address();
    let url = format!("ws://{address}{CONNECT_PATH}");
    let config = WebSocketConfig::default()
        .max_message_size(Some(LONGEST_BATCH_BYTES))
        .max_frame_size(Some(LONGEST_BATCH_BYTES));
    let connecting = connect_async_with_config(url, Some(config), true);
    match timeout(CONNECT_TIMEOUT, connecting).await {
        Ok(Ok((socket, _))) => Ok(socket),
        Ok(Err(Error::Io(error))) => Err(in_words(&error, address)),
        Ok(Err(Error::Http(answer))) => Err(format!(
            "{address} answers with {}: is this SensorServer?",
            answer.status()
        )),
        Ok(Err(error)) => Err(format!("{address}: {error}; is this SensorServer?")),
        Err(_) => Err(not_reached(address)),
    }
}

async fn listen(link: &Link, feed: &mut Feed, mut socket: Socket, delivered: &mut bool) -> Ended {
    link.say(InputState::Connected, "connected");
    let mut silent = 0;
    loop {
        return Err(match timeout(STEP, socket.next()).await {
            Err(_) => {
                silent += 1;
                if silent == SILENT[0] {
                    let text = "connected, but nothing comes: does the phone have these sensors, and is the app allowed to run in the background?";
                    link.say(InputState::Connected, text);
                }
                if silent < SILENT[1] {
                    continue;
                }
                format!("nothing came for {} s", SILENT[1])
            }
            Ok(Some(Ok(Message::Text(text)))) => {
                silent = 0;
                feed.give(Bytes::from(text)).await?;
                *delivered = true;
                if let Some(text) = feed.news() {
                    link.say(InputState::Connected, text);
                }
                continue;
            }
            // The app says what it does not like in the reason: 4001 to 4004.
            Ok(Some(Ok(Message::Close(Some(frame))))) => {
                let reason = shown(frame.reason.as_str());
                format!(
                    "SensorServer closed the connection: {reason} ({})",
                    frame.code
                )
            }
            Ok(Some(Ok(Message::Close(None))) | None) => {
                "SensorServer closed the connection".to_owned()
            }
            Ok(Some(Ok(_))) => continue,
            Ok(Some(Err(Error::Io(error)))) => in_words(&error, link.address()),
            Ok(Some(Err(error))) => format!("the connection broke off: {error}"),
        });
    }
}

/// What the other side says, short and without control characters.
fn shown(text: &str) -> String {
    if text.is_empty() {
        return "no reason given".to_owned();
    }
    text.chars().filter(|c| !c.is_control()).take(120).collect()
}
