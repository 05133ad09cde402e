//! The simulator in process: the firmware's image on the virtual board, in virtual time, exact to the
//! picosecond, with every way to damage a character.

use std::path::{Path, PathBuf};
use std::time::Duration;

use register_map::codes::{Baud, Format as FormatCode};
use register_map::{Module, configuration, record};
use sim::line::{Character, Format, Settings};
use sim::{Board, Config, Image, Time};

use super::{Abilities, Broken, Endpoint, Heard, Piece};
use crate::frame::Mode;
use crate::line::{LineFormat, Parity};

/// The part's flash, 128 KiB from here.
const FLASH_BASE: u32 = 0x0800_0000;
const FLASH_SIZE: usize = 128 * 1024;

/// Time for the unit to start in after power comes on.
const START: Time = Time::from_ms(150);

/// How the virtual board is fitted and set.
#[derive(Clone, Debug)]
pub struct Fitting {
    /// The firmware's ELF file.
    pub elf: PathBuf,
    /// What is in the slot.
    pub module: Module,
    /// SW01: the unit address.
    pub dip: u8,
    /// The stored rate and format.
    pub line: LineFormat,
    /// The stored transmission mode.
    pub mode: Mode,
    /// Further stored settings: register and value.
    pub settings: Vec<(u16, u16)>,
}

/// The virtual board and a master on its line.
pub struct Simulated {
    board: Board,
    name: String,
    line: LineFormat,
    findings: usize,
    /// Driver edges up to here have been told.
    edges_until: Time,
}

impl Simulated {
    /// A board fitted like this, switched on and started.
    ///
    /// # Errors
    ///
    /// When the image cannot be read, or the device has no such setting.
    pub fn new(fitting: &Fitting) -> Result<Self, Broken> {
        let image = Image::read(Path::new(&fitting.elf)).map_err(|e| Broken(e.to_string()))?;
        let config = Config {
            dip: fitting.dip,
            module: fitting.module,
            flash: Some(flash(fitting)?),
            ..Config::default()
        };
        let mut board = Board::new(&image, config).map_err(|e| Broken(e.to_string()))?;
        board.line().set_settings(settings(fitting.line)?);
        board.run_for(START);
        let (module, line) = (fitting.module, fitting.line);
        Ok(Self {
            board,
            name: format!("the simulator with {module}, {line}"),
            line,
            findings: 0,
            edges_until: Time::ZERO,
        })
    }

    /// The board, for what only a simulator can do.
    pub fn board(&mut self) -> &mut Board {
        &mut self.board
    }
}

/// A flash in which these settings are stored.
fn flash(fitting: &Fitting) -> Result<Vec<u8>, Broken> {
    let mut pairs = vec![(configuration::MODULE_SLOT, fitting.module.code())];
    pairs.extend(line_settings(fitting.line)?);
    if fitting.mode == Mode::Ascii {
        pairs.push((configuration::MODE, 1));
    }
    pairs.extend(&fitting.settings);
    let mut flash = vec![0xFF; FLASH_SIZE];
    let at = (record::PAGE_ADDRESSES[0] - FLASH_BASE) as usize;
    record::encode_page(0, &pairs, &mut flash[at..at + record::PAGE_SIZE])
        .ok_or_else(|| Broken("too many settings for a page of the store".to_owned()))?;
    Ok(flash)
}

/// The registers and values that stand for this rate and format.
///
/// # Errors
///
/// When the device has no such rate or format.
pub fn line_settings(line: LineFormat) -> Result<[(u16, u16); 2], Broken> {
    let baud = Baud::ALL
        .iter()
        .find(|baud| baud.bits_per_second() == line.baud)
        .ok_or_else(|| Broken(format!("the device has no rate of {} bit/s", line.baud)))?;
    let format = match format_of(line)? {
        Format::N2 => FormatCode::F8N2,
        Format::E1 => FormatCode::F8E1,
        Format::O1 => FormatCode::F8O1,
        Format::N1 => FormatCode::F8N1,
    };
    Ok([
        (configuration::BAUD, baud.code()),
        (configuration::FORMAT, format.code()),
    ])
}

