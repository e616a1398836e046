//! Rules that a machine can check: dependencies point down, the index is that of the files, links lead
//! somewhere, cited equations exist, terms are those of the glossary, and nothing names a path outside.
//!
//! Each rule is a function from text to complaints, tried on a bad example as well as on the repository.

#![allow(clippy::unwrap_used)]

mod index;
mod language;
mod readme_numbers;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const README: &str = include_str!("../../../../README.md");
const DERIVATION: &str = include_str!("../../../../docs/derivations/mekf.md");

fn root() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    root.canonicalize().unwrap()
}

/// Every file below `folder` whose path ends in `ending`; build output and hidden folders are left
/// out, except `.ci`, and so is the `.git` of a worktree, which is a file.
fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for path in entries.map(|entry| entry.unwrap().path()) {
        let name = path.file_name().unwrap().to_string_lossy();
        let hidden = name.starts_with('.') && name != ".ci";
        if path.is_dir()
            && !hidden
            && !name.starts_with("target")
            && name != "node_modules"
            && name != "dist"
        {
            found.extend(files(&path, ending));
        } else if path.is_file() && name != ".git" && name.ends_with(ending) {
            found.push(path);
        }
    }
    found
}

/// Applies a rule to the text of each file and fails with all its complaints.
fn check(paths: Vec<PathBuf>, at_least: usize, rule: impl Fn(&Path, &str) -> Vec<String>) {
    assert!(paths.len() >= at_least, "found only {paths:?}");
    let mut complaints = String::new();
    for path in paths {
        // Pictures and recordings are not text.
        let text = String::from_utf8(fs::read(&path).unwrap()).unwrap_or_default();
        for complaint in rule(&path, &text) {
            complaints += &format!("\n{}: {complaint}", path.display());
        }
    }
    assert!(complaints.is_empty(), "{complaints}\n");
}

/// The floor of one of our crates.
fn floor(name: &str) -> Option<u8> {
    match name {
        "northing-core" | "northing-pages" => Some(0),
        "northing-recording" | "northing-simulation" | "northing-c" => Some(1),
        "northing-evaluation" => Some(2),
        "northing-experiments" => Some(3),
        "northing-report" => Some(4),
        "northing-live" | "northing-ros" | "northing-foxglove" => Some(5),
        "northing" | "northing-python" => Some(6),
        _ => None,
    }
}

fn may_use(user: &str, used: &str) -> bool {
    // A virtual phone writes recordings: the one step sideways (docs/decisions/0001).
    let sideways = user == "northing-simulation" && used == "northing-recording";
    let below = floor(user).zip(floor(used)).map(|(user, used)| used < user);
    below.is_some_and(|below| below || sideways)
}

/// Without a line in the manifest no `use` line compiles, so the manifests say it all.
fn upward_dependencies(manifest: &str) -> Vec<String> {
    let manifest: toml::Table = manifest.parse().unwrap();
    let user = manifest["package"]["name"].as_str().unwrap();
    let sections = ["dependencies", "dev-dependencies", "build-dependencies"];
    let tables = sections
        .iter()
        .filter_map(|name| manifest.get(*name)?.as_table());
    let ours = tables.flat_map(|table| table.keys().filter(|used| used.starts_with("northing")));
    let upward = ours.filter(|used| !may_use(user, used));
    upward
        .map(|used| format!("{user} must not use {used}"))
        .collect()
}

#[test]
fn dependencies_point_down() {
    let manifests = files(&root().join("crates"), "Cargo.toml");
    check(manifests, 5, |_, manifest| upward_dependencies(manifest));
}

#[test]
fn an_upward_dependency_is_seen() {
    let manifest = |user: &str, section: &str, used: &str| {
        upward_dependencies(&format!(
            "[package]\nname = '{user}'\n[{section}]\n{used} = '1'"
        ))
    };
    let upward = manifest(
        "northing-recording",
        "dev-dependencies",
        "northing-evaluation",
    );
    assert_eq!(
        upward,
        ["northing-recording must not use northing-evaluation"]
    );
    let without_a_floor = manifest("northing-new", "dependencies", "northing-core");
    assert_eq!(without_a_floor.len(), 1);
    let sideways = manifest("northing-simulation", "dependencies", "northing-recording");
    assert!(sideways.is_empty());
}

