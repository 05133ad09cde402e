//! Links: inputs that switch digital outputs without a master.
//!
//! A level link (follow, invert) holds its output at what its source wants: it does not share the output with a master,
//! as it did in images that were not released. An edge link (the others) shares it: it acts at an edge of its source and
//! at nothing else. Toggle is for buttons, change for switches that are no buttons. An analog source has level links only:
//!
//! ```text
//!   word   ______                  above HIGH: on with follow, off with invert
//!   HIGH --/------\---------       below LOW: off with follow, on with invert
//!         /        \     /\
//!   LOW -/----------\---/--\       between them: what it wanted before
//!   _____|           |_/
//! ```
//!
//! [`Sources`] says when an input has a value, [`Outputs`] what the links to the outputs of a slot do with it.

mod outputs;
mod plausible;
mod sources;

use modio_drivers::{CHANNELS, Kind};
use register_map::codes::LinkAction;
use register_map::links::{EACH, NO_SOURCE, WORDS};

pub(crate) use outputs::{Outputs, Source};
pub(crate) use sources::{AFTER_POWER_ON_MS, Sources};

/// Number of links of a slot: the first links of its points, then the second ones.
pub const OF_A_SLOT: usize = CHANNELS * EACH as usize;

/// A link, as its registers have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link(pub [u16; WORDS as usize]);

/// What a link does to its output at an edge of its input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Act {
    /// New value of the output.
    pub value: bool,
    /// Time in ms after which the output is cleared again; 0 = the value stays.
    pub pulse_ms: u32,
}

impl Link {
    /// A link that does nothing, the default.
    pub const NONE: Self = Self([NO_SOURCE, 0, 0, 0]);

    /// Returns the point of the input, if there is one.
    #[must_use]
    pub fn source(&self) -> Option<u16> {
        Some(self.0[0]).filter(|source| *source != NO_SOURCE)
    }

    /// Returns the register at this address.
    #[must_use]
    pub const fn word(&self, address: u16) -> u16 {
        self.0[(address % WORDS) as usize]
    }

    /// Returns the register at this address, to be changed.
    pub const fn word_mut(&mut self, address: u16) -> &mut u16 {
        &mut self.0[(address % WORDS) as usize]
    }

    /// Returns the action without WHEN.
    fn action(&self) -> LinkAction {
        LinkAction::from_code(self.0[1] & 0xFF).unwrap_or(LinkAction::None)
    }

    /// Returns LOW and HIGH of an analog input. Words above 0x7FFF are below 0: only temperatures have them.
    const fn thresholds(&self) -> [i16; 2] {
        [self.0[3].cast_signed(), self.0[2].cast_signed()]
    }

    /// Returns whether the registers are consistent for a source of this kind; [`Kind::None`] when SOURCE is not a point of
    /// the unit.
    #[must_use]
    pub fn suits(&self, source: Kind) -> bool {
        // WHEN is 0 or 1.
        let action = self.0[1] & !LinkAction::NoneAlone.code();
        let [low, high] = self.thresholds();
        let last = match source {
            Kind::BitInput => LinkAction::Change,
            Kind::WordInput if low <= high => LinkAction::Invert,
            _ if self.source().is_none() => LinkAction::Change,
            _ => return false,
        };
        action <= last.code() && (action != LinkAction::Pulse.code() || self.0[2] > 0)
    }

    /// Returns whether the link does anything.
    fn has_action(&self) -> bool {
        self.action() != LinkAction::None
    }

    /// Returns whether the link follows or inverts its source.
    fn is_level(&self) -> bool {
        matches!(self.action(), LinkAction::Follow | LinkAction::Invert)
    }

    /// Returns whether the link inverts its source.
    fn inverts(&self) -> bool {
        self.action() == LinkAction::Invert
    }

    /// Returns whether the link acts only while the communication watchdog has expired.
    const fn is_for_alone(&self) -> bool {
        self.0[1] >> 8 != 0
    }

    /// Returns the level of an analog input with this word; `None` between the thresholds.
    #[must_use]
    pub fn level_of(&self, word: u16) -> Option<bool> {
        let [low, high] = self.thresholds();
        let word = word.cast_signed();
        if word > high {
            Some(true)
        } else if word < low {
            Some(false)
        } else {
            None
        }
    }

