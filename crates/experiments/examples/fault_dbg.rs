//! debug
#![allow(clippy::print_stdout)]
use nalgebra::Vector3;
use northing_evaluation::attitude::ScoredRecord;
use northing_evaluation::{EstimatorKind, Profile, RunObserver, RunOptions, run};
use northing_recording::{Event, OpenOptions, RecordingError, Sample};
#[derive(Default)]
struct Obs {
    e: Vec<(f64, f64, f64)>,
}
impl RunObserver for Obs {
    fn scored(&mut self, s: &ScoredRecord) {
        if !s.reference.scored {
            return;
        }
        let d = s.reference.attitude.inverse() * s.attitude;
        let v = d.scaled_axis();
        let n = s
            .attitude_covariance
            .and_then(|p| p.try_inverse())
            .map_or(f64::NAN, |i| v.dot(&(i * v)) / 3.0);
        self.e.push((s.time_s, v.norm().to_degrees(), n));
    }
}
fn rms(e: &[(f64, f64, f64)], a: f64, b: f64, nees: bool) -> f64 {
    let v: Vec<f64> = e
        .iter()
        .filter(|x| x.0 >= a && x.0 < b)
        .map(|x| if nees { x.2 } else { x.1 * x.1 })
        .collect();
    let m = v.iter().sum::<f64>() / v.len() as f64;
    if nees { m } else { m.sqrt() }
}
fn gyro(s: &mut Sample) -> Option<&mut Vector3<f64>> {
    match s {
        Sample::AngularRate(w) => Some(w),
        _ => None,
    }
}
fn inject(ev: &[Event], kind: &str, at: i64) -> (Vec<Event>, i64) {
    let mut out = ev.to_vec();
    let s = 1_000_000_000;
    let mut end = at;
    let mut frozen: Option<Vector3<f64>> = None;
    let mut done = false;
    let mut drop = vec![];
    for (i, e) in out.iter_mut().enumerate() {
        let t = e.time_ns;
        if t < at {
            continue;
        }
        let within = |d: i64| t < at + d * s;
        match kind {
            "spike" => {
                if !done && let Some(w) = gyro(&mut e.sample) {
                    w.x = 34.9;
                    done = true;
                }
            }
            "accspike" => {
                if !done && let Sample::SpecificForce(f) = &mut e.sample {
                    f.x = 156.9;
                    done = true;
                }
            }
            "frozen3" | "zero3" | "frozen10" | "zero10" => {
                let d = if kind.ends_with("10") { 10 } else { 3 };
                if within(d)
                    && let Some(w) = gyro(&mut e.sample)
                {
                    let z = if kind.starts_with("zero") {
                        Vector3::zeros()
                    } else {
                        *frozen.get_or_insert(*w)
                    };
                    *w = z;
                    end = t;
                }
            }
            "sat3" => {
                if within(3)
                    && let Some(w) = gyro(&mut e.sample)
                {
                    for c in w.iter_mut() {
                        *c = c.clamp(-1.0, 1.0);
                    }
                    end = t;
                }
            }
            "miss3" => {
                if within(3) && gyro(&mut e.sample).is_some() {
                    drop.push(i);
                    end = t;
                }
            }
            "all3" => {
                if within(3) && !matches!(e.sample, Sample::Reference(_)) {
                    drop.push(i);
                    end = t;
                }
            }
            "bias.05" => {
                if let Some(w) = gyro(&mut e.sample) {
                    *w += Vector3::new(0.03, -0.03, 0.0264);
                }
            }
            "garbage20" => {
                if within(20) {
                    let r = |k: i64| {
                        let mut z = ((t / 1000) as u64)
                            .wrapping_mul(31)
                            .wrapping_add(k as u64 * 977)
                            .wrapping_add(0x9E3779B97F4A7C15);
                        z = (z ^ (z >> 30)).wrapping_mul(0xBF58476D1CE4E5B9);
                        z = (z ^ (z >> 27)).wrapping_mul(0x94D049BB133111EB);
                        z ^= z >> 31;
                        (z >> 40) as f64 / 8388608.0 - 1.0
                    };
                    let g = Vector3::new(r(1), r(2), r(3));
                    match &mut e.sample {
                        Sample::AngularRate(w) => *w = g * 10.0,
                        Sample::SpecificForce(w) => *w = g * 40.0,
                        Sample::MagneticField(w) | Sample::MagneticFieldUncalibrated(w) => {
                            *w = g * 100.0
                        }
                        _ => {}
                    }
                    end = t;
                }
            }
            _ => {}
        }
    }
    for i in drop.into_iter().rev() {
        out.remove(i);
    }
    (out, end)
}
fn main() {
    let data = std::env::var("NORTHING_DATA").unwrap();
    let args: Vec<String> = std::env::args().skip(1).collect();
    let only: Vec<&str> = args
        .iter()
        .filter(|a| !a.contains('='))
        .map(String::as_str)
        .collect();
    let mut paths = vec![];
    for (folder, step) in [("broad", 3), ("smartphone", 5)] {
        let dir = std::path::Path::new(&data).join("attitude").join(folder);
        let mut p: Vec<_> = std::fs::read_dir(dir)
            .unwrap()
            .map(|e| e.unwrap().path())
            .filter(|p| {
                let n = p.file_name().unwrap().to_string_lossy().into_owned();
                n.ends_with(".parquet") && !n.starts_with("calib_")
            })
            .collect();
        p.sort();
        paths.extend(p.into_iter().step_by(step));
    }
    let all = [
        "clean",
        "spike",
        "accspike",
        "frozen3",
        "zero3",
        "frozen10",
        "sat3",
        "miss3",
        "all3",
        "bias.05",
        "garbage20",
    ];
    let kinds: Vec<&str> = all
        .into_iter()
        .filter(|k| only.is_empty() || only.contains(k) || *k == "clean")
        .collect();
    println!(
        "{:<28} {:<16} {:>9} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} faults",
        "file", "kind", "est", "clean", "rms", "max60", "rec", "nees60", "cl.nees"
    );
    let mut sums: std::collections::BTreeMap<(usize, &str), Vec<(f64, f64, f64, bool)>> =
        Default::default();
    let mut hours = 0.0;
    let mut alarms: std::collections::BTreeMap<String, usize> = Default::default();
    for p in &paths {
        let name = p.file_stem().unwrap().to_string_lossy().into_owned();
        let rec = northing_recording::open(p, &OpenOptions::default()).unwrap();
        let frame = rec.metadata().world_frame;
        let ev: Vec<Event> = rec.map(|e| e.unwrap()).collect();
        let (t0, t1) = (ev[0].time_ns, ev[ev.len() - 1].time_ns);
        // fastest within the second third
        let (a, b) = (t0 + (t1 - t0) / 4, t0 + (t1 - t0) / 2);
        let at = ev
            .iter()
            .filter(|e| e.time_ns > a && e.time_ns < b)
            .max_by(|x, y| {
                let n = |e: &Event| {
                    if let Sample::AngularRate(w) = &e.sample {
                        w.norm()
                    } else {
                        0.0
                    }
                };
                n(x).total_cmp(&n(y))
            })
            .unwrap()
            .time_ns
            - 300_000_000;
        hours += (t1 - t0) as f64 * 1e-9 / 3600.0;
        for (j, est) in [
            EstimatorKind::BoundedVelocity,
            EstimatorKind::Mekf,
            EstimatorKind::Complementary,
        ]
        .into_iter()
        .enumerate()
        {
            let mut o = RunOptions::new(est, Profile::HandHeld);
            o.world_frame = frame;
            if !name.contains("broad") && p.to_string_lossy().contains("smartphone") {
                o.sensors.magnetometer_source = northing_evaluation::calibration::magnetometer::MagnetometerSource::Uncalibrated;
            }
            for s in args.iter().filter(|a| a.contains('=')) {
                let _ = o.set(s);
            }
            let mut clean = vec![];
            for kind in &kinds {
                let (e2, end) = inject(&ev, kind, at);
                let mut obs = Obs::default();
                let s = match run(e2.into_iter().map(Ok::<_, RecordingError>), &o, &mut obs) {
                    Ok(s) => s,
                    Err(x) => {
                        println!("ERR {name} {kind} {x}");
                        continue;
                    }
                };
                let e = obs.e;
                if *kind == "clean" {
                    clean = e.clone();
                    if j == 0 {
                        for f in &s.faults {
                            *alarms
                                .entry(format!("{:?}-{:?}", f.sensor, f.kind))
                                .or_default() += 1;
                        }
                    }
                }
                let end_s = (end - t0) as f64 * 1e-9;
                let big = 1e9;
                let (c, r) = (rms(&clean, 0.0, big, false), rms(&e, 0.0, big, false));
                let at_s = (at - t0) as f64 * 1e-9;
                let mx = e
                    .iter()
                    .filter(|x| x.0 > at_s && x.0 < end_s + 60.0)
                    .map(|x| x.1)
                    .fold(0.0, f64::max);
                // last time above clean+5 within next 60s
                let cl = |t: f64| {
                    let i = clean.partition_point(|y| y.0 < t);
                    clean.get(i).map_or(0.0, |y| y.1)
                };
                let recov = e
                    .iter()
                    .filter(|x| x.0 > end_s && x.0 < end_s + 60.0 && x.1 > cl(x.0) + 5.0)
                    .map(|x| x.0 - end_s)
                    .fold(0.0, f64::max);
                let nees = rms(&e, end_s + 10.0, end_s + 70.0, true);
                let cn = rms(&clean, end_s + 10.0, end_s + 70.0, true);
                let f: Vec<String> = s
                    .faults
                    .iter()
                    .map(|f| {
                        format!(
                            "{:?}-{:?}@{:.2}({:.2})",
                            f.sensor,
                            f.kind,
                            f.from_s - at_s,
                            f.size
                        )
                        .replace("Gyroscope", "G")
                        .replace("Accelerometer", "A")
                        .replace("Magnetometer", "M")
                    })
                    .collect();
                println!(
                    "{:<28} {:<16} {:>9} {c:7.2} {r:7.2} {mx:7.1} {recov:7.1} {nees:7.2} {cn:7.2} {}",
                    &name[..name.len().min(28)],
                    kind,
                    ["bv", "mekf", "comp"][j],
                    f.iter().take(6).cloned().collect::<Vec<_>>().join(" ")
                );
                sums.entry((j, kind)).or_default().push((
                    r / c,
                    recov,
                    nees / cn.max(1.0),
                    recov <= 10.0 && (nees < 3.0 || nees < 1.5 * cn),
                ));
            }
        }
    }
    println!("hours {hours:.2} clean alarms {alarms:?}");
    for ((j, k), v) in &sums {
        let med = |f: &dyn Fn(&(f64, f64, f64, bool)) -> f64| {
            let mut x: Vec<f64> = v.iter().map(f).collect();
            x.sort_by(f64::total_cmp);
            (x[x.len() / 2], x[x.len() - 1])
        };
        let (a, b) = med(&|x| x.0);
        let (c, d) = med(&|x| x.1);
        let (e, f) = med(&|x| x.2);
        println!(
            "SUM {:>5} {:<10} ratio {a:.2} {b:.2}  recovery {c:.1} {d:.1}  nees {e:.2} {f:.2}  ok {}/{}",
            ["bv", "mekf", "comp"][*j],
            k,
            v.iter().filter(|x| x.3).count(),
            v.len()
        );
    }
}
