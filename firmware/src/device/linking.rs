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
        let bit = 1 << (slot & 7);
        if self.has_links {
            let act = self.linked & bit != 0;
            self.update_links(slot, act, act && self.linked_words & bit != 0);
        }
        self.linked |= bit;
        self.links_due &= !bit;
        if self.words_scanned {
            self.linked_words |= bit;
        }
    }

    /// Notes that a scan has read the inputs, so that the links are to run. `words` is false when the words have the unit of
    /// the settings before.
    pub(super) const fn links_are_due(&mut self, words: bool) {
        self.links_due = u8::MAX;
        self.words_scanned |= words;
    }

    /// Stores the levels of the sources after the settings have changed. They are no edges, but those of bits that a scan
    /// has read and for which the links have not run yet. Words have their new unit after the next scan.
    pub(super) fn settle_links(&mut self) {
        if !links::exist(SLOTS) {
            return;
        }
        self.has_links = false;
        self.linked_words = 0;
        self.words_scanned = false;
        for slot in 0..SLOTS {
            let act = self.links_due & self.linked & 1 << (slot & 7) != 0;
            self.update_links(slot, act, false);
        }
    }

    /// Stores the levels of the sources of the links to a slot. `act` and `act_words`: a level of a bit or of a word that has
    /// changed is an edge.
    #[inline(never)]
    fn update_links(&mut self, slot: usize, act: bool, act_words: bool) {
        let alone = self.comm_watchdog.has_expired();
        let now = self.state.millis();
        let mut levels = self.levels.get(slot).copied().unwrap_or_default();
        for index in 0..OF_A_SLOT {
            let link = self.config.link(slot, index);
            self.has_links |= link.source().is_some();
            let before = levels >> index & 1 != 0;
            let (level, is_word) = self.level_of(link, before);
            if level == before {
                continue;
            }
            levels ^= 1 << index;
            let (output, other) = (index % CHANNELS, index ^ CHANNELS);
            let second = self.config.link(slot, other);
            let wanted = second.is_awake(alone) && second.wants(levels >> other & 1 != 0);
            let act = if is_word { act_words } else { act };
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

    /// Returns the level of the source of a link, and whether it is a word. `before` is its level before, which a link
    /// without source keeps.
    fn level_of(&self, link: &Link, before: bool) -> (bool, bool) {
        let source = link.source().and_then(|point| self.points.place_of(point));
        match source.map(|(port, channel)| (port.kind(channel), port.channels(), channel)) {
            Some((Kind::BitInput, channels, channel)) => (channels.bit(channel), false),
            Some((Kind::WordInput, channels, channel)) => {
                (link.level_of(channels.word(channel), before), true)
            }
            _ => (before, false),
        }
    }
}
