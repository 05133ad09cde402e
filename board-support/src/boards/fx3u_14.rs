//! The clone of the FX3U-14MR: eight inputs, six outputs, eight analog inputs and two analog outputs.

use super::{Descriptor, PortKind, SlotPins, fx3u};
use crate::pin::Pin;

/// The fx3u-14.
pub const BOARD: Descriptor = fx3u::board(
    &[
        fx3u::X0,
        fx3u::X4,
        fx3u::Y0,
        fx3u::outputs([fx3u::Y4[0], fx3u::Y4[1], Pin::NONE, Pin::NONE]),
        SlotPins {
            lines: fx3u::VOLTAGE_PINS,
            kind: PortKind::AnalogInputs(&fx3u::VOLTAGES),
        },
        fx3u::OTHERS,
        SlotPins {
            lines: [
                fx3u::OUTPUT_PINS[0],
                fx3u::OUTPUT_PINS[1],
                Pin::NONE,
                Pin::NONE,
            ],
            kind: PortKind::AnalogOutputs(&fx3u::OUTPUTS),
        },
    ],
);
