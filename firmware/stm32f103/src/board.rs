//! An STM32F103 at 72 MHz: three serial lines, a watchdog, a counter of microseconds.
//!
//! | line | pins | what is on it |
//! |---|---|---|
//! | USART1 | PA9 out | the sentences, 230400 baud |
//! | USART2 | PA2 out, PA3 in | the Razor board, 57600 baud |
//! | USART3 | PB11 in | the GNSS receiver, 9600 baud |
//!
//! Bytes come in by interrupts and wait in queues; the main loop works on them, sends what there is to
//! send while the line is free, and feeds the watchdog. Nothing waits.

mod lines;
mod time;

use core::panic::PanicInfo;

use northing_firmware::application::Overruns;
use northing_firmware::ring::Ring;
use northing_firmware::{Application, Navigator, ResetCause, nmea, razor};
use stm32f1xx_hal::pac::{self, RCC};
use stm32f1xx_hal::prelude::*;
use stm32f1xx_hal::rcc;
use stm32f1xx_hal::serial::Config;
use stm32f1xx_hal::watchdog::IndependentWatchdog;

/// Bits a second of the output: the sentences of a second are below half of it.
const OUT_BAUD: u32 = 230_400;
/// A program that has not come round for so long hangs, ms.
const WATCHDOG_MS: u32 = 200;
/// From one command to a silent IMU to the next, microseconds.
const COMMAND_US: u32 = 2_000_000;

/// Runs the application of a build for ever.
pub(crate) fn run<N: Navigator>() -> ! {
    // Both are there exactly once, and this is the first call.
    let (Some(device), Some(mut core)) = (pac::Peripherals::take(), cortex_m::Peripherals::take())
    else {
        hang()
    };
    let cause = reset_cause(&device.RCC);
    let mut watchdog = IndependentWatchdog::new(device.IWDG);
    watchdog.start(WATCHDOG_MS.millis());
    let mut flash = device.FLASH.constrain();
    let clocks = rcc::Config::hse(8.MHz()).sysclk(72.MHz()).pclk1(36.MHz());
    let mut rcc = device.RCC.freeze(clocks, &mut flash.acr);
    time::start(&mut core.SYST);

    let mut gpioa = device.GPIOA.split(&mut rcc);
    let mut gpiob = device.GPIOB.split(&mut rcc);
    let speed = |baud: u32| Config::default().baudrate(baud.bps());
    let pins = (
        gpioa.pa9.into_alternate_push_pull(&mut gpioa.crh),
        gpioa.pa10,
    );
    let (mut out, _) = device
        .USART1
        .serial(pins, speed(OUT_BAUD), &mut rcc)
        .split();
    let pins = (
        gpioa.pa2.into_alternate_push_pull(&mut gpioa.crl),
        gpioa.pa3,
    );
    let (mut imu, imu_in) = device
        .USART2
        .serial(pins, speed(razor::BAUD), &mut rcc)
        .split();
    let pins = (
        gpiob.pb10.into_alternate_push_pull(&mut gpiob.crh),
        gpiob.pb11,
    );
    let (_, gnss_in) = device
        .USART3
        .serial(pins, speed(nmea::BAUD), &mut rcc)
        .split();
    lines::listen(imu_in, gnss_in);

    // A second of output and more: 10 kB/s leave at 23 kB/s.
    let waiting = Ring::<1024>::new();
    let mut say = |byte: u8| {
        waiting.push(byte);
    };
    let mut application = Application::<N>::new(cause, time::now_us(), &mut say);
    let mut commanded_us = time::now_us();
    let mut command = razor::START_COMMAND.iter();
    loop {
        watchdog.feed();
        let now_us = time::now_us();
        while let Some(byte) = lines::GNSS.pop() {
            application.gnss_byte(byte, now_us);
        }
        while let Some(byte) = lines::IMU.pop() {
            application.imu_byte(byte, now_us, &mut say);
        }
        application.poll(now_us, overruns(), &mut say);
        if out.is_tx_empty()
            && let Some(byte) = waiting.pop()
        {
            // The line was free a moment ago.
            let _ = out.write_u8(byte);
        }
        if application.imu_is_silent() && now_us.wrapping_sub(commanded_us) > COMMAND_US {
            commanded_us = now_us;
            command = razor::START_COMMAND.iter();
        }
        if imu.is_tx_empty()
            && let Some(byte) = command.next()
        {
            let _ = imu.write_u8(*byte);
        }
    }
}

fn overruns() -> Overruns {
    Overruns {
        imu: lines::IMU.lost(),
        gnss: lines::GNSS.lost(),
    }
}

/// Why it started; the flags are cleared for the next time.
fn reset_cause(rcc: &RCC) -> ResetCause {
    let barked = rcc.csr().read().iwdgrstf().bit_is_set();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    if barked {
        ResetCause::Watchdog
    } else {
        ResetCause::Power
    }
}

/// The watchdog ends it.
fn hang() -> ! {
    loop {
        cortex_m::asm::nop();
    }
}

/// Filters and application contain no panic; what the hardware support has ends in a reset.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    hang()
}
