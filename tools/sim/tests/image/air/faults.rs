//! Faults of the module, the air and the UART, and two lines that must not disturb each other.

use register_map::{
    codes::Baud,
    configuration::{BAUD, COMMAND, FILTER, LORA_ADDRESS, LORA_AIR_RATE, LORA_FRAME_GAP},
    fault, second, state,
};
use sim::Time;
use sim::radio::{Fault, Parameters};
use sim::soc::map::Block;

use crate::radio::{rig, starting};
use crate::rig::{FIRST, adu, pages};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn silent_radio_is_reported_and_used_when_it_answers() {
    for fault in [Fault::Absent, Fault::Hung] {
        let mut rig = starting(Parameters::FACTORY, &[]);
        rig.board.set_radio_fault(fault);
        rig.board.take_log();
        rig.board.run_for(Time::from_ms(3_000));
        let log = rig.board.take_log();
        assert!(
            log.contains("WARN radio: the module does not answer"),
            "{log}"
        );
        assert!(
            rig.status(state::status::MODULE_FAULT),
            "a module has a fault"
        );
        assert!(rig.board.leds().fault);
        rig.assert_answers(1);
        rig.board.run_for(Time::from_ms(12_000));
        assert_eq!(rig.board.take_log(), "", "reported once");
        rig.board.set_radio_fault(Fault::None);
        rig.board.run_for(Time::from_ms(9_000));
        assert!(rig.board.take_log().ends_with("radio: ready\n"));
        assert!(!rig.status(state::status::MODULE_FAULT));
        rig.assert_answers_over_the_air();
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn module_that_is_removed_is_reported_and_the_next_one_is_set_up() {
    let mut rig = rig(&[(LORA_ADDRESS, 7)]);
    rig.board.set_radio_fault(Fault::Absent);
    // AUX looks busy. The module may be busy for nine packets of 600 ms, and two seconds.
    rig.board.run_for(Time::from_ms(7_500));
    assert!(rig.status(state::status::MODULE_FAULT));
    rig.board.change_radio(|module| {
        module.set_stored(Parameters::FACTORY);
        module.set_fault(Fault::None);
    });
    rig.board.run_for(Time::from_ms(9_000));
    assert!(!rig.status(state::status::MODULE_FAULT));
    assert_eq!(rig.module().stored(), Parameters::FACTORY.with_address(7));
    rig.assert_answers_over_the_air();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn any_bit_of_the_uarts_registers_may_change_at_any_instant() {
    // RM0008 27.6. Each bit changes at one of five instants of a request and its reply.
    for (offset, bits) in [
        (0x08, 0xFFFF),
        (0x0C, 0x3FFF),
        (0x10, 0x7F6F),
        (0x14, 0x07FF),
    ] {
        let mut rig = rig(&[(LORA_AIR_RATE, 5), (LORA_FRAME_GAP, 20)]);
        rig.tolerant = true;
        for bit in (0..16).filter(|bit| bits >> bit & 1 != 0) {
            let instant = bit % 5;
            let now = rig.board.now();
            rig.air().send(now, &adu(&[1, 1, 0, FIRST, 0, 4]));
            rig.board.run_for(Time::from_ms(instant * 30 + bit));
            rig.board.upset(Block::Usart3, offset, 1 << bit);
            rig.board.run_for(Time::from_ms(300));
            rig.air().take_received();
            rig.assert_answers_over_the_air();
            assert_eq!(rig.board.resets(), 0, "{offset:#x}, bit {bit}");
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn disturbed_register_of_the_uart_is_set_again() {
    // Baud rate, receiver off, two stop bits and a reserved mode, half duplex.
    for (offset, bits) in [
        (0x08, 0x0400),
        (0x0C, 0x0004),
        (0x10, 0x2000),
        (0x14, 0x0008),
    ] {
        let mut rig = rig(&[]);
        rig.tolerant = true;
        rig.board.upset(Block::Usart3, offset, bits);
        rig.board.run_for(Time::from_ms(150));
        rig.assert_answers_over_the_air();
        assert_eq!(rig.register(fault::LINE_REPAIRS), 1, "offset {offset:#x}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn saves_do_not_disturb_requests_over_the_air() {
    let mut rig = rig(&[(LORA_AIR_RATE, 5), (LORA_FRAME_GAP, 20)]);
    let mut changed = false;
    for round in 0..20 {
        rig.configure(FILTER, &[round + 1; 30]);
        let now = rig.board.now();
        rig.air().send(now, &adu(&[1, 1, 0, FIRST, 0, 4]));
        // At a phase of the request and the reply that moves on from round to round.
        rig.board.run_for(Time::from_ms(u64::from(round) * 9));
        rig.write(COMMAND, &[1]).unwrap();
        rig.board.run_for(Time::from_ms(400));
        let reply = rig.take_from_the_air();
        assert_eq!(reply, adu(&[1, 1, 1, 0]), "round {round}");
        changed |= pages()
            .iter()
            .any(|page| rig.board.flash()[page.clone()][2..4] == [0xFF; 2]);
    }
    assert!(changed, "a page is erased by some of the saves");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn rs485_line_at_921600_loses_nothing_while_the_radio_is_busy() {
    let mut rig = rig(&[
        (BAUD, Baud::B921600.code()),
        (LORA_AIR_RATE, 5),
        (LORA_FRAME_GAP, 50),
    ]);
    rig.settings(sim::line::Settings {
        baud: 921_600,
        ..sim::line::Settings::default()
    });
    // A reply may wait while a request over the air is served.
    rig.patience = Time::from_ms(1);
    let echo: Vec<u8> = [1, 8, 0, 0].into_iter().chain(0..=249).collect();
    let request = adu(&echo[..201]);
    let echo = adu(&echo);
    let (mut replies, mut asked) = (0, false);
    for _ in 0..400 {
        if !asked {
            let now = rig.board.now();
            rig.air().send(now, &request);
            asked = true;
        }
        assert_eq!(rig.hurry(Time::ZERO, &echo).0, echo);
        if rig.air().received().count() == request.len() {
            assert_eq!(rig.take_from_the_air(), request);
            (replies, asked) = (replies + 1, false);
        }
    }
    assert!(replies >= 2, "{replies} replies over the air");
    assert_eq!(rig.registers(state::BUS_ERRORS, 1), Ok(vec![0]));
    assert_eq!(rig.registers(state::OVERRUNS, 2), Ok(vec![0, 0]));
    assert_eq!(rig.registers(second::BUS_ERRORS, 1), Ok(vec![0]));
}
