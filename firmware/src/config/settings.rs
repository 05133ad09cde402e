//! The value of every setting.

use register_map::codes::{Format, Mode};
use register_map::configuration::{self, BY_POINT, COMMAND, FORMAT, KEY, MODE, MODULE, RULES};
use register_map::points::{self, Kind};
use register_map::{Board, InForce, Module, Rule, rule_at};

/// The high byte of every configuration address; the low byte is the place in [`Settings`].
const PAGE: u16 = KEY >> 8;

/// How many settings count only after a restart.
pub(super) const RESTARTS: usize = restarts();

/// The values of all settings that count only after a restart, in the order of their addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RestartValues(pub(super) [u16; RESTARTS]);

/// A value for every register of the configuration. They fit each other: a setting by point is one that
/// the point's module allows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// By the low byte of the address. KEY, COMMAND and gaps hold 0.
    values: [u16; 256],
}

impl Settings {
    /// As the factory sets them.
    #[must_use]
    pub fn defaults() -> Self {
        let mut settings = Self { values: [0; 256] };
        for (rule, address) in Addresses::from(KEY) {
            settings.put(address, rule.default);
        }
        settings
    }

    /// The settings that a record's pairs of address and value amount to, in whatever order they come,
    /// and how many values were not allowed on this board and have their default instead. Addresses not known here
    /// are passed over.
    #[must_use]
    pub fn load(board: &Board, pairs: impl Iterator<Item = (u16, u16)> + Clone) -> (Self, u16) {
        let mut settings = Self::defaults();
        let mut rejected: u16 = 0;
        // What a setting by point may be depends on the modules, so these come first.
        for modules in [true, false] {
            for (address, value) in pairs.clone() {
                let Some((rule, _)) = rule_at(RULES, address).filter(|(rule, _)| holds(rule))
                else {
                    continue;
                };
                let port = port_of(address);
                if port.is_some() != modules {
                    continue;
                }
                let allowed = rule.values_for(settings.kind_at(address)).allow(value)
                    && port.is_none_or(|port| takes_module(board, port, value));
                if allowed {
                    settings.set(address, value);
                } else {
                    rejected = rejected.saturating_add(1);
                }
            }
        }
        // Each of the two may be allowed and the pair not.
        if !format_suits_mode(settings.get(FORMAT), settings.get(MODE)) {
            settings.put(FORMAT, Format::F8N2.code());
            rejected = rejected.saturating_add(1);
        }
        (settings, rejected)
    }

    /// The value of a setting; 0 for an address that holds none.
    #[inline(never)]
    #[must_use]
    pub fn get(&self, address: u16) -> u16 {
        let [page, place] = address.to_be_bytes();
        match self.values.get(usize::from(place)) {
            Some(value) if u16::from(page) == PAGE => *value,
            _ => 0,
        }
    }

    /// The module chosen for a port, 1 to 8.
    #[must_use]
    pub fn module(&self, port: u16) -> Module {
        let address = MODULE.wrapping_add(port.wrapping_sub(1));
        Module::from_code(self.get(address)).unwrap_or(Module::None)
    }

    /// What the modules make of a point, 0 to 31.
    #[must_use]
    pub fn kind(&self, point: u16) -> Kind {
        let kinds = self.module(point / points::CHANNELS + 1).points();
        let channel = usize::from(point % points::CHANNELS);
        kinds.get(channel).copied().unwrap_or(Kind::None)
    }

