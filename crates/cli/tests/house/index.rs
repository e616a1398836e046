//! `docs/INDEX.md`: every source file with the first sentence of its header, made from the files themselves.
//!
//! `NORTHING_BLESS=1 cargo test -p northing --test house` writes it anew.

use std::fmt::Write as _;

use crate::{README, estimators, files, root};

/// Folders that are indexed, and the endings of their files.
const INDEXED: [(&str, &[&str]); 3] = [
    ("crates", &[".rs"]),
    ("firmware", &[".rs"]),
    ("web", &[".ts", ".tsx"]),
];

const HEAD: &str = "\
# Index of the source files

Every file with the first sentence of its header. Made by `NORTHING_BLESS=1 cargo test -p northing --test house`, which without
the variable fails when this page is out of date.
";

/// Whether a path is one that people look for: sources, without tests, benchmarks and what is used while developing.
fn is_indexed(path: &str) -> bool {
    let in_sources =
        path.contains("/src/") || path.starts_with("web/lab/") || path.starts_with("web/phone/");
    let is_test = ["/tests/", "/tests.rs", "_tests.rs", "/test_", ".d.ts"]
        .iter()
        .any(|test| path.contains(test));
    in_sources && (!is_test || path.starts_with("firmware/tests/"))
}

/// The first sentence of a header: of its first paragraph, without the signs of a comment.
pub(crate) fn first_sentence(source: &str) -> Option<String> {
    let lines = source.lines().map(|line| {
        ["//!", "//"]
            .iter()
            .find_map(|sign| line.strip_prefix(sign))
    });
    let paragraph = lines.map_while(|line| line.map(str::trim).filter(|line| !line.is_empty()));
    let paragraph = paragraph.collect::<Vec<_>>().join(" ");
    let end = paragraph.find(". ").map_or(paragraph.len(), |end| end + 1);
    (!paragraph.is_empty()).then(|| paragraph[..end].to_owned())
}

/// The page, from pairs of path and text in the order of the paths; what is wrong where a file has no header.
fn index<'a>(sources: impl Iterator<Item = (&'a str, &'a str)>) -> Result<String, String> {
    let mut page = HEAD.to_owned();
    let mut folder = "";
    for (path, text) in sources {
        let sentence = first_sentence(text).ok_or_else(|| format!("{path}: no first line"))?;
        let (own, name) = path.rsplit_once('/').unwrap_or_default();
        if own != folder {
            folder = own;
            let _ = write!(page, "\n## {own}\n\n| file | |\n|---|---|\n");
        }
        // A vertical line would end the cell; links of rustdoc lead nowhere here.
        let sentence = sentence
            .replace('|', "\\|")
            .replace("[`", "`")
            .replace("`]", "`");
        let _ = writeln!(page, "| [{name}](../{path}) | {sentence} |");
    }
    Ok(page)
}

/// The page as the files want it.
pub(crate) fn fresh() -> String {
    let mut sources = Vec::new();
    for (folder, endings) in INDEXED {
        for path in endings
            .iter()
            .flat_map(|ending| files(&root().join(folder), ending))
        {
            let name = path
                .strip_prefix(root())
                .unwrap()
                .to_str()
                .unwrap()
                .replace('\\', "/");
            if is_indexed(&name) {
                sources.push((name, std::fs::read_to_string(path).unwrap()));
            }
        }
    }
    // Folder by folder, `mod.rs` and the like where the alphabet puts them.
    sources.sort_by(|(a, _), (b, _)| a.rsplit_once('/').cmp(&b.rsplit_once('/')));
    let sources = sources
        .iter()
        .map(|(path, text)| (path.as_str(), text.as_str()));
    index(sources).unwrap()
}

#[test]
fn the_index_is_as_the_files_say() {
    let page = root().join("docs/INDEX.md");
    let fresh = fresh();
    if std::env::var_os("NORTHING_BLESS").is_some() {
        std::fs::write(&page, &fresh).unwrap();
    }
    let written = std::fs::read_to_string(&page).unwrap_or_default();
    let differs = |(fresh, written): &(&str, &str)| fresh != written;
    let mut lines = fresh.lines().chain([""]).zip(written.lines().chain([""]));
    let first = lines.find(differs);
    assert!(
        written == fresh,
        "docs/INDEX.md is out of date at {first:?}; NORTHING_BLESS=1 cargo test -p northing --test house writes it"
    );
}

#[test]
fn headers_are_read_up_to_their_first_sentence() {
    let header = "//! One: [`two`] | three\n//! four. Five.\n//!\n//! Six\n";
    assert_eq!(
        first_sentence(header).unwrap(),
        "One: [`two`] | three four."
    );
    assert_eq!(first_sentence("// Short\nuse x;").unwrap(), "Short");
    assert_eq!(first_sentence("use x;\n//! late"), None);
    let page = index([("a/src/b.rs", header)].into_iter()).unwrap();
    assert!(page.ends_with("| [b.rs](../a/src/b.rs) | One: `two` \\| three four. |\n"));
    assert_eq!(
        index([("b.rs", "use x;")].into_iter()).unwrap_err(),
        "b.rs: no first line"
    );
    for (path, wanted) in [
        ("crates/a/src/b.rs", true),
        ("crates/a/src/b/tests.rs", false),
        ("crates/a/benches/b.rs", false),
        ("web/lab/chart.tsx", true),
    ] {
        assert_eq!(is_indexed(path), wanted, "{path}");
    }
}

/// Estimators that neither page mentions as `` `name` ``.
fn unlisted<'a>(pages: [&str; 2], estimators: &'a [String]) -> Vec<&'a String> {
    let listed = |name: &&String| pages.iter().any(|page| page.contains(&format!("`{name}`")));
    estimators.iter().filter(|name| !listed(name)).collect()
}

#[test]
fn every_estimator_is_in_the_readme_or_in_the_index() {
    let index = std::fs::read_to_string(root().join("docs/INDEX.md")).unwrap();
    let estimators = estimators();
    assert!(estimators.len() >= 6, "{estimators:?}");
    assert_eq!(unlisted([README, &index], &estimators), [""; 0]);
    assert_eq!(
        unlisted(["a `mekf`", ""], &["mekf".into(), "usque".into()]),
        ["usque"]
    );
}

/// Commands of the program that a page does not name in backquotes.
fn unnamed<'a>(page: &str, commands: &'a [String]) -> Vec<&'a String> {
    let named = |command: &&String| page.contains(&format!("`{command}`"));
    commands.iter().filter(|command| !named(command)).collect()
}

#[test]
fn the_readme_names_every_command() {
    let commands = crate::language::commands(&[]);
    assert!(commands.len() > 10, "{commands:?}");
    assert_eq!(unnamed(README, &leaves(commands)), [""; 0]);
    assert_eq!(unnamed("`run`", &["run".into(), "tune".into()]), ["tune"]);
}

/// `calibrate` is named by what stands below it; the others by themselves.
fn leaves(commands: Vec<String>) -> Vec<String> {
    let parts = |command: String| {
        if command != "calibrate" {
            return vec![command];
        }
        let below = crate::language::commands(&[&command]);
        below
            .iter()
            .map(|part| format!("{command} {part}"))
            .collect()
    };
    commands.into_iter().flat_map(parts).collect()
}
