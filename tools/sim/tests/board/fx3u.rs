//! The boards with fixed inputs and outputs, with programs written by hand.

use sim::board::terminals::Value;
use sim::board::{FX3U_14, FX3U_24, Layout};
use sim::line::{Direction, Format, Settings};
use sim::{Board, Config, Time};

use super::asm::{Asm, When};
use super::regs::*;
use super::{board_with, findings, out};

const LINE: Settings = Settings {
    baud: 9600,
    format: Format::N1,
};

fn fx3u(layout: &'static Layout, program: Asm) -> Board {
    let config = Config {
        layout,
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
    let mut board = fx3u(&FX3U_24, program);
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
    let mut board = fx3u(&FX3U_24, program);
    let what = findings(&board);
    assert_eq!(what.len(), 1, "{what:?}");
    assert!(what[0].contains("the RS-485 driver is on because"));
    assert!(board.driver_enable());
    board.line().send(Time::from_ms(11), b"A");
    board.run_until(Time::from_ms(20));
    assert!(board.line().collisions().next().is_some());
}

#[test]
fn byte_is_sent_back_at_uart4_and_at_the_rs232_port() {
    check_both_ports(UART4, 1 << 19, 4 << 24);
}

#[test]
fn firmware_that_remaps_usart3_to_the_pins_of_the_line_uses_the_line() {
    check_both_ports(USART3, 1 << 18, 4 << 24 | 1 << 4);
}

/// Sends a byte in each direction at the line and at the RS-232 port. The firmware uses this USART for the line, with
/// this bit of its clock and this value of AFIO_MAPR.
fn check_both_ports(line: u32, clock: u32, mapr: u32) {
    let mut program = set_up();
    release_line(&mut program);
    program.store(RCC_APB2ENR, 0x407D);
    program.store(RCC_APB1ENR, clock);
    program.store(AFIO + 4, mapr);
    // PC10 and PA9 are alternate outputs.
    program.store(GPIOC + 4, 0x4444_4B44);
    program.store(GPIOA + 4, 0x4244_44B4);
    for usart in [line, USART1] {
        program.store(usart + 8, 833);
        program.store(usart + 0x0C, 0x200C);
    }
    program.store(GPIOA + 0x10, 1 << 14);
    for usart in [line, USART1] {
        // Reading SR before writing DR clears TC.
        program.copy(usart, OUT);
        program.store(usart + 4, u32::from(b'!'));
        program.wait_set(usart, 1 << 6);
    }
    program.store(GPIOA + 0x14, 1 << 14);
    for (usart, n) in [(line, 0), (USART1, 1)] {
        program.wait_set(usart, 1 << 5);
        program.copy(usart + 4, OUT + 4 * n);
    }
    program.spin();
    let mut board = fx3u(&FX3U_14, program);
    board.line().send(Time::from_ms(20), b"A");
    let port = board.rs232().unwrap();
    port.set_settings(LINE);
    let end = port.send(Time::from_ms(22), b"B");
    // A start bit, eight data bits and a stop bit.
    assert_eq!(end, Time::from_ms(22) + LINE.rate().bits(10));
    board.run_until(Time::from_ms(30));
    assert_eq!((out(&board, 0), out(&board, 1)), (0x41, 0x42));
    let frame = board.line().frames().next().unwrap();
    assert_eq!(
        (frame.direction, &frame.bytes[..]),
        (Direction::Response, &b"!"[..])
    );
    assert_eq!(findings(&board), [""; 0]);
}

#[test]
fn terminals_are_at_their_pins() {
    let mut program = set_up();
    release_line(&mut program);
    program.store(RCC_APB1ENR, 1 << 29);
    // PA0, PA2, PA6, PA7 outputs, PA1, PA3, PA4, PA5 analog; PC8, PC9, PB3, PB15, PD10, PD12 outputs.
    program.store(GPIOA, 0x2200_0202);
    program.store(GPIOB, 0x4444_2444);
    program.store(GPIOB + 4, 0x2444_4444);
    program.store(GPIOC + 4, 0x4444_4422);
    program.store(GPIOD + 4, 0x4442_4244);
    program.store(GPIOD + 0x0C, 1 << 12);
    program.store(GPIOA + 0x0C, 1 << 2 | 1 << 7);
    // Without its buffer: 1.65 V at PA5.
    program.store(DAC, 3 << 16);
    program.store(DAC + 0x14, 2048);
    let top = program.here();
    for (port, n) in [(GPIOB, 0), (GPIOC, 1), (GPIOE, 2)] {
        program.copy(port + 8, OUT + 4 * n);
    }
    program.branch(When::Always, top);
    let mut board = fx3u(&FX3U_24, program);
    let on: Vec<_> = board
        .terminals()
        .iter()
        .filter(|(_, value)| *value == Value::Relay(true))
        .map(|(terminal, _)| terminal.name)
        .collect();
    assert_eq!(on, ["Y5", "Y7", "Y11"]);
    assert_eq!(board.terminals().get("DA0"), Some(Value::Output(0)));
    assert_eq!(board.terminals().get("DA1"), Some(Value::Output(5161)));
    assert!(board.leds().run, "PD10 is low");
    // Pulled up by the board: X0 to X7 and X10 to X15. PC7 is high while 24 V are present.
    let read = |board: &Board| (out(board, 0) & 0x7C04, out(board, 1) & 0x80, out(board, 2));
    assert_eq!(read(&board), (0x7C00, 0x80, 0xFF80));
    for name in ["X0", "X5", "X7", "X15"] {
        board.set_terminal(name, Value::Input(true)).unwrap();
    }
    board.set_terminal("RUN", Value::Switch(true)).unwrap();
    board.set_terminal("24V", Value::Supply(false)).unwrap();
    board.run_for(Time::from_ms(1));
    assert_eq!(read(&board), (0x5804, 0, 0xBE80));
    board.power_off();
    assert_eq!(board.terminals().get("Y5"), Some(Value::Relay(false)));
    assert_eq!(findings(&board), [""; 0]);
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
