//! The configuration, 0x0100 to 0x01FF: holding registers behind a lock.

use crate::Module;
use crate::block::block;
use crate::codes::{
    AirRate, Baud, Command, Format, GapRule, Mode, Power, Scale, Signal, Switch as OnOff,
};
use crate::points::PointKind::{BitOutput, WordInput, WordOutput};
use crate::rule::{Narrower, Rule};
use crate::values::Values;

/// The value of KEY that opens the lock.
pub const OPENING_KEY: u16 = 0x5A17;

/// How long the lock stays open after the last configuration write, in seconds.
pub const OPEN_S: u32 = 60;

/// The value of SAFE that leaves an output as it is.
pub const HOLD: u16 = 0xFFFF;

/// The greatest raw value of a word point: 12 bits.
pub const RAW_MAX: u16 = 4095;

/// FILTER of a point that is no analog input, as the factory sets it, in ms.
pub const DEBOUNCE_DEFAULT_MS: u16 = 5;

/// MODULE of port 5, the only one with a slot.
const SLOT: Rule = Rule::restart(Values::up_to(6), 0);
/// MODULE of a port without a slot: `none`.
const NO_SLOT: Rule = Rule::restart(Values::only(0), 0);

const SAFE_OF_A_BIT: Narrower = Narrower::new(BitOutput, Values::up_to(1).or(HOLD), 0);
const START_OF_A_BIT: Narrower = Narrower::new(BitOutput, Values::up_to(1), 0);
const FILTER_OF_A_WORD: Narrower = Narrower::new(WordInput, Values::up_to(8), 4);
const RANGE_OF_AN_OUTPUT: Narrower = Narrower::new(WordOutput, Values::up_to(1), 0);

const SAFE_RULE: Rule = Rule::now(Values::up_to(RAW_MAX).or(HOLD), 0).but(&SAFE_OF_A_BIT);
const START_RULE: Rule = Rule::restart(Values::up_to(RAW_MAX), 0).but(&START_OF_A_BIT);
const FILTER_RULE: Rule =
    Rule::now(Values::up_to(1000), DEBOUNCE_DEFAULT_MS).but(&FILTER_OF_A_WORD);
const RANGE_RULE: Rule = Rule::now(Values::up_to(2), 0).but(&RANGE_OF_AN_OUTPUT);

