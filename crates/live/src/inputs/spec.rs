//! What an input is and where: `sensorserver=192.168.1.20:8080`, `linkoping=3401`, `razor=/dev/ttyUSB0@57600`.

use std::fmt;
use std::net::IpAddr;
use std::str::FromStr;

use northing_recording::wire::{WireFormat, linkoping};
use serde::{Deserialize, Serialize};

/// Makes the kinds of inputs of a table: the name on the command line and in messages, what their payloads are, the
/// form of their addresses, what people call them, an address, and what to do in the app and here, in a sentence.
macro_rules! kinds {
    ($($(#[$about:meta])* $kind:ident = $name:literal, $format:ident, $form:expr, $title:literal, $example:literal, $hint:literal;)+) => {
        /// The kinds of inputs.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        #[cfg_attr(test, derive(ts_rs::TS))]
        pub enum InputKind {
            $($(#[$about])* #[serde(rename = $name)] $kind,)+
        }

        impl InputKind {
            /// Every kind.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$kind),+];

            /// The name on the command line and in messages.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$kind => $name,)+ }
            }

            /// What people call it.
            #[must_use]
            pub const fn title(self) -> &'static str {
                match self { $(Self::$kind => $title,)+ }
            }

            /// What to do in the app and here, in a sentence or two.
            #[must_use]
            pub const fn hint(self) -> &'static str {
                match self { $(Self::$kind => $hint,)+ }
            }

            /// An address, as an example.
            #[must_use]
            pub const fn example(self) -> &'static str {
                match self { $(Self::$kind => $example,)+ }
            }

            /// What its payloads are.
            #[must_use]
            pub const fn format(self) -> WireFormat {
                match self { $(Self::$kind => WireFormat::$format,)+ }
            }

            const fn form(self) -> Form {
                match self { $(Self::$kind => $form,)+ }
            }
        }
    };
}

kinds! {
    /// The app SensorServer: we connect to it.
    SensorServer = "sensorserver", SensorServer, Form::Remote, "SensorServer", "192.168.1.20:8080",
        "SensorServer (Android): in its settings set the sampling rate to 10000 microseconds, \
         press start, and enter the address that the app shows, such as 192.168.1.20:8080.";
    /// The Sensor Fusion app of Linköping: it connects to us.
    Linkoping = "linkoping", Linkoping, Form::Listen(linkoping::PORT), "Sensor Fusion app", "3400",
        "Sensor Fusion app (Android): the app connects to this computer. Enter the port \
         (3400 if left empty), then enter this computer's address in the app and press \
         stream. There is no token: anybody in the network can send.";
    /// phyphox with remote access: we ask it.
    Phyphox = "phyphox", Phyphox, Form::Remote, "phyphox", "192.168.1.21:8080",
        "phyphox (Android, iOS): open an experiment with accelerometer and gyroscope, choose \
         \"Allow remote access\" in its menu, press play, and enter the address that it shows, \
         with the port: 192.168.1.21:8080 on Android, 192.168.1.21:80 on iOS.";
    /// A Razor board on a serial line.
    Razor = "razor", Razor, Form::Serial(57_600), "Razor board", "/dev/ttyUSB0@57600",
        "Razor 9DOF board on a serial line: enter the device, such as /dev/ttyUSB0 or COM3; \
         @57600 behind it is the speed.";
    /// A board with our own firmware on a serial line.
    Northing = "northing", NorthingSerial, Form::Serial(230_400), "Northing board", "/dev/ttyUSB0@230400",
        "Board with Northing's firmware on a serial line: enter the device, such as /dev/ttyUSB0 or \
         COM3; @230400 behind it is the speed. Its own estimate is drawn as the device's.";
    /// HyperIMU: it sends us lines, by TCP or UDP.
    HyperImu = "hyperimu", HyperImu, Form::Listen(2055), "HyperIMU", "2055",
        "HyperIMU (Android): choose accelerometer, gyroscope, magnetometer in this order, a \
         sampling of 10 ms, the protocol TCP or UDP, this computer's address and the port \
         (2055 if left empty). There is no token: anybody in the network can send.";
    /// SensorStreamer: it connects to us.
    SensorStreamer = "sensorstreamer", SensorStreamer, Form::Listen(3401), "SensorStreamer", "3401",
        "SensorStreamer (Android): choose the packet type JSON, the connection TCP client, this \
         computer's address and the port (3401 if left empty). There is no token: anybody in \
         the network can send.";
}

