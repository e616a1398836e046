//! What a board has printed, as a recording for `northing run`: its output as it came, the truth of the walk, and
//! a manifest that puts the truth beside it.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::walk::{Truth, degrees};

/// Frames from one point of the truth to the next: five a second.
const EVERY: usize = 10;

/// Writes `NAME.txt`, `NAME-truth.csv` and `NAME.toml` into a folder; gives the path of the last, which names
/// the others.
///
/// # Panics
/// When they cannot be written.
#[must_use]
pub fn write(folder: &Path, name: &str, printed: &[u8], truth: &[Truth]) -> PathBuf {
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join(format!("{name}.txt")), printed).unwrap();
    fs::write(folder.join(format!("{name}-truth.csv")), table(truth)).unwrap();
    let path = folder.join(format!("{name}.toml"));
    fs::write(&path, manifest(name)).unwrap();
    path
}

/// Time counts from the first frame, as the board's does.
fn table(truth: &[Truth]) -> String {
    let mut text = String::from("t_s,latitude_deg,longitude_deg,height_m,vn,ve,vd,qw,qx,qy,qz\n");
    for (frame, truth) in truth.iter().enumerate().step_by(EVERY) {
        let [latitude, longitude, height] = degrees(&truth.position);
        let [north, east, down] = truth.velocity.into();
        let q = truth.attitude;
        writeln!(
            text,
            "{:.2},{latitude:.9},{longitude:.9},{height:.4},{north:.4},{east:.4},{down:.4},{:.7},{:.7},{:.7},{:.7}",
            frame as f64 * 0.02,
            q.w,
            q.i,
            q.j,
            q.k
        )
        .unwrap();
    }
    text
}

fn manifest(name: &str) -> String {
    format!(
        r#"# A simulated walk, as the emulated board printed it, and its truth.
name = "the walk with {name}"
world_frame = "ned"

[[source]]
file = "{name}.txt"
format = "northing-serial"

[[source]]
file = "{name}-truth.csv"
role = "reference"
time = {{ column = "t_s", unit = "s" }}
gnss_position = {{ latitude = "latitude_deg", longitude = "longitude_deg", height = "height_m" }}
gnss_velocity = {{ columns = ["vn", "ve", "vd"] }}
device_orientation = {{ columns = ["qw", "qx", "qy", "qz"] }}
"#
    )
}
