//! Encodes a description as CBOR. docs/self-description.md describes the format.

use std::convert::Infallible;

use minicbor::Encoder;

use crate::format::{self, PORT_BYTES};
use crate::{
    Description, Field, ModuleType, Narrower, PointKind, Reading, Register, Unit, Value, Values,
};

type Out<'a> = Encoder<&'a mut Vec<u8>>;
/// Writing to memory does not fail.
type Done = Result<(), minicbor::encode::Error<Infallible>>;

impl Description {
    /// Returns the CBOR document. Its last bytes are the ports, [`PORT_BYTES`] for each.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        match document(&mut Encoder::new(&mut bytes), self) {
            Ok(()) => bytes,
            Err(error) => unreachable!("a vector takes every byte: {error}"),
        }
    }
}

fn document(e: &mut Out<'_>, of: &Description) -> Done {
    e.array(3)?.u16(format::VERSION)?.array(7)?;
    e.str(&of.board)?.str(&of.model)?.str(&of.firmware)?;
    e.u16(of.map_version)?;
    e.array(of.kinds.len() as u64)?;
    of.kinds.iter().try_for_each(|kind| point_kind(e, kind))?;
    e.array(of.modules.len() as u64)?;
    of.modules.iter().try_for_each(|one| module_type(e, one))?;
    e.array(of.registers.len() as u64)?;
    of.registers.iter().try_for_each(|one| register(e, one))?;
    let ports = of
        .ports
        .iter()
        .flat_map(|port| [port.number, port.lacks, port.module as u8]);
    let ports: Vec<u8> = ports.collect();
    debug_assert!(ports.len().is_multiple_of(PORT_BYTES));
    e.bytes(&ports)?;
    Ok(())
}

fn point_kind(e: &mut Out<'_>, kind: &PointKind) -> Done {
    e.array(if kind.readings.is_empty() { 3 } else { 4 })?;
    e.str(&kind.name)?.u8(format::table_code(kind.table))?;
    e.bool(kind.writable)?;
    if !kind.readings.is_empty() {
        e.array(kind.readings.len() as u64)?;
        kind.readings.iter().try_for_each(|one| reading(e, one))?;
    }
    Ok(())
}

fn reading(e: &mut Out<'_>, reading: &Reading) -> Done {
    e.array(4 + unit_fields(&reading.unit))?;
    e.u16(reading.range)?.u16(reading.scale)?;
    e.i32(reading.min)?.i32(reading.max)?;
    unit(e, &reading.unit)
}

fn module_type(e: &mut Out<'_>, module: &ModuleType) -> Done {
    e.array(3)?.u16(module.code)?.str(&module.name)?;
    e.bytes(&module.points)?;
    Ok(())
}

/// Trailing fields with default values are omitted.
fn register(e: &mut Out<'_>, register: &Register) -> Done {
    let access = format::access_code(register.writable, register.restart);
    let fields = match register {
        Register {
            narrower: Some(_), ..
        } => 10,
        Register { default: 1.., .. } => 9,
        Register { values, .. } if *values != format::ANY => 8,
        _ if access != 0 => 7,
        Register { scope, .. } if *scope != format::SCOPE => 6,
        Register { count, .. } if *count != format::COUNT => 5,
        _ => 4,
    };
    e.array(fields)?;
    e.u16(register.address)?.str(&register.name)?;
    value(e, &register.value)?;
    e.str(&register.about)?;
    if fields > 4 {
        e.u16(register.count)?;
    }
    if fields > 5 {
        e.u8(format::scope_code(register.scope))?;
    }
    if fields > 6 {
        e.u8(access)?;
    }
    if fields > 7 {
        values(e, &register.values)?;
    }
    if fields > 8 {
        e.u16(register.default)?;
    }
    if let Some(of) = &register.narrower {
        narrower(e, of)?;
    }
    Ok(())
}

fn narrower(e: &mut Out<'_>, narrower: &Narrower) -> Done {
    e.array(3 + u64::from(narrower.value.is_some()))?;
    e.u8(narrower.kind)?;
    values(e, &narrower.values)?;
    e.u16(narrower.default)?;
    narrower.value.iter().try_for_each(|of| value(e, of))
}

fn value(e: &mut Out<'_>, value: &Value) -> Done {
    match value {
        Value::Number(of) => {
            e.array(1 + unit_fields(of))?.u8(format::NUMBER)?;
            unit(e, of)
        }
        Value::Long(of) => {
            e.array(1 + unit_fields(of))?.u8(format::LONG)?;
            unit(e, of)
        }
        Value::Codes(codes) => {
            e.array(2)?.u8(format::CODES)?.map(codes.len() as u64)?;
            codes.iter().try_for_each(|(code, name)| {
                e.u16(*code)?.str(name)?;
                Ok(())
            })
        }
        Value::Bits(bits) => {
            e.array(2)?.u8(format::BITS)?.map(bits.len() as u64)?;
            bits.iter().try_for_each(|(bit, name)| {
                e.u8(*bit)?.str(name)?;
                Ok(())
            })
        }
        Value::Opaque => {
            e.array(1)?.u8(format::OPAQUE)?;
            Ok(())
        }
        Value::Point => {
            e.array(1)?.u8(format::POINT)?;
            Ok(())
        }
        Value::Fields { kind, fields } => {
            e.array(3)?.u8(format::FIELDS)?.u8(*kind)?;
            e.array(fields.len() as u64)?;
            fields.iter().try_for_each(|one| field(e, one))
        }
    }
}

/// Trailing items with default values are omitted.
fn field(e: &mut Out<'_>, field: &Field) -> Done {
    let items = match field {
        Field { default: 1.., .. } => 4,
        Field { values, .. } if *values != format::ANY => 3,
        _ => 2,
    };
    e.array(items)?.str(&field.name)?;
    value(e, &field.value)?;
    if items > 2 {
        values(e, &field.values)?;
    }
    if items > 3 {
        e.u16(field.default)?;
    }
    Ok(())
}

/// Returns the number of fields of a unit at the end of an array: none for a plain number.
fn unit_fields(unit: &Unit) -> u64 {
    match unit {
        Unit { offset, .. } if *offset != 0 => 3,
        Unit { exponent, .. } if *exponent != 0 => 2,
        Unit { code, .. } if !code.is_empty() => 1,
        _ => 0,
    }
}

fn unit(e: &mut Out<'_>, unit: &Unit) -> Done {
    let fields = unit_fields(unit);
    if fields > 0 {
        e.str(&unit.code)?;
    }
    if fields > 1 {
        e.i8(unit.exponent)?;
    }
    if fields > 2 {
        e.i16(unit.offset)?;
    }
    Ok(())
}

fn values(e: &mut Out<'_>, values: &Values) -> Done {
    match values {
        Values::Range(min, max) => {
            e.array(3)?.u8(format::RANGE)?.u16(*min)?.u16(*max)?;
        }
        Values::RangeOr(also, min, max) => {
            e.array(4)?.u8(format::RANGE_OR)?;
            e.u16(*also)?.u16(*min)?.u16(*max)?;
        }
        Values::OneOf(values) => {
            e.array(1 + values.len() as u64)?.u8(format::ONE_OF)?;
            for value in values {
                e.u16(*value)?;
            }
        }
    }
    Ok(())
}
