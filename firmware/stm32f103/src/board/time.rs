//! A counter of microseconds that rolls over after 71 minutes, moved on each millisecond.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

/// Ticks of the 72 MHz core clock in a millisecond.
const TICKS: u32 = 72_000;

static NOW_US: AtomicU32 = AtomicU32::new(0);

/// Starts counting.
pub(super) fn start(syst: &mut SYST) {
    syst.set_clock_source(SystClkSource::Core);
    syst.set_reload(TICKS - 1);
    syst.clear_current();
    syst.enable_interrupt();
    syst.enable_counter();
}

/// Time since the start, microseconds, wrapping.
pub(super) fn now_us() -> u32 {
    NOW_US.load(Ordering::Relaxed)
}

#[cortex_m_rt::exception]
fn SysTick() {
    let now = NOW_US.load(Ordering::Relaxed);
    NOW_US.store(now.wrapping_add(1000), Ordering::Relaxed);
}
