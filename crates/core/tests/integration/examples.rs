//! The examples run, and what they assert holds; each has at most 40 lines.

#![allow(
    missing_docs,
    unreachable_pub,
    unused_attributes,
    unused_extern_crates,
    reason = "they are programs of their own"
)]

#[path = "../../examples/attitude.rs"]
mod attitude;
#[path = "../../examples/attitude_f32.rs"]
mod attitude_f32;
#[path = "../../examples/gnss_ins.rs"]
mod gnss_ins;
#[path = "../../examples/schmidt_tracking.rs"]
mod schmidt_tracking;

#[test]
fn attitude_is_found_with_its_bias() {
    attitude::main().unwrap();
}

#[test]
fn a_car_is_found_at_the_end_of_a_tunnel() {
    gnss_ins::main().unwrap();
}

#[test]
fn a_ship_is_tracked_from_an_uncertain_one() {
    schmidt_tracking::main().unwrap();
}

#[test]
fn a_chip_finds_its_roll_in_single_precision() {
    attitude_f32::main();
}

#[test]
fn examples_are_short() {
    for (name, text) in [
        ("attitude", include_str!("../../examples/attitude.rs")),
        (
            "attitude_f32",
            include_str!("../../examples/attitude_f32.rs"),
        ),
        ("gnss_ins", include_str!("../../examples/gnss_ins.rs")),
        (
            "schmidt_tracking",
            include_str!("../../examples/schmidt_tracking.rs"),
        ),
    ] {
        let lines = text.lines().count();
        assert!(lines <= 40, "{name}: {lines} lines");
    }
}
