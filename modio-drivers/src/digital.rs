//! Digital lines of a slot. A line that fails is reported, and the others still work.

use embedded_hal::digital::{InputPin, OutputPin, PinState};

use crate::{Channels, ModuleError, debounce::Debounce};

/// Reads inputs, from channel 1 on, each through its filter. A low line sets its bit.
pub(crate) fn read(
    lines: &mut [impl InputPin],
    filters: &mut [Debounce],
    channels: &mut Channels,
) -> Result<(), ModuleError> {
    let mut result = Ok(());
    for (channel, (line, filter)) in lines.iter_mut().zip(filters).enumerate() {
        match line.is_low() {
            Ok(low) => channels.set_bit(channel, filter.sample(low)),
            Err(_) => result = ModuleError::in_either(result, Err(ModuleError::line(channel))),
        }
    }
    result
}

/// Drives outputs, from channel `first` on, counted from 0: every line in every call, changed or not, so that a
/// disturbed output is wrong for one scan at most.
pub(crate) fn drive(
    lines: &mut [impl OutputPin],
    first: usize,
    channels: &Channels,
) -> Result<(), ModuleError> {
    let mut result = Ok(());
    for (channel, line) in (first..).zip(lines) {
        if line
            .set_state(PinState::from(channels.bit(channel)))
            .is_err()
        {
            result = ModuleError::in_either(result, Err(ModuleError::line(channel)));
        }
    }
    result
}

/// Lines for the tests of drivers.
#[cfg(test)]
pub(crate) mod mock {
    extern crate std;
    use std::vec::Vec;

    use embedded_hal_mock::eh1::MockError;
    pub use embedded_hal_mock::eh1::digital::{Mock, State, Transaction};

    /// Returns an input with these levels, one for each scan: `true` is low.
    pub fn input(low: &[bool]) -> Mock {
        let level = |&low: &bool| if low { State::Low } else { State::High };
        Mock::new(
            &low.iter()
                .map(level)
                .map(Transaction::get)
                .collect::<Vec<_>>(),
        )
    }

    /// Returns an output that is driven to these levels, one in each scan: `true` is high.
    pub fn output(high: &[bool]) -> Mock {
        let level = |&high: &bool| if high { State::High } else { State::Low };
        Mock::new(
            &high
                .iter()
                .map(level)
                .map(Transaction::set)
                .collect::<Vec<_>>(),
        )
    }

    /// Returns a line that fails in this transaction.
    pub fn failing(transaction: Transaction) -> Mock {
        let error = MockError::Io(std::io::ErrorKind::NotConnected);
        Mock::new(&[transaction.with_error(error)])
    }
}
