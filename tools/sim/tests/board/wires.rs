//! The wires of the board: pins, line, switch, slot, timer and EXTI interrupts.

use sim::line::{Direction, Format, Settings};
use sim::{Channel, Config, Module, Time};

use super::asm::{Asm, When};
use super::regs::*;
use super::{board, board_with, findings, out};

const SR: u16 = 0;
const DR: u16 = 4;

/// USART1 at 19200 8N1 from 8 MHz. The program returns each byte plus one, with the driver on until TC.
fn echo_program(release: bool) -> Asm {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 1 << 14 | 1 << 2);
    program.store(GPIOA + 4, 0x4444_44B3);
    program.store(USART1 + 8, 417);
    program.store(USART1 + 0x0C, 0x200C);
    program.set(4, USART1);
    program.set(5, GPIOA);
    program.set(6, 1 << 8);
    let top = program.here();
    program.wait_set(USART1, 1 << 5);
    program.ldr(3, 4, DR);
    program.add(3, 1);
    program.str(6, 5, 0x10);
    program.str(3, 4, DR);
    let sent = program.here();
    program.ldr(1, 4, SR);
    program.set(2, 1 << 6);
    program.tst(1, 2);
    program.branch(When::Equal, sent);
    if release {
        program.str(6, 5, 0x14);
    }
    program.branch(When::Always, top);
    program
}

#[test]
fn byte_is_received_and_sent_back() {
    let mut board = board(echo_program(true));
    board.line().set_settings(Settings {
        baud: 19_200,
        format: Format::N1,
    });
    board.run_until(Time::from_ms(10));
    let end = board.line().send(Time::from_ms(10), b"A");
    board.run_until(Time::from_ms(30));
    let frames: Vec<_> = board.line().frames().cloned().collect();
    assert_eq!(frames.len(), 2, "{frames:?}");
    assert_eq!(
        (frames[0].direction, &frames[0].bytes[..]),
        (Direction::Request, &b"A"[..])
    );
    assert_eq!(
        (frames[1].direction, &frames[1].bytes[..]),
        (Direction::Response, &b"B"[..])
    );
    assert!(!frames[1].damaged);
    // RXNE is set at ten sixteenths of the stop bit, and the reply begins at the next tick of the baud generator: at
    // most a bit of 52 us later.
    assert!(frames[1].start < end + Time::from_us(40), "{frames:?}");
    assert!(!board.driver_enable());
    let edges: Vec<_> = board.line().driver_edges().collect();
    assert_eq!(edges.len(), 2);
    assert!(edges[1].0 >= frames[1].end - Time::from_us(1), "{edges:?}");
    assert_eq!(findings(&board), [""; 0]);
}

#[test]
fn unit_whose_driver_stays_on_receives_nothing() {
    let mut board = board(echo_program(false));
    board.line().set_settings(Settings {
        baud: 19_200,
        format: Format::N1,
    });
    board.run_until(Time::from_ms(10));
    board.line().send(Time::from_ms(10), b"A");
    board.line().send(Time::from_ms(20), b"C");
    board.run_until(Time::from_ms(40));
    let received: Vec<_> = board.line().received().map(|word| word.byte).collect();
    assert_eq!(received, b"B");
    assert!(board.driver_enable());
}

#[test]
fn receiver_whose_pin_is_an_output_is_reported() {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 1 << 14 | 1 << 2);
    program.store(GPIOA + 4, 0x4444_43B3);
    program.store(USART1 + 8, 417);
    program.store(USART1 + 0x0C, 0x200C);
    program.spin();
    let mut board = board(program);
    board.step(100);
    let text = "USART1 receives, but its RX pin is not a digital input";
    assert!(findings(&board).contains(&text.to_owned()));
}

#[test]
fn the_switch_pulls_its_pins_low() {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 0b1100);
    program.store(GPIOA + 0x0C, 0x00F0);
    program.store(GPIOA, 0x8888_4444);
    program.store(GPIOA + 0x400 + 0x0C, 0xF000);
    program.store(GPIOA + 0x400 + 4, 0x8888_4444);
    let top = program.here();
    program.copy(GPIOA + 8, OUT);
    program.copy(GPIOA + 0x408, OUT + 4);
    program.branch(When::Always, top);
    let config = Config {
        dip: 0b1010_0101,
        ..Config::default()
    };
    let mut board = board_with(&program.image(), config);
    board.step(100);
    assert_eq!(out(&board, 0) & 0xF0, 0b1010_0000);
    assert_eq!(out(&board, 1) & 0xF000, 0b0101 << 12);
    board.set_dip(0);
    board.step(100);
    assert_eq!(out(&board, 0) & 0xF0, 0xF0);
    assert_eq!(out(&board, 1) & 0xF000, 0xF000);
}

#[test]
fn slot_follows_outputs_and_drives_inputs_and_voltages() {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 1 << 2);
    program.store(GPIOA + 0x0C, 0b0111);
    program.store(GPIOA, 0x4444_3388);
    let top = program.here();
    program.copy(GPIOA + 8, OUT);
    program.branch(When::Always, top);
    let config = Config {
        module: Module::Relay2,
        ..Config::default()
    };
    let mut board = board_with(&program.image(), config);
    board.step(100);
    let relay = |energised, manual| Channel::Relay { energised, manual };
    assert_eq!(board.channel(1), relay(true, false));
    assert_eq!(board.channel(2), relay(false, false));
    assert_eq!(out(&board, 0) & 3, 3);
    board.set_manual(2, true).unwrap();
    board.step(100);
    assert_eq!(out(&board, 0) & 3, 1);
    assert_eq!(board.channel(2), relay(false, true));
    board.power_off();
    assert_eq!(
        board.channel(1),
        relay(false, false),
        "a coil without power is released"
    );
    board.set_module(Module::Ai4).unwrap();
    board.power_on();
    assert_eq!(
        board.set_module(Module::None),
        Err(f103::Error::Powered.into())
    );
}
