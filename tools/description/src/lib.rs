//! What a unit's registers and points mean, in a form that a tool can work with: read from the unit, or made from
//! crate register-map for a unit without a description of its own.
//!
//! A tool that uses nothing but a [`Description`] can show, check and name every value of a unit that is newer than
//! itself.
//!
//! A unit has its description in file 1, as CBOR: [`Description::open`] reads the file, [`Description::decode`] the
//! CBOR. docs/self-description.md has the format.

#![forbid(unsafe_code)]

mod decode;
mod encode;
mod error;
mod file;
mod format;
mod known;

pub use error::Error;
pub use file::{FILE, HEAD, checksum, records};
pub use format::{PORT_BYTES, VERSION};
pub use known::describe;

/// What a unit says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// The board's name: `modio-02`.
    pub board: String,
    /// The model in the device identification.
    pub model: String,
    /// The firmware's version: `0.1.0`.
    pub firmware: String,
    /// The version of the register map.
    pub map_version: u16,
    /// Its registers but for the points, in ascending order of the addresses.
    pub registers: Vec<Register>,
    /// What a point can be. [`ModuleType::points`] counts from 0 in here.
    pub kinds: Vec<PointKind>,
    /// The modules it knows, in the order of their codes.
    pub modules: Vec<ModuleType>,
    /// Its ports that have a slot, in ascending order, with what is in force there.
    pub ports: Vec<Port>,
}

/// A register, or a run of registers that mean the same.
#[derive(Clone, Debug, PartialEq)]
pub struct Register {
    /// The first address, counted from 0.
    pub address: u16,
    /// How many, 1 or more.
    pub count: u16,
    /// Its name: `BAUD`, `reset cause`.
    pub name: String,
    /// The things that have one value each.
    pub scope: Scope,
    /// What the number means.
    pub value: Value,
    /// Whether a master may write it.
    pub writable: bool,
    /// Whether what is written counts after a restart only.
    pub restart: bool,
    /// Which values it takes, where it can be written.
    pub values: Values,
    /// What the factory sets, where it can be written.
    pub default: u16,
    /// For a setting by point: the kind of point that takes other values.
    pub narrower: Option<Narrower>,
    /// What it is, in one line.
    pub about: String,
}

/// The things that have one value each in a run of registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// The unit.
    Unit,
    /// Each port, 1 to 8.
    Port,
    /// Each point: four for each port.
    Point,
}

/// What holds for points of one kind, where it differs from the rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Narrower {
    /// The kind: its place in [`Description::kinds`].
    pub kind: u8,
    /// The values.
    pub values: Values,
    /// The default.
    pub default: u16,
    /// What the number means. `None`: the same as for the other points, [`Register::value`].
    pub value: Option<Value>,
}

/// What a number means.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number in each register.
    Number(Unit),
    /// A number of 32 bits in each two registers, high word first.
    Long(Unit),
    /// In each register one of these codes.
    Codes(Vec<(u16, String)>),
    /// Bits with a name each.
    Bits(Vec<(u8, String)>),
    /// All registers of the run as one value without further meaning.
    Opaque,
}

/// What a number counts: the quantity is `(number + offset) * 10^exponent` in the unit.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unit {
    /// Its code in UCUM; empty for a plain number.
    pub code: String,
    /// The power of ten that one step is.
    pub exponent: i8,
    /// The quantity at the number 0, in steps.
    pub offset: i16,
}

/// Which values a register takes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Values {
    /// From the first to the second, both included.
    Range(u16, u16),
    /// The first, or from the second to the third.
    RangeOr(u16, u16, u16),
    /// These.
    OneOf(Vec<u16>),
}

/// What a point can be.
#[derive(Clone, Debug, PartialEq)]
pub struct PointKind {
    /// Its name: `digital input`.
    pub name: String,
    /// Whether it is a bit or a word. `None`: no point stands at the address.
    pub table: Option<Table>,
    /// Whether a master may write it.
    pub writable: bool,
    /// For a word: how the values of registers RANGE and SCALE make it be read.
    pub readings: Vec<Reading>,
}

/// Where a point is read and written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// By functions 01, 02, 05 and 0F.
    Bit,
    /// By functions 03, 04, 06 and 10.
    Word,
}

/// What the word of a point means while RANGE and SCALE have these values.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// The value of RANGE.
    pub range: u16,
    /// The value of SCALE.
    pub scale: u16,
    /// What the word counts.
    pub unit: Unit,
    /// The least value. Below 0: the word is in two's complement.
    pub min: i32,
    /// The greatest value.
    pub max: i32,
}

/// A kind of module.
#[derive(Clone, Debug, PartialEq)]
pub struct ModuleType {
    /// Its code in MODULE.
    pub code: u16,
    /// Its name: `4ai`.
    pub name: String,
    /// What it makes of the four points of its port: places in [`Description::kinds`].
    pub points: [u8; 4],
}

/// A port with a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Port {
    /// Its number, 1 to 8.
    pub number: u8,
    /// The code of the module in force.
    pub module: u16,
}
