//! Descriptions of the units in crate register-map.

use register_map::points::{self, Kind};
use register_map::state::MAP_VERSION_VALUE;
use register_map::{Access, FixedPort, InForce, Module, Row, Rule, Text, configuration, state};

use crate::{
    Description, Field, ModuleType, Narrower, PointKind, Port, Reading, Register, Scope, Table,
    Unit, Value, Values,
};

/// The kinds of point in the order of [`Description::kinds`].
const KINDS: [Kind; 5] = [
    Kind::None,
    Kind::BitInput,
    Kind::BitOutput,
    Kind::WordInput,
    Kind::WordOutput,
];

/// Describes a unit of this board with firmware of this version. `module` returns the module in force at a port, 1
/// to 8.
pub fn describe(board: &Row, firmware: &str, module: impl Fn(u16) -> Module) -> Description {
    Description {
        board: board.name.to_owned(),
        model: board.model.to_owned(),
        firmware: firmware.to_owned(),
        map_version: MAP_VERSION_VALUE,
        registers: board
            .registers()
            .map(|(rule, text)| register(board, rule, text))
            .collect(),
        kinds: KINDS.map(kind).into(),
        modules: Module::ALL.map(module_type).into(),
        ports: board
            .ports()
            .map(|number| Port {
                number: number as u8,
                module: module(number).code(),
                lacks: board.fixed(number).map_or(0, FixedPort::lacks),
            })
            .collect(),
    }
}

fn register(board: &Row, rule: &Rule, text: &Text) -> Register {
    Register {
        address: rule.first,
        count: rule.count,
        name: text.name.to_owned(),
        scope: match text.scope(rule.count) {
            register_map::Scope::Unit => Scope::Unit,
            register_map::Scope::Port => Scope::Port,
            register_map::Scope::Point => Scope::Point,
        },
        value: match rule.first {
            // Names of other boards would only take room in flash.
            state::BOARD => Value::Codes(vec![(board.code, board.name.to_owned())]),
            _ => value(text.value),
        },
        writable: match rule.first {
            configuration::MODULE => board.ports().any(|port| board.chooses(port)),
            configuration::RANGE => board.fixed.is_empty(),
            _ => rule.access != Access::ReadOnly,
        },
        restart: rule.in_force == InForce::Restart,
        values: values(rule.values),
        default: rule.default,
        narrower: rule.narrower.map(|narrower| Narrower {
            kind: place(narrower.kind),
            values: values(narrower.values),
            default: narrower.default,
            value: text.narrower.map(value),
        }),
        about: text.about.trim().to_owned(),
    }
}

fn value(value: register_map::Value) -> Value {
    match value {
        register_map::Value::Number(of) => Value::Number(unit(of)),
        register_map::Value::Long(of) => Value::Long(unit(of)),
        register_map::Value::Codes(names) => Value::Codes(owned(names)),
        register_map::Value::Bits(names) => Value::Bits(owned(names)),
        register_map::Value::Opaque => Value::Opaque,
        register_map::Value::Point => Value::Point,
        register_map::Value::Fields(kind, fields) => Value::Fields {
            kind: place(kind),
            fields: fields.iter().map(field).collect(),
        },
    }
}

fn field(field: &register_map::Field) -> Field {
    Field {
        name: field.name.to_owned(),
        value: value(field.value),
        values: values(field.values),
        default: field.default,
    }
}

fn owned<T: Copy>(names: &[(T, &str)]) -> Vec<(T, String)> {
    let names = names.iter().map(|(code, name)| (*code, (*name).to_owned()));
    names.collect()
}

fn unit(unit: register_map::Unit) -> Unit {
    Unit {
        code: unit.code.to_owned(),
        exponent: unit.exponent,
        offset: unit.offset,
    }
}

fn values(values: register_map::Values) -> Values {
    match values {
        register_map::Values::Range { min, max } => Values::Range(min, max),
        register_map::Values::RangeOr { also, min, max } => Values::RangeOr(also, min, max),
        register_map::Values::OneOf(values) => Values::OneOf(values.to_vec()),
    }
}

fn place(kind: Kind) -> u8 {
    let place = KINDS.iter().position(|known| *known == kind);
    place.map_or(0, |place| place as u8)
}

fn kind(kind: Kind) -> PointKind {
    let (name, table, writable) = match kind {
        Kind::None => ("none", None, false),
        Kind::BitInput => ("digital input", Some(Table::Bit), false),
        Kind::BitOutput => ("digital output", Some(Table::Bit), true),
        Kind::WordInput => ("analog input", Some(Table::Word), false),
        Kind::WordOutput => ("analog output", Some(Table::Word), true),
    };
    PointKind {
        name: name.to_owned(),
        table,
        writable,
        readings: points::readings(kind).iter().map(reading).collect(),
    }
}

fn reading(reading: &points::Reading) -> Reading {
    Reading {
        range: reading.signal.code(),
        scale: reading.scale.code(),
        unit: unit(reading.unit),
        min: reading.min,
        max: reading.max,
    }
}

fn module_type(module: Module) -> ModuleType {
    ModuleType {
        code: module.code(),
        name: module.name().to_owned(),
        points: module.points().map(place),
    }
}

#[cfg(test)]
mod tests {
    use register_map::board::{MODIO_02, MODIO_08};

    use super::*;

    #[test]
    fn a_description_has_every_register_with_its_scope() {
        let unit = describe(&MODIO_08, "0.1.0", |_| Module::Ai4);
        let of = |name: &str| unit.registers.iter().find(|r| r.name == name).unwrap();
        assert_eq!(of("BAUD").scope, Scope::Unit);
        assert_eq!(of("MODULE").scope, Scope::Port);
        assert_eq!(of("FILTER").scope, Scope::Point);
        assert_eq!(of("pulses").scope, Scope::Point);
        assert_eq!(of("link").scope, Scope::Point);
        assert_eq!(of("product code").scope, Scope::Unit);
        assert_eq!(of("unique device identity").scope, Scope::Unit);
        assert_eq!(of("FILTER").narrower.as_ref().unwrap().kind, 3);
        assert!(unit.registers.is_sorted_by_key(|r| r.address));
        let unit = describe(&MODIO_02, "0.1.0", |_| Module::Ai4);
        assert!(unit.registers.iter().all(|r| r.name != "link"));
        assert_eq!(
            unit.ports,
            [Port {
                number: 5,
                module: 4,
                lacks: 0,
            }]
        );
    }

    #[test]
    fn an_analog_input_has_a_reading_for_each_range_and_scale() {
        let unit = describe(&MODIO_02, "0.1.0", |_| Module::Ai4);
        let [first, ..] = unit.modules[4].points;
        let kind = &unit.kinds[usize::from(first)];
        assert_eq!(kind.name, "analog input");
        let ntc = kind
            .readings
            .iter()
            .find(|r| (r.range, r.scale) == (2, 1))
            .unwrap();
        assert_eq!(
            (ntc.min, ntc.max, &*ntc.unit.code, ntc.unit.exponent),
            (-400, 1250, "Cel", -1)
        );
        assert_eq!(kind.readings.len(), 6);
    }
}
