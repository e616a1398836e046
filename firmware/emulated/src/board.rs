//! The boards mps2-an385 and mps2-an386 of QEMU: Cortex-M3 and Cortex-M4F, four serial lines, a watchdog.
//!
//! | line | what is on it |
//! |---|---|
//! | UART0 | out: the sentences |
//! | UART1 | in: the IMU |
//! | UART2 | in: the GNSS receiver |
//! | UART3 | both ways: the clock, which the test holds, so that every run is the same and an hour takes seconds |
//!
//! Bytes come in by interrupts, as on the chip. The clock line takes commands:
//!
//! | command | then |
//! |---|---|
//! | `T`, ms, bytes sent to UART1 and UART2 so far (16 bits each, little-endian) | it waits until they have come, moves its counter on by `ms`, works, and answers `K` and the number of bytes that it has written to UART0 (32 bits) |
//! | `S` | it answers `S` and the most bytes of stack that were in use (32 bits) |
//! | `H` | it hangs, as a program with an error would; the watchdog resets it |
//!
//! After a reset it says `R`. The counter starts 30 seconds before it rolls over.

mod device;
mod watchdog;

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};

use northing_firmware::application::Overruns;
use northing_firmware::ring::Ring;
use northing_firmware::{Application, Navigator};

use device::{Interrupt, Uart};

/// Bytes of a frame and a half; bytes of the sentences of one instant.
static IMU: Line<256> = Line::new();
static GNSS: Line<512> = Line::new();
const IMU_UART: Uart = Uart::new(1);
const GNSS_UART: Uart = Uart::new(2);
const OUT: Uart = Uart::new(0);
static COMMANDS: Line<16> = Line::new();
const CLOCK: Uart = Uart::new(3);

/// The counter at the start: it rolls over after 30 seconds.
const COUNTER_AT_START_US: u32 = 0_u32.wrapping_sub(30_000_000);

/// A serial line that receives by interrupts.
struct Line<const N: usize> {
    ring: Ring<N>,
    /// Bytes that have come, wrapping.
    received: AtomicU32,
}

impl<const N: usize> Line<N> {
    const fn new() -> Self {
        Self {
            ring: Ring::new(),
            received: AtomicU32::new(0),
        }
    }

    /// What its interrupt does.
    fn receive(&self, uart: Uart) {
        // First: a byte that comes in between asks again.
        uart.clear_receive_interrupt();
        while let Some(byte) = uart.read() {
            self.ring.push(byte);
            let received = self.received.load(Ordering::Relaxed);
            self.received
                .store(received.wrapping_add(1), Ordering::Release);
        }
    }

    /// Whether so many bytes have come, counted in 16 bits.
    fn has_received(&self, bytes: u16) -> bool {
        self.received.load(Ordering::Acquire) as u16 == bytes
    }
}

/// Every interrupt comes here; the lines' are numbers 2, 4 and 18.
#[cortex_m_rt::exception]
#[allow(unsafe_code)]
unsafe fn DefaultHandler(number: i16) {
    match number {
        2 => IMU.receive(IMU_UART),
        4 => GNSS.receive(GNSS_UART),
        18 => COMMANDS.receive(CLOCK),
        _ => hang(),
    }
}

/// Runs the application of a build for ever.
pub(crate) fn run<N: Navigator>() -> ! {
    let cause = watchdog::start();
    device::start_ticking();
    for uart in [OUT, CLOCK, IMU_UART, GNSS_UART] {
        uart.enable();
    }
    device::unmask([Interrupt(2), Interrupt(4), Interrupt(18)]);
    let mut written = 0_u32;
    let mut out = |byte: u8| {
        OUT.write(byte);
        written = written.wrapping_add(1);
    };
    let mut now_us = COUNTER_AT_START_US;
    let mut application = Application::<N>::new(cause, now_us, &mut out);
    CLOCK.write(b'R');
    loop {
        match command() {
            b'T' => {
                let ms = command();
                let [imu, gnss] = [sixteen_bits(), sixteen_bits()];
                wait_for(|| (IMU.has_received(imu) && GNSS.has_received(gnss)).then_some(()));
                now_us = now_us.wrapping_add(u32::from(ms) * 1000);
                while let Some(byte) = GNSS.ring.pop() {
                    application.gnss_byte(byte, now_us);
                }
                let mut out = |byte: u8| {
                    OUT.write(byte);
                    written = written.wrapping_add(1);
                };
                while let Some(byte) = IMU.ring.pop() {
                    application.imu_byte(byte, now_us, &mut out);
                }
                let overruns = Overruns {
                    imu: IMU.ring.lost(),
                    gnss: GNSS.ring.lost(),
                };
                application.poll(now_us, overruns, &mut out);
                answer(b'K', written);
            }
            b'S' => answer(b'S', device::stack_used()),
            b'H' => hang(),
            _ => {}
        }
    }
}

/// Sleeps from interrupt to interrupt until there is something.
fn wait_for<T>(mut something: impl FnMut() -> Option<T>) -> T {
    loop {
        watchdog::feed();
        // With interrupts off, none can come between the look and the sleep; it wakes all the same.
        let found = cortex_m::interrupt::free(|_| {
            let found = something();
            if found.is_none() {
                cortex_m::asm::wfi();
            }
            found
        });
        if let Some(found) = found {
            return found;
        }
    }
}

/// The next byte of the clock line.
fn command() -> u8 {
    wait_for(|| COMMANDS.ring.pop())
}

fn sixteen_bits() -> u16 {
    u16::from_le_bytes([command(), command()])
}

fn answer(kind: u8, value: u32) {
    CLOCK.write(kind);
    for byte in value.to_le_bytes() {
        CLOCK.write(byte);
    }
}

fn hang() -> ! {
    loop {
        cortex_m::asm::nop();
    }
}

/// Nothing in the application panics; if something did, the watchdog would end it.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    hang()
}
