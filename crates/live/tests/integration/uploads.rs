//! Uploads over real sockets: nothing valid is lost, nothing counts twice, nothing bad does harm.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use northing_recording::{Event, Sample};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use support::{TestLab, batch, request, wait_for};

/// What a phone page sends of a virtual phone: gyroscope, accelerometer, magnetometer.
fn sensor_events(seconds: f64) -> Vec<Event> {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        duration_s: Some(seconds),
        ..VirtualPhoneConfig::default()
    });
    let sent = |event: &Event| {
        matches!(
            event.sample,
            Sample::AngularRate(_) | Sample::SpecificForce(_) | Sample::MagneticField(_)
        )
    };
    phone.unwrap().events().filter(sent).collect()
}

#[test]
fn batches_resent_repeated_and_out_of_order_count_once() {
    let lab = TestLab::start();
    let events = sensor_events(4.0);
    let batches: Vec<Vec<u8>> = events
        .chunks(30)
        .zip(0..)
        .map(|(chunk, seq)| batch("anna", "load", seq, chunk))
        .collect();
    // Pairs are swapped, and every third batch comes again.
    let mut order: Vec<usize> = (0..batches.len()).collect();
    order[1..]
        .chunks_exact_mut(2)
        .for_each(|pair| pair.swap(0, 1));
    for (turn, index) in order.iter().enumerate() {
        let answer = lab.upload(&batches[*index]);
        assert_eq!(
            (answer.status, &answer.json()["ack"]),
            (200, &(*index).into())
        );
        if turn % 3 == 0 {
            assert_eq!(lab.upload(&batches[*index]).status, 200);
        }
    }
    let device = lab.device("anna");
    assert_eq!(device["received"], events.len());
    assert_eq!((&device["lost"], &device["late"]), (&0.into(), &0.into()));
    assert_eq!(device["duplicated_batches"], order.len().div_ceil(3));
    assert_eq!(device["source"], "page");
    let rate = device["rates_hz"]["gyroscope"].as_f64().unwrap();
    assert!((rate - 100.0).abs() < 2.0, "{rate}");
    assert!(device["estimates"]["mekf"]["q"].is_array(), "{device}");
}

#[test]
fn a_batch_that_never_comes_is_counted_and_the_rest_goes_on() {
    let lab = TestLab::start();
    let events = sensor_events(1.0);
    for (chunk, seq) in events.chunks(30).zip(0_u64..) {
        if seq != 3 {
            lab.upload(&batch("anna", "load", seq, chunk));
        }
    }
    let device = wait_for("the lost batch", || {
        Some(lab.device("anna")).filter(|d| d["lost"] == 1)
    });
    assert_eq!(device["received"], events.len() - 30);
}

#[test]
fn two_phones_do_not_disturb_each_other() {
    let lab = TestLab::start();
    let events = sensor_events(2.0);
    for (chunk, seq) in events.chunks(40).zip(0..) {
        lab.upload(&batch("anna", "a", seq, chunk));
        lab.upload(br#"{"v":1,"device":"ben","session":"b","seq":"x"}"#);
        lab.upload(&batch("ben", "b", seq, &chunk[..1]));
    }
    assert_eq!(lab.device("anna")["received"], events.len());
    assert_eq!(lab.device("ben")["received"], events.chunks(40).count());
}

#[test]
fn what_is_no_batch_is_refused_with_one_line() {
    let lab = TestLab::start();
    for body in [
        &b"{"[..],
        b"[]",
        b"",
        b"{\"v\":1}",
        b"\xff\xfe",
        b"{\"v\":7,\"device\":\"a\"}",
    ] {
        let answer = lab.upload(body);
        assert_eq!(answer.status, 400);
        let error = answer.json()["error"].as_str().unwrap().to_owned();
        assert!(!error.is_empty() && !error.contains('\n'), "{error}");
    }
    let large = vec![b' '; 300 * 1024];
    assert_eq!(lab.upload(&large).status, 413);
    assert!(lab.status()["devices"].as_array().unwrap().is_empty());
}

#[test]
fn absurd_readings_are_left_out_and_the_others_are_kept() {
    let lab = TestLab::start();
    let body = br#"{"v":1,"device":"a","name":"","session":"s","seq":0,"platform":"android","gs":{
        "g":[[10,0.1,0,0],[20,null,0,0],[30,1e300,0,0],[40,"x",0,0],[50,0.1,0,0],[1e300,0,0,0],[]],
        "a":[[10,0,0,9.8],[20,0,0,1e9]]}}"#;
    assert_eq!(lab.upload(body).status, 200);
    let device = wait_for("what was left out", || {
        Some(lab.device("a")).filter(|d| d["health"].to_string().contains("left out"))
    });
    assert_eq!(device["received"], 3, "{device}");
}

