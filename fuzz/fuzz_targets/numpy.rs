//! Arrays of NumPy of any bytes, alone and in a zip: described and read, or refused, never a panic.
#![no_main]

use std::io::{Cursor, Write};
use std::path::Path;

use libfuzzer_sys::fuzz_target;
use northing_recording::{OpenOptions, describe, manifest};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

const MAGIC: &[u8] = b"\x93NUMPY\x01\0";

/// A header of that shape, and numbers behind it.
fn array(bytes: &[u8]) -> Vec<u8> {
    let mut numbers = bytes.iter().copied();
    let mut next = || numbers.next().unwrap_or_default();
    let kinds = [
        "<f8", "<f4", ">f8", "<i2", "<i8", "<M8[ns]", "<m8[us]", "|b1", "<f2", "<u4",
    ];
    let kind = kinds[usize::from(next()) % kinds.len()];
    let (fortran, rows, columns) = (next() % 2 == 1, next(), next() % 24);
    let fortran = if fortran { "True" } else { "False" };
    let header = format!(
        "{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': ({rows}, {columns}), }}\n"
    );
    let length = u16::try_from(header.len())
        .unwrap_or_default()
        .to_le_bytes();
    [MAGIC, &length, header.as_bytes(), bytes].concat()
}

/// Both halves as members of a zip whose checksums are right.
fn zipped(halves: [&[u8]; 2]) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, half) in ["gyr.npy", "time.npy"].into_iter().zip(halves) {
        archive.start_file(name, options).expect("a member");
        archive.write_all(half).expect("its bytes");
    }
    archive.finish().expect("a zip").into_inner()
}

fn read(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a temporary file");
    for rate_hz in [None, Some(100.0)] {
        if let Ok(draft) = describe::draft(std::slice::from_ref(&path), folder, rate_hz) {
            let place = folder.join("draft.toml");
            if let Ok(recording) =
                manifest::open_text(&draft.manifest, &place, &OpenOptions::default())
            {
                recording.map_while(Result::ok).for_each(drop);
            }
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (first, second) = bytes.split_at(bytes.len() / 2);
    read(folder.path(), "any.npy", &[MAGIC, bytes].concat());
    read(folder.path(), "shaped.npy", &array(bytes));
    read(folder.path(), "any.npz", &zipped([first, second]));
    read(
        folder.path(),
        "shaped.npz",
        &zipped([&array(first), &array(second)]),
    );
});
