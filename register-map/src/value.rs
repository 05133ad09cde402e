//! What a register's number means, for people and for tools.

use core::fmt;

/// What a register, or a run of like ones, holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// A number in each register.
    Number(Unit),
    /// A number of 32 bits in each two registers, high word first.
    Long(Unit),
    /// In each register one of these codes, which have names.
    Codes(&'static [(u16, &'static str)]),
    /// Bits with a name each, the lowest being bit 0. The others are 0.
    Bits(&'static [(u8, &'static str)]),
    /// Registers that have a meaning only together, such as an identity. They are shown in hexadecimal.
    Opaque,
}

impl Value {
    /// A number without a unit.
    pub const NUMBER: Self = Self::Number(Unit::NONE);
    /// A number of 32 bits without a unit.
    pub const LONG: Self = Self::Long(Unit::NONE);

    /// A number in this unit.
    #[must_use]
    pub const fn number(code: &'static str) -> Self {
        Self::tens(code, 0)
    }

    /// A number in 10^`exponent` of this unit: `tens("ms", -1)` counts tenths of a millisecond.
    #[must_use]
    pub const fn tens(code: &'static str, exponent: i8) -> Self {
        Self::Number(Unit {
            code,
            exponent,
            offset: 0,
        })
    }

    /// A number of 32 bits in this unit.
    #[must_use]
    pub const fn long(code: &'static str) -> Self {
        match Self::number(code) {
            Self::Number(unit) => Self::Long(unit),
            other => other,
        }
    }

    /// The unit of a number.
    #[must_use]
    pub const fn unit(self) -> Unit {
        match self {
            Self::Number(unit) | Self::Long(unit) => unit,
            Self::Codes(_) | Self::Bits(_) | Self::Opaque => Unit::NONE,
        }
    }

    /// How many registers make one value; `None` when all of them together do.
    #[must_use]
    pub const fn registers(self) -> Option<u16> {
        match self {
            Self::Number(_) | Self::Codes(_) | Self::Bits(_) => Some(1),
            Self::Long(_) => Some(2),
            Self::Opaque => None,
        }
    }
}

/// What a number counts: the quantity is `(number + offset) * 10^exponent` in the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Its code in UCUM (the Unified Code for Units of Measure): `ms`, `By` for bytes; empty for a plain number.
    pub code: &'static str,
    /// The power of ten that one step is.
    pub exponent: i8,
    /// The quantity at the number 0, in steps.
    pub offset: i16,
}

impl Unit {
    /// A plain number.
    pub const NONE: Self = Self {
        code: "",
        exponent: 0,
        offset: 0,
    };
}

/// As in `100 bit/s`, `0.1 ms` or `410 MHz + n`; nothing for a plain number.
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
    fn units_are_written_as_people_read_them() {
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
