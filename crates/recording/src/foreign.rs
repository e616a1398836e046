//! Files of other programs that are not read, known by their first bytes: what they are, and how they can be had in a form that is.

/// What a file is known by.
struct Kind {
    /// What it begins with, and where that stands.
    begins: &'static [u8],
    at: usize,
    /// What it is and what to do.
    problem: &'static str,
}

const ARRAYS: &str = "arrays of NumPy, of which nothing says what they mean; `northing describe` drafts a manifest for them, `northing run \
                      --describe` runs by its guess, and `northing.attitude` in Python takes them as they are";

/// What is said of a workbook of Excel, old or new.
const EXCEL: &str = "it is a workbook of Excel, which is not read; export the recording as CSV (in phyphox: Export Data, CSV)";

const GEOJSON: &str = "GeoJSON, whose points have no times; a track with times is read as GPX, or as a table that `northing describe` looks at";

const KINDS: [Kind; 8] = [
    Kind {
        begins: b"MATLAB 5.0 MAT-file",
        at: 0,
        problem: "a file of MATLAB: in Python `scipy.io.loadmat` gives its arrays to `northing.attitude`; or save a table in MATLAB with \
                  `writetable` and let `northing describe` look at it",
    },
    Kind {
        begins: b"MATLAB 7.3 MAT-file",
        at: 0,
        problem: "a file of MATLAB: in Python `h5py` gives its arrays to `northing.attitude`; or save a table in MATLAB with `writetable` and \
                  let `northing describe` look at it",
    },
    Kind {
        begins: b"\x89HDF\r\n\x1a\n",
        at: 0,
        problem: "a file of HDF5: in Python `h5py` gives its arrays to `northing.attitude`; or save them as a table and let `northing \
                  describe` look at it",
    },
    Kind {
        begins: b"\xd0\xcf\x11\xe0",
        at: 0,
        problem: EXCEL,
    },
    Kind {
        begins: b"\x93NUMPY",
        at: 0,
        problem: ARRAYS,
    },
    Kind {
        begins: b"\xfd",
        at: 8,
        problem: TELEMETRY,
    },
    Kind {
        begins: b"\xfe",
        at: 8,
        problem: TELEMETRY,
    },
    Kind {
        begins: b"RINEX VERSION / TYPE",
        at: 60,
        problem: "raw observations of satellites (RINEX), of which no position is made here; RTKLIB makes a solution (.pos) of them, which is read",
    },
];

const TELEMETRY: &str = "telemetry of MAVLink (.tlog), which is not read; `mavlogdump.py --types HIGHRES_IMU,RAW_IMU --format csv` of pymavlink \
                         writes a table that `northing describe` can look at";

/// What a file is that begins so, and what to do.
pub(crate) fn recognised(head: &[u8]) -> Option<&'static str> {
    if head.starts_with(b"{") && String::from_utf8_lossy(head).contains("\"FeatureCollection\"") {
        return Some(GEOJSON);
    }
    let is = |kind: &&Kind| {
        let there = head.get(kind.at..);
        there.is_some_and(|there| there.starts_with(kind.begins))
            && (kind.problem != TELEMETRY || is_telemetry(head))
    };
    KINDS.iter().find(is).map(|kind| kind.problem)
}

/// What a zip with these members is, and what to do.
pub(crate) fn recognised_zip<'a>(
    members: impl IntoIterator<Item = &'a str>,
) -> Option<&'static str> {
    let members: Vec<&str> = members.into_iter().collect();
    if !members.is_empty() && members.iter().all(|name| name.ends_with(".npy")) {
        return Some(ARRAYS);
    }
    members.contains(&"xl/workbook.xml").then_some(EXCEL)
}

/// Whether messages of MAVLink follow each other, each behind its time in microseconds since 1970, the first bytes first.
fn is_telemetry(head: &[u8]) -> bool {
    /// The years in which there was MAVLink, and some to come, us.
    const TIMES_US: std::ops::Range<u64> = 1_200_000_000_000_000..4_000_000_000_000_000;
    let mut at = 0;
    for _ in 0..3 {
        let time = head.get(at..at + 8).and_then(|bytes| bytes.try_into().ok());
        let Some(time) = time.map(u64::from_be_bytes) else {
            return false;
        };
        let (Some(mark), Some(length)) = (head.get(at + 8), head.get(at + 9)) else {
            return false;
        };
        // What surrounds the payload: of version 2 with its flags, perhaps a signature.
        let around = match mark {
            0xfe => 8,
            0xfd => 12 + 13 * usize::from(head.get(at + 10).is_some_and(|flags| flags & 1 == 1)),
            _ => return false,
        };
        if !TIMES_US.contains(&time) {
            return false;
        }
        at += 8 + around + usize::from(*length);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn telemetry_is_known_by_three_messages_and_nothing_else_is_taken_for_it() {
        let message = |version: u8, length: u8| {
            let mut bytes = 1_700_000_000_000_000_u64.to_be_bytes().to_vec();
            bytes.extend([version, length]);
            let around = if version == 0xfe { 6 } else { 10 };
            bytes.resize(bytes.len() + around + usize::from(length), 0);
            bytes
        };
        for version in [0xfe, 0xfd] {
            let log: Vec<u8> = [9, 30, 62]
                .into_iter()
                .flat_map(|n| message(version, n))
                .collect();
            assert_eq!(recognised(&log), Some(TELEMETRY), "{version:x}");
            assert_eq!(recognised(&log[..40]), None);
            let mut other = log;
            other[0] = 0xff;
            assert_eq!(recognised(&other), None);
        }
    }

    #[test]
    fn others_are_known_by_their_first_bytes() {
        assert!(recognised(b"\x93NUMPY\x01\0").is_some());
        assert!(recognised(b"\x89HDF\r\n\x1a\n\0").is_some());
        let rinex = format!(
            "{:<60}RINEX VERSION / TYPE\n",
            "     3.04           OBSERVATION DATA"
        );
        assert!(recognised(rinex.as_bytes()).is_some_and(|told| told.contains("RTKLIB")));
        assert_eq!(
            recognised(b"{\"type\": \"FeatureCollection\"}"),
            Some(GEOJSON)
        );
        assert_eq!(recognised(b"t_s,a\n1,2\n"), None);
        assert_eq!(recognised(b""), None);
        assert_eq!(recognised_zip(["acc.npy", "gyr.npy"]), Some(ARRAYS));
        assert_eq!(
            recognised_zip(["[Content_Types].xml", "xl/workbook.xml"]),
            Some(EXCEL)
        );
        assert_eq!(recognised_zip(["acc.npy", "notes.txt"]), None);
        assert_eq!(recognised_zip([]), None);
    }
}
