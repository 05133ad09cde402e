//! The simulator in process: the firmware's image on the virtual board, in virtual time.

use std::path::PathBuf;

use modbus_line::LineFormat;
use modbus_line::exact::{Reply, Request};
use register_map::{Module, configuration};
use sim::board::{Firmware, InSlot, Layout};
use sim::exact_line::Session;
use sim::{Board, Config, Image, Time};

use super::Broken;
use super::exact_line::{ExactLine, Transport};
use crate::frame::Mode;
use crate::target::codes;

/// Time that the unit has to start after power-on: at most 70 ms in the loader, and 100 ms in the application.
const START: Time = Time::from_ms(200);

/// How the virtual board is fitted and set.
#[derive(Clone, Debug)]
pub struct Fitting {
    /// An ELF file: the loader, or an application that runs alone.
    pub elf: PathBuf,
    /// The file with the image that the loader starts; `None` for an application that runs alone.
    pub image: Option<PathBuf>,
    /// The board.
    pub board: &'static register_map::Row,
    /// The module in the first slot, unless `slots` names that slot.
    pub module: Module,
    /// The modules in the slots of these ports. A slot that is not named is empty.
    pub slots: Vec<(u8, Module)>,
    /// SW01: the unit address.
    pub dip: u8,
    /// The stored rate and format.
    pub line: LineFormat,
    /// The stored transmission mode.
    pub mode: Mode,
    /// Further stored settings: register and value.
    pub settings: Vec<(u16, u16)>,
}

impl Fitting {
    /// Returns a board with this loader, this image and empty slots, set as in the factory: address 1, 9600 8N2, RTU.
    pub fn new(loader: PathBuf, image: PathBuf, board: &'static register_map::Row) -> Self {
        Self {
            elf: loader,
            image: Some(image),
            board,
            module: Module::None,
            slots: Vec::new(),
            dip: 1,
            line: LineFormat::default(),
            mode: Mode::Rtu,
            settings: Vec::new(),
        }
    }
}

/// The virtual board, which carries out the requests of the exact-line protocol.
pub struct InProcess {
    /// The board.
    pub board: Board,
    session: Session,
}

/// Starts a board fitted like this. Returns the master's end of its line.
pub fn start(fitting: &Fitting) -> Result<ExactLine<InProcess>, Broken> {
    ExactLine::new(board(fitting)?)
}

/// Starts a board fitted like this.
pub fn board(fitting: &Fitting) -> Result<InProcess, Broken> {
    let elf = Image::read(&fitting.elf).map_err(|e| Broken(e.to_string()))?;
    let unknown = || Broken(format!("the simulator does not know the {}", fitting.board));
    let mut config = Config {
        layout: Layout::of(fitting.board).ok_or_else(unknown)?,
        dip: fitting.dip,
        module: fitting.module,
        slots: fitting.slots.clone(),
        ..Config::default()
    };
    let firmware = match &fitting.image {
        Some(image) => Firmware::Loaded(elf, InSlot::read(config.layout, image).map_err(Broken)?),
        None => Firmware::Alone(elf),
    };
    let mut flash = vec![0xFF; config.layout.part.flash_size];
    let programmed = firmware.program(config.layout, &mut flash, false);
    let (image, _) = programmed.map_err(|e| Broken(e.to_string()))?;
    if !config
        .layout
        .store(&mut flash, &settings(fitting, &config)?)
    {
        return Err(Broken(
            "too many settings for a page of the store".to_owned(),
        ));
    }
    config.chip.flash = Some(flash);
    let mut board = Board::new(&image, config).map_err(|e| Broken(e.to_string()))?;
    board.run_for(START);
    let mut server = InProcess {
        board,
        session: Session::default(),
    };
    let line = Request::Line(fitting.line.baud, fitting.line.format.to_string());
    server.ask(&line).map_err(Broken)?;
    Ok(server)
}

impl Transport for InProcess {
    fn ask(&mut self, request: &Request) -> Result<Reply, String> {
        self.session.answer(&mut self.board, request)
    }
}

/// Returns the stored settings: register and value.
fn settings(fitting: &Fitting, config: &Config) -> Result<Vec<(u16, u16)>, Broken> {
    let mut pairs: Vec<_> = configuration::modules(config.plugged()).collect();
    let codes = codes(fitting.line).map_err(Broken)?;
    pairs.extend(
        [configuration::BAUD, configuration::FORMAT]
            .into_iter()
            .zip(codes),
    );
    if fitting.mode == Mode::Ascii {
        pairs.push((configuration::MODE, 1));
    }
    pairs.extend(&fitting.settings);
    Ok(pairs)
}
