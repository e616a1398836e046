//! README's accuracies are those of `docs/results`, whose tables commands make.

use std::fs;

use crate::{README, files, root};

/// Units of what one computer measured at one time: no table is made anew with the same number.
const TIMES: [&str; 2] = ["us", "million samples/s"];

/// The bold numbers of README's table of results, without their units, but those of times.
fn claimed(readme: &str) -> Vec<String> {
    let table = readme
        .lines()
        .skip_while(|line| !line.starts_with("## How accurate"));
    let rows = table.skip(1).take_while(|line| !line.starts_with("## "));
    let cells = rows.filter_map(|row| row.strip_prefix('|')?.split('|').nth(1));
    let bold = cells.filter_map(|cell| cell.trim().strip_prefix("**")?.strip_suffix("**"));
    let numbers = bold.filter_map(|text| {
        let (number, unit) = text.split_once(' ').unwrap_or((text, ""));
        (!TIMES.contains(&unit)).then(|| number.to_owned())
    });
    numbers.collect()
}

/// Whether a text has a number as a whole one.
fn has(text: &str, number: &str) -> bool {
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    text.match_indices(number).any(|(at, _)| {
        let before = text[..at].chars().next_back();
        let after = text[at + number.len()..].chars().next();
        !before.is_some_and(is_part) && !after.is_some_and(|c| c.is_ascii_digit())
    })
}

#[test]
fn accuracies_of_readme_are_in_the_tables_of_results() {
    let bad = "## How accurate\n| a | **1.5 deg** | x |\n| b | **2.0 us** | |\n| c | **3** | |\n## Next\n| d | **9** |";
    assert_eq!(claimed(bad), ["1.5", "3"]);
    assert!(has("| 1.5 |", "1.5") && !has("| 11.5 | 1.55 |", "1.5"));

    let pages: Vec<String> = files(&root().join("docs/results"), ".md")
        .into_iter()
        .map(|path| fs::read_to_string(path).unwrap())
        .collect();
    let claims = claimed(README);
    assert!(claims.len() >= 7, "{claims:?}");
    for number in claims {
        let found = pages.iter().any(|page| has(page, &number));
        assert!(found, "README says {number}, no table of docs/results does");
    }
}
