//! What the parts of high density with 100 pins have beyond the others: UART4 with DMA2, ports D and E, the DAC, all
//! remaps of USARTs; and the pins that every part shares with its debug port.

use f103::part::{Part, STM32F103C8, STM32F103RC, STM32F103VC};
use f103::periph::gpio::{Drive, Gpio};
use f103::periph::usart::{Sent, Wire};
use f103::serial::{Character, Format, Settings, Wave};
use f103::soc::{Circuit, Pin, Pins};
use f103::{Chip, Time, chip};

use super::asm::{Asm, When};
use super::regs::*;

const LINE: Settings = Settings {
    baud: 9600,
    format: Format::N1,
};
/// Transmitter of UART4.
const TX: Pin = Pin::new('C', 10);
const BUFFER: u32 = OUT + 0x100;

/// Something at every pin that these tests use.
#[derive(Default)]
struct Rig {
    now: Time,
    /// Characters to the part.
    input: Wave,
    taken: Time,
    /// Start of each character from the part.
    sent: Vec<Time>,
    button: bool,
    dac: [Option<u16>; 2],
    debug: bool,
    /// Transmitter of the USART at the wire, if it is not UART4. Then nothing else is connected.
    tx: Option<Pin>,
}

impl Circuit for Rig {
    fn drive(&self, pins: &mut Pins) {
        if self.tx.is_some() {
            return;
        }
        let button = if self.button {
            Drive::Low
        } else {
            Drive::PullUp
        };
        pins.drive(Pin::new('E', 15), button);
        pins.drive(Pin::new('A', 1), Drive::Millivolts(825));
        pins.drive(Pin::new('A', 14), Drive::PullUp);
    }

    fn port_changed(&mut self, port: char, gpio: &Gpio, _now: Time) -> bool {
        if port == 'A' {
            self.dac = [4, 5].map(|pin| gpio.dac(pin));
            self.debug = gpio.level() >> 14 & 1 != 0;
        }
        false
    }

    fn wire(&mut self, tx: Pin) -> Option<&mut dyn Wire> {
        (tx == self.tx.unwrap_or(TX)).then_some(self as &mut dyn Wire)
    }
}

impl Wire for Rig {
    fn sent(&mut self, sent: Sent) {
        if let Sent::Character(character) = sent {
            self.sent.push(character.start);
        }
    }

    fn advance(&mut self, to: Time) {
        self.now = to;
    }

    fn now(&self) -> Time {
        self.now
    }

    fn take_edges(&mut self) -> Vec<(Time, bool)> {
        let edges = self.input.edges(self.taken, self.now).collect();
        self.taken = self.now;
        edges
    }

    fn next_edge(&self) -> Option<Time> {
        self.input
            .next_edge(self.taken)
            .map(|(at, _)| at.max(self.now))
    }

    fn has_edges(&self) -> bool {
        self.next_edge().is_some_and(|at| at <= self.now)
    }

    fn rx_level(&self) -> bool {
        self.input.level_at(self.now)
    }
}

fn run(program: Asm, rig: Rig) -> Chip<Rig> {
    run_on(&STM32F103VC, program, rig)
}

fn run_on(part: &'static Part, program: Asm, rig: Rig) -> Chip<Rig> {
    let config = chip::Config {
        part,
        ..chip::Config::default()
    };
    let mut chip = Chip::in_circuit(&program.image(), config, rig).expect("the program fits");
    chip.run_until(Time::from_ms(10));
    chip
}

fn out(chip: &Chip<Rig>, n: u32) -> u32 {
    chip.word(OUT + 4 * n).expect("in SRAM")
}

fn findings(chip: &Chip<Rig>) -> Vec<String> {
    chip.findings().iter().map(|f| f.what.to_string()).collect()
}

/// Makes `program` count the entries of the handler of interrupt `line` at `OUT + 4 * n`, and enables the line. The
/// handler begins with `acknowledge`.
fn count_interrupts(program: &mut Asm, line: u32, n: u32, acknowledge: impl Fn(&mut Asm)) {
    program.store(NVIC_ISER + line / 32 * 4, 1 << (line % 32));
    let over = program.forward(When::Always);
    program.handler(16 + line as usize);
    acknowledge(program);
    program.set(0, OUT + 4 * n);
    program.ldr(1, 0, 0);
    program.add(1, 1);
    program.str(1, 0, 0);
    program.bx(14);
    program.land(over);
}

