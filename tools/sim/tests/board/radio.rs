//! The LoRa module at the pins of the part: USART3, M0, M1 and AUX on both boards.

use sim::board::{Layout, MODIO_02, MODIO_08};
use sim::radio::{Fault, Mode, Parameters, Sender, timing};
use sim::{Board, Config, Time};

use super::asm::{Asm, When};
use super::echo::{echo, select_normal_mode, set_up};
use super::regs::*;
use super::{START, board_with, findings, out};

const FACTORY: [u8; 6] = [0xC0, 0x00, 0x00, 0x1A, 0x17, 0x44];

pub fn ms(n: u64) -> Time {
    Time::from_ms(n)
}

fn fitted(layout: &'static Layout, program: Asm) -> Board {
    let config = Config {
        layout,
        radio: Some(Parameters::FACTORY),
        ..Config::default()
    };
    board_with(&program.image(), config)
}

/// Waits for AUX, sends these bytes, and stores `count` received words from [`OUT`] on.
fn exchange(program: &mut Asm, aux: (u32, u32), bytes: &[u8], count: u32) {
    program.wait_set(aux.0 + 8, 1 << aux.1);
    for &byte in bytes {
        program.wait_set(USART3, 1 << 7);
        program.store(USART3 + 4, u32::from(byte));
    }
    for n in 0..count {
        program.wait_set(USART3, 1 << 5);
        program.copy(USART3 + 4, OUT + 4 * n);
    }
}

/// Port and number of the pin AUX.
fn aux(layout: &Layout) -> (u32, u32) {
    match layout.radio {
        Some(pins) if pins.aux.port() == 'B' => (GPIOB, 5),
        _ => (GPIOC, 12),
    }
}

fn results(board: &Board, count: u32) -> Vec<u8> {
    (0..count).map(|n| out(board, n) as u8).collect()
}

#[test]
fn parameters_are_read_over_usart3_with_m0_and_m1_open() {
    for layout in [&MODIO_02, &MODIO_08] {
        let mut program = set_up();
        exchange(&mut program, aux(layout), &[0xC1; 3], 6);
        program.spin();
        let mut board = fitted(layout, program);
        board.run_until(timing::START_UP - ms(1));
        assert_eq!(board.radio().unwrap().mode(), None);
        board.run_until(timing::START_UP + ms(100));
        assert_eq!(board.radio().unwrap().mode(), Some(Mode::Sleep));
        assert_eq!(results(&board, 6), FACTORY, "{}", layout.board);
        assert_eq!(findings(&board), [""; 0]);
    }
}

#[test]
fn bytes_go_to_the_gateway_and_back_in_normal_mode() {
    for layout in [&MODIO_02, &MODIO_08] {
        let mut program = set_up();
        select_normal_mode(&mut program);
        echo(&mut program);
        let mut board = fitted(layout, program);
        let pin = layout.radio.unwrap().aux;
        board.watch_pin(pin.port(), pin.number() as u8);
        board.run_until(timing::START_UP + ms(100));
        assert_eq!(board.radio().unwrap().mode(), Some(Mode::Normal));
        let begin = board.now();
        board.air().unwrap().send(begin, b"HAL");
        board.run_for(ms(500));
        let air = board.air().unwrap();
        let received: Vec<u8> = air.take_received().iter().map(|byte| byte.byte).collect();
        assert_eq!(received, b"IBM");
        let packets: Vec<_> = air.packets().cloned().collect();
        assert_eq!(packets.len(), 2);
        assert_eq!(
            (packets[1].sender, &packets[1].bytes[..]),
            (Sender::Board(0), &b"IBM"[..])
        );
        let radio = board.radio().unwrap();
        assert_eq!((radio.packets_sent(), radio.packets_received()), (1, 1));
        // The firmware sees AUX as the module drives it: low from the end of the first packet to the start of the
        // second.
        let edges = board.pin_edges(pin.port(), pin.number() as u8);
        let edges: Vec<_> = edges.iter().filter(|(at, _)| *at > begin).collect();
        assert_eq!(*edges[0], (packets[0].end + timing::CHECK, false));
        assert_eq!(**edges.last().unwrap(), (packets[1].start, true));
        assert_eq!(findings(&board), [""; 0]);
    }
}

