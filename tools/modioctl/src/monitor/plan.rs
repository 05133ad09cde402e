//! The items that the monitor reads of a unit, and the check that their meaning has not changed.

use std::collections::{BTreeMap, BTreeSet};

use register_map::state::{BUS_MESSAGES, T15_GAPS};

use crate::links;
use crate::names::{Book, Item, Meaning, PortItems, port_of};

/// Values by the name of their item.
pub type Words = BTreeMap<String, Vec<u16>>;

/// The items to read of a unit.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Ports with their points.
    pub ports: Vec<PortItems>,
    /// State of the unit, of its modules and of its channels: read after the points.
    pub state: Vec<Item>,
    /// Settings that determine the meaning of the points, read after the points. There are none without analog
    /// points.
    pub settings: Vec<Item>,
    /// Counters of the line, read less often.
    pub counters: Vec<Item>,
    /// Links of the outputs, read with the counters.
    pub links: Vec<Item>,
    /// Uptime in ms, read with the log of edges; `None` for a unit without the log.
    pub uptime_ms: Option<Item>,
}

impl Plan {
    /// Returns the items to read of the unit with these names.
    pub fn new(book: &Book) -> Self {
        let ports = book.ports();
        let found = |name: &str| book.item(name).cloned();
        let mut state: Vec<_> = ["uptime", "status"]
            .iter()
            .filter_map(|name| found(name))
            .collect();
        let mut settings = Vec::new();
        for port in &ports {
            for name in ["module", "module_in_force", "module_state"] {
                state.extend(found(&format!("p{}.{name}", port.number)));
            }
            for point in &port.points {
                state.extend(found(&format!("{}.channel_status", point.name)));
                if matches!(point.meaning, Meaning::Analog(_) | Meaning::Unknown) {
                    settings.extend(found(&format!("{}.range", point.name)));
                    settings.extend(found(&format!("{}.scale", point.name)));
                }
            }
        }
        let is_counter = |item: &&Item| (BUS_MESSAGES..=T15_GAPS).contains(&item.address);
        let counters = book.items().iter().filter(is_counter).cloned();
        Self {
            counters: counters.collect(),
            links: links::all(book).unwrap_or_default(),
            uptime_ms: found("uptime ms"),
            ports,
            state,
            settings,
        }
    }

    /// Returns whether the unit still has the modules, ranges and scales for which the plan was made. These words
    /// were read after the points, so a change between the two reads is detected.
    pub fn holds(&self, words: &Words) -> bool {
        self.ports.iter().all(|port| {
            let in_force = words.get(&format!("p{}.module_in_force", port.number));
            let alike = || {
                port.points
                    .iter()
                    .all(|item| Self::reads_alike(item, words))
            };
            in_force.and_then(|words| words.first()) == Some(&port.code)
                && (self.unsettled(port, words) || alike())
        })
    }

    /// Returns the settings that determine the meaning of a point.
    pub fn settings_of(&self, point: &Item) -> Vec<Item> {
        let names = ["range", "scale"].map(|setting| format!("{}.{setting}", point.name));
        let settings = self.settings.iter();
        let own = settings.filter(|item| names.contains(&item.name));
        own.cloned().collect()
    }

    /// Returns whether RANGE and SCALE of an analog point are those for which its meaning is known. The meaning of
    /// other points never changes.
    pub fn reads_alike(point: &Item, words: &Words) -> bool {
        let setting = |setting: &str| {
            let words = words.get(&format!("{}.{setting}", point.name));
            words.and_then(|words| words.first()).copied()
        };
        match &point.meaning {
            Meaning::Analog(reading) => {
                setting("range") == Some(reading.range) && setting("scale") == Some(reading.scale)
            }
            _ => true,
        }
    }