/// Crates whose folders are rooms on floors, too.
const FLOORED: [&str; 4] = ["evaluation", "experiments", "report", "cli"];

/// The folders, or files, below a crate's `src` that a source file names by `crate::`.
fn named_rooms(source: &str) -> impl Iterator<Item = &str> {
    let code = source.lines().map(str::trim);
    let code = code.filter(|line| !line.starts_with("//"));
    let after = code.flat_map(|line| line.split("crate::").skip(1));
    after.filter_map(|rest| {
        rest.split(|c: char| !c.is_alphanumeric() && c != '_')
            .next()
    })
}

/// Which room uses which: `(user, used)`.
fn arrows(sources: &Path) -> Vec<(String, String)> {
    let mut arrows = Vec::new();
    for path in files(sources, ".rs") {
        let below = path.strip_prefix(sources).unwrap();
        let first = below.iter().next().unwrap().to_string_lossy();
        let user = first.trim_end_matches(".rs").to_owned();
        let text = fs::read_to_string(&path).unwrap();
        let rooms = named_rooms(&text).filter(|used| *used != user);
        // A name of the crate's own face is no room.
        let rooms = rooms.filter(|used| {
            sources.join(used).is_dir() || sources.join(format!("{used}.rs")).is_file()
        });
        arrows.extend(rooms.map(|used| (user.clone(), used.to_owned())));
    }
    arrows.sort();
    arrows.dedup();
    arrows
}

/// Rooms that lie on a circle: those that are left when rooms that use nothing are taken away, again and again.
fn circle(mut arrows: Vec<(String, String)>) -> Vec<(String, String)> {
    loop {
        let before = arrows.len();
        let users: Vec<String> = arrows.iter().map(|(user, _)| user.clone()).collect();
        arrows.retain(|(_, used)| users.contains(used));
        let used: Vec<String> = arrows.iter().map(|(_, used)| used.clone()).collect();
        arrows.retain(|(user, _)| used.contains(user));
        if arrows.len() == before {
            return arrows;
        }
    }
}

#[test]
fn no_circle_between_folders() {
    let mut seen = 0;
    for krate in FLOORED {
        let sources = root().join("crates").join(krate).join("src");
        let arrows = arrows(&sources);
        seen += arrows.len();
        assert_eq!(circle(arrows), [], "{krate}");
    }
    assert!(seen > 20, "only {seen} arrows in all: are they read?");
    let arrow = |a: &str, b: &str| (a.to_owned(), b.to_owned());
    let ring = vec![
        arrow("a", "b"),
        arrow("b", "c"),
        arrow("c", "b"),
        arrow("c", "d"),
    ];
    assert_eq!(circle(ring), [arrow("b", "c"), arrow("c", "b")]);
    assert_eq!(
        named_rooms("// crate::a\nuse crate::b::C; crate::d_e::f()").collect::<Vec<_>>(),
        ["b", "d_e"]
    );
}

const QUESTIONS: [&str; 3] = ["attitude", "navigation", "tracking"];

/// Lines of code in core's folder `own` that reach into another question's folder.
fn questions_mixed(own: &str, source: &str) -> Vec<String> {
    let code = source
        .lines()
        .map(str::trim)
        .filter(|line| !line.starts_with("//"));
    let mixes = |line: &&str| {
        let others = QUESTIONS.iter().filter(|other| **other != own);
        let mut paths = others.flat_map(|o| [format!("crate::{o}"), format!("super::{o}")]);
        // Alignment may start from TRIAD, wherever it is needed.
        paths.any(|path| line.contains(&path)) && !line.contains("attitude::wahba")
    };
    code.filter(mixes).map(str::to_owned).collect()
}

#[test]
fn core_keeps_its_questions_apart() {
    for own in QUESTIONS {
        let sources = files(&root().join("crates/core/src").join(own), ".rs");
        check(sources, 0, |_, source| questions_mixed(own, source));
    }
    let bad = "use crate::navigation::strapdown;";
    assert_eq!(questions_mixed("tracking", bad), [bad]);
    assert!(questions_mixed("navigation", "use crate::attitude::wahba;").is_empty());
}

/// Targets of the links `[...](target)` in a page.
fn links(markdown: &str) -> impl Iterator<Item = &str> {
    let after = markdown.split("](").skip(1);
    after.filter_map(|rest| rest.split(')').next())
}

