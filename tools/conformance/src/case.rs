//! A case: its name, the section it comes from, what it needs, and how it is judged.

use crate::bench::Bench;
use crate::endpoint::Broken;

/// Something without which a case is skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// The unit has this function.
    Function(u8),
    /// There is something that this function (1 to 4) can read.
    Readable(u8),
    /// There are coils to write to.
    Bits,
    /// There are registers to write to.
    Words,
    /// The endpoint's time is exact.
    Exact,
    /// The endpoint can send damaged characters.
    Faults,
    /// The line has a parity bit.
    Parity,
    /// The endpoint can switch the unit's power.
    Power,
    /// The endpoint sees the driver.
    Driver,
    /// Characters that the unit sends take their time on the endpoint's line.
    CharacterTime,
    /// The unit notices a start bit when it begins.
    StartBit,
    /// The endpoint can let the unit hear itself.
    Echo,
    /// The endpoint can change rate and format.
    SetLine,
    /// The configuration may be written (`--allow-config`).
    Config,
    /// The unit is a modio.
    Modio,
    /// The unit speaks RTU.
    Rtu,
    /// The unit speaks ASCII.
    Ascii,
}

/// What was sent, what came of it, and what the standard wants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// What was sent.
    pub sent: String,
    /// What came.
    pub came: String,
    /// What should have come.
    pub wanted: String,
}

/// Why a case stops before its end.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Stop {
    /// The unit made a mistake.
    #[error("sent {}; received {}; expected {}", .0.sent, .0.came, .0.wanted)]
    Fail(Failure),
    /// The case does not apply: the reason, which the case found while it ran.
    #[error("{0}")]
    Skip(String),
    /// The endpoint no longer works.
    #[error(transparent)]
    Broken(#[from] Broken),
}

/// What a step of a case results in.
pub type Check<T = ()> = Result<T, Stop>;

/// Skips the case, for this reason.
///
/// # Errors
///
/// [`Stop::Skip`] always.
pub fn skip<T>(why: impl Into<String>) -> Check<T> {
    Err(Stop::Skip(why.into()))
}

/// Where the demand of a case comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The words of the standards.
    Standard,
    /// A reading of the standards, where they leave a choice or say nothing.
    Interpretation,
    /// The register map and the documents of the modio.
    Modio,
}

impl Kind {
    /// Its name in lists and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard",
            Self::Interpretation => "interpretation",
            Self::Modio => "modio",
        }
    }
}

/// A named case.
#[derive(Clone, Copy)]
pub struct Case {
    /// Its name: what it is about, a slash, what is tried. Never used twice.
    pub name: &'static str,
    /// Where it is written that it must be so.
    pub section: &'static str,
    /// Where the demand comes from.
    pub kind: Kind,
    /// What must be so, in one line.
    pub about: &'static str,
    /// What it needs.
    pub needs: &'static [Need],
    /// Tries it.
    pub run: fn(&mut Bench<'_>) -> Check,
}

impl Case {
    /// The same case, whose demand is a reading of the standards.
    #[must_use]
    pub const fn interpretation(mut self) -> Self {
        self.kind = Kind::Interpretation;
        self
    }
}

/// Returns a case. Its kind is [`Kind::Modio`] when it needs a modio or cites the register map, and
/// [`Kind::Standard`] otherwise.
#[must_use]
pub const fn case(
    name: &'static str,
    section: &'static str,
    about: &'static str,
    needs: &'static [Need],
    run: fn(&mut Bench<'_>) -> Check,
) -> Case {
    let source = section.as_bytes();
    let mut modio = matches!(source, [b'm', b'a', b'p', ..]);
    let mut at = 0;
    while at < needs.len() {
        modio |= matches!(needs[at], Need::Modio);
        at += 1;
    }
    Case {
        name,
        section,
        kind: if modio { Kind::Modio } else { Kind::Standard },
        about,
        needs,
        run,
    }
}
