//! SW01, the eight-way DIP switch: its pins as a number, read until the number is stable.
//!
//! The switch is read after a power-on only. The kept region has the number over every other reset: by the watchdog,
//! by software or by the reset pin. Otherwise a unit in service could change its address at a reset, which its master
//! does not expect.

use crate::{
    design::{DIP_POLLS, DIP_STABLE_POLLS},
    pin::Pin,
};

/// Returns the switch as a number from 0 to 255, given access to the levels of its pins. Position 1 is bit 0; a position
/// that is ON pulls its pin low.
pub(crate) fn number(switch: &[Pin; 8], is_high: impl Fn(Pin) -> bool) -> u8 {
    let positions = switch.iter().rev();
    positions.fold(0, |number, pin| number << 1 | u8::from(!is_high(*pin)))
}

/// Returns the switch once [`DIP_STABLE_POLLS`] more readings equal the first, calling `wait` between readings. If
/// that does not happen within [`DIP_POLLS`] readings, returns the last one.
pub(crate) fn stable(mut read: impl FnMut() -> u8, mut wait: impl FnMut()) -> u8 {
    let mut value = read();
    let mut equal = 0;
    for _ in 0..DIP_POLLS {
        if equal == DIP_STABLE_POLLS {
            break;
        }
        wait();
        let now = read();
        equal = if now == value { equal + 1 } else { 0 };
        value = now;
    }
    value
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;
    use crate::boards::{AddressPins, modio_02, modio_08};

    /// Feeds these readings to `stable`, repeating the last one, and returns the value and the number of readings
    /// taken.
    fn read(readings: &[u8]) -> (u8, usize) {
        let mut taken = 0;
        let value = stable(
            || {
                let reading = readings[taken.min(readings.len() - 1)];
                taken += 1;
                reading
            },
            || {},
        );
        (value, taken)
    }

    #[test]
    fn stable_switch_is_read_for_ten_polls() {
        assert_eq!(read(&[17]), (17, 1 + DIP_STABLE_POLLS as usize));
    }

    #[test]
    fn bouncing_switch_is_read_once_it_is_stable() {
        let bounces = [17, 17, 19, 17, 17, 17, 17, 17, 19, 19, 17];
        assert_eq!(
            read(&bounces),
            (17, bounces.len() + DIP_STABLE_POLLS as usize)
        );
    }

    #[test]
    fn switch_that_never_settles_returns_the_last_reading() {
        let bounces: Vec<u8> = (0..200).map(|n| 17 + n % 2).collect();
        let (value, taken) = read(&bounces);
        assert_eq!(taken, 1 + DIP_POLLS as usize);
        assert_eq!(value, bounces[taken - 1]);
    }

    #[test]
    fn every_position_has_its_own_bit() {
        let on = |switch: &[Pin; 8], low: &[Pin]| number(switch, |pin| !low.contains(&pin));
        for (address, lower, upper) in [
            (
                modio_02::BOARD.address,
                Pin::a as fn(u8) -> Pin,
                (Pin::b as fn(u8) -> Pin),
            ),
            (modio_08::BOARD.address, |n| Pin::c(n + 2), Pin::b),
        ] {
            let AddressPins::Switch(switch) = &address else {
                panic!("the board has SW01");
            };
            assert_eq!((on(switch, &[]), on(switch, switch)), (0, 255));
            for position in 0..4 {
                assert_eq!(on(switch, &[lower(4 + position)]), 1 << position);
                assert_eq!(on(switch, &[upper(12 + position)]), 16 << position);
            }
        }
    }
}
