//! The two lines that receive, by interrupts.

use core::cell::RefCell;

use critical_section::Mutex;
use northing_firmware::ring::Ring;
use stm32f1xx_hal::pac::{Interrupt, USART2, USART3, interrupt};
use stm32f1xx_hal::serial::{Instance, Rx};

/// Two frames of the IMU; the sentences of one instant.
pub(super) static IMU: Ring<256> = Ring::new();
pub(super) static GNSS: Ring<512> = Ring::new();

/// What receives, once it is set up.
type Shared<U> = Mutex<RefCell<Option<Rx<U>>>>;
static IMU_RECEIVER: Shared<USART2> = Mutex::new(RefCell::new(None));
static GNSS_RECEIVER: Shared<USART3> = Mutex::new(RefCell::new(None));

/// Lets bytes come.
pub(super) fn listen(mut imu: Rx<USART2>, mut gnss: Rx<USART3>) {
    imu.listen();
    gnss.listen();
    critical_section::with(|section| {
        IMU_RECEIVER.borrow_ref_mut(section).replace(imu);
        GNSS_RECEIVER.borrow_ref_mut(section).replace(gnss);
    });
    for interrupt in [Interrupt::USART2, Interrupt::USART3] {
        // SAFETY: nothing here relies on these interrupts being masked.
        #[allow(unsafe_code)]
        unsafe {
            cortex_m::peripheral::NVIC::unmask(interrupt);
        }
    }
}

fn receive<U: Instance, const N: usize>(shared: &Shared<U>, ring: &Ring<N>) {
    critical_section::with(|section| {
        let mut receiver = shared.borrow_ref_mut(section);
        if let Some(receiver) = receiver.as_mut() {
            match receiver.read() {
                Ok(byte) => {
                    ring.push(byte);
                }
                // Noise, a wrong speed, or a byte that nobody fetched in time.
                Err(nb::Error::Other(_)) => ring.count_lost(),
                Err(nb::Error::WouldBlock) => {}
            }
        }
    });
}

#[interrupt]
fn USART2() {
    receive(&IMU_RECEIVER, &IMU);
}

#[interrupt]
fn USART3() {
    receive(&GNSS_RECEIVER, &GNSS);
}
