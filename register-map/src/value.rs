//! Meaning of a register's number, for people and for tools.

use core::fmt;

use crate::kind::Kind;
use crate::values::Values;

/// Kind of content of a register or of a run of similar ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// A number in each register.
    Number(Unit),
    /// A number of 32 bits in each two registers, high word first.
    Long(Unit),
    /// One of these codes, which have names, in each register.
    Codes(&'static [(u16, &'static str)]),
    /// Bits with names, the lowest being bit 0. All other bits are 0.
    Bits(&'static [(u8, &'static str)]),
    /// Registers that have a meaning only together, such as an identity. Shown in hexadecimal.
    Opaque,
    /// The address of a point; 0xFFFF = none.
    Point,
    /// Consecutive registers with a meaning of their own, which only points of this kind have. They are written together.
    Fields(Kind, &'static [Field]),
}

/// One of the registers of a [`Value::Fields`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name.
    pub name: &'static str,
    /// Meaning of its number: one register, which is not [`Value::Fields`] itself.
    pub value: Value,
    /// Allowed values. Others of the fields may restrict them.
    pub values: Values,
    /// Factory default.
    pub default: u16,
}

impl Field {
    /// Returns a field.
    #[must_use]
    pub const fn new(name: &'static str, value: Value, values: Values, default: u16) -> Self {
        Self {
            name,
            value,
            values,
            default,
        }
    }
}

impl Value {
    /// A number without a unit.
    pub const NUMBER: Self = Self::Number(Unit::NONE);
    /// A number of 32 bits without a unit.
    pub const LONG: Self = Self::Long(Unit::NONE);

    /// Returns a number in this unit.
    #[must_use]
    pub const fn number(code: &'static str) -> Self {
        Self::tens(code, 0)
    }

    /// Returns a number in 10^`exponent` of this unit: `tens("ms", -1)` counts tenths of a millisecond.
    #[must_use]
    pub const fn tens(code: &'static str, exponent: i8) -> Self {
        Self::Number(Unit {
            code,
            exponent,
            offset: 0,
        })
    }

    /// Returns a number of 32 bits in this unit.
    #[must_use]
    pub const fn long(code: &'static str) -> Self {
        match Self::number(code) {
            Self::Number(unit) => Self::Long(unit),
            other => other,
        }
    }

    /// Returns the unit of a number.
    #[must_use]
    pub const fn unit(self) -> Unit {
        match self {
            Self::Number(unit) | Self::Long(unit) => unit,
            Self::Codes(_) | Self::Bits(_) | Self::Opaque | Self::Point | Self::Fields(..) => {
                Unit::NONE
            }
        }
    }

    /// Returns the number of registers of one value, or `None` when all of them together are one value.
    #[must_use]
    pub const fn registers(self) -> Option<u16> {
        match self {
            Self::Number(_) | Self::Codes(_) | Self::Bits(_) | Self::Point => Some(1),
            Self::Long(_) => Some(2),
            Self::Opaque => None,
            Self::Fields(_, fields) => Some(fields.len() as u16),
        }
    }
}

/// Unit of a number: the quantity is `(number + offset) * 10^exponent` in the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Code in UCUM (the Unified Code for Units of Measure): `ms`, `By` for bytes; empty for a plain number.
    pub code: &'static str,
    /// Power of ten of one step.
    pub exponent: i8,
    /// Quantity for the number 0, in steps.
    pub offset: i16,
}

impl Unit {
    /// No unit, for a plain number.
    pub const NONE: Self = Self {
        code: "",
        exponent: 0,
        offset: 0,
    };
}

/// Writes `100 bit/s`, `0.1 ms` or `410 MHz + n`; nothing for a plain number.
impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.code {
            "By" => "bytes",
            "Cel" => "degC",
            code => code,
        };
        if self.offset != 0 {
            return write!(f, "{} {name} + n", self.offset);
        }
        match self.exponent {
            0 => {}
            1.. => {
                f.write_str("1")?;
                (0..self.exponent).try_for_each(|_| f.write_str("0"))?;
                f.write_str(" ")?;
            }
            ..0 => {
                f.write_str("0.")?;
                (1..-self.exponent).try_for_each(|_| f.write_str("0"))?;
                f.write_str("1 ")?;
            }
        }
        f.write_str(name)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString;

    use super::*;

    #[test]
    fn units_are_written_with_their_factor_and_offset() {
        let written = |value: Value| value.unit().to_string();
        assert_eq!(written(Value::tens("bit/s", 2)), "100 bit/s");
        assert_eq!(written(Value::tens("ms", -1)), "0.1 ms");
        assert_eq!(written(Value::tens("s", -3)), "0.001 s");
        assert_eq!(written(Value::number("By")), "bytes");
        assert_eq!(written(Value::NUMBER), "");
        let channel = Unit {
            code: "MHz",
            exponent: 0,
            offset: 410,
        };
        assert_eq!(channel.to_string(), "410 MHz + n");
    }
}
