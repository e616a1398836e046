//! Every input against a phone or board that plays its part: connect, break off, stall, flood, nonsense.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::thread;
use std::time::Duration;

use northing_live::inputs::InputSpec;
use serde_json::{Value, json};
use support::{TestLab, wait_for};
use tokio_tungstenite::tungstenite::protocol::CloseFrame;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::{Message, accept, connect};

fn add(lab: &TestLab, spec: &str) -> String {
    let _entered = lab.runtime.enter();
    lab.running.inputs.add(spec.parse().unwrap()).unwrap()
}

/// State and text of the only input.
fn input(lab: &TestLab) -> (String, String) {
    let status = lab.status()["inputs"][0].clone();
    let word = |key: &str| status[key].as_str().unwrap_or_default().to_owned();
    (word("state"), word("text"))
}

fn wait_text(lab: &TestLab, part: &str) -> String {
    let mut last = String::new();
    wait_for(part, || {
        last = input(lab).1;
        last.contains(part).then(|| last.clone())
    })
}

/// The port on which the only input waits.
fn port(lab: &TestLab) -> u16 {
    let text = wait_text(lab, "waiting on port ");
    let after = text.split("waiting on port ").nth(1).unwrap();
    let digits: String = after.chars().take_while(char::is_ascii_digit).collect();
    digits.parse().unwrap()
}

fn received(lab: &TestLab, device: &str) -> u64 {
    lab.device(device)["received"].as_u64().unwrap_or(0)
}

fn wait_received(lab: &TestLab, device: &str, count: u64) {
    let mut last = 0;
    let start = std::time::Instant::now();
    while last < count {
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "{device}: {last} of {count}"
        );
        last = received(lab, device);
        thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(last, count, "{device}");
}

/// Accelerometer, gyroscope and magnetometer at rest, as lines of the Sensor Fusion app.
fn linkoping_lines(from_ms: u32, count: u32) -> Vec<u8> {
    let line = |k: u32| {
        let t = from_ms + 10 * k;
        format!("{t}\tACC\t0.01\t0\t9.81\n{t}\tGYR\t0.001\t0\t0\n{t}\tMAG\t0\t22\t-42\n")
    };
    (0..count).map(line).collect::<String>().into_bytes()
}

#[test]
fn apps_that_send_lines_come_go_and_come_back_without_a_wrong_sample() {
    let lab = TestLab::start();
    add(&lab, "linkoping=127.0.0.1:0");
    let port = port(&lab);
    let device = "linkoping-127.0.0.1";
    let mut phone = TcpStream::connect(("127.0.0.1", port)).unwrap();
    for piece in linkoping_lines(0, 200).chunks(777) {
        phone.write_all(piece).unwrap();
    }
    wait_received(&lab, device, 600);
    // A second one at the same address is another device.
    let mut second = TcpStream::connect(("127.0.0.1", port)).unwrap();
    second.write_all(&linkoping_lines(0, 10)).unwrap();
    wait_received(&lab, "linkoping-127.0.0.1 (2)", 30);
    wait_text(&lab, "127.0.0.1: ");
    // It breaks off in the middle of a number; what was unfinished is not used.
    phone.write_all(b"2000\tGYR\t0.1\t0.2\t1").unwrap();
    drop(phone);
    wait_for("the end of the first", || {
        (!input(&lab).1.contains("127.0.0.1:")).then_some(())
    });
    let mut phone = TcpStream::connect(("127.0.0.1", port)).unwrap();
    phone
        .write_all(b"nonsense\n2000\tGYR\ta\tb\n\xff\xfe\n")
        .unwrap();
    phone.write_all(&linkoping_lines(2000, 100)).unwrap();
    wait_received(&lab, device, 900);
    let rate = lab.device(device)["rates_hz"]["gyroscope"]
        .as_f64()
        .unwrap();
    assert!((rate - 100.0).abs() < 1.0, "{rate}");
    let health = lab.device(device)["health"].to_string();
    assert!(health.contains("left out"), "{health}");
    assert_eq!(received(&lab, "linkoping-127.0.0.1 (2)"), 30);
}

