//! Outputs that start as they were: what is stored of them, and what a start does with it.

use modio_drivers::{CHANNELS, Kind};
use register_map::limits::RAW_MAX;
use register_map::record::{BITS, OUTPUTS, Record};

use super::Device;
use crate::outputs::Outputs;

impl<const SLOTS: usize> Device<SLOTS> {
    /// Returns what a master or a link commanded last of the outputs that are to start as they were, to be stored.
    #[must_use]
    #[inline(never)]
    pub fn outputs(&self) -> Outputs {
        let mut outputs = Outputs::new();
        for slot in 0..SLOTS {
            for channel in 0..CHANNELS {
                let Some(address) = self.kept_at(slot, channel) else {
                    continue;
                };
                let mut value = self.points.commanded(slot * CHANNELS + channel);
                if address & BITS != 0 {
                    value = (0x100 | value) << channel;
                }
                match outputs.last_mut() {
                    Some((last, bits)) if *last == address => *bits |= value,
                    // There is room for every point.
                    _ => _ = outputs.push((address, value)),
                }
            }
        }
        outputs
    }

    /// Commands the outputs that are to start as they were, from a record. Ignores values of another module than the
    /// one in force, and values out of range.
    #[inline(never)]
    pub fn restore(&mut self, stored: &Record<'_>) {
        for slot in 0..SLOTS {
            for channel in 0..CHANNELS {
                let Some(address) = self.kept_at(slot, channel) else {
                    continue;
                };
                let mut pairs = stored.pairs();
                let Some((_, value)) = pairs.find(|(stored, _)| *stored == address) else {
                    continue;
                };
                let value = if address & BITS == 0 {
                    value
                } else if value >> (8 + channel) & 1 != 0 {
                    value >> channel & 1
                } else {
                    continue;
                };
                let port = self.points.ports_mut().get_mut(slot);
                if let Some(port) = port.filter(|_| value <= RAW_MAX) {
                    port.command_raw(channel, value);
                }
            }
        }
    }

    /// Returns the address of the pair that has the value of an output; `None` if the output is not to start as it was.
    fn kept_at(&self, slot: usize, channel: usize) -> Option<u16> {
        if !self.config.starts_as_it_was(slot, channel) {
            return None;
        }
        let module = self.config.modules().get(slot)?.code();
        let first = OUTPUTS | module << 8 | self.points.first_of(slot);
        match self.points.ports().get(slot)?.kind(channel) {
            Kind::BitOutput => Some(first | BITS),
            Kind::WordOutput => Some(first | channel as u16),
            Kind::None | Kind::BitInput | Kind::WordInput => None,
        }
    }
}
