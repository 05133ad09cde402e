//! The visible state of a board, as it is in JSON: LEDs, channels, line, log, radio.

use register_map::{Module, Row, configuration, update::Slot as FlashSlot};
use serde::Serialize;
use sim::Board;
use sim::radio::{self, Mode};
use sim::slot::Slot;
use utoipa::openapi::schema::{SchemaType, Type};
use utoipa::openapi::{ObjectBuilder, RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use super::faults::{Faults, HSI_HZ};
use super::scene::Scene;
use super::terminals::{self, Terminal};

/// The state of a board.
#[derive(Serialize, ToSchema)]
pub struct State {
    /// Virtual time since the start of the simulator, in ms.
    virtual_ms: u64,
    #[schema(schema_with = board_names)]
    board: &'static str,
    powered: bool,
    #[schema(maximum = 255)]
    dip: u8,
    /// Unit address in force: the DIP switch at the last power-on, or register UNIT. `null` without power, and for a
    /// position that is no address.
    #[schema(required, minimum = 1, maximum = 255)]
    address: Option<u8>,
    /// Slot of the flash whose image runs, `A` or `B`. `null` without power, in the loader, and for an image that runs
    /// without a loader.
    #[schema(required, schema_with = slot_names)]
    running_slot: Option<&'static str>,
    /// Module in the first slot.
    module: ModuleName,
    /// Module that the unit has stored for the first slot.
    configured: ModuleName,
    leds: Leds,
    /// The RS-485 driver is on.
    driver_enable: bool,
    line: Line,
    /// Channels of the first slot.
    #[schema(min_items = 4, max_items = 4)]
    channels: [Channel; 4],
    /// The last lines of the firmware's log.
    log_tail: Vec<String>,
    /// The slots, only of a board with several slots.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    slots: Vec<OneSlot>,
    /// The terminals in their order, only of a board with fixed inputs and outputs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    terminals: Vec<Terminal>,
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    radio: Option<Radio>,
}

/// The LEDs that are lit.
#[derive(Serialize, ToSchema)]
struct Leds {
    activity: bool,
    fault: bool,
    run: bool,
}

/// The line.
#[derive(Serialize, ToSchema)]
struct Line {
    baud: u32,
    #[schema(examples("8N2"))]
    format: &'static str,
    /// Number of frames to the unit.
    rx_frames: u64,
    /// Number of frames from the unit.
    tx_frames: u64,
}

/// A channel of a slot.
#[derive(Serialize, ToSchema)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Channel {
    /// The module does not have this channel.
    None,
    /// A digital input.
    Di { energised: bool },
    /// A digital output.
    Do { on: bool },
    /// A relay, with its jumper.
    Relay { energised: bool, manual: bool },
    /// An analog input, with the voltage at its pin in mV.
    Ai {
        #[schema(maximum = 3300)]
        millivolts: u16,
    },
    /// An analog output, with the code of the DAC.
    Ao {
        #[schema(maximum = 4095)]
        code: u16,
    },
}

impl From<sim::Channel> for Channel {
    fn from(channel: sim::Channel) -> Self {
        match channel {
            sim::Channel::None => Self::None,
            sim::Channel::Di { energised } => Self::Di { energised },
            sim::Channel::Do { on } => Self::Do { on },
            sim::Channel::Relay { energised, manual } => Self::Relay { energised, manual },
            sim::Channel::Ai { millivolts } => Self::Ai { millivolts },
            sim::Channel::Ao { code } => Self::Ao { code },
        }
    }
}

/// A slot of a board.
#[derive(Serialize, ToSchema)]
#[schema(as = Slot)]
struct OneSlot {
    #[schema(minimum = 1, maximum = 8)]
    port: u8,
    module: ModuleName,
    /// Module that the unit has stored for this slot.
    configured: ModuleName,
    #[schema(min_items = 4, max_items = 4)]
    channels: [Channel; 4],
}