#[test]
fn a_flood_holds_itself_back_and_disturbs_nobody() {
    let lab = TestLab::start();
    add(&lab, "linkoping=127.0.0.1:0");
    let port = port(&lab);
    let flood = move |bytes: &'static [u8]| {
        thread::spawn(move || {
            let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
            stream
                .set_write_timeout(Some(Duration::from_millis(500)))
                .unwrap();
            let mut written = 0;
            for _ in 0..3000 {
                match stream.write(bytes) {
                    Ok(n) => written += n,
                    Err(_) => break,
                }
            }
            written
        })
    };
    let mut quiet = TcpStream::connect(("127.0.0.1", port)).unwrap();
    quiet.write_all(&linkoping_lines(0, 1)).unwrap();
    wait_received(&lab, "linkoping-127.0.0.1", 3);
    // One without line ends, one of lines that say nothing.
    let floods = [
        flood(&[b'x'; 60_000]),
        flood(b"1\tBAT\t1\n2\tBAT\t1\n3\tBAT\t1\n4\tBAT\t1\n"),
    ];
    for k in 0..50 {
        quiet.write_all(&linkoping_lines(10 + 100 * k, 10)).unwrap();
        thread::sleep(Duration::from_millis(20));
    }
    wait_received(&lab, "linkoping-127.0.0.1", 1503);
    for flood in floods {
        assert!(flood.join().unwrap() > 50_000);
    }
    // Not more than sixteen at a time: the others are closed at once.
    let many: Vec<TcpStream> = (0..40)
        .map(|_| TcpStream::connect(("127.0.0.1", port)).unwrap())
        .collect();
    let closed = |mut stream: &TcpStream| {
        stream
            .set_read_timeout(Some(Duration::from_millis(200)))
            .unwrap();
        matches!(stream.read(&mut [0; 1]), Ok(0))
    };
    assert!(many.iter().filter(|s| closed(s)).count() >= 20);
    quiet.write_all(&linkoping_lines(9000, 10)).unwrap();
    wait_received(&lab, "linkoping-127.0.0.1", 1533);
}

#[test]
fn hyperimu_sends_lines_or_datagrams_and_sensorstreamer_objects() {
    let lab = TestLab::start();
    add(&lab, "hyperimu=127.0.0.1:0");
    let port = port(&lab);
    let line = |k: u64| {
        format!(
            "{},0,0,9.81,0.001,0,0,0,22,-42\n",
            1_763_697_600_000 + 10 * k
        )
    };
    let mut tcp = TcpStream::connect(("127.0.0.1", port)).unwrap();
    let lines: String = (0..100).map(line).collect();
    tcp.write_all(lines.as_bytes()).unwrap();
    wait_received(&lab, "hyperimu-127.0.0.1", 300);
    let udp = UdpSocket::bind("127.0.0.1:0").unwrap();
    // Datagrams that come faster than they are taken are lost; these are not.
    for ten in 0..10 {
        for k in 10 * ten..10 * (ten + 1) {
            udp.send_to(line(k).trim_end().as_bytes(), ("127.0.0.1", port))
                .unwrap();
        }
        wait_received(&lab, "hyperimu-127.0.0.1 (UDP)", 30 * (ten + 1));
    }

    let lab = TestLab::start();
    add(&lab, "sensorstreamer=127.0.0.1:0");
    let port = self::port(&lab);
    let mut tcp = TcpStream::connect(("127.0.0.1", port)).unwrap();
    for k in 0..100_u64 {
        let t = k * 10_000_000;
        let reading = |v: [f64; 3]| json!({"value": v, "timestamp": t});
        let object = json!({"accelerometer": reading([0.0, 0.0, 9.81]),
            "gyroscope": reading([0.001, 0.0, 0.0]), "magneticField": reading([0.0, 22.0, -42.0])});
        writeln!(tcp, "{object}").unwrap();
    }
    wait_received(&lab, "sensorstreamer-127.0.0.1", 300);
}

fn sensorserver_frames(from_ns: u64, step_ns: u64, count: u64) -> Vec<String> {
    let sensors = [
        ("accelerometer", [0.0, 0.0, 9.81]),
        ("gyroscope", [0.001, 0.0, 0.0]),
        ("magnetic_field", [0.0, 22.0, -42.0]),
    ];
    let frame = move |k: u64| {
        sensors.map(|(sensor, values)| {
            json!({"values": values, "timestamp": from_ns + k * step_ns, "accuracy": 3,
                "type": format!("android.sensor.{sensor}")})
            .to_string()
        })
    };
    (0..count).flat_map(frame).collect()
}

