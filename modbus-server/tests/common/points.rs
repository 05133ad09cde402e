//! The device of the tests.

use modbus_server::{
    Adu, Bits, BitsOut, DataModel, Exception, Function, Span, Table, TextOut, Words, WordsOut,
};

/// Four tables from address 0 on.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    /// Coils.
    pub bits: Vec<bool>,
    /// Discrete inputs.
    pub input_bits: Vec<bool>,
    /// Holding registers.
    pub words: Vec<u16>,
    /// Input registers.
    pub input_words: Vec<u16>,
    /// Function codes that the device does not have.
    pub lacks: Vec<u8>,
    /// Coils and holding registers from here on cannot be written.
    pub read_only_from: u32,
    /// Larger words are refused.
    pub max_word: u16,
    /// If set, everything that has a right address and value is refused with it.
    pub state: Option<Exception>,
    /// Exception status, and the low byte of the diagnostic register.
    pub status: u8,
    pub server_id: Vec<u8>,
    pub running: bool,
    pub additional_data: Vec<u8>,
    /// A function that the server does not know: it keeps its data, and answers with them backwards,
    /// three times. Without data it is refused.
    pub custom: Option<u8>,
    pub kept: Vec<u8>,
    /// Device identification by object.
    pub objects: Vec<Option<Vec<u8>>>,
}

/// The objects of the device identification in the tests: short ones, an empty one, and some that
/// do not fit one reply together.
pub fn object(id: u8) -> Option<Vec<u8>> {
    let text = |text: &str| Some(text.as_bytes().to_vec());
    match id {
        0 => text("Company identification"),
        1 => text("Product code XX"),
        2 => text("V2.11"),
        3 => text("https://example.org/"),
        4 => text("Product"),
        5 => text("Model"),
        6 => text(""),
        0x80 => Some(vec![b'a'; 180]),
        0x81 => Some(vec![b'b'; 300]),
        0x82 => Some(vec![b'c'; 244]),
        0x83 => Some(vec![b'd'; 120]),
        0x84 => Some(vec![b'e'; 122]),
        _ => None,
    }
}

/// The largest word that new [`Points`] take.
pub const MAX_WORD: u16 = 0xFFF0;

impl Points {
    /// Coils and discrete inputs, holding and input registers, as many of each kind.
    pub fn new(bits: usize, words: usize) -> Self {
        Self {
            bits: vec![false; bits],
            input_bits: vec![false; bits],
            words: vec![0; words],
            input_words: vec![0; words],
            lacks: Vec::new(),
            read_only_from: u32::MAX,
            max_word: MAX_WORD,
            state: None,
            status: 0x6D,
            server_id: vec![0x42],
            running: true,
            additional_data: Vec::new(),
            custom: None,
            kept: Vec::new(),
            objects: (0..=255).map(object).collect(),
        }
    }

    /// The bits that function 01 or 02 reads.
    pub fn bits_of(&mut self, function: u8) -> &mut Vec<bool> {
        match function {
            1 => &mut self.bits,
            2 => &mut self.input_bits,
            _ => panic!("function {function:02X} reads no bits"),
        }
    }

    /// The words that function 03 or 04 reads.
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
        self.state.map_or(Ok(()), Err)
    }

    fn writable(&self, points: usize) -> usize {
        points.min(self.read_only_from as usize)
    }
}

impl DataModel for Points {
    fn has(&self, function: Function) -> bool {
        !self.lacks.contains(&function.code())
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
        assert_eq!(adu.as_slice()[..2], [super::UNIT, code]);
        self.kept = adu.as_slice()[2..].to_vec();
        adu.clear();
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
        // In two parts, for a model that makes its text may need several.
        let (front, back) = value
            .unwrap_or(b"none")
            .split_at(value.map_or(0, |v| v.len() / 2));
        text.extend(front);
        text.extend(back);
        value.is_some()
    }
}
