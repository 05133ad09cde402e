//! A board that runs the image, and a master on its line.

use std::{env, ops::Range, path::PathBuf, sync::LazyLock};

use register_map::{configuration, points};
use sim::{
    Board, Config, Corner, Finding, Image, Module, Time,
    board::{Firmware, InSlot},
    finding::What,
    line::{Format, Settings, frame_silence},
};

use crate::LAYOUT;

/// The port of the board's first slot.
pub const PORT: u16 = LAYOUT.board.first_port;
/// The first point of that slot.
pub const SLOT: u16 = points::first(PORT);
/// The low byte of that point's address; the high byte is 0.
pub const FIRST: u8 = SLOT as u8;
/// Address of the setting MODULE of that slot.
pub const MODULE: u16 = configuration::MODULE + PORT - 1;

/// Size of a page of the store in bytes.
pub const PAGE_SIZE: usize = LAYOUT.board.layout().store.bytes as usize;
/// Addresses of the store's pages.
pub const PAGE_ADDRESSES: [u32; 2] = LAYOUT.board.layout().store.addresses();

/// Returns the offsets of the store's pages in the flash.
pub fn pages() -> [Range<usize>; 2] {
    PAGE_ADDRESSES.map(|address| {
        let start = (address - FLASH_START) as usize;
        start..start + PAGE_SIZE
    })
}

const FLASH_START: u32 = 0x0800_0000;

/// The firmware under test: the loader, and the image for slot A.
static FIRMWARE: LazyLock<Firmware> = LazyLock::new(|| {
    let loader = Image::read(&file("loader")).expect("the loader can be read");
    let image = InSlot::read(LAYOUT, &file("modio-a.image")).expect("the image can be read");
    Firmware::Loaded(loader, image)
});

/// Returns a file of the board's firmware.
pub fn file(name: &str) -> PathBuf {
    let board = LAYOUT.board.name.to_uppercase().replace('-', "_");
    let variable = format!("MODIO_IMAGES_{board}");
    let directory = env::var_os(&variable);
    let directory = directory.unwrap_or_else(|| panic!("{variable}: cargo xtask test sets it"));
    PathBuf::from(directory).join(name)
}

/// Returns the address of a symbol of the application.
pub fn symbol(name: &str) -> u32 {
    static APPLICATION: LazyLock<Image> =
        LazyLock::new(|| Image::read(&file("modio-a")).expect("the application can be read"));
    let symbol = APPLICATION.symbol(name);
    symbol.unwrap_or_else(|| panic!("the application has no symbol {name}"))
}

/// Returns a flash with the firmware under test, as after its first start, and a stored configuration with these
/// settings: address and value.
pub fn flash_with_settings(pairs: &[(u16, u16)]) -> Vec<u8> {
    let mut flash = programmed();
    let fit = LAYOUT.store(&mut flash, pairs);
    assert!(fit, "the settings fit in the store");
    flash
}

/// Returns a flash with the firmware under test, as after its first start, and no stored configuration.
fn programmed() -> Vec<u8> {
    static PROGRAMMED: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let mut flash = vec![0xFF; LAYOUT.part.flash_size];
        let programmed = FIRMWARE.program(LAYOUT, &mut flash, false);
        programmed.expect("the firmware fits");
        flash
    });
    PROGRAMMED.clone()
}

/// Returns a board of this type, just powered on. Its flash is that of the configuration, or has the firmware under test
/// and no settings. The loader is written into it.
pub fn board(mut config: Config) -> Board {
    let Firmware::Loaded(loader, _) = &*FIRMWARE else {
        panic!("the board has a loader");
    };
    config.layout = LAYOUT;
    config.chip.flash.get_or_insert_with(programmed);
    Board::new(loader, config).expect("the loader fits")
}

/// Returns the configuration of a board with this module, which is also stored, and with more stored settings.
pub fn config(module: Module, settings: &[(u16, u16)]) -> Config {
    let pairs = [&[(MODULE, module.code())], settings].concat();
    Config {
        module,
        chip: sim::chip::Config::holding(flash_with_settings(&pairs)),
        ..Config::default()
    }
}

/// Time that a unit has to start after power-on: at most 70 ms in the loader, and 100 ms in the application.
pub const START: Time = Time::from_ms(200);

