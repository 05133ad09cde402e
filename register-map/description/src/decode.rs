//! Decodes CBOR into a description. The decoder skips fields that a later version of the format has appended.
//!
//! A unit can send any bytes, so the decoder limits what a description can contain. Programs then need no checks of
//! their own: a text cannot control a terminal, and the memory for all registers stays small.

use minicbor::Decoder;

use crate::format::{self, PORT_BYTES, VERSION};
use crate::limit;
use crate::{
    Description, Error, Field, ModuleType, Narrower, PointKind, Port, Reading, Register, Unit,
    Value, Values,
};

type Read<T> = Result<T, Error>;

impl Description {
    /// Reads a CBOR document.
    ///
    /// # Errors
    ///
    /// [`Error::Version`] for a format that is newer than [`VERSION`], [`Error::Form`] for anything else that is not a
    /// self-description.
    pub fn decode(bytes: &[u8]) -> Result<Self, Error> {
        let mut d = Decoder::new(bytes);
        let description = document(&mut d)?;
        if d.position() < bytes.len() {
            let end = d.position();
            return Err(form(format!("bytes after its end (byte {end})")));
        }
        Ok(description)
    }
}

fn form(what: impl Into<String>) -> Error {
    Error::Form(what.into())
}

/// The fields of an array, in order.
struct Fields<'d, 'b> {
    d: &'d mut Decoder<'b>,
    left: u64,
}

impl<'d, 'b> Fields<'d, 'b> {
    fn of(d: &'d mut Decoder<'b>) -> Read<Self> {
        let at = d.position();
        let left = d.array()?;
        let left = left.ok_or_else(|| form(format!("an array without a length (byte {at})")))?;
        Ok(Self { d, left })
    }

