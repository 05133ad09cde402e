//! The modio-08: four slots, their pins, and their DACs on one I2C bus.

use register_map::Module;
use sim::board::MODIO_08;
use sim::{Board, Channel, Config, Error, Time};

use super::asm::{Asm, When};
use super::regs::*;
use super::{board_with, findings, out};

const I2C1: u32 = 0x4000_5400;

fn modio_08(slots: &[(u8, Module)], program: Asm) -> Board {
    let config = Config {
        layout: &MODIO_08,
        slots: slots.to_vec(),
        ..Config::default()
    };
    board_with(&program.image(), config)
}

fn output(board: &Board, port: u8, channel: usize) -> Channel {
    let mut slots = board.slots();
    let slot = slots
        .find(|(known, _)| *known == port)
        .expect("the port has a slot");
    slot.1.channel(channel)
}

#[test]
fn each_slot_and_the_switch_have_their_pins() {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 0b1_1100);
    // Inputs with pull-ups, except the lines of port 4: PB0, PB1, PC4 and PC5 are outputs.
    for gpio in [GPIOA, GPIOB, GPIOC] {
        program.store(gpio + 0x0C, 0xFFFF);
    }
    program.store(GPIOA, 0x8888_8888);
    program.store(GPIOB, 0x8888_8833);
    program.store(GPIOB + 4, 0x8888_8888);
    program.store(GPIOC, 0x8833_8888);
    program.store(GPIOC + 4, 0x8888_8888);
    program.store(GPIOB + 0x14, 1 << 1);
    program.store(GPIOC + 0x14, 1 << 5);
    let top = program.here();
    program.copy(GPIOA + 8, OUT);
    program.copy(GPIOB + 8, OUT + 4);
    program.copy(GPIOC + 8, OUT + 8);
    program.branch(When::Always, top);
    let slots = [
        (1, Module::Di4),
        (2, Module::Di4),
        (3, Module::Di4),
        (4, Module::Do4),
    ];
    let mut board = modio_08(&slots, program);
    board.set_dip(0b1010_0101);
    for (port, channel) in [(1, 1), (2, 2), (3, 4)] {
        let energised = board.change_slot(port, |slot| slot.set_energised(channel, true));
        assert_eq!(energised, Ok(Ok(())));
    }
    board.run_until(Time::from_ms(3));
    assert_eq!(out(&board, 0) & 0xFF, 0b1101_1110, "ports 1 and 2");
    assert_eq!(out(&board, 2) & 0xF, 0b0111, "port 3");
    assert_eq!(out(&board, 2) >> 6 & 0xF, 0b1010, "SW01 positions 1 to 4");
    assert_eq!(out(&board, 1) >> 12, 0b0101, "SW01 positions 5 to 8");
    let on = [1, 2, 3, 4].map(|channel| output(&board, 4, channel));
    assert_eq!(on, [true, false, true, false].map(|on| Channel::Do { on }));
    assert_eq!(findings(&board), [""; 0]);
}

#[test]
fn an_analog_input_of_port_4_is_at_its_input_of_the_adc() {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 1 << 4 | 1 << 9);
    program.store(GPIOC, 0x4440_4444);
    // Line 3 is PC4: input 14.
    program.store(ADC1 + 0x34, 14);
    for control in [1, 1 << 2 | 1, 7 << 17 | 1 << 20 | 1] {
        program.store(ADC1 + 8, control);
        program.set(3, 200);
        let settle = program.here();
        program.raw(0x3B01); // subs r3, #1
        program.branch(When::NotEqual, settle);
    }
    program.store(ADC1 + 8, 7 << 17 | 1 << 20 | 1 << 22 | 1);
    program.wait_set(ADC1, 2);
    program.copy(ADC1 + 0x4C, OUT);
    program.spin();
    let mut board = modio_08(&[(4, Module::Ai4)], program);
    let set = board.change_slot(4, |slot| {
        // A source without impedance: the shortest sampling time is then enough.
        slot.set_source_ohms(3, 0)?;
        slot.set_millivolts(3, 1650)
    });
    assert_eq!(set, Ok(Ok(())));
    board.run_until(Time::from_ms(5));
    assert_eq!(out(&board, 0), 2048);
    assert_eq!(findings(&board), [""; 0]);
}

/// Writes the code 0x0ABC to channel A of the DAC at `address` with a fast write.
fn write_dac(program: &mut Asm, address: u32) {
    program.store(I2C1, 1 << 8 | 1);
    program.wait_set(I2C1 + 0x14, 1);
    program.store(I2C1 + 0x10, address << 1);
    program.wait_set(I2C1 + 0x14, 1 << 1);
    program.copy(I2C1 + 0x18, OUT);
    for byte in [0x0A, 0xBC] {
        program.wait_set(I2C1 + 0x14, 1 << 7);
        program.store(I2C1 + 0x10, byte);
    }
    program.wait_set(I2C1 + 0x14, 1 << 2);
    program.store(I2C1, 1 << 9 | 1);
}

#[test]
fn the_dac_of_each_slot_has_its_own_address() {
    for (address, port) in [(0x60, 1), (0x61, 2), (0x62, 3), (0x63, 4)] {
        let mut program = Asm::new();
        program.store(RCC_APB2ENR, 1 << 3);
        program.store(RCC_APB1ENR, 1 << 21);
        program.store(GPIOB, 0xFF44_4444);
        // 8 MHz, 100 kHz, 1000 ns.
        program.store(I2C1 + 0x04, 8);
        program.store(I2C1 + 0x1C, 40);
        program.store(I2C1 + 0x20, 9);
        program.store(I2C1, 1);
        write_dac(&mut program, address);
        program.spin();
        let mut board = modio_08(&[1, 2, 3, 4].map(|port| (port, Module::Ao4)), program);
        board.run_until(Time::from_ms(10));
        for other in 1..=4 {
            let code = if other == port { 0x0ABC } else { 0 };
            assert_eq!(
                output(&board, other, 1),
                Channel::Ao { code },
                "{address:#x}"
            );
        }
        assert_eq!(findings(&board), [""; 0]);
    }
}

#[test]
fn slot_that_the_board_does_not_have_is_refused() {
    let config = Config {
        slots: vec![(1, Module::Do4)],
        ..Config::default()
    };
    let board = Board::new(&Asm::new().image(), config);
    assert_eq!(board.err(), Some(Error::Slot(1)));
    let mut board = modio_08(&[], Asm::new());
    assert_eq!(board.change_slot(5, |_| ()), Err(Error::Slot(5)));
    assert_eq!(
        board.set_module_at(2, Module::Do4),
        Err(f103::Error::Powered.into())
    );
    board.power_off();
    assert_eq!(board.set_module_at(2, Module::Do4), Ok(()));
    let modules: Vec<_> = board
        .slots()
        .map(|(port, slot)| (port, slot.module()))
        .collect();
    let expected = [Module::Di4, Module::Do4, Module::None, Module::None];
    assert_eq!(modules, (1..=4).zip(expected).collect::<Vec<_>>());
}