#[test]
fn sensorserver_is_reached_again_after_every_misfortune_and_each_is_said() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap();
    let phone = thread::spawn(move || {
        let send = |socket: &mut tokio_tungstenite::tungstenite::WebSocket<TcpStream>, frame| {
            socket.send(Message::text(frame)).unwrap();
        };
        // At the app's default rate, then a refusal in the app's words.
        let mut socket = accept(server.accept().unwrap().0).unwrap();
        for frame in sensorserver_frames(1_000, 200_000_000, 25) {
            send(&mut socket, frame);
            thread::sleep(Duration::from_millis(25));
        }
        let reason = CloseFrame {
            code: CloseCode::from(4002),
            reason: "sensor not supported".into(),
        };
        socket.close(Some(reason)).unwrap();
        while socket.read().is_ok() {}
        // No WebSocket at all, then one cut off without a word.
        let (mut stream, _) = server.accept().unwrap();
        let mut head = [0; 1024];
        let asked = stream.read(&mut head).unwrap();
        assert!(String::from_utf8_lossy(&head[..asked]).contains("android.sensor.gyroscope"));
        stream
            .write_all(b"HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\n\r\n")
            .unwrap();
        drop(stream);
        let mut socket = accept(server.accept().unwrap().0).unwrap();
        send(&mut socket, "no json".to_owned());
        for frame in sensorserver_frames(10_000_000_000, 10_000_000, 100) {
            send(&mut socket, frame);
        }
        drop(socket);
        // At last as it should be, and then silent.
        let mut socket = accept(server.accept().unwrap().0).unwrap();
        for frame in sensorserver_frames(11_000_000_000, 10_000_000, 150) {
            send(&mut socket, frame);
            thread::sleep(Duration::from_millis(4));
        }
        thread::sleep(Duration::from_secs(6));
        drop(socket);
    });
    let lab = TestLab::start();
    add(&lab, &format!("sensorserver={address}"));
    wait_text(&lab, "10000 microseconds");
    let refused = wait_text(&lab, "(4002)");
    assert!(refused.contains("sensor not supported"), "{refused}");
    wait_text(&lab, "404");
    wait_text(&lab, "about 100 gyroscope samples a second");
    let device = format!("sensorserver-{address}");
    wait_received(&lab, &device, 3 * (25 + 100 + 150));
    let silent = wait_text(&lab, "nothing comes");
    assert_eq!(input(&lab).0, "connected", "{silent}");
    phone.join().unwrap();
    wait_text(&lab, "refuses the connection");
}

/// phyphox's answers to the questions of one connection; every seventh connection attempt of the lab
/// finds it closed after a few answers.
fn phyphox_connection(stream: &TcpStream, answers: usize, values: &[f64]) -> bool {
    let mut reader = BufReader::new(stream);
    for _ in 0..answers {
        let mut path = String::new();
        loop {
            let mut line = String::new();
            if reader.read_line(&mut line).unwrap_or(0) == 0 {
                return false;
            }
            if line.starts_with("GET ") {
                path = line.split(' ').nth(1).unwrap().to_owned();
            }
            if line == "\r\n" {
                break;
            }
        }
        let body = if path == "/config" {
            let outputs = |p: &str| {
                json!([{"x": format!("{p}X")}, {"y": format!("{p}Y")},
                {"z": format!("{p}Z")}, {"t": format!("{p}_time")}])
            };
            json!({"title": "lab", "buffers": [], "inputs": [
                {"source": "accelerometer", "outputs": outputs("acc")},
                {"source": "gyroscope", "outputs": outputs("gyr")}]})
        } else {
            let since = path.split("acc_time=").nth(1).unwrap_or("");
            let since: f64 = since.split('&').next().unwrap().parse().unwrap_or(-1.0);
            // Thirty more with each answer.
            let new: Vec<f64> = values
                .iter()
                .copied()
                .filter(|t| *t > since)
                .take(30)
                .collect();
            let of = |x: f64| json!({"buffer": vec![x; new.len()], "updateMode": "partial"});
            let mut buffers = json!({});
            for (p, v) in [("acc", [0.0, 0.0, 9.81]), ("gyr", [0.001, 0.0, 0.0])] {
                buffers[format!("{p}_time")] = json!({"buffer": new.clone()});
                for (axis, x) in ["X", "Y", "Z"].iter().zip(v) {
                    buffers[format!("{p}{axis}")] = of(x);
                }
            }
            json!({"buffer": buffers, "status": {"session": "a", "measuring": true}})
        };
        let body = body.to_string();
        let answer = format!(
            "HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n{body}",
            body.len()
        );
        if (&mut &*stream).write_all(answer.as_bytes()).is_err() {
            return false;
        }
    }
    true
}

