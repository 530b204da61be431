//! What floats compute. A result that is no number is always the same one: what a plug-in does must not
//! depend on the machine that runs it.

use crate::Trap;
use crate::opcode::*;

fn f32_of(bits: u64) -> f32 {
    f32::from_bits(bits as u32)
}

fn f64_of(bits: u64) -> f64 {
    f64::from_bits(bits)
}

fn of_f32(value: f32) -> u64 {
    u64::from(if value.is_nan() { 0x7FC0_0000 } else { value.to_bits() })
}

fn of_f64(value: f64) -> u64 {
    if value.is_nan() { 0x7FF8_0000_0000_0000 } else { value.to_bits() }
}

/// Whether the operator takes two operands.
pub(crate) fn takes_two(operator: u8) -> bool {
    matches!(
        operator,
        F32_EQ..=F64_GE | F32_ADD..=F32_COPYSIGN | F64_ADD..=F64_COPYSIGN
    )
}

/// An operator on two floats.
#[expect(clippy::float_cmp, reason = "that is what the operators do")]
pub(crate) fn two(operator: u8, left: u64, right: u64) -> u64 {
    if matches!(operator, F32_EQ..=F32_GE | F32_ADD..=F32_COPYSIGN) {
        let (a, b) = (f32_of(left), f32_of(right));
        return match operator {
            F32_EQ => u64::from(a == b),
            F32_NE => u64::from(a != b),
            F32_LT => u64::from(a < b),
            F32_GT => u64::from(a > b),
            F32_LE => u64::from(a <= b),
            F32_GE => u64::from(a >= b),
            F32_ADD => of_f32(a + b),
            F32_SUB => of_f32(a - b),
            F32_MUL => of_f32(a * b),
            F32_DIV => of_f32(a / b),
            F32_MIN => of_f32(if a.is_nan() || b.is_nan() { f32::NAN } else { least_f32(a, b) }),
            F32_MAX => of_f32(if a.is_nan() || b.is_nan() { f32::NAN } else { -least_f32(-a, -b) }),
            // Only the sign's bit: a NaN stays the one that it is.
            _ => u64::from(a.copysign(b).to_bits()),
        };
    }
    let (a, b) = (f64_of(left), f64_of(right));
    match operator {
        F64_EQ => u64::from(a == b),
        F64_NE => u64::from(a != b),
        F64_LT => u64::from(a < b),
        F64_GT => u64::from(a > b),
        F64_LE => u64::from(a <= b),
        F64_GE => u64::from(a >= b),
        F64_ADD => of_f64(a + b),
        F64_SUB => of_f64(a - b),
        F64_MUL => of_f64(a * b),
        F64_DIV => of_f64(a / b),
        F64_MIN => of_f64(if a.is_nan() || b.is_nan() { f64::NAN } else { least_f64(a, b) }),
        F64_MAX => of_f64(if a.is_nan() || b.is_nan() { f64::NAN } else { -least_f64(-a, -b) }),
        _ => a.copysign(b).to_bits(),
    }
}

/// Of two zeros, the negative one.
fn least_f32(a: f32, b: f32) -> f32 {
    if a < b || (a <= b && a.is_sign_negative()) { a } else { b }
}

fn least_f64(a: f64, b: f64) -> f64 {
    if a < b || (a <= b && a.is_sign_negative()) { a } else { b }
}

/// An operator on one operand, of which at least one side is a float.
pub(crate) fn one(operator: u8, bits: u64) -> Result<u64, Trap> {
    let (a, b) = (f32_of(bits), f64_of(bits));
    Ok(match operator {
        F32_ABS => u64::from(a.abs().to_bits()),
        F32_NEG => u64::from((-a).to_bits()),
        F32_CEIL => of_f32(libm::ceilf(a)),
        F32_FLOOR => of_f32(libm::floorf(a)),
        F32_TRUNC => of_f32(libm::truncf(a)),
        F32_NEAREST => of_f32(libm::rintf(a)),
        F32_SQRT => of_f32(libm::sqrtf(a)),
        F64_ABS => b.abs().to_bits(),
        F64_NEG => (-b).to_bits(),
        F64_CEIL => of_f64(libm::ceil(b)),
        F64_FLOOR => of_f64(libm::floor(b)),
        F64_TRUNC => of_f64(libm::trunc(b)),
        F64_NEAREST => of_f64(libm::rint(b)),
        F64_SQRT => of_f64(libm::sqrt(b)),
        I32_TRUNC_F32_S => {
            u64::from(whole(f64::from(a), -2_147_483_649.0, 2_147_483_648.0)? as i32 as u32)
        }
        I32_TRUNC_F64_S => u64::from(whole(b, -2_147_483_649.0, 2_147_483_648.0)? as i32 as u32),
        I32_TRUNC_F32_U => u64::from(whole(f64::from(a), -1.0, 4_294_967_296.0)? as u32),
        I32_TRUNC_F64_U => u64::from(whole(b, -1.0, 4_294_967_296.0)? as u32),
        I64_TRUNC_F32_S => whole(f64::from(a), BELOW_I64, ABOVE_I64)? as i64 as u64,
        I64_TRUNC_F64_S => whole(b, BELOW_I64, ABOVE_I64)? as i64 as u64,
        I64_TRUNC_F32_U => whole(f64::from(a), -1.0, ABOVE_U64)? as u64,
        I64_TRUNC_F64_U => whole(b, -1.0, ABOVE_U64)? as u64,
        F32_CONVERT_I32_S => of_f32(bits as i32 as f32),
        F32_CONVERT_I32_U => of_f32(bits as u32 as f32),
        F32_CONVERT_I64_S => of_f32(bits as i64 as f32),
        F32_CONVERT_I64_U => of_f32(bits as f32),
        F32_DEMOTE_F64 => of_f32(b as f32),
        F64_CONVERT_I32_S => of_f64(f64::from(bits as i32)),
        F64_CONVERT_I32_U => of_f64(f64::from(bits as u32)),
        F64_CONVERT_I64_S => of_f64(bits as i64 as f64),
        F64_CONVERT_I64_U => of_f64(bits as f64),
        F64_PROMOTE_F32 => of_f64(f64::from(a)),
        I32_REINTERPRET_F32 | F32_REINTERPRET_I32 => u64::from(bits as u32),
        // The two that take 64 bits for what they are.
        _ => bits,
    })
}

/// The next float below i64's range: none lies between it and -2^63.
const BELOW_I64: f64 = -9_223_372_036_854_777_856.0;
const ABOVE_I64: f64 = 9_223_372_036_854_775_808.0;
const ABOVE_U64: f64 = 18_446_744_073_709_551_616.0;

/// A float that lies between the two bounds, and on neither.
fn whole(value: f64, above: f64, below: f64) -> Result<f64, Trap> {
    if value.is_nan() {
        return Err(Trap::InvalidConversion);
    }
    if value > above && value < below { Ok(value) } else { Err(Trap::IntegerOverflow) }
}