/// Returns the CRC-16/MODBUS, calculated bit by bit as in the standard's appendix B: slow, but independent of the
/// project's other code.
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

/// A supply voltage below the detector's threshold of 2.78 V, far above the 2.0 V at which the part is reset.
pub const LOW_MV: u16 = 2700;
/// A supply voltage that is high enough to program the flash.
pub const GOOD_MV: u16 = 3300;

/// Returns the corner of the part at which the tests run: `MODIO_CORNER`, or nominal without that variable.
pub fn corner() -> Corner {
    let name = env::var("MODIO_CORNER");
    name.map_or(Corner::Nominal, |name| name.parse().expect("MODIO_CORNER"))
}

/// Upper limit of a time that depends on the cost of instructions: at the nominal corner, and at the slow one.
pub struct Most(pub Time, pub Time);

impl Most {
    pub const fn of(&self, corner: Corner) -> Time {
        match corner {
            Corner::Nominal | Corner::Fast | Corner::Gd32 => self.0,
            Corner::Slow => self.1,
        }
    }
}

/// Returns the frequency for the crystal of the corner that is `hz` with an exact crystal.
pub fn on_crystal(hz: u32) -> u32 {
    scaled(hz, corner().oscillators().hse)
}

/// Returns the frequency for the HSI of the corner that is `hz` with an exact HSI.
pub fn on_hsi(hz: u32) -> u32 {
    scaled(hz, corner().oscillators().hsi)
}

fn scaled(hz: u32, oscillator: u32) -> u32 {
    (u64::from(hz) * u64::from(oscillator) / 8_000_000) as u32
}

/// Returns an ADU: these bytes and their CRC.
pub fn adu(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc(bytes)].concat()
}

/// Returns an ASCII frame of unit 1.
pub fn ascii(pdu: &[u8], end: &str) -> Vec<u8> {
    let sum = pdu.iter().fold(1u8, |sum, byte| sum.wrapping_add(*byte));
    let mut text = String::from(":01");
    for byte in pdu.iter().chain(&[sum.wrapping_neg()]) {
        text += &format!("{byte:02X}");
    }
    (text + end).into_bytes()
}

/// Returns the line's format for a value of FORMAT.
pub fn format(code: u16) -> Format {
    Format::ALL[usize::from(code)]
}

/// A board and its master.
pub struct Rig {
    pub board: Board,
    settings: Settings,
    /// End of the last stop bit that was sent.
    pub sent: Time,
    /// Longest time after t3.5 before a reply begins: the unit's response delay.
    pub patience: Time,
    /// Whether the test expects findings, resets and the like.
    pub tolerant: bool,
}

impl Rig {
    /// Returns a board with this module and switch, powered and with time to start.
    pub fn new(module: Module, dip: u8) -> Self {
        Self::with(Config {
            dip,
            ..config(module, &[])
        })
    }

    /// Returns a board with this module, unit address 1 and more stored settings.
    pub fn set_up(module: Module, settings: &[(u16, u16)]) -> Self {
        let mut rig = Self::with(config(module, settings));
        let stored = |address| settings.iter().find(|pair| pair.0 == address);
        rig.settings(Settings {
            baud: stored(configuration::BAUD).map_or(9600, |pair| u32::from(pair.1) * 100),
            format: stored(configuration::FORMAT).map_or(Format::N2, |pair| format(pair.1)),
        });
        rig
    }

    /// Returns a board with this configuration, powered and with time to start.
    pub fn with(config: Config) -> Self {
        let mut rig = Self::cold(config);
        rig.board.run_for(START);
        rig
    }

    /// Returns a board that was powered just now, at the corner at which the tests run.
    pub fn cold(mut config: Config) -> Self {
        config.chip.corner = corner();
        Self::of(board(config))
    }

    /// Returns a board and its master.
    pub fn of(board: Board) -> Self {
        Self {
            board,
            settings: Settings::default(),
            sent: Time::ZERO,
            // Two characters at 921600 bit/s are less than the unit needs at the slow corner.
            patience: Time::from_us(100),
            tolerant: false,
        }
    }

    /// Sets the master to another rate and format.
    pub fn settings(&mut self, settings: Settings) {
        self.settings = settings;
        self.board.line().set_settings(settings);
    }

    /// Returns the duration of `n` characters on the line.
    pub fn characters(&self, n: u64) -> Time {
        self.settings.characters(n)
    }

