//! A second board: an MPU-9250 on SPI at an STM32F411 ("Black Pill"), attitude at 50 Hz.
//!
//! The same filters and sentences as on the paper's chip; what differs is where frames come from. SPI1
//! on PA5 (clock), PA6 (in), PA7 (out), PA4 (select); sentences on PA9, 230400 baud. The sensor lies with
//! its x axis forward and its z axis up. Without its magnetometer, which sits behind another bus, the
//! heading is that of the start, zero, and drifts.
#![no_std]
#![no_main]

mod mpu9250;

use core::panic::PanicInfo;

use embedded_hal::spi::MODE_3;
use embedded_hal_bus::spi::ExclusiveDevice;
use mpu9250::Mpu9250;
use northing_firmware::application::Overruns;
use northing_firmware::navigator::AxisNavigator;
use northing_firmware::ring::Ring;
use northing_firmware::{Application, ResetCause};
use stm32f4xx_hal::pac;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Config;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

const OUT_BAUD: u32 = 230_400;
/// A program that has not come round for so long hangs, ms.
const WATCHDOG_MS: u32 = 500;

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(device) = pac::Peripherals::take() else {
        hang()
    };
    let barked = device.RCC.csr().read().wdgrstf().bit_is_set();
    device.RCC.csr().modify(|_, w| w.rmvf().set_bit());
    let mut watchdog = IndependentWatchdog::new(device.IWDG);
    watchdog.start(WATCHDOG_MS.millis());
    let clocks = Config::hse(25.MHz()).sysclk(96.MHz());
    let mut rcc = device.RCC.freeze(clocks);
    let gpioa = device.GPIOA.split(&mut rcc);
    let Ok(mut out) = device.USART1.tx(gpioa.pa9, OUT_BAUD.bps(), &mut rcc) else {
        hang()
    };
    let pins = (Some(gpioa.pa5), Some(gpioa.pa6), Some(gpioa.pa7));
    let bus = device.SPI1.spi(pins, MODE_3, 1.MHz(), &mut rcc);
    let select = gpioa.pa4.into_push_pull_output();
    let delay = device.TIM3.delay_us(&mut rcc);
    let Ok(spi) = ExclusiveDevice::new(bus, select, delay);
    let mut pause = device.TIM4.delay_us(&mut rcc);
    // 32 bits at 1 MHz: rolls over after 71 minutes.
    let mut counter = device.TIM5.counter_us(&mut rcc);
    if counter.start(u32::MAX.micros()).is_err() {
        hang()
    }

    // A sensor that does not answer is tried again by the watchdog's reset.
    let Ok(mut imu) = Mpu9250::start(spi, &mut pause) else {
        hang()
    };
    let cause = if barked {
        ResetCause::Watchdog
    } else {
        ResetCause::Power
    };
    let waiting = Ring::<1024>::new();
    let mut say = |byte: u8| {
        waiting.push(byte);
    };
    let mut application = Application::<AxisNavigator>::new(cause, counter.now().ticks(), &mut say);
    loop {
        watchdog.feed();
        let now_us = counter.now().ticks();
        if let Ok(Some(frame)) = imu.frame() {
            application.take_frame(&frame, now_us, &mut say);
        }
        application.poll(now_us, Overruns::default(), &mut say);
        if out.is_tx_empty()
            && let Some(byte) = waiting.pop()
        {
            // The line was free a moment ago.
            let _ = out.write(byte);
        }
    }
}

/// The watchdog ends it.
fn hang() -> ! {
    loop {
        cortex_m::asm::nop();
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    hang()
}
