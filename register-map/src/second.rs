//! The line counters of the second line, 0x0270 to 0x0278: as those of the RS-485 line from 0x0230 on, in the same order.
//! Gaps are 0 with a radio, because there are pauses between the packets of a frame.

use crate::block::block;
use crate::rule::Rule;
use crate::value::Value;

const READ: Rule = Rule::read_only();

block! {
    "Line counters of the second line", 0x0270..=0x0278;

    /// As 0x0230
    BUS_MESSAGES "line2 bus messages": 0x0270 x 1, Value::NUMBER, READ;
    /// As 0x0231
    BUS_ERRORS "line2 communication errors": 0x0271 x 1, Value::NUMBER, READ;
    /// As 0x0232
    EXCEPTIONS "line2 exceptions sent": 0x0272 x 1, Value::NUMBER, READ;
    /// As 0x0233
    UNIT_MESSAGES "line2 messages for this unit": 0x0273 x 1, Value::NUMBER, READ;
    /// As 0x0234
    NO_RESPONSES "line2 no response": 0x0274 x 1, Value::NUMBER, READ;
    /// As 0x0235
    NAKS "line2 NAK": 0x0275 x 1, Value::NUMBER, READ;
    /// As 0x0236
    BUSY "line2 busy": 0x0276 x 1, Value::NUMBER, READ;
    /// As 0x0237
    OVERRUNS "line2 character overruns": 0x0277 x 1, Value::NUMBER, READ;
    /// As 0x0238
    T15_GAPS "line2 inter-character gaps": 0x0278 x 1, Value::NUMBER, READ;
}
