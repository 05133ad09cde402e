//! SW01, the eight-way DIP switch: read once at power-on.

use embedded_hal::digital::InputPin;

/// The switch as a number 0 to 255: position 1 is bit 0, and ON pulls its pin low.
pub(crate) fn read(positions: [&mut dyn InputPin<Error = core::convert::Infallible>; 8]) -> u8 {
    positions
        .into_iter()
        .enumerate()
        .fold(0, |value, (bit, pin)| {
            let Ok(on) = pin.is_low();
            value | u8::from(on) << bit
        })
}
