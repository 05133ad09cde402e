//! The configuration, 0x0100 to 0x01FF: holding registers protected by a lock.

use crate::block::{Text, block};
use crate::codes::{
    AirRate, Baud, CommSource, Command, Format, GapRule, Lora, Mode, Power, Scale, Signal,
};
use crate::kind::Kind::{BitOutput, WordInput, WordOutput};
use crate::limits::{
    BETA_DEFAULT, BETA_MAX, BETA_MIN, DEBOUNCE_DEFAULT_MS, DEBOUNCE_MAX_MS, LOW_PASS_DEFAULT,
    LOW_PASS_MAX, RAW_MAX,
};
use crate::rule::{Narrower, Rule};
use crate::value::{Unit, Value};
use crate::values::Values;
use crate::{Module, points};

/// Value of KEY that opens the lock.
pub const OPENING_KEY: u16 = 0x5A17;

/// Time for which the lock stays open after the last configuration write, in seconds.
pub const OPEN_S: u32 = 60;

/// Number of saves that a unit may write to its flash one after another.
pub const SAVES: u8 = 20;

/// Time after which a unit may write one more save, in seconds.
pub const SAVE_EVERY_S: u32 = 60;

/// Number of records of outputs that a unit may write to its flash one after another, and in a day.
pub const RECORDS: u8 = 80;

/// Time after which a unit may write one more record of outputs, in seconds.
pub const RECORD_EVERY_S: u32 = 24 * 3600 / RECORDS as u32;

/// Least time between two records of outputs, in seconds.
pub const RECORD_AFTER_S: u32 = 10;

/// Value of SAFE that leaves an output unchanged.
pub const HOLD: u16 = 0xFFFF;

/// Value of START by which an output starts with the value that a master or a link commanded last.
pub const AS_IT_WAS: u16 = 0xFFFE;

const SAFE_OF_A_BIT: Narrower = Narrower::new(BitOutput, Values::up_to(1).or(HOLD), 0);
const START_OF_A_BIT: Narrower = Narrower::new(BitOutput, Values::up_to(1).or(AS_IT_WAS), 0);
const PLAIN_START_OF_A_BIT: Narrower = Narrower::new(BitOutput, Values::up_to(1), 0);
const FILTER_OF_A_WORD: Narrower =
    Narrower::new(WordInput, Values::up_to(LOW_PASS_MAX), LOW_PASS_DEFAULT);
const RANGE_OF_AN_OUTPUT: Narrower = Narrower::new(WordOutput, Values::up_to(1), 0);

const SAFE_RULE: Rule = Rule::now(Values::up_to(RAW_MAX).or(HOLD), 0).but(&SAFE_OF_A_BIT);
const START_RULE: Rule =
    Rule::restart(Values::up_to(RAW_MAX).or(AS_IT_WAS), 0).but(&START_OF_A_BIT);
const PLAIN_START_RULE: Rule = Rule::restart(Values::up_to(RAW_MAX), 0).but(&PLAIN_START_OF_A_BIT);
const FILTER_RULE: Rule =
    Rule::now(Values::up_to(DEBOUNCE_MAX_MS), DEBOUNCE_DEFAULT_MS).but(&FILTER_OF_A_WORD);
const RANGE_RULE: Rule = Rule::now(Values::up_to(2), 0).but(&RANGE_OF_AN_OUTPUT);

/// Frequency of a channel: 410 MHz plus 1 MHz per step.
const LORA_MHZ: Value = Value::Number(Unit {
    code: "MHz",
    exponent: 0,
    offset: 410,
});

