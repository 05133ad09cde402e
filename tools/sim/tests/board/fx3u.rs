//! The fx3u-24 with programs written by hand: its driver from power-on, and its dividers.

use sim::board::FX3U_24;
use sim::board::terminals::Value;
use sim::line::{Format, Settings};
use sim::{Board, Config, Time};

use super::asm::Asm;
use super::regs::*;
use super::{board_with, findings, out};

const LINE: Settings = Settings {
    baud: 9600,
    format: Format::N1,
};

fn fx3u(program: Asm) -> Board {
    let config = Config {
        layout: &FX3U_24,
        ..Config::default()
    };
    let mut board = board_with(&program.image(), config);
    board.line().set_settings(LINE);
    board.run_until(Time::from_ms(10));
    board
}

/// The clocks of AFIO and of ports A to E are on, and the debug port is off.
fn set_up() -> Asm {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 0x7D);
    program.store(AFIO + 4, 4 << 24);
    program
}

/// PA14 is an output, low: the driver of the line is off.
fn release_line(program: &mut Asm) {
    program.store(GPIOA + 4, 0x4244_4444);
}

#[test]
fn driver_of_the_line_is_on_from_power_on_until_the_firmware_drives_its_pin() {
    let mut program = set_up();
    release_line(&mut program);
    program.spin();
    let mut board = fx3u(program);
    let edges: Vec<_> = board.line().driver_edges().collect();
    assert_eq!(edges.len(), 2, "{edges:?}");
    assert_eq!(edges[0], (Time::ZERO, true));
    assert!(!edges[1].1 && edges[1].0 < super::START + Time::from_us(20));
    assert_eq!(findings(&board), [""; 0]);
    board.power_off();
    assert!(!board.driver_enable());
    board.run_for(Time::from_ms(10));
    board.power_on();
    assert!(board.driver_enable());
}

#[test]
fn firmware_that_leaves_the_driver_on_is_a_finding_and_collides_with_the_master() {
    // The debug port is on, so PA14 is SWCLK, whatever the port's register says.
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 0x7D);
    release_line(&mut program);
    program.spin();
    let mut board = fx3u(program);
    let what = findings(&board);
    assert_eq!(what.len(), 1, "{what:?}");
    assert!(what[0].contains("the RS-485 driver is on because"));
    assert!(board.driver_enable());
    board.line().send(Time::from_ms(11), b"A");
    board.run_until(Time::from_ms(20));
    assert!(board.line().collisions().next().is_some());
}

#[test]
fn analog_terminals_have_the_codes_of_their_dividers() {
    let mut program = set_up();
    release_line(&mut program);
    program.store(RCC_APB2ENR, 0x27D);
    program.store(GPIOA, 0x4400_0404);
    program.store(GPIOC, 0x4400_0000);
    // On, calibrated, with the longest sampling time of all channels.
    program.store(ADC1 + 0x0C, 0x00FF_FFFF);
    program.store(ADC1 + 0x10, 0x3FFF_FFFF);
    let on = 0x001E_0001;
    program.store(ADC1 + 8, on);
    for calibration in [8, 4] {
        for _ in 0..40 {
            program.nop();
        }
        program.store(ADC1 + 8, on | calibration);
        for _ in 0..200 {
            program.nop();
        }
    }
    for (channel, n) in [(1, 0), (14, 1), (15, 2), (12, 3)] {
        program.store(ADC1 + 0x34, channel);
        program.store(ADC1 + 8, on | 1 << 22);
        program.wait_set(ADC1, 2);
        program.copy(ADC1 + 0x4C, OUT + 4 * n);
    }
    program.spin();
    let config = Config {
        layout: &FX3U_24,
        ..Config::default()
    };
    let mut board = board_with(&program.image(), config);
    for (name, value) in [
        ("AD0", Value::Voltage(10_000)),
        ("AD2", Value::Voltage(5_000)),
        ("AD3", Value::Current(20_000)),
        ("POT0", Value::Potentiometer(250)),
    ] {
        board.set_terminal(name, value).unwrap();
    }
    board.run_until(Time::from_ms(10));
    assert_eq!(findings(&board), [""; 0]);
    // The contract of the boards: 10 V = 3968, 20 mA = 3830. 5 V are 1599 mV at the pin, in whole millivolts.
    assert_eq!(
        [0, 1, 2, 3].map(|n| out(&board, n)),
        [3968, 1985, 3830, 1024]
    );
}
