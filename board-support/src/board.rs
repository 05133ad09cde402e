//! The board as one struct of named devices.

use core::array;

use cortex_m::peripheral::SCB;
use stm32f1xx_hal::{pac, rcc::Enable};

use crate::{
    ClockSource, CrcUnit, DacBus, Flash, IoPin, OwnDac, Rs485, Rs485Timer, SLOT, Sampler,
    ScanTimer, Watchdog,
    boards::{AddressPins, BOARD, LEDS},
    clock,
    design::{CRYSTAL_FAULTS, DIP_POLL_US, DIP_SETTLE_CYCLES},
    dip, early,
    fault::FaultRecord,
    gap_ticks::LineTimes,
    gesture::Watch,
    kept,
    pin::Pin,
    rs485,
    second_uart::SecondOff,
    unique_id, vectors, wait,
};
use ports::line_settings::LineSettings;

/// Flags in [`Board::reset_cause`].
const WATCHDOG: u8 = 1 << 2;
const POWER_ON: u8 = 1 << 4;

/// The board's devices.
pub struct Board {
    /// Clock source of the core.
    pub clock: ClockSource,
    /// Reset flags of this start: bit 0 low-power, 1 window watchdog, 2 independent watchdog, 3 software, 4
    /// power-on, 5 reset pin. A power-on also sets bit 5 (RM0008 7.3.10).
    pub reset_cause: u8,
    /// The last fault before this start.
    pub faults: FaultRecord,
    /// SW01 as a number from 0 to 255, as read at power-on. On a board without SW01 it is 0, or 255 after the gesture that
    /// starts recovery.
    pub dip: u8,
    /// This start is one as with SW01 = 255, COMMAND 0xB007.
    pub as_255: bool,
    /// SW01 = 254 chose the slot that runs.
    pub chosen: bool,
    /// The loader trusts the development key.
    pub development: bool,
    /// Number of saves that were left before the reset, 255 after power-on.
    pub saves_left: u8,
    /// Seconds from power-on to this start.
    pub powered_s: u32,
    /// The chip's unique identity, half-words in the order of their addresses (RM0008 30.2).
    pub unique_id: [u16; 6],
    /// The converter of the slots' analog lines.
    pub sampler: Sampler,
    /// The bus to the DACs of the analog-output modules. Its pins float until the first transfer.
    pub dacs: DacBus,
    /// The part's own DAC, if the board uses it.
    pub own_dac: Option<OwnDac>,
    /// The flash pages that keep data without power.
    pub flash: Flash,
    /// The unit that computes the CRC-32 of an image.
    pub crc: CrcUnit,
    /// The LEDs for activity and fault, which high lights, and for running, which low lights; or only the last one. All are
    /// off.
    pub leds: [IoPin; LEDS],
    /// The switch or button whose gesture starts recovery.
    pub recovery: RecoveryPins,
    /// The timer that starts each scan, not started yet.
    pub scan_timer: ScanTimer,
    /// The watchdog, running with the long period for the start-up.
    pub watchdog: Watchdog,
    /// The RS-485 line, off, with its driver disabled.
    pub line: LineOff,
    /// The second line, off, with its pins floating.
    pub second: SecondOff,
    /// The reset and clock control, for the set-up of the lines.
    pub rcc: pac::RCC,
}

/// Number of gestures that start recovery: one, or none on a board with SW01.
const GESTURES: usize = matches!(BOARD.address, AddressPins::Register(_)) as usize;

/// The switch or button whose gesture after a power-on starts recovery. A board with SW01 has none.
pub struct RecoveryPins([Option<Watch>; GESTURES]);

impl RecoveryPins {
    fn new(after_power_on: bool) -> Self {
        Self(array::from_fn(|_| match BOARD.address {
            AddressPins::Register(gesture) if after_power_on => Some(Watch::new(gesture)),
            _ => None,
        }))
    }

    /// Returns whether the gesture has just ended, at `now` milliseconds after the start. Call this every 10 ms or so.
    pub fn is_asked(&mut self, now: u32) -> bool {
        let watches = self.0.iter_mut().flatten();
        watches.fold(false, |asked, watch| {
            asked | watch.step(now, watch.pin().is_high())
        })
    }
}

/// The RS-485 line before it is set up.
pub struct LineOff {
    timer: pac::TIM2,
    start_bit: pac::TIM1,
    clock: ClockSource,
}

impl LineOff {
    /// Sets the line up with these settings and times, and turns the receiver on. Returns `None` when the clock
    /// cannot produce the baud rate or the silences; the line then stays off.
    #[must_use]
    pub fn start(
        self,
        settings: LineSettings,
        times: LineTimes,
        rcc: &mut pac::RCC,
    ) -> Option<(Rs485, Rs485Timer)> {
        let clock = self.clock;
        let (timer, start_bit) = (self.timer, self.start_bit);
        let gap = Rs485Timer::new(timer, start_bit, settings, times, clock, rcc)?;
        let line = Rs485::new(settings, clock, rcc)?;
        Some((line, gap))
    }
}