    /// Returns the ports whose MODULE differs from the module in force. RANGE and SCALE of such a port belong to
    /// the module after the next restart, and do not apply to the present one.
    pub fn waiting_for_restart(&self, words: &Words) -> BTreeSet<u8> {
        let waiting = self.ports.iter().filter(|port| self.unsettled(port, words));
        waiting.map(|port| port.number).collect()
    }

    /// Returns the links of all ports except these, whose new modules may not have them.
    pub fn links_without(&self, ports: &BTreeSet<u8>) -> Vec<Item> {
        let is_known = |item: &&Item| port_of(&item.name).is_none_or(|port| !ports.contains(&port));
        self.links.iter().filter(is_known).cloned().collect()
    }

    fn unsettled(&self, port: &PortItems, words: &Words) -> bool {
        let module = words.get(&format!("p{}.module", port.number));
        module.is_some_and(|module| module.first() != Some(&port.code))
    }
}

/// Returns whether an item is a digital input.
pub const fn is_digital_input(item: &Item) -> bool {
    matches!(item.meaning, Meaning::Bit) && !item.writable
}

/// Returns whether an item is an analog point.
pub const fn is_analog(item: &Item) -> bool {
    matches!(item.meaning, Meaning::Analog(_))
}

#[cfg(test)]
mod tests {
    use modio_description::describe;
    use register_map::Module;
    use register_map::board::{MODIO_02, MODIO_08};

    use super::*;
    use crate::names::book;

    fn plan() -> Plan {
        let mut readings = vec![(0, 0); 32];
        readings[0x12] = (1, 1);
        Plan::new(&Book::new(
            describe(&MODIO_02, "0.1.0", |_| Module::Ai2Ao2),
            readings,
        ))
    }

    fn words(scale: u16, module: u16, in_force: u16) -> Words {
        let mut words = Words::new();
        for channel in 1..=4 {
            let engineering = if channel == 3 { scale } else { 0 };
            words.insert(format!("p5.{channel}.range"), vec![engineering]);
            words.insert(format!("p5.{channel}.scale"), vec![engineering]);
        }
        words.insert("p5.module".to_owned(), vec![module]);
        words.insert("p5.module_in_force".to_owned(), vec![in_force]);
        words
    }

    #[test]
    fn plan_has_state_settings_and_counters_of_the_unit() {
        let plan = plan();
        let has = |items: &[Item], name: &str| items.iter().any(|item| item.name == name);
        assert!(has(&plan.state, "uptime") && has(&plan.state, "p5.4.channel_status"));
        assert!(has(&plan.state, "p5.module_state") && has(&plan.state, "p5.module_in_force"));
        assert!(has(&plan.settings, "p5.1.range") && has(&plan.settings, "p5.4.scale"));
        assert_eq!(plan.counters.len(), 9);
    }

    #[test]
    fn links_of_a_port_that_waits_for_a_restart_are_not_read() {
        let plan = Plan::new(&book(&MODIO_08, Module::Do4, (0, 0)));
        assert_eq!(plan.links_without(&BTreeSet::new()).len(), 2 * 4 * 4);
        let without = plan.links_without(&BTreeSet::from([2, 3]));
        assert_eq!(without.len(), 2 * 2 * 4);
        assert!(without.iter().all(|item| !item.name.starts_with("p2.")));
    }

    #[test]
    fn other_scale_or_module_in_force_ends_the_plan() {
        let plan = plan();
        assert!(plan.holds(&words(1, 6, 6)));
        assert!(!plan.holds(&words(0, 6, 6)), "another scale");
        assert!(!plan.holds(&words(1, 4, 4)), "another module");
        assert!(!plan.holds(&Words::new()), "nothing is known");
    }

    #[test]
    fn other_module_setting_makes_the_port_wait_for_a_restart() {
        let plan = plan();
        let changed = words(0, 4, 6);
        assert!(plan.holds(&changed));
        assert_eq!(plan.waiting_for_restart(&changed), BTreeSet::from([5]));
        assert!(plan.waiting_for_restart(&words(1, 6, 6)).is_empty());
    }
}
