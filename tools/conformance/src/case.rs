//! A case: its name, the section that it tests, its needs, and the function that runs it.

use crate::hil::Hil;
use crate::hil::bench_file::Wire;
use crate::tester::Tester;

pub use crate::check::{Check, Failure, Part, Stop, skip};

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
    /// The endpoint records the driver.
    Driver,
    /// Characters that the unit sends have their duration on the endpoint's line.
    CharacterTime,
    /// The unit detects a character at its start bit.
    StartBit,
    /// The endpoint can let the unit receive its own frames.
    Echo,
    /// The endpoint can change rate and format.
    SetLine,
    /// The configuration may be written (`--allow-config`).
    Config,
    /// The configuration lock of the modio is closed, for which the run waits.
    LockClosed,
    /// The unit is a modio.
    Modio,
    /// The unit speaks RTU.
    Rtu,
    /// The unit speaks ASCII.
    Ascii,
    /// The user asks for requests at each rate (`--requests`).
    Requests,
    /// The bench file has digital wires.
    Wires,
    /// The bench file has digital wires whose pulses are counted.
    Pulses,
    /// The bench file has analog wires.
    AnalogWires,
}

impl Need {
    /// Returns the reason why a need of a bench is not met, if it is not met. Other needs are met here.
    pub fn unmet(self, bench: &Hil) -> Option<&'static str> {
        let mut wires = bench.wires.iter();
        let (met, why) = match self {
            Self::Requests => (bench.requests > 0, "measures with --requests only"),
            Self::Wires => (
                wires.any(Wire::is_digital),
                "no [[wire]] in a bench file: --bench",
            ),
            Self::Pulses => (
                wires.any(Wire::has_pulses),
                "no [[wire]] with pulses in a bench file: --bench",
            ),
            Self::AnalogWires => (
                wires.any(|wire| !wire.is_digital()),
                "no [[analog]] in a bench file: --bench",
            ),
            _ => return None,
        };
        (!met).then_some(why)
    }
}

/// Where the demand of a case comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The text of the standards.
    Standard,
    /// An interpretation of the standards, where they leave a choice or say nothing.
    Interpretation,
    /// An extension of a maker, which other units may have.
    Extension,
    /// The register map and the documents of the modio.
    Modio,
}

impl Kind {
    /// Returns the name in lists and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard",
            Self::Interpretation => "interpretation",
            Self::Extension => "extension",
            Self::Modio => "modio",
        }
    }
}

/// A named case.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// The name: a group, a slash, and what is tried. Each name is used once.
    pub name: &'static str,
    /// The section that the demand comes from.
    pub section: &'static str,
    /// The kind of source that the demand comes from.
    pub kind: Kind,
    /// The demand, in one line.
    pub about: &'static str,
    /// What the case needs of the unit and the endpoint.
    pub needs: &'static [Need],
    /// Runs the case.
    pub run: Run,
}

/// The function that runs a case.
#[derive(Clone, Copy, Debug)]
pub enum Run {
    /// The case has one verdict.
    Whole(fn(&mut Tester<'_>) -> Check),
    /// There is a verdict for each part of the case, such as a wire or a rate. The function calls the closure with each part.
    Parts(fn(&mut Tester<'_>, &mut dyn FnMut(Part)) -> Check),
}

impl Case {
    /// Returns the same case as an interpretation of the standards.
    pub const fn interpretation(mut self) -> Self {
        self.kind = Kind::Interpretation;
        self
    }
}

/// Returns a case with one verdict.
pub const fn case(
    name: &'static str,
    section: &'static str,
    about: &'static str,
    needs: &'static [Need],
    run: fn(&mut Tester<'_>) -> Check,
) -> Case {
    new(name, section, about, needs, Run::Whole(run))
}

/// Returns a case whose parts have verdicts.
pub const fn parts(
    name: &'static str,
    section: &'static str,
    about: &'static str,
    needs: &'static [Need],
    run: fn(&mut Tester<'_>, &mut dyn FnMut(Part)) -> Check,
) -> Case {
    new(name, section, about, needs, Run::Parts(run))
}

/// The kind of a case is [`Kind::Modio`] when it needs a modio or cites the register map, [`Kind::Extension`] when
/// it cites Fast Modbus, and [`Kind::Standard`] otherwise.
const fn new(
    name: &'static str,
    section: &'static str,
    about: &'static str,
    needs: &'static [Need],
    run: Run,
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
        kind: match source {
            _ if modio => Kind::Modio,
            [b'F', b'a', b's', b't', ..] => Kind::Extension,
            _ => Kind::Standard,
        },
        about,
        needs,
        run,
    }
}
