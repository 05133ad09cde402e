//! The filter of an analog input: a first-order low-pass, y += (x - y) / 2^n per sample.
//!
//! Its step response is that of an RC filter with a time constant of 2^n samples; with n = 0 it does not filter.
//! The state is a fixed-point code whose scale does not depend on n, so changing n changes the speed but not the
//! value. The shift drops bits of the difference, which leaves the state at most (2^n - 1) / 65536 below a steady
//! input, so the rounded code settles exactly.

use register_map::limits::LOW_PASS_MAX;

use crate::Code;

/// Number of fraction bits. With the 12 bits of a code the state has 28 bits, so differences fit an `i32`.
const FRACTION: u32 = 16;

/// A low-pass over 12-bit codes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LowPass {
    n: u16,
    /// `None` before the first sample, which is not filtered.
    state: Option<i32>,
}

impl LowPass {
    pub(crate) const fn new(n: u16) -> Self {
        Self { n, state: None }
    }

    /// Sets n, at most [`LOW_PASS_MAX`].
    pub(crate) fn set_n(&mut self, n: u16) {
        self.n = n.min(LOW_PASS_MAX);
    }

    /// Discards the state: the next sample is not filtered.
    pub(crate) const fn reset(&mut self) {
        self.state = None;
    }

    /// Adds a sample.
    pub(crate) fn sample(&mut self, code: Code) {
        let input = i32::from(code.get()) << FRACTION;
        self.state = Some(match self.state {
            Some(state) => state + ((input - state) >> self.n),
            None => input,
        });
    }

    /// Returns the filtered code, or `None` before the first sample.
    pub(crate) fn code(&self) -> Option<Code> {
        const HALF: i32 = 1 << (FRACTION - 1);
        self.state
            .map(|state| Code::new(((state + HALF) >> FRACTION) as u16))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settled(n: u16, code: u16) -> LowPass {
        let mut filter = LowPass::new(n);
        filter.sample(Code::new(code));
        filter
    }

    fn shown(filter: &LowPass) -> Option<u16> {
        filter.code().map(Code::get)
    }

    #[test]
    fn the_first_sample_is_not_filtered() {
        for n in 0..=LOW_PASS_MAX {
            assert_eq!(shown(&LowPass::new(n)), None);
            assert_eq!(shown(&settled(n, 4095)), Some(4095));
            let mut filter = settled(n, 4095);
            filter.reset();
            assert_eq!(shown(&filter), None);
            filter.sample(Code::new(17));
            assert_eq!(shown(&filter), Some(17));
        }
    }

    #[test]
    fn the_step_response_is_that_of_an_rc_filter() {
        for n in 0..=LOW_PASS_MAX {
            for (from, to) in [(0, 4095), (4095, 0), (1000, 1100), (2048, 2047)] {
                let mut filter = settled(n, from);
                let keep = 1.0 - 1.0 / f64::from(1 << n);
                for k in 1..=3000 {
                    filter.sample(Code::new(to));
                    let step = f64::from(from) - f64::from(to);
                    let exact = f64::from(to) + step * keep.powi(k);
                    let code = f64::from(shown(&filter).unwrap());
                    assert!(
                        (code - exact).abs() <= 0.51,
                        "n {n}, {from} to {to}, sample {k}: {code} for {exact}"
                    );
                }
            }
        }
    }

    #[test]
    fn every_code_settles_exactly_from_above_and_from_below() {
        for n in 0..=LOW_PASS_MAX {
            for code in (0..=4095).step_by(13).chain([1, 4094, 4095]) {
                for from in [0, 4095] {
                    let mut filter = settled(n, from);
                    // 12 bits of step and one of rounding need 13 ln 2 = 9.01 time constants.
                    (0..10 << n).for_each(|_| filter.sample(Code::new(code)));
                    assert_eq!(shown(&filter), Some(code), "n {n} from {from}");
                }
            }
        }
    }

    #[test]
    fn another_n_does_not_change_the_value() {
        let mut filter = settled(8, 0);
        (0..100).for_each(|_| filter.sample(Code::new(4000)));
        let before = shown(&filter);
        for n in [0, 8, 3, u16::MAX] {
            filter.set_n(n);
            assert_eq!(shown(&filter), before);
        }
        assert_eq!(filter.n, LOW_PASS_MAX);
        filter.set_n(0);
        filter.sample(Code::new(4000));
        assert_eq!(shown(&filter), Some(4000));
    }
}
