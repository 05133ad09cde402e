//! Names of points and registers: `p5.1`, `p5.1.filter`, `p5.module`, `BAUD`, or an address.

use modio_description::{
    Description, ModuleType, PointKind, Reading, Register, Scope, Table, Unit, Value, Values,
};

use register_map::Row;
use register_map::configuration::MODULE;
use register_map::points::{CHANNELS, COUNT, PORTS};
use register_map::stage::MAX_ON;

use crate::failure::Failure;

/// An item that can be read: a point, a register, or an address without known meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Name of the item.
    pub name: String,
    /// Table of the item: bits or words.
    pub table: Table,
    /// Address, counted from 0.
    pub address: u16,
    /// Number of registers; 1 for a bit.
    pub words: u16,
    /// Meaning of its number.
    pub meaning: Meaning,
    /// Whether it can be written.
    pub writable: bool,
    /// Whether it is a setting, which the lock protects.
    pub setting: bool,
    /// Whether a written value takes effect only after a restart.
    pub restart: bool,
    /// Allowed values; `None` when they are not known.
    pub values: Option<Values>,
    /// Factory default of a setting.
    pub default: u16,
    /// Description in one line.
    pub about: String,
}

impl Item {
    /// Returns whether a value is allowed. Every value is when the allowed ones are not known.
    pub fn allows(&self, word: u16) -> bool {
        match &self.values {
            None => true,
            Some(Values::Range(min, max)) => (*min..=*max).contains(&word),
            Some(Values::RangeOr(also, min, max)) => word == *also || (*min..=*max).contains(&word),
            Some(Values::OneOf(values)) => values.contains(&word),
        }
    }

    /// Returns the unit of its number, without a name where it has none.
    pub fn unit(&self) -> Unit {
        match &self.meaning {
            Meaning::Analog(reading) => reading.unit.clone(),
            Meaning::Value(Value::Number(unit) | Value::Long(unit)) => unit.clone(),
            _ => Unit::default(),
        }
    }
}

/// Meaning of an item's number.
#[derive(Clone, Debug, PartialEq)]
pub enum Meaning {
    /// On or off.
    Bit,
    /// As the description says for the register.
    Value(Value),
    /// An analog point, with the meaning that its RANGE and SCALE select.
    Analog(Reading),
    /// MAX_ON: 0, or a time in tenths of a second or in minutes.
    LongestOn,
    /// The meaning is not known.
    Unknown,
}

/// A port with a slot, and the points of its module.
#[derive(Clone, Debug, PartialEq)]
pub struct PortItems {
    /// Number of the port, 1 to 8.
    pub number: u8,
    /// Code of the module in force.
    pub code: u16,
    /// Name of the module in force, `unknown` for a code without a name.
    pub module: String,
    /// Points of the port, in ascending order of the channels.
    pub points: Vec<Item>,
}

/// The names of a unit.
#[derive(Clone, Debug, Default)]
pub struct Book {
    description: Option<Description>,
    items: Vec<Item>,
}

impl Book {
    /// Creates the names of a unit. `readings` contains RANGE and SCALE of every point.
    pub fn new(description: Description, readings: Vec<(u16, u16)>) -> Self {
        let mut items = points(&description, &readings);
        for register in &description.registers {
            items.extend(registers(&description, register));
        }
        Self {
            description: Some(description),
            items,
        }
    }

    /// Returns the unit's description; `None` for a unit that is not a modio.
    pub const fn description(&self) -> Option<&Description> {
        self.description.as_ref()
    }

    /// Returns all items: the points, then the registers in the order of their addresses.
    pub fn items(&self) -> &[Item] {
        &self.items
    }

    /// Returns the item with exactly this name.
    pub fn item(&self, name: &str) -> Option<&Item> {
        self.items.iter().find(|item| item.name == name)
    }

    /// Returns the description of a unit that must be a modio.
    pub fn of_modio(&self) -> Result<&Description, Failure> {
        self.description().ok_or_else(|| {
            Failure::Refused(
                "the unit is not a modio; for other units use `read` and `write` with addresses"
                    .to_owned(),
            )
        })
    }

