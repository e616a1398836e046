//! Dotted names of parameters within groups, put together while the program is compiled.

use super::{Parameter, Range};

/// Longest dotted name.
const LONGEST: usize = 64;

/// A dotted name and its length.
type Name = ([u8; LONGEST], usize);

/// Parameters of groups, their names dotted.
#[derive(Debug)]
pub struct Grouped<const N: usize> {
    names: [Name; N],
}

impl<const N: usize> Grouped<N> {
    /// Names of the own parameters, then those of each group.
    #[must_use]
    pub const fn new(groups: &[(&str, &[Parameter])]) -> Self {
        let mut names = [([0; LONGEST], 0); N];
        let (mut next, mut group) = (0, 0);
        while group < groups.len() {
            let (of_group, parameters) = groups[group];
            let mut i = 0;
            while i < parameters.len() {
                names[next] = dotted(of_group, parameters[i].name);
                (next, i) = (next + 1, i + 1);
            }
            group += 1;
        }
        Self { names }
    }
}

const fn dotted(group: &str, name: &str) -> Name {
    let (mut bytes, mut length) = ([0; LONGEST], 0);
    let parts = [group.as_bytes(), b".", name.as_bytes()];
    let mut part = if group.is_empty() { 2 } else { 0 };
    while part < parts.len() {
        let mut i = 0;
        while i < parts[part].len() {
            bytes[length] = parts[part][i];
            (length, i) = (length + 1, i + 1);
        }
        part += 1;
    }
    (bytes, length)
}

/// The own parameters and those of the groups as one list, each under its dotted name.
#[must_use]
pub const fn join<const N: usize>(
    names: &'static Grouped<N>,
    groups: &[(&str, &[Parameter])],
) -> [Parameter; N] {
    let mut all = [BLANK; N];
    let (mut next, mut group) = (0, 0);
    while group < groups.len() {
        let parameters = groups[group].1;
        let mut i = 0;
        while i < parameters.len() {
            let (bytes, length) = &names.names[next];
            all[next] = parameters[i];
            if let Ok(name) = core::str::from_utf8(bytes.split_at(*length).0) {
                all[next].name = name;
            }
            (next, i) = (next + 1, i + 1);
        }
        group += 1;
    }
    all
}

const BLANK: Parameter = Parameter {
    name: "",
    formerly: None,
    unit: "",
    range: Range::Flag,
    meaning: "",
    note: "",
    read_by: &[],
};