    /// Every setting that differs from its default, from this address on, in ascending order.
    #[must_use]
    pub const fn changed_from(&self, first: u16) -> Changed<'_> {
        Changed {
            settings: self,
            held: Addresses::from(first),
        }
    }

    /// Sets a value, which must be allowed. With MODULE go the settings of the port's points.
    pub(super) fn set(&mut self, address: u16, value: u16) {
        match port_of(address) {
            Some(port) => self.choose_module(port, value),
            None => self.put(address, value),
        }
    }

    /// The values from one address to before another, for what neither MODULE, KEY nor COMMAND are in.
    #[inline]
    pub(super) fn slice_mut(&mut self, start: u16, count: u16) -> &mut [u16] {
        let start = usize::from(start & 0xFF);
        let end = start.saturating_add(usize::from(count));
        self.values.get_mut(start..end).unwrap_or_default()
    }

    /// The values from one address to before another.
    #[inline]
    pub(super) fn slice(&self, start: u16, count: u16) -> &[u16] {
        let start = usize::from(start & 0xFF);
        let end = start.saturating_add(usize::from(count));
        self.values.get(start..end).unwrap_or_default()
    }

    /// How many settings differ from those.
    pub(super) fn differences(&self, from: &Self) -> u16 {
        let pairs = self.values.iter().zip(&from.values);
        // There are 256 at most.
        pairs.map(|(a, b)| u16::from(a != b)).sum()
    }

    /// Whether these settings differ from those in force since the start in one that counts only after a restart.
    #[must_use]
    pub fn needs_restart(&self, started: &RestartValues) -> bool {
        !self.restart_values().eq(started.0.iter().copied())
    }

    /// The settings that count only after a restart, in the order of their addresses.
    pub(super) fn restart_values(&self) -> impl Iterator<Item = u16> {
        Addresses::from(KEY)
            .filter(|(rule, _)| rule.in_force == InForce::Restart)
            .map(|(_, address)| self.get(address))
    }

    /// The kind of the point that a setting is for; none for what is no setting by point.
    fn kind_at(&self, address: u16) -> Kind {
        configuration::point_of(address).map_or(Kind::None, |point| self.kind(point))
    }

    /// From one module to another, the points' settings go to the defaults: what suited the one could
    /// switch something on at the other. From none, those made in advance are kept if they suit.
    fn choose_module(&mut self, port: u16, code: u16) {
        let first = points::of_port(port);
        let before = self.module(port);
        let after = Module::from_code(code).unwrap_or(Module::None);
        if after == before {
            return;
        }
        self.put(MODULE.wrapping_add(port.wrapping_sub(1)), code);
        let rules = RULES.iter().filter(|rule| BY_POINT.contains(&rule.first));
        for rule in rules {
            let kinds = before.points().into_iter().zip(after.points());
            for (point, (before_kind, kind)) in (first..).zip(kinds) {
                let address = rule.first.wrapping_add(point);
                let value = self.get(address);
                let keep = before == Module::None
                    && value != rule.default_for(before_kind)
                    && rule.values_for(kind).allow(value);
                if !keep {
                    self.put(address, rule.default_for(kind));
                }
            }
        }
    }

    fn put(&mut self, address: u16, value: u16) {
        let [_, place] = address.to_be_bytes();
        if let Some(held) = self.values.get_mut(usize::from(place)) {
            *held = value;
        }
    }
}

/// Whether a value of FORMAT can be used with a value of MODE.
pub(super) fn format_suits_mode(format: u16, mode: u16) -> bool {
    match (Format::from_code(format), Mode::from_code(mode)) {
        (Some(format), Some(mode)) => format.suits(mode),
        _ => false,
    }
}

/// Whether a port's MODULE may have this value: without a slot, it has no module.
pub(super) const fn takes_module(board: &Board, port: u16, code: u16) -> bool {
    code == 0 || board.has_slot(port)
}

/// The port, 1 to 8, whose MODULE stands at this address.
pub(super) fn port_of(address: u16) -> Option<u16> {
    let index = address.wrapping_sub(MODULE);
    (index < points::PORTS).then_some(index + 1)
}

/// Whether the registers of a rule hold a setting.
const fn holds(rule: &Rule) -> bool {
    rule.first != KEY && rule.first != COMMAND
}

