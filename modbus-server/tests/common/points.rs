//! The device of the tests.

use modbus_server::{Bits, BitsOut, DataModel, Exception, Span, Words, WordsOut};

/// Bits and words from address 0 on, some of them read-only; words above `MAX_WORD` are refused.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    pub bits: Vec<bool>,
    pub words: Vec<u16>,
    /// Points from here on cannot be written.
    pub read_only_from: u32,
    /// If set, everything that has a right address and value is refused with it.
    pub state: Option<Exception>,
    /// Exception status, and the low byte of the diagnostic register.
    pub status: u8,
    pub server_id: Vec<u8>,
    pub running: bool,
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

/// The largest word [`Points`] takes.
pub const MAX_WORD: u16 = 0xFFF0;

impl Points {
    pub fn new(bits: usize, words: usize) -> Self {
        Self {
            bits: vec![false; bits],
            words: vec![0; words],
            read_only_from: u32::MAX,
            state: None,
            status: 0x6D,
            server_id: vec![0x42],
            running: true,
            objects: (0..=255).map(object).collect(),
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
    fn check_read_bits(&self, span: Span) -> Result<(), Exception> {
        self.check(span.end(), self.bits.len(), true)
    }

    fn check_read_words(&self, span: Span) -> Result<(), Exception> {
        self.check(span.end(), self.words.len(), true)
    }

    fn check_write_bits(&self, span: Span, bits: Bits<'_>) -> Result<(), Exception> {
        assert_eq!(span.count(), bits.count());
        self.check(span.end(), self.writable(self.bits.len()), true)
    }

    fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        assert_eq!(usize::from(span.count()), words.count());
        let good = words.iter().all(|word| word <= MAX_WORD);
        self.check(span.end(), self.writable(self.words.len()), good)
    }

    fn read_bits(&self, span: Span, out: &mut BitsOut<'_>) {
        for address in span.addresses() {
            out.push(self.bits[usize::from(address)]);
        }
    }

    fn read_words(&self, span: Span, out: &mut WordsOut<'_>) {
        for address in span.addresses() {
            out.push(self.words[usize::from(address)]);
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

    fn is_running(&self) -> bool {
        self.running
    }

    fn identification(&self, object: u8) -> Option<&[u8]> {
        assert!(!(0x07..=0x7F).contains(&object), "{object:02X} is reserved");
        self.objects[usize::from(object)].as_deref()
    }
}
