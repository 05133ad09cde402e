//! Conversion of a code to a temperature, in integers, for a 10 k thermistor to ground with a 10 k pull-up to the
//! converter's reference.
//!
//! The thermistor's resistance is R = 10 k * exp(B * (1/T - 1/T0)) with T0 = 298.15 K, and the code is
//! c = 4095 * R / (R + 10 k), so R / 10 k = c / (4095 - c) and
//!
//! ```text
//! T = T0 * B / (B + T0 * ln(c / (4095 - c)))
//! ```
//!
//! The logarithm is the difference of two binary logarithms from a table with interpolation. Numerator and
//! denominator then fit 32 bits, so one division is enough (at most 12 cycles on a Cortex-M3). 0 degC is 2731.5
//! tenths of a kelvin, so discarding the remainder and subtracting 2731 rounds to the nearest tenth.
//!
//! The table is exact to 2^-16 and the interpolation adds at most 1.8e-4, together less than 0.01 K up to 125 degC.
//! With the rounding to a tenth, the test finds an error of at most 0.06 degC for every B and every code between
//! -40 and 125 degC.

use register_map::limits::{BETA_MAX, BETA_MIN};

use crate::Code;

/// Largest result of [`tenths_celsius`], far above any thermistor: 300 degC.
const SATURATED: i16 = 3000;

/// Result of [`tenths_celsius`] for an infinite resistance: 0 K, rounded.
const FROZEN: i16 = -2731;

/// Number of segments of the logarithm table.
const SEGMENTS: usize = 32;

/// log2(1 + i / 32) in 1/65536.
const LOG2: [u32; SEGMENTS + 1] = log2_table();

/// Returns the temperature in 0.1 degC for a code. `beta` is the B constant in K, limited to [`BETA_MIN`] to
/// [`BETA_MAX`]. The result is within 0.1 degC of the formula between -40 and 125 degC. Above that range it is
/// limited to 300 degC.
#[must_use]
pub fn tenths_celsius(code: Code, beta: u16) -> i16 {
    /// Numerator and denominator are in 1/256 K; 2981.5 is T0 in tenths of a kelvin.
    const T0_TENTHS: u32 = 29_815 * 256 / 10;
    /// T0 * ln 2 in the unit of the denominator, 298.15 * 0.693147 * 256, with 8 more bits.
    const T0_LN2: i64 = 13_543_789;

    let code = code.get();
    let low = Code::MAX.get() - code;
    let (Some(upper), Some(lower)) = (log2(code), log2(low)) else {
        return if code == 0 { SATURATED } else { FROZEN };
    };
    let beta = beta.clamp(BETA_MIN, BETA_MAX);
    // The product is below 2^44. 16 bits are the fraction of the logarithm, 8 that of the constant.
    let t0_ln = ((upper - lower) as i64 * T0_LN2) >> 24;
    let denominator = i64::from(beta) * 256 + t0_ln;
    let tenths_kelvin = u32::try_from(denominator)
        .ok()
        .and_then(|denominator| (T0_TENTHS * u32::from(beta)).checked_div(denominator));
    match tenths_kelvin.map(i32::try_from) {
        Some(Ok(kelvin)) => (kelvin - 2731).min(i32::from(SATURATED)) as i16,
        _ => SATURATED,
    }
}

/// Returns the binary logarithm in 1/65536, or `None` for 0.
fn log2(x: u16) -> Option<i32> {
    let exponent = x.checked_ilog2()?;
    // The mantissa, 1 to 2, in 1/32768: five bits select the segment, ten the position in it.
    let mantissa = u32::from(x) << (15 - exponent);
    let segment = (mantissa >> 10) as usize % SEGMENTS;
    let place = mantissa & 0x3FF;
    let [from, to] = *LOG2.get(segment..)?.first_chunk()?;
    Some(((exponent << 16) + from + (((to - from) * place + 512) >> 10)) as i32)
}