/// Every address that holds a setting, with its rule, in ascending order.
struct Addresses {
    rules: &'static [Rule],
    from: u16,
}

impl Addresses {
    const fn from(first: u16) -> Self {
        Self {
            rules: RULES,
            from: first,
        }
    }
}

impl Iterator for Addresses {
    type Item = (&'static Rule, u16);

    // Start-up and every save go through it in several places: one copy for all.
    #[inline(never)]
    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let (rule, rest) = self.rules.split_first()?;
            let address = self.from.max(rule.first);
            if address < rule.end() && holds(rule) {
                self.from = address.wrapping_add(1);
                return Some((rule, address));
            }
            self.rules = rest;
        }
    }
}

/// The settings that differ from their defaults, from [`Settings::changed_from`].
pub struct Changed<'a> {
    settings: &'a Settings,
    held: Addresses,
}

impl Iterator for Changed<'_> {
    type Item = (u16, u16);

    #[inline(never)]
    fn next(&mut self) -> Option<(u16, u16)> {
        loop {
            let (rule, address) = self.held.next()?;
            let value = self.settings.get(address);
            let default = match rule.narrower {
                Some(_) => rule.default_for(self.settings.kind_at(address)),
                None => rule.default,
            };
            if value != default {
                return Some((address, value));
            }
        }
    }
}

