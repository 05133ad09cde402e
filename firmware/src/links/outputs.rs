//! The links to the outputs of one slot, while they run.
//!
//! A link that follows or inverts its source is a *level link*. Level links hold their output: while at least one acts,
//! and each acting one has decided on or off, the output is the *or* of these decisions. The other links act at edges only.
//!
//! Masks of links have a bit for each of the slot's links: the first links of the four outputs, then the second ones.
//! Masks of outputs have channel 1 in bit 0.

use super::{Link, OF_A_SLOT};
use crate::stage::Held;

/// Time in ms from the last write of a link until it acts. A master may write its registers one by one.
pub const AFTER_A_WRITE_MS: u16 = 1_000;

/// Number of outputs, which is the distance of the two links of an output.
const OUTPUTS: usize = OF_A_SLOT / 2;

/// What a level link reads from its source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// The source has no value.
    NoValue {
        /// Whether the source is good: it will have a value after its wait.
        good: bool,
    },
    /// The level of a digital input.
    Bit(bool),
    /// The word of an analog input.
    Word(u16),
    /// An analog input whose value is uncertain: a link keeps its last decision.
    Uncertain,
}

/// The state of the links to the outputs of a slot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outputs {
    /// Level links.
    levels: u8,
    /// Links that act at edges.
    edges: u8,
    /// Links that act only while the communication watchdog has expired.
    alone: u8,
    /// Links that have decided whether their output is on or off.
    known: u8,
    /// Of these, the links whose output is on.
    want: u8,
    /// Links with SAFE = hold whose source is not good and that have never decided: they take no part.
    absent: u8,
    /// Decision of a link for a word between its thresholds, as long as the link has not decided before.
    first: u8,
    /// Links of `alone` that act: from the expiry of the watchdog until a master writes their output.
    holding: u8,
    /// Time in ms until a link acts.
    rests: [u16; OF_A_SLOT],
    /// Links whose time is not over.
    resting: u8,
    /// Outputs that are held.
    held: u8,
    /// Outputs that are held on.
    on: u8,
    /// Outputs that links held before the start and that no link has decided about yet.
    kept: u8,
}

