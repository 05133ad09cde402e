//! Runs the links: inputs that switch outputs without a master.

use modio_drivers::{CHANNELS, Kind};
use register_map::links;

use super::Device;
use crate::links::{Link, OF_A_SLOT};

impl<const SLOTS: usize> Device<SLOTS> {
    /// Ends the pulses of a slot's outputs, and runs the links to them with the inputs of a scan of all slots. The levels at
    /// the first scan are no edges.
    pub fn run_links(&mut self, slot: usize) {
        if !links::exist(SLOTS) {
            return;
        }
        let now = self.state.millis();
        if let Some(port) = self.points.ports_mut().get_mut(slot) {
            port.end_pulses(now);
        }
        if self.has_links {
            let act = self.linked >> (slot & 7) & 1 != 0;
            self.update_links(slot, act);
        }
        self.linked |= 1 << (slot & 7);
    }

    /// Stores the levels of the sources after the settings have changed. They are no edges.
    pub(super) fn settle_links(&mut self) {
        if !links::exist(SLOTS) {
            return;
        }
        self.has_links = false;
        (0..SLOTS).for_each(|slot| self.update_links(slot, false));
    }

    /// Stores the levels of the sources of the links to a slot. `act`: a level that has changed is an edge.
    #[inline(never)]
    fn update_links(&mut self, slot: usize, act: bool) {
        let alone = self.comm_watchdog.has_expired();
        let now = self.state.millis();
        let mut levels = self.levels.get(slot).copied().unwrap_or_default();
        for index in 0..OF_A_SLOT {
            let link = self.config.link(slot, index);
            self.has_links |= link.source().is_some();
            let before = levels >> index & 1 != 0;
            let level = self.level_of(link, before);
            if level == before {
                continue;
            }
            levels ^= 1 << index;
            let (output, other) = (index % CHANNELS, index ^ CHANNELS);
            let second = self.config.link(slot, other);
            let wanted = second.is_awake(alone) && second.wants(levels >> other & 1 != 0);
            if act
                && link.is_awake(alone)
                && let Some(port) = self.points.ports().get(slot)
                && let Some(act) = link.at_edge(level, port.channels.bit(output), wanted)
            {
                self.points.act(slot, output, act, now);
            }
        }
        if let Some(own) = self.levels.get_mut(slot) {
            *own = levels;
        }
    }

    /// Returns the level of the source of a link. `before` is its level before, which a link without source keeps.
    fn level_of(&self, link: &Link, before: bool) -> bool {
        let source = link.source().and_then(|point| self.points.place_of(point));
        match source.map(|(port, channel)| (port.kind(channel), port.channels(), channel)) {
            Some((Kind::BitInput, channels, channel)) => channels.bit(channel),
            Some((Kind::WordInput, channels, channel)) => {
                link.level_of(channels.word(channel), before)
            }
            _ => before,
        }
    }
}