#[test]
fn aux_raises_its_exti_line_at_its_edge() {
    for (layout, afio, line) in [(&MODIO_02, 0x10, 5), (&MODIO_08, 2, 12)] {
        let mut program = set_up();
        // EXTI5 is in AFIO_EXTICR2, EXTI12 in AFIO_EXTICR4.
        program.store(AFIO + 8 + 4 * (line / 4), afio);
        program.store(EXTI, 1 << line);
        program.store(EXTI + 8, 1 << line);
        // EXTI9_5 is interrupt 23, EXTI15_10 is interrupt 40.
        let number = if line < 10 { 23 } else { 40 };
        program.store(NVIC_ISER + 4 * (number / 32), 1 << (number % 32));
        program.set(4, EXTI);
        program.set(5, 1 << line);
        program.store(OUT, 0);
        let top = program.here();
        program.wfi();
        program.branch(When::Always, top);
        program.handler(16 + number as usize);
        program.str(5, 4, 0x14);
        program.store(OUT, 1);
        program.bx(14);
        let mut board = fitted(layout, program);
        board.run_until(timing::START_UP - Time::from_us(1));
        assert_eq!(out(&board, 0), 0);
        board.run_until(timing::START_UP + Time::from_us(10));
        assert_eq!(out(&board, 0), 1, "{}", layout.board);
    }
}

#[test]
fn pins_of_a_module_that_is_not_fitted_have_the_level_of_their_pulls() {
    for (pulls, expected) in [(1 << 5 | 1 << 11, 1 << 5 | 1 << 11), (0, 0)] {
        let mut program = set_up();
        program.store(GPIOB + 0x0C, pulls);
        let top = program.here();
        program.copy(GPIOB + 8, OUT);
        program.copy(USART3, OUT + 4);
        program.branch(When::Always, top);
        let mut board = board_with(&program.image(), Config::default());
        board.run_until(ms(700));
        assert!(board.radio().is_none() && board.air().is_none());
        assert_eq!(out(&board, 0) & (1 << 5 | 1 << 11), expected);
        assert_eq!(out(&board, 1) & 1 << 5, 0, "no byte is received");
        assert_eq!(findings(&board), [""; 0]);
    }
}

#[test]
fn faulty_module_is_absent_or_holds_aux_low() {
    let mut program = set_up();
    let top = program.here();
    program.copy(GPIOB + 8, OUT);
    program.branch(When::Always, top);
    let mut board = fitted(&MODIO_02, program);
    let aux = |board: &mut Board| {
        board.run_for(ms(1));
        out(board, 0) >> 5 & 1
    };
    board.run_until(START + ms(1));
    assert_eq!(aux(&mut board), 0, "the self-check");
    board.set_radio_fault(Fault::Absent);
    assert_eq!(aux(&mut board), 1, "the pull-up of the part");
    board.set_radio_fault(Fault::Hung);
    assert_eq!(aux(&mut board), 0);
    board.run_for(timing::START_UP);
    assert_eq!(aux(&mut board), 0);
    board.set_radio_fault(Fault::None);
    board.run_for(timing::START_UP);
    assert_eq!(aux(&mut board), 1);
    assert_eq!(findings(&board), [""; 0]);
}

#[test]
fn short_reset_of_the_part_does_not_change_the_mode() {
    let mut program = set_up();
    select_normal_mode(&mut program);
    program.spin();
    let mut board = fitted(&MODIO_02, program);
    board.run_until(timing::START_UP + ms(10));
    assert_eq!(board.radio().unwrap().mode(), Some(Mode::Normal));
    // The reset of 20 us is shorter than the delay of a mode change.
    board.reset();
    board.run_for(ms(5));
    assert_eq!(board.radio().unwrap().mode(), Some(Mode::Normal));
}