    /// Iterates over the points.
    pub fn points(&self) -> impl Iterator<Item = &Item> {
        let known = |item: &&Item| matches!(item.meaning, Meaning::Bit | Meaning::Analog(_));
        self.items.iter().filter(known)
    }

    /// Returns the ports with a slot and their points, including points whose values have no known meaning.
    pub fn ports(&self) -> Vec<PortItems> {
        let Some(description) = &self.description else {
            return Vec::new();
        };
        let port = |port: &modio_description::Port| {
            let names: Vec<_> = (1..=CHANNELS)
                .map(|channel| format!("p{}.{channel}", port.number))
                .collect();
            let points = self.items.iter().filter(|item| names.contains(&item.name));
            PortItems {
                number: port.number,
                code: port.module,
                module: module_name(description, port.module).to_owned(),
                points: points.cloned().collect(),
            }
        };
        description.ports.iter().map(port).collect()
    }

    /// Iterates over the settings, which are the content of a configuration file.
    pub fn settings(&self) -> impl Iterator<Item = &Item> {
        self.items.iter().filter(|item| item.setting)
    }

    /// Returns the item with this name or address. The error contains similar names.
    pub fn find(&self, name: &str) -> Result<Item, Failure> {
        let wanted = slug(name);
        if let Some(item) = self.items.iter().find(|item| slug(&item.name) == wanted) {
            return Ok(item.clone());
        }
        if let Some(address) = number_of(name) {
            // The first item that contains the address, if it begins there.
            let before = |item: &Item| address.checked_sub(item.address);
            let has = |item: &&Item| before(item).is_some_and(|n| n < item.words);
            let known = self.items.iter().find(has);
            let known = known.filter(|item| item.address == address);
            return Ok(known.cloned().unwrap_or_else(|| unknown(address)));
        }
        Err(Failure::usage(self.no_such(name, &wanted)))
    }

    /// Returns the items with these names or addresses.
    pub fn find_all(&self, names: &[String]) -> Result<Vec<Item>, Failure> {
        names.iter().map(|name| self.find(name)).collect()
    }

    /// Returns whether this is the name of a time of a digital output, and the unit has no such times.
    pub fn lacks_stage(&self, name: &str) -> bool {
        let is_time = matches!(
            slug(name).rsplit_once('.'),
            Some((_, "dead_time" | "max_on" | "min_off"))
        );
        let has = |of: &Description| of.registers.iter().any(|r| r.name == "DEAD_TIME");
        is_time && self.description.as_ref().is_some_and(|of| !has(of))
    }

    fn no_such(&self, name: &str, wanted: &str) -> String {
        if self.lacks_stage(name) {
            return format!(
                "{name}: this unit has no DEAD_TIME, MAX_ON and MIN_OFF: only some boards have them, such as a modio-08, and only with firmware that supports them"
            );
        }
        if self.items.is_empty() {
            return format!(
                "{name}: the names of this unit are not known; give an address such as 0x0010"
            );
        }
        let mut near: Vec<_> = self.items.iter().map(|item| item.name.as_str()).collect();
        near.sort_by_cached_key(|name| strsim::damerau_levenshtein(&slug(name), wanted));
        near.truncate(4);
        format!(
            "{name}: no such point or register; similar names: {}; `modioctl describe` lists all",
            near.join(", ")
        )
    }
}

/// Returns a name in the form in which names are compared. `5.1` is `p5.1`.
fn slug(name: &str) -> String {
    let name = name.trim().to_lowercase().replace([' ', '-'], "_");
    match name.split_once('.') {
        Some((port, _)) if port.parse::<u8>().is_ok() => format!("p{name}"),
        _ => name,
    }
}

