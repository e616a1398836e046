//! The program and its arguments as they were typed, for commands that people may copy.

/// The program as it was called, for commands that people may copy: its path, or `northing`.
pub(crate) fn called() -> String {
    let path = std::env::args_os()
        .next()
        .map(|path| path.to_string_lossy().into_owned());
    path.filter(|path| path.contains('/') && !path.contains(' '))
        .unwrap_or_else(|| "northing".to_owned())
}

/// The command as it was typed, for people who want to give it again.
pub(crate) fn command_line() -> String {
    let arguments = std::env::args_os().skip(1);
    let words = arguments.map(|word| quoted(&word.to_string_lossy()));
    std::iter::once("northing".to_owned())
        .chain(words)
        .collect::<Vec<_>>()
        .join(" ")
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn words_are_quoted_where_a_shell_would_split_or_change_them() {
        assert_eq!(quoted("--set"), "--set");
        assert_eq!(quoted("walk one.csv"), "'walk one.csv'");
        assert_eq!(quoted("it's.csv"), r"'it'\''s.csv'");
        assert_eq!(quoted("$HOME"), "'$HOME'");
        assert_eq!(quoted(""), "''");
    }
}
