//! Whether the messages of a topic are laid out as those of their type in ROS are: by the definition and the hash that a bag has
//! of them.
//!
//! Read first: the message definitions of ROS, and REP 2016 (hashes of types). Only the layout of bytes is compared: a package may
//! have a type of the same name with other fields, whose bytes would be read as other numbers.

use std::iter::repeat_n;

/// Numbers and texts of a type in the order of its bytes: `1`, `2`, `4`, `8` whole numbers of so many bytes, `f` and `d` single and
/// double precision, `s` a text. Behind them the hash of the type, the same in every distribution so far.
const LAYOUTS: [(&str, &str, usize, &str, &str); 10] = [
    (
        "sensor_msgs/msg/Imu",
        "",
        37,
        "",
        "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    ),
    (
        "sensor_msgs/msg/MagneticField",
        "",
        12,
        "",
        "e80f32f56a20486c9923008fc1a1db07bbb273cbbf6a5b3bfa00835ee00e4dff",
    ),
    (
        "sensor_msgs/msg/NavSatFix",
        "12",
        12,
        "1",
        "62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404",
    ),
    (
        "sensor_msgs/msg/FluidPressure",
        "",
        2,
        "",
        "22dfb2b145a0bd5a31a1ac3882a1b32148b51d9b2f3bab250290d66f3595bc32",
    ),
    (
        "geometry_msgs/msg/TwistStamped",
        "",
        6,
        "",
        "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    ),
    (
        "geometry_msgs/msg/TwistWithCovarianceStamped",
        "",
        42,
        "",
        "77b67434531e6529b7a0091357b186b6ebdb17fd9ffd3e0c7ce9d3fb11a44563",
    ),
    (
        "geometry_msgs/msg/QuaternionStamped",
        "",
        4,
        "",
        "381add86c6c3160644d228ca342182c7fd6c7fab11c7a85ad817a9cc22dbac6e",
    ),
    (
        "geometry_msgs/msg/PoseStamped",
        "",
        7,
        "",
        "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    ),
    (
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "",
        43,
        "",
        "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
    ),
    (
        "nav_msgs/msg/Odometry",
        "s",
        85,
        "",
        "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    ),
];
/// The key of the hash in the metadata of a channel of MCAP.
pub(super) const HASH: &str = "topic_type_hash";
/// The version of hashes that is known.
const VERSION: &str = "RIHS01_";
/// A definition with more numbers or lines, or deeper in one another, is none of those that are read.
const MOST_NUMBERS: usize = 1000;
const DEEPEST: usize = 8;

/// What a bag says of the type of a topic.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stated<'a> {
    /// `ros2msg`, `ros1msg`; of other encodings nothing is compared.
    pub(super) encoding: &'a str,
    pub(super) definition: &'a str,
    pub(super) hash: &'a str,
}

/// The name of a type as it is looked for: that of ROS, unless the bag states another layout for it.
pub(super) fn name_of(name: &str, stated: Stated<'_>) -> String {
    if fits(name, stated) {
        name.to_owned()
    } else {
        format!("{name} of another definition")
    }
}

fn fits(name: &str, stated: Stated<'_>) -> bool {
    let Some((_, before, numbers, behind, hash)) = LAYOUTS.iter().find(|(of, ..)| *of == name)
    else {
        return true;
    };
    if let Some(other) = stated.hash.strip_prefix(VERSION)
        && other != *hash
    {
        return false;
    }
    // Sequence number of ROS 1, seconds, nanoseconds, frame.
    let header = match stated.encoding {
        "ros2msg" => "44s",
        "ros1msg" => "444s",
        _ => return true,
    };
    let doubles: String = repeat_n('d', *numbers).collect();
    let expected = format!("{header}{before}{doubles}{behind}");
    // A definition that cannot be followed says nothing.
    layout(stated.definition).is_none_or(|layout| layout == expected)
}

/// The layout of a definition with those of the messages in it; `None` where it is not complete.
fn layout(definition: &str) -> Option<String> {
    let mut blocks: Vec<(&str, Vec<&str>)> = vec![("", Vec::new())];
    for line in definition.lines() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.starts_with("===") {
            blocks.push(("", Vec::new()));
        } else if let Some(name) = line.strip_prefix("MSG:") {
            blocks.last_mut()?.0 = name.trim();
        } else if !line.is_empty() {
            blocks.last_mut()?.1.push(line);
        }
    }
    let mut layout = String::new();
    let mut steps = MOST_NUMBERS;
    follow(&blocks[0].1, &blocks, DEEPEST, &mut steps, &mut layout)?;
    (!layout.is_empty()).then_some(layout)
}

fn follow(
    lines: &[&str],
    blocks: &[(&str, Vec<&str>)],
    depth: usize,
    steps: &mut usize,
    layout: &mut String,
) -> Option<()> {
    for line in lines {
        let (kind, rest) = line.split_once(char::is_whitespace)?;
        *steps = steps.checked_sub(1)?;
        // Constants have no bytes.
        let behind_name = rest.trim_start().trim_start_matches(is_name);
        if behind_name.trim_start().starts_with('=') {
            continue;
        }
        let (kind, count) = match kind.split_once('[') {
            None => (kind, 1),
            Some((kind, count)) => (kind, count.strip_suffix(']')?.parse().ok()?),
        };
        let one = match kind {
            "bool" | "byte" | "char" | "int8" | "uint8" => "1",
            "int16" | "uint16" => "2",
            "int32" | "uint32" => "4",
            "int64" | "uint64" => "8",
            "float32" => "f",
            "float64" => "d",
            "string" => "s",
            "time" | "duration" => "44",
            _ => {
                let short = |name: &str| name.rsplit('/').next().unwrap_or_default().to_owned();
                let found = blocks.iter().find(|(name, _)| short(name) == short(kind))?;
                let depth = depth.checked_sub(1)?;
                for _ in 0..count {
                    *steps = steps.checked_sub(1)?;
                    follow(&found.1, blocks, depth, steps, layout)?;
                }
                continue;
            }
        };
        if count > MOST_NUMBERS || layout.len() > MOST_NUMBERS {
            return None;
        }
        layout.extend(repeat_n(one, count));
    }
    Some(())
}

fn is_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mcap::estimate_messages::EstimateTopic;
    use crate::mcap::ros::MAGNETIC_FIELD_DEFINITION;

    fn name(kind: &str, definition: &str, hash: &str) -> String {
        let encoding = "ros2msg";
        name_of(
            kind,
            Stated {
                encoding,
                definition,
                hash,
            },
        )
    }

    #[test]
    fn the_definitions_of_ros_fit() {
        let ours = [
            EstimateTopic::Imu,
            EstimateTopic::Odometry,
            EstimateTopic::Fix,
        ];
        let ours = ours.map(|topic| (topic.schema(), topic.definition()));
        let field = ("sensor_msgs/msg/MagneticField", MAGNETIC_FIELD_DEFINITION);
        for (kind, definition) in ours.into_iter().chain([field]) {
            assert!(layout(definition).is_some(), "{kind}");
            assert_eq!(name(kind, definition, ""), kind);
            // A field less, and one more.
            let shorter = definition.replacen("float64", "float32", 1);
            let longer = format!("uint8 more\n{definition}");
            for other in [shorter, longer] {
                assert_eq!(
                    name(kind, &other, ""),
                    format!("{kind} of another definition")
                );
            }
        }
    }

    #[test]
    fn ros_1_has_a_number_and_a_time_in_its_header() {
        let definition = "Header header\nfloat64 fluid_pressure\nfloat64 variance\nuint8 ODD = 3 # a constant\nstring WORD=a b\n\
             ===\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";
        let of = |encoding| {
            name_of(
                "sensor_msgs/msg/FluidPressure",
                Stated {
                    encoding,
                    definition,
                    hash: "",
                },
            )
        };
        assert_eq!(of("ros1msg"), "sensor_msgs/msg/FluidPressure");
        assert_eq!(
            of("ros2msg"),
            "sensor_msgs/msg/FluidPressure of another definition"
        );
        assert_eq!(of("ros2idl"), "sensor_msgs/msg/FluidPressure");
    }

    #[test]
    fn another_hash_is_another_type_and_what_says_nothing_is_none() {
        let imu = "sensor_msgs/msg/Imu";
        let known = format!("{VERSION}{}", LAYOUTS[0].4);
        assert_eq!(name(imu, "", &known), imu);
        assert_eq!(
            name(imu, "", "RIHS01_00"),
            "sensor_msgs/msg/Imu of another definition"
        );
        for silent in [
            "",
            "-",
            "std_msgs/Header header",
            "float64[] x",
            "float64[x] x",
            "x",
        ] {
            assert_eq!(name(imu, silent, "RIHS99_00"), imu, "{silent}");
        }
        // Messages in one another, and without end.
        let endless = format!("{0} a\n===\nMSG: p/{0}\nX a\n===\nMSG: p/X\n{0} a\n", "Y");
        assert_eq!(layout(&endless), None);
        assert_eq!(layout("float64[1000000000] x"), None);
        let wide = "A[1000] a\n===\nMSG: p/A\nB[1000] b\n===\nMSG: p/B\nfloat64[1000] x\n";
        assert_eq!(layout(wide), None);
        // No bytes, however often.
        let nothing = "A[1000000000] a\n===\nMSG: p/A\n";
        assert_eq!(layout(nothing), None);
    }
}
