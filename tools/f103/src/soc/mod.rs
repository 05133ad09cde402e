//! The part without its core: the register blocks with their clocks and interrupt lines, the wires between the blocks,
//! and the pins, to which a [`Circuit`] is connected.
//!
//! Blocks do not know each other. [`wires`] passes on their signals after every access to a block and after every event
//! of a block. Time moves from event to event: each block knows its next event, and [`Soc::advance`] handles the events
//! in time order.

mod access;
mod circuit;
mod config;
mod dma;
pub mod map;
mod requests;
mod serial;
mod wires;

use crate::finding::What;
use crate::memory::Memory;
use crate::part::{PORTS, Part};
use crate::periph::adc::Adc;
use crate::periph::afio::Afio;
use crate::periph::can::Can;
use crate::periph::clocks::Clocks;
use crate::periph::crc::Crc;
use crate::periph::dac::Dac;
use crate::periph::dma::Dma;
use crate::periph::exti::Exti;
use crate::periph::flash::Flash;
use crate::periph::gpio::Gpio;
use crate::periph::i2c::I2c;
use crate::periph::iwdg::Iwdg;
use crate::periph::pwr::Pwr;
use crate::periph::rcc::{Cause, Rcc};
use crate::periph::timer::{Kind, Timer};
use crate::periph::usart::Usart;
use crate::peripheral::Peripheral;
use crate::time::Time;
pub use circuit::{Circuit, Pin, Pins};
pub use config::Config;
use map::{BLOCKS, Block};
use serial::{Places, USARTS};

/// The blocks, and the circuit at the pins.
#[derive(Debug)]
pub struct Soc<C> {
    part: &'static Part,
    /// Reset and clock control.
    pub rcc: Rcc,
    /// The flash controller and its cells.
    pub flash: Flash,
    /// The SRAM.
    pub ram: Memory,
    /// Ports A to E.
    pub gpio: [Gpio; PORTS],
    /// The circuit that is connected to the pins.
    pub circuit: C,
    /// Power control, with the supply voltage.
    pub pwr: Pwr,
    crc: Crc,
    afio: Afio,
    exti: Exti,
    iwdg: Iwdg,
    usarts: [Usart; USARTS],
    /// The pins of the USARTs, in the same order.
    places: Places,
    /// What is at pins that a USART has left.
    absent: Usart,
    tim1: Timer,
    tim2: Timer,
    tim3: Timer,
    tim4: Timer,
    adc1: Adc,
    i2c1: I2c,
    can: Can,
    dac: Dac,
    dma: [Dma; 2],
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
    /// Returns the part after power-on, with this flash and SRAM, in `circuit`.
    #[must_use]
    pub fn new(config: &Config, flash: Flash, ram: Memory, circuit: C) -> Self {
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
            ram,
            // PC13 to PC15 are supplied through a switch for 3 mA, so they allow 2 MHz at most (DS5319 table 5, notes).
            gpio: [0, 0, 0xE000, 0, 0].map(Gpio::with_slow_pins),
            circuit,
            pwr: Pwr::default(),
            crc: Crc::default(),
            afio: Afio::default(),
            exti: Exti::default(),
            iwdg: Iwdg::new(oscillators.lsi),
            usarts: Default::default(),
            places: Places::default(),
            absent: Usart::default(),
            tim1: timer(Kind::Advanced),
            tim2: timer(Kind::General),
            tim3: timer(Kind::General),
            tim4: timer(Kind::General),
            adc1: Adc::default(),
            i2c1: I2c::default(),
            can: Can::default(),
            dac: Dac::default(),
            dma: [Dma::new(7), Dma::new(5)],
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
        for usart in &mut soc.usarts {
            usart.set_idle_bits(config.corner.is_clone().into());
        }
        soc.set_clocks(Time::ZERO);
        soc.wire(Block::Afio, Time::ZERO);
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
        for serial in self.places.0 {
            self.sync_wire(&serial, now);
        }
        self.sync_left_wires(now);
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
        self.note_due(Block::I2c1);
        self.wires_changed();
    }

    /// Takes over a change of the next edges at an RX pin.
    pub fn wires_changed(&mut self) {
        for serial in self.places.0 {
            self.note_due(serial.usart);
        }
        self.note_due(Block::Tim1);
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

    /// Computes a block and its wires up to `now`.
    fn catch_up(&mut self, block: Block, now: Time) {
        match block {
            Block::Usart1
            | Block::Usart2
            | Block::Usart3
            | Block::Uart4
            | Block::GpioA
            | Block::GpioB
            | Block::GpioC
            | Block::GpioD => {
                for serial in self.places.0 {
                    if serial.usart == block {
                        self.sync_wire(&serial, now);
                    } else if serial.port() == block {
                        self.sync_wire(&serial, now);
                        self.drive_rx(&serial, now);
                    }
                }
            }
            // A write may move USARTs to other pins.
            Block::Afio => {
                for serial in self.places.0 {
                    self.sync_wire(&serial, now);
                }
            }
            Block::Tim1 => {
                if let Some(serial) = self.places.captured() {
                    self.sync_wire(&serial, now);
                    for (at, rising) in self.usarts[0].take_edges() {
                        self.tim1.capture_edge(serial::RX_CAPTURE, at, rising);
                    }
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
        self.serve_dma(block, now);
        self.wire(block, now);
        self.note_requests(block);
        self.note_due(block);
    }

    /// Notes the next event of a block.
    fn note_due(&mut self, block: Block) {
        let next = match block {
            Block::Tim1 if self.tim1.capture_interrupt_enabled(serial::RX_CAPTURE) => {
                let serial = self.places.captured();
                let wire = serial.and_then(|serial| self.circuit.wire(serial.tx));
                let edge = wire.and_then(|wire| wire.next_edge());
                [self.tim1.next_event(), edge].into_iter().flatten().min()
            }
            _ => match self.places.0.iter().find(|serial| serial.usart == block) {
                Some(&serial) => self.next_exchange(&serial),
                None => self.block(block).next_event(),
            },
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
            Block::Usart1 => &mut self.usarts[0],
            Block::Usart2 => &mut self.usarts[1],
            Block::Usart3 => &mut self.usarts[2],
            Block::Uart4 => &mut self.usarts[3],
            Block::Can => &mut self.can,
            Block::Dac => &mut self.dac,
            Block::I2c1 => &mut self.i2c1,
            Block::Afio => &mut self.afio,
            Block::Exti => &mut self.exti,
            Block::GpioA => &mut self.gpio[0],
            Block::GpioB => &mut self.gpio[1],
            Block::GpioC => &mut self.gpio[2],
            Block::GpioD => &mut self.gpio[3],
            Block::GpioE => &mut self.gpio[4],
            Block::Adc1 => &mut self.adc1,
            Block::Tim1 => &mut self.tim1,
            Block::Rcc => &mut self.rcc,
            Block::Flash => &mut self.flash,
            Block::Pwr => &mut self.pwr,
            Block::Crc => &mut self.crc,
            Block::Dma1 => &mut self.dma[0],
            Block::Dma2 => &mut self.dma[1],
        }
    }
}
