//! The image on the virtual board, and the cost of a request.

use std::collections::BTreeMap;

use register_map::codes::Mode;
use register_map::{Module, Row, configuration};
use serde::Serialize;
use sim::board::Layout;
use sim::line::{Format, Settings, frame_silence};
use sim::{Board, Config, Corner, Image, Time};

use crate::framing::{adu, is_adu};
use crate::requests::Request;

/// The exceptions of the line (RM0008 table 63): USART1, TIM2 (the frame gap), EXTI3 (the server).
pub(crate) const BYTE: u32 = 16 + 37;
pub(crate) const GAP: u32 = 16 + 28;
pub(crate) const SERVE: u32 = 16 + 9;
/// The program itself, and the exceptions that do not hold off the scan: EXTI1 (the scan), EXTI4 (the radio), EXTI0 (the
/// background).
const THREAD: u32 = 0;
pub(crate) const SCAN: u32 = 16 + 7;
const RADIO: u32 = 16 + 10;
pub(crate) const BACKGROUND: u32 = 16 + 6;
/// Frequency of the core on the board's crystal.
const CORE_HZ: f64 = 72e6;

/// Time for the image to start.
const START: Time = Time::from_ms(150);
/// Duration of the longest response at 115200 bit/s.
const LONGEST: Time = Time::from_ms(100);
/// Time within which the unit starts to answer after t3.5, at any corner: no request keeps it busy for longer.
const ANSWER: Time = Time::from_ms(1);
/// Difference between the pauses before the counted runs of a request: not a simple fraction of a millisecond.
const PAUSE: Time = Time::from_us(137);
/// More instructions than any measurement needs: the image hangs.
const TOO_MANY: u32 = 1_000_000;

/// Cost of one request, in instructions.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Cost {
    /// From the end of t3.5 to the first byte of the response in the UART's data register.
    pub to_first_byte: u32,
    /// The three interrupt handlers of the line, from the request's first byte until the driver is off.
    pub transaction: u32,
    /// The instructions of `transaction`, by address.
    pub addresses: BTreeMap<u32, u32>,
    /// The longest handler for a byte received.
    pub byte_in: u32,
    /// The longest handler for a byte sent.
    pub byte_out: u32,
    /// The handler at the end of the reply, which switches the driver off.
    pub reply_end: u32,
    /// Longest time for which the request holds off the scan, in cycles of the core.
    pub scan_held: u32,
}

/// A board with the image.
pub struct Unit {
    pub(crate) board: Board,
    settings: Settings,
    mode: Mode,
    /// Time at which a master may send again.
    free: Time,
}

impl Unit {
    /// Starts a board with this module in all of its slots, at a corner of the part, at a rate in units of 100
    /// bit/s in this mode.
    ///
    /// # Errors
    ///
    /// When the image does not fit the board.
    pub fn new(
        image: &Image,
        board: &Row,
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
            ..Config::default()
        };
        config.chip.corner = corner;
        let mut settings = vec![
            (configuration::BAUD, hundreds),
            (configuration::MODE, mode.code()),
        ];
        settings.extend(configuration::modules(config.plugged()));
        config.chip.flash = layout.flash_with(&settings);
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

    /// Sends a request. Returns the unit's complete response, or an empty one when there is none.
    pub fn ask(&mut self, pdu: &[u8]) -> Vec<u8> {
        let now = self.board.now();
        let end = self.board.line().send(now, &adu(self.mode, pdu));
        self.board.run_until(end + self.silence());
        while self.board.driver_enable() {
            self.board.run_for(self.settings.characters(1));
        }
        self.board.run_for(self.silence());
        self.received()
    }

    /// Sends an ADU exactly t3.5 after the last response, and gives the unit time to answer.
    pub(crate) fn back_to_back(&mut self, adu: &[u8]) -> Vec<u8> {
        let start = self.board.now().max(self.free);
        let end = self.board.line().send(start, adu);
        let late = end + self.silence();
        self.board.run_until(end + frame_silence(self.settings));
        let step = self.settings.rate().bits(1);
        while !self.board.driver_enable() && self.board.now() < late {
            self.board.run_for(step);
        }
        while self.board.driver_enable() {
            self.board.run_for(step);
        }
        self.free = self.board.now() + frame_silence(self.settings);
        self.received()
    }

