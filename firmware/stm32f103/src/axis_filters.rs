//! The build `axis-filters` for the STM32F103.
#![no_std]
#![no_main]

mod board;

use northing_firmware_soft_float as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    board::run::<northing_firmware::navigator::AxisNavigator>()
}
