//! A clone of the part, such as GD32F103: page erases of up to 400 ms, an idle bit between the characters of a reply, and
//! LOCK of FLASH_CR that always reads 0.

use register_map::codes::Baud;
use register_map::configuration::{BAUD, COMMAND, FILTER, FORMAT};
use sim::chip;
use sim::line::Settings;
use sim::periph::flash::Durations;
use sim::{Board, Config, Corner, Module, Time};

use crate::campaign::{Line, stored};
use crate::rig::{Rig, SLOT, adu, board, config, format};
use crate::saving::{SLOWEST, large};

/// Longer than the page erase of any clone that is known.
const ERASE: Time = Time::from_ms(400);

/// Returns the board of a clone whose erases take this time.
fn made(mut config: Config, erase: Time) -> Board {
    config.chip.corner = Corner::Gd32;
    let mut board = board(config);
    board.set_flash_durations(Durations { erase, ..SLOWEST });
    board
}

/// Returns a clone with a 4DO at this rate and format, with time to start.
fn clone(baud: Baud, format_code: u16, settings: &[(u16, u16)]) -> Rig {
    let line = [(BAUD, baud.code()), (FORMAT, format_code)];
    let config = config(Module::Do4, &[settings, &line].concat());
    let mut rig = Rig::of(made(config, ERASE));
    rig.settings(Settings {
        baud: baud.bits_per_second(),
        format: format(format_code),
    });
    // The first start of all erases pages of the boot state.
    rig.board.run_for(Time::from_ms(4_000));
    rig
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn saves_with_long_erases_cost_no_reset_no_output_and_no_frame() {
    let mut rig = clone(Baud::B115200, 0, &large());
    rig.patience = ERASE + Time::from_ms(10);
    rig.write_bits(SLOT, &[true; 4]).unwrap();
    (0..4).for_each(|pin| rig.board.watch_pin('A', pin));
    let from = rig.board.now();
    for n in 0..12 {
        rig.configure(FILTER, &[10 + n]);
        rig.write(COMMAND, &[1]).unwrap();
        let end = rig.board.now() + Time::from_ms(1_200);
        let mut longest = Time::ZERO;
        while rig.board.now() < end {
            let begin = rig.board.now();
            let reply = rig.exchange(&adu(&[1, 1, 0, SLOT as u8, 0, 4]));
            assert_eq!(reply, adu(&[1, 1, 1, 0x0F]), "save {n}");
            longest = longest.max(rig.board.now() - begin);
        }
        assert!(!rig.status(8), "save {n} is done");
        // Every second save erases a page.
        assert_eq!(longest > Time::from_ms(300), n % 2 == 1, "{n}: {longest:?}");
    }
    assert_eq!(rig.board.resets(), 0);
    for pin in 0..4 {
        let edges = rig.board.pin_edges('A', pin).iter();
        assert_eq!(edges.filter(|edge| edge.0 >= from).count(), 0, "PA{pin}");
    }
    assert_eq!(rig.registers(0x0231, 1), Ok(vec![0]), "errors of the line");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn update_with_long_erases_loses_no_poll_but_those_of_the_restart() {
    let baud = Baud::B921600;
    let config = Config {
        dip: 1,
        module: Module::Di4,
        chip: chip::Config::holding(stored(baud)),
        ..Config::default()
    };
    let mut line = Line::of(baud, vec![made(config, Time::from_ms(390))]);
    line.polls = true;
    line.patience = Time::from_ms(400);
    line.update();
    let [polls, lost] = line.polled;
    // An erase for each of 58 pages. The unit is silent while it restarts and the loader checks the signature.
    assert!(polls > 20 && lost <= 5, "{polls} {lost}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn longest_replies_are_whole_at_every_rate() {
    // The limit counts bits: each rate has another format than those beside it.
    for (baud, format_code) in Baud::ALL.iter().zip((0..4).cycle()) {
        let mut rig = clone(*baud, format_code, &[]);
        let reply = rig.ask(1, &[3, 1, 0x60, 0, 125]).expect("a reply");
        assert_eq!(reply.len(), 2 + 250, "{baud:?} {format_code}");
        let echo = [&[8, 0, 0][..], &[0xA5; 250]].concat();
        assert_eq!(rig.ask(1, &echo), Some(echo), "{baud:?} {format_code}");
    }
}
