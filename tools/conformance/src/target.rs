//! The unit under test, as far as the cases need it: its address, functions and points, from the probe or a profile.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use modbus_line::LineFormat;
use register_map::codes::{Baud, Format};
use register_map::points::{self, Kind};
use register_map::{Module, Row};

use crate::frame::Mode;
use crate::hil::Hil;

/// Waiting times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Patience {
    /// Time to wait for the first character of a reply that is due.
    pub reply: Duration,
    /// Time without a character after which the unit counts as silent, where no reply is due.
    pub silence: Duration,
    /// Silence that ends a reply.
    pub quiet: Duration,
}

/// A run of addresses that one request can ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// The first address.
    pub first: u16,
    /// The last address, not below `first`.
    pub last: u16,
}

impl Span {
    /// Returns a span of one address.
    pub const fn one(address: u16) -> Self {
        Self::of(address, 1)
    }

    /// Returns a span of `count` addresses, at least one.
    pub const fn of(first: u16, count: u16) -> Self {
        Self {
            first,
            last: first + (count - 1),
        }
    }

    /// Returns the number of addresses, 1 to 65536.
    pub fn len(self) -> u32 {
        u32::from(self.last - self.first) + 1
    }

    /// Always false: a span has at least one address.
    pub const fn is_empty(self) -> bool {
        false
    }

    /// Returns the first addresses, `most` at most.
    pub fn up_to(self, most: u16) -> Self {
        let last = self.first.saturating_add(most.saturating_sub(1));
        Self {
            first: self.first,
            last: self.last.min(last),
        }
    }

    /// Returns whether the span contains the address.
    pub const fn has(self, address: u16) -> bool {
        self.first <= address && address <= self.last
    }
}

/// Registers that cases write to, and the values that they accept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Words {
    /// Their addresses, at most 123.
    pub span: Span,
    /// A value that they accept.
    pub low: u16,
    /// Another value that they accept.
    pub high: u16,
    /// A value that they refuse with exception 03, if one is known.
    pub refused: Option<u16>,
    /// They belong to the configuration, whose lock must be opened first.
    pub locked: bool,
}

impl Words {
    /// Returns the accepted value that differs from this one.
    pub const fn other(&self, value: u16) -> u16 {
        if value == self.high {
            self.low
        } else {
            self.high
        }
    }
}

/// The reply to the probe's request for a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// A reply other than exception 01.
    Yes,
    /// Exception 01.
    Refused,
    /// Silence.
    Silent,
}

/// The board and the modules of a modio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Modio {
    /// The board, by its register BOARD; `None` for a board that the register map does not know.
    pub board: Option<&'static Row>,
    /// The modules in force, port 1 first.
    pub modules: [Module; points::PORTS as usize],
}

impl Modio {
    /// Returns the ports that have a slot, with the modules in force. For an unknown board, the ports that have a
    /// module.
    pub fn slots(&self) -> impl Iterator<Item = (u16, Module)> {
        let ports = (1..).zip(self.modules);
        ports.filter(|(port, module)| match self.board {
            Some(board) => board.has_slot(*port),
            None => *module != Module::None,
        })
    }

    /// Returns the module in the first slot.
    pub fn module(&self) -> Module {
        self.slots()
            .next()
            .map_or(Module::None, |(_, module)| module)
    }

    /// Returns the points of all modules with their kinds, in ascending order of their addresses.
    pub fn points(&self) -> impl Iterator<Item = (u16, Kind)> {
        let of_slot = |(port, module): (u16, Module)| {
            let kinds = self
                .board
                .map_or(module.points(), |board| board.kinds(port, module));
            (points::first(port)..).zip(kinds)
        };
        let points = self.slots().flat_map(of_slot);
        points.filter(|(_, kind)| *kind != Kind::None)
    }

    /// Returns the runs of neighbouring points of these kinds.
    pub fn runs(&self, kinds: &[Kind]) -> Vec<Span> {
        let mut runs: Vec<Span> = Vec::new();
        for (address, _) in self.points().filter(|(_, kind)| kinds.contains(kind)) {
            match runs.last_mut() {
                Some(run) if run.last + 1 == address => run.last = address,
                _ => runs.push(Span::one(address)),
            }
        }
        runs
    }
}

impl fmt::Display for Modio {
    /// Returns the module in its slot, such as `4do`; of a board with several slots all of them, such as `1=4do
    /// 2=none`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.slots().count() < 2 {
            return self.module().fmt(f);
        }
        for (n, (port, module)) in self.slots().enumerate() {
            let separator = if n == 0 { "" } else { " " };
            write!(f, "{separator}{port}={module}")?;
        }
        Ok(())
    }
}

/// The unit under test.
#[derive(Clone, Debug)]
pub struct Target {
    /// Its address, 1 to 247 (255 for a modio in recovery mode).
    pub unit: u8,
    /// RTU or ASCII.
    pub mode: Mode,
    /// How long to wait.
    pub patience: Patience,
    /// Whether a modio's configuration may be written.
    pub allow_config: bool,
    /// The functions that were probed.
    pub functions: BTreeMap<u8, Support>,
    /// The readable addresses, for functions 1 to 4. The runs are in ascending order. Two runs follow each other
    /// without an address between them only when one request cannot span both.
    pub readable: [Vec<Span>; 4],
    /// Coils to write to: at most 1968.
    pub bits: Option<Span>,
    /// Registers to write to.
    pub words: Option<Words>,
    /// Whether the unit drops a frame with a gap between t1.5 and t3.5. `None`: both are right.
    pub strict_t15: Option<bool>,
    /// The board and modules, if the unit is a modio.
    pub modio: Option<Modio>,
    /// The PDU of a request that the unit answers, and that has no effect.
    pub ping: Vec<u8>,
    /// What a bench adds.
    pub hil: Hil,
}