/// Links to files that are not there.
fn dead_links(page: &Path, markdown: &str) -> Vec<String> {
    let folder = page.parent().unwrap();
    let local = links(markdown).filter(|link| !link.contains("://") && !link.starts_with('#'));
    let dead = local.filter(|link| !folder.join(link.split('#').next().unwrap()).exists());
    dead.map(|link| format!("no such file: {link}")).collect()
}

#[test]
fn links_lead_to_files() {
    check(files(&root(), ".md"), 5, dead_links);
    let bad = dead_links(&root().join("README.md"), "see [x](no/such/file.rs)");
    assert_eq!(bad, ["no such file: no/such/file.rs"]);
}

/// Source files that a page names in backquotes from the root on, and that are not there. Capitals are placeholders.
fn dead_names(markdown: &str) -> Vec<String> {
    let quoted = markdown.split('`').skip(1).step_by(2);
    let path = |text: &&str| {
        text.starts_with("crates/")
            && text.ends_with(".rs")
            && !text.contains(|c: char| c.is_uppercase())
    };
    let dead = quoted
        .filter(path)
        .filter(|path| !root().join(path).exists());
    dead.map(|path| format!("no such file: {path}")).collect()
}

#[test]
fn files_that_pages_name_exist() {
    check(files(&root(), ".md"), 5, |_, page| dead_names(page));
    let bad = "see `crates/no.rs`, not `crates/NAME.rs`, `crates/cli/src/main.rs` or crates/x.rs";
    assert_eq!(dead_names(bad), ["no such file: crates/no.rs"]);
}

/// The estimators that the program itself lists.
fn estimators() -> Vec<String> {
    let mut program = Command::new(env!("CARGO_BIN_EXE_northing"));
    let output = program.args(["estimators", "--json"]).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let list = document
        .as_array()
        .or_else(|| document["estimators"].as_array());
    let names = list
        .unwrap()
        .iter()
        .map(|e| e["name"].as_str().unwrap().to_owned());
    names.collect()
}

/// Equation numbers such as `M14b` in the comments of a source file that cites the derivation.
fn cited_equations(source: &str) -> Vec<&str> {
    let lines = source.lines().map(str::trim_start);
    let comments = lines.filter(|line| line.starts_with("//"));
    let tokens = comments.flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && c != '-'));
    // "M9-M13" is a range of equations, "Cortex-M3" is a processor.
    let words = tokens
        .filter(|token| !token.starts_with("Cortex"))
        .flat_map(|t| t.split('-'));
    let numbered = |word: &&str| {
        let number = word.strip_prefix('M').unwrap_or_default();
        number.starts_with(|c: char| c.is_ascii_digit())
    };
    words.filter(numbered).collect()
}

fn unknown_equations(source: &str) -> Vec<String> {
    if !source.contains("derivations/mekf.md") {
        return Vec::new();
    }
    let known = |equation: &&str| DERIVATION.contains(&format!("\\tag{{{equation}}}"));
    let unknown = cited_equations(source)
        .into_iter()
        .filter(|equation| !known(equation));
    unknown
        .map(|equation| format!("({equation}) is not in the derivation"))
        .collect()
}

#[test]
fn cited_equations_exist_in_the_derivation() {
    check(files(&root().join("crates"), ".rs"), 20, |_, s| {
        unknown_equations(s)
    });
    let bad = "//! docs/derivations/mekf.md (M9-M14b), (M99) on a Cortex-M3\nlet m = M6;";
    assert_eq!(cited_equations(bad), ["M9", "M14b", "M99"]);
    assert_eq!(unknown_equations(bad), ["(M99) is not in the derivation"]);
}

/// Lines that name folders beside the repository, which a reader does not have.
fn outside_paths(text: &str) -> Vec<String> {
    let forbidden = [concat!("../", "shared"), concat!("/wo", "rk/")];
    let names_one = |line: &&str| forbidden.iter().any(|path| line.contains(path));
    text.lines().filter(names_one).map(str::to_owned).collect()
}

#[test]
fn nothing_names_a_path_outside_the_repository() {
    let mut paths = files(&root(), "");
    // `.git` is a file in a working tree of its own.
    paths.retain(|path| !path.ends_with(".ci/run") && !path.ends_with(".git"));
    check(paths, 50, |_, text| outside_paths(text));
    let bad = concat!("see ../", "shared/data");
    assert_eq!(outside_paths(bad), [bad]);
}
