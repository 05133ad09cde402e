//! The part without its core: the register blocks with their clocks and interrupt lines, the wires between the blocks,
//! and the pins, to which a [`Circuit`] is connected.
//!
//! Blocks do not know each other. [`wires`] passes on their signals after every access to a block and after every event
//! of a block. Time moves from event to event: each block knows its next event, and [`Soc::advance`] handles the events
//! in time order.

mod circuit;
mod config;
pub mod map;
mod requests;
mod wires;

use crate::finding::What;
use crate::part::Part;
use crate::periph::adc::Adc;
use crate::periph::afio::Afio;
use crate::periph::clocks::Clocks;
use crate::periph::crc::Crc;
use crate::periph::exti::Exti;
use crate::periph::flash::Flash;
use crate::periph::gpio::Gpio;
use crate::periph::i2c::I2c;
use crate::periph::iwdg::Iwdg;
use crate::periph::pwr::Pwr;
use crate::periph::rcc::{Cause, Rcc};
use crate::periph::timer::{Kind, Timer};
use crate::periph::usart::Usart;
use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;
pub use circuit::{Circuit, PORTS, Pin, Pins};
pub use config::Config;
use map::{BLOCKS, Block};
use wires::SERIALS;

/// The blocks, and the circuit at the pins.
#[derive(Debug)]
pub struct Soc<C> {
    part: &'static Part,
    /// Reset and clock control.
    pub rcc: Rcc,
    /// The flash controller and its cells.
    pub flash: Flash,
    /// Ports A to D.
    pub gpio: [Gpio; PORTS],
    /// The circuit that is connected to the pins.
    pub circuit: C,
    /// Power control, with the supply voltage.
    pub pwr: Pwr,
    crc: Crc,
    afio: Afio,
    exti: Exti,
    iwdg: Iwdg,
    usart1: Usart,
    usart3: Usart,
    tim1: Timer,
    tim2: Timer,
    tim3: Timer,
    tim4: Timer,
    adc1: Adc,
    i2c1: I2c,
    /// Levels of the ports that were passed on last.
    seen: [u16; PORTS],
    /// Mask of the I2C pins that the firmware pulls low as GPIO outputs.
    i2c_by_hand: u16,
    /// Clocks that were passed on last.
    clocks: Clocks,
    /// [`Flash::access_control`] that was passed on last.
    flash_access: (u32, bool),
    /// Instant of the next event of each block.
    due: [Time; BLOCKS],
    /// Earliest instant in `due`.
    next: Time,
    /// Level of each interrupt line, one bit each.
    levels: u64,
    /// Mask of the interrupt lines that have changed since they were taken.
    changed_lines: u64,
    /// Requests of the blocks to the machine.
    pub signals: Signals,
    notes: Vec<(Time, What)>,
}

/// Requests of the blocks to the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Signals {
    /// HCLK or the flash's wait states have changed.
    pub rate: bool,
    /// A block requests a reset of the part.
    pub reset: Option<Cause>,
    /// Bytes of the flash from the first offset up to, not including, the second have changed.
    pub flash: Option<(usize, usize)>,
}

impl<C: Circuit> Soc<C> {
    /// Returns USART1.
    #[must_use]
    pub const fn usart1(&self) -> &Usart {
        &self.usart1
    }

    /// Returns the part after power-on, with this flash, in `circuit`.
    #[must_use]
    pub fn new(config: &Config, flash: Flash, circuit: C) -> Self {
        let oscillators = config.corner.oscillators().with_crystal(config.crystal_hz);
        let rcc = Rcc::new(config.crystal, oscillators, config.part.clock_enables);
        let timer = |kind| Timer::new(kind).with_ug_delay(config.corner.ug_delay());
        let flash_access = flash.access_control();
        let mut soc = Self {
            part: config.part,
            clocks: rcc.clocks(),
            rcc,
            flash,
            flash_access,
            // PC13 to PC15 are supplied through a switch for 3 mA, so they allow 2 MHz at most (DS5319 table 5, notes).
            gpio: [0, 0, 0xE000, 0].map(Gpio::with_slow_pins),
            circuit,
            pwr: Pwr::default(),
            crc: Crc::default(),
            afio: Afio::default(),
            exti: Exti::default(),
            iwdg: Iwdg::new(oscillators.lsi),
            usart1: Usart::default(),
            usart3: Usart::default(),
            tim1: timer(Kind::Advanced),
            tim2: timer(Kind::General),
            tim3: timer(Kind::General),
            tim4: timer(Kind::General),
            adc1: Adc::default(),
            i2c1: I2c::default(),
            seen: [0; PORTS],
            i2c_by_hand: 0,
            due: [Time::MAX; BLOCKS],
            next: Time::MAX,
            levels: 0,
            changed_lines: 0,
            signals: Signals::default(),
            notes: Vec::new(),
        };
        soc.adc1.set_noise(config.corner.adc_noise());
        soc.set_clocks(Time::ZERO);
        soc
    }