impl Target {
    /// Returns the runs that this function (1 to 4) reads.
    pub fn readable(&self, function: u8) -> &[Span] {
        match function {
            1..=4 => &self.readable[usize::from(function) - 1],
            _ => &[],
        }
    }

    /// Returns the longest run that this function reads.
    pub fn longest(&self, function: u8) -> Option<Span> {
        let spans = self.readable(function).iter().copied();
        spans.max_by_key(|span| (span.len(), u16::MAX - span.first))
    }

    /// Returns whether the unit has this function.
    pub fn has(&self, function: u8) -> bool {
        self.functions.get(&function) == Some(&Support::Yes)
    }

    /// Returns the highest address that this function (1 to 4) cannot read.
    pub fn nowhere(&self, function: u8) -> Option<u16> {
        let spans = self.readable(function);
        (0..=u16::MAX)
            .rev()
            .find(|address| !spans.iter().any(|span| span.has(*address)))
    }

    /// Returns the highest address without a coil, or without a register, for a function that writes.
    pub fn nowhere_to_write(&self, function: u8) -> Option<u16> {
        match function {
            5 | 15 => self.nowhere(1),
            _ => self.nowhere(3),
        }
    }
}

/// Returns the values of the registers BAUD and FORMAT for a line. The error says what the device does not have.
pub(crate) fn codes(line: LineFormat) -> Result<[u16; 2], String> {
    let (baud, name) = (line.baud, line.format.to_string());
    let rate = Baud::ALL.iter().find(|rate| rate.bits_per_second() == baud);
    let rate = rate.ok_or_else(|| format!("the device has no rate of {baud} bit/s"))?;
    let format = Format::ALL.iter().find(|format| format.name() == name);
    let format = format.ok_or_else(|| format!("the device has no format {name}"))?;
    Ok([rate.code(), format.code()])
}

#[cfg(test)]
mod tests {
    use register_map::board::{MODIO_02, MODIO_08};

    use super::*;

    const fn span(first: u16, last: u16) -> Span {
        Span { first, last }
    }

    fn target(holding: Vec<Span>) -> Target {
        Target {
            unit: 1,
            mode: Mode::Rtu,
            patience: Patience::default(),
            allow_config: false,
            functions: BTreeMap::from([(3, Support::Yes), (4, Support::Refused)]),
            readable: [vec![], vec![], holding, vec![]],
            bits: None,
            words: None,
            strict_t15: None,
            modio: None,
            ping: vec![],
            hil: Hil::default(),
        }
    }

    #[test]
    fn run_of_points_spans_slots_and_ends_where_the_kind_changes() {
        let mut modules = [Module::None; 8];
        modules[..4].copy_from_slice(&[Module::Relay2, Module::Do4, Module::None, Module::Ai2Ao2]);
        let modio = Modio {
            board: Some(&MODIO_08),
            modules,
        };
        assert_eq!(modio.runs(&[Kind::BitOutput]), [span(2, 7)]);
        let bits = [Kind::BitInput, Kind::BitOutput];
        assert_eq!(modio.runs(&bits), [span(0, 7)]);
        assert_eq!(modio.runs(&[Kind::WordOutput]), [span(14, 15)]);
        assert_eq!(modio.to_string(), "1=2relay 2=4do 3=none 4=2ai2ao");
        assert_eq!((modio.slots().count(), modio.module()), (4, Module::Relay2));

        modules[4] = Module::Di4;
        let board = Some(&MODIO_02);
        let modio = Modio { board, modules };
        assert_eq!(
            modio.runs(&bits),
            [span(0x10, 0x13)],
            "port 5 alone has a slot"
        );
        assert_eq!(modio.to_string(), "4di");
        let board = None;
        assert_eq!(Modio { board, modules }.slots().count(), 4);
    }

    #[test]
    fn span_has_a_length_and_can_be_cut() {
        assert_eq!(span(0, u16::MAX).len(), 65_536);
        assert_eq!(span(10, 19).up_to(4), span(10, 13));
        assert_eq!(span(10, 12).up_to(4), span(10, 12));
        assert_eq!(span(0xFFFE, 0xFFFF).up_to(123), span(0xFFFE, 0xFFFF));
    }

    #[test]
    fn longest_run_and_highest_address_outside_are_found() {
        let target = target(vec![span(0, 3), span(10, 20), span(0xFFF0, 0xFFFF)]);
        assert_eq!(target.longest(3), Some(span(0xFFF0, 0xFFFF)));
        assert_eq!(target.nowhere(3), Some(0xFFEF));
        assert_eq!(target.longest(4), None);
        assert!(target.has(3) && !target.has(4) && !target.has(5));
    }
}