/// UART4 at 9600 8N1 from 8 MHz, on its pins, with its DMA channels off.
fn uart4() -> Asm {
    let mut program = Asm::new();
    program.store(OUT, 0);
    program.store(OUT + 4, 0);
    program.store(BUFFER, 0);
    program.store(RCC_APB2ENR, 1 << 4);
    program.store(RCC_APB1ENR, 1 << 19);
    program.store(RCC_AHBENR, 0b10);
    program.store(GPIOC + 4, 0x4444_4B44);
    program.store(UART4 + 8, 833);
    program.store(UART4 + 0x0C, 0x200C);
    program
}

#[test]
fn uart4_receives_by_channel_3_of_dma2_and_reports_the_idle_line() {
    let mut program = uart4();
    // Channel 3: eight bytes from UART4 to the buffer. Its interrupt does not come, that of the idle line does.
    program.store(DMA2 + 0x38, UART4 + 4);
    program.store(DMA2 + 0x3C, BUFFER);
    program.store(DMA2 + 0x34, 8);
    program.store(DMA2 + 0x30, 0x83);
    count_interrupts(&mut program, 58, 0, |handler| {
        handler.store(DMA2 + 4, u32::MAX);
    });
    // Reading SR and then DR clears IDLE.
    count_interrupts(&mut program, 52, 1, |handler| {
        handler.set(0, UART4);
        handler.ldr(1, 0, 0);
        handler.ldr(1, 0, 4);
    });
    program.store(UART4 + 0x14, 1 << 6);
    program.store(UART4 + 0x0C, 0x201C);
    program.spin();
    let mut rig = Rig::default();
    let mut at = Time::from_ms(4);
    for byte in *b"OK!" {
        let character = Character::new(LINE, byte).at(at);
        rig.input.push_character(&character);
        at = character.end();
    }
    rig.input.push(at, true);
    let mut chip = run(program, rig);
    chip.run_until(Time::from_ms(12));
    assert_eq!(findings(&chip), [""; 0]);
    let received = chip.word(BUFFER).expect("in SRAM").to_le_bytes();
    assert_eq!(&received, b"OK!\0");
    // The idle frame after the receiver was switched on, and the one after the third byte.
    assert_eq!((out(&chip, 0), out(&chip, 1)), (0, 2));
}

#[test]
fn uart4_sends_by_channel_5_of_dma2_without_a_gap() {
    let mut program = uart4();
    program.store(BUFFER, 0x0102_0304);
    program.store(DMA2 + 0x60, UART4 + 4);
    program.store(DMA2 + 0x64, BUFFER);
    program.store(DMA2 + 0x5C, 3);
    count_interrupts(&mut program, 59, 0, |handler| {
        handler.store(DMA2 + 4, u32::MAX);
    });
    program.store(UART4 + 0x14, 1 << 7);
    program.store(DMA2 + 0x58, 0x93);
    program.spin();
    let chip = run(program, Rig::default());
    assert_eq!(findings(&chip), [""; 0]);
    let sent = &chip.circuit().sent;
    assert_eq!(sent.len(), 3);
    let frame = Time::cycles(10 * 833, 8_000_000);
    for pair in sent.windows(2) {
        assert_eq!(pair[1] - pair[0], frame);
    }
    assert_eq!(out(&chip, 0), 1, "one interrupt of the end");
}

#[test]
fn continuous_scan_of_the_adc_fills_a_buffer_by_channel_1_of_dma1() {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 1 << 2 | 1 << 9);
    program.store(RCC_AHBENR, 1);
    program.store(GPIOA, 0x4444_4404);
    program.store(DMA1 + 0x10, ADC1 + 0x4C);
    program.store(DMA1 + 0x14, BUFFER);
    program.store(DMA1 + 0x0C, 4);
    // MSIZE, PSIZE = 16, MINC, CIRC, EN.
    program.store(DMA1 + 0x08, 0x05A1);
    // Channels 1 and 16, with the longest sampling time.
    program.store(ADC1 + 0x0C, 7 << 18);
    program.store(ADC1 + 0x10, 7 << 3);
    program.store(ADC1 + 0x2C, 1 << 20);
    program.store(ADC1 + 0x34, 16 << 5 | 1);
    program.store(ADC1 + 0x04, 1 << 8);
    let on = 0x009E_0103;
    program.store(ADC1 + 0x08, on);
    for calibration in [8, 4] {
        program.store(ADC1 + 0x08, on | calibration);
        for _ in 0..200 {
            program.nop();
        }
    }
    program.store(ADC1 + 0x08, on | 1 << 22);
    program.spin();
    let chip = run(program, Rig::default());
    assert_eq!(findings(&chip), [""; 0]);
    let codes = [0, 4].map(|at| chip.word(BUFFER + at).expect("in SRAM"));
    // 825 mV of 3300 mV, and 1430 mV of the temperature sensor.
    assert_eq!(codes, [1775 << 16 | 1024; 2]);
}

