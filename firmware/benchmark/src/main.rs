//! Counts the instructions of one 50 Hz step of each filter, on the boards mps2-an385 (Cortex-M3) and
//! mps2-an386 (Cortex-M4F) of QEMU.
//!
//! With `-icount shift=6` an instruction takes 64 ns of the emulated time, and the SysTick counter
//! ticks each 40 ns. Inputs are made before a step is counted. One line a filter:
//! `name worst mean` in instructions.
#![no_std]
#![no_main]

mod kernels;

use northing_firmware_soft_float as _;

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{Peripherals, SYST};
use cortex_m_semihosting::{debug, hprintln};
use panic_halt as _;

/// Largest count of the SysTick counter.
const FULL: u32 = 0x00ff_ffff;
/// Steps of each filter: a minute.
const STEPS: u32 = 3000;

/// Instructions by the SysTick counter.
struct Counter {
    /// Ticks of a measurement of nothing.
    nothing: u32,
}

impl Counter {
    fn new(syst: &mut SYST) -> Self {
        syst.set_clock_source(SystClkSource::Core);
        syst.set_reload(FULL);
        syst.clear_current();
        syst.enable_counter();
        let mut counter = Self { nothing: 0 };
        counter.nothing = counter.ticks(|| {});
        counter
    }

    fn ticks(&self, work: impl FnOnce()) -> u32 {
        let before = SYST::get_current();
        work();
        let after = SYST::get_current();
        // It counts down, and rolls over.
        (before.wrapping_sub(after) & FULL).saturating_sub(self.nothing)
    }

    /// Counts a step; 40 ns a tick, 64 ns an instruction.
    fn instructions(&self, work: impl FnOnce()) -> u32 {
        (self.ticks(work) * 5).div_ceil(8)
    }
}

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(mut peripherals) = Peripherals::take() {
        let counter = Counter::new(&mut peripherals.SYST);
        kernels::all(&counter);
        hprintln!("done");
        debug::exit(debug::EXIT_SUCCESS);
    }
    loop {
        cortex_m::asm::nop();
    }
}
