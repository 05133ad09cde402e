//! The device that a server serves.

/// Four tables from address 0 on.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    /// Coils.
    pub bits: Vec<bool>,
    /// Discrete inputs.
    pub input_bits: Vec<bool>,
    /// Holding registers.
    pub words: Vec<u16>,
    /// Input registers.
    pub input_words: Vec<u16>,
    /// Files from number 1 on.
    pub files: Vec<Vec<u16>>,
    /// Function codes that the device does not have.
    pub lacks: Vec<u8>,
    /// Coils, holding registers and records of files from here on cannot be written.
    pub read_only_from: u32,
    /// Larger words are refused.
    pub max_word: u16,
    /// If set, requests with right addresses and values are refused with this exception.
    pub state: Option<u8>,
    /// Exception status, and the low byte of the diagnostic register.
    pub status: u8,
    /// The identity of function 11.
    pub server_id: Vec<u8>,
    /// The run indicator of function 11.
    pub running: bool,
    /// Of function 11, after the run indicator.
    pub additional_data: Vec<u8>,
    /// A function that the server does not know. The device keeps the data and answers with them backwards, three
    /// times. A request without data is refused.
    pub custom: Option<u8>,
    /// The data of the last request of that function.
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

/// The largest word that a new [`Device`] takes.
pub const MAX_WORD: u16 = 0xFFF0;

impl Device {
    /// Coils and discrete inputs, holding and input registers, as many of each kind.
    pub fn new(bits: usize, words: usize) -> Self {
        Self {
            bits: vec![false; bits],
            input_bits: vec![false; bits],
            words: vec![0; words],
            input_words: vec![0; words],
            files: Vec::new(),
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
}
