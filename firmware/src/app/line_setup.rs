//! The RS-485 line of the board, set up as its settings say.

use board_support::{Rs485, Rs485Timer, board::LineOff, gap_ticks::LineTimes, pac};
use firmware::{config::LineConfig, line};
use modbus_server::{
    Adu,
    line::{Framing, Gaps, Port, Receiver, Width, Windows},
};
use ports::line_settings::{self, LineSettings};
use register_map::codes::{Format, GapRule, Mode};

use crate::board::{BOARD, Units};

/// USART1 with PA8 to PA10; TIM2, and TIM1 for the start bit and the time limit of a reply.
pub type Line = line::Line<Rs485, Rs485Timer, Units>;

/// What the line does with these settings.
pub struct Frames<'a> {
    settings: &'a LineConfig,
    on_wire: LineSettings,
    gaps: Gaps,
    /// RTU or ASCII.
    pub framing: Framing,
    /// Silence that ends a frame in RTU mode, in nanoseconds.
    pub t35_ns: u32,
}

impl<'a> Frames<'a> {
    /// Returns what follows from the settings.
    pub fn of(settings: &'a LineConfig) -> Self {
        let on_wire = wire_settings(settings);
        let gaps = Gaps::standard(on_wire.baud, on_wire.format.bits() as u8);
        Self {
            settings,
            on_wire,
            framing: match settings.mode {
                Mode::Rtu => Framing::Rtu,
                Mode::Ascii => Framing::ASCII,
            },
            t35_ns: settings
                .frame_gap
                .map_or(gaps.t35, |tenths| gaps.frame_gap(tenths)),
            gaps,
        }
    }

    /// Sets the line up. Returns `None` on a board whose UART does not have the rate.
    pub fn start(
        &self,
        off: LineOff,
        rcc: &mut pac::RCC,
        units: Units,
        adus: &'static mut [Adu],
    ) -> Option<Line> {
        let strict = self.settings.gap_rule == GapRule::Drop;
        let t15_ns = self.gaps.t15.min(self.t35_ns);
        let (receiver, (t15_ns, t35_ns)) = match self.framing {
            Framing::Rtu => (Receiver::rtu(units, strict), (t15_ns, self.t35_ns)),
            Framing::Ascii { .. } => {
                let width = match self.settings.format.data_bits() {
                    7 if self.on_wire.format.stop_in_data() != 0 => Width::SevenAndStop,
                    7 => Width::Seven,
                    _ => Width::Eight,
                };
                let receiver = Receiver::ascii(units, width);
                (receiver, (self.t35_ns, Gaps::ASCII_TIMEOUT))
            }
        };
        let limit_us = longest_reply_us(self.on_wire, self.framing);
        let times = LineTimes {
            t15_ns,
            t35_ns,
            limit_us,
        };
        let (uart, gap) = off.start(self.on_wire, times, rcc)?;
        // The count may begin just before a tick.
        let longest_ms = (limit_us / 1000) as u16 + 2;
        let port = Port::new(receiver, adus);
        // Without function 70 nothing needs these times.
        let (bit, us) = if BOARD.events {
            gap.bit_and_us()
        } else {
            (0, 0)
        };
        let windows = Windows::new(bit, us);
        Some(Line::new(uart, gap, port, windows, longest_ms))
    }
}

/// Returns a limit for the duration of a reply in microseconds: the longest frame with a bit between characters, as clones
/// of the part send it, and with 2 % and a millisecond in reserve.
fn longest_reply_us(line: LineSettings, framing: Framing) -> u32 {
    // V1.02 2.5.1 and 2.5.2.1: 256 bytes in RTU mode, 513 characters in ASCII mode.
    let characters = match framing {
        Framing::Rtu => 256,
        Framing::Ascii { .. } => 513,
    };
    let bits = characters * (line.format.bits() + 1);
    // At most 513 * 12 bits, so the product fits 32 bits.
    let us = bits * 10_000 / (line.baud / 100).max(1);
    us + us / 50 + 1_000
}

fn wire_settings(line: &LineConfig) -> LineSettings {
    LineSettings {
        baud: line.baud,
        format: match line.format {
            Format::F8N2 => line_settings::Format::N2,
            Format::F8E1 => line_settings::Format::E1,
            Format::F8O1 => line_settings::Format::O1,
            Format::F8N1 => line_settings::Format::N1,
            Format::F7E1 => line_settings::Format::SevenE1,
            Format::F7O1 => line_settings::Format::SevenO1,
            Format::F7N2 => line_settings::Format::SevenN2,
        },
    }
}
