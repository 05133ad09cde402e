//! The device for the tests.

use std::ops::{Deref, DerefMut};

use modbus_reference::{Device, UNIT};
use modbus_server::{
    Adu, Bits, BitsOut, DataModel, Exception, Function, Span, Table, TextOut, Words, WordsOut,
};

/// The reference's device as a data model.
#[derive(Clone, Debug, PartialEq)]
pub struct Points(pub Device);

impl Deref for Points {
    type Target = Device;

    fn deref(&self) -> &Device {
        &self.0
    }
}

impl DerefMut for Points {
    fn deref_mut(&mut self) -> &mut Device {
        &mut self.0
    }
}

/// Every exception, to find one by its code.
const EXCEPTIONS: [Exception; 10] = [
    Exception::IllegalFunction,
    Exception::IllegalDataAddress,
    Exception::IllegalDataValue,
    Exception::ServerDeviceFailure,
    Exception::Acknowledge,
    Exception::ServerDeviceBusy,
    Exception::NegativeAcknowledge,
    Exception::MemoryParityError,
    Exception::GatewayPathUnavailable,
    Exception::GatewayTargetDeviceFailedToRespond,
];

impl Points {
    /// Creates a device with `bits` coils and discrete inputs and `words` holding and input registers each.
    pub fn new(bits: usize, words: usize) -> Self {
        Self(Device::new(bits, words))
    }

    /// Returns the bits that function 01 or 02 reads.
    pub fn bits_of(&mut self, function: u8) -> &mut Vec<bool> {
        match function {
            1 => &mut self.bits,
            2 => &mut self.input_bits,
            _ => panic!("function {function:02X} reads no bits"),
        }
    }

    /// Returns the words that function 03 or 04 reads.
    pub fn words_of(&mut self, function: u8) -> &mut Vec<u16> {
        match function {
            3 => &mut self.words,
            4 => &mut self.input_words,
            _ => panic!("function {function:02X} reads no words"),
        }
    }

    fn table_of_bits(&self, table: Table) -> &[bool] {
        match table {
            Table::Coils => &self.bits,
            Table::DiscreteInputs => &self.input_bits,
            _ => panic!("{table:?} has no bits"),
        }
    }

    fn table_of_words(&self, table: Table) -> &[u16] {
        match table {
            Table::HoldingRegisters => &self.words,
            Table::InputRegisters => &self.input_words,
            _ => panic!("{table:?} has no words"),
        }
    }

    fn check(&self, end: u32, points: usize, value_is_good: bool) -> Result<(), Exception> {
        if end as usize > points {
            return Err(Exception::IllegalDataAddress);
        }
        if !value_is_good {
            return Err(Exception::IllegalDataValue);
        }
        let state = |exception: &&Exception| Some(exception.code()) == self.state;
        EXCEPTIONS.iter().find(state).copied().map_or(Ok(()), Err)
    }

    /// Returns the number of records in a file.
    fn records(&self, file: u16) -> usize {
        assert!(file > 0, "no file has the number 0");
        self.files.get(usize::from(file) - 1).map_or(0, Vec::len)
    }

    fn writable(&self, points: usize) -> usize {
        points.min(self.read_only_from as usize)
    }
}

impl DataModel for Points {
    fn has(&self, function: Function) -> bool {
        !self.lacks.contains(&function.code())
    }

    fn has_files(&self) -> bool {
        !self.files.is_empty()
    }

    fn check_read_file(&self, file: u16, records: Span) -> Result<(), Exception> {
        self.check(records.end(), self.records(file), true)
    }

    fn check_write_file(
        &self,
        file: u16,
        records: Span,
        words: Words<'_>,
    ) -> Result<(), Exception> {
        assert_eq!(usize::from(records.count()), words.count());
        let good = words.iter().all(|word| word <= self.max_word);
        self.check(records.end(), self.writable(self.records(file)), good)
    }

    fn read_file(&self, file: u16, records: Span, out: &mut WordsOut<'_>) {
        for record in records.addresses() {
            out.push(self.files[usize::from(file) - 1][usize::from(record)]);
        }
    }

    fn write_file(&mut self, file: u16, records: Span, words: Words<'_>) {
        assert_eq!(usize::from(records.count()), words.count());
        for (record, word) in records.addresses().zip(words.iter()) {
            self.files[usize::from(file) - 1][usize::from(record)] = word;
        }
    }

    fn check_read_bits(&self, table: Table, span: Span) -> Result<(), Exception> {
        self.check(span.end(), self.table_of_bits(table).len(), true)
    }

    fn check_read_words(&self, table: Table, span: Span) -> Result<(), Exception> {
        self.check(span.end(), self.table_of_words(table).len(), true)
    }

    fn check_write_bits(&self, span: Span, bits: Bits<'_>) -> Result<(), Exception> {
        assert_eq!(span.count(), bits.count());
        self.check(span.end(), self.writable(self.bits.len()), true)
    }

    fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        assert_eq!(usize::from(span.count()), words.count());
        let good = words.iter().all(|word| word <= self.max_word);
        self.check(span.end(), self.writable(self.words.len()), good)
    }

    fn read_bits(&self, table: Table, span: Span, out: &mut BitsOut<'_>) {
        for address in span.addresses() {
            out.push(self.table_of_bits(table)[usize::from(address)]);
        }
    }

    fn read_words(&self, table: Table, span: Span, out: &mut WordsOut<'_>) {
        for address in span.addresses() {
            out.push(self.table_of_words(table)[usize::from(address)]);
        }
    }

    fn write_bits(&mut self, span: Span, bits: Bits<'_>) {
        assert_eq!(span.count(), bits.count());
        for (address, bit) in span.addresses().zip(bits.iter()) {
            self.bits[usize::from(address)] = bit;
        }
    }

    fn write_words(&mut self, span: Span, words: Words<'_>) {
        assert_eq!(usize::from(span.count()), words.count());
        for (address, word) in span.addresses().zip(words.iter()) {
            self.words[usize::from(address)] = word;
        }
    }

    fn exception_status(&self) -> u8 {
        self.status
    }

    fn diagnostic_register(&self) -> u16 {
        0xAB00 | u16::from(self.status)
    }

    fn server_id(&self) -> &[u8] {
        &self.server_id
    }

    fn additional_data(&self) -> &[u8] {
        &self.additional_data
    }

    fn check_custom(&self, code: u8, data: &[u8]) -> Result<(), Exception> {
        if self.custom != Some(code) {
            Err(Exception::IllegalFunction)
        } else if data.is_empty() {
            Err(Exception::IllegalDataValue)
        } else {
            Ok(())
        }
    }

    fn serve_custom(&mut self, code: u8, adu: &mut Adu) {
        assert_eq!(self.custom, Some(code));
        assert_eq!(adu.as_slice()[..2], [UNIT, code]);
        self.kept = adu.as_slice()[2..].to_vec();
        adu.truncate(2);
        for byte in self.kept.repeat(3).iter().rev() {
            adu.push(*byte);
        }
    }

    fn is_running(&self) -> bool {
        self.running
    }

    fn identification(&self, object: u8, text: &mut TextOut<'_>) -> bool {
        assert!(!(0x07..=0x7F).contains(&object), "{object:02X} is reserved");
        let value = self.objects[usize::from(object)].as_deref();
        // The text is appended in two parts, because a model may need several calls.
        let (front, back) = value
            .unwrap_or(b"none")
            .split_at(value.map_or(0, |v| v.len() / 2));
        text.extend(front);
        text.extend(back);
        value.is_some()
    }
}
