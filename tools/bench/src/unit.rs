//! The image on the virtual board, and what serving a request costs there.

use std::collections::BTreeMap;

use register_map::codes::Mode;
use register_map::{Board as Map, Module, configuration};
use sim::board::Layout;
use sim::line::{Format, Settings};
use sim::{Board, Config, Corner, Image, Time};

use crate::framing::{adu, is_adu};
use crate::requests::Request;

/// The exceptions that serve the line (RM0008 table 63): USART1, TIM2 (the frame gap), EXTI3 (the server).
pub(crate) const BYTE: u32 = 16 + 37;
pub(crate) const GAP: u32 = 16 + 28;
pub(crate) const SERVE: u32 = 16 + 9;

/// Time for the image to start in.
const START: Time = Time::from_ms(150);
/// The longest that any response takes at 115200 bit/s.
const LONGEST: Time = Time::from_ms(100);
/// What the unit takes to answer after t3.5, at any corner.
const ANSWER: Time = Time::from_us(100);
/// By so much the pauses between the counted runs of a request differ: no simple fraction of a millisecond.
const PAUSE: Time = Time::from_us(137);
/// More instructions than anything measured needs: then it hangs.
const TOO_MANY: u32 = 1_000_000;

/// What one request costs, in instructions.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// From the expiry of t3.5 to the first byte of the response in the UART's data register.
    pub to_first_byte: u32,
    /// The same to the second byte, which is the first that depends on what the request is: the first byte, the
    /// unit address, is sent before the request is decoded.
    pub to_second_byte: u32,
    /// The line's three interrupt handlers, from the request's first byte until the driver is off.
    pub transaction: u32,
    /// The same, by the address of the instruction.
    pub addresses: BTreeMap<u32, u32>,
    /// The longest handler for a byte received.
    pub byte_in: u32,
    /// The longest handler for a byte sent.
    pub byte_out: u32,
    /// The handler at the end of the reply, which switches the driver off.
    pub reply_end: u32,
}

/// A board with the image on it.
pub struct Unit {
    pub(crate) board: Board,
    settings: Settings,
    mode: Mode,
    /// When a master may send again.
    free: Time,
}

impl Unit {
    /// A board with this module in all of its slots, at a corner of the part, at a rate in units of 100 bit/s in this
    /// mode, started.
    ///
    /// # Errors
    ///
    /// When the image does not fit the board.
    pub fn new(
        image: &Image,
        board: &Map,
        module: Module,
        corner: Corner,
        hundreds: u16,
        mode: Mode,
    ) -> Result<Self, String> {
        let layout = Layout::of(board).ok_or("the simulator does not know this board")?;
        let slots = layout.slots.iter().map(|slot| (slot.port, module));
        let mut config = Config {
            layout,
            slots: slots.collect(),
            corner,
            ..Config::default()
        };
        let mut settings = vec![
            (configuration::BAUD, hundreds),
            (configuration::MODE, mode.code()),
        ];
        settings.extend(configuration::modules(config.plugged()));
        config.flash = layout.flash_with(&settings);
        let mut board = Board::new(image, config).map_err(|error| error.to_string())?;
        let settings = Settings {
            baud: u32::from(hundreds) * 100,
            format: Format::N2,
        };
        board.line().set_settings(settings);
        board.run_for(START);
        Ok(Self {
            board,
            settings,
            mode,
            free: Time::ZERO,
        })
    }

    /// Sends a request; the unit's response once it is complete, empty when there is none.
    pub fn ask(&mut self, pdu: &[u8]) -> Vec<u8> {
        let now = self.board.now();
        let end = self.board.line().send(now, &adu(self.mode, pdu));
        self.board.run_until(end + self.silence());
        while self.board.driver_enable() {
            self.board.run_for(self.settings.characters(1));
        }
        self.board.run_for(self.silence());
        self.heard()
    }

    /// Sends an ADU the moment t3.5 has passed since the last response, and gives the unit time to answer.
    pub(crate) fn back_to_back(&mut self, adu: &[u8]) -> Vec<u8> {
        let start = self.board.now().max(self.free);
        let end = self.board.line().send(start, adu);
        let late = end + self.silence();
        self.board.run_until(end + self.settings.frame_silence());
        let step = self.settings.rate().bits(1);
        while !self.board.driver_enable() && self.board.now() < late {
            self.board.run_for(step);
        }
        while self.board.driver_enable() {
            self.board.run_for(step);
        }
        self.free = self.board.now() + self.settings.frame_silence();
        self.heard()
    }

    fn silence(&self) -> Time {
        // At the highest rates what the unit takes to answer is more than two characters.
        self.settings.frame_silence() + self.settings.characters(2) + ANSWER
    }

