//! Sensors, their units and axes in drafts of manifests.

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::describe::{Confidence, draft};
use northing_recording::{
    BodyAxes, OpenOptions, RateUnit, Sample, WorldFrame, manifest, open, read_from,
};

use super::{near, read, slow, sure};
use crate::tables::{Random, plain, recording};

#[test]
fn arrays_without_names_are_told_by_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let mut offs: Vec<f64> = Vec::new();
    for seed in 1..=40_u64 {
        let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let rows = recording(&mut random, 100.0, 40.0);
        let order = random.of(&[[0, 1, 2], [0, 2, 1], [1, 0, 2], [2, 1, 0]]);
        let text = plain(&rows, |row| {
            let three = [row.rate, row.force, row.field];
            order
                .iter()
                .flat_map(|which| three[*which].iter().copied().collect::<Vec<_>>())
                .collect()
        });
        // The rate is told, or found to some per cent by the turns.
        for told in [Some(100.0), None] {
            let (draft, events) = read(folder.path(), "array.csv", &text, told);
            let mut rates = rows.iter();
            let turns = events.iter().filter_map(|event| match event.sample {
                Sample::AngularRate(v) => Some(v),
                _ => None,
            });
            assert!(
                turns.clone().count() == rows.len()
                    && turns.clone().all(|v| near(v, rates.next().unwrap().rate)),
                "seed {seed}: {}",
                draft.manifest
            );
            let seconds = (events[events.len() - 1].time_ns - events[0].time_ns) as f64 * 1e-9;
            let off = (seconds / rows[rows.len() - 1].t - 1.0).abs();
            offs.extend(told.is_none().then_some(off));
            assert!(
                off < if told.is_some() { 1e-6 } else { 0.15 },
                "seed {seed}: {off}"
            );
            assert_eq!(
                sure(&draft, "time"),
                if told.is_some() {
                    Confidence::Certain
                } else {
                    Confidence::Assumed
                }
            );
        }
    }
    offs.sort_by(f64::total_cmp);
    assert!(offs[offs.len() * 9 / 10] < 0.03, "{offs:?}");
}

#[test]
fn axes_quaternions_and_the_vertical_are_found_by_gravity() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(77);
    let rows = recording(&mut random, 100.0, 60.0);
    let text = plain(&rows, |row| {
        let (w, f, q) = (row.rate, row.force, row.attitude.inverse());
        vec![row.t, w.y, w.x, -w.z, f.x, f.y, f.z, q.i, q.j, q.k, q.w]
    });
    let text = format!("t,gx,gy,gz,ax,ay,az,vicon_x,vicon_y,vicon_z,vicon_w\n{text}");
    let (draft, events) = read(folder.path(), "mocap.csv", &text, None);
    let mut row = rows.iter();
    let mut truth = rows.iter();
    for event in &events {
        let is_right = match &event.sample {
            Sample::AngularRate(v) => near(*v, row.next().unwrap().rate),
            Sample::Reference(reference) => {
                reference.attitude.angle_to(&truth.next().unwrap().attitude) < 1e-6
            }
            _ => true,
        };
        assert!(is_right, "{event:?}\n{}", draft.manifest);
    }
    assert!(row.next().is_none() && truth.next().is_none());
    // The same with z down.
    let text = plain(&rows, |row| {
        let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let (w, f, q) = (row.rate, row.force, down * row.attitude);
        vec![row.t, w.x, w.y, w.z, f.x, f.y, f.z, q.w, q.i, q.j, q.k]
    });
    let text = format!("t,gx,gy,gz,ax,ay,az,q0,q1,q2,q3\n{text}");
    let path = folder.path().join("down.csv");
    std::fs::write(&path, &text).unwrap();
    let options = OpenOptions {
        describe: true,
        ..OpenOptions::default()
    };
    let recording = open(&path, &options).unwrap();
    assert_eq!(recording.metadata().world_frame, WorldFrame::Ned);
    let told = recording.issues().sentences().join("\n");
    assert!(
        told.contains("Guessed (likely): device_orientation from q0, q1, q2, q3"),
        "{told}"
    );
    assert!(open(&path, &OpenOptions::default()).is_err());
}

#[test]
fn at_rest_the_unit_of_a_gyroscope_is_assumed_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(5);
    let text: String = (0..2000)
        .map(|k| {
            let (w, f) = (random.vector() * 0.02, random.vector() * 0.1);
            format!(
                "{},{},{},{},{},{},{}\n",
                f64::from(k) * 0.01,
                w.x,
                w.y,
                w.z,
                f.x,
                f.y,
                9.81 + f.z
            )
        })
        .collect();
    let text = format!("t,gx,gy,gz,ax,ay,az\n{text}");
    let (draft, _) = read(folder.path(), "rest.csv", &text, None);
    assert_eq!(sure(&draft, "gyroscope"), Confidence::Assumed);
    assert!(
        draft
            .manifest
            .contains("# assumed: neither a header nor a turn of gravity tells the unit")
    );
}

