//! The mode of the line, RTU or ASCII, in which the gateway sends.

use modbus_line::adu::Framing;
use register_map::{codes, configuration};
use sim::Board;
use sim::line::Settings;

/// Value of the DIP switch for recovery mode: the line is in RTU mode, whatever is stored.
const RECOVERY: u8 = 255;

/// The mode of the unit's line, which the unit read from its settings when it started.
#[derive(Debug, Default)]
pub struct Mode {
    /// Number of power-ons, and of resets since the last one: they identify a start.
    start: Option<(u64, u32)>,
    /// The DIP switch at power-on.
    dip: u8,
    /// The register MODE at the start.
    stored: u16,
}

impl Mode {
    /// Reads switch and mode again if the unit has started again.
    pub fn update(&mut self, board: &Board) {
        let start = (board.power_ons(), board.resets());
        if self.start == Some(start) {
            return;
        }
        self.start = Some(start);
        self.dip = board.dip_at_power_on();
        let mode = board.layout().stored(board.flash(), configuration::MODE);
        self.stored = mode.unwrap_or_default();
    }

    /// Returns the framing of the line. A line with 7 data bits is in ASCII mode, because RTU needs 8 (V1.02, 2.5.1).
    pub fn framing(&self, settings: Settings) -> Framing {
        let seven = settings.format.data_bits() == 7;
        let ascii = self.stored == codes::Mode::Ascii.code() && self.dip != RECOVERY;
        if seven || ascii {
            Framing::Ascii
        } else {
            Framing::Rtu
        }
    }
}

#[cfg(test)]
mod tests {
    use sim::Config;
    use sim::line::Format;

    use super::*;
    use crate::app::testing::bench_of;

    fn framing(dip: u8, stored: u16, format: Format) -> Framing {
        let layout = Config::default().layout;
        let mut config = Config {
            dip,
            ..Config::default()
        };
        config.chip.flash = layout.flash_with(&[(configuration::MODE, stored)]);
        let mut scene = bench_of(config);
        let mut mode = Mode::default();
        mode.update(scene.bus.board(0));
        // The firmware reads the switch at power-on only.
        scene.first().set_dip(1);
        mode.update(scene.bus.board(0));
        let baud = 9600;
        mode.framing(Settings { baud, format })
    }

    #[test]
    fn mode_is_the_stored_one_except_in_recovery_mode_and_with_seven_bits() {
        assert_eq!(framing(1, 0, Format::N2), Framing::Rtu);
        assert_eq!(framing(1, 1, Format::N2), Framing::Ascii);
        assert_eq!(framing(255, 1, Format::N2), Framing::Rtu);
        assert_eq!(framing(1, 0, Format::SevenE1), Framing::Ascii);
    }

    #[test]
    fn stored_mode_is_in_force_from_the_next_start() {
        let mut scene = bench_of(Config::default());
        let mut mode = Mode::default();
        mode.update(scene.bus.board(0));
        let ascii = scene
            .bus
            .board(0)
            .layout()
            .flash_with(&[(configuration::MODE, 1)]);
        scene.first().power_off();
        scene
            .first()
            .flash_mut()
            .unwrap()
            .copy_from_slice(&ascii.unwrap());
        mode.update(scene.bus.board(0));
        assert_eq!(mode.framing(Settings::default()), Framing::Rtu);
        scene.first().power_on();
        mode.update(scene.bus.board(0));
        assert_eq!(mode.framing(Settings::default()), Framing::Ascii);
    }
}