#[test]
fn phyphox_is_asked_for_what_is_new_and_goes_on_after_a_break() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap();
    let values: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.01).collect();
    let phone = thread::spawn(move || {
        // It answers eight times and breaks off in the middle of the measurement; then stays.
        phyphox_connection(&server.accept().unwrap().0, 8, &values);
        phyphox_connection(&server.accept().unwrap().0, 120, &values);
        let (mut stream, _) = server.accept().unwrap();
        let _ = stream.read(&mut [0; 1024]);
        let _ = stream.write_all(b"HTTP/1.1 200 OK\r\ncontent-length: 7\r\n\r\n{\"a\":1}");
    });
    let lab = TestLab::start();
    add(&lab, &format!("phyphox={address}"));
    wait_received(&lab, &format!("phyphox-{address}"), 1200);
    wait_text(&lab, "nothing new comes");
    phone.join().unwrap();
    wait_for("a description that is none, or nobody", || {
        (input(&lab).0 == "failed").then_some(())
    });
    let rate = lab.device(&format!("phyphox-{address}"))["rates_hz"]["gyroscope"].as_f64();
    assert!((rate.unwrap() - 100.0).abs() < 1.0, "{rate:?}");
}

#[cfg(all(feature = "serial", target_os = "linux"))]
#[test]
fn a_board_on_a_serial_line_is_read_and_told_to_send() {
    use serialport::{SerialPort, TTYPort};
    let (mut board, line) = TTYPort::pair().unwrap();
    let path = line.name().unwrap();
    let lab = TestLab::start();
    add(&lab, &format!("razor={path}@57600"));
    let mut told = [0; 8];
    board.set_timeout(Duration::from_secs(30)).unwrap();
    board.read_exact(&mut told).unwrap();
    assert_eq!(&told, b"#osct#o1");
    board
        .write_all(b"garbage from the middle of a line\n")
        .unwrap();
    for _ in 0..100 {
        board
            .write_all(
                b"#A-C=0.00,0.00,256.00\r\n#M-C=220.00,0.00,420.00\r\n#G-C=0.10,0.00,0.00\r\n",
            )
            .unwrap();
        thread::sleep(Duration::from_millis(12));
    }
    let device = format!("razor-{path}@57600");
    wait_received(&lab, &device, 300);
    wait_text(&lab, "gyroscope samples a second");
    let q = wait_for("an estimate", || {
        lab.device(&device)["estimates"]["mekf"]["q"][0].as_f64()
    });
    assert!(q > 0.5, "the board lies level: {q}");
    drop((board, line));
    let broken = wait_text(&lab, "trying again");
    assert!(
        broken.contains("broke off") || broken.contains("opened") || broken.contains("closed"),
        "{broken}"
    );
}

/// A sentence of our firmware.
#[cfg(all(feature = "serial", target_os = "linux"))]
fn sentence(body: &str) -> Vec<u8> {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n").into_bytes()
}

