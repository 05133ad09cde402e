//! Links: inputs that switch digital outputs without a master.
//!
//! Everything happens at an edge of the input, so a master, SAFE and links can share an output: the last one wins. For an
//! analog input the edges are the crossings of two thresholds:
//!
//! ```text
//!   word   ______                  on:  the word was above HIGH last
//!   HIGH --/------\---------       off: the word was below LOW last
//!         /        \     /\
//!   LOW -/----------\---/--\       between them nothing changes
//!   _____|           |_/
//!       edge        edge
//! ```

use modio_drivers::{CHANNELS, Kind};
use register_map::codes::LinkAction;
use register_map::links::{EACH, NO_SOURCE, WORDS};

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
            Kind::BitInput => LinkAction::Reset,
            Kind::WordInput if low <= high => LinkAction::Invert,
            _ if self.source().is_none() => LinkAction::Reset,
            _ => return false,
        };
        action <= last.code() && (action != LinkAction::Pulse.code() || self.0[2] > 0)
    }

    /// Returns whether the link acts. `alone`: the communication watchdog has expired.
    #[must_use]
    pub const fn is_awake(&self, alone: bool) -> bool {
        self.0[1] >> 8 == 0 || alone
    }

    /// Returns the level of an analog input with this word. `before` is its level before.
    #[must_use]
    pub fn level_of(&self, word: u16, before: bool) -> bool {
        let [low, high] = self.thresholds();
        let word = word.cast_signed();
        word > high || before && word >= low
    }

    /// Returns what the link does when the level of its input has changed. `output` is the value of the output, `other`
    /// whether its other link wants it on.
    #[must_use]
    pub fn at_edge(&self, level: bool, output: bool, other: bool) -> Option<Act> {
        let mut pulse_ms = 0;
        let value = match self.action() {
            LinkAction::Follow | LinkAction::Invert => self.wants(level) || other,
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

    /// Returns whether a link that follows its input wants the output on, for this level of the input.
    #[must_use]
    pub fn wants(&self, level: bool) -> bool {
        match self.action() {
            LinkAction::Follow => level,
            LinkAction::Invert => !level,
            _ => false,
        }
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
        use LinkAction::{Follow, Invert, None, Pulse, Reset, Set, Toggle};
        let set = |value| Some(Act { value, pulse_ms: 0 });
        // With the output off and on.
        for (action, rising, falling) in [
            (None, [Option::None; 2], [Option::None; 2]),
            (Follow, [set(true); 2], [set(false); 2]),
            (Invert, [set(false); 2], [set(true); 2]),
            (Toggle, [set(true), set(false)], [Option::None; 2]),
            (Set, [set(true); 2], [Option::None; 2]),
            (Reset, [set(false); 2], [Option::None; 2]),
        ] {
            let link = link(action);
            let acts = |level| [false, true].map(|output| link.at_edge(level, output, false));
            assert_eq!((acts(true), acts(false)), (rising, falling), "{action:?}");
            let follows = [Follow, Invert].contains(&action);
            for level in [false, true] {
                let with_other = link.at_edge(level, false, true);
                assert_eq!(
                    with_other == set(true),
                    follows || level && rising[0] == set(true)
                );
            }
        }
        for time in [1, 0xFFFF] {
            let link = Link([3, Pulse.code(), time, 0]);
            let pulse_ms = u32::from(time) * 100;
            let value = true;
            assert_eq!(
                link.at_edge(true, true, false),
                Some(Act { value, pulse_ms })
            );
            assert_eq!(link.at_edge(false, true, false), Option::None);
        }
    }

    #[test]
    fn a_link_wants_its_output_on_only_if_it_follows() {
        for action in LinkAction::ALL.iter().copied() {
            let wants = [false, true].map(|level| link(action).wants(level));
            let expected = match action {
                LinkAction::Follow | LinkAction::FollowAlone => [false, true],
                LinkAction::Invert | LinkAction::InvertAlone => [true, false],
                _ => [false; 2],
            };
            assert_eq!(wants, expected, "{action:?}");
        }
    }

    #[test]
    fn when_is_the_high_byte_of_the_action() {
        for action in LinkAction::ALL {
            let link = link(*action);
            assert!(link.is_awake(true));
            assert_eq!(link.is_awake(false), action.code() < 0x100);
            let always = Link([3, action.code() & 7, 1, 0]);
            assert_eq!(
                link.at_edge(true, false, false),
                always.at_edge(true, false, false)
            );
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
    fn level_of_an_analog_input_has_a_hysteresis() {
        let link = Link([3, 1, 20, 10]);
        let mut level = false;
        let words = [15, 20, 21, 20, 10, 9, 10, 20, 30, 0xFFFF];
        let levels = words.map(|word| {
            level = link.level_of(word, level);
            u8::from(level)
        });
        assert_eq!(levels, [0, 0, 1, 1, 1, 0, 0, 0, 1, 0], "-1 is below 10");
        let frost = Link([3, 1, 0, 0xFFF6]);
        assert!(frost.level_of(0xFFF6, true) && !frost.level_of(0xFFF5, true));
    }
}
