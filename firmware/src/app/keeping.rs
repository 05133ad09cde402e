//! Keeps what the outputs have, for a reset that is not a power-on. On a board without links a reset keeps nothing of
//! them.

use core::array;

use board_support::{boards::SLOTS, kept};
use firmware::kept_outputs::half_word_of;
use modio_drivers::{CHANNELS, Code, DacLink, Kind};

use crate::board::{BOARD, Device};

/// What is kept of the outputs.
pub struct Kept {
    /// The digital and the analog outputs of each slot, channel 1 in bit 0.
    outputs: [[u8; 2]; SLOTS],
    /// The outputs that a link holds, and those that are at SAFE, by address, as they were kept last.
    held: [u32; 2],
}

impl Kept {
    /// Keeps the outputs of this start, which have been driven for the first time. From then on they count instead of those
    /// of the run before.
    pub fn begin(device: &Device, dacs: &[DacLink; SLOTS]) -> Self {
        let ports = device.points.ports();
        let kept = Self {
            outputs: array::from_fn(|slot| {
                [Kind::BitOutput, Kind::WordOutput]
                    .map(|kind| ports.get(slot).map_or(0, |port| port.channels_of(kind)))
            }),
            held: [device.held_outputs(), device.outputs_at_safe()],
        };
        if BOARD.has_links() {
            for (slot, ((port, outputs), dac)) in
                ports.iter().zip(&kept.outputs).zip(dacs).enumerate()
            {
                keep_slot(slot, *outputs, port.channels().bits(), dac);
            }
            kept::keep_held(kept.held);
        }
        let modules = if BOARD.has_links() {
            device.modules_in_force()
        } else {
            0
        };
        kept::keep_outputs(modules);
        kept
    }

    /// Keeps the outputs that a scan has driven: the digital ones of each slot as they were commanded, but those with a pulse,
    /// which is over after a reset, the codes of the DACs, and the outputs that a link holds and those that are at SAFE.
    // Not inlined into the scan, whose frame is large.
    #[inline(never)]
    pub fn keep(&mut self, coils: &[u8; SLOTS], dacs: &[DacLink; SLOTS], held: [u32; 2]) {
        // An output is marked only while its value is that of the link, or SAFE.
        if self.held != held {
            let [before, now] = [self.held, held];
            kept::keep_held([before[0] & now[0], before[1] & now[1]]);
        }
        let slots = coils.iter().zip(dacs).zip(&self.outputs);
        for (slot, ((coils, dac), outputs)) in slots.enumerate() {
            keep_slot(slot, *outputs, *coils, dac);
        }
        if self.held != held {
            self.held = held;
            kept::keep_held(held);
        }
    }
}

/// Keeps the digital and the analog outputs of a slot, channel 1 in bit 0.
fn keep_slot(slot: usize, [digital, analog]: [u8; 2], coils: u8, dac: &DacLink) {
    if digital | analog == 0 {
        return;
    }
    let codes = dac.wanted.unwrap_or_default();
    for (channel, code) in codes.map(Code::get).into_iter().enumerate() {
        let value = if digital >> channel & 1 != 0 {
            u16::from(coils >> channel & 1)
        } else if analog >> channel & 1 != 0 {
            code
        } else {
            continue;
        };
        let point = (usize::from(BOARD.first_port) - 1 + slot) * CHANNELS + channel;
        kept::keep_output(point, half_word_of(value));
    }
}