block! {
    "Configuration", 0x0100..=0x01FF;

    /// Opens the lock for 60 s after the last configuration write: write 0x5A17. Reads 1 while open, 0 while closed
    KEY "KEY": 0x0100 x 1, "", Rule::now(Values::only(OPENING_KEY), 0), &[];
    /// Speed of the RS-485 line
    BAUD "BAUD": 0x0101 x 1, "100 bit/s", Rule::restart(Values::OneOf(Baud::CODES), 96), &[];
    /// Data bits, parity and stop bits. 7 data bits with MODE 1 only: with MODE 0 the write is exception 03
    FORMAT "FORMAT": 0x0102 x 1, "", Rule::restart(Values::up_to(6), 0), Format::NAMES;
    /// Transmission mode
    MODE "MODE": 0x0103 x 1, "", Rule::restart(Values::up_to(1), 0), Mode::NAMES;
    /// Communication watchdog: outputs go to SAFE after so long without a valid request; 0 = off
    COMM_TIMEOUT "COMM_TIMEOUT": 0x0104 x 1, "100 ms", Rule::now(Values::up_to(36_000), 0), &[];
    /// Pause before a response, beyond t3.5
    RESPONSE_DELAY "RESPONSE_DELAY": 0x0105 x 1, "ms", Rule::now(Values::up_to(1000), 0), &[];
    /// Silence that ends a frame; 0 = t3.5 by the standard
    FRAME_GAP "FRAME_GAP": 0x0106 x 1, "0.1 ms", Rule::restart(Values::range(5, 1000).or(0), 0), &[];
    /// What becomes of a frame with a gap above t1.5
    STRICT_T15 "STRICT_T15": 0x0107 x 1, "", Rule::restart(Values::up_to(1), 0), GapRule::NAMES;
    /// What to do once the response is out. Reads 0
    COMMAND "COMMAND": 0x0108 x 1, "", Rule::now(Values::range(1, 5).or(0xB007), 0), Command::NAMES;
    /// Module of ports 1-4, which have no slot
    MODULE "MODULE, ports 1-4": 0x0110 x 4, "", NO_SLOT, &[];
    /// Module of port 5, the slot
    MODULE_SLOT "MODULE, port 5": 0x0114 x 1, "", SLOT, &Module::NAMES;
    /// Module of ports 6-8, which have no slot
    MODULE_6 "MODULE, ports 6-8": 0x0115 x 3, "", NO_SLOT, &[];
    /// By point. Inputs: debounce in ms. Analog inputs: low-pass over 2^n samples
    FILTER "FILTER": 0x0120 x 32, "ms, or power of 2", FILTER_RULE, &[];
    /// The LoRa line
    LORA "LORA": 0x0140 x 1, "", Rule::restart(Values::up_to(1), 0), OnOff::NAMES;
    /// Address of the LoRa module
    LORA_ADDRESS "LORA_ADDRESS": 0x0141 x 1, "", Rule::restart(Values::ANY, 0), &[];
    /// Channel of the LoRa module: 410 MHz + n
    LORA_CHANNEL "LORA_CHANNEL": 0x0142 x 1, "MHz", Rule::restart(Values::up_to(31), 23), &[];
    /// Speed on the air
    LORA_AIR_RATE "LORA_AIR_RATE": 0x0143 x 1, "", Rule::restart(Values::up_to(5), 2), AirRate::NAMES;
    /// Power on the air
    LORA_POWER "LORA_POWER": 0x0144 x 1, "", Rule::restart(Values::up_to(3), 0), Power::NAMES;
    /// Silence that ends a frame on the LoRa line
    LORA_FRAME_GAP "LORA_FRAME_GAP": 0x0145 x 1, "ms", Rule::restart(Values::range(5, 500), 50), &[];
    /// By point. NTC constant of an analog input
    BETA "BETA": 0x0160 x 32, "K", Rule::now(Values::range(2000, 5000), 3950), &[];
    /// By point. Signal of an analog input; of an analog output 0 or 1, as its jumper is set
    RANGE "RANGE": 0x0180 x 32, "", RANGE_RULE, Signal::NAMES;
    /// By point. How an analog point is counted
    SCALE "SCALE": 0x01A0 x 32, "", Rule::now(Values::up_to(1), 0), Scale::NAMES;
    /// By point. Output when the line falls silent: 0xFFFF = hold, 0-1 for a bit, 0-4095 raw for a word
    SAFE "SAFE": 0x01C0 x 32, "", SAFE_RULE, &[];
    /// By point. Output at power-on: 0-1 for a bit, 0-4095 raw for a word
    START "START": 0x01E0 x 32, "", START_RULE, &[];
}

/// The settings by point: FILTER, BETA, RANGE, SCALE, SAFE and START.
pub const BY_POINT: [u16; 6] = [FILTER, BETA, RANGE, SCALE, SAFE, START];

/// The point that a setting is for, 0 to 31; `None` for a register that is no setting by point.
#[inline]
#[must_use]
pub fn point_of(address: u16) -> Option<u16> {
    let run = address & !(crate::points::COUNT - 1);
    BY_POINT.contains(&run).then_some(address.wrapping_sub(run))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points;

    #[test]
    fn a_setting_by_point_knows_its_point() {
        assert_eq!(point_of(FILTER), Some(0));
        assert_eq!(point_of(0x013F), Some(31));
        assert_eq!(point_of(SAFE + points::SLOT_FIRST), Some(16));
        for other in [KEY, BAUD, MODULE, MODULE_SLOT, LORA, 0x0150, 0x0200, 0xFFFF] {
            assert_eq!(point_of(other), None, "{other:#06x}");
        }
    }

    #[test]
    fn there_is_a_setting_for_every_point() {
        for first in BY_POINT {
            let rule = RULES.iter().find(|rule| rule.first == first).unwrap();
            assert_eq!(rule.count, points::COUNT);
        }
    }

    #[test]
    fn narrower_values_are_some_of_the_wider_ones() {
        for rule in RULES {
            let Some(narrower) = rule.narrower else {
                continue;
            };
            assert!(narrower.values.allow(narrower.default));
            let allowed = (0..=0xFFFF).filter(|value| narrower.values.allow(*value));
            assert!(rule.values.allow_all(allowed), "{:#06x}", rule.first);
        }
    }

    #[test]
    fn defaults_are_allowed_but_for_key_and_command_which_hold_nothing() {
        for rule in RULES {
            let holds = ![KEY, COMMAND].contains(&rule.first);
            assert_eq!(
                rule.values.allow(rule.default),
                holds,
                "{:#06x}",
                rule.first
            );
        }
    }
}