block! {
    "Configuration", 0x0100..=0x01FF;

    /// 0x5A17 unlocks for 60 s. Reads 1 then
    KEY "KEY": 0x0100 x 1, Value::NUMBER, Rule::now(Values::only(OPENING_KEY), 0);
    /// Speed of the line
    BAUD "BAUD": 0x0101 x 1, Value::tens("bit/s", 2), Rule::restart(Values::OneOf(Baud::CODES), 96);
    /// Data, parity and stop bits. 7 bits need MODE 1
    FORMAT "FORMAT": 0x0102 x 1, Value::Codes(Format::NAMES), Rule::restart(Values::up_to(6), 0);
    /// Transmission mode
    MODE "MODE": 0x0103 x 1, Value::Codes(Mode::NAMES), Rule::restart(Values::up_to(1), 0);
    /// Silence until outputs go to SAFE; 0 = off
    COMM_TIMEOUT "COMM_TIMEOUT": 0x0104 x 1, Value::tens("s", -1), Rule::now(Values::up_to(36_000), 0);
    /// Pause before a response, beyond t3.5
    RESPONSE_DELAY "RESPONSE_DELAY": 0x0105 x 1, Value::number("ms"), Rule::now(Values::up_to(1000), 0);
    /// Silence that ends a frame; 0 = t3.5
    FRAME_GAP "FRAME_GAP": 0x0106 x 1, Value::tens("ms", -1), Rule::restart(Values::range(2, 1000).or(0), 0);
    /// Frames with a gap above t1.5
    STRICT_T15 "STRICT_T15": 0x0107 x 1, Value::Codes(GapRule::NAMES), Rule::restart(Values::up_to(1), 0);
    /// Runs after the response. Reads 0
    COMMAND "COMMAND": 0x0108 x 1, Value::Codes(Command::NAMES), Rule::now(Values::OneOf(Command::CODES), 0);
    /// Requests that restart COMM_TIMEOUT
    COMM_SOURCE "COMM_SOURCE": 0x0109 x 1, Value::Codes(CommSource::NAMES), Rule::now(Values::up_to(3), 0);
    /// Unit address of a board without switch
    UNIT "UNIT": 0x010A x 1, Value::NUMBER, Rule::restart(Values::range(1, 247), 1);
    /// Low word of the serial number; 0 = from the unique identity
    SERIAL_LOW "SERIAL_LOW": 0x010B x 1, Value::NUMBER, Rule::restart(Values::ANY, 0);
    /// Only restarts COMM_TIMEOUT, without KEY. Reads 0
    HEARTBEAT "HEARTBEAT": 0x010C x 1, Value::NUMBER, Rule::now(Values::ANY, 0);
    /// Module in the slot
    MODULE "MODULE": 0x0110 x 8, Value::Codes(Module::NAMES), Rule::restart(Values::up_to(Module::LAST), 0);
    /// Debounce, or low-pass over 2^n samples
    FILTER "FILTER": 0x0120 x 32, Value::number("ms") => Value::NUMBER, FILTER_RULE;
    /// The LoRa line; 2 is recommended
    LORA "LORA": 0x0140 x 1, Value::Codes(Lora::NAMES), Rule::restart(Values::up_to(2), 0);
    /// Address of the LoRa module
    LORA_ADDRESS "LORA_ADDRESS": 0x0141 x 1, Value::NUMBER, Rule::restart(Values::ANY, 0);
    /// Channel of the LoRa module
    LORA_CHANNEL "LORA_CHANNEL": 0x0142 x 1, LORA_MHZ, Rule::restart(Values::up_to(31), 23);
    /// Speed on the air
    LORA_AIR_RATE "LORA_AIR_RATE": 0x0143 x 1, Value::Codes(AirRate::NAMES), Rule::restart(Values::up_to(5), 2);
    /// Power on the air
    LORA_POWER "LORA_POWER": 0x0144 x 1, Value::Codes(Power::NAMES), Rule::restart(Values::up_to(3), 0);
    /// Silence that ends a frame on the air
    LORA_FRAME_GAP "LORA_FRAME_GAP": 0x0145 x 1, Value::number("ms"), Rule::restart(Values::range(5, 500), 300);
    /// Constant of an NTC
    BETA "BETA": 0x0160 x 32, Value::number("K"), Rule::now(Values::range(BETA_MIN, BETA_MAX), BETA_DEFAULT);
    /// Signal; an output has a jumper too
    RANGE "RANGE": 0x0180 x 32, Value::Codes(Signal::NAMES), RANGE_RULE;
    /// Number format
    SCALE "SCALE": 0x01A0 x 32, Value::Codes(Scale::NAMES), Rule::now(Values::up_to(1), 0);
    /// Output while the line is silent, raw; 0xFFFF = hold
    SAFE "SAFE": 0x01C0 x 32, Value::NUMBER, SAFE_RULE;
    /// Output at power-on, raw; 0xFFFE = as it was
    START "START": 0x01E0 x 32, Value::NUMBER, START_RULE;
}

