//! The visible state of a board as JSON: LEDs, channels, line, log, radio.

use serde_json::{Value, json};
use sim::radio::{Mode, Module};
use sim::slot::Slot;
use sim::{Board, Channel};

use super::bench::Bench;
use super::faults::HSI_HZ;

/// The body of `GET /api/state` of board `n`.
pub fn json(bench: &mut Bench, n: usize) -> Value {
    let line = bench.bus.line();
    let settings = line.settings();
    let (to_unit, from_unit) = line.frame_counts();
    let board = bench.bus.board(n);
    let leds = board.leds();
    let mut state = json!({
        "virtual_ms": board.now().as_ms(),
        "board": board.layout().board.name,
        "powered": board.powered(),
        "dip": board.dip(),
        "address": address(board),
        "module": board.module().name(),
        "configured": configured(board, board.layout().slots[0].port),
        "leds": { "activity": leds.activity, "fault": leds.fault, "run": leds.run },
        "driver_enable": board.driver_enable(),
        "line": {
            "baud": settings.baud,
            "format": settings.format.name(),
            "rx_frames": to_unit,
            "tx_frames": from_unit,
        },
        "channels": channels(board.slot()),
        "log_tail": bench.units[n].log_tail().collect::<Vec<_>>(),
    });
    if board.slots().count() > 1 {
        state["slots"] = board
            .slots()
            .map(|(port, slot)| one_slot(board, port, slot))
            .collect();
    }
    if let Some(module) = board.radio() {
        state["radio"] = radio(module);
    }
    state
}

/// The body of `GET /api/faults`: the faults in force on the line, in the air, and on board `n`.
pub fn faults(bench: &mut Bench, n: usize) -> Value {
    let loss = bench.bus.air().map(|air| air.loss());
    let line = &bench.disturbance;
    let board = bench.bus.board(n);
    let (hsi, lsi) = board.rc_oscillators();
    // Round, because the oscillators are set in whole hertz.
    let rounded = |value: f64| (value * 1000.0).round() / 1000.0;
    let mut faults = json!({
        "bit_error_rate": line.bit_error_rate(),
        "drop_rate": line.drop_rate(),
        "noise_hz": line.noise_hz(),
        "i2c_absent": bench.units[n].i2c_absent,
        "hse_failed": !board.crystal(),
        "hsi_percent": rounded((f64::from(hsi) / HSI_HZ - 1.0) * 100.0),
        "lsi_khz": rounded(f64::from(lsi) / 1000.0),
    });
    if let Some(loss) = loss {
        faults["radio_loss"] = loss.into();
    }
    faults
}

/// The LoRa module of a board.
fn radio(module: &Module) -> Value {
    let parameters = module.parameters();
    json!({
        "mode": module.mode().map(Mode::name),
        "aux": module.aux(),
        "address": parameters.address(),
        "channel_mhz": parameters.frequency_mhz(),
        "air_rate": parameters.air_rate(),
        "power_dbm": parameters.power_dbm(),
        "packets_sent": module.packets_sent(),
        "packets_received": module.packets_received(),
    })
}

/// The unit address in force; `None` without power, and if the switch had no valid position at power-on.
pub fn address(board: &Board) -> Option<u8> {
    let dip = board.dip_at_power_on();
    (board.powered() && matches!(dip, 1..=247 | 255)).then_some(dip)
}

/// Name of the module that the unit has stored for the slot at `port`.
fn configured(board: &Board, port: u8) -> &'static str {
    board.layout().configured(board.flash(), port).name()
}

fn one_slot(board: &Board, port: u8, slot: &Slot) -> Value {
    json!({
        "port": port,
        "module": slot.module().name(),
        "configured": configured(board, port),
        "channels": channels(slot),
    })
}

fn channels(slot: &Slot) -> [Value; 4] {
    [1, 2, 3, 4].map(|number| channel(slot.channel(number)))
}

fn channel(channel: Channel) -> Value {
    match channel {
        Channel::None => json!({ "kind": "none" }),
        Channel::Di { energised } => json!({ "kind": "di", "energised": energised }),
        Channel::Do { on } => json!({ "kind": "do", "on": on }),
        Channel::Relay { energised, manual } => {
            json!({ "kind": "relay", "energised": energised, "manual": manual })
        }
        Channel::Ai { millivolts } => json!({ "kind": "ai", "millivolts": millivolts }),
        Channel::Ao { code } => json!({ "kind": "ao", "code": code }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_channel_has_its_json_form() {
        for (seen, expected) in [
            (Channel::None, r#"{"kind":"none"}"#),
            (
                Channel::Di { energised: true },
                r#"{"energised":true,"kind":"di"}"#,
            ),
            (Channel::Do { on: false }, r#"{"kind":"do","on":false}"#),
            (
                Channel::Relay {
                    energised: true,
                    manual: false,
                },
                r#"{"energised":true,"kind":"relay","manual":false}"#,
            ),
            (
                Channel::Ai { millivolts: 3300 },
                r#"{"kind":"ai","millivolts":3300}"#,
            ),
            (Channel::Ao { code: 4095 }, r#"{"code":4095,"kind":"ao"}"#),
        ] {
            assert_eq!(channel(seen).to_string(), expected);
        }
    }
}
