//! The clone of the FX3U-24MR: 14 inputs, ten outputs, and four analog inputs or two of them and two analog outputs.

use super::{Analog, Descriptor, PortKind, SlotPins, fx3u};
use crate::pin::Pin;

/// The fx3u-24.
pub const BOARD: Descriptor = fx3u::board(
    &[
        fx3u::X0,
        fx3u::X4,
        // X10 to X13.
        fx3u::inputs([Pin::e(11), Pin::e(12), Pin::e(9), Pin::e(10)]),
        // X14, X15, the RUN switch and the monitor of the 24 V.
        fx3u::inputs([Pin::e(7), Pin::e(8), fx3u::RUN, Pin::c(7)]),
        fx3u::Y0,
        // Y4 to Y7.
        fx3u::outputs([fx3u::Y4[0], fx3u::Y4[1], Pin::b(15), Pin::a(7)]),
        // Y10 and Y11.
        fx3u::outputs([Pin::a(6), Pin::a(2), Pin::NONE, Pin::NONE]),
        SlotPins {
            lines: fx3u::VOLTAGE_PINS,
            kind: PortKind::Analog(&Analog {
                inputs: fx3u::VOLTAGES,
                outputs: fx3u::OUTPUT_PINS,
                output: fx3u::OUTPUTS,
            }),
        },
    ],
);
