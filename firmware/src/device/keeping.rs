//! Outputs that start as they were: what is stored of them, what a reset keeps, and what a start does with both.

use modio_drivers::{CHANNELS, Kind};
use register_map::board::{Board, Each};
use register_map::limits::RAW_MAX;
use register_map::record::{BITS, OUTPUTS, Record};

use super::{Device, Points};
use crate::kept_outputs::KeptOutputs;
use crate::outputs::Outputs;

impl<B: Board> Device<B> {
    /// Sets the outputs at a start. `stored` is the last record, `kept` what a reset that was not a power-on has kept.
    ///
    /// - An output that is to start as it was has its kept value, else its stored one.
    /// - An output that a link held has its kept value, if it still has such a link.
    /// - One that is at SAFE still counts as commanded what is stored.
    /// - Every other output keeps START.
    #[inline(never)]
    pub fn start_outputs(&mut self, kept: Option<&KeptOutputs>, stored: Option<&Record<'_>>) {
        if B::ROW.keeps_outputs
            && let Some(stored) = stored
        {
            self.restore(stored);
        }
        let kept = kept.filter(|kept| kept.modules == self.modules_in_force());
        let mut held: Each<B::Ports, u8> = Each::all(0);
        for (slot, held) in held.iter_mut().enumerate() {
            let Some(kept) = kept else {
                break;
            };
            let first = Points::<B>::first_of(slot);
            *held = (kept.held >> (first & 31)) as u8 & self.linking.with_any_level(slot);
            for channel in 0..CHANNELS {
                let is_held = *held >> channel & 1 != 0;
                let point = first.wrapping_add(channel as u16);
                if (is_held || self.kept_at(slot, channel).is_some())
                    && let Some(value) = kept.value(point)
                {
                    let at_safe = kept.at_safe >> (point & 31) & 1 != 0;
                    self.points.return_to(slot, channel, value, at_safe);
                }
            }
        }
        for (slot, held) in held.iter().enumerate() {
            self.points.begin_stage(slot, *held);
        }
        self.begin_links(|slot| held.get(slot).copied().unwrap_or_default());
    }

    /// Returns the modules in force, 4 bits for each port, port 1 lowest.
    #[must_use]
    pub fn modules_in_force(&self) -> u32 {
        let first = u32::from(B::ROW.first_port.wrapping_sub(1));
        let modules = (first..).zip(self.config.modules());
        modules.fold(0, |word, (port, module)| {
            word | u32::from(module.code()) << ((4 * port) & 31)
        })
    }

    /// Returns the outputs, by address, that are to have after a reset what they have now, because a link holds them.
    #[must_use]
    pub fn held_outputs(&self) -> u32 {
        if !B::ROW.has_links() {
            return 0;
        }
        (0..B::PORTS).fold(0, |mask, slot| {
            mask | u32::from(self.linking.keeping(slot)) << (Points::<B>::first_of(slot) & 31)
        })
    }

    /// Returns the outputs, by address, that are at SAFE and were not commanded since.
    #[must_use]
    pub fn outputs_at_safe(&self) -> u32 {
        self.points.at_safe() << (Points::<B>::first_of(0) & 31)
    }

    /// Returns what a master or a link commanded last of the outputs that are to start as they were, to be stored. Those
    /// that a link always holds are left out: they would change as often as their source.
    #[must_use]
    #[inline(never)]
    pub fn outputs(&self) -> Outputs {
        let mut outputs = Outputs::new();
        for slot in 0..B::PORTS {
            for channel in 0..CHANNELS {
                let Some(address) = self.kept_at(slot, channel) else {
                    continue;
                };
                if self.linking.held_always(slot) >> channel & 1 != 0 {
                    continue;
                }
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
    fn restore(&mut self, stored: &Record<'_>) {
        for slot in 0..B::PORTS {
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
        let first = OUTPUTS | module << 8 | Points::<B>::first_of(slot);
        match self.points.ports().get(slot)?.kind(channel) {
            Kind::BitOutput => Some(first | BITS),
            Kind::WordOutput => Some(first | channel as u16),
            Kind::None | Kind::BitInput | Kind::WordInput => None,
        }
    }
}