/// Sets the board up. Interrupts must be disabled. The slots' lines still float, as after the reset.
///
/// `masked` is the value of BASEPRI while flash is erased or programmed: interrupts that it does not mask must run
/// from RAM.
#[must_use]
pub fn setup(device: pac::Peripherals, scb: &SCB, masked: u8) -> Board {
    vectors::move_to_ram(scb);
    let mut rcc = device.RCC;
    // Behind the loader, it has read and cleared the flags.
    let (reset_cause, development) = if SLOT.is_some() {
        kept::take_cause()
    } else {
        (take_reset_cause(&rcc), false)
    };
    let watchdog = Watchdog::start(device.IWDG, &device.DBGMCU);
    let (kept, powered_s) = kept::at_start(reset_cause & (WATCHDOG | POWER_ON) == WATCHDOG);
    let faults = kept.record();
    let crystal = faults.crystal_faults < CRYSTAL_FAULTS;
    let clock = clock::start(&rcc, &device.FLASH, crystal);

    set_up_ports(&mut rcc);

    // Configure the driver-enable pin first, so that nothing is sent on the bus.
    rs485::set_up_pins();

    let dip = kept.dip();
    let dip = dip.unwrap_or_else(|| switch(clock.core_mhz()));

    // PC13 must not be faster than 2 MHz nor drive more than 3 mA (DS5319 table 5, notes).
    let leds = array::from_fn(|led| {
        let off = if led + 1 == LEDS {
            IoPin::high
        } else {
            IoPin::low
        };
        off(BOARD.leds[led])
    });

    // Allow a debug probe to read the log while the core sleeps.
    device.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
    // It connects TIM1 to PA10 in its reset mapping, and ports to external interrupts.
    early::write_mapr(&mut rcc, &device.AFIO);
    pac::ADC1::enable(&mut rcc);
    if BOARD.has_slots() {
        pac::I2C1::enable(&mut rcc);
    }
    pac::PWR::enable(&mut rcc);

    Board {
        clock,
        reset_cause,
        faults,
        dip,
        as_255: kept::take_as_255(),
        chosen: kept.is_chosen(),
        development,
        saves_left: kept.saves(),
        powered_s,
        unique_id: unique_id::read(),
        sampler: Sampler::new(device.ADC1),
        dacs: DacBus::new(device.I2C1, clock),
        own_dac: OwnDac::new(device.DAC, &mut rcc),
        flash: Flash::new(device.FLASH, device.PWR, masked),
        crc: CrcUnit::new(device.CRC, &mut rcc),
        leds,
        recovery: RecoveryPins::new(reset_cause & POWER_ON != 0),
        scan_timer: ScanTimer::new(device.TIM4, clock, &mut rcc),
        watchdog,
        line: LineOff {
            timer: device.TIM2,
            start_bit: device.TIM1,
            clock,
        },
        second: SecondOff { clock },
        rcc,
    }
}

/// Turns the clocks of the ports on. Every pin floats, as after a reset of the chip, but those of SW01 are pulled up, and
/// those that the board holds stay as they are.
pub(crate) fn set_up_ports(rcc: &mut pac::RCC) {
    early::ports_on(rcc);
    early::float_pins(rcc);
    match BOARD.address {
        // One side of each switch is connected to ground.
        AddressPins::Switch(pins) => pins.iter().for_each(|pin| pin.pull_up()),
        AddressPins::Register(gesture) => gesture.pin().pull_up(),
    }
}

/// Reads SW01 and keeps it, with a core clock of `mhz` MHz. The ports must be set up. Without SW01 this is 0.
pub(crate) fn switch(mhz: u8) -> u8 {
    let dip = match BOARD.address {
        AddressPins::Switch(pins) => {
            cortex_m::asm::delay(DIP_SETTLE_CYCLES);
            let read = || dip::number(&pins, Pin::is_high);
            dip::stable(read, || wait::wait_us(DIP_POLL_US, mhz))
        }
        AddressPins::Register(_) => 0,
    };
    kept::keep_dip(dip);
    dip
}

/// Reads and clears the reset flags, so that the next start sees only its own flags. After a power-on clears the kept
/// region first; otherwise another reset in between would hide the power-on.
pub(crate) fn take_reset_cause(rcc: &pac::RCC) -> u8 {
    // The six most significant bits, from LPWRRSTF down to PINRSTF (RM0008 7.3.10).
    let cause = rcc.csr().read().bits().reverse_bits() as u8 & 0b11_1111;
    if cause & POWER_ON != 0 {
        kept::forget();
    }
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    cause
}
