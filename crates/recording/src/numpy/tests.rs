use super::*;
use proptest::prelude::*;
use std::io::{Cursor, Write};

/// An array as NumPy writes it.
fn npy(descr: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), data].concat()
}

fn reals(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn read(bytes: &[u8]) -> Result<Array> {
    let (length, limit) = (bytes.len() as u64, limits::unpacked(0));
    Array::read(&mut Cursor::new(bytes), length, &mut 0, limit, "a.npy")
}

fn text(bytes: Vec<u8>) -> Result<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table");
    std::fs::write(&path, bytes).unwrap();
    let mut text = Vec::new();
    open_table(&path, "table")?.read_to_end(&mut text).unwrap();
    Ok(String::from_utf8_lossy(&text).into_owned())
}

fn npz(members: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in members {
        archive
            .start_file(*name, zip::write::SimpleFileOptions::default())
            .unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

#[test]
fn numbers_of_all_kinds_are_read_as_they_are() {
    let integers =
        |descr, bytes: &[u8]| match read(&npy(descr, "False", "(1,)", bytes)).unwrap().values {
            Values::Integers(v) => v[0],
            Values::Reals(v) => panic!("{v:?}"),
        };
    assert_eq!(integers("<i2", &[0xfe, 0xff]), -2);
    assert_eq!(integers(">i4", &[0xff, 0xff, 0xff, 0x00]), -256);
    assert_eq!(integers("|u1", &[200]), 200);
    assert_eq!(integers("|b1", &[1]), 1);
    let big = 1_700_000_000_123_456_789_i64;
    assert_eq!(integers("<i8", &big.to_le_bytes()), big);
    assert_eq!(integers("<M8[ns]", &big.to_le_bytes()), big);
    let real = |descr, bytes: &[u8]| read(&npy(descr, "False", "()", bytes)).unwrap();
    let array = real(">f4", &0.1_f32.to_be_bytes());
    assert_eq!(
        (array.shape, array.number(0)),
        ([1, 1], Some(f64::from(0.1_f32)))
    );
    let by_columns = npy(
        "<f8",
        "True",
        "(2, 3)",
        &reals(&[1.0, 4.0, 2.0, 5.0, 3.0, 6.0]),
    );
    let by_rows = npy(
        "<f8",
        "False",
        "(2, 3)",
        &reals(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
    );
    assert_eq!(read(&by_columns).unwrap(), read(&by_rows).unwrap());
}

#[test]
fn what_is_no_array_of_numbers_is_refused_with_the_reason() {
    let said = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
    let whole = npy("<f8", "False", "(2, 3)", &reals(&[0.0; 6]));
    for length in 0..whole.len() {
        assert!(said(&whole[..length]).contains("damaged"), "{length}");
    }
    assert!(said(&npy("<f8", "False", "(1, 2, 3)", &reals(&[0.0; 6]))).contains("3 axes"));
    assert!(said(&npy("<U5", "False", "(1,)", &[0; 20])).contains("`<U5`"));
    let huge = npy("<f8", "False", "(9999999999999, 9999999999999)", &[]);
    assert!(said(&huge).contains("shorter than its header"));
    let fields = b"{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,), }";
    let fields = [b"\x93NUMPY\x01\0", &[fields.len() as u8, 0][..], fields].concat();
    assert!(said(&fields).contains("named fields"));
}

#[test]
fn arrays_are_a_table_with_a_row_a_sample() {
    let gyr: Vec<f64> = (0..90).map(f64::from).collect();
    let mut stamps: Vec<i64> = (0..30).map(|row| 10 * row).collect();
    stamps[2] = i64::MIN;
    let stamps: Vec<u8> = stamps.iter().flat_map(|x| x.to_le_bytes()).collect();
    let made = npz(&[
        ("t.npy", npy("<M8[ms]", "False", "(30,)", &stamps)),
        // A column for each sample.
        ("gyr.npy", npy("<f8", "False", "(3, 30)", &reals(&gyr))),
        ("note.npy", npy("<U1", "False", "()", &[0; 4])),
        ("R.npy", npy("<f8", "False", "(3, 3)", &reals(&[0.0; 9]))),
        ("rate.npy", npy("<f8", "False", "()", &reals(&[50.0]))),
    ]);
    let expected = "t (ms),gyr_x,gyr_y,gyr_z\n0,0.0,30.0,60.0\n10,1.0,31.0,61.0\n,2.0,32.0,62.0\n30,3.0,33.0,63.0\n";
    let made = text(made).unwrap();
    assert!(
        made.starts_with(expected) && made.lines().count() == 31,
        "{made}"
    );
    let counted = npz(&[
        ("fs.npy", npy("<i8", "False", "()", &50_i64.to_le_bytes())),
        (
            "acc.npy",
            npy(
                "<f8",
                "False",
                "(2, 3)",
                &reals(&[1.0, f64::NAN, 3.0, 4.0, 5.0, 6.0]),
            ),
        ),
    ]);
    assert_eq!(
        text(counted).unwrap(),
        "time (s) by fs,acc_x,acc_y,acc_z\n0.0,1.0,,3.0\n0.02,4.0,5.0,6.0\n"
    );
    // One array is named by its file.
    let alone = npy("<f8", "False", "(1, 3)", &reals(&[1.0, 2.0, 3.0]));
    assert_eq!(text(alone).unwrap(), "x,y,z\n1.0,2.0,3.0\n");
    assert_eq!(text(b"a,b\n1,2\n".to_vec()).unwrap(), "a,b\n1,2\n");
}

#[test]
fn sensors_of_different_rates_are_not_put_side_by_side() {
    let array = |rows: usize| {
        npy(
            "<f8",
            "False",
            &format!("({rows}, 3)"),
            &reals(&vec![0.0; 3 * rows]),
        )
    };
    let made = npz(&[("gyr.npy", array(500)), ("mag.npy", array(100))]);
    let said = text(made).unwrap_err().to_string();
    assert!(said.contains("gyr 500 x 3, mag 100 x 3"), "{said}");
}

proptest! {
    #[test]
    fn any_bytes_are_an_array_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..300), at in 0..80_usize) {
        let mut array = npy("<f8", "False", "(3, 3)", &reals(&[0.5; 9]));
        let _ = read(&bytes);
        array.splice(at..at, bytes);
        let _ = read(&array);
        let _ = text(array);
    }
}
