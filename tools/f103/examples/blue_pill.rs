//! Another board with an STM32F103: a "Blue Pill" with an LED at PC13 and a terminal at USART1.
//!
//! Prints everything that the board does, with the virtual time. Without an argument the board runs a small program
//! that switches the LED and sends a line; with the path of an ELF file it runs that image.
//!
//! ```sh
//! cargo run --ignore-rust-version -p f103 --example blue_pill
//! ```

use std::path::Path;

use f103::part::STM32F103C8;
use f103::periph::gpio::Gpio;
use f103::periph::usart::{Sent, Usart, Wire};
use f103::serial::{Format, Framing, Receiver, Settings, Wave};
use f103::soc::{Circuit, Pin};
use f103::{Chip, Error, Image, Time, chip};

#[path = "../tests/machine/asm.rs"]
#[allow(dead_code, reason = "the tests of the core use all of the assembler")]
mod asm;
use asm::{Asm, When};

/// Transmitter of USART1.
const TX: Pin = Pin::new('A', 9);
/// Rate and format of the terminal.
const TERMINAL: Settings = Settings {
    baud: 115_200,
    format: Format::N1,
};

const RCC_APB2ENR: u32 = 0x4002_1018;
const GPIOA_CRH: u32 = 0x4001_0804;
const GPIOC: u32 = 0x4001_1000;
const USART1: u32 = 0x4001_3800;

/// The circuit of the board.
#[derive(Default)]
pub struct BluePill {
    led: bool,
    terminal: Terminal,
    /// The events so far, each with its virtual time, in order.
    pub events: Vec<(Time, String)>,
}

impl Circuit for BluePill {
    /// Switches the LED, which is on while PC13 is an output and low.
    fn port_changed(&mut self, port: char, gpio: &Gpio, now: Time) -> bool {
        let led = (gpio.outputs() & !gpio.level()) >> 13 & 1 != 0;
        if port == 'C' && led != self.led {
            self.led = led;
            let text = if led { "LED on" } else { "LED off" };
            self.events.push((now, text.to_owned()));
        }
        false
    }

    fn wire(&mut self, tx: Pin) -> Option<&mut dyn Wire> {
        (tx == TX).then_some(self as &mut dyn Wire)
    }
}

/// A terminal that makes an event of each line that it receives.
#[derive(Default)]
struct Terminal {
    wave: Wave,
    receiver: Receiver,
    line: String,
    now: Time,
}

impl Wire for BluePill {
    fn sent(&mut self, sent: Sent) {
        sent.put_on(&mut self.terminal.wave);
    }

    fn advance(&mut self, to: Time) {
        self.terminal.now = to;
    }

    fn now(&self) -> Time {
        self.terminal.now
    }

    fn caught_up(&mut self, _usart: &Usart) {
        let terminal = &mut self.terminal;
        let framing = Framing::of(TERMINAL);
        while let Some(word) = terminal
            .receiver
            .next_word(&terminal.wave, &framing, terminal.now)
        {
            match word.data as u8 {
                b'\n' => {
                    let line = std::mem::take(&mut terminal.line);
                    self.events.push((word.end, format!("UART: {line}")));
                }
                byte => terminal.line.push(char::from(byte)),
            }
        }
        let needed = terminal.receiver.needs_from();
        let margin = framing.rate.bits(1);
        terminal.wave.drop_before(needed.saturating_sub(margin));
    }
}

/// A program that switches the LED and sends a line, in an endless loop.
#[must_use]
pub fn blinking() -> Image {
    let mut program = Asm::new();
    // Enable the clocks of ports A and C and of USART1.
    program.store(RCC_APB2ENR, 1 << 2 | 1 << 4 | 1 << 14);
    // Make PC13 an output, and PA9 the transmitter of USART1.
    program.store(GPIOC + 0x04, 0x4424_4444);
    program.store(GPIOA_CRH, 0x4444_44B4);
    // Write 8 MHz / 115200 to BRR, then set UE and TE.
    program.store(USART1 + 0x08, 69);
    program.store(USART1 + 0x0C, 1 << 13 | 1 << 3);
    program.set(4, GPIOC);
    program.set(5, 1 << 13);
    let top = program.here();
    for byte in *b"hello\n" {
        program.wait_set(USART1, 1 << 7);
        program.store(USART1 + 0x04, u32::from(byte));
    }
    program.set(3, 100_000);
    let wait = program.here();
    program.raw(0x3B01); // SUBS r3, #1
    program.branch(When::NotEqual, wait);
    // ODR ^= 1 << 13.
    program.ldr(6, 4, 0x0C);
    program.eor(6, 5);
    program.str(6, 4, 0x0C);
    program.branch(When::Always, top);
    program.image()
}

/// Runs `image` on the board for `duration`.
///
/// # Errors
///
/// [`Error::Image`] if the image does not fit the part.
pub fn run(image: &Image, duration: Time) -> Result<Chip<BluePill>, Error> {
    let config = chip::Config {
        part: &STM32F103C8,
        ..chip::Config::default()
    };
    let mut chip = Chip::in_circuit(image, config, BluePill::default())?;
    chip.run_for(duration);
    Ok(chip)
}

fn main() -> Result<(), Error> {
    let image = match std::env::args().nth(1) {
        Some(path) => Image::read(Path::new(&path))?,
        None => blinking(),
    };
    let chip = run(&image, Time::from_ms(500))?;
    for (at, what) in &chip.circuit().events {
        println!("{:>10} us  {what}", at.as_us());
    }
    for finding in chip.findings() {
        println!("{finding}");
    }
    Ok(())
}