#[test]
fn a_flood_is_asked_to_wait_and_nothing_taken_is_lost() {
    let lab = TestLab::start();
    let events = sensor_events(10.0);
    let (mut taken, mut refused) = (0, 0);
    for (chunk, seq) in events.chunks(5).zip(0..) {
        match lab.upload(&batch("flood", "s", seq, chunk)).status {
            200 => taken += chunk.len(),
            429 => refused += 1,
            other => panic!("{other}"),
        }
        if refused > 20 {
            break;
        }
    }
    assert!(refused > 0, "the limit was never met");
    wait_for("what was taken", || {
        (lab.device("flood")["received"] == taken).then_some(())
    });
}

#[test]
fn wrong_tokens_hosts_and_origins_are_turned_away() {
    let lab = TestLab::start();
    let (app, page) = (lab.app_host(), lab.lab_host());
    let body = batch("a", "s", 0, &sensor_events(0.1));
    let wrong = request(&app, "POST", "/in/AAAAAAAAAAAAAAAAAAAAAA", &[], &body);
    assert_eq!(wrong.status, 499);
    assert!(wrong.text().contains("wrong token"));
    for host in [
        "evil.example",
        "evil.example:80",
        "127.0.0.1",
        "127.0.0.1:1",
    ] {
        assert_eq!(
            request(&page, "GET", "/", &[("host", host)], b"").status,
            403,
            "{host}"
        );
        let path = format!("/in/{}", lab.token());
        assert_eq!(
            request(&app, "POST", &path, &[("host", host)], &body).status,
            403
        );
    }
    let upgrade = |origin: &str| {
        let headers = [
            ("origin", origin),
            ("upgrade", "websocket"),
            ("connection", "upgrade"),
            ("sec-websocket-version", "13"),
            ("sec-websocket-key", "dGhlIHNhbXBsZSBub25jZQ=="),
        ];
        request(&page, "GET", "/api/ws", &headers, b"").status
    };
    assert_eq!(upgrade("http://evil.example"), 403);
    assert_eq!(upgrade("null"), 403);
    assert!(lab.status()["devices"].as_array().unwrap().is_empty());
    // The lab itself is not to be had where phones are.
    assert_eq!(request(&app, "GET", "/api/status", &[], b"").status, 404);
}

#[test]
fn every_answer_carries_the_protecting_headers() {
    let lab = TestLab::start();
    for path in ["/", "/api/status", "/no-such-page"] {
        let head = lab.get(path).head.to_lowercase();
        assert!(
            head.contains("content-security-policy: default-src 'self'"),
            "{head}"
        );
        assert!(head.contains("x-content-type-options: nosniff"), "{head}");
    }
    let qr = lab.get("/api/qr.svg");
    assert!(qr.text().contains("<svg"));
}

#[test]
fn sensor_logger_messages_are_taken() {
    let lab = TestLab::start();
    let message = |id: u64| {
        let readings: Vec<String> = (0..20)
            .map(|k| {
                let t = 1_763_697_600_000_000_000 + id * 200_000_000 + k * 10_000_000;
                format!(
                    r#"{{"name":"gyroscope","time":{t},"values":{{"x":0.01,"y":0.0,"z":0.0}}}},
                       {{"name":"totalacceleration","time":{t},"values":{{"x":0.0,"y":0.0,"z":9.81}}}}"#
                )
            })
            .collect();
        let payload = readings.join(",");
        format!(r#"{{"messageId":{id},"sessionId":"s","deviceId":"logger","payload":[{payload}]}}"#)
    };
    for id in [0, 2, 1, 2, 3] {
        assert_eq!(lab.upload(message(id).as_bytes()).status, 200);
    }
    let device = wait_for("all messages", || {
        Some(lab.device("logger")).filter(|d| d["received"] == 160)
    });
    assert_eq!(device["source"], "sensor-logger");
}