    /// Reads a field that every document has.
    fn next<T>(&mut self, read: impl FnOnce(&mut Decoder<'b>) -> Read<T>) -> Read<T> {
        let at = self.d.position();
        self.option(read)?
            .ok_or_else(|| form(format!("an array ends too early (byte {at})")))
    }

    /// Reads a field that may be missing, together with all fields after it.
    fn option<T>(&mut self, read: impl FnOnce(&mut Decoder<'b>) -> Read<T>) -> Read<Option<T>> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        read(self.d).map(Some)
    }

    /// Reads all remaining fields as elements of a list. Memory grows with the elements that exist, not with the
    /// length that the array claims.
    fn all<T>(mut self, mut read: impl FnMut(&mut Decoder<'b>) -> Read<T>) -> Read<Vec<T>> {
        let mut list = Vec::new();
        while let Some(element) = self.option(&mut read)? {
            list.push(element);
        }
        Ok(list)
    }

    /// Skips the fields that this program does not know.
    fn end(mut self) -> Read<()> {
        while self.option(|d| Ok(d.skip()?))?.is_some() {}
        Ok(())
    }
}

/// Reads a name, a version or a code of a unit.
fn name(d: &mut Decoder<'_>) -> Read<String> {
    text(d, limit::NAME)
}

/// Reads a text of up to `most` bytes.
fn text(d: &mut Decoder<'_>, most: usize) -> Read<String> {
    let at = d.position();
    let text = d.str()?;
    if text.len() > most {
        let length = text.len();
        return Err(form(format!(
            "a text of {length} bytes, more than {most} (byte {at})"
        )));
    }
    if text.chars().any(limit::is_control) {
        return Err(form(format!("a control character in a text (byte {at})")));
    }
    Ok(text.to_owned())
}

fn u16(d: &mut Decoder<'_>) -> Read<u16> {
    Ok(d.u16()?)
}

fn u8(d: &mut Decoder<'_>) -> Read<u8> {
    Ok(d.u8()?)
}

fn list<'b, T>(d: &mut Decoder<'b>, read: impl FnMut(&mut Decoder<'b>) -> Read<T>) -> Read<Vec<T>> {
    Fields::of(d)?.all(read)
}

fn document(d: &mut Decoder<'_>) -> Read<Description> {
    let mut fields = Fields::of(d)?;
    let version = fields.next(|d| Ok(d.u64()?))?;
    if version == 0 {
        return Err(form("format version 0"));
    }
    if version > u64::from(VERSION) {
        return Err(Error::Version(version));
    }
    let mut description = fields.next(firmware)?;
    description.ports = fields.next(ports)?;
    fields.end()?;
    limit::check(&description).map_err(form)?;
    Ok(description)
}

/// Reads the part that the firmware determines: everything except the ports.
fn firmware(d: &mut Decoder<'_>) -> Read<Description> {
    let mut fields = Fields::of(d)?;
    let board = fields.next(name)?;
    let model = fields.next(name)?;
    let firmware = fields.next(name)?;
    let map_version = fields.next(u16)?;
    let kinds = fields.next(|d| list(d, point_kind))?;
    let modules = fields.next(|d| list(d, |d| module_type(d, kinds.len())))?;
    let registers = fields.next(|d| list(d, |d| register(d, kinds.len())))?;
    fields.end()?;
    Ok(Description {
        board,
        model,
        firmware,
        map_version,
        registers,
        kinds,
        modules,
        ports: Vec::new(),
    })
}

fn ports(d: &mut Decoder<'_>) -> Read<Vec<Port>> {
    let (ports, rest) = d.bytes()?.as_chunks::<PORT_BYTES>();
    if !rest.is_empty() {
        return Err(form("a port without a whole module code"));
    }
    let ports = ports.iter().map(|&[number, lacks, module]| Port {
        number,
        module: module.into(),
        lacks,
    });
    Ok(ports.collect())
}

fn point_kind(d: &mut Decoder<'_>) -> Read<PointKind> {
    let mut fields = Fields::of(d)?;
    let kind = PointKind {
        name: fields.next(name)?,
        table: format::table_of(fields.next(u8)?),
        writable: fields.next(|d| Ok(d.bool()?))?,
        readings: fields.option(|d| list(d, reading))?.unwrap_or_default(),
    };
    fields.end()?;
    Ok(kind)
}

fn reading(d: &mut Decoder<'_>) -> Read<Reading> {
    let mut fields = Fields::of(d)?;
    let (range, scale) = (fields.next(u16)?, fields.next(u16)?);
    let (min, max) = (
        fields.next(|d| Ok(d.i32()?))?,
        fields.next(|d| Ok(d.i32()?))?,
    );
    let unit = unit(&mut fields)?;
    fields.end()?;
    Ok(Reading {
        range,
        scale,
        unit,
        min,
        max,
    })
}

/// Reads the index of a kind of point, one of `kinds`.
fn place(d: &mut Decoder<'_>, kinds: usize) -> Read<u8> {
    known(u8(d)?, kinds)
}

fn known(place: u8, kinds: usize) -> Read<u8> {
    if usize::from(place) < kinds {
        Ok(place)
    } else {
        Err(form(format!("unknown kind of point {place}")))
    }
}

fn module_type(d: &mut Decoder<'_>, kinds: usize) -> Read<ModuleType> {
    let mut fields = Fields::of(d)?;
    let (code, name) = (fields.next(u16)?, fields.next(name)?);
    let points = fields.next(|d| Ok(d.bytes()?))?;
    let points = <[u8; 4]>::try_from(points).map_err(|_| form("a module without four points"))?;
    for point in points {
        known(point, kinds)?;
    }
    fields.end()?;
    Ok(ModuleType { code, name, points })
}

fn register(d: &mut Decoder<'_>, kinds: usize) -> Read<Register> {
    let mut fields = Fields::of(d)?;
    let address = fields.next(u16)?;
    let name = fields.next(name)?;
    let value = fields.next(|d| meaning(d, kinds))?;
    let about = fields.next(|d| text(d, limit::ABOUT))?;
    let count = fields.option(u16)?.unwrap_or(format::COUNT);
    let scope = fields.option(u8)?.map_or(format::SCOPE, format::scope_of);
    let (writable, restart) = format::access_of(fields.option(u8)?.unwrap_or_default());
    let values = fields.option(values)?.unwrap_or(format::ANY);
    let default = fields.option(u16)?.unwrap_or_default();
    let narrower = fields.option(|d| narrower(d, kinds))?;
    fields.end()?;
    Ok(Register {
        address,
        count,
        name,
        scope,
        value,
        writable,
        restart,
        values,
        default,
        narrower,
        about,
    })
}

fn narrower(d: &mut Decoder<'_>, kinds: usize) -> Read<Narrower> {
    let mut fields = Fields::of(d)?;
    let narrower = Narrower {
        kind: fields.next(|d| place(d, kinds))?,
        values: fields.next(values)?,
        default: fields.next(u16)?,
        value: fields.option(value)?,
    };
    fields.end()?;
    Ok(narrower)
}

/// Reads the meaning of registers.
fn meaning(d: &mut Decoder<'_>, kinds: usize) -> Read<Value> {
    // Fields are not nested, so that the depth of a document is limited.
    let start = d.position();
    let mut items = Fields::of(d)?;
    if items.next(u8)? != format::FIELDS {
        d.set_position(start);
        return value(d);
    }
    let kind = items.next(|d| place(d, kinds))?;
    let fields = items.next(|d| list(d, field))?;
    items.end()?;
    if fields.is_empty() || fields.len() > limit::CODES {
        return Err(form(format!(
            "{} fields of a value (byte {start})",
            fields.len()
        )));
    }
    Ok(Value::Fields { kind, fields })
}

fn field(d: &mut Decoder<'_>) -> Read<Field> {
    let mut items = Fields::of(d)?;
    let field = Field {
        name: items.next(name)?,
        value: items.next(value)?,
        values: items.option(values)?.unwrap_or(format::ANY),
        default: items.option(u16)?.unwrap_or_default(),
    };
    items.end()?;
    Ok(field)
}

/// Reads the meaning of a number. An unknown kind of value becomes a value without meaning.
fn value(d: &mut Decoder<'_>) -> Read<Value> {
    let mut fields = Fields::of(d)?;
    let value = match fields.next(u8)? {
        format::NUMBER => Value::Number(unit(&mut fields)?),
        format::LONG => Value::Long(unit(&mut fields)?),
        format::CODES => Value::Codes(fields.next(|d| names(d, u16))?),
        format::BITS => Value::Bits(fields.next(|d| names(d, bit))?),
        format::POINT => Value::Point,
        _ => Value::Opaque,
    };
    fields.end()?;
    Ok(value)
}

/// Reads a map of numbers to names.
fn names<'b, T>(
    d: &mut Decoder<'b>,
    number: impl Fn(&mut Decoder<'b>) -> Read<T>,
) -> Read<Vec<(T, String)>> {
    let at = d.position();
    let entries = d.map()?;
    let entries = entries.ok_or_else(|| form(format!("a map without a length (byte {at})")))?;
    if entries > limit::CODES as u64 {
        return Err(form(format!("{entries} names of one value (byte {at})")));
    }
    let mut names = Vec::new();
    for _ in 0..entries {
        names.push((number(d)?, name(d)?));
    }
    Ok(names)
}

/// Reads the number of a bit in a register.
fn bit(d: &mut Decoder<'_>) -> Read<u8> {
    let at = d.position();
    let bit = u8(d)?;
    if bit > 15 {
        return Err(form(format!("bit {bit} of a register (byte {at})")));
    }
    Ok(bit)
}

/// Reads the unit at the end of an array.
fn unit(fields: &mut Fields<'_, '_>) -> Read<Unit> {
    Ok(Unit {
        code: fields.option(name)?.unwrap_or_default(),
        exponent: fields.option(exponent)?.unwrap_or_default(),
        offset: fields.option(|d| Ok(d.i16()?))?.unwrap_or_default(),
    })
}

fn exponent(d: &mut Decoder<'_>) -> Read<i8> {
    let at = d.position();
    let exponent = d.i8()?;
    if exponent.unsigned_abs() > limit::EXPONENT {
        return Err(form(format!("exponent {exponent} (byte {at})")));
    }
    Ok(exponent)
}

/// Reads a set of values. An unknown kind of set becomes the set of all values.
fn values(d: &mut Decoder<'_>) -> Read<Values> {
    let mut fields = Fields::of(d)?;
    let values = match fields.next(u8)? {
        format::RANGE => Values::Range(fields.next(u16)?, fields.next(u16)?),
        format::RANGE_OR => {
            Values::RangeOr(fields.next(u16)?, fields.next(u16)?, fields.next(u16)?)
        }
        format::ONE_OF if fields.left > limit::CODES as u64 => {
            return Err(form(format!("a set of {} values", fields.left)));
        }
        format::ONE_OF => return Ok(Values::OneOf(fields.all(u16)?)),
        _ => format::ANY,
    };
    fields.end()?;
    Ok(values)
}