    /// Returns the duration of a bit on the line.
    pub fn bit(&self) -> Time {
        self.settings.rate().bits(1)
    }

    /// Returns the largest error with which the unit's receiver sees an instant on the line: a sixteenth of a bit.
    pub fn sixteenth(&self) -> Time {
        self.settings.rate().sixteenths(1)
    }

    /// Returns t3.5 on the line.
    pub fn t35(&self) -> Time {
        frame_silence(self.settings)
    }

    /// Sends these bytes now and gives the unit time to answer. Returns the bytes of the reply, if there is one.
    pub fn exchange(&mut self, bytes: &[u8]) -> Vec<u8> {
        let now = self.board.now();
        self.sent = self.board.line().send(now, bytes);
        self.answer_after(self.sent)
    }

    /// Returns the bytes of a reply to a request that ended at `end`; empty when the unit does not reply in time.
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
        // The line must be silent before the next request.
        self.board.run_for(self.t35() + self.characters(1));
        let received = self.board.line().take_received();
        assert!(
            received.iter().all(sim::line::Received::is_good),
            "the unit sent a damaged character: {received:?}"
        );
        received.iter().map(|character| character.byte).collect()
    }

    /// Returns the time after the last stop bit of a reply in which the driver is off and the receiver on.
    pub fn ready(&self) -> Time {
        self.bit().max(Time::from_us(10))
    }

    /// Returns how far the end of a character is off in the master's time: its clock and the unit's differ by 100 ppm,
    /// and the divider by half a cycle a bit.
    pub fn clocks(&self) -> Time {
        Time::from_ps(self.characters(1).as_ps() / 10_000) + Time::from_ns(80)
    }

    /// Sends a request after `rest`. Returns the bytes of the reply and the time from t3.5 until the driver was on.
    /// Asserts that a reply begins within 60 ms, and that the driver is off in time after it. Afterwards the unit must
    /// be ready, and a master may send its next request now.
    pub fn hurry(&mut self, rest: Time, bytes: &[u8]) -> (Vec<u8>, Time) {
        let start = self.board.now() + rest;
        self.sent = self.board.line().send(start, bytes);
        let due = self.sent + self.t35();
        self.board.run_until(due);
        while !self.board.driver_enable() {
            let waited = self.board.now() - due;
            assert!(waited < Time::from_ms(60), "{bytes:02X?} got no reply");
            self.board.run_for(Time::from_us(10));
        }
        let late = self.board.now() - due;
        while self.board.driver_enable() {
            self.board.run_for(Time::from_us(5));
        }
        let reply = self.board.line().take_received();
        let ready = reply.last().expect("a reply").end + self.ready();
        let (off, _) = self.board.line().driver_edges().next_back().expect("edges");
        assert!(
            off <= ready + self.clocks(),
            "off at {off:?}, after {ready:?}"
        );
        self.board.run_until(ready);
        (reply.iter().map(|character| character.byte).collect(), late)
    }

    /// Sends a PDU to a unit. Returns the PDU of the reply, or `None` when there is no reply. Checks the reply's frame.
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
            "a valid request was not answered: {reply:02X?}"
        );
    }

    /// Returns how many bytes of the stack were not used since the application's start, which paints it.
    pub fn free_stack(&self) -> usize {
        const PAINT: [u8; 4] = [0xCC; 4];
        let (words, _) = self.board.ram().as_chunks();
        4 * words.iter().take_while(|word| **word == PAINT).count()
    }

    /// Asserts that the firmware did nothing that could fail on a real part.
    pub fn assert_sound(&mut self) {
        assert_eq!(self.board.findings(), [], "findings on the bus");
        assert!(!self.board.locked_up(), "the core is locked up");
        assert_eq!(self.board.resets(), 0, "resets since power-on");
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        if std::thread::panicking() {
            return;
        }
        if !self.tolerant {
            self.assert_sound();
        }
        if self.board.running_slot().is_some() {
            let free = self.free_stack();
            assert!(free >= 1024, "{free} bytes of the stack are free");
        }
        let findings = self.board.findings().iter();
        let stalled = findings.filter(|finding| matches!(finding.what, What::StalledRead { .. }));
        assert_eq!(stalled.collect::<Vec<_>>(), [] as [&Finding; 0]);
    }
}