/// The LoRa module, only if it is fitted (`--lora`).
#[derive(Serialize, ToSchema)]
struct Radio {
    /// `null` without power, during the start, and with a fault.
    #[schema(required, schema_with = mode_names)]
    mode: Option<&'static str>,
    /// The pin AUX is high: the module is idle.
    aux: bool,
    address: u16,
    /// Frequency of the channel in MHz.
    #[schema(minimum = 410, maximum = 441)]
    channel_mhz: u16,
    /// Bit rate on the air, in bit/s.
    air_rate: u32,
    /// Transmitting power in dBm.
    power_dbm: u8,
    packets_sent: u64,
    packets_received: u64,
}

/// A board on the line.
#[derive(Serialize, ToSchema)]
#[schema(as = Board)]
pub struct OneBoard {
    name: String,
    #[schema(schema_with = board_names)]
    board: &'static str,
    #[schema(maximum = 255)]
    dip: u8,
    /// Unit address in force: the DIP switch at the last power-on, or register UNIT. `null` without power, and for a
    /// position that is no address.
    #[schema(required, minimum = 1, maximum = 255)]
    address: Option<u8>,
    powered: bool,
    /// The fault LED is lit.
    fault: bool,
    /// Modules in the slots.
    modules: Vec<ModuleName>,
}

/// Name of a module.
#[derive(Serialize)]
pub struct ModuleName(&'static str);

impl From<Module> for ModuleName {
    fn from(module: Module) -> Self {
        Self(module.name())
    }
}

impl PartialSchema for ModuleName {
    fn schema() -> RefOr<Schema> {
        one_of(Module::ALL.map(Module::name))
    }
}

impl ToSchema for ModuleName {
    fn name() -> std::borrow::Cow<'static, str> {
        "Module".into()
    }
}

/// Names of the types of boards.
fn board_names() -> RefOr<Schema> {
    one_of(Row::ALL.map(|board| board.name))
}

/// Names of the modes of a LoRa module, or null.
fn mode_names() -> RefOr<Schema> {
    let modes = [Mode::Normal, Mode::WakeUp, Mode::PowerSaving, Mode::Sleep];
    one_of_or_null(modes.map(Mode::name))
}

/// Names of the slots of the flash, or null.
fn slot_names() -> RefOr<Schema> {
    one_of_or_null(["A", "B"])
}

