//! Every duration and size of the module, with its source: the manual (by section), or an assumption.
//!
//! The assumptions about AUX and the commands are on the slow side. A packet takes about as long as the LoRa modulation
//! with the usual spreading factors of these air rates. For a similar module (manual of the E220, chapter 6) the maker
//! gives a delay of 1.5 s for 100 bytes at 2.4 kbit/s, for which the model takes 0.7 s. So a packet takes twice as long
//! at the slow corner, and these bytes 1.2 s.

use f103::corner::Corner;
use f103::time::Time;

/// Self-check after power-on and after the command C4, in which AUX is low. Assumption: drivers in the field wait 40 ms
/// to 1 s.
pub const START_UP: Time = Time::from_ms(500);

/// Reconfiguration when the module leaves sleep, in which AUX is low. Assumption: drivers in the field wait 40 ms.
pub const RECONFIGURATION: Time = Time::from_ms(100);

/// Time from a change of M0 or M1 to the new mode, if the module is idle (manual 6.1).
pub const MODE_DELAY: Time = Time::from_ms(1);

/// Time from the rising edge of AUX to the new mode, if the pins have changed before (manual 5.6).
pub const MODE_AFTER_AUX: Time = Time::from_ms(2);

/// Time from the end of a command to its answer. AUX is low from the end of the command until the end of the answer.
/// Assumption.
pub const ANSWER: Time = Time::from_ms(20);

/// As [`ANSWER`], of the command C0, which stores the parameters. Assumption.
pub const STORE: Time = Time::from_ms(100);

/// Silence at the UART that ends a packet (manual 6.2) or a command (assumption), in byte times.
pub const SILENCE_BYTES: u64 = 3;

/// Most bytes in a packet (manual 6.2).
pub const PACKET_BYTES: usize = 58;

/// Size of the buffer from the UART to the air (manual 6.2), and of the one from the air to the UART (assumption).
/// Further bytes are lost.
pub const BUFFER_BYTES: usize = 512;

/// Preamble and header of a packet, in bits at the air rate. Assumption: 107 ms at 2.4 kbit/s, except at the slow
/// corner.
pub const OVERHEAD_BITS: u64 = 256;

/// Time from the end of a packet that a module has sent until it can receive, or send the next packet. Assumption.
pub const TURNAROUND: Time = Time::from_ms(5);

/// Time from the end of a packet on the air until the receiver has checked it, when AUX goes low. Assumption.
pub const CHECK: Time = Time::from_ms(2);

/// Time from the falling edge of AUX until the receiver sends the bytes at TXD (manual 6.2; 2 to 3 ms in an older
/// manual).
pub const OUTPUT_DELAY: Time = Time::from_ms(5);

/// Returns the duration of a packet with `bytes` bytes at an air rate of `rate` bit/s, without a wake-up preamble.
/// Assumption: all bits are sent at the nominal rate, or at half of it at the slow corner.
#[must_use]
pub const fn packet(bytes: usize, rate: u32, corner: Corner) -> Time {
    let bits = OVERHEAD_BITS + 8 * bytes as u64;
    let times = match corner {
        Corner::Nominal | Corner::Fast | Corner::Gd32 => 1,
        Corner::Slow => 2,
    };
    Time::cycles(bits * times, rate)
}

/// How far the places of the air may be apart in time when they exchange their packets: a packet is known everywhere
/// before its receivers check it, and so is every packet that overlaps it. Less than [`CHECK`] by more than the
/// longest instruction.
pub(crate) const LOOK_AHEAD: Time = Time::from_ms(1);
const _: () = assert!(LOOK_AHEAD.as_ps() < CHECK.as_ps());
const _: () = assert!(CHECK.as_ps() < packet(1, 19_200, Corner::Nominal).as_ps());

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packet_has_its_bits_at_the_air_rate_and_the_overhead() {
        // (256 + 8 * 8) bits at 2.4 kbit/s.
        let nominal = |bytes, rate| packet(bytes, rate, Corner::Nominal);
        assert_eq!(nominal(8, 2400).as_us(), 133_333);
        assert_eq!(nominal(58, 2400).as_us(), 300_000);
        assert_eq!(nominal(58, 300).as_ms(), 2400);
        assert_eq!(nominal(1, 19_200).as_us(), 13_750);
        assert_eq!(packet(58, 2400, Corner::Slow).as_ms(), 600);
    }
}
