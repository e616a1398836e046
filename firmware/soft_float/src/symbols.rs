//! The symbols that the compiler's code calls, by the names of the Arm run-time ABI (IHI 0043).
//!
//! Arguments and results travel in integer registers there, so these functions take bits.
#![allow(unsafe_code)]

use crate::{
    added, divided, is_at_most, is_equal, is_less, is_unordered, larger_first, multiplied,
};

unsafe extern "C" {
    /// The compiler's own, for all that is not ordinary.
    safe fn __addsf3(a: f32, b: f32) -> f32;
    safe fn __mulsf3(a: f32, b: f32) -> f32;
    safe fn __divsf3(a: f32, b: f32) -> f32;
}

// SAFETY: the name stands for this function in the run-time ABI, with this signature.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fadd(a: u32, b: u32) -> u32 {
    sum(a, b)
}

// SAFETY: as above.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fsub(a: u32, b: u32) -> u32 {
    sum(a, b ^ 0x8000_0000)
}

// SAFETY: as above.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fmul(a: u32, b: u32) -> u32 {
    multiplied(a, b).unwrap_or_else(|| other_product(a, b))
}

// SAFETY: as above.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fdiv(a: u32, b: u32) -> u32 {
    divided(a, b).unwrap_or_else(|| other_quotient(a, b))
}

// SAFETY: as above; comparisons give 1 or 0.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fcmplt(a: u32, b: u32) -> u32 {
    u32::from(is_less(a, b))
}

// SAFETY: as above.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fcmple(a: u32, b: u32) -> u32 {
    u32::from(is_at_most(a, b))
}

// SAFETY: as above.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fcmpgt(a: u32, b: u32) -> u32 {
    u32::from(is_less(b, a))
}

// SAFETY: as above.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fcmpge(a: u32, b: u32) -> u32 {
    u32::from(is_at_most(b, a))
}

// SAFETY: as above.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fcmpeq(a: u32, b: u32) -> u32 {
    u32::from(is_equal(a, b))
}

// SAFETY: as above.
#[unsafe(no_mangle)]
extern "C" fn __aeabi_fcmpun(a: u32, b: u32) -> u32 {
    u32::from(is_unordered(a, b))
}

#[inline(always)]
fn sum(a: u32, b: u32) -> u32 {
    // A sum does not care which comes first: nothing has to be kept for the compiler's.
    let ordered = larger_first(a, b);
    added(ordered).unwrap_or_else(|| other_sum(ordered[0], ordered[1]))
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

#[cold]
#[inline(never)]
fn other_quotient(a: u32, b: u32) -> u32 {
    __divsf3(f32::from_bits(a), f32::from_bits(b)).to_bits()
}
