//! Everything an application does, in an image that links only when none of it contains a panic.
//!
//! Its panic handler calls a function that exists nowhere. Linked as a whole the optimiser proves that
//! no path leads there and leaves the call out; where one is left, the linker names the symbol.

use core::hint::black_box;
use core::panic::PanicInfo;

use northing_firmware::application::Overruns;
use northing_firmware::{Application, Navigator, ResetCause};

#[panic_handler]
#[allow(unsafe_code)]
fn panic(_: &PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        fn a_panic_is_still_reachable() -> !;
    }
    // SAFETY: never linked; see above.
    unsafe { a_panic_is_still_reachable() }
}

/// An application of a build, on bytes that the compiler knows nothing of.
pub(crate) fn run<N: Navigator>() -> ! {
    let mut out = |byte: u8| {
        black_box(byte);
    };
    let mut application = Application::<N>::new(black_box(ResetCause::Power), 0, &mut out);
    loop {
        let now_us = black_box(0);
        application.gnss_byte(black_box(0), now_us);
        application.imu_byte(black_box(0), now_us, &mut out);
        application.poll(now_us, black_box(Overruns::default()), &mut out);
    }
}
