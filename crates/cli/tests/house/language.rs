//! The language: words that `docs/glossary.md` retires do not stand where people look for a term.

use std::path::Path;
use std::process::Command;

use crate::{README, check, files, index, root};

const GLOSSARY: &str = include_str!("../../../../docs/glossary.md");

/// The last table of the glossary: what is retired, and what is said instead.
fn retired(glossary: &str) -> Vec<(&str, &str)> {
    let section = glossary
        .split("\n## Retired words")
        .nth(1)
        .unwrap_or_default();
    let rows = section.lines().filter(|line| line.starts_with("| "));
    let cells = rows
        .skip(1)
        .filter_map(|row| row.trim_matches('|').split_once('|'));
    cells.map(|(old, new)| (old.trim(), new.trim())).collect()
}

/// The words of a text or of names in it: lower case, `CamelCase` and `snake_case` taken apart. Punctuation is a
/// word of its own, for no term goes on beyond it; not so the slashes of comments.
fn words(text: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for c in text.chars() {
        if !c.is_ascii_alphanumeric() || (c.is_ascii_uppercase() && before.is_ascii_lowercase()) {
            words.push(String::new());
        }
        let joins = "/_".contains(c) || (c == '-' && before != ' ');
        if c.is_ascii_punctuation() && !joins {
            words.extend([c.to_string(), String::new()]);
        }
        if c.is_ascii_alphanumeric() {
            words.last_mut().unwrap().push(c.to_ascii_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Retired words in a text, with what to say instead. What begins with `_` is the end of a name.
fn old_words(text: &str) -> Vec<String> {
    let said = words(text);
    let stands = |old: &str| {
        let mut names = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
        let old_words = words(old);
        match old.starts_with('_') {
            true => names.any(|name| name.ends_with(old)),
            false => said.windows(old_words.len()).any(|part| part == old_words),
        }
    };
    let found = retired(GLOSSARY).into_iter().filter(|(old, _)| stands(old));
    found
        .map(|(old, new)| format!("`{old}`: say {new}"))
        .collect()
}

#[test]
fn a_retired_word_is_seen_and_good_english_is_not() {
    assert!(retired(GLOSSARY).len() > 30);
    for bad in [
        "R is honest",
        "fixes that are\n  withheld",
        "SideStates",
        "position_white_share",
        "rate_dps",
        "PoseMemory",
    ] {
        assert_eq!(old_words(bad).len(), 1, "{bad}");
    }
    for good in [
        "held-out fixes",
        "beside the states",
        "a field",
        "calibrate magnetometer",
        "the board mps2-an385",
        "honestly",
    ] {
        assert_eq!(old_words(good), [""; 0], "{good}");
    }
}

/// What the program says to `arguments`, on standard output.
fn said(arguments: &[&str]) -> String {
    let mut program = Command::new(env!("CARGO_BIN_EXE_northing"));
    let output = program.args(arguments).arg("--help").output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The commands below one, as its help lists them.
pub(crate) fn commands(path: &[&str]) -> Vec<String> {
    let help = said(path);
    let list = help.split("\nCommands:\n").nth(1).unwrap_or_default();
    let rows = list.lines().take_while(|line| !line.is_empty());
    let names = rows.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names = names.filter_map(|line| line.split_whitespace().next());
    names.map(str::to_owned).collect()
}

/// Complaints about the help of a command and of all below it.
fn complaints_about_help(path: &[&str]) -> Vec<String> {
    let name = path.join(" ");
    let mut complaints = old_words(&said(path));
    complaints
        .iter_mut()
        .for_each(|old| *old = format!("northing {name} --help: {old}"));
    for command in commands(path) {
        let below = [path, &[&command]].concat();
        complaints.extend(complaints_about_help(&below));
    }
    complaints
}

#[test]
fn help_and_front_pages_use_the_terms_of_the_glossary() {
    let mut complaints = complaints_about_help(&[]);
    for (page, text) in [
        ("README.md", README),
        ("first lines of files", &index::fresh()),
    ] {
        complaints.extend(
            old_words(text)
                .into_iter()
                .map(|old| format!("{page}: {old}")),
        );
    }
    assert!(complaints.is_empty(), "\n{}\n", complaints.join("\n"));
}

/// Public names of a source file: items, and fields, which are keys of what is serialised.
fn public_names(source: &str) -> Vec<&str> {
    let product = source
        .split("#[cfg(test)]\nmod tests {")
        .next()
        .unwrap_or_default();
    let lines = product.lines().map(str::trim_start);
    let after = lines.filter_map(|line| line.strip_prefix("pub "));
    let kinds = [
        "const fn ",
        "async fn ",
        "fn ",
        "const ",
        "static ",
        "struct ",
        "enum ",
        "trait ",
        "type ",
        "mod ",
    ];
    after
        .filter(|line| !line.starts_with("use "))
        .map(|line| {
            let name = kinds
                .iter()
                .find_map(|kind| line.strip_prefix(kind))
                .unwrap_or(line);
            name.split(|c: char| !c.is_alphanumeric() && c != '_')
                .next()
                .unwrap_or_default()
        })
        .collect()
}

fn old_names(_: &Path, source: &str) -> Vec<String> {
    let names = public_names(source).into_iter();
    let complaints = names.flat_map(|name| {
        old_words(name)
            .into_iter()
            .map(move |old| format!("{name}, {old}"))
    });
    complaints.collect()
}

/// Where old words stand because they are somebody's names: the rule's own examples, and columns of recordings.
fn names_old_words(path: &Path) -> bool {
    let path = path.strip_prefix(root()).unwrap();
    let exempt = ["docs/glossary.md", "crates/cli/tests/house/language.rs"];
    exempt.iter().any(|file| path == Path::new(file)) || path.starts_with("examples/recordings")
}

/// A text without the old names that are still read: aliases, units of old scenarios, and what CHANGELOG quotes.
fn without_old_names(path: &Path, text: &str) -> String {
    if path.ends_with("CHANGELOG.md") {
        let outside = text.split('`').step_by(2);
        return outside.collect::<Vec<_>>().join("` `");
    }
    let is_old = |line: &&str| {
        let marks = ["was \"", "alias = \"", "let renamed = "];
        marks.iter().any(|mark| line.contains(mark))
    };
    let is_unit = |line: &&str| path.ends_with("scenario/file.rs") && line.contains('"');
    let mut said = text.lines().collect::<Vec<_>>();
    said.retain(|line| !is_old(line) && !is_unit(line));
    said.join("\n")
}

fn old_terms(path: &Path, text: &str) -> Vec<String> {
    old_words(&without_old_names(path, text))
}

#[test]
fn no_text_of_the_repository_uses_a_retired_word() {
    let endings = [
        ".rs", ".md", ".toml", ".ts", ".tsx", ".mjs", ".css", ".html", ".py",
    ];
    let of_ending = |ending: &&str| files(&root(), ending);
    let mut texts: Vec<_> = endings.iter().flat_map(of_ending).collect();
    texts.retain(|path| !names_old_words(path));
    check(texts, 500, old_terms);

    let line = "a: T, was \"bias_wander\";\n// the honest R\n";
    assert_eq!(old_terms(Path::new("x.rs"), line).len(), 1);
    let quoted = "`consistent` (was `honest`); in hindsight";
    assert_eq!(old_terms(Path::new("CHANGELOG.md"), quoted).len(), 1);
}

#[test]
fn public_names_use_the_terms_of_the_glossary() {
    let mut sources = files(&root().join("crates"), ".rs");
    sources.retain(|path| path.components().any(|part| part.as_os_str() == "src"));
    check(sources, 100, old_names);

    let bad = "pub struct SideStates {\n    pub rate_dps: f64,\n}\nfn honest() {}\npub const fn look_back() {}";
    assert_eq!(public_names(bad), ["SideStates", "rate_dps", "look_back"]);
    assert_eq!(old_names(Path::new("x.rs"), bad).len(), 3);
}