/// Parses a number from 0 to 65535, decimal or hexadecimal.
pub fn number_of(text: &str) -> Option<u16> {
    // The functions of the standard library also accept a sign.
    if text.contains(['+', '-']) {
        return None;
    }
    match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => u16::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

/// Returns the number of a port: `p5` or `5`.
pub fn port_number(text: &str) -> Option<u8> {
    text.strip_prefix(['p', 'P']).unwrap_or(text).parse().ok()
}

/// Returns the port in a name such as `p5.1.filter` or `5.module`.
pub fn port_of(name: &str) -> Option<u8> {
    port_number(name.trim().split_once('.')?.0)
}

/// Returns the module with this code.
fn module(description: &Description, code: u16) -> Option<&ModuleType> {
    let mut modules = description.modules.iter();
    modules.find(|module| module.code == code)
}

/// Returns the name of the module with this code; `unknown` for a code without a name.
pub fn module_name(description: &Description, code: u16) -> &str {
    module(description, code).map_or("unknown", |module| &module.name)
}

/// Lists the ports with a slot, for people.
pub fn slots(description: &Description) -> String {
    let ports = description.ports.iter();
    let ports: Vec<_> = ports.map(|port| port.number.to_string()).collect();
    ports.join(", ")
}

fn unknown(address: u16) -> Item {
    Item {
        name: format!("{address:#06X}"),
        table: Table::Word,
        address,
        words: 1,
        meaning: Meaning::Unknown,
        writable: true,
        setting: false,
        restart: false,
        values: None,
        default: 0,
        about: String::new(),
    }
}

/// Iterates over the points of all ports with a slot: port, channel and kind of point, in order.
fn kinds(description: &Description) -> impl Iterator<Item = (u16, u16, &PointKind)> {
    description.ports.iter().flat_map(move |port| {
        let points = module(description, port.module).map_or([0; 4], |module| module.points);
        let channels = 1..=CHANNELS.saturating_sub(port.lacks.into());
        channels.zip(points).filter_map(move |(channel, kind)| {
            let kind = description.kinds.get(usize::from(kind))?;
            Some((u16::from(port.number), channel, kind))
        })
    })
}

fn point(port: u16, channel: u16) -> u16 {
    (port.max(1) - 1) * CHANNELS + channel - 1
}

fn points(description: &Description, readings: &[(u16, u16)]) -> Vec<Item> {
    let mut items = Vec::new();
    for (port, channel, kind) in kinds(description) {
        let Some(table) = kind.table else { continue };
        let address = point(port, channel);
        let reading = readings
            .get(usize::from(address))
            .and_then(|(range, scale)| {
                let suits = |reading: &&Reading| reading.range == *range && reading.scale == *scale;
                kind.readings.iter().find(suits)
            });
        items.push(Item {
            name: format!("p{port}.{channel}"),
            table,
            meaning: match (table, reading) {
                (Table::Bit, _) => Meaning::Bit,
                (Table::Word, Some(reading)) => Meaning::Analog(reading.clone()),
                (Table::Word, None) => Meaning::Unknown,
            },
            writable: kind.writable,
            about: kind.name.clone(),
            ..unknown(address)
        });
    }
    items
}

/// Returns the items of a register or a run of registers.
fn registers(description: &Description, register: &Register) -> Vec<Item> {
    let each = match (&register.value, register.scope) {
        (Value::Opaque, Scope::Unit) => register.count,
        (value, _) => value.registers(),
    };
    let item = |name: String, index: u16| Item {
        name,
        table: Table::Word,
        address: register.address.wrapping_add(index.wrapping_mul(each)),
        words: each,
        meaning: match (register.address, &*register.name) {
            (MAX_ON, "MAX_ON") => Meaning::LongestOn,
            _ => Meaning::Value(register.value.clone()),
        },
        writable: register.writable,
        setting: register.writable && is_setting(register),
        restart: register.restart,
        values: register.writable.then(|| register.values.clone()),
        default: register.default,
        about: register.about.clone(),
    };
    let name = slug(&register.name);
    match register.scope {
        Scope::Unit if register.count <= each => vec![item(register.name.clone(), 0)],
        Scope::Unit => (0..register.count / each)
            .map(|index| item(format!("{name}.{}", index + 1), index))
            .collect(),
        Scope::Port => {
            let ports = description.ports.iter().map(|port| u16::from(port.number));
            let board = Row::named(&description.board);
            ports
                .map(|port| {
                    let mut item = item(format!("p{port}.{name}"), port.max(1) - 1);
                    if is_module(&item) && board.is_some_and(|board| !board.chooses(port)) {
                        (item.writable, item.setting, item.values) = (false, false, None);
                    }
                    item
                })
                .collect()
        }
        Scope::Point => points_of(description, register)
            .map(|(port, channel, kind, row)| {
                let number = row.map(|row| (row + 1).to_string()).unwrap_or_default();
                let name = format!("p{port}.{channel}.{name}{number}");
                let index = row.unwrap_or_default() * COUNT + point(port, channel);
                let mut item = item(name, index);
                let narrower = register.narrower.as_ref().filter(|narrower| {
                    description.kinds.get(usize::from(narrower.kind)) == Some(kind)
                });
                if let Some(narrower) = narrower {
                    item.values = Some(narrower.values.clone());
                    item.default = narrower.default;
                    if let Some(value) = &narrower.value {
                        item.meaning = Meaning::Value(value.clone());
                    }
                }
                item
            })
            .collect(),
    }
}

/// Iterates over the points of the values of a run: port, channel and kind of point, and the row of the value, if a point has
/// several.
fn points_of<'a>(
    description: &'a Description,
    register: &'a Register,
) -> impl Iterator<Item = (u16, u16, &'a PointKind, Option<u16>)> {
    let rows = register.count / register.value.registers().saturating_mul(COUNT).max(1);
    let of_kind = match &register.value {
        Value::Fields { kind, .. } => description.kinds.get(usize::from(*kind)),
        _ => None,
    };
    let points = kinds(description).filter(move |(.., kind)| of_kind.is_none_or(|of| of == *kind));
    points.flat_map(move |(port, channel, kind)| {
        let rows = (0..rows.max(1)).map(move |row| (rows > 1).then_some(row));
        rows.map(move |row| (port, channel, kind, row))
    })
}