fn format_of(line: LineFormat) -> Result<Format, Broken> {
    match (line.data_bits, line.parity, line.stop_bits) {
        (8, Parity::None, 2) => Ok(Format::N2),
        (8, Parity::Even, 1) => Ok(Format::E1),
        (8, Parity::Odd, 1) => Ok(Format::O1),
        (8, Parity::None, 1) => Ok(Format::N1),
        _ => Err(Broken(format!("the simulator's line has no {line}"))),
    }
}

fn settings(line: LineFormat) -> Result<Settings, Broken> {
    Ok(Settings {
        baud: line.baud,
        format: format_of(line)?,
    })
}

const fn time(duration: Duration) -> Time {
    Time::from_ns(duration.as_nanos() as u64)
}

const fn duration(time: Time) -> Duration {
    Duration::from_nanos(time.as_ns())
}

impl Endpoint for Simulated {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            exact: true,
            faults: true,
            power: true,
            driver: true,
            echo: true,
            set_line: true,
        }
    }

    fn line(&self) -> LineFormat {
        self.line
    }

    fn set_line(&mut self, line: LineFormat) -> Result<(), Broken> {
        self.board.line().set_settings(settings(line)?);
        self.line = line;
        Ok(())
    }

    fn now(&self) -> Duration {
        duration(self.board.now())
    }

    fn rest(&mut self, wanted: Duration) -> Result<(), Broken> {
        self.board.run_for(time(wanted));
        Ok(())
    }

    fn send(&mut self, pieces: &[Piece]) -> Result<Duration, Broken> {
        let mut at = self.board.now();
        let settings = settings(self.line)?;
        let line = self.board.line();
        for piece in pieces {
            at = match piece {
                Piece::Bytes(bytes) => line.send(at, bytes),
                Piece::Gap(gap) => at + time(*gap),
                Piece::BadParity(byte) => {
                    let character = Character::new(settings, *byte).with_wrong_parity();
                    line.send_character(at, character)
                }
                Piece::BadStop(byte) => {
                    // All stop bits are low, and one more bit brings the line back up.
                    let mut character = Character::new(settings, *byte);
                    let stop = settings.format.stop_bits();
                    for bit in character.bits - stop..character.bits {
                        character = character.with_bit_flipped(bit);
                    }
                    character.levels |= 1 << character.bits;
                    character.bits += 1;
                    line.send_character(at, character)
                }
                Piece::Break(bits) => {
                    line.send_character(at, Character::line_break(settings.rate(), *bits))
                }
                Piece::Glitch(width) => {
                    line.noise(at, time(*width));
                    at + time(*width)
                }
            };
        }
        self.board.run_until(at);
        Ok(duration(at))
    }

    fn hear(
        &mut self,
        patience: Duration,
        quiet: Duration,
        enough: usize,
    ) -> Result<Vec<Heard>, Broken> {
        let slice = time(self.line.characters(1));
        let mut heard = Vec::new();
        let mut until = self.board.now() + time(patience);
        loop {
            for character in self.board.line().take_received() {
                until = character.end + time(quiet);
                heard.push(Heard {
                    byte: character.byte,
                    start: duration(character.start),
                    end: duration(character.end),
                    good: character.is_good(),
                });
            }
            let now = self.board.now();
            if now >= until || heard.len() >= enough {
                return Ok(heard);
            }
            self.board.run_until(until.min(now + slice));
        }
    }

    fn set_power(&mut self, on: bool) -> Result<(), Broken> {
        if on {
            self.board.power_on();
        } else {
            self.board.power_off();
        }
        Ok(())
    }

    fn set_echo(&mut self, echo: bool) -> Result<(), Broken> {
        self.board.line().set_echo(echo);
        Ok(())
    }

    fn take_driver_edges(&mut self) -> Result<Vec<(Duration, bool)>, Broken> {
        let from = std::mem::replace(&mut self.edges_until, self.board.now());
        let new = self
            .board
            .line()
            .driver_edges()
            .filter(|edge| edge.0 > from);
        Ok(new.map(|(at, on)| (duration(at), on)).collect())
    }

    fn take_complaints(&mut self) -> Vec<String> {
        let new: Vec<String> = self
            .board
            .findings()
            .iter()
            .skip(self.findings)
            .map(ToString::to_string)
            .collect();
        self.findings += new.len();
        new
    }
}