#[test]
fn velocities_and_the_estimate_of_gravity_are_no_accelerometer() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(13);
    let rows = recording(&mut random, 100.0, 20.0);
    let text = plain(&rows, |row| {
        let (g, w) = (row.attitude.inverse() * Vector3::z() * 9.81, row.rate);
        vec![
            row.t, g.x, g.y, g.z, 9.8, 0.1, 0.1, 30.0, 20.0, 10.0, w.x, w.y, w.z,
        ]
    });
    let header =
        "t,gravity_x,gravity_y,gravity_z,vel_x,vel_y,vel_z,pos_x,pos_y,pos_z,gyro_x,gyro_y,gyro_z";
    let path = folder.path().join("a.csv");
    std::fs::write(&path, format!("{header}\n{text}")).unwrap();
    let draft = draft(std::slice::from_ref(&path), folder.path(), None).unwrap();
    let keys: Vec<&str> = draft.guesses.iter().map(|guess| guess.key).collect();
    assert_eq!(keys, ["time", "gyroscope"], "{}", draft.manifest);
}

#[test]
fn a_unit_that_is_told_is_taken_and_a_stream_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(14);
    let rows = recording(&mut random, 100.0, 20.0);
    let text = slow("time_s", &rows, |k| (k as f64 * 0.01).to_string());
    let path = folder.path().join("a.csv");
    std::fs::write(&path, &text).unwrap();
    let options = OpenOptions {
        describe: true,
        gyroscope_unit: Some(RateUnit::DegPerS),
        ..OpenOptions::default()
    };
    let recording = open(&path, &options).unwrap();
    let told = recording.issues().sentences().join("\n");
    assert!(
        told.contains("in rad-per-s. Taken in deg-per-s, as told."),
        "{told}"
    );
    let first = recording
        .map(Result::unwrap)
        .find_map(|event| match event.sample {
            Sample::AngularRate(v) => Some(v),
            _ => None,
        });
    assert!(near(first.unwrap(), rows[0].rate * 1_f64.to_radians()));
    let input = std::io::Cursor::new(text.into_bytes());
    let error = read_from(input, "standard input", &options)
        .unwrap_err()
        .to_string();
    assert!(error.contains("cannot be described"), "{error}");
}

#[test]
fn counts_that_no_turn_tells_the_scale_of_are_assumed() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(15);
    let text: String = (0..2000)
        .map(|k| {
            let (w, f) = (random.vector() * 9000.0, random.vector() * 0.05);
            let t = f64::from(k) * 0.01;
            format!(
                "{t},{},{},{},{},{},{}\n",
                w.x,
                w.y,
                w.z,
                f.x,
                f.y,
                9.81 + f.z
            )
        })
        .collect();
    let text = format!("t,gx,gy,gz,ax,ay,az\n{text}");
    let path = folder.path().join("a.csv");
    std::fs::write(&path, text).unwrap();
    let draft = draft(std::slice::from_ref(&path), folder.path(), None).unwrap();
    assert_eq!(sure(&draft, "gyroscope"), Confidence::Assumed);
    assert!(
        draft.manifest.contains("counts of a converter"),
        "{}",
        draft.manifest
    );
}

#[test]
fn gauss_of_a_magnetometer_is_no_g() {
    let folder = tempfile::tempdir().unwrap();
    let rows = recording(&mut Random(5), 100.0, 20.0);
    for (header, factor, unit) in [("G", 0.01, "gauss"), ("mG", 10.0, "milligauss")] {
        let lines = plain(&rows, |r| {
            let (w, f, m) = (r.rate, r.force, r.field * factor);
            vec![r.t, w.x, w.y, w.z, f.x, f.y, f.z, m.x, m.y, m.z]
        });
        let text =
            format!("t_s,gx,gy,gz,ax,ay,az,Mx [{header}],My [{header}],Mz [{header}]\n{lines}");
        let (draft, _) = read(folder.path(), "a.csv", &text, None);
        assert!(
            draft.manifest.contains(&format!("unit = \"{unit}\"")),
            "{}",
            draft.manifest
        );
        assert_eq!(sure(&draft, "magnetometer"), Confidence::Certain);
        assert!(
            !draft.manifest.contains("as the header says"),
            "{}",
            draft.manifest
        );
    }
}