/// Worked out by the compiler.
const fn restarts() -> usize {
    let mut rules = RULES;
    let mut count = 0;
    while let Some((rule, rest)) = rules.split_first() {
        if holds(rule) && matches!(rule.in_force, InForce::Restart) {
            count += rule.count as usize;
        }
        rules = rest;
    }
    count
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;
    use register_map::board::{MODIO_02, MODIO_08};
    use register_map::configuration::{
        BAUD, FILTER, HOLD, LORA_ADDRESS, RANGE, SAFE, START, module_of,
    };

    const SLOT: u16 = points::first(5);
    const MODULE_SLOT: u16 = module_of(5);

    fn changed(settings: &Settings) -> Vec<(u16, u16)> {
        settings.changed_from(0).collect()
    }

    fn loaded(pairs: &[(u16, u16)]) -> (Settings, u16) {
        Settings::load(&MODIO_02, pairs.iter().copied())
    }

    #[test]
    fn defaults_are_the_factory_s_and_change_nothing() {
        let settings = Settings::defaults();
        assert_eq!((settings.get(BAUD), settings.get(FILTER + SLOT)), (96, 5));
        assert_eq!((settings.get(0x0145), settings.get(0x017F)), (50, 3950));
        assert_eq!((settings.get(0x0201), settings.get(0x0001)), (0, 0));
        assert_eq!(changed(&settings), []);
        assert_eq!(RESTARTS, 5 + 8 + 6 + 32);
        assert_eq!(settings.restart_values().count(), RESTARTS);
    }

    #[test]
    fn what_is_changed_leads_back_to_the_same_settings() {
        let pairs = [
            (BAUD, 1152),
            (MODULE_SLOT, 4),
            (FILTER + SLOT, 8),
            (LORA_ADDRESS, 0xFFFF),
            (RANGE + SLOT + 3, 2),
            (START + 31, 4095),
        ];
        let (settings, rejected) = loaded(&pairs);
        assert_eq!(rejected, 0);
        assert_eq!(changed(&settings), pairs);
        let from: Vec<_> = settings.changed_from(FILTER + SLOT + 1).collect();
        assert_eq!(from, pairs[3..]);
        let backwards: Vec<_> = pairs.into_iter().rev().collect();
        assert_eq!(loaded(&backwards).0, settings, "the order does not matter");
    }

    #[test]
    fn a_filter_has_the_default_of_its_module() {
        let (settings, _) = loaded(&[(MODULE_SLOT, 4)]);
        assert_eq!(
            (settings.get(FILTER + SLOT), settings.get(FILTER + SLOT - 1)),
            (4, 5)
        );
        assert_eq!(changed(&settings), [(MODULE_SLOT, 4)]);
        let (settings, _) = loaded(&[(MODULE_SLOT, 4), (FILTER + SLOT, 5)]);
        assert_eq!(changed(&settings), [(MODULE_SLOT, 4), (FILTER + SLOT, 5)]);
    }

    #[test]
    fn a_value_not_allowed_is_counted_and_an_address_not_known_is_not() {
        let (settings, rejected) = loaded(&[
            (BAUD, 97),
            (MODULE, 1),
            (0x0109, 1),
            (KEY, 0x5A17),
            (COMMAND, 1),
            (0x0200, 1),
            (0xFFFF, 0xFFFF),
            (MODULE_SLOT, 2),
            (SAFE + SLOT, 2),
            (SAFE + SLOT + 1, 1),
        ]);
        assert_eq!(rejected, 3, "BAUD, MODULE of port 1, SAFE of a bit");
        assert_eq!(changed(&settings), [(MODULE_SLOT, 2), (SAFE + SLOT + 1, 1)]);
    }

    #[test]
    fn modules_are_kept_on_the_ports_that_the_board_has_slots_for() {
        let pairs = (1..=8).map(|port| (module_of(port), 2));
        let ports = |board| {
            let (settings, rejected) = Settings::load(board, pairs.clone());
            let ports: Vec<_> = (1..=8)
                .filter(|port| settings.module(*port) == Module::Do4)
                .collect();
            (ports, rejected)
        };
        assert_eq!(ports(&MODIO_02), (std::vec![5], 7));
        assert_eq!(ports(&MODIO_08), (std::vec![1, 2, 3, 4], 4));
    }

    #[test]
    fn stored_format_with_seven_data_bits_is_kept_in_ascii_mode_only() {
        for format in 4..=6 {
            let (settings, rejected) = loaded(&[(FORMAT, format), (MODE, 1)]);
            assert_eq!((settings.get(FORMAT), rejected), (format, 0));
            let (settings, rejected) = loaded(&[(FORMAT, format)]);
            assert_eq!((settings.get(FORMAT), rejected), (0, 1));
        }
        let (settings, rejected) = loaded(&[(FORMAT, 7), (MODE, 1)]);
        assert_eq!((settings.get(FORMAT), rejected), (0, 1));
    }

    #[test]
    fn another_module_starts_from_its_own_defaults() {
        let (mut settings, _) = loaded(&[(MODULE_SLOT, 2), (SAFE + SLOT, HOLD), (START + SLOT, 1)]);
        settings.set(MODULE_SLOT, 3);
        assert_eq!(changed(&settings), [(MODULE_SLOT, 3)]);
        settings.set(MODULE_SLOT, 4);
        settings.set(RANGE + SLOT, 2);
        settings.set(MODULE_SLOT, 4);
        assert_eq!(
            settings.get(RANGE + SLOT),
            2,
            "the same module is no change"
        );
        settings.set(MODULE_SLOT, 0);
        assert_eq!(changed(&settings), []);
    }

    #[test]
    fn settings_made_before_the_module_are_kept_if_they_suit() {
        let mut settings = Settings::defaults();
        settings.set(SAFE + SLOT, 2048);
        settings.set(SAFE + SLOT + 1, HOLD);
        settings.set(FILTER + SLOT, 3);
        settings.set(FILTER + SLOT + 1, 100);
        let mut outputs = settings.clone();
        outputs.set(MODULE_SLOT, 2);
        assert_eq!(outputs.get(SAFE + SLOT), 0, "a bit has no 2048");
        assert_eq!(outputs.get(SAFE + SLOT + 1), HOLD);
        settings.set(MODULE_SLOT, 4);
        let filters: Vec<_> = (0..4).map(|i| settings.get(FILTER + SLOT + i)).collect();
        assert_eq!(filters, [3, 4, 4, 4]);
    }
}