/// Returns whether an item is MODULE of a port.
pub fn is_module(item: &Item) -> bool {
    (MODULE..MODULE + PORTS).contains(&item.address)
}

/// Returns whether a writable register is a setting, and not the lock, a command, a heartbeat or a counter.
fn is_setting(register: &Register) -> bool {
    !matches!(register.name.as_str(), "KEY" | "COMMAND" | "HEARTBEAT")
        && !matches!(register.value, Value::Long(_))
}

/// Returns the names of a unit with this module in every slot, and with this RANGE and SCALE of every point.
#[cfg(test)]
pub fn book(board: &register_map::Row, module: register_map::Module, reading: (u16, u16)) -> Book {
    let description = modio_description::describe(board, "0.1.0", |_| module);
    Book::new(description, vec![reading; 32])
}

#[cfg(test)]
mod tests {
    use modio_description::describe;
    use register_map::Module;
    use register_map::board::{FX3U_24, MODIO_02, MODIO_08};

    use super::*;

    fn book(module: Module) -> Book {
        super::book(&MODIO_02, module, (1, 1))
    }

    #[test]
    fn names_are_resolved_to_addresses() {
        let book = book(Module::Ai2Ao2);
        let address = |name| book.find(name).map(|item| (item.address, item.words));
        assert_eq!(address("p5.1"), Ok((0x10, 1)));
        assert_eq!(address("P5.4.SAFE"), Ok((0x1D3, 1)));
        assert_eq!(address("5.1"), address("p5.1"));
        assert_eq!(address("5.4.safe"), address("p5.4.safe"));
        assert_eq!(address("baud"), Ok((0x101, 1)));
        assert_eq!(address("reset cause"), Ok((0x207, 1)));
        assert_eq!(address("reset_cause"), Ok((0x207, 1)));
        assert_eq!(address("p5.module"), Ok((0x114, 1)));
        assert_eq!(address("p5.2.pulses"), Ok((0x322, 2)));
        assert_eq!(address("product_code"), Ok((0x200, 2)));
        assert_eq!(address("p5.2.last_edge"), Ok((0x3A2, 2)));
        assert_eq!(address("uptime_ms"), Ok((0x226, 2)));
        assert_eq!(address("0x0101"), Ok((0x101, 1)));
        assert_eq!(book.find("0x0101").unwrap().name, "BAUD");
        assert_eq!(book.find("4096").unwrap().meaning, Meaning::Unknown);
    }