/// What a kind's addresses look like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// `host:port`.
    Remote,
    /// Nothing, `port` or `ip:port`.
    Listen(u16),
    /// `device` or `device@baud`, with the baud rate that is meant where none is given.
    Serial(u32),
}

/// Where an input is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A device that has a server.
    Remote {
        /// Its name or address, IPv6 in brackets.
        host: String,
        /// Its port.
        port: u16,
    },
    /// A port of this computer.
    Listen {
        /// On this address only; `None`: where phones reach this computer.
        ip: Option<IpAddr>,
        /// The port; 0 takes a free one.
        port: u16,
    },
    /// A serial line.
    Serial {
        /// The device.
        path: String,
        /// Bits a second.
        baud: u32,
    },
}

/// An input as it is asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputSpec {
    /// What it is.
    pub kind: InputKind,
    /// Where it is.
    pub address: Address,
}

/// A text that is no input: what was expected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("input `{text}`: expected {expected}")]
pub struct SpecError {
    text: String,
    expected: String,
}

/// Longest address, bytes.
const LONGEST: usize = 200;

impl InputSpec {
    /// An input of this kind at an address as people write it.
    ///
    /// # Errors
    /// The address is none of this kind: what was expected.
    pub fn new(kind: InputKind, address: &str) -> Result<Self, SpecError> {
        let text = address.trim();
        let parsed = (text.len() <= LONGEST).then(|| match kind.form() {
            Form::Remote => remote(text),
            Form::Listen(port) => listen(text, port),
            Form::Serial(baud) => serial(text, baud),
        });
        let expected = match kind.form() {
            Form::Remote => "HOST:PORT without a path",
            Form::Listen(_) => "nothing, a PORT, or an IP:PORT of this computer",
            Form::Serial(_) => "a serial device, with @BAUD behind it if need be",
        };
        let address = parsed.flatten().ok_or_else(|| SpecError {
            text: format!("{}={}", kind.name(), shown(text)),
            expected: format!("{expected}, e.g. {}={}", kind.name(), kind.example()),
        })?;
        Ok(Self { kind, address })
    }
}

/// `KIND` or `KIND=ADDRESS`.
impl FromStr for InputSpec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let (name, address) = text.split_once('=').unwrap_or((text, ""));
        let kind = InputKind::ALL.into_iter().find(|k| k.name() == name.trim());
        let kind = kind.ok_or_else(|| SpecError {
            text: shown(text),
            expected: format!(
                "KIND=ADDRESS with one of: {}",
                InputKind::ALL.map(InputKind::name).join(", ")
            ),
        })?;
        Self::new(kind, address)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Remote { host, port } => write!(f, "{host}:{port}"),
            Self::Listen { ip: None, port } => write!(f, "{port}"),
            Self::Listen { ip: Some(ip), port } => {
                write!(f, "{}", std::net::SocketAddr::new(*ip, *port))
            }
            Self::Serial { path, baud } => write!(f, "{path}@{baud}"),
        }
    }
}

fn remote(text: &str) -> Option<Address> {
    let (host, port) = text.rsplit_once(':')?;
    let port = port.parse().ok().filter(|port| *port != 0)?;
    let bare = host.strip_prefix('[').and_then(|h| h.strip_suffix(']'));
    let is_host = match bare {
        Some(v6) => v6.parse::<std::net::Ipv6Addr>().is_ok(),
        // A label of a name, or an IPv4 address: nothing that could begin a path or a user.
        None => {
            !host.is_empty()
                && host
                    .bytes()
                    .all(|b| b.is_ascii_alphanumeric() || b == b'.' || b == b'-')
        }
    };
    is_host.then(|| Address::Remote {
        host: host.to_owned(),
        port,
    })
}

