//! The line counters of the radio, 0x0270 to 0x0278: as those of the RS-485 line from 0x0230 on, in the same order. Gaps
//! are not counted, because there are pauses between the packets of a frame.

use crate::block::block;
use crate::rule::Rule;
use crate::value::Value;

const READ: Rule = Rule::read_only();

block! {
    "Line counters of the radio", 0x0270..=0x0278;

    /// As 0x0230
    BUS_MESSAGES "radio bus messages": 0x0270 x 1, Value::NUMBER, READ;
    /// As 0x0231
    BUS_ERRORS "radio communication errors": 0x0271 x 1, Value::NUMBER, READ;
    /// As 0x0232
    EXCEPTIONS "radio exceptions sent": 0x0272 x 1, Value::NUMBER, READ;
    /// As 0x0233
    UNIT_MESSAGES "radio messages for this unit": 0x0273 x 1, Value::NUMBER, READ;
    /// As 0x0234
    NO_RESPONSES "radio no response": 0x0274 x 1, Value::NUMBER, READ;
    /// As 0x0235
    NAKS "radio NAK": 0x0275 x 1, Value::NUMBER, READ;
    /// As 0x0236
    BUSY "radio busy": 0x0276 x 1, Value::NUMBER, READ;
    /// As 0x0237
    OVERRUNS "radio character overruns": 0x0277 x 1, Value::NUMBER, READ;
    /// Always 0
    T15_GAPS "radio inter-character gaps": 0x0278 x 1, Value::NUMBER, READ;
}
