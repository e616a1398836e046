//! `northing run` on what a board with our firmware printed: the board's own estimates, drawn and scored.

use std::fmt::Write as _;

use crate::support::{Lab, contains};

/// So many frames a second.
const RATE_HZ: u32 = 50;

fn sentence(body: &str) -> String {
    let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${body}*{sum:02X}\r\n")
}

/// A board that is carried north at 1.5 m/s for 90 s and says that it is 3 m east of there, with an uncertainty
/// of 2 m on each axis; fixes each second, and where the board really was, once a second.
pub(crate) fn with_board() -> Lab {
    let lab = Lab::new();
    let mut log = sentence("PNORB,1,axis-filters,power");
    let mut truth = "t_s,lat_deg,lon_deg,h_m\n".to_owned();
    for k in 0..90 * RATE_HZ {
        let ms = k * 20;
        let north_mm = 3 * k * 10;
        // 1e-7 deg of latitude are 11.13 mm there.
        let latitude_e7 = 531_173_000 + (f64::from(north_mm) / 11.127).round() as i64;
        log += &sentence(&format!("PNORI,{ms},20,0,0,-98100,0,0,0,1900,0,4600"));
        if k % RATE_HZ == 0 {
            if k == 0 {
                log += &sentence("PNORO,531173000,231434000,176500");
            }
            log += &sentence(&format!(
                "PNORG,{ms},43200000,{latitude_e7},231434000,176500,9,92,1500,0"
            ));
            writeln!(
                truth,
                "{:.2},{:.7},23.1434,176.5",
                f64::from(ms) * 1e-3,
                latitude_e7 as f64 * 1e-7
            )
            .unwrap();
        }
        log += &sentence(&format!(
            "PNORE,{ms},1000,-2000,3000,900,900,1500,1,{north_mm},3000,0,1500,0,0,2000,2000,4000,0123ABCD"
        ));
    }
    lab.write("board.txt", log);
    lab.write("truth.csv", truth);
    lab.write("board.toml", MANIFEST);
    lab
}

const MANIFEST: &str = r#"
name = "board"
world_frame = "ned"

[[source]]
file = "board.txt"
format = "northing-serial"

[[source]]
file = "truth.csv"
role = "reference"
time = { column = "t_s", unit = "s" }
gnss_position = { latitude = "lat_deg", longitude = "lon_deg", height = "h_m" }
"#;

#[test]
fn the_boards_own_estimates_are_scored_and_drawn() {
    let lab = with_board();
    let outputs = [
        "--report",
        "board.html",
        "--picture",
        "board.svg",
        "--out",
        "board.csv",
    ];
    let run = ["run", "board.toml", "--json"];
    let json = lab.json(&[&run[..], &outputs].concat());
    assert_eq!(json["estimator"], "device");
    assert_eq!(json["scored_against"], "reference");
    let off = json["position"]["horizontal_rmse_m"].as_f64().unwrap();
    assert!((off - 3.0).abs() < 0.02, "{off}");
    assert_eq!(json["position"]["inside_95"], 1.0);
    let table = lab.read("board.csv");
    assert_eq!(table.lines().count(), 1 + 90 * 50);
    let last: Vec<&str> = table.lines().last().unwrap().split(',').collect();
    assert_eq!(last[4..7], ["134.9700", "3.0000", "0.0000"]);
    assert_eq!(last[17..], ["3.0000", "1.5000", "aided"]);
    let report = lab.read("board.html");
    let picture = lab.read("board.svg");
    let figures = [
        "Roll, pitch and heading over time, a few seconds",
        "Position north, east and up over time, with fixes",
        "Position over a few seconds",
        "Map of the track with its fixes",
    ];
    let headings = [
        "Orientation, a few seconds",
        "Position",
        "Between the fixes, a few seconds",
        "Track",
    ];
    for (drawn, figures) in [(&report, figures), (&picture, headings)] {
        let keys = [
            "the device\u{2019}s own estimate",
            "accelerometer and magnetometer alone",
        ];
        contains(drawn, &[&figures[..], &keys].concat());
        assert!(!drawn.contains("NaN"));
    }
    assert!(picture.starts_with("<svg") && picture.trim_end().ends_with("</svg>"));
    contains(
        &report,
        &["what the device itself reported", "The board has started"],
    );
}

#[test]
fn a_file_and_a_stream_of_the_line_are_known_and_other_estimators_show_the_boards_beside_theirs() {
    let lab = with_board();
    let file = lab.succeeds(&["run", "board.txt"]);
    contains(
        &file,
        &[
            "board.txt: device over 90.0 s",
            "the device has used every fix, and there is no reference",
        ],
    );
    let arguments = [
        "run",
        "-",
        "--format",
        "northing-serial",
        "--estimator",
        "device",
    ];
    let mut program = lab.program(&arguments);
    let output = program.write_stdin(lab.read("board.txt")).output().unwrap();
    let stream = String::from_utf8(output.stdout).unwrap();
    assert_eq!(stream, file.replace("board.txt", "standard input"));
    lab.succeeds(&[
        "run",
        "board.txt",
        "--estimator",
        "axis-filters",
        "--report",
        "host.html",
    ]);
    contains(&lab.read("host.html"), &["the device\u{2019}s own"]);
    let attitude = lab.succeeds(&["run", "board.txt", "--estimator", "mekf"]);
    assert!(attitude.contains("mekf"), "{attitude}");
}

#[test]
fn nothing_can_be_kept_from_a_board_afterwards_and_others_are_told_what_is_missing() {
    let lab = with_board();
    for option in [&["--gnss-every", "2"][..], &["--outage", "10:5"]] {
        let message = lab.refuses(&[&["run", "board.txt"], option].concat());
        assert!(
            message.contains("nothing can be kept from it now"),
            "{message}"
        );
    }
    let message = lab.refuses(&["tune", "board.txt", "--estimator", "device"]);
    assert!(message.contains("no parameters to fit"), "{message}");
    let message = lab.refuses(&[
        "run",
        "board.txt",
        "--estimator",
        "mekf",
        "--picture",
        "x.svg",
    ]);
    assert!(message.contains("--picture has no effect"), "{message}");
    let message = lab.refuses(&[
        "run",
        "board.txt",
        "--picture",
        "x.svg",
        "--report",
        "./x.svg",
    ]);
    assert!(message.contains("name the same file"), "{message}");
}
