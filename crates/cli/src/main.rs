//! `northing`: the program.
fn main() {}