/// Computes the table. Squaring doubles the logarithm; its next bit is 1 if the square reaches 2.
const fn log2_table() -> [u32; SEGMENTS + 1] {
    let mut table = [0; SEGMENTS + 1];
    let mut i = 0;
    while i < SEGMENTS {
        // In units of 2^-31, from 1 to 2.
        let mut x: u64 = (1 << 31) + (((i as u64) << 31) / SEGMENTS as u64);
        let mut log: u32 = 0;
        let mut bit = 0;
        // One more bit than is kept, for rounding.
        while bit < 17 {
            x = (x * x) >> 31;
            log <<= 1;
            if x >= 1 << 32 {
                log |= 1;
                x >>= 1;
            }
            bit += 1;
        }
        table[i] = (log + 1) >> 1;
        i += 1;
    }
    table[SEGMENTS] = 1 << 16;
    table
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::{println, vec::Vec};

    use register_map::limits::BETA_DEFAULT;

    use super::*;

    /// Returns ln(R / 10 k) of every code but 0 and 4095, in floating point.
    fn logarithms() -> Vec<(u16, f64)> {
        let ln = |code: u16| (f64::from(code) / (4095.0 - f64::from(code))).ln();
        (1..4095).map(|code| (code, ln(code))).collect()
    }

    /// The formula in floating point, in degC.
    fn exact(logarithm: f64, beta: u16) -> f64 {
        1.0 / (1.0 / 298.15 + logarithm / f64::from(beta)) - 273.15
    }

    #[test]
    fn the_table_holds_binary_logarithms() {
        for (i, &entry) in LOG2.iter().enumerate() {
            let exact = (1.0 + i as f64 / SEGMENTS as f64).log2() * 65536.0;
            assert!((f64::from(entry) - exact).abs() <= 0.51, "{i}");
        }
        for x in 1..=u16::MAX {
            let exact = f64::from(x).log2();
            let got = f64::from(log2(x).unwrap()) / 65536.0;
            assert!((got - exact).abs() < 2.1e-4, "{x}: {got} for {exact}");
        }
        assert_eq!(log2(0), None);
    }

    #[test]
    fn every_code_and_every_beta_is_within_a_tenth_of_the_formula() {
        let codes = logarithms();
        let mut worst = 0.0_f64;
        for beta in BETA_MIN..=BETA_MAX {
            let (mut near, mut wide) = (0.0_f64, 0.0_f64);
            for &(code, logarithm) in &codes {
                let exact = exact(logarithm, beta);
                let error = (f64::from(tenths_celsius(Code::new(code), beta)) / 10.0 - exact).abs();
                if (-20.0..=80.0).contains(&exact) {
                    near = near.max(error);
                }
                if (-40.0..=125.0).contains(&exact) {
                    wide = wide.max(error);
                }
            }
            assert!(near < 0.06, "beta {beta}: {near} degC, -20 to 80");
            assert!(wide < 0.065, "beta {beta}: {wide} degC, -40 to 125");
            worst = worst.max(wide);
            if beta % 500 == 0 || beta == BETA_DEFAULT {
                println!("beta {beta}: {near:.4} degC, -20 to 80; {wide:.4} degC, -40 to 125");
            }
        }
        println!("any beta: {worst:.4} degC, -40 to 125");
    }

    #[test]
    fn a_higher_code_never_gives_a_higher_temperature_and_the_ends_are_limited() {
        for beta in [0, BETA_MIN, BETA_DEFAULT, BETA_MAX, u16::MAX] {
            assert_eq!(tenths_celsius(Code::new(0), beta), SATURATED);
            assert_eq!(tenths_celsius(Code::new(1), beta), SATURATED);
            assert_eq!(tenths_celsius(Code::MAX, beta), FROZEN);
            for code in 1..=4095 {
                assert!(
                    tenths_celsius(Code::new(code), beta)
                        <= tenths_celsius(Code::new(code - 1), beta)
                );
            }
        }
    }
}
