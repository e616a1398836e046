//! debug
#![allow(clippy::print_stdout)]
use nalgebra::{Matrix3, Vector3};
use northing_evaluation::{EstimateRecord, EstimatorKind, Profile, RunObserver, RunOptions, run};
use northing_recording::{Event, OpenOptions, RecordingError, Sample};
#[derive(Default)]
struct Obs {
    e: Vec<(f64, Vector3<f64>, Matrix3<f64>)>,
}
impl RunObserver for Obs {
    fn estimate(&mut self, s: &EstimateRecord) {
        if let Some((b, p)) = s.gyroscope_bias {
            self.e.push((s.time_s, b, p));
        }
    }
}
fn main() {
    let data = std::env::var("NORTHING_DATA").unwrap();
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
    for est in [EstimatorKind::BoundedVelocity, EstimatorKind::Mekf] {
        for p in &paths {
            let name = p.file_stem().unwrap().to_string_lossy().into_owned();
            let rec = northing_recording::open(p, &OpenOptions::default()).unwrap();
            let frame = rec.metadata().world_frame;
            let ev: Vec<Event> = rec.map(|e| e.unwrap()).collect();
            let (t0, t1) = (ev[0].time_ns, ev[ev.len() - 1].time_ns);
            for step in [0.0, 0.05] {
                let at = t0 + (t1 - t0) / 3;
                let mut e2 = ev.clone();
                for e in &mut e2 {
                    if e.time_ns >= at
                        && let Sample::AngularRate(w) = &mut e.sample
                    {
                        *w += Vector3::new(0.6, -0.6, 0.53) * step;
                    }
                }
                let mut o = RunOptions::new(est, Profile::HandHeld);
                o.world_frame = frame;
                if p.to_string_lossy().contains("smartphone") {
                    o.sensors.magnetometer_source = northing_evaluation::calibration::magnetometer::MagnetometerSource::Uncalibrated;
                }
                let mut obs = Obs::default();
                if run(e2.into_iter().map(Ok::<_, RecordingError>), &o, &mut obs).is_err() {
                    continue;
                };
                let at_s = (at - t0) as f64 * 1e-9;
                for w in [1.0, 3.0] {
                    let mut d = vec![];
                    let mut last: Option<(f64, Vector3<f64>, Matrix3<f64>)> = None;
                    for r in &obs.e {
                        match last {
                            None => last = Some(*r),
                            Some(l) if r.0 - l.0 >= w => {
                                let db = r.1 - l.1;
                                let q = (l.2 - r.2 + l.2 * 0.02).trace().max(l.2.trace() * 0.02);
                                let cos = if d.is_empty() { 0.0 } else { 1.0 };
                                d.push((
                                    r.0,
                                    db.norm_squared() / q,
                                    l.2.trace().sqrt(),
                                    db.norm(),
                                    cos,
                                ));
                                last = Some(*r);
                            }
                            _ => {}
                        }
                    }
                    if step == 0.0 {
                        let mut v: Vec<f64> = d.iter().filter(|x| x.0 > 5.0).map(|x| x.1).collect();
                        v.sort_by(f64::total_cmp);
                        println!(
                            "{est:?} {name:<30.30} w {w} clean  med {:.2} p90 {:.2} p99 {:.2} max {:.2}",
                            v[v.len() / 2],
                            v[v.len() * 9 / 10],
                            v[v.len() * 99 / 100],
                            v[v.len() - 1]
                        );
                    } else {
                        let v: Vec<String> = d
                            .iter()
                            .filter(|x| x.0 > at_s && x.0 < at_s + 15.0)
                            .map(|x| format!("{:.1}", x.1))
                            .collect();
                        println!("{est:?} {name:<30.30} w {w} step   {}", v.join(" "));
                    }
                }
            }
        }
    }
}
