//! The numbers of the format that the encoder and the decoder share.

use crate::{Scope, Table, Values};

/// The version of the format.
pub const VERSION: u16 = 1;

/// Bytes of a port at the end of the document: its number, then the code of its module, high byte first.
pub const PORT_BYTES: usize = 3;

/// Kinds of value.
pub(crate) const NUMBER: u8 = 0;
pub(crate) const LONG: u8 = 1;
pub(crate) const CODES: u8 = 2;
pub(crate) const BITS: u8 = 3;
pub(crate) const OPAQUE: u8 = 4;
pub(crate) const POINT: u8 = 5;
pub(crate) const FIELDS: u8 = 6;

/// Kinds of sets of values.
pub(crate) const RANGE: u8 = 0;
pub(crate) const RANGE_OR: u8 = 1;
pub(crate) const ONE_OF: u8 = 2;

/// Default values of register fields that the document omits.
pub(crate) const COUNT: u16 = 1;
pub(crate) const SCOPE: Scope = Scope::Unit;
pub(crate) const ANY: Values = Values::Range(0, 0xFFFF);

/// Bits of a register's access.
const WRITABLE: u8 = 1 << 0;
const RESTART: u8 = 1 << 1;

pub(crate) const fn access_code(writable: bool, restart: bool) -> u8 {
    (if writable { WRITABLE } else { 0 }) | (if restart { RESTART } else { 0 })
}

/// Returns whether a register is writable, and whether a change takes effect only after a restart.
pub(crate) const fn access_of(code: u8) -> (bool, bool) {
    (code & WRITABLE != 0, code & RESTART != 0)
}

pub(crate) const fn scope_code(scope: Scope) -> u8 {
    match scope {
        Scope::Unit => 0,
        Scope::Port => 1,
        Scope::Point => 2,
    }
}

/// Returns the scope with this code. An unknown scope becomes that of the unit.
pub(crate) const fn scope_of(code: u8) -> Scope {
    match code {
        1 => Scope::Port,
        2 => Scope::Point,
        _ => Scope::Unit,
    }
}

pub(crate) const fn table_code(table: Option<Table>) -> u8 {
    match table {
        None => 0,
        Some(Table::Bit) => 1,
        Some(Table::Word) => 2,
    }
}

/// Returns the table with this code. An unknown table becomes none.
pub(crate) const fn table_of(code: u8) -> Option<Table> {
    match code {
        1 => Some(Table::Bit),
        2 => Some(Table::Word),
        _ => None,
    }
}
