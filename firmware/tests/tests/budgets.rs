//! Flash, RAM, stack and instructions stay within `budgets.toml`, and are printed.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use std::collections::BTreeMap;
use std::process::Command;

use northing_firmware_tests::Board;
use northing_firmware_tests::emulator::Emulator;
use northing_firmware_tests::images::{Chip, image, size};
use northing_firmware_tests::walk::Walk;
use serde::Deserialize;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Budgets {
    /// By chip and filter.
    instructions: BTreeMap<String, BTreeMap<String, u32>>,
    images: BTreeMap<String, ImageBudget>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ImageBudget {
    chips: Vec<String>,
    flash_bytes: u32,
    static_ram_bytes: u32,
    /// For images whose stack can be measured: those of the emulated board.
    stack_bytes: Option<u32>,
    /// The image of the emulated board whose stack stands for this one's.
    stack_of: Option<String>,
    ram_bytes: u32,
}

fn budgets() -> Budgets {
    toml::from_str(include_str!("../../budgets.toml")).unwrap()
}

fn chip(name: &str) -> Chip {
    Chip::ALL
        .into_iter()
        .find(|chip| chip.name() == name)
        .unwrap()
}

/// What the benchmark counts: worst and mean instructions of a step, by filter.
fn counted(chip: Chip) -> BTreeMap<String, [u32; 2]> {
    let run = Command::new("qemu-system-arm")
        .args([
            "-M",
            chip.machine(),
            "-icount",
            "shift=6",
            "-display",
            "none",
        ])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(image(chip, "benchmark"))
        .output()
        .expect("qemu-system-arm is needed: ./scripts/test firmware installs it");
    assert!(run.status.success(), "{run:?}");
    let text = String::from_utf8(run.stdout).unwrap() + &String::from_utf8(run.stderr).unwrap();
    assert!(text.trim_end().ends_with("done"), "{text}");
    let lines = text.lines().filter_map(|line| {
        let [name, worst, mean] = line.split(' ').collect::<Vec<_>>().try_into().ok()?;
        Some((name.to_owned(), [worst.parse().ok()?, mean.parse().ok()?]))
    });
    lines.collect()
}

/// Share of a 72 MHz Cortex-M3 that 50 steps a second take, per cent. An instruction is taken for 1.5
/// cycles: loads, branches and the flash's wait states cost more than one, most others one.
fn share_percent(instructions: u32) -> f64 {
    const CYCLES_PER_INSTRUCTION: f64 = 1.5;
    f64::from(instructions) * 50.0 * CYCLES_PER_INSTRUCTION / 72e6 * 100.0
}

#[test]
fn a_step_takes_no_more_instructions_than_it_may() {
    let mut exceeded = Vec::new();
    for (name, budgets) in budgets().instructions {
        let counted = counted(chip(&name));
        let named: Vec<_> = counted.keys().collect();
        assert_eq!(
            named,
            budgets.keys().collect::<Vec<_>>(),
            "a filter without a budget, or the reverse"
        );
        for (filter, budget) in budgets {
            let [worst, mean] = counted[&filter];
            let share = share_percent(worst);
            println!(
                "{name} {filter}: worst step {worst} instructions of {budget}, mean {mean}; {share:.2} % of 72 MHz"
            );
            if worst > budget {
                exceeded.push(format!("{name} {filter}: {worst} > {budget}"));
            }
        }
    }
    assert!(exceeded.is_empty(), "{exceeded:?}");
}

/// The most stack that an image of the emulated board has used over a walk with damage, and with an IMU that freezes.
fn stack_used(chip: Chip, name: &str) -> u32 {
    let mut walk = Walk::new(3, 6.0);
    walk.ticks[100].imu.extend([b'#'; 300]);
    walk.ticks[150].gnss.extend([b'$'; 300]);
    let frozen = walk.ticks[200].imu.clone();
    for tick in &mut walk.ticks[201..260] {
        tick.imu.clone_from(&frozen);
    }
    let mut board = Emulator::start(chip, name);
    board.ticks(&walk.ticks);
    board.stack_used()
}

#[test]
fn images_fit_where_they_must() {
    let mut exceeded = Vec::new();
    for (name, budget) in budgets().images {
        for chip in budget.chips.iter().map(|name| chip(name)) {
            let size = size(chip, &name);
            let stack = stack_used(chip, budget.stack_of.as_deref().unwrap_or(&name));
            println!(
                "{} {name}: flash {} B, static RAM {} B, stack {stack} B",
                chip.name(),
                size.flash,
                size.static_ram
            );
            let measured = [
                ("flash", size.flash, Some(budget.flash_bytes)),
                ("static RAM", size.static_ram, Some(budget.static_ram_bytes)),
                ("stack", stack, budget.stack_bytes),
                ("RAM", size.static_ram + stack, Some(budget.ram_bytes)),
            ];
            for (what, bytes, most) in measured {
                if most.is_some_and(|most| bytes > most) {
                    exceeded.push(format!(
                        "{} {name}: {what} {bytes} B > {most:?}",
                        chip.name()
                    ));
                }
            }
        }
    }
    assert!(exceeded.is_empty(), "{exceeded:?}");
}