/// Returns the schema of a text that is one of these, or of null.
fn one_of_or_null<const N: usize>(names: [&'static str; N]) -> RefOr<Schema> {
    ObjectBuilder::new()
        .schema_type(SchemaType::from_iter([Type::String, Type::Null]))
        .enum_values(Some(names.map(Some).into_iter().chain([None])))
        .into()
}

/// Returns the schema of a text that is one of these.
fn one_of<const N: usize>(names: [&'static str; N]) -> RefOr<Schema> {
    ObjectBuilder::new()
        .schema_type(Type::String)
        .enum_values(Some(names))
        .into()
}

/// Returns the state of board `n`.
pub fn of_board(scene: &mut Scene, n: usize) -> State {
    let line = scene.bus.line();
    let settings = line.settings();
    let (rx_frames, tx_frames) = line.frame_counts();
    let running_slot = scene.bus.board_mut(n).running_slot();
    let board = scene.bus.board(n);
    let leds = board.leds();
    let mut slots: Vec<_> = board
        .slots()
        .map(|(port, slot)| one_slot(board, port, slot))
        .collect();
    if slots.len() == 1 {
        slots.clear();
    }
    State {
        virtual_ms: board.now().as_ms(),
        board: board.layout().board.name,
        powered: board.powered(),
        dip: board.dip(),
        address: address(board),
        running_slot: running_slot.map(|slot| match slot {
            FlashSlot::A => "A",
            FlashSlot::B => "B",
        }),
        module: board.module().into(),
        configured: match board.layout().slots.first() {
            Some(slot) => configured(board, slot.port),
            None => Module::None.into(),
        },
        leds: Leds {
            activity: leds.activity,
            fault: leds.fault,
            run: leds.run,
        },
        driver_enable: board.driver_enable(),
        line: Line {
            baud: settings.baud,
            format: settings.format.name(),
            rx_frames,
            tx_frames,
        },
        channels: [1, 2, 3, 4].map(|number| board.channel(number).into()),
        log_tail: scene.units[n].log_tail().map(str::to_owned).collect(),
        slots,
        terminals: terminals::of_board(board),
        radio: board.radio().map(radio),
    }
}

/// Returns the faults in force on the line, in the air, and on board `n`.
pub fn faults(scene: &mut Scene, n: usize) -> Faults {
    let radio_loss = scene.bus.air().map(|air| air.loss());
    let line = &scene.disturbance;
    let board = scene.bus.board(n);
    let (hsi, lsi) = board.rc_oscillators();
    // Round, because the oscillators are set in whole hertz.
    let rounded = |value: f64| (value * 1000.0).round() / 1000.0;
    Faults {
        bit_error_rate: Some(line.bit_error_rate()),
        drop_rate: Some(line.drop_rate()),
        noise_hz: Some(line.noise_hz()),
        radio_loss,
        i2c_absent: Some(scene.units[n].i2c_absent),
        hse_failed: Some(!board.crystal()),
        hsi_percent: Some(rounded((f64::from(hsi) / HSI_HZ - 1.0) * 100.0)),
        lsi_khz: Some(rounded(f64::from(lsi) / 1000.0)),
    }
}

/// Returns the boards on the line.
pub fn boards(scene: &Scene) -> Vec<OneBoard> {
    let boards = scene.units.iter().zip(scene.bus.boards());
    boards
        .map(|(unit, board)| OneBoard {
            name: unit.name.clone(),
            board: board.layout().board.name,
            dip: board.dip(),
            address: address(board),
            powered: board.powered(),
            fault: board.leds().fault,
            modules: board
                .slots()
                .map(|(_, slot)| slot.module().into())
                .collect(),
        })
        .collect()
}

/// Returns the LoRa module of a board.
fn radio(module: &radio::Module) -> Radio {
    let parameters = module.parameters();
    Radio {
        mode: module.mode().map(Mode::name),
        aux: module.aux(),
        address: parameters.address(),
        channel_mhz: parameters.frequency_mhz(),
        air_rate: parameters.air_rate(),
        power_dbm: parameters.power_dbm(),
        packets_sent: module.packets_sent(),
        packets_received: module.packets_received(),
    }
}

/// Returns the unit address in force: that of the switch or, on a board without one, of register UNIT. `None` without
/// power, and if the switch had no valid position at power-on.
pub fn address(board: &Board) -> Option<u8> {
    let address = match board.layout().switch {
        [] => {
            let unit = board.layout().stored(board.flash(), configuration::UNIT);
            // 1 is the default.
            unit.map_or(1, |unit| unit as u8)
        }
        _ => board.dip_at_power_on(),
    };
    (board.powered() && matches!(address, 1..=247 | 255)).then_some(address)
}

/// Returns the module that the unit has stored for the slot at `port`.
fn configured(board: &Board, port: u8) -> ModuleName {
    board.layout().configured(board.flash(), port).into()
}

fn one_slot(board: &Board, port: u8, slot: &Slot) -> OneSlot {
    OneSlot {
        port,
        module: slot.module().into(),
        configured: configured(board, port),
        channels: channels(slot),
    }
}

fn channels(slot: &Slot) -> [Channel; 4] {
    [1, 2, 3, 4].map(|number| slot.channel(number).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_channel_has_its_json_form() {
        for (seen, expected) in [
            (sim::Channel::None, r#"{"kind":"none"}"#),
            (
                sim::Channel::Di { energised: true },
                r#"{"energised":true,"kind":"di"}"#,
            ),
            (
                sim::Channel::Do { on: false },
                r#"{"kind":"do","on":false}"#,
            ),
            (
                sim::Channel::Relay {
                    energised: true,
                    manual: false,
                },
                r#"{"energised":true,"kind":"relay","manual":false}"#,
            ),
            (
                sim::Channel::Ai { millivolts: 3300 },
                r#"{"kind":"ai","millivolts":3300}"#,
            ),
            (
                sim::Channel::Ao { code: 4095 },
                r#"{"code":4095,"kind":"ao"}"#,
            ),
        ] {
            assert_eq!(
                serde_json::to_value(Channel::from(seen))
                    .unwrap()
                    .to_string(),
                expected
            );
        }
    }
}
