//! The data that a server serves.

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
    /// First address of coils, holding registers and records of files that cannot be written.
    pub read_only_from: u32,
    /// Largest value that can be written to a word; larger values are rejected.
    pub max_word: u16,
    /// If set, every request with valid addresses and values is rejected with this exception.
    pub state: Option<u8>,
    /// Exception status, and the low byte of the diagnostic register.
    pub status: u8,
    /// The server ID of function 11.
    pub server_id: Vec<u8>,
    /// The run indicator of function 11.
    pub running: bool,
    /// The additional data of function 11, after the run indicator.
    pub additional_data: Vec<u8>,
    /// A user-defined function. The device stores the data of its request and replies with the data reversed, three
    /// times. It rejects a request without data.
    pub custom: Option<u8>,
    /// The data of the last request of that function.
    pub kept: Vec<u8>,
    /// Device identification by object.
    pub objects: Vec<Option<Vec<u8>>>,
}

/// Returns the objects of the device identification in the tests: short ones, an empty one, and some that do not
/// fit one reply together.
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

/// Largest word that a new [`Device`] allows.
pub const MAX_WORD: u16 = 0xFFF0;

impl Device {
    /// Creates a device with `bits` coils and discrete inputs and `words` holding and input registers each.
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