    /// Resets the part.
    pub fn reset(&mut self, cause: Cause, now: Time) {
        self.advance(now);
        self.rcc.note_reset(cause);
        for block in Block::ALL {
            self.reset_block(block, now);
        }
        self.set_clocks(now);
        self.signals.reset = None;
    }

    /// Switches the power. Without power the part drives no pin, and a flash operation is interrupted.
    pub fn set_power(&mut self, on: bool, now: Time) {
        if on {
            self.circuit.set_power(true, now);
        } else {
            self.sync(now);
            // The circuit first, which then knows that the part's outputs do not change by an order of the firmware.
            self.circuit.set_power(false, now);
            self.flash.power_off(now);
            for block in Block::ALL {
                self.reset_block(block, now);
            }
            self.set_clocks(now);
        }
        self.refresh(now);
    }

    /// Computes everything up to `now` that is otherwise computed on demand. Needed before code outside the part reads
    /// or changes something.
    pub fn sync(&mut self, now: Time) {
        self.advance(now);
        for serial in &SERIALS {
            self.sync_wire(serial, now);
        }
        self.find_next();
    }

    /// Takes over changes that were made to the circuit.
    pub fn refresh(&mut self, now: Time) {
        self.circuit.drive(&mut Pins {
            part: self.part,
            gpio: &mut self.gpio,
            adc: &mut self.adc1,
            now,
        });
        for port in 0..PORTS {
            self.wire_port(port, now);
        }
        self.exchange_i2c(now);
        self.note_requests(Block::I2c1);
        for block in [Block::I2c1, Block::Usart1, Block::Usart3, Block::Tim1] {
            self.note_due(block);
        }
        self.find_next();
    }

    /// Takes over a change of the next edges at an RX pin.
    pub fn wires_changed(&mut self) {
        for block in [Block::Usart1, Block::Usart3, Block::Tim1] {
            self.note_due(block);
        }
        self.find_next();
    }

    /// Takes the findings of blocks and wires, each with its instant.
    pub fn take_notes(&mut self) -> Vec<(Time, What)> {
        core::mem::take(&mut self.notes)
    }

    /// Returns whether there are findings to take.
    #[must_use]
    pub fn has_notes(&self) -> bool {
        !self.notes.is_empty()
    }

    /// Returns the instant of the next event of any block; [`Time::MAX`] if there is none.
    #[must_use]
    pub fn next_event(&self) -> Time {
        self.next
    }

    /// Handles all events up to and including `now`, in time order.
    pub fn advance(&mut self, now: Time) {
        while self.next <= now {
            let at = self.next;
            for source in 0..BLOCKS {
                if self.due[source] <= at {
                    self.act(source, at);
                }
            }
            self.find_next();
        }
    }

    /// Handles the events of block number `source` that are due at `at`.
    fn act(&mut self, source: usize, at: Time) {
        let block = Block::ALL[source];
        self.catch_up(block, at);
        self.settle(block, at);
        debug_assert!(
            self.due[source] > at,
            "block {source} has an event at {at} again"
        );
        self.due[source] = self.due[source].max(at + Time::from_ps(1));
    }

    /// Reads the register of `block` at `offset` (word aligned).
    ///
    /// # Errors
    ///
    /// As [`Peripheral::read`].
    pub fn read(&mut self, block: Block, offset: u32, now: Time) -> Result<u32, Unmodelled> {
        self.catch_up(block, now);
        let answer = self.block(block).read(offset, now);
        self.settle(block, now);
        self.find_next();
        answer
    }

