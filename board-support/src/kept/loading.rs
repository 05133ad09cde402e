//! What the loader reads and keeps in the region.

use super::{
    region::{read, update},
    sealed::{ASKED, CAUSE, CHOSEN, DEVELOPMENT, FLAGS, Sealed, UNSEEN},
};

/// An application has been started since power-on, so SW01 has no effect any more.
const USED: u32 = 1 << 13;

/// What the loader needs of the region.
pub(crate) struct AtLoading {
    /// COMMAND 2 asked for this restart.
    pub asked: bool,
    /// The slot that SW01 = 254 chose at power-on: 0 none, 1 A, 2 B.
    pub chosen: u8,
    /// SW01 as read at power-on, or `None` before it was read.
    pub dip: Option<u8>,
    /// An application has been started since power-on.
    pub used: bool,
    /// The crystal has not failed since power-on.
    pub crystal: bool,
}

/// Returns the content for the loader, which calls this once at every start, and keeps the reset flags for the
/// application. Those of an earlier start of the loader that no application has seen are kept, too. `development`: the
/// loader trusts the development key.
pub(crate) fn at_loading(cause: u8, development: bool) -> AtLoading {
    let mut sealed = Sealed::after_power_on();
    sealed.load(read);
    let flags = sealed.word(FLAGS);
    update(None, FLAGS, ASKED, 0);
    let unseen = if sealed.word(CAUSE) & UNSEEN != 0 {
        0
    } else {
        u32::MAX
    };
    let development = if development { DEVELOPMENT } else { 0 };
    update(None, CAUSE, unseen, UNSEEN | development | u32::from(cause));
    AtLoading {
        asked: flags & ASKED != 0,
        chosen: ((flags & CHOSEN) >> CHOSEN.trailing_zeros()) as u8,
        dip: sealed.dip(),
        used: flags & USED != 0,
        crystal: sealed.record().crystal_faults == 0,
    }
}

/// Keeps the slot that SW01 = 254 chose: 0 none, 1 A, 2 B. SW01 has no effect any more.
pub(crate) fn keep_chosen(slot: u8) {
    let number = u32::from(slot) << CHOSEN.trailing_zeros();
    update(None, FLAGS, CHOSEN, USED | number);
}