#[test]
fn edge_at_a_pin_of_port_e_requests_the_interrupt_of_its_line() {
    let mut program = Asm::new();
    program.store(OUT, 0);
    program.store(RCC_APB2ENR, 1 << 6 | 1);
    // Line 15 from port E, falling edge.
    program.store(AFIO + 0x14, 4 << 12);
    program.store(EXTI + 0x0C, 1 << 15);
    program.store(EXTI, 1 << 15);
    count_interrupts(&mut program, 40, 0, |handler| {
        handler.store(EXTI + 0x14, 1 << 15);
    });
    program.copy(GPIOE + 8, OUT + 4);
    program.spin();
    let mut chip = run(program, Rig::default());
    assert_eq!((out(&chip, 0), out(&chip, 1)), (0, 1 << 15));
    for pressed in [true, false, true] {
        chip.change(|rig| rig.button = pressed);
        chip.run_for(Time::from_ms(1));
    }
    assert_eq!(out(&chip, 0), 2);
    assert_eq!(findings(&chip), [""; 0]);
}

#[test]
fn dac_output_reaches_the_circuit_at_an_analog_pin() {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 1 << 2);
    program.store(RCC_APB1ENR, 1 << 29);
    program.store(GPIOA, 0x4440_4444);
    program.store(DAC, 0x0003);
    program.store(DAC + 0x08, 1000);
    program.spin();
    let chip = run(program, Rig::default());
    assert_eq!(chip.circuit().dac, [Some(805), None]);
    assert_eq!(findings(&chip), [""; 0]);
    // Channel 2 is on while PA5 is a digital input.
    let mut program = Asm::new();
    program.store(RCC_APB1ENR, 1 << 29);
    program.store(DAC, 1 << 16);
    program.spin();
    let chip = run(program, Rig::default());
    assert!(findings(&chip)[0].contains("its pin is not analog"));
}

#[test]
fn pin_of_swclk_is_an_output_only_while_mapr_has_the_debug_port_off() {
    let low = |swj: Option<u32>, again: bool| {
        let mut program = Asm::new();
        program.store(RCC_APB2ENR, 1 << 2 | 1);
        program.store(GPIOA + 4, 0x4244_4444);
        if let Some(swj) = swj {
            program.store(AFIO + 4, swj << 24);
        }
        if again {
            // Reads MAPR and writes it back.
            program.copy(AFIO + 4, AFIO + 4);
        }
        program.spin();
        let chip = run(program, Rig::default());
        assert_eq!(findings(&chip), [""; 0]);
        !chip.circuit().debug
    };
    assert!(!low(None, false), "SWCLK");
    assert!(!low(Some(2), false), "SW-DP on");
    assert!(low(Some(4), false));
    assert!(!low(Some(4), true), "SWJ_CFG does not read back");
}

/// A USART at 9600 8N1 from 8 MHz: the USART, the bits of its clock in APB2ENR and APB1ENR, and BRR.
const USARTS: [(u32, u32, u32); 3] = [
    (USART1, 1 << 14, 0),
    (USART2, 0, 1 << 17),
    (USART3, 0, 1 << 18),
];

/// Sends a byte at USART `n` (from 1) and then waits for one, with this value of AFIO_MAPR and all pins of ports A to D
/// as alternate outputs, except `rx`, which is a floating input.
fn remapped(n: usize, mapr: u32, rx: Pin) -> Asm {
    let (usart, apb2, apb1) = USARTS[n - 1];
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 0x3D | apb2);
    program.store(RCC_APB1ENR, apb1);
    program.store(AFIO + 4, mapr);
    let port = GPIOA + 0x400 * (rx.port() as u32 - 'A' as u32);
    for half in 0..2 {
        let mut modes = 0xAAAA_AAAA;
        if rx.number() as u32 / 8 == half {
            let shift = 4 * (rx.number() % 8);
            modes = modes & !(0xF << shift) | 4 << shift;
        }
        program.store(port + 4 * half, modes);
    }
    program.store(usart + 8, 833);
    program.store(usart + 0x0C, 0x200C);
    program.store(usart + 4, u32::from(b'!'));
    program.wait_set(usart, 1 << 5);
    program.copy(usart + 4, OUT);
    program.spin();
    program
}

