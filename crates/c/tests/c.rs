//! The header is that of the library, and what C makes of both is what Rust makes.

#![expect(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "a test ends there; digits are to be the same"
)]

use std::ffi::{CString, c_int};
use std::path::{Path, PathBuf};
use std::process::Command;

#[cfg(feature = "double")]
use northing_c::attitude::northing_mekf_init;
#[cfg(not(feature = "double"))]
use northing_c::attitude::northing_mekf_init_float as northing_mekf_init;
use northing_c::attitude::{
    MekfMemory, NORTHING_MEKF_WORDS, Profile, northing_mekf_accelerometer,
    northing_mekf_covariance, northing_mekf_gyroscope, northing_mekf_quat,
};
#[cfg(feature = "double")]
use northing_c::gnss_ins::northing_gnss_ins_init;
#[cfg(not(feature = "double"))]
use northing_c::gnss_ins::northing_gnss_ins_init_float as northing_gnss_ins_init;
use northing_c::gnss_ins::{
    GnssInsMemory, NORTHING_GNSS_INS_WORDS, northing_gnss_ins_imu, northing_gnss_ins_position,
};
use northing_c::shared::{Innovation, Outcome, Real, Setting, Status};

const LAB: c_int = Profile::Lab as c_int;
const HAND_HELD: c_int = Profile::HandHeld as c_int;

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn the_header_is_that_of_the_library() {
    let config = cbindgen::Config::from_file(here().join("cbindgen.toml")).unwrap();
    let made = cbindgen::Builder::new()
        .with_config(config)
        .with_src(here().join("src/lib.rs"))
        .generate()
        .unwrap();
    let mut text = Vec::new();
    made.write(&mut text);
    let text = String::from_utf8(text).unwrap();
    let path = here().join("include/northing.h");
    if std::env::var_os("NORTHING_BLESS").is_some() {
        std::fs::write(&path, &text).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == text,
        "include/northing.h is out of date: NORTHING_BLESS=1 cargo test -p northing-c"
    );
}

/// The static library that cargo has built beside this test, with the same features.
fn library() -> PathBuf {
    let test = std::env::current_exe().unwrap();
    let folder = test.parent().unwrap();
    let built = std::fs::read_dir(folder).unwrap().filter_map(|entry| {
        let path = entry.ok()?.path();
        let name = path.file_name()?.to_str()?;
        let is_it = name.starts_with("libnorthing_c") && name.ends_with(".a");
        let modified = path.metadata().and_then(|meta| meta.modified()).ok()?;
        is_it.then_some((modified, path))
    });
    let newest = built.max_by_key(|(modified, _)| *modified);
    newest.expect("cargo has built no static library").1
}

#[test]
fn the_example_of_c_runs_without_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["attitude", "gnss_ins"] {
        let program = folder.path().join(name);
        compile(name, cfg!(feature = "double"), &program).unwrap();
        let ran = Command::new(&program).output().unwrap();
        let said = String::from_utf8_lossy(&ran.stdout);
        assert!(ran.status.success(), "{said}");
        assert!(said.contains("NIS"), "{said}");
    }
}

/// Compiles an example and links the library, or says what the compiler says.
fn compile(name: &str, double: bool, program: &Path) -> Result<(), String> {
    let compiled = Command::new(std::env::var("CC").unwrap_or_else(|_| "cc".to_owned()))
        .args([
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-pedantic",
            "-O1",
        ])
        .args((!double).then_some("-DNORTHING_FLOAT"))
        .arg("-I")
        .arg(here().join("include"))
        .arg(here().join(format!("examples/{name}.c")))
        .arg(library())
        .args(["-lm", "-lpthread", "-ldl", "-o"])
        .arg(program)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&compiled.stderr);
    compiled.status.success().then_some(()).ok_or(said.into())
}

/// Of another precision the filter is larger than its memory.
#[test]
fn a_library_of_another_precision_does_not_link() {
    let folder = tempfile::tempdir().unwrap();
    for (name, function) in [
        ("attitude", "northing_mekf_init"),
        ("gnss_ins", "northing_gnss_ins_init"),
    ] {
        let program = folder.path().join(name);
        let said = compile(name, !cfg!(feature = "double"), &program).unwrap_err();
        assert!(said.contains(function), "{said}");
    }
}

fn empty() -> MekfMemory {
    MekfMemory {
        words: [0; NORTHING_MEKF_WORDS],
    }
}

/// A filter that pre-integrates takes samples for later; a fix without a height is one.
#[test]
fn gathered_samples_and_fixes_without_a_height_are_told_as_such() {
    use northing_core::kalman::{Innovation as Told, SkipReason};
    let told = Told::<Real>::skipped(SkipReason::Accumulated);
    assert_eq!(Innovation::from(&told).outcome, Outcome::Gathered);
    let mut filter = GnssInsMemory {
        words: [0; NORTHING_GNSS_INS_WORDS],
    };
    let (rate, force): ([Real; 3], [Real; 3]) = ([0.0; 3], [0.0, 0.0, -9.81]);
    let (std, mut told) = ([1.0; 3], Vec::new());
    // SAFETY: every pointer is null or points to what it is said to.
    unsafe {
        let made = northing_gnss_ins_init(&mut filter, std::ptr::null(), 0);
        assert_eq!(made, Status::Ok);
        for k in 0..6000_i64 {
            northing_gnss_ins_imu(&mut filter, k * 10_000_000, rate.as_ptr(), force.as_ptr());
            if k % 100 == 50 {
                let wobble = if k % 200 == 50 { 0.1 } else { -0.1 };
                let ned = [wobble, 0.0, Real::NAN];
                let mut vertical = Innovation::from(&Told::skipped(SkipReason::NotUsed));
                let horizontal = northing_gnss_ins_position(
                    &mut filter,
                    k * 10_000_000,
                    ned.as_ptr(),
                    std.as_ptr(),
                    &mut vertical,
                );
                told.push((horizontal.outcome, vertical.outcome));
            }
        }
    }
    assert_eq!(told.last(), Some(&(Outcome::Fused, Outcome::NotUsed)));
}

