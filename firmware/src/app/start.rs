//! Start-up: creates everything that the tasks need from the board and the stored configuration.

use core::mem::MaybeUninit;

use board_support::{
    Flash, SLOT, ScanTimer, SecondUart, Watchdog, board, boards::SLOTS, flash::FlashError, kept,
    pac, stack::LowWater,
};
use cortex_m::peripheral::SCB;
use firmware::{
    config::{Config, LineConfig, RadioConfig},
    device::Identity,
    kept_outputs::KeptOutputs,
    leds::{Leds, Trouble},
    line::Addresses,
    start_up::{self, Address, RECOVERY_UNIT},
    store::{Store, WriteError},
};
use modbus_server::{Adu, fast};
use modio_drivers::DacLink;
use register_map::{
    codes::Mode,
    configuration::UNIT,
    state::{build as build_bits, reset_cause::POWER_ON},
    update::{DEVELOPMENT_KEY, Header},
};

use crate::{
    background::Background,
    board::{BOARD, Device, Events},
    fault_record,
    installed::install,
    line_setup::{Frames, Line},
    log::{self, Log},
    persistence::Persistence,
    scanning::Scanning,
    second::{self, AtSocket, Second, Socket},
    serving::Serving,
    updating::Updating,
};

/// The highest priority of a task whose code is in flash.
const SERVE_PRIORITY: u8 = 3;

/// The result of the start-up.
pub struct Started {
    pub line: Option<Line>,
    pub second: Option<Second>,
    pub second_uart: Option<SecondUart>,
    pub serving: Serving,
    pub device: &'static mut Device,
    pub scanning: Scanning,
    pub dacs: [DacLink; SLOTS],
    pub background: Background,
    pub scan_timer: ScanTimer,
    pub watchdog: Watchdog,
}

/// The memory for what is too large to be moved over the stack, or is shared with interrupts.
pub struct Memory {
    pub device: &'static mut MaybeUninit<Device>,
    pub adus: &'static mut [Adu],
    pub second_adus: &'static mut [Adu],
}

/// Starts everything. The outputs come first: they are set to START as soon as the configuration is known. The line
/// is enabled last, when everything that serves it is ready.
pub fn up(
    device: pac::Peripherals,
    scb: &SCB,
    Memory {
        device: place,
        adus,
        second_adus,
    }: Memory,
) -> Started {
    let mut log = Log::new();
    let masked = rtic::export::cortex_logical2hw(SERVE_PRIORITY, pac::NVIC_PRIO_BITS);
    let mut board = board::setup(device, scb, masked);
    let mut pages = board.flash;
    let mut store = Store::open(&pages);
    let loaded = store.load(&pages);
    let number = if board.as_255 {
        RECOVERY_UNIT
    } else if BOARD.switch || board.dip == RECOVERY_UNIT {
        board.dip
    } else {
        loaded.settings.get(UNIT) as u8
    };
    let address = Address::from_dip(number, SLOT.is_some());
    let settings = start_up::line(address, LineConfig::of(&loaded.settings));
    let radio_config = RadioConfig::of(&loaded.settings);
    let mut config = Config::new(loaded.settings, loaded.is_invalid());
    config.set_saves_left(board.saves_left);
    let points_only = config.air_serves_points_only();
    // A radio does not serve recovery, whose address is the same for all units.
    let radio_config = radio_config.filter(|_| matches!(address, Address::Unit(_)));

    let mut sampler = board.sampler;
    let (modules, analog_outputs) =
        install(config.modules(), &mut sampler, board.dacs, board.own_dac);
    let serial_number = if BOARD.events {
        start_up::serial_number(board.unique_id, config.serial_low())
    } else {
        0
    };
    let is_fast = settings.mode == Mode::Rtu && BOARD.events;
    let identity = Identity {
        serial_number,
        reports_events: is_fast && matches!(address, Address::Unit(_)),
        unit: address.unit().unwrap_or_default(),
        reset_cause: board.reset_cause,
        unique_id: board.unique_id,
        fault: fault_record::words(&board.faults),
        internal_oscillator: !board.clock.is_crystal(),
        build: build(board.development),
    };
    let device = Device::new_in(place, config, identity);
    let kept = kept_outputs();
    let stored = if BOARD.keeps_outputs {
        store.outputs(&pages)
    } else {
        None
    };
    device.start_outputs(kept.as_ref(), stored.as_ref());
    let updating = Updating::new(&mut pages, board.crc);
    device.update = updating.update(&mut pages, board.chosen);
    for (slot, port) in device.points.ports_mut().iter_mut().enumerate() {
        port.set_pulses(kept::pulses(slot));
    }
    let mut dacs = [DacLink::default(); SLOTS];
    let scanning = Scanning::new(modules, sampler, device, &mut dacs, board.powered_s);

    log.start(&log::Start {
        address,
        dip: board.dip,
        line: settings,
        modules: device.config.modules(),
        clock: board.clock,
        reset_cause: board.reset_cause,
        faults: board.faults,
        config_invalid: loaded.invalid,
    });
    // This may erase pages. The line is not served yet.
    let prepared = store.prepare(&mut pages);
    match prepared {
        Ok(()) => {}
        Err(WriteError::Flash(FlashError::NotNow)) => log.event(log::Event::LowSupply),
        Err(_) => log.event(log::Event::SaveFailed),
    }
    // An erase that failed here is done by the background task, as after a change of pages.
    let erase = prepared.is_err() && !store.has_spare();

    let frames = Frames::of(&settings);
    let line = Events::units(address.unit(), is_fast)
        .and_then(|units| frames.start(board.line, &mut board.rcc, units, adus));

    let second = second::Start {
        line: board.second,
        radio: radio_config,
        unit: address.unit(),
        power_on: u16::from(board.reset_cause) & POWER_ON != 0,
        adus: second_adus,
    };
    let (second, second_uart) = Socket::start(second, &mut board.rcc).unzip();

    Started {
        line,
        second,
        second_uart,
        serving: Serving::new(
            identity.unit,
            BOARD.events.then(|| {
                let part = start_up::part(address, board.clock.is_crystal());
                fast::Unit::new(serial_number, identity.unit, part)
            }),
            (frames.framing, frames.t35_ns.div_ceil(1_000_000)),
            points_only,
        ),
        device,
        scanning,
        dacs,
        background: Background {
            analog_outputs,
            persistence: Persistence::new(store, pages, erase),
            updating,
            leds: Leds::new(
                board.leds,
                Trouble::at_start(address, board.clock.is_crystal()),
            ),
            recovery: board.recovery,
            log,
            stack: LowWater::default(),
            radio: None,
        },
        scan_timer: board.scan_timer,
        watchdog: board.watchdog,
    }
}

/// Returns the bits of the register BUILD that depend on loader and slot. `trusted`: the loader trusts the development
/// key.
fn build(trusted: bool) -> u16 {
    let Some(slot) = Flash::running_slot() else {
        return build_bits::NO_LOADER;
    };
    let signed = Header::of(slot).is_ok_and(|header| header.key() == DEVELOPMENT_KEY);
    let bit = |mask, set| if set { mask } else { 0 };
    bit(build_bits::DEVELOPMENT_SIGNED, signed) | bit(build_bits::DEVELOPMENT_TRUSTED, trusted)
}

/// Returns what a reset has kept of the outputs.
fn kept_outputs() -> Option<KeptOutputs> {
    if !BOARD.has_links() {
        return None;
    }
    let (values, modules, held, at_safe) = kept::outputs()?;
    Some(KeptOutputs {
        values,
        modules,
        held,
        at_safe,
    })
}
