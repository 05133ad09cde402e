//! A board with the image on it and a master on its line.

use std::{env, ops::Range, path::Path, sync::OnceLock};

use register_map::{configuration, points};
use sim::{
    Board, Config, Corner, Image, Module, Time,
    line::{Format, Settings},
};

use crate::{ELF, LAYOUT};

/// The port of the board's first slot.
pub const PORT: u16 = LAYOUT.board.first_port;
/// The first point of that slot.
pub const SLOT: u16 = points::first(PORT);
/// The same as the low byte of its address; the high byte is 0.
pub const FIRST: u8 = SLOT as u8;
/// MODULE of that slot.
pub const MODULE: u16 = configuration::MODULE + PORT - 1;

/// Bytes of a page of the store.
pub const PAGE_SIZE: usize = LAYOUT.board.store.bytes as usize;
/// The addresses of the store's pages.
pub const PAGE_ADDRESSES: [u32; 2] = LAYOUT.board.store.addresses();

/// Where the store's pages are in the flash.
pub fn pages() -> [Range<usize>; 2] {
    PAGE_ADDRESSES.map(|address| {
        let start = (address - FLASH_START) as usize;
        start..start + PAGE_SIZE
    })
}

const FLASH_START: u32 = 0x0800_0000;

/// The image under test.
pub fn image() -> &'static Image {
    static IMAGE: OnceLock<Image> = OnceLock::new();
    IMAGE.get_or_init(|| {
        let path = env::var_os(ELF).unwrap_or_else(|| panic!("{ELF}: cargo xtask test sets it"));
        Image::read(Path::new(&path)).expect("the image can be read")
    })
}

/// A flash whose stored configuration has only the first slot's module.
pub fn flash_with(module: Module) -> Vec<u8> {
    let settings: Vec<_> = configuration::modules([(PORT, module)]).collect();
    flash_with_settings(&settings)
}

/// A flash whose stored configuration is these settings: address and value.
pub fn flash_with_settings(pairs: &[(u16, u16)]) -> Vec<u8> {
    LAYOUT.flash_with(pairs).expect("they fit")
}

/// CRC-16/MODBUS bit by bit, as the standard's appendix B says it: slow, and nobody else's code.
pub fn crc(bytes: &[u8]) -> [u8; 2] {
    let mut crc = 0xFFFFu16;
    for byte in bytes {
        crc ^= u16::from(*byte);
        for _ in 0..8 {
            let out = crc & 1 != 0;
            crc >>= 1;
            if out {
                crc ^= 0xA001;
            }
        }
    }
    crc.to_le_bytes()
}

/// A supply below the detector's threshold of 2.78 V, far above the 2.0 V at which the part is reset.
pub const LOW_MV: u16 = 2700;
/// A supply that flash can be programmed with.
pub const GOOD_MV: u16 = 3300;

/// The corner of the part that the tests run at: `MODIO_CORNER`, nominal without it.
pub fn corner() -> Corner {
    let name = env::var("MODIO_CORNER");
    name.map_or(Corner::Nominal, |name| name.parse().expect("MODIO_CORNER"))
}

/// A time that depends on what instructions cost: at most this long at the nominal corner, and at the slow one.
pub struct Most(pub Time, pub Time);

impl Most {
    pub const fn of(&self, corner: Corner) -> Time {
        match corner {
            Corner::Nominal | Corner::Fast => self.0,
            Corner::Slow => self.1,
        }
    }
}

/// A frequency that is `hz` from an exact crystal, from the crystal of the corner.
pub fn on_crystal(hz: u32) -> u32 {
    scaled(hz, corner().oscillators().hse)
}

/// A frequency that is `hz` from an exact HSI, from the HSI of the corner.
pub fn on_hsi(hz: u32) -> u32 {
    scaled(hz, corner().oscillators().hsi)
}

fn scaled(hz: u32, oscillator: u32) -> u32 {
    (u64::from(hz) * u64::from(oscillator) / 8_000_000) as u32
}

/// An ADU: these bytes and their CRC.
pub fn adu(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc(bytes)].concat()
}

/// The line's format for a value of FORMAT.
pub fn format(code: u16) -> Format {
    Format::ALL[usize::from(code)]
}

/// A board and its master.
pub struct Bench {
    pub board: Board,
    settings: Settings,
    /// The end of the last stop bit of what was sent last.
    pub sent: Time,
    /// How much later than after t3.5 a reply may begin: the unit's response delay.
    pub patience: Time,
    /// Findings, resets and the like are what the test is about.
    pub tolerant: bool,
}

impl Bench {
    /// A board with this module and switch, powered and given time to start.
    pub fn new(module: Module, dip: u8) -> Self {
        Self::with(Config {
            dip,
            module,
            flash: Some(flash_with(module)),
            ..Config::default()
        })
    }