impl Outputs {
    /// Returns outputs without links.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            levels: 0,
            edges: 0,
            alone: 0,
            known: 0,
            want: 0,
            absent: 0,
            first: 0,
            holding: 0,
            rests: [0; OF_A_SLOT],
            resting: 0,
            held: 0,
            on: 0,
            kept: 0,
        }
    }

    /// Returns whether the links are to run: there is one, or one that has gone still holds an output.
    #[must_use]
    pub const fn are_to_run(&self) -> bool {
        self.levels | self.edges | self.held | self.kept != 0
    }

    /// Returns the level links.
    #[must_use]
    pub const fn levels(&self) -> u8 {
        self.levels
    }

    /// Takes the kinds of the links from their registers.
    pub fn set_up<'a>(&mut self, links: impl Iterator<Item = &'a Link>) {
        (self.levels, self.edges, self.alone) = (0, 0, 0);
        for (link, mask) in links.zip((0..OF_A_SLOT).map(|index| 1 << index)) {
            if link.source().is_none() || !link.has_action() {
                continue;
            }
            if link.is_level() {
                self.levels |= mask;
            } else {
                self.edges |= mask;
            }
            if link.is_for_alone() {
                self.alone |= mask;
            }
        }
    }

    /// Restarts the links that a request has written.
    pub fn written(&mut self, links: u8) {
        self.forget(links, 0);
        self.holding &= !links;
        self.resting |= links;
        for (index, rest) in self.rests.iter_mut().enumerate() {
            if links >> index & 1 != 0 {
                *rest = AFTER_A_WRITE_MS;
            }
        }
    }

    /// Clears the decisions of links, at a start or after a change of the settings of their source. Until a word leaves
    /// the range between the thresholds, such a link keeps the present value of its output, which `on` has.
    pub const fn forget(&mut self, links: u8, on: u8) {
        self.known &= !links;
        self.absent &= !links;
        self.first = self.first & !links | of_both(on) & links;
    }

    /// Begins with outputs that were held before a reset.
    pub const fn begin_held(&mut self, outputs: u8) {
        self.kept = outputs;
    }

    /// Advances the time by `ms` milliseconds. `alone`: the communication watchdog has expired.
    pub fn tick(&mut self, ms: u32, alone: bool) {
        if self.resting != 0 {
            for (index, rest) in self.rests.iter_mut().enumerate() {
                *rest = u32::from(*rest).saturating_sub(ms) as u16;
                if *rest == 0 {
                    self.resting &= !(1 << index);
                }
            }
        }
        if alone {
            self.holding |= self.alone;
        }
    }

    /// Returns whether a link acts until a master writes its output.
    #[must_use]
    pub const fn is_holding(&self) -> bool {
        self.holding != 0
    }

    /// Ends the hold of links that act only while there is no master. Called when a master has written these outputs.
    pub const fn end_hold(&mut self, outputs: u8) {
        self.holding &= !of_both(outputs);
        self.hold();
    }

    /// Returns the level links that act.
    const fn acting_levels(&self) -> u8 {
        self.levels & !self.resting & (!self.alone | self.holding)
    }

    /// Returns the outputs with a level link that acts, which therefore do not take SAFE.
    #[must_use]
    pub const fn with_level(&self) -> u8 {
        of_outputs(self.acting_levels())
    }

    /// Returns the outputs with a level link, whether it acts or not.
    #[must_use]
    pub const fn with_any_level(&self) -> u8 {
        of_outputs(self.levels)
    }

    /// Returns the links that act at edges now.
    #[must_use]
    pub const fn acting_edges(&self, alone: bool) -> u8 {
        let resting = if alone { 0 } else { self.alone };
        self.edges & !self.resting & !resting & !of_both(self.held)
    }

    /// Reads the source of a level link. `safe` is SAFE of its output, `None` for hold. `look`: a word is compared with the
    /// thresholds even if the link has decided before.
    pub fn look(
        &mut self,
        index: usize,
        link: &Link,
        source: Source,
        safe: Option<bool>,
        look: bool,
    ) {
        let mask = 1 << (index % OF_A_SLOT);
        let known = self.known & mask != 0;
        let want = match source {
            Source::NoValue { good } => {
                if good && (self.known | self.absent) & mask == 0 {
                    return;
                }
                match safe {
                    Some(safe) => safe,
                    None if known => return,
                    None => {
                        self.absent |= mask;
                        return;
                    }
                }
            }
            Source::Bit(level) => level != link.inverts(),
            Source::Uncertain => return,
            Source::Word(_) if known && !look => return,
            Source::Word(word) => match link.level_of(word) {
                Some(level) => level != link.inverts(),
                None if known => return,
                None => self.first & mask != 0,
            },
        };
        self.known |= mask;
        self.absent &= !mask;
        self.want = self.want & !mask | if want { mask } else { 0 };
    }

    /// Decides which outputs are held, after the last [`look`](Self::look) of a scan.
    pub const fn hold(&mut self) {
        let acting = self.acting_levels();
        let unknown = of_outputs(acting & !(self.known | self.absent));
        let part = acting & self.known;
        self.held = of_outputs(part) & !unknown;
        self.on = of_outputs(part & self.want) & self.held;
        self.kept = self.held | self.kept & unknown;
    }

    /// Returns the outputs that are held.
    #[must_use]
    pub const fn held(&self) -> Held {
        Held {
            outputs: self.held,
            on: self.on,
        }
    }

    /// Returns the outputs with a level link that always acts. Such a link holds its output once it has decided.
    #[must_use]
    pub const fn held_always(&self) -> u8 {
        of_outputs(self.levels & !self.alone & !self.absent)
    }

    /// Returns the outputs that keep their present value over a reset: a link holds them, or a link held them before the
    /// start and has not decided yet.
    #[must_use]
    pub const fn keeping(&self) -> u8 {
        self.kept
    }
}

/// Returns both links of each output.
const fn of_both(outputs: u8) -> u8 {
    outputs | outputs << OUTPUTS
}

/// Returns the outputs of links.
const fn of_outputs(links: u8) -> u8 {
    (links | links >> OUTPUTS) & ((1 << OUTPUTS) - 1)
}