    #[test]
    fn digital_outputs_have_two_links() {
        let book = super::book(&MODIO_08, Module::Relay2, (0, 0));
        let links = book
            .items()
            .iter()
            .filter(|item| item.name.contains(".link"));
        let links: Vec<_> = links
            .map(|item| (item.name.as_str(), item.address))
            .collect();
        assert_eq!(
            links[..3],
            [
                ("p1.3.link1", 0x0408),
                ("p1.3.link2", 0x0488),
                ("p1.4.link1", 0x040C)
            ]
        );
        assert_eq!(links.len(), 4 * 4);
        let last = book.find("4.4.LINK2").unwrap();
        assert_eq!((last.address, last.words, last.setting), (0x04BC, 4, true));
    }

    #[test]
    fn items_are_those_of_a_board_without_slots() {
        let module = |port| FX3U_24.fixed(port).map_or(Module::None, |port| port.module);
        let book = Book::new(describe(&FX3U_24, "0.1.0", module), vec![(0, 0); 32]);
        for (name, setting) in [
            ("UNIT", Some(true)),
            ("HEARTBEAT", Some(false)),
            ("p7.2", Some(false)),
            ("p7.3", None),
            ("p7.2.safe", Some(true)),
            ("p7.3.safe", None),
            ("p7.module", Some(false)),
            ("p8.module", Some(true)),
            ("p8.1.range", Some(false)),
            ("LORA", None),
            ("p7.2.link1", Some(true)),
        ] {
            let item = book.find(name).ok();
            assert_eq!(item.map(|item| item.setting), setting, "{name}");
        }
    }

    #[test]
    fn an_unknown_name_is_reported_with_similar_ones() {
        let unknown = book(Module::Di4).find("BUAD").unwrap_err();
        assert!(unknown.to_string().contains("BAUD"), "{unknown}");
        assert!(
            book(Module::None).find("p5.1").is_err(),
            "an empty slot has no points"
        );
        assert!(Book::default().find("BAUD").is_err());
        assert!(Book::default().find("16").is_ok());
        let text = |book: Book| book.find("5.1.dead-time").unwrap_err().to_string();
        assert!(text(book(Module::Do4)).contains("this unit has no DEAD_TIME"));
        let with_stage = super::book(&MODIO_08, Module::None, (1, 1));
        assert!(text(with_stage).contains("similar names"));
    }

    #[test]
    fn a_point_has_the_meaning_of_its_settings_and_a_setting_the_values_of_its_kind() {
        let book = book(Module::Ai2Ao2);
        let Meaning::Analog(reading) = book.find("p5.1").unwrap().meaning else {
            panic!("not an analog point");
        };
        assert_eq!((reading.unit.code.as_str(), reading.max), ("uA", 20_000));
        assert_eq!(
            book.find("p5.1.filter").unwrap().values,
            Some(Values::Range(0, 8))
        );
        assert_eq!(
            book.find("p5.3.range").unwrap().values,
            Some(Values::Range(0, 1))
        );
        assert!(!book.find("p5.1").unwrap().writable && book.find("p5.3").unwrap().writable);
    }

    #[test]
    fn ports_have_their_module_and_points_of_unknown_meaning() {
        let ports = book(Module::Ai2Ao2).ports();
        let names = |port: &PortItems| {
            let names = port.points.iter().map(|item| item.name.clone());
            names.collect::<Vec<_>>()
        };
        assert_eq!(ports.len(), 1);
        assert_eq!((ports[0].number, ports[0].module.as_str()), (5, "2ai2ao"));
        assert_eq!(names(&ports[0]), ["p5.1", "p5.2", "p5.3", "p5.4"]);
        let unknown = Book::new(describe(&MODIO_02, "0.1.0", |_| Module::Ai4), Vec::new());
        assert_eq!(names(&unknown.ports()[0]).len(), 4);
        assert!(Book::default().ports().is_empty());
    }

    #[test]
    fn register_at_the_end_of_the_addresses_is_found() {
        let mut description = describe(&MODIO_02, "0.1.0", |_| Module::None);
        let counter = description
            .registers
            .iter_mut()
            .find(|r| r.name == "uptime");
        counter.unwrap().address = 0xFFFF;
        let book = Book::new(description, Vec::new());
        assert_eq!(book.find("0xFFFF").unwrap().name, "uptime");
        assert_eq!(book.find("0xFFFE").unwrap().meaning, Meaning::Unknown);
        assert_eq!(book.find("0x0000").unwrap().meaning, Meaning::Unknown);
    }
}