/// START of a board whose firmware does not keep outputs: without [`AS_IT_WAS`].
pub(crate) static PLAIN_START: (Rule, Text) = (
    PLAIN_START_RULE.at(START, points::COUNT),
    Text {
        name: "START",
        value: Value::NUMBER,
        narrower: None,
        about: " Output at power-on, raw",
    },
);

/// The rules of such a board, otherwise those of [`RULES`].
pub(crate) static PLAIN_RULES: &[Rule] = &{
    let mut rules = [PLAIN_START_RULE.at(START, points::COUNT); ROWS.len()];
    let mut i = 0;
    while i < rules.len() {
        if ROWS[i].first != START {
            rules[i] = ROWS[i];
        }
        i += 1;
    }
    rules
};

/// MODULE of a port, 1 to 8.
#[inline]
#[must_use]
pub const fn module_of(port: u16) -> u16 {
    MODULE.wrapping_add(port.wrapping_sub(1))
}

/// The settings by which a device has these modules in the slots of these ports, 1 to 8: address and value. An empty
/// slot is the default, which is not stored.
pub fn modules<P: Into<u16>>(
    slots: impl IntoIterator<Item = (P, Module)>,
) -> impl Iterator<Item = (u16, u16)> {
    let plugged = slots
        .into_iter()
        .filter(|(_, module)| *module != Module::None);
    plugged.map(|(port, module)| (module_of(port.into()), module.code()))
}

/// Returns the point of a setting by point, 0 to 31; `None` for any other register. The settings by point are FILTER,
/// BETA, RANGE, SCALE, SAFE and START, and no other rule of this block has a register for each point.
#[inline]
#[must_use]
pub fn point_of(address: u16) -> Option<u16> {
    let run = address & !(points::COUNT - 1);
    matches!(run, FILTER | BETA | RANGE | SCALE | SAFE | START).then_some(address.wrapping_sub(run))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn point_of_returns_the_point_of_a_setting() {
        assert_eq!(point_of(FILTER), Some(0));
        assert_eq!(point_of(0x013F), Some(31));
        assert_eq!(point_of(SAFE + points::first(5)), Some(16));
        for other in [
            KEY,
            BAUD,
            MODULE,
            module_of(5),
            LORA,
            0x0150,
            0x0200,
            0xFFFF,
        ] {
            assert_eq!(point_of(other), None, "{other:#06x}");
        }
    }

    #[test]
    fn modules_are_settings_of_their_ports_and_empty_slots_are_omitted() {
        let slots = [(1_u8, Module::Di4), (2, Module::None), (4, Module::Ao4)];
        assert!(modules(slots).eq([(0x0110, 1), (0x0113, 5)]));
    }

    #[test]
    fn settings_by_point_are_the_rules_with_a_register_for_each_point() {
        for rule in RULES {
            let by_point = point_of(rule.first).is_some();
            assert_eq!(by_point, rule.count == points::COUNT, "{:#06x}", rule.first);
        }
    }

    #[test]
    fn narrower_values_are_a_subset_of_the_rules_values() {
        for rule in RULES {
            let Some(narrower) = rule.narrower else {
                continue;
            };
            assert!(narrower.values.allow(narrower.default));
            let mut allowed = (0..=0xFFFF).filter(|value| narrower.values.allow(*value));
            assert!(
                allowed.all(|value| rule.values.allow(value)),
                "{:#06x}",
                rule.first
            );
        }
    }

    #[test]
    fn defaults_are_allowed_except_for_key_and_command() {
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
