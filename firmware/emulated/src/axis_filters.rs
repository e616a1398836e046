//! The build `axis-filters` on the emulated board.
#![no_std]
#![no_main]

mod board;

#[cortex_m_rt::entry]
fn main() -> ! {
    board::run::<northing_firmware::navigator::AxisNavigator>()
}
