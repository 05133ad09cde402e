//! The data model of a device that consists only of tables and files.

use crate::{Bits, BitsOut, DataModel, Exception, Function, Span, Table, Words, WordsOut};

/// Four tables and some files in slices: the [`DataModel`] of a device without its own checks and identification.
///
/// Each table begins at address 0 and ends with its slice; higher addresses return exception 02. An empty table
/// means that the device does not have it: the functions that need it return exception 01. Every coil, every
/// holding register and every record of a file can be written with any value.
///
/// Bits are `bool`, one per byte. Packing would save 1750 bytes for 2000 bits, but then the program would need a
/// function for each access. A device with more bits implements [`DataModel`] over its own storage.
///
/// ```
/// use modbus_server::{DataModel, Span, Table, Tables};
///
/// let (mut relays, mut setpoints) = ([false; 8], [0; 10]);
/// let mut tables = Tables {
///     coils: &mut relays,
///     holding_registers: &mut setpoints,
///     ..Tables::default()
/// };
/// tables.holding_registers[3] = 500; // the program's own access
/// assert!(tables.check_read_bits(Table::Coils, Span::single(7)).is_ok());
/// assert!(tables.check_read_bits(Table::Coils, Span::single(8)).is_err());
/// ```
#[derive(Debug, Default)]
pub struct Tables<'a> {
    /// Functions 01, 05 and 0F.
    pub coils: &'a mut [bool],
    /// Function 02.
    pub discrete_inputs: &'a mut [bool],
    /// Functions 03, 06, 10, 16 and 17.
    pub holding_registers: &'a mut [u16],
    /// Function 04.
    pub input_registers: &'a mut [u16],
    /// Functions 14 and 15: the first is file 1, and each begins with record 0. A file ends with its slice; records
    /// above 9999 cannot be accessed.
    pub files: &'a mut [&'a mut [u16]],
}

impl Tables<'_> {
    fn bits(&self, table: Table) -> &[bool] {
        match table {
            Table::Coils => self.coils,
            Table::DiscreteInputs => self.discrete_inputs,
            Table::HoldingRegisters | Table::InputRegisters => &[],
        }
    }

    fn words(&self, table: Table) -> &[u16] {
        match table {
            Table::HoldingRegisters => self.holding_registers,
            Table::InputRegisters => self.input_registers,
            Table::Coils | Table::DiscreteInputs => &[],
        }
    }

    /// Returns the records of a file, or none if the file does not exist.
    fn file(&self, file: u16) -> &[u16] {
        self.files
            .get(place(file))
            .map(|file| &**file)
            .unwrap_or_default()
    }
}

/// Returns the index of a file.
fn place(file: u16) -> usize {
    // The server rejects a request for file 0.
    usize::from(file).wrapping_sub(1)
}

/// Returns the points of `span`, if all of them exist.
fn points<T>(table: &[T], span: Span) -> Result<&[T], Exception> {
    let points = table.get(usize::from(span.start())..span.end() as usize);
    points.ok_or(Exception::IllegalDataAddress)
}

/// Writes values to the points of `span`.
fn write<T>(table: &mut [T], span: Span, values: impl Iterator<Item = T>) {
    let points = table.iter_mut().skip(span.start().into());
    points.zip(values).for_each(|(point, value)| *point = value);
}

impl DataModel for Tables<'_> {
    fn has(&self, function: Function) -> bool {
        match function {
            Function::ReadCoils | Function::WriteSingleCoil | Function::WriteMultipleCoils => {
                !self.coils.is_empty()
            }
            Function::ReadDiscreteInputs => !self.discrete_inputs.is_empty(),
            Function::ReadHoldingRegisters
            | Function::WriteSingleRegister
            | Function::WriteMultipleRegisters
            | Function::MaskWriteRegister
            | Function::ReadWriteMultipleRegisters => !self.holding_registers.is_empty(),
            Function::ReadInputRegisters => !self.input_registers.is_empty(),
            _ => true,
        }
    }

    fn has_files(&self) -> bool {
        !self.files.is_empty()
    }

    fn check_read_bits(&self, table: Table, span: Span) -> Result<(), Exception> {
        points(self.bits(table), span).map(|_| ())
    }

    fn check_read_words(&self, table: Table, span: Span) -> Result<(), Exception> {
        points(self.words(table), span).map(|_| ())
    }

    fn check_write_bits(&self, span: Span, _: Bits<'_>) -> Result<(), Exception> {
        points(self.coils, span).map(|_| ())
    }

    fn check_write_words(&self, span: Span, _: Words<'_>) -> Result<(), Exception> {
        points(self.holding_registers, span).map(|_| ())
    }

    fn read_bits(&self, table: Table, span: Span, out: &mut BitsOut<'_>) {
        let bits = points(self.bits(table), span).unwrap_or_default();
        bits.iter().for_each(|bit| out.push(*bit));
    }

    fn read_words(&self, table: Table, span: Span, out: &mut WordsOut<'_>) {
        let words = points(self.words(table), span).unwrap_or_default();
        words.iter().for_each(|word| out.push(*word));
    }

    fn write_bits(&mut self, span: Span, bits: Bits<'_>) {
        write(self.coils, span, bits.iter());
    }

    fn write_words(&mut self, span: Span, words: Words<'_>) {
        write(self.holding_registers, span, words.iter());
    }
    fn check_read_file(&self, file: u16, records: Span) -> Result<(), Exception> {
        points(self.file(file), records).map(|_| ())
    }

    fn check_write_file(&self, file: u16, records: Span, _: Words<'_>) -> Result<(), Exception> {
        points(self.file(file), records).map(|_| ())
    }

    fn read_file(&self, file: u16, records: Span, out: &mut WordsOut<'_>) {
        let words = points(self.file(file), records).unwrap_or_default();
        words.iter().for_each(|word| out.push(*word));
    }

    fn write_file(&mut self, file: u16, records: Span, words: Words<'_>) {
        if let Some(file) = self.files.get_mut(place(file)) {
            write(file, records, words.iter());
        }
    }
}