    fn heard(&mut self) -> Vec<u8> {
        let heard = self.board.line().take_received();
        heard.iter().map(|character| character.byte).collect()
    }

    /// What it costs to serve a request.
    ///
    /// # Errors
    ///
    /// When the unit does not answer, or not with a good frame, or hangs.
    pub fn measure(&mut self, request: &Request) -> Result<Cost, String> {
        if let Some(before) = &request.before
            && !is_adu(self.mode, &self.ask(before))
        {
            return Err("the lock does not open".to_owned());
        }
        // The first is not like the others, as for a value that changes. Of the others the one in the
        // middle: the interrupt of the millisecond may fall into any. Pauses that grow keep it from falling into most.
        self.count(&request.pdu)?;
        let mut costs: [Cost; 5] = Default::default();
        let mut pause = Time::ZERO;
        for cost in &mut costs {
            pause += PAUSE;
            self.board.run_for(pause);
            *cost = self.count(&request.pdu)?;
        }
        costs.sort_by_key(|cost| (cost.to_first_byte, cost.to_second_byte, cost.transaction));
        let [_, _, middle, _, _] = costs;
        Ok(middle)
    }

    /// Counts every instruction of a transaction by the handler it is of.
    fn count(&mut self, pdu: &[u8]) -> Result<Cost, String> {
        let now = self.board.now();
        let end = self.board.line().send(now, &adu(self.mode, pdu));
        let expiry = end + self.settings.frame_silence();
        let mut cost = Cost::default();
        let mut handler = Handler::default();
        let mut waiting = Expiry::Before;
        let written = self.board.line_bytes_written();
        let mut replied = false;
        loop {
            let before = self.board.line_bytes_written();
            let driving = self.board.driver_enable();
            let retired = self.board.instructions();
            let exception = self.exception();
            let address = self.board.pc();
            self.board.step(1);
            let retired = self.board.instructions() - retired;
            let retired = u32::try_from(retired).unwrap_or(u32::MAX);
            let wrote = self.board.line_bytes_written() > before;

            if exception == GAP && waiting == Expiry::Before && self.board.now() >= expiry {
                waiting = Expiry::Counting;
            }
            if waiting == Expiry::Counting {
                cost.to_first_byte += retired;
            }
            if matches!(waiting, Expiry::Counting | Expiry::FirstByte) {
                cost.to_second_byte += retired;
                if wrote {
                    waiting = waiting.after_a_byte();
                }
            }
            if matches!(exception, BYTE | GAP | SERVE) {
                cost.transaction += retired;
                *cost.addresses.entry(address).or_default() += retired;
            }
            let on = self.board.driver_enable();
            if exception == BYTE {
                if handler.instructions == 0 {
                    handler.driving = driving;
                    handler.entry = address;
                }
                handler.instructions += retired;
                handler.out |= self.board.line_bytes_written() > written;
                // One that is pending again is entered at once, without a return to the program.
                if self.exception() != BYTE || self.board.pc() == handler.entry {
                    handler.end(on, &mut cost);
                }
            }

            replied |= on;
            if replied && !on && self.exception() != BYTE {
                break;
            }
            if cost.to_first_byte > TOO_MANY {
                return Err("the response never begins".to_owned());
            }
            if self.board.now() > end + LONGEST {
                return Err("there is no response".to_owned());
            }
        }
        self.board.run_for(self.silence());
        let response = self.heard();
        if is_adu(self.mode, &response) {
            Ok(cost)
        } else {
            Err(format!("the response is no frame: {response:02X?}"))
        }
    }

    /// The exception whose handler runs; 0 in the program itself.
    fn exception(&self) -> u32 {
        self.board.register(16).unwrap_or_default() & 0x1FF
    }
}

/// Where the counting to the first two bytes stands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Expiry {
    Before,
    Counting,
    FirstByte,
    Done,
}

impl Expiry {
    const fn after_a_byte(self) -> Self {
        match self {
            Self::Counting => Self::FirstByte,
            _ => Self::Done,
        }
    }
}

/// A run of the byte handler.
#[derive(Default)]
struct Handler {
    /// Where it starts.
    entry: u32,
    instructions: u32,
    /// The reply has begun: nothing comes in any more.
    out: bool,
    /// The driver was on when it began.
    driving: bool,
}

impl Handler {
    /// The handler has ended, with the driver on or off.
    fn end(&mut self, driving: bool, cost: &mut Cost) {
        let longest = match self {
            Self { driving: true, .. } if !driving => &mut cost.reply_end,
            Self { out: true, .. } => &mut cost.byte_out,
            Self { .. } => &mut cost.byte_in,
        };
        *longest = self.instructions.max(*longest);
        *self = Self::default();
    }
}
