//! Runs the links: inputs that switch outputs without a master.

use modio_drivers::{CHANNELS, Kind};

use super::Device;
use crate::links::{Link, OF_A_SLOT};

impl<const SLOTS: usize> Device<SLOTS> {
    /// Runs the links with the inputs of a scan of all slots. The levels at the first scan are no edges.
    pub fn run_links(&mut self) {
        let act = core::mem::replace(&mut self.linked, true);
        self.update_links(act);
    }

    /// Stores the levels of all sources. `act`: a level that has changed is an edge. Otherwise it is that of a link whose
    /// registers have changed.
    #[inline(never)]
    pub(super) fn update_links(&mut self, act: bool) {
        let alone = self.comm_watchdog.has_expired();
        let now = self.state.millis();
        for slot in 0..SLOTS {
            for index in 0..OF_A_SLOT {
                let link = self.config.link(slot, index);
                let Some(levels) = self.levels.get(slot).copied() else {
                    return;
                };
                let before = levels >> index & 1 != 0;
                let level = self.level_of(link, before);
                if level == before {
                    continue;
                }
                if let Some(levels) = self.levels.get_mut(slot) {
                    *levels ^= 1 << index;
                }
                let (output, other) = (index % CHANNELS, (index + CHANNELS) % OF_A_SLOT);
                let second = self.config.link(slot, other);
                let wanted = second.is_awake(alone) && second.wants(levels >> other & 1 != 0);
                if act
                    && link.is_awake(alone)
                    && let Some(port) = self.points.ports_mut().get_mut(slot)
                    && let Some(act) = link.at_edge(level, port.channels.bit(output), wanted)
                {
                    port.act(output, act, now);
                }
            }
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
