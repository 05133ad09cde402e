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
        (Direction::FromMaster, &b"A"[..])
    );
    assert_eq!(
        (frames[1].direction, &frames[1].bytes[..]),
        (Direction::FromUnit, &b"B"[..])
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

#[test]
fn adc_converts_the_voltage_at_the_pin() {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 1 << 2 | 1 << 9);
    program.store(GPIOA, 0x4444_4400);
    program.store(ADC1 + 8, 1);
    program.store(ADC1 + 0x34, 1);
    // Power-up and calibration take less than 200 rounds each.
    for control in [1 << 2 | 1, 7 << 17 | 1 << 20 | 1] {
        program.set(3, 200);
        let settle = program.here();
        program.raw(0x3B01); // subs r3, #1
        program.branch(When::NotEqual, settle);
        program.store(ADC1 + 8, control);
    }
    let top = program.here();
    program.store(ADC1 + 8, 7 << 17 | 1 << 20 | 1 << 22 | 1);
    program.wait_set(ADC1, 2);
    program.copy(ADC1 + 0x4C, OUT);
    program.branch(When::Always, top);
    let config = Config {
        module: Module::Ai4,
        ..Config::default()
    };
    let mut board = board_with(&program.image(), config);
    board.set_millivolts(2, 1650).unwrap();
    board.run_until(Time::from_ms(5));
    assert_eq!(out(&board, 0), 2048);
    board.set_millivolts(2, 825).unwrap();
    board.run_for(Time::from_ms(1));
    assert_eq!(out(&board, 0), 1024);
    assert_eq!(findings(&board), [""; 0]);
}

#[test]
fn timer_interrupt_occurs_on_time_and_wakes_the_core() {
    let mut program = Asm::new();
    program.store(RCC_APB1ENR, 1);
    program.store(RCC_APB2ENR, 1 << 4);
    program.store(GPIOC + 4, 0x4424_4444);
    program.store(TIM2 + 0x28, 7);
    program.store(TIM2 + 0x2C, 999);
    program.store(TIM2 + 0x14, 1);
    program.store(TIM2 + 0x10, 0);
    program.store(TIM2 + 0x0C, 1);
    program.store(NVIC_ISER, 1 << 28);
    program.set(4, GPIOC);
    program.set(5, 1 << 13);
    program.set(3, 0);
    program.set(7, TIM2);
    program.store(TIM2, 1);
    let top = program.here();
    program.wfi();
    program.branch(When::Always, top);
    program.handler(16 + 28);
    program.str(3, 7, 0x10);
    program.ldr(6, 4, 0x0C);
    program.eor(6, 5);
    program.str(6, 4, 0x0C);
    program.bx(14);
    let mut board = board(program);
    board.watch_pin('C', 13);
    board.run_until(Time::from_ms(53));
    let edges = board.pin_edges('C', 13);
    assert_eq!(edges.len(), 50);
    for pair in edges.windows(2) {
        assert_eq!(pair[1].0 - pair[0].0, Time::from_ms(1));
    }
    assert_eq!(findings(&board), [""; 0]);
}

#[test]
fn an_edge_on_a_pin_raises_its_exti_line() {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 0b101);
    program.store(GPIOA + 0x0C, 0x10);
    program.store(GPIOA, 0x4448_4444);
    program.store(EXTI, 1 << 4);
    program.store(EXTI + 0x0C, 1 << 4);
    program.store(NVIC_ISER, 1 << 10);
    program.set(4, EXTI);
    program.set(5, 1 << 4);
    program.set(6, 0);
    program.set(7, OUT);
    program.str(6, 7, 0);
    let top = program.here();
    program.wfi();
    program.branch(When::Always, top);
    program.handler(16 + 10);
    program.str(5, 4, 0x14);
    program.add(6, 1);
    program.str(6, 7, 0);
    program.bx(14);
    let config = Config {
        dip: 0,
        ..Config::default()
    };
    let mut board = board_with(&program.image(), config);
    board.run_until(Time::from_ms(5));
    assert_eq!(out(&board, 0), 0);
    board.set_dip(1);
    board.run_for(Time::from_ms(1));
    assert_eq!(out(&board, 0), 1);
    board.set_dip(0);
    board.set_dip(1);
    board.run_for(Time::from_ms(1));
    assert_eq!(out(&board, 0), 2);
}
