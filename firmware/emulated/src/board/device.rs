//! Registers of the emulated board: the one place of this image that touches memory by address.
#![allow(unsafe_code)]

use core::ptr::{read_volatile, write_volatile};

/// A CMSDK serial line (Arm DDI 0479, section 4.3).
#[derive(Debug, Clone, Copy)]
pub(super) struct Uart {
    base: usize,
}

const DATA: usize = 0x0;
const STATE: usize = 0x4;
const CONTROL: usize = 0x8;
const INTERRUPT_CLEAR: usize = 0xc;
const BAUD_DIVIDER: usize = 0x10;
const TRANSMIT_FULL: u32 = 1;
const RECEIVE_FULL: u32 = 2;

impl Uart {
    /// Line 0 to 3.
    pub(super) const fn new(number: usize) -> Self {
        let base = 0x4000_4000 + (number & 3) * 0x1000;
        Self { base }
    }

    /// Both directions, with the interrupt for received bytes.
    pub(super) fn enable(self) {
        self.set(BAUD_DIVIDER, 16);
        self.set(CONTROL, 0b1011);
    }

    pub(super) fn read(self) -> Option<u8> {
        let full = self.get(STATE) & RECEIVE_FULL != 0;
        full.then(|| self.get(DATA) as u8)
    }

    pub(super) fn write(self, byte: u8) {
        while self.get(STATE) & TRANSMIT_FULL != 0 {
            super::watchdog::feed();
        }
        self.set(DATA, u32::from(byte));
    }

    pub(super) fn clear_receive_interrupt(self) {
        self.set(INTERRUPT_CLEAR, 0b10);
    }

    fn get(self, register: usize) -> u32 {
        // SAFETY: `base` is that of one of the four lines, and the register is one of a line's.
        unsafe { read_volatile((self.base + register) as *const u32) }
    }

    fn set(self, register: usize, value: u32) {
        // SAFETY: as above.
        unsafe { write_volatile((self.base + register) as *mut u32, value) }
    }
}

/// The CMSDK watchdog (Arm DDI 0479, section 4.6): registers by their offsets.
pub(super) fn set_watchdog(register: usize, value: u32) {
    const BASE: usize = 0x4000_8000;
    // SAFETY: offsets are those of the watchdog's registers, below its size of 4 KB.
    unsafe { write_volatile((BASE + (register & 0xffc)) as *mut u32, value) }
}

/// An interrupt's number.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interrupt(pub(super) u16);

// SAFETY: the numbers are those of the board's interrupts.
unsafe impl cortex_m::interrupt::InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self.0
    }
}

/// Lets interrupts come.
pub(super) fn unmask(interrupts: [Interrupt; 3]) {
    for interrupt in interrupts {
        // SAFETY: nothing here relies on an interrupt being masked.
        unsafe { cortex_m::peripheral::NVIC::unmask(interrupt) }
    }
}

/// Wakes the program each 10 ms, so that it can feed the watchdog while nothing comes.
pub(super) fn start_ticking() {
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.SYST
            .set_clock_source(cortex_m::peripheral::syst::SystClkSource::Core);
        core.SYST.set_reload(250_000);
        core.SYST.clear_current();
        core.SYST.enable_interrupt();
        core.SYST.enable_counter();
    }
}

#[cortex_m_rt::exception]
fn SysTick() {}

/// Most bytes of stack that have been in use: the start paints it, and what is no longer painted was
/// used.
pub(super) fn stack_used() -> u32 {
    const PAINT: u32 = 0xcccc_cccc;
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    let (mut end, start) = (&raw const _stack_end, &raw const _stack_start);
    // SAFETY: between the two symbols lies the stack, words of initialised memory.
    while end < start && unsafe { read_volatile(end) } == PAINT {
        end = end.wrapping_add(1);
    }
    (start as usize - end as usize) as u32
}
