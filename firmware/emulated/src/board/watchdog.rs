//! The watchdog: not fed for 200 ms, it resets the board, and the start after tells so.

use core::sync::atomic::{AtomicU32, Ordering};

use northing_firmware::ResetCause;

use super::device::set_watchdog;

/// Ticks of 40 ns: 100 ms to its interrupt, and as much again to the reset.
const LOAD: u32 = 2_500_000;
const LOAD_REGISTER: usize = 0x0;
const CONTROL: usize = 0x8;
const INTERRUPT_CLEAR: usize = 0xc;
const LOCK: usize = 0xc00;
const UNLOCK: u32 = 0x1acc_e551;

/// Memory that a start does not touch: what the last breath was.
#[unsafe(link_section = ".uninit.last_breath")]
#[allow(unsafe_code)]
static LAST_BREATH: AtomicU32 = AtomicU32::new(0);
const WATCHDOG: u32 = 0x0dd5_d065;

/// Starts it; why the board has started.
pub(super) fn start() -> ResetCause {
    let barked = LAST_BREATH.load(Ordering::Relaxed) == WATCHDOG;
    LAST_BREATH.store(0, Ordering::Relaxed);
    set_watchdog(LOCK, UNLOCK);
    set_watchdog(LOAD_REGISTER, LOAD);
    set_watchdog(CONTROL, 0b11);
    if barked {
        ResetCause::Watchdog
    } else {
        ResetCause::Power
    }
}

/// The program is alive.
pub(super) fn feed() {
    set_watchdog(INTERRUPT_CLEAR, 1);
}

/// It barks: nothing can be trusted any more, so only the cause is kept. Then it bites.
#[cortex_m_rt::exception]
#[allow(unsafe_code)]
unsafe fn NonMaskableInt() -> ! {
    LAST_BREATH.store(WATCHDOG, Ordering::Relaxed);
    loop {
        cortex_m::asm::nop();
    }
}
