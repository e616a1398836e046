//! The build `error-state`: links only without a panic.
#![no_std]
#![no_main]

mod link;

use northing_firmware_soft_float as _;

#[cortex_m_rt::entry]
fn main() -> ! {
    link::run::<northing_firmware::navigator::ErrorStateNavigator>()
}
