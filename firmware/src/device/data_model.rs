//! What masters access: the blocks of registers, files and functions.

use core::ops::Range;

use modbus_server::fast::{self, EventSource, Packet, Waiting};
use modbus_server::{
    Adu, Bits, BitsOut, DataModel, Exception, Server, Span, Table, TextOut, Words, WordsOut,
};
use register_map::board::Board;
use register_map::codes::Command;
use register_map::configuration::COMMAND;
use register_map::update::status;
use register_map::{counters, edges, fault, name, second, state as state_map};

use super::{Device, EdgeLog, Points, identification, points};
use crate::config::LineName;
use crate::update::{Update, order_of};

/// The block of the address space that contains the start of a span. The span must not leave the block.
enum Block {
    Points,
    Config,
    Pulses,
    /// Name of the board, state, fault record, counters of the second line, last edges.
    ReadOnly,
}

/// The registers of [`Block::ReadOnly`]. A span lies within one of these ranges.
const READ_ONLY: [&[Range<u16>]; 5] = [
    name::SPANS,
    state_map::SPANS,
    fault::SPANS,
    second::SPANS,
    edges::SPANS,
];

impl Block {
    #[inline(always)]
    const fn of<B: Board>(span: Span) -> Self {
        // Most requests are for points.
        if span.start() < register_map::points::COUNT {
            Self::Points
        } else {
            Self::of_others::<B>(span)
        }
    }

    #[inline(never)]
    const fn of_others<B: Board>(span: Span) -> Self {
        match span.start().to_be_bytes() {
            [1 | 4, _] => Self::Config,
            [5, _] if B::ROW.events || B::ROW.stage => Self::Config,
            [0 | 2, _] | [3, 0x80..=0xFF] => Self::ReadOnly,
            [3, _] => Self::Pulses,
            _ => Self::Points,
        }
    }
}

impl<B: Board> Device<B> {
    /// Checks whether a write of the configuration may give the order of an update that it contains, if any.
    fn check_order(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        let code = words.get(COMMAND.wrapping_sub(span.start()));
        let Some(command) = code.and_then(Command::from_code).filter(is_of_update) else {
            return Ok(());
        };
        let Some(update) = &self.update else {
            return Err(Exception::IllegalDataValue);
        };
        let allowed = match order_of(command) {
            Some(order) => update.check(order, self.config.spare_saves()).is_ok(),
            // The unit would leave the air until somebody stands before it: there is no radio in recovery.
            None => !self.config.is_over_the_air(),
        };
        if allowed && self.config.is_to_the_address() {
            Ok(())
        } else {
            Err(Exception::ServerDeviceBusy)
        }
    }

    /// Returns whether these are counters of a second line that the board does not have.
    const fn lacks(span: Span) -> bool {
        B::ROW.second.is_none() && matches!(span.start(), second::BUS_MESSAGES..=second::T15_GAPS)
    }

    /// Returns a register of the board's name.
    fn name_word(&self, address: u16) -> u16 {
        let index = usize::from(address.wrapping_sub(name::NAME));
        let byte = B::ROW.name.as_bytes().get(index);
        byte.copied().unwrap_or_default().into()
    }

    /// Returns the status register (0x020A).
    fn status(&self) -> u16 {
        use state_map::status;
        let bit = |mask, set| if set { mask } else { 0 };
        self.config.status()
            | bit(status::COMM_WATCHDOG, self.comm_watchdog.has_tripped())
            | bit(
                status::MODULE_FAULT,
                self.points.has_fault() || self.radio_fails(),
            )
            | bit(
                status::INTERNAL_OSCILLATOR,
                self.state.on_internal_oscillator(),
            )
    }