    /// A board with this module and unit address 1, and settings stored beside that of the module.
    pub fn set_up(module: Module, settings: &[(u16, u16)]) -> Self {
        let pairs = [&[(MODULE, module.code())], settings].concat();
        let mut bench = Self::with(Config {
            module,
            flash: Some(flash_with_settings(&pairs)),
            ..Config::default()
        });
        let stored = |address| pairs.iter().find(|pair| pair.0 == address);
        bench.settings(Settings {
            baud: stored(configuration::BAUD).map_or(9600, |pair| u32::from(pair.1) * 100),
            format: stored(configuration::FORMAT).map_or(Format::N2, |pair| format(pair.1)),
        });
        bench
    }

    /// A board fitted like this, powered and given time to start.
    pub fn with(config: Config) -> Self {
        let mut bench = Self::cold(config);
        bench.board.run_for(Time::from_ms(150));
        bench
    }

    /// A board powered just now, at the corner that the tests run at.
    pub fn cold(config: Config) -> Self {
        let config = Config {
            corner: corner(),
            layout: LAYOUT,
            ..config
        };
        Self {
            board: Board::new(image(), config).expect("the image fits"),
            settings: Settings::default(),
            sent: Time::ZERO,
            patience: Time::ZERO,
            tolerant: false,
        }
    }

    /// Sets the master to another rate and format.
    pub fn settings(&mut self, settings: Settings) {
        self.settings = settings;
        self.board.line().set_settings(settings);
    }

    /// The length of `n` characters on the line.
    pub fn characters(&self, n: u64) -> Time {
        self.settings.characters(n)
    }

    /// The length of a bit on the line.
    pub fn bit(&self) -> Time {
        self.settings.rate().bits(1)
    }

    /// By how much the unit's receiver may misjudge an instant on the line: a sixteenth of a bit.
    pub fn sixteenth(&self) -> Time {
        self.settings.rate().sixteenths(1)
    }

    /// t3.5 on the line.
    pub fn t35(&self) -> Time {
        self.settings.frame_silence()
    }

    /// Sends bytes as they are, now, and gives the unit time to answer in. What it says, if anything.
    pub fn exchange(&mut self, bytes: &[u8]) -> Vec<u8> {
        let now = self.board.now();
        self.sent = self.board.line().send(now, bytes);
        self.answer_after(self.sent)
    }

    /// What the unit says within a moment after `end`, the end of what it was sent.
    pub fn answer_after(&mut self, end: Time) -> Vec<u8> {
        self.board.run_until(end + self.t35() + self.characters(2));
        let last = end + self.t35() + self.patience;
        while !self.board.driver_enable()
            && self.board.line().received().next().is_none()
            && self.board.now() < last
        {
            self.board.run_for(self.characters(1));
        }
        while self.board.driver_enable() {
            self.board.run_for(self.characters(1));
        }
        // The next request is to find the line silent.
        self.board.run_for(self.t35() + self.characters(1));
        let heard = self.board.line().take_received();
        assert!(
            heard.iter().all(sim::line::Received::is_good),
            "the unit's characters are good: {heard:?}"
        );
        heard.iter().map(|character| character.byte).collect()
    }

    /// Sends a PDU to a unit; its reply's PDU, or `None` when it is silent. Checks the reply's frame.
    pub fn ask(&mut self, unit: u8, pdu: &[u8]) -> Option<Vec<u8>> {
        let reply = self.exchange(&adu(&[&[unit], pdu].concat()));
        if reply.is_empty() {
            return None;
        }
        assert!(reply.len() >= 4, "too short for a frame: {reply:02X?}");
        let (body, check) = reply.split_at(reply.len() - 2);
        assert_eq!(check, crc(body), "the reply's CRC: {reply:02X?}");
        assert_eq!(body[0], unit, "the reply's unit: {reply:02X?}");
        Some(body[1..].to_vec())
    }

    /// Asserts that the unit answers an ordinary request.
    pub fn assert_answers(&mut self, unit: u8) {
        let reply = self.ask(unit, &[1, 0, FIRST, 0, 4]);
        assert!(
            matches!(reply.as_deref(), Some([1, 1, _])),
            "a good request is answered: {reply:02X?}"
        );
    }

    /// Asserts that the firmware did nothing a real part would not take well.
    pub fn assert_sound(&mut self) {
        assert_eq!(self.board.findings(), [], "nothing odd on the bus");
        assert!(!self.board.locked_up(), "the core runs");
        assert_eq!(self.board.resets(), 0, "no reset since power-on");
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        if !self.tolerant && !std::thread::panicking() {
            self.assert_sound();
        }
    }
}
