//! Registers that change on their own, as in a disturbance of the part: the driver goes off in time, and the unit
//! repairs them and serves the line again.

use register_map::{codes::Baud, configuration, fault};
use sim::soc::map::{Block, irq};
use sim::{Channel, Module, Time};

use crate::rig::{FIRST, Rig, SLOT, adu};

/// A register that is disturbed: its block (`None` for the core's interrupt controller), offset, bits, and name.
type Register = (Option<Block>, u32, u32, &'static str);

/// Registers of the line. RM0008 27.6 (USART), 14.4 (TIM1), 15.4 (TIM2).
const OF_LINE: [Register; 26] = [
    (Some(Block::Usart1), 0x08, 0xFFFF, "USART1 BRR"),
    (Some(Block::Usart1), 0x0C, 0x3FFF, "USART1 CR1"),
    (Some(Block::Usart1), 0x10, 0x7F6F, "USART1 CR2"),
    (Some(Block::Usart1), 0x14, 0x07FF, "USART1 CR3"),
    (Some(Block::GpioA), 0x0C, 1 << 8, "GPIOA ODR, driver"),
    (Some(Block::Tim2), 0x00, 0x03FF, "TIM2 CR1"),
    (Some(Block::Tim2), 0x08, 0x0077, "TIM2 SMCR"),
    (Some(Block::Tim2), 0x0C, 0x5F5F, "TIM2 DIER"),
    (Some(Block::Tim2), 0x18, 0x7F7F, "TIM2 CCMR1"),
    (Some(Block::Tim2), 0x1C, 0x7F7F, "TIM2 CCMR2"),
    (Some(Block::Tim2), 0x20, 0x3333, "TIM2 CCER"),
    (Some(Block::Tim2), 0x28, 0xFFFF, "TIM2 PSC"),
    (Some(Block::Tim2), 0x2C, 0xFFFF, "TIM2 ARR"),
    (Some(Block::Tim2), 0x34, 0xFFFF, "TIM2 CCR1"),
    (Some(Block::Tim2), 0x38, 0xFFFF, "TIM2 CCR2"),
    (Some(Block::Tim2), 0x3C, 0xFFFF, "TIM2 CCR3"),
    (Some(Block::Tim1), 0x00, 0x03FF, "TIM1 CR1"),
    (Some(Block::Tim1), 0x08, 0x0077, "TIM1 SMCR"),
    (Some(Block::Tim1), 0x0C, 0x5F5F, "TIM1 DIER"),
    (Some(Block::Tim1), 0x18, 0x7F7F, "TIM1 CCMR1"),
    (Some(Block::Tim1), 0x1C, 0x00FF, "TIM1 CCMR2"),
    (Some(Block::Tim1), 0x20, 0x0FFF, "TIM1 CCER"),
    (Some(Block::Tim1), 0x28, 0xFFFF, "TIM1 PSC"),
    (Some(Block::Tim1), 0x2C, 0xFFFF, "TIM1 ARR"),
    // Not in the unit's table. An inverted bit of SR can clear TC.
    (Some(Block::Usart1), 0x00, 1 << 6, "USART1 SR.TC"),
    (Some(Block::Tim2), 0x24, 0xFFFF, "TIM2 CNT"),
];

/// Bits of those registers that change in operation, that raise an interrupt which clears them, or that cannot be
/// changed (CC3S) or clear themselves (SBK).
const VARYING: [(&str, u32); 7] = [
    ("USART1 CR1", 0b11 << 6 | 1),
    ("TIM1 CCMR2", 0b11),
    ("TIM2 CR1", 1),
    ("TIM2 DIER", 1 << 2),
    ("TIM1 DIER", 0b11 << 1),
    ("USART1 SR.TC", 1 << 6),
    ("TIM2 CNT", 0xFFFF),
];

/// The other registers. RM0008 7.3 (RCC), 9.2 (GPIO), 15.4 (TIM4); PM0075 3.1 (FLASH_ACR); PM0056 4.3.
const OTHERS: [Register; 25] = [
    (Some(Block::Rcc), 0x0C, 0x5E7D, "APB2RSTR"),
    (Some(Block::Rcc), 0x10, 0x1AE6_4807, "APB1RSTR"),
    (Some(Block::Rcc), 0x14, 0x0055, "AHBENR"),
    (Some(Block::Rcc), 0x18, 0x5E7D, "APB2ENR"),
    (Some(Block::Rcc), 0x1C, 0x1AE6_4807, "APB1ENR"),
    (None, 0x100, u32::MAX, "ISER0"),
    (None, 0x104, 0x07FF, "ISER1"),
    (None, 0x404, 0xF0F0_F0F0, "IPR1"),
    (None, 0x408, 0xF0F0_F0F0, "IPR2"),
    (None, 0x418, 0xF0F0_F0F0, "IPR6"),
    (None, 0x41C, 0xF0F0_F0F0, "IPR7"),
    (None, 0x424, 0xF0F0_F0F0, "IPR9"),
    (Some(Block::Flash), 0x00, 0x001F, "FLASH_ACR"),
    (Some(Block::GpioA), 0x00, u32::MAX, "GPIOA CRL"),
    (Some(Block::GpioA), 0x04, u32::MAX, "GPIOA CRH"),
    (Some(Block::GpioB), 0x00, 0x0FFF, "GPIOB CRL"),
    (Some(Block::GpioB), 0x04, u32::MAX, "GPIOB CRH"),
    (Some(Block::GpioC), 0x00, u32::MAX, "GPIOC CRL"),
    (Some(Block::GpioC), 0x04, u32::MAX, "GPIOC CRH"),
    // PA4 to PA7 and PA10 have pull-ups.
    (Some(Block::GpioA), 0x0C, 0x04F0, "GPIOA ODR"),
    (Some(Block::Tim4), 0x00, 0x03FF, "TIM4 CR1"),
    (Some(Block::Tim4), 0x08, 0xFF77, "TIM4 SMCR"),
    (Some(Block::Tim4), 0x0C, 0x5F5F, "TIM4 DIER"),
    (Some(Block::Tim4), 0x28, 0xFFFF, "TIM4 PSC"),
    (Some(Block::Tim4), 0x2C, 0xFFFF, "TIM4 ARR"),
];

/// Returns whether a bit may stop the beat of TIM4, which the checks need, so that the watchdog restarts the unit.
fn may_restart(name: &str, bit: u32) -> bool {
    match name {
        "APB1RSTR" | "APB1ENR" => bit == 2,
        "ISER0" => bit == u32::from(irq::TIM4),
        _ => name.contains("TIM4"),
    }
}

/// A read of 9 registers: the reply has 23 characters.
const LONG: [u8; 6] = [1, 3, 1, 0, 0, 9];
/// A read of the four outputs, and the reply.
const OUTPUTS: [u8; 6] = [1, 1, 0, FIRST, 0, 4];
const ALL_ON: [u8; 4] = [1, 1, 1, 0x0F];

/// Returns a board whose outputs are all on.
fn rig(baud: Baud) -> Rig {
    let mut rig = Rig::set_up(Module::Do4, &[(configuration::BAUD, baud.code())]);
    rig.tolerant = true;
    rig.patience = Time::from_ms(1);
    rig.write_bits(SLOT, &[true; 4]).unwrap();
    rig.board.run_for(Time::from_ms(40));
    rig
}

/// Returns the instants after the start of a request at which bits change: in the request, in t3.5, at the beginning,
/// in the middle and at the end of the reply.
fn instants(rig: &Rig) -> [Time; 6] {
    let request = rig.characters(8);
    let reply = request + rig.t35();
    let half = |characters: u64| Time::from_ps(rig.characters(characters).as_ps() / 2);
    [
        half(9),
        request + half(5),
        reply + half(1),
        reply + half(11),
        reply + half(43),
        reply + half(46),
    ]
}

/// Returns the duration of the longest reply at the rig's rate, plus the millisecond that the server may add, plus two
/// tenths: clones of the part send a bit more for each character, and a tenth is in reserve.
fn bound(rig: &Rig) -> Time {
    let longest = rig.characters(256) + Time::from_ms(1);
    Time::from_ps(longest.as_ps() * 12 / 10)
}

/// Inverts bits of a register. The core's registers are written by an instruction of the core, which is put into
/// unused memory of the stack.
fn upset(rig: &mut Rig, (block, offset, _, name): Register, mask: u32) {
    if let Some(block) = block {
        rig.board.upset(block, offset, mask);
        return;
    }
    /// `str r0, [r1]`
    const STORE: [u8; 2] = 0x6008_u16.to_le_bytes();
    const UNUSED: u32 = 0x2000_0000;
    let address = 0xE000_E000 + offset;
    let read = |rig: &mut Rig| {
        let mut bytes = [0; 4];
        assert_eq!(rig.board.read_memory(address, &mut bytes), 4);
        u32::from_le_bytes(bytes)
    };
    let wanted = read(rig) ^ mask;
    // A bit of ISER is cleared through ICER.
    let clears = name.starts_with("ISER") && wanted & mask == 0;
    let (address, value) = match (name.starts_with("ISER"), clears) {
        (true, true) => (address + 0x80, mask),
        (true, false) => (address, mask),
        _ => (address, wanted),
    };
    while rig.board.asleep() {
        rig.board.run_for(Time::from_us(1));
    }
    let saved = [0, 1, 15, 16].map(|number| (number, rig.board.register(number).unwrap()));
    let was = rig.board.patch_code(UNUSED, &STORE).unwrap();
    // Not within an IT block.
    let flags = saved[3].1 & !0x0600_FC00;
    for (number, value) in [(0, value), (1, address), (15, UNUSED), (16, flags)] {
        rig.board.set_register(number, value).unwrap();
    }
    rig.board.step_instruction();
    for (number, value) in saved {
        rig.board.set_register(number, value).unwrap();
    }
    rig.board.patch_code(UNUSED, &was).unwrap();
    assert_eq!(read(rig), wanted, "{name} is inverted by {mask:#x}");
}

/// Disturbs one bit `after` the start of a request, or of an idle line without a request. Returns what is wrong
/// afterwards, if anything.
fn fails(rig: &mut Rig, register: Register, bit: u32, after: Option<Time>) -> Option<String> {
    let (.., name) = register;
    let resets = rig.board.resets();
    let repairs = rig.register(fault::LINE_REPAIRS);
    rig.board.run_for(Time::from_us(u64::from(bit) * 37));
    let begin = rig.board.now();
    if let Some(after) = after {
        rig.board.line().send(begin, &adu(&LONG));
        rig.board.run_until(begin + after);
    }
    upset(rig, register, 1 << bit);
    let upset = rig.board.now();
    let most = bound(rig);
    // The checks find any register in 66 ms. The watchdog needs 1,200 ms, twice if tasks that run slowly prove it once more.
    let end = if may_restart(name, bit) { 2_500 } else { 110 };
    let end = upset + most.max(Time::from_ms(end));
    while rig.board.now() < end && rig.board.resets() == resets {
        rig.board.run_for(Time::from_us(250));
        let now = rig.board.now();
        let last = rig.board.line().driver_edges().next_back();
        if last.is_some_and(|(at, on)| on && now > at + most) {
            return Some("the driver is on for too long".to_owned());
        }
    }
    rig.board.line().take_received();
    if rig.board.resets() != resets && may_restart(name, bit) {
        rig.started();
        let kind = rig.register(0x0260);
        rig.write_bits(SLOT, &[true; 4]).unwrap();
        return (kind != 3).then(|| format!("the fault is {kind}"));
    }
    if rig.board.resets() != resets {
        return Some("a reset".to_owned());
    }
    let reply = rig.exchange(&adu(&OUTPUTS));
    if reply != adu(&ALL_ON) {
        return Some(format!("the reply is {reply:02X?}"));
    }
    if (1..=4).any(|line| rig.board.channel(line) != Channel::Do { on: true }) {
        return Some("an output is off".to_owned());
    }
    let repairs = rig.register(fault::LINE_REPAIRS) - repairs;
    let varies = VARYING
        .iter()
        .any(|&(register, bits)| register == name && bits >> bit & 1 != 0);
    // Traffic writes some registers, so that nothing is left to repair.
    let expected = if after.is_none() && !varies {
        1..=1
    } else {
        0..=1
    };
    (!expected.contains(&repairs)).then(|| format!("{repairs} repairs"))
}

/// Disturbs every bit of the registers on an idle line, and at two of the instants, which differ from bit to bit.
fn disturb(registers: &[Register], baud: Baud, instants: fn(&Rig) -> Vec<Time>) {
    let mut failures = Vec::new();
    let mut rig = rig(baud);
    let instants = instants(&rig);
    for &register in registers {
        let (_, _, bits, name) = register;
        for bit in (0..32).filter(|bit| bits >> bit & 1 != 0) {
            let some = instants.iter().copied().cycle().skip(bit as usize);
            let some = some
                .step_by(instants.len().div_ceil(2))
                .take(instants.len().min(2));
            for after in [None].into_iter().chain(some.map(Some)) {
                if let Some(failure) = fails(&mut rig, register, bit, after) {
                    failures.push(format!("{baud:?} {name} bit {bit}, {after:?}: {failure}"));
                    rig = self::rig(baud);
                }
            }
        }
    }
    assert!(
        failures.is_empty(),
        "{} failed: {failures:#?}",
        failures.len()
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn any_bit_of_the_lines_registers_may_change_at_any_instant() {
    disturb(&OF_LINE, Baud::B115200, |rig| instants(rig).to_vec());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn any_bit_of_the_lines_registers_may_change_at_921600() {
    disturb(&OF_LINE, Baud::B921600, |rig| instants(rig)[3..4].to_vec());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn any_bit_of_the_other_registers_may_change_at_any_instant() {
    disturb(&OTHERS, Baud::B115200, |rig| instants(rig)[3..4].to_vec());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_reply_whose_end_is_never_reported_is_cut_off() {
    for baud in [Baud::B9600, Baud::B115200, Baud::B921600] {
        let mut rig = Rig::set_up(Module::Di4, &[(configuration::BAUD, baud.code())]);
        stays_within_the_bound(&mut rig, |_| {});
        rig.assert_answers(1);
    }
}

/// The timer that limits a reply has stopped as well.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_reply_whose_end_is_never_reported_is_cut_off_by_the_second_clock_too() {
    let mut rig = Rig::set_up(Module::Di4, &[]);
    stays_within_the_bound(&mut rig, |rig| {
        rig.board.upset(Block::Tim2, 0x00, 1);
    });
    rig.assert_answers(1);
}

/// Stops the transmitter in a reply, so that TC is never set. The driver must go off in time.
fn stays_within_the_bound(rig: &mut Rig, more: impl FnOnce(&mut Rig)) {
    rig.tolerant = true;
    let now = rig.board.now();
    rig.board.line().send(now, &adu(&[1, 2, 0, FIRST, 0, 4]));
    while !rig.board.driver_enable() {
        rig.board.run_for(Time::from_us(1));
    }
    let begin = rig.board.now();
    let limit = begin + bound(rig);
    rig.board.run_for(Time::from_us(5));
    // Clear TE.
    rig.board.upset(Block::Usart1, 0x0C, 1 << 3);
    more(rig);
    rig.board.run_until(limit);
    assert!(!rig.board.driver_enable(), "the driver is off");
    rig.board.run_for(Time::from_ms(10));
    rig.board.line().take_received();
}