    /// Returns a register of [`Block::ReadOnly`] or of the pulse counters.
    // Not inlined into the loop over the registers, which has few registers of the core left.
    #[inline(never)]
    fn read_only_word(&self, address: u16) -> u16 {
        match address {
            ..state_map::PRODUCT_CODE => self.name_word(address),
            counters::PULSES.. => self.points.input_word(address),
            fault::KIND..second::BUS_MESSAGES => self.state.fault_word(address),
            state_map::STATUS => self.status(),
            state_map::UPDATE => self.update.as_ref().map_or(0, Update::register),
            state_map::DESCRIPTION_CRC => self.description.crc(),
            address => self.state.word(address, &self.points, &self.config),
        }
    }
}

/// Returns whether a command exists only behind the loader.
const fn is_of_update(command: &Command) -> bool {
    command.code() >= Command::Prepare.code()
}

/// Checks whether a span lies in one of these ranges of registers.
fn check_exists(blocks: &[&[Range<u16>]], span: Span) -> Result<(), Exception> {
    let within =
        |range: &Range<u16>| range.contains(&span.start()) && span.end() <= u32::from(range.end);
    if blocks.iter().any(|block| block.iter().any(within)) {
        Ok(())
    } else {
        Err(Exception::IllegalDataAddress)
    }
}

/// Functions 01 and 02 read the same bits, and 03 and 04 the same words.
impl<B: Board> DataModel for Device<B> {
    fn check_read_bits(&self, _: Table, span: Span) -> Result<(), Exception> {
        self.points.check_read_bits(span)
    }

    fn check_read_words(&self, _: Table, span: Span) -> Result<(), Exception> {
        match Block::of::<B>(span) {
            Block::Points => self.points.check_read_words(span),
            Block::Config => self.config.check_read(span),
            Block::Pulses => check_exists(&[counters::SPANS], span),
            Block::ReadOnly if Self::lacks(span) => Err(Exception::IllegalDataAddress),
            Block::ReadOnly => check_exists(&READ_ONLY, span),
        }
    }

    fn check_write_bits(&self, span: Span, _bits: Bits<'_>) -> Result<(), Exception> {
        self.points.check_write_bits(span)
    }

    fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        match Block::of::<B>(span) {
            Block::Points => self.points.check_write_words(span, words),
            Block::Config => {
                let checked = self.config.check_write(span, words);
                // Address and value come before the state.
                if matches!(checked, Ok(()) | Err(Exception::ServerDeviceBusy)) {
                    self.check_order(span, words)?;
                }
                checked
            }
            Block::ReadOnly if span == Span::single(name::UNIT_BY_SERIAL) => {
                self.config.check_unit(words.get(0))
            }
            Block::ReadOnly => Err(Exception::IllegalDataAddress),
            Block::Pulses => {
                check_exists(&[counters::SPANS], span)?;
                points::check_clear(span, words)?;
                self.config.check_line()
            }
        }
    }

    fn read_bits(&self, _: Table, span: Span, out: &mut BitsOut<'_>) {
        self.points.read_bits(span, out);
    }

    #[inline]
    fn before_read_words(&mut self, span: Span, server: &Server) {
        // The request may have written settings, which may change anything else.
        if !matches!(Block::of::<B>(span), Block::Config) {
            self.settings_may_have_changed();
        }
        if span.start() >= state_map::PRODUCT_CODE {
            *self.state.counters_of(self.config.origin_line()) = server.counters();
        }
    }

    fn read_words(&self, _: Table, span: Span, out: &mut WordsOut<'_>) {
        match Block::of::<B>(span) {
            Block::Points => self.points.read_words(span, out),
            Block::Config => self.config.read(span, out),
            Block::Pulses | Block::ReadOnly => span
                .addresses()
                .for_each(|address| out.push(self.read_only_word(address))),
        }
    }

    fn write_bits(&mut self, span: Span, bits: Bits<'_>) {
        self.end_holds(span.start(), span.count());
        self.points.write_bits(span, bits);
    }

    fn write_words(&mut self, span: Span, words: Words<'_>) {
        match Block::of::<B>(span) {
            Block::Points => self.points.write_words(span, words),
            Block::Config => {
                self.ordered = self.config.write(span, words);
            }
            Block::Pulses => self.points.clear_pulses(span),
            // Of these registers `check_write_words` accepts only UNIT_BY_SERIAL.
            Block::ReadOnly => {
                if !B::ROW.switch
                    && let Some(unit) = words.get(0)
                {
                    self.config.set_unit(unit);
                    self.new_unit = Some(unit as u8);
                }
            }
        }
    }

    /// The self-description is file 1, the log of edges file 3. Behind the loader, file 2 is the state of an update, and the
    /// images are files that can be written.
    fn has_files(&self) -> bool {
        true
    }

    fn check_read_file(&self, file: u16, records: Span) -> Result<(), Exception> {
        if file == status::FILE
            && let Some(update) = &self.update
        {
            return update.check_read(records);
        }
        if file == edges::log::FILE {
            return EdgeLog::check_read(records);
        }
        self.description.check_read::<B>(file, records)
    }

    fn read_file(&self, file: u16, records: Span, out: &mut WordsOut<'_>) {
        let update = self.update.as_ref().filter(|_| file == status::FILE);
        if file == edges::log::FILE || update.is_some() {
            return records.addresses().for_each(|record| {
                out.push(
                    update
                        .map_or_else(|| self.edges.record(record), |update| update.record(record)),
                );
            });
        }
        self.description.read(&self.config, records, out);
    }

    fn check_write_file(
        &self,
        file: u16,
        records: Span,
        words: Words<'_>,
    ) -> Result<(), Exception> {
        let Some(update) = &self.update else {
            return Err(Exception::IllegalDataAddress);
        };
        let line = self.config.origin_line();
        update.check_write(file, records, words, line)?;
        self.config.check_line()
    }

    fn write_file(&mut self, file: u16, records: Span, words: Words<'_>) {
        if let Some(update) = &mut self.update {
            update.write(file, records, words);
            self.config.keep_open();
        }
    }

    /// Returns the low byte of the status register.
    fn exception_status(&self) -> u8 {
        self.status().to_le_bytes()[0]
    }

    /// Returns the status register.
    fn diagnostic_register(&self) -> u16 {
        self.status()
    }

    /// Function 70 with the unit's own address: which points report events.
    fn check_custom(&self, code: u8, data: &[u8]) -> Result<(), Exception> {
        let is_served = B::ROW.events
            && code == fast::FUNCTION
            && self.state.reports_events()
            && self.config.origin_line() == LineName::Rs485;
        if !is_served {
            return Err(Exception::IllegalFunction);
        }
        fast::check_settings(data)
    }

    fn serve_custom(&mut self, _: u8, adu: &mut Adu) {
        let (ports, first) = (self.points.ports(), Points::<B>::first_of(0));
        fast::apply_settings(adu, |kind, id, to| {
            self.events.set(ports, first, kind, id, to)
        });
    }

    fn server_id(&self) -> &[u8] {
        self.state.server_id()
    }

    /// Returns false while the communication watchdog has set the outputs to SAFE.
    fn is_running(&self) -> bool {
        !self.comm_watchdog.has_tripped()
    }

    fn identification(&self, object: u8, text: &mut TextOut<'_>) -> bool {
        let value = identification::object(object, self.state.serial(), &self.config);
        text.extend(value.unwrap_or_default());
        value.is_some()
    }
}

impl<B: Board> EventSource for Device<B> {
    fn waiting(&self) -> Waiting {
        self.events.waiting()
    }

    fn reports_start(&self) -> bool {
        self.events.reports_start()
    }

    fn start_is_known(&mut self) {
        self.events.start_is_known();
    }

    fn fill(&mut self, packet: &mut Packet) {
        let first = Points::<B>::first_of(0);
        self.events.fill(packet, self.points.ports(), first);
    }

    fn sent(&mut self) {
        self.events.sent();
    }
}