    /// Writes the register of `block` at `offset` (word aligned). The write is lost while RCC holds the block in reset.
    ///
    /// # Errors
    ///
    /// As [`Peripheral::write`].
    pub fn write(
        &mut self,
        block: Block,
        offset: u32,
        value: u32,
        now: Time,
    ) -> Result<(), Unmodelled> {
        let (apb2, apb1) = self.rcc.held_in_reset();
        if apb2 | apb1 != 0
            && block
                .clock()
                .is_some_and(|(bus, bit)| [apb2, apb1, 0][bus] >> bit & 1 != 0)
        {
            return Ok(());
        }
        self.catch_up(block, now);
        let answer = self.block(block).write(offset, value, now);
        self.settle(block, now);
        self.find_next();
        answer
    }

    /// Returns whether `block` has its clock (RM0008 7.3.7, 7.3.8).
    #[must_use]
    pub fn is_clocked(&self, block: Block) -> bool {
        let enabled = self.rcc.enabled();
        block
            .clock()
            .is_none_or(|(bus, bit)| enabled[bus] >> bit & 1 != 0)
    }

    /// Handles a store of the core to the flash at `offset`. `half` says whether it is a half-word.
    pub fn program(&mut self, offset: u32, half: bool, value: u16, now: Time) {
        self.flash.advance(now);
        self.flash.program(offset, half, value, now);
        self.settle(Block::Flash, now);
        self.find_next();
    }

    /// Computes a block and its wires up to `now`.
    fn catch_up(&mut self, block: Block, now: Time) {
        match block {
            Block::Usart1 | Block::Usart3 | Block::GpioA | Block::GpioB => {
                for serial in &SERIALS {
                    if serial.usart == block {
                        self.sync_wire(serial, now);
                    } else if serial.port() == block {
                        self.sync_wire(serial, now);
                        self.drive_rx(serial, now);
                    }
                }
            }
            Block::Tim1 => {
                self.sync_wire(wires::CAPTURED, now);
                for (at, rising) in self.usart1.take_edges() {
                    self.tim1.capture_edge(wires::RX_CAPTURE, at, rising);
                }
                self.tim1.advance(now);
            }
            Block::I2c1 => self.exchange_i2c(now),
            _ => self.block(block).advance(now),
        }
    }

    fn reset_block(&mut self, block: Block, now: Time) {
        self.catch_up(block, now);
        self.block(block).reset(now);
        self.settle(block, now);
        self.find_next();
    }

    /// Passes the outputs of a block on to other blocks, the circuit and the interrupt lines, and notes its next event.
    fn settle(&mut self, block: Block, now: Time) {
        self.wire(block, now);
        self.note_requests(block);
        self.note_due(block);
    }

    /// Notes the next event of a block.
    fn note_due(&mut self, block: Block) {
        let next = match block {
            Block::Usart1 => self.next_exchange(&SERIALS[0]),
            Block::Usart3 => self.next_exchange(&SERIALS[1]),
            Block::Tim1 if self.tim1.capture_interrupt_enabled(wires::RX_CAPTURE) => {
                let wire = self.circuit.wire(wires::CAPTURED.tx);
                let edge = wire.and_then(|wire| wire.next_edge());
                [self.tim1.next_event(), edge].into_iter().flatten().min()
            }
            _ => self.block(block).next_event(),
        };
        self.due[block as usize] = next.unwrap_or(Time::MAX);
    }

    /// Computes the instant of the next event of any block.
    fn find_next(&mut self) {
        self.next = self.due.iter().copied().fold(Time::MAX, Time::min);
    }

    fn block(&mut self, block: Block) -> &mut dyn Peripheral {
        match block {
            Block::Tim2 => &mut self.tim2,
            Block::Tim3 => &mut self.tim3,
            Block::Tim4 => &mut self.tim4,
            Block::Iwdg => &mut self.iwdg,
            Block::Usart3 => &mut self.usart3,
            Block::I2c1 => &mut self.i2c1,
            Block::Afio => &mut self.afio,
            Block::Exti => &mut self.exti,
            Block::GpioA => &mut self.gpio[0],
            Block::GpioB => &mut self.gpio[1],
            Block::GpioC => &mut self.gpio[2],
            Block::GpioD => &mut self.gpio[3],
            Block::Adc1 => &mut self.adc1,
            Block::Tim1 => &mut self.tim1,
            Block::Usart1 => &mut self.usart1,
            Block::Rcc => &mut self.rcc,
            Block::Flash => &mut self.flash,
            Block::Pwr => &mut self.pwr,
            Block::Crc => &mut self.crc,
        }
    }
}