#[cfg(all(feature = "serial", target_os = "linux"))]
#[test]
fn a_board_with_our_firmware_is_read_with_its_own_estimate_and_has_a_name() {
    use serialport::{SerialPort, TTYPort};
    let (mut board, line) = TTYPort::pair().unwrap();
    let path = line.name().unwrap();
    let lab = TestLab::start();
    add(&lab, &format!("northing={path}"));
    wait_text(&lab, "nothing comes");
    let mut say = |body: &str| board.write_all(&sentence(body)).unwrap();
    say("PNORB,1,axis-filters,power");
    for frame in 0..100 {
        let ms = frame * 20;
        say(&format!("PNORI,{ms},20,0,0,-98100,0,0,0,1900,0,4600"));
        say(&format!(
            "PNORE,{ms},1000,-2000,3000,900,900,1500,0,,,,,,,,,,00000000"
        ));
        thread::sleep(Duration::from_millis(12));
    }
    let device = format!("northing-{path}@230400");
    wait_received(&lab, &device, 400);
    wait_text(&lab, "gyroscope samples a second");
    let device = lab.device(&device);
    let line = path.rsplit('/').next().unwrap();
    assert_eq!(device["name"], format!("Northing board {line}"));
    let health = device["health"].to_string();
    assert!(
        health.contains("The board has started: axis-filters."),
        "{health}"
    );
}

#[test]
fn the_page_adds_and_removes_inputs_and_is_told_in_words() {
    let lab = TestLab::start();
    let url = format!("ws://{}/api/ws", lab.lab_host());
    let (mut page, _) = connect(url).unwrap();
    let mut wait = |ask: Option<Value>, wanted: &dyn Fn(&Value) -> bool| -> Value {
        if let Some(ask) = ask {
            page.send(Message::text(ask.to_string())).unwrap();
        }
        for _ in 0..1000 {
            let Ok(Message::Text(text)) = page.read() else {
                continue;
            };
            let message: Value = serde_json::from_str(&text).unwrap();
            if wanted(&message) {
                return message;
            }
        }
        panic!("nothing of the kind came");
    };
    let hello = wait(None, &|m| m["type"] == "hello");
    let kinds = hello["input_kinds"].as_array().unwrap();
    let titles: Vec<_> = kinds
        .iter()
        .filter_map(|kind| kind["title"].as_str())
        .collect();
    assert!(titles.contains(&"Northing board") && titles.contains(&"Razor board"));
    assert_eq!(kinds.len(), 7);
    assert!(
        kinds
            .iter()
            .all(|k| k["hint"].as_str().is_some_and(|hint| hint.len() > 40))
    );
    assert_eq!(hello["inputs"], json!([]));
    let inputs = |m: &Value| m["type"] == "inputs";
    let error = |m: &Value| m["type"] == "error";
    let ask = |action: &str, kind: &str, address: &str| {
        Some(json!({"type": "input", "action": action, "kind": kind, "address": address}))
    };
    // Nothing listens there.
    let free = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .to_string();
    let told = wait(ask("add", "sensorserver", &free), &inputs);
    assert_eq!(told["inputs"][0]["kind"], "sensorserver");
    let failed = wait(None, &|m| inputs(m) && m["inputs"][0]["state"] == "failed");
    let text = failed["inputs"][0]["text"].as_str().unwrap();
    assert!(
        text.contains("refuses") && text.contains("trying again"),
        "{text}"
    );
    for (action, kind, address, part) in [
        ("add", "sensorserver", free.as_str(), "already"),
        ("add", "sensorserver", "http://a:80/x", "without a path"),
        ("add", "telepathy", "a:80", "does not know"),
        ("remove", "phyphox", "127.0.0.1:1", "no such input"),
    ] {
        let answer = wait(ask(action, kind, address), &error);
        assert!(answer["text"].as_str().unwrap().contains(part), "{answer}");
    }
    let by_id = json!({"type": "input", "action": "remove", "id": failed["inputs"][0]["id"]});
    let gone = wait(Some(by_id), &|m| inputs(m) && m["inputs"] == json!([]));
    assert_eq!(gone["inputs"], json!([]));
    assert_eq!(lab.status()["inputs"], json!([]));
}

#[test]
fn a_port_that_is_taken_is_said_and_taken_when_it_is_free() {
    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = other.local_addr().unwrap();
    let lab = TestLab::start();
    let id = add(&lab, &format!("linkoping={address}"));
    wait_text(&lab, "cannot be used");
    drop(other);
    assert_eq!(port(&lab), address.port());
    let spec: InputSpec = format!("linkoping={address}").parse().unwrap();
    assert_eq!(lab.running.inputs.find(&spec), Some(id.clone()));
    lab.running.inputs.remove(&id).unwrap();
    wait_for("the port to be free", || TcpListener::bind(address).ok());
}
