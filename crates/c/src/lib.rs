//! The estimators for C and C++: a static library, and the header `include/northing.h` that is made of it.
//!
//! | file | what is in it |
//! |---|---|
//! | `value.rs` | filters as values in C's memory: no allocation, copied by assignment |
//! | `shared.rs` | numbers, innovations, settings, statuses |
//! | `attitude.rs` | attitude: the multiplicative EKF and the bounded-velocity filter |
//! | `gnss_ins.rs` | position, velocity and attitude: the GNSS/INS |
//!
//! The library is `no_std`, allocates nothing and calls nothing. A filter is a structure that the caller owns: static, on the
//! stack or on the heap. Every function takes a null pointer, and says so.

#![cfg_attr(not(any(feature = "std", test)), no_std)]

pub mod attitude;
pub mod gnss_ins;
pub mod shared;
mod value;

/// What the page for firmware engineers shows runs.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/start/firmware_engineer.md")]
pub struct StartPage;

/// Nothing of the estimators panics; the linker asks for it all the same.
#[cfg(not(any(feature = "std", test)))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}