/// Quaternions are told by the accelerometer of another file, by the stamps of both.
#[test]
fn a_reference_in_a_file_of_its_own_is_told_by_the_accelerometer_of_another() {
    let folder = tempfile::tempdir().unwrap();
    let rows = recording(&mut Random(21), 100.0, 30.0);
    let write = |name: &str, header: &str, text: String| {
        let path = folder.path().join(name);
        std::fs::write(&path, format!("{header}\n{text}")).unwrap();
        path
    };
    let imu = slow("time_us", &rows, |k| {
        format!("{}", 5_000_000_000_u64 + 10_000 * k as u64)
    });
    let imu = {
        let path = folder.path().join("imu.csv");
        std::fs::write(&path, imu).unwrap();
        path
    };
    let reference = |offset_s: f64| {
        let inverse = plain(&rows[..], |r| {
            let q = r.attitude.inverse();
            vec![r.t + offset_s, q.i, q.j, q.k, q.w]
        });
        write("ref.csv", "t,ref_1,ref_2,ref_3,ref_4", inverse)
    };
    let made = draft(&[imu.clone(), reference(5000.003)], folder.path(), None).unwrap();
    for line in ["order = \"xyzw\"", "direction = \"world-to-body\""] {
        assert!(made.manifest.contains(line), "{}", made.manifest);
    }
    assert!(made.remarks.is_empty(), "{:?}", made.remarks);
    // Of another time it cannot be told, and the reason is not that there is no accelerometer.
    let made = draft(&[imu, reference(41_000.0)], folder.path(), None).unwrap();
    assert!(
        made.manifest
            .contains("the accelerometer has samples at fewer than 30 of its times"),
        "{}",
        made.manifest
    );
    let [remark] = &made.remarks[..] else {
        panic!("{:?}", made.remarks)
    };
    assert!(
        remark.starts_with(
            "ref.csv has times from 41000.000 to 41029.990 s, imu.csv from 5000.000 to 5029.990 s"
        ) && remark.contains("time_offset_s")
            && made.manifest.contains(remark),
        "{remark}"
    );
}

#[test]
fn a_line_of_units_below_the_names_belongs_to_them() {
    let folder = tempfile::tempdir().unwrap();
    let rows = recording(&mut Random(8), 100.0, 20.0);
    let degrees = 180.0 / std::f64::consts::PI;
    let lines = plain(&rows, |r| {
        let (w, f, m, q) = (
            r.rate * degrees,
            r.force / 9.80665e-3,
            r.field * 10.0,
            r.attitude,
        );
        vec![
            r.t, w.x, w.y, w.z, f.x, f.y, f.z, m.x, m.y, m.z, q.i, q.j, q.k, q.w,
        ]
    });
    let text = format!(
        "time,gyr_x,gyr_y,gyr_z,acc_x,acc_y,acc_z,mag_x,mag_y,mag_z,ref_x,ref_y,ref_z,ref_w\n\
         s,deg/s,deg/s,deg/s,mg,mg,mg,mG,mG,mG,-,-,-,-\n{lines}"
    );
    let (draft, events) = read(folder.path(), "a.csv", &text, None);
    assert!(draft.manifest.contains("[reference]"), "{}", draft.manifest);
    for key in ["time", "gyroscope", "accelerometer", "magnetometer"] {
        assert_eq!(sure(&draft, key), Confidence::Certain, "{}", draft.manifest);
    }
    let mut read = rows.iter();
    for event in &events {
        if let Sample::SpecificForce(force) = event.sample {
            assert!(near(force, read.next().unwrap().force), "{event:?}");
        }
    }
    assert!(read.next().is_none());
}

/// Of a unit that has gravity on its z with these signs, one after the other.
fn on_its_z(signs: &[f64]) -> String {
    let mut random = Random(23);
    let mut text = String::from("time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n");
    for k in 0..1000 {
        let (w, f) = (random.vector() * 0.02, random.vector() * 0.2);
        let z = 9.81 * signs[k * signs.len() / 1000] + f.z;
        let t = 0.01 * k as f64;
        text.push_str(&format!(
            "{t:.2},{},{},{},{},{},{z}\n",
            w.x, w.y, w.z, f.x, f.y
        ));
    }
    text
}

#[test]
fn z_that_reads_gravity_with_a_minus_is_that_of_forward_right_down() {
    let folder = tempfile::tempdir().unwrap();
    let drafted = |signs: &[f64]| {
        let path = folder.path().join("unit.csv");
        std::fs::write(&path, on_its_z(signs)).unwrap();
        let draft = draft(std::slice::from_ref(&path), folder.path(), None).unwrap();
        let place = folder.path().join("draft.toml");
        let opened = manifest::open_text(&draft.manifest, &place, &OpenOptions::default());
        (draft, opened.unwrap().metadata().body_axes)
    };
    let (down, axes) = drafted(&[-1.0]);
    assert_eq!(axes, Some(BodyAxes::Frd), "{}", down.manifest);
    assert_eq!(sure(&down, "body_axes"), Confidence::Assumed);
    // Upright, and a device that is turned over.
    for signs in [&[1.0][..], &[-1.0, 1.0, -1.0, 1.0]] {
        let (draft, axes) = drafted(signs);
        assert_eq!(axes, None, "{}", draft.manifest);
        let named = "# body_axes = \"phone\"   # x, y, z: right, forward, up;";
        assert!(draft.manifest.contains(named), "{}", draft.manifest);
    }
}
