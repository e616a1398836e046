//! The symbols that the compiler's code calls, by the names of the Arm run-time ABI (IHI 0043).
//!
//! Arguments and results travel in integer registers there, so these functions take bits.
#![allow(unsafe_code)]

use crate::{added, multiplied};

unsafe extern "C" {
    /// The compiler's own, for all that is not ordinary.
    safe fn __addsf3(a: f32, b: f32) -> f32;
    safe fn __mulsf3(a: f32, b: f32) -> f32;
}

// SAFETY: the name stands for this function in the run-time ABI, with this signature.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fadd(a: u32, b: u32) -> u32 {
    added(a, b).unwrap_or_else(|| other_sum(a, b))
}

// SAFETY: as above.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fsub(a: u32, b: u32) -> u32 {
    let b = b ^ 0x8000_0000;
    added(a, b).unwrap_or_else(|| other_sum(a, b))
}

// SAFETY: as above.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fmul(a: u32, b: u32) -> u32 {
    multiplied(a, b).unwrap_or_else(|| other_product(a, b))
}

#[cold]
#[inline(never)]
fn other_sum(a: u32, b: u32) -> u32 {
    __addsf3(f32::from_bits(a), f32::from_bits(b)).to_bits()
}

#[cold]
#[inline(never)]
fn other_product(a: u32, b: u32) -> u32 {
    __mulsf3(f32::from_bits(a), f32::from_bits(b)).to_bits()
}