/// Runs [`remapped`] with a wire at `tx` and the pin behind it, and sends a byte to the part.
fn run_remapped(part: &'static Part, n: usize, mapr: u32, tx: Pin) -> Chip<Rig> {
    let rx = Pin::new(tx.port(), tx.number() + 1);
    let mut rig = Rig {
        tx: Some(tx),
        ..Rig::default()
    };
    let character = Character::new(LINE, b'?').at(Time::from_ms(7));
    rig.input.push_character(&character);
    rig.input.push(character.end(), true);
    run_on(part, remapped(n, mapr, rx), rig)
}

#[test]
fn remapped_usart_sends_and_receives_at_its_new_pins_and_not_at_the_old_ones() {
    let pin = |port, number| Pin::new(port, number);
    for (part, n, mapr, old, new) in [
        (&STM32F103C8, 1, 1 << 2, pin('A', 9), pin('B', 6)),
        (&STM32F103VC, 2, 1 << 3, pin('A', 2), pin('D', 5)),
        (&STM32F103RC, 3, 1 << 4, pin('B', 10), pin('C', 10)),
        (&STM32F103VC, 3, 3 << 4, pin('B', 10), pin('D', 8)),
    ] {
        for (mapr, tx, heard) in [(0, old, true), (mapr, new, true), (mapr, old, false)] {
            // The low byte of MAPR with all pins of the debug port released, which are on ports A and B.
            let chip = run_remapped(part, n, mapr | 4 << 24, tx);
            let what = format!("USART{n} {mapr:#x} {tx:?}");
            assert_eq!(findings(&chip), [""; 0], "{what}");
            assert_eq!(chip.circuit().sent.len(), usize::from(heard), "{what}");
            assert_eq!(out(&chip, 0) == u32::from(b'?'), heard, "{what}");
        }
    }
}

#[test]
fn receiver_whose_pin_is_an_output_is_reported() {
    let rig = Rig {
        tx: Some(Pin::new('A', 9)),
        ..Rig::default()
    };
    let program = remapped(1, 4 << 24, Pin::new('A', 0));
    let text = "USART1 receives, but its RX pin is not a digital input";
    assert!(findings(&run_on(&STM32F103VC, program, rig)).contains(&text.to_owned()));
}

#[test]
fn remap_to_missing_pins_and_remap_of_a_timer_are_findings() {
    let at = Pin::new('C', 10);
    for (part, mapr, what) in [
        (&STM32F103C8, 1 << 4, "pins that this part does not have"),
        (&STM32F103RC, 3 << 4, "pins that this part does not have"),
        (&STM32F103RC, 1 << 3, "pins that this part does not have"),
        (&STM32F103VC, 2 << 4, "pin remapping (AFIO_MAPR)"),
        (&STM32F103VC, 1 << 4 | 1 << 8, "pin remapping (AFIO_MAPR)"),
    ] {
        let mut program = Asm::new();
        program.store(RCC_APB2ENR, 1);
        program.store(AFIO + 4, mapr);
        program.copy(AFIO + 4, OUT);
        program.spin();
        let rig = Rig {
            tx: Some(at),
            ..Rig::default()
        };
        let found = findings(&run_on(part, program, rig));
        assert_eq!(found.len(), 1, "{} {mapr:#x}: {found:?}", part.name);
        assert!(
            found[0].contains(what),
            "{} {mapr:#x}: {found:?}",
            part.name
        );
    }
}

#[test]
fn uart4_has_no_pins_while_usart3_is_at_them() {
    let mut program = uart4();
    program.store(RCC_APB2ENR, 1 << 4 | 1);
    for mapr in [0, 1 << 4, 0] {
        program.store(AFIO + 4, mapr);
        // Reading SR before writing DR clears TC.
        program.copy(UART4, OUT);
        program.store(UART4 + 4, u32::from(b'!'));
        program.wait_set(UART4, 1 << 6);
    }
    program.spin();
    let chip = run(program, Rig::default());
    assert_eq!(chip.circuit().sent.len(), 2);
    let findings = findings(&chip);
    assert!(!findings.is_empty());
    for found in findings {
        assert!(found.contains("USART3 is remapped to its pins"), "{found}");
    }
}