    fn silence(&self) -> Time {
        frame_silence(self.settings) + ANSWER
    }

    fn received(&mut self) -> Vec<u8> {
        let received = self.board.line().take_received();
        received.iter().map(|character| character.byte).collect()
    }

    /// Measures the cost of a request.
    ///
    /// # Errors
    ///
    /// When the unit does not answer, answers with an invalid frame, or hangs.
    pub fn measure(&mut self, request: &Request) -> Result<Cost, String> {
        if let Some(before) = &request.before
            && !is_adu(self.mode, &self.ask(before))
        {
            return Err("the unit does not answer the write that opens the lock".to_owned());
        }
        // Do not use the first run, which may differ from the others, for example because a value changes. Use the
        // medians of the others: the millisecond interrupt, or the task that copies counters every 100 ms, may fall into
        // any run. The increasing pauses prevent that one falls into most of them.
        self.count(&request.pdu)?;
        let mut costs: [Cost; 5] = Default::default();
        let mut pause = Time::ZERO;
        for cost in &mut costs {
            pause += PAUSE;
            self.board.run_for(pause);
            *cost = self.count(&request.pdu)?;
        }
        let median = |of: fn(&Cost) -> u32| {
            let mut all = costs.each_ref().map(of);
            all.sort_unstable();
            all[2]
        };
        let to_first_byte = median(|cost| cost.to_first_byte);
        // One run in some hundred has one instruction more, of the same code, when another interrupt is pending at its end.
        let byte_in = median(|cost| cost.byte_in);
        costs.sort_by_key(|cost| cost.transaction);
        let [_, _, middle, _, _] = costs;
        Ok(Cost {
            to_first_byte,
            byte_in,
            ..middle
        })
    }

    /// Counts every instruction of a transaction by its interrupt handler.
    fn count(&mut self, pdu: &[u8]) -> Result<Cost, String> {
        let now = self.board.now();
        let end = self.board.line().send(now, &adu(self.mode, pdu));
        let expiry = end + frame_silence(self.settings);
        let mut cost = Cost::default();
        let mut handler = Handler::default();
        let mut expired = false;
        let mut held_since = now;
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
            expired |= exception == GAP && self.board.now() >= expiry;
            if expired && before == written {
                cost.to_first_byte += retired;
            }
            if matches!(exception, THREAD | SCAN | RADIO | BACKGROUND) {
                held_since = self.board.now();
            }
            let held = (self.board.now() - held_since).as_secs_f64() * CORE_HZ;
            cost.scan_held = cost.scan_held.max(held as u32);
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
                // A handler whose interrupt is pending again is entered immediately, without a return to the
                // program.
                if self.exception() != BYTE || self.board.pc() == handler.entry {
                    handler.end(on, &mut cost);
                }
            }

            replied |= on;
            if replied && !on && self.exception() != BYTE {
                break;
            }
            if cost.to_first_byte > TOO_MANY {
                return Err("the response does not begin".to_owned());
            }
            if self.board.now() > end + LONGEST {
                return Err("there is no response".to_owned());
            }
        }
        self.board.run_for(self.silence());
        let response = self.received();
        if is_adu(self.mode, &response) {
            Ok(cost)
        } else {
            Err(format!(
                "the response is not a valid frame: {response:02X?}"
            ))
        }
    }

    /// Returns the exception whose handler runs; 0 in the program itself.
    fn exception(&self) -> u32 {
        self.board.register(16).unwrap_or_default() & 0x1FF
    }
}

/// A run of the byte handler.
#[derive(Default)]
struct Handler {
    /// Address of its first instruction.
    entry: u32,
    instructions: u32,
    /// The reply has begun: the handler sends and no longer receives.
    out: bool,
    /// The driver was on when the handler began.
    driving: bool,
}

impl Handler {
    /// Ends the run of the handler, with the driver on or off.
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
