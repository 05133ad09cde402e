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
