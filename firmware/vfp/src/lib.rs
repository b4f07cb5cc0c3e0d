//! The square root instruction of Arm's single-precision floating-point unit.
//!
//! VSQRT.F32 rounds correctly, as IEEE 754 asks: its bits are those of any other correct square root. In software it takes
//! about fifty instructions.
#![no_std]

core::arch::global_asm!(
    ".fpu fpv4-sp-d16",
    ".section .text.feedspline_vsqrt_f32, \"ax\", %progbits",
    ".global feedspline_vsqrt_f32",
    ".type feedspline_vsqrt_f32, %function",
    ".thumb_func",
    "feedspline_vsqrt_f32:",
    "vsqrt.f32 s0, s0",
    "bx lr",
    ".size feedspline_vsqrt_f32, . - feedspline_vsqrt_f32",
    ".text",
);

// SAFETY: the function above takes and returns a number in s0, as the hard-float calling convention has it, and touches
// nothing else.
unsafe extern "C" {
    #[link_name = "feedspline_vsqrt_f32"]
    safe fn vsqrt(x: f32) -> f32;
}

/// Square root, correctly rounded.
#[inline(always)]
pub fn sqrt(x: f32) -> f32 {
    vsqrt(x)
}