fn listen(text: &str, default: u16) -> Option<Address> {
    if text.is_empty() {
        let port = default;
        return Some(Address::Listen { ip: None, port });
    }
    if let Ok(port) = text.parse() {
        return Some(Address::Listen { ip: None, port });
    }
    let address: std::net::SocketAddr = text.parse().ok()?;
    Some(Address::Listen {
        ip: Some(address.ip()),
        port: address.port(),
    })
}

fn serial(text: &str, default: u32) -> Option<Address> {
    let (path, baud) = match text.rsplit_once('@') {
        Some((path, baud)) => (path, baud.parse().ok()?),
        None => (text, default),
    };
    let unix = path.starts_with("/dev/") && !path.contains("..");
    let windows = path
        .strip_prefix("COM")
        .is_some_and(|n| n.parse::<u8>().is_ok());
    let path = path.to_owned();
    ((unix || windows) && (300..=4_000_000).contains(&baud))
        .then_some(Address::Serial { path, baud })
}

/// A text of others in a message: short, and without control characters.
fn shown(text: &str) -> String {
    let clean = text.chars().map(|c| if c.is_control() { '?' } else { c });
    clean.take(60).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<InputSpec, String> {
        text.parse().map_err(|error: SpecError| error.to_string())
    }

    #[test]
    fn inputs_are_read_and_written() {
        for (text, address) in [
            ("sensorserver=192.168.1.20:8080", "192.168.1.20:8080"),
            ("sensorserver=my-phone.local:81", "my-phone.local:81"),
            ("phyphox=[fd00::1]:80", "[fd00::1]:80"),
            ("linkoping", "3400"),
            ("linkoping=", "3400"),
            ("linkoping=3401", "3401"),
            ("hyperimu=127.0.0.1:9000", "127.0.0.1:9000"),
            ("sensorstreamer", "3401"),
            ("razor=/dev/ttyUSB0", "/dev/ttyUSB0@57600"),
            ("razor=COM3@115200", "COM3@115200"),
            ("northing=/dev/ttyUSB0", "/dev/ttyUSB0@230400"),
        ] {
            let spec = parse(text).unwrap();
            assert_eq!(spec.address.to_string(), address, "{text}");
            let again = InputSpec::new(spec.kind, address).unwrap();
            assert_eq!(again, spec);
        }
        for kind in InputKind::ALL {
            assert!(InputSpec::new(kind, kind.example()).is_ok(), "{kind:?}");
            let json = serde_json::to_string(&kind).unwrap();
            assert_eq!(json, format!("\"{}\"", kind.name()));
        }
    }

    #[test]
    fn what_is_no_input_is_refused_with_what_was_expected() {
        let unknown = parse("telepathy=1").unwrap_err();
        assert!(
            unknown.contains("one of: sensorserver, linkoping"),
            "{unknown}"
        );
        let no_port = parse("sensorserver=192.168.1.20").unwrap_err();
        assert!(no_port.contains("HOST:PORT without a path"), "{no_port}");
        for bad in [
            "sensorserver",
            "sensorserver=http://a:80",
            "sensorserver=a:80/x",
            "sensorserver=user@a:80",
            "sensorserver=a:0",
            "sensorserver=a:99999",
            "phyphox=a b:80",
            "phyphox=[zz]:80",
            "linkoping=x",
            "linkoping=phone:3400",
            "razor",
            "razor=/etc/passwd",
            "razor=/dev/../etc/passwd",
            "razor=/dev/ttyUSB0@fast",
            "razor=/dev/ttyUSB0@1",
        ] {
            let error = parse(bad).unwrap_err();
            assert!(
                error.starts_with("input `") && error.contains("expected"),
                "{error}"
            );
        }
        let long = format!("sensorserver={}:80", "a".repeat(300));
        assert!(parse(&long).unwrap_err().len() < 250);
    }
}
