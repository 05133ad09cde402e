//! The meaning of a unit's registers and points, as data for tools: read from the unit, or created from crate
//! register-map for a unit without its own description.
//!
//! A tool that relies only on a [`Description`] can show, check and name every value of a unit that is newer than
//! the tool.
//!
//! A unit has its description in file 1, as CBOR: [`Description::open`] decodes the file, [`Description::decode`]
//! the CBOR. docs/self-description.md describes the format and its limits.

#![forbid(unsafe_code)]

mod decode;
mod encode;
mod error;
mod file;
mod format;
mod known;
mod limit;

pub use error::Error;
pub use file::{FILE, HEAD, checksum, records};
pub use format::{PORT_BYTES, VERSION};
pub use known::describe;

/// The description of a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Name of the board, such as `modio-02`.
    pub board: String,
    /// Model in the device identification.
    pub model: String,
    /// Version of the firmware, such as `0.2.0`.
    pub firmware: String,
    /// Version of the register map.
    pub map_version: u16,
    /// Registers other than the points, in ascending order of the addresses.
    pub registers: Vec<Register>,
    /// Kinds of point. [`ModuleType::points`] contains indices of this list, from 0.
    pub kinds: Vec<PointKind>,
    /// Known modules, in the order of their codes.
    pub modules: Vec<ModuleType>,
    /// Ports with a slot, in ascending order, with their modules in force.
    pub ports: Vec<Port>,
}

/// A register, or a run of registers with the same meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct Register {
    /// First address, counted from 0.
    pub address: u16,
    /// Number of registers, 1 or more.
    pub count: u16,
    /// Name, such as `BAUD` or `reset cause`.
    pub name: String,
    /// What each value belongs to.
    pub scope: Scope,
    /// Meaning of the number.
    pub value: Value,
    /// Whether a master can write it.
    pub writable: bool,
    /// Whether a written value takes effect only after a restart.
    pub restart: bool,
    /// Allowed values, if it can be written.
    pub values: Values,
    /// Factory default, if it can be written.
    pub default: u16,
    /// For a setting by point: the kind of point with other values.
    pub narrower: Option<Narrower>,
    /// Description in one line.
    pub about: String,
}

/// What each value in a run of registers belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// The unit.
    Unit,
    /// Each port, 1 to 8.
    Port,
    /// Each point: four for each port.
    Point,
}

/// Values of a setting for one kind of point, where they differ from the other kinds.
#[derive(Clone, Debug, PartialEq)]
pub struct Narrower {
    /// Kind of point: its index in [`Description::kinds`].
    pub kind: u8,
    /// Allowed values.
    pub values: Values,
    /// Default value.
    pub default: u16,
    /// Meaning of the number; `None` when it is the same as for the other points, [`Register::value`].
    pub value: Option<Value>,
}

/// Meaning of a number.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number in each register.
    Number(Unit),
    /// A number of 32 bits in each two registers, high word first.
    Long(Unit),
    /// One of these codes in each register.
    Codes(Vec<(u16, String)>),
    /// Bits with names.
    Bits(Vec<(u8, String)>),
    /// All registers of the run are one value without further meaning.
    Opaque,
    /// The address of a point in each register; 0xFFFF = none.
    Point,
    /// Consecutive registers with a meaning of their own. They are written together.
    Fields {
        /// Kind of the points that have these registers: its index in [`Description::kinds`].
        kind: u8,
        /// The registers in order.
        fields: Vec<Field>,
    },
}

/// One of the registers of a [`Value::Fields`].
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Name.
    pub name: String,
    /// Meaning of its number: one register.
    pub value: Value,
    /// Allowed values. Others of the fields may restrict them.
    pub values: Values,
    /// Factory default.
    pub default: u16,
}

impl Value {
    /// Returns the number of registers of one value; for [`Self::Opaque`] 1, although all registers together are a value.
    #[must_use]
    pub const fn registers(&self) -> u16 {
        match self {
            Self::Long(_) => 2,
            Self::Fields { fields, .. } => fields.len() as u16,
            _ => 1,
        }
    }
}

/// Unit of a number: the quantity is `(number + offset) * 10^exponent` in the unit.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unit {
    /// Code in UCUM; empty for a plain number.
    pub code: String,
    /// Power of ten of one step.
    pub exponent: i8,
    /// Quantity for the number 0, in steps.
    pub offset: i16,
}

/// Set of values that a register allows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Values {
    /// From the first to the second, both included.
    Range(u16, u16),
    /// The first, or from the second to the third.
    RangeOr(u16, u16, u16),
    /// One of these values.
    OneOf(Vec<u16>),
}

/// Kind of a point.
#[derive(Clone, Debug, PartialEq)]
pub struct PointKind {
    /// Name, such as `digital input`.
    pub name: String,
    /// Whether it is a bit or a word; `None` when there is no point at the address.
    pub table: Option<Table>,
    /// Whether a master can write it.
    pub writable: bool,
    /// For a word: its meaning for the values of registers RANGE and SCALE.
    pub readings: Vec<Reading>,
}

/// Table in which a point is read and written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// By functions 01, 02, 05 and 0F.
    Bit,
    /// By functions 03, 04, 06 and 10.
    Word,
}

/// Meaning of a point's word for one value of RANGE and SCALE.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// The value of RANGE.
    pub range: u16,
    /// The value of SCALE.
    pub scale: u16,
    /// Unit of the word.
    pub unit: Unit,
    /// Smallest value. If it is below 0, the word is in two's complement.
    pub min: i32,
    /// Largest value.
    pub max: i32,
}

/// A kind of module.
#[derive(Clone, Debug, PartialEq)]
pub struct ModuleType {
    /// Code in register MODULE.
    pub code: u16,
    /// Name, such as `4ai`.
    pub name: String,
    /// Kinds of the four points of its port, as indices of [`Description::kinds`].
    pub points: [u8; 4],
}

/// A port with points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port {
    /// Number of the port, 1 to 8.
    pub number: u8,
    /// Code of the module in force.
    pub module: u16,
    /// Number of the module's channels that the port does not have: the last ones.
    pub lacks: u8,
}
