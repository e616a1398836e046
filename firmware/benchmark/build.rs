//! Tells the linker where memory is.

use std::path::Path;
use std::{env, fs};

fn main() {
    let layout = include_bytes!("../layout/benchmark.x");
    let out = env::var_os("OUT_DIR").expect("cargo sets OUT_DIR");
    let folder = Path::new(&out);
    fs::write(folder.join("memory.x"), layout).expect("OUT_DIR can be written");
    println!("cargo:rustc-link-search={}", folder.display());
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rerun-if-changed=../layout/benchmark.x");
}