    /// Returns what an edge link does at an edge of its source to this level. `output` is the value of the output.
    #[must_use]
    pub fn at_edge(&self, level: bool, output: bool) -> Option<Act> {
        let mut pulse_ms = 0;
        let value = match self.action() {
            LinkAction::Change => !output,
            LinkAction::Toggle if level => !output,
            LinkAction::Pulse if level => {
                pulse_ms = u32::from(self.0[2]) * 100;
                true
            }
            LinkAction::Set if level => true,
            LinkAction::Reset if level => false,
            _ => return None,
        };
        Some(Act { value, pulse_ms })
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    fn link(action: LinkAction) -> Link {
        Link([3, action.code(), 1, 0])
    }

    #[test]
    fn edges_do_what_the_action_says() {
        use LinkAction::{Change, Follow, Invert, None, Pulse, Reset, Set, Toggle};
        let set = |value| Some(Act { value, pulse_ms: 0 });
        const NOTHING: [Option<Act>; 2] = [Option::None; 2];
        // With the output off and on.
        for (action, rising, falling) in [
            (None, NOTHING, NOTHING),
            (Follow, NOTHING, NOTHING),
            (Invert, NOTHING, NOTHING),
            (Toggle, [set(true), set(false)], NOTHING),
            (Change, [set(true), set(false)], [set(true), set(false)]),
            (Set, [set(true); 2], NOTHING),
            (Reset, [set(false); 2], NOTHING),
        ] {
            let link = link(action);
            let acts = |level| [false, true].map(|output| link.at_edge(level, output));
            assert_eq!((acts(true), acts(false)), (rising, falling), "{action:?}");
        }
        for time in [1, 0xFFFF] {
            let link = Link([3, Pulse.code(), time, 0]);
            let pulse_ms = u32::from(time) * 100;
            let value = true;
            assert_eq!(link.at_edge(true, true), Some(Act { value, pulse_ms }));
            assert_eq!(link.at_edge(false, true), Option::None);
        }
    }

    #[test]
    fn when_is_the_high_byte_of_the_action() {
        for action in LinkAction::ALL {
            let link = link(*action);
            assert_eq!(link.is_for_alone(), action.code() >= 0x100);
            let always = Link([3, action.code() & 7, 1, 0]);
            assert_eq!(link.at_edge(true, false), always.at_edge(true, false));
            let levels = [LinkAction::Follow, LinkAction::Invert];
            assert_eq!(link.is_level(), levels.contains(&always.action()));
        }
    }

    #[test]
    fn registers_must_suit_the_kind_of_the_source() {
        let suiting = |kind, source| {
            let suits = |action: &u16| Link([source, *action, 1, 0]).suits(kind);
            (0..=0xFFFF).filter(suits).collect::<Vec<u16>>()
        };
        assert_eq!(suiting(Kind::BitInput, 3), LinkAction::CODES);
        assert_eq!(suiting(Kind::None, NO_SOURCE), LinkAction::CODES);
        assert_eq!(suiting(Kind::WordInput, 3), [0, 1, 2, 0x100, 0x101, 0x102]);
        for kind in [Kind::None, Kind::BitOutput, Kind::WordOutput] {
            assert_eq!(suiting(kind, 3), [], "{kind:?}");
        }
        assert!(!Link([3, LinkAction::Pulse.code(), 0, 0]).suits(Kind::BitInput));
        let thresholds = |high: i16, low: i16| {
            Link([3, 1, high.cast_unsigned(), low.cast_unsigned()]).suits(Kind::WordInput)
        };
        assert!(thresholds(5, 5) && thresholds(-1, -2) && thresholds(1, -400));
        assert!(!thresholds(5, 6) && !thresholds(-2, -1));
    }

    #[test]
    fn level_of_an_analog_input_is_unknown_between_the_thresholds() {
        let link = Link([3, 1, 20, 10]);
        let words = [9, 10, 20, 21, 0xFFFF];
        let levels = words.map(|word| link.level_of(word));
        let (on, off) = (Some(true), Some(false));
        assert_eq!(levels, [off, None, None, on, off], "-1 is below 10");
        let frost = Link([3, 1, 0, 0xFFF6]);
        assert_eq!(
            [0xFFF6, 0xFFF5].map(|word| frost.level_of(word)),
            [None, off]
        );
    }
}