/// The filter behind the functions is the one of the core, to the bit; a copy of the memory is the filter.
#[test]
fn it_is_the_filter_of_the_core_and_a_copy_goes_on() {
    use northing_core::attitude::{AttitudeConfig, AttitudeDriver, DriverConfig, Mekf};
    use northing_core::geometry::rotation;
    use northing_core::nalgebra::Vector3;

    let mut config = AttitudeConfig::<Real>::lab();
    config.accelerometer_std = 0.25;
    let mut expected = AttitudeDriver::new(Mekf::new(config).unwrap(), DriverConfig::default());
    let name = CString::new("accelerometer_std").unwrap();
    let settings = [Setting {
        name: name.as_ptr(),
        value: [0.25, 0.0, 0.0],
    }];
    let mut filter = empty();
    // SAFETY: every pointer points to what it is said to.
    unsafe {
        let made = northing_mekf_init(&mut filter, LAB, settings.as_ptr(), 1);
        assert_eq!(made, Status::Ok);
    }
    let mut copies = Vec::new();
    for k in 0..400_i64 {
        let (time_ns, t) = (k * 10_000_000, k as Real * 0.01);
        let (rate, force) = ([0.3 * t.sin(), 0.1, -0.05], [0.2 * t.cos(), 0.1, 9.8]);
        expected.gyroscope(time_ns, &Vector3::from(rate));
        let told = expected.accelerometer(time_ns, &Vector3::from(force));
        if k == 100 {
            copies.push(filter);
        }
        for one in copies.iter_mut().chain([&mut filter]) {
            // SAFETY: as above.
            let by_c = unsafe {
                northing_mekf_gyroscope(one, time_ns, rate.as_ptr());
                northing_mekf_accelerometer(one, time_ns, force.as_ptr())
            };
            assert_eq!(by_c.residual, <[Real; 3]>::from(told.residual));
            assert_eq!(
                (by_c.nis, by_c.degrees_of_freedom),
                (told.nis, told.degrees_of_freedom)
            );
        }
    }
    for one in copies.iter().chain([&filter]) {
        let (mut quat, mut covariance) = ([0.0; 4], [0.0; 9]);
        // SAFETY: as above.
        let read = unsafe {
            [
                northing_mekf_quat(one, quat.as_mut_ptr()),
                northing_mekf_covariance(one, covariance.as_mut_ptr()),
            ]
        };
        assert_eq!(read, [Status::Ok; 2]);
        assert_eq!(quat, rotation::to_wxyz(&expected.attitude().unwrap()));
        let p = expected.attitude_covariance().unwrap();
        assert_eq!(covariance, p.transpose().as_slice());
    }
}

#[test]
fn null_pointers_and_what_is_no_filter_are_said_to_be() {
    let (mut filter, null) = (empty(), std::ptr::null_mut());
    let vector: [Real; 3] = [0.0, 0.0, 9.81];
    let unknown = CString::new("no_such_name").unwrap();
    let known = CString::new("accelerometer_std").unwrap();
    let setting = |name: *const std::ffi::c_char, value: Real| Setting {
        name,
        value: [value, 0.0, 0.0],
    };
    // SAFETY: every pointer is null or points to what it is said to.
    unsafe {
        assert_eq!(
            northing_mekf_init(null, LAB, std::ptr::null(), 0),
            Status::NoFilter
        );
        assert_eq!(
            northing_mekf_gyroscope(&mut filter, 0, vector.as_ptr()),
            Status::NoFilter
        );
        assert_eq!(
            northing_mekf_quat(&filter, [0.0; 4].as_mut_ptr()),
            Status::NoFilter
        );
        for (name, value, status) in [
            (unknown.as_ptr(), 1.0, Status::UnknownParameter),
            (std::ptr::null(), 1.0, Status::UnknownParameter),
            (known.as_ptr(), -1.0, Status::OutOfRange),
        ] {
            let made = northing_mekf_init(&mut filter, LAB, &setting(name, value), 1);
            assert_eq!(made, status);
        }
        assert_eq!(
            northing_mekf_init(&mut filter, HAND_HELD, std::ptr::null(), 0),
            Status::Ok
        );
        assert_eq!(
            northing_mekf_gyroscope(&mut filter, 0, std::ptr::null()),
            Status::NoFilter
        );
        assert_eq!(
            northing_mekf_quat(&filter, [0.0; 4].as_mut_ptr()),
            Status::Aligning
        );
        for number in [-1, 2, c_int::MAX] {
            let made = northing_mekf_init(&mut filter, number, std::ptr::null(), 0);
            assert_eq!(made, Status::OutOfRange, "profile {number}");
        }
        let told = northing_mekf_accelerometer(&mut filter, 0, std::ptr::null());
        assert_eq!(told.outcome, Outcome::NotUsed);
        let nan = [Real::NAN, 0.0, 0.0];
        assert_ne!(
            northing_mekf_gyroscope(&mut filter, 1, nan.as_ptr()),
            Status::Ok
        );
    }
}
