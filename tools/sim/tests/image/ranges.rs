//! Every configuration register accepts the ends of its range and refuses the values just outside.
//!
//! The values are the rules of the register map, which firmware and documentation share. The tests of `register-map`
//! compare those rules with the contract.

use register_map::{
    Module, Rule, Values,
    configuration::{COMMAND, FORMAT, KEY, MODULE as MODULES, RESPONSE_DELAY, RULES, point_of},
    points::{Kind, PORTS},
};
use sim::Time;

use crate::LAYOUT;
use crate::bench::{Bench, SLOT};

/// Returns the values at the ends of a set, and the values just outside.
fn ends(values: Values) -> (Vec<u16>, Vec<u16>) {
    let inside: Vec<u16> = match values {
        Values::Range { min, max } => vec![min, max],
        Values::RangeOr { also, min, max } => vec![also, min, max],
        Values::OneOf(set) => set.to_vec(),
    };
    let beside = inside
        .iter()
        .flat_map(|v| [v.checked_sub(1), v.checked_add(1)]);
    let outside = beside.flatten().chain([0x7FFF, 0xFFFF]);
    let outside = outside.filter(|value| !values.allow(*value)).collect();
    (inside, outside)
}

/// Returns the registers of a rule to try: all if there are few, otherwise the first, the slot's and the last.
fn some(rule: &Rule) -> Vec<u16> {
    let slot = rule.first + SLOT;
    match point_of(rule.first) {
        Some(_) => vec![
            rule.first,
            slot,
            slot + 1,
            slot + 2,
            slot + 3,
            rule.end() - 1,
        ],
        None => rule.addresses().collect(),
    }
}

fn try_every_register(module: Module) {
    let mut bench = Bench::set_up(module, &[(0x0101, 1152)]);
    let mut tried = 0;
    for rule in RULES
        .iter()
        .filter(|rule| ![KEY, COMMAND].contains(&rule.first))
    {
        for address in some(rule) {
            // `module_choice` tests MODULE of a slot, which changes the values that other registers accept.
            let port = (address.wrapping_sub(MODULES) < PORTS).then(|| address - MODULES + 1);
            if port.is_some_and(|port| LAYOUT.board.has_slot(port)) {
                continue;
            }
            let kind = point_of(address)
                .and_then(|point| point.checked_sub(SLOT))
                .and_then(|channel| module.points().get(usize::from(channel)).copied())
                .unwrap_or(Kind::None);
            let (inside, outside) = ends(match port {
                // A port without a slot cannot have a module.
                Some(_) => Values::only(0),
                None => rule.values_for(kind),
            });
            let stored = bench.register(address);
            bench.unlock();
            // The response delay is in force immediately.
            let delayed = address == RESPONSE_DELAY;
            bench.patience = Time::from_ms(if delayed { 1_002 } else { 0 });
            for value in inside {
                // Seven data bits are only allowed in ASCII mode.
                let seven_bits = address == FORMAT && value > 3;
                let expected = if seven_bits { Err(3) } else { Ok(()) };
                let written = bench.write_single(6, address, value);
                assert_eq!(written, expected, "{address:#06x} <- {value}");
                if expected.is_ok() {
                    assert_eq!(bench.register(address), value, "{address:#06x}");
                }
                tried += 1;
            }
            let before = bench.register(address);
            for value in outside {
                assert_eq!(
                    bench.write_single(6, address, value),
                    Err(3),
                    "{address:#06x} <- {value}"
                );
                assert_eq!(
                    bench.write(address, &[value]),
                    Err(3),
                    "{address:#06x} <- {value}"
                );
            }
            assert_eq!(bench.register(address), before, "{address:#06x}");
            bench.write_single(6, address, stored).unwrap();
        }
    }
    assert!(tried > 100, "only {tried}");
    assert!(!bench.status(8), "all settings are restored");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn with_bit_outputs() {
    try_every_register(Module::Do4);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn with_bit_inputs() {
    try_every_register(Module::Di4);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn with_word_inputs_and_outputs() {
    try_every_register(Module::Ai2Ao2);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn key_and_command_accept_only_their_defined_values() {
    let mut bench = Bench::set_up(Module::Do4, &[]);
    bench.unlock();
    for value in [0, 1, 0x5A16, 0x5A18, 0x175A, 0xFFFF] {
        assert_eq!(bench.write_single(6, KEY, value), Err(3), "KEY {value:#x}");
    }
    for value in [0, 7, 0xB007, 0xFFFF] {
        assert_eq!(
            bench.write_single(6, COMMAND, value),
            Err(3),
            "COMMAND {value:#x}"
        );
    }
    assert_eq!(bench.register(COMMAND), 0);
    for value in [3, 4, 5, 6, 1] {
        bench.write_single(6, COMMAND, value).unwrap();
        bench.board.run_for(Time::from_ms(100));
        assert_eq!(bench.register(COMMAND), 0, "it reads 0");
    }
}
