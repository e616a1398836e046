//! Studies on engines that exist: the scripts of `examples/studies` as Slurm and Kubernetes would run them, task by task.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::support::Lab;

const STUDY: &str = r#"
question = "attitude"
estimators = ["complementary", "mekf3"]
seeds = { first = 1, count = 10 }
[sources.worlds]
count = 1
motion = "desk"
"#;

/// A file of the examples.
fn example(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("../../examples/studies").join(name)
}

/// A folder with a study, and its hash on one process.
fn lab() -> (Lab, Value) {
    let lab = Lab::new();
    lab.write("study.toml", STUDY);
    let whole = lab.json(&["study", "study.toml", "--json"]);
    assert_eq!(whole["runs"], 20);
    (lab, whole)
}

/// The hash of what the tasks left behind.
fn agrees(lab: &Lab, parts: &str, whole: &Value) {
    let merged = lab.json(&["study", "merge", parts, "--json"]);
    assert_eq!(merged["hash"], whole["hash"]);
    assert_eq!(&merged, whole);
}

#[test]
fn a_slurm_array_makes_the_same_study_whatever_its_first_index() {
    let (lab, whole) = lab();
    let bin = Path::new(env!("CARGO_BIN_EXE_northing")).parent().unwrap();
    let path = std::env::var("PATH").unwrap_or_default();
    let script = example("slurm.sh");
    let task = |index: u32, first: u32, parts: &str| {
        let mut command = Command::new("bash");
        command
            .arg(&script)
            .args(["study.toml", parts])
            .current_dir(lab.path("."))
            .env("PATH", format!("{}:{path}", bin.display()))
            .env("SLURM_ARRAY_TASK_ID", index.to_string())
            .env("SLURM_ARRAY_TASK_MIN", first.to_string())
            .env("SLURM_ARRAY_TASK_COUNT", "3")
            .env("SLURM_CPUS_PER_TASK", "1");
        command.output().unwrap()
    };
    for (first, parts) in [(0, "from-zero"), (1, "from-one")] {
        for index in first..first + 3 {
            let output = task(index, first, parts);
            let errors = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.success(), "{errors}");
        }
        agrees(&lab, parts, &whole);
    }
    let checked = Command::new("bash").arg("-n").arg(&script).status();
    assert!(checked.unwrap().success());
    let outside = Command::new("bash")
        .arg(&script)
        .args(["study.toml", "p"])
        .output();
    let message = String::from_utf8_lossy(&outside.unwrap().stderr).into_owned();
    assert!(message.contains("submit it with sbatch"), "{message}");
}

#[test]
fn an_indexed_job_of_kubernetes_makes_the_same_study() {
    let (lab, whole) = lab();
    let text = std::fs::read_to_string(example("kubernetes.yaml")).unwrap();
    let job: Value = serde_yaml_ng::from_str(&text).unwrap();
    assert_eq!(
        (&job["apiVersion"], &job["kind"]),
        (&"batch/v1".into(), &"Job".into())
    );
    let spec = &job["spec"];
    assert_eq!(spec["completionMode"], "Indexed");
    let pod = &spec["template"]["spec"];
    // A pod of a job may not be restarted always; limits of each index need `Never`.
    assert_eq!(pod["restartPolicy"], "Never");
    assert!(spec["backoffLimitPerIndex"].as_u64().unwrap() > 0);
    let shard = &pod["containers"][0];
    let mounted = &shard["volumeMounts"][0];
    assert_eq!(mounted["name"], pod["volumes"][0]["name"]);
    let words = |key: &str| -> Vec<String> {
        let words = shard[key].as_array().unwrap().iter();
        words
            .map(|word| word.as_str().unwrap().to_owned())
            .collect()
    };
    let all = [words("command"), words("args")].concat();
    let version = concat!("northing:", env!("CARGO_PKG_VERSION"));
    assert_eq!(
        (all[0].as_str(), shard["image"].as_str().unwrap()),
        ("northing", version)
    );
    let shards = all.iter().position(|word| word == "--shards").unwrap();
    let completions = spec["completions"].as_u64().unwrap();
    assert_eq!(all[shards + 1], completions.to_string());
    // Kubernetes replaces $(NAME) by the variable, which is the annotation of the index.
    assert_eq!(shard["env"][0]["name"], "JOB_COMPLETION_INDEX");
    let path = mounted["mountPath"].as_str().unwrap();
    for index in 0..completions {
        let index = index.to_string();
        let word = |word: &String| {
            let word = word.replace(&format!("{path}/"), "");
            word.replace("$(JOB_COMPLETION_INDEX)", &index)
        };
        let words: Vec<String> = all[1..].iter().map(word).collect();
        assert!(words.contains(&index), "{words:?}");
        lab.succeeds(&words.iter().map(String::as_str).collect::<Vec<_>>());
    }
    agrees(&lab, "parts", &whole);
}
