//! The value of every setting.

use core::ops::Range;

use modio_drivers::CHANNELS;
use register_map::board::{Board, Each};
use register_map::codes::{Format, Mode};
use register_map::configuration::{
    self, COMMAND, FORMAT, HEARTBEAT, KEY, MODE, MODULE, RANGE, RULES, module_of,
};
use register_map::points::{self, Kind};
use register_map::{InForce, Module, Rule, links, rule_at, stage};

use super::links::{Links, differences};
use crate::links::{Link, OF_A_SLOT};

/// High byte of every configuration address. The low byte is the index in [`Settings`].
const PAGE: u16 = KEY >> 8;
/// Number of addresses of the configuration.
const VALUES: usize = 256;

/// Number of settings that need a restart.
pub(super) const RESTARTS: usize = restarts();

/// The values of all settings that need a restart, in the order of their addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RestartValues(pub(super) [u16; RESTARTS]);

/// A value for every register of the configuration, the links and the settings behind them. The values are
/// consistent: a setting by point is always one that the point's module allows, and so is a link.
// `Copy`, because copies of its parts one after another take more flash. Aligned, so that it is copied by words: requests
// wait for the copy.
#[repr(align(4))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings<B: Board> {
    /// By the low byte of the address. KEY, COMMAND, HEARTBEAT and gaps hold 0.
    values: [u16; VALUES],
    /// DEADBAND, DEAD_TIME, MAX_ON and MIN_OFF, as far as the board has them.
    behind: Each<B::BehindLinks, u16>,
    pub(super) links: Links<B>,
}

impl<B: Board> Settings<B> {
    /// Returns the factory settings.
    #[must_use]
    pub fn defaults() -> Self {
        let mut settings = Self {
            values: [0; VALUES],
            behind: Each::all(0),
            links: Links::new(),
        };
        for (rule, address) in Addresses::from::<B>(KEY) {
            settings.put(address, rule.default);
        }
        if !B::ROW.is_modular() {
            for (port, fixed) in B::ROW.ports().zip(B::ROW.fixed) {
                settings.put(module_of(port), fixed.module.code());
                settings.set_ranges(port);
            }
        }
        settings
    }

    /// Returns the settings from a record's pairs of address and value, in ascending order, and the number of values that
    /// this board does not allow and that have their default instead. Unknown addresses are ignored.
    #[must_use]
    pub fn load(pairs: impl Iterator<Item = (u16, u16)>) -> (Self, u16) {
        let mut settings = Self::defaults();
        let mut rejected: u16 = 0;
        // Pairs are in ascending order. So the modules, which determine which settings by point are allowed, come before
        // these.
        for (address, value) in pairs {
            let rule = rule_at(B::ROW.rules(), address).filter(|(rule, _)| holds(rule));
            let allowed = match rule {
                Some((rule, _)) => {
                    let port = port_of(address);
                    rule.values_for(settings.kind_at(address)).allow(value)
                        && port.is_none_or(|port| B::ROW.takes(port, value))
                        && settings.takes_range(address, value)
                }
                None if Links::<B>::contain(address) => settings.has_link(address),
                None if is_behind::<B>(address) => stage::allows(address, value),
                None => continue,
            };
            if allowed {
                settings.set(address, value);
            } else {
                rejected = rejected.saturating_add(1);
            }
        }
        // Each of the two may be allowed alone but not in combination.
        if !format_suits_mode(settings.get(FORMAT), settings.get(MODE)) {
            settings.put(FORMAT, Format::F8N2.code());
            rejected = rejected.saturating_add(1);
        }
        let rejected = rejected.saturating_add(settings.drop_links(None));
        (settings, rejected)
    }

    /// Returns the value of a setting, or 0 for an address without one.
    #[inline(never)]
    #[must_use]
    pub fn get(&self, address: u16) -> u16 {
        match self.slice(address, 1) {
            [value] if is_held::<B>(address) => *value,
            _ => self.links.at(address).map_or(0, |link| link.word(address)),
        }
    }

    /// Returns the value of a setting whose address is known, faster than [`get`](Self::get).
    #[inline]
    #[must_use]
    pub const fn at<const ADDRESS: u16>(&self) -> u16 {
        self.values[const { (ADDRESS - PAGE * 0x100) as usize }]
    }

    /// Returns the module chosen for a port, 1 to 8.
    #[must_use]
    pub fn module(&self, port: u16) -> Module {
        Module::from_code(self.get(module_of(port))).unwrap_or(Module::None)
    }

    /// Returns the kind of a point with the chosen module; none above 31.
    #[must_use]
    pub fn kind(&self, point: u16) -> Kind {
        if point >= points::COUNT {
            return Kind::None;
        }
        let port = point / points::CHANNELS + 1;
        let kinds = B::ROW.kinds(port, self.module(port));
        let channel = usize::from(point % points::CHANNELS);
        kinds.get(channel).copied().unwrap_or(Kind::None)
    }

    /// Returns every setting from this address on that differs from its default, in ascending order.
    #[must_use]
    pub fn changed_from(&self, first: u16) -> Changed<'_, B> {
        let behind = if Links::<B>::EXIST {
            links::LINKS
        } else {
            B::ROW.behind_links().start
        };
        Changed {
            settings: self,
            held: Addresses::from::<B>(first),
            behind: first.max(behind),
        }
    }

    /// Sets a value, which must be allowed. Setting MODULE also changes the settings of the port's points.
    pub(super) fn set(&mut self, address: u16, value: u16) {
        match port_of(address) {
            Some(port) => self.choose_module(port, value),
            None => self.put(address, value),
        }
    }

    /// Returns `count` values from an address on, to be changed. The range must not contain MODULE, KEY, COMMAND or
    /// HEARTBEAT.
    #[inline]
    pub(super) fn slice_mut(&mut self, start: u16, count: u16) -> &mut [u16] {
        let (values, first) = if is_behind::<B>(start) {
            (&mut self.behind[..], B::ROW.behind_links().start)
        } else {
            (&mut self.values[..], KEY)
        };
        values
            .get_mut(place(start, first, count))
            .unwrap_or_default()
    }

    /// Returns `count` values from an address on.
    #[inline]
    pub(super) fn slice(&self, start: u16, count: u16) -> &[u16] {
        let (values, first) = if is_behind::<B>(start) {
            (&self.behind[..], B::ROW.behind_links().start)
        } else {
            (&self.values[..], KEY)
        };
        values.get(place(start, first, count)).unwrap_or_default()
    }

    /// Returns the number of settings that differ from those of `from`.
    pub(super) fn differences(&self, from: &Self) -> u16 {
        differences(&self.values, &from.values)
            + differences(&self.behind, &from.behind)
            + self.links.differences(&from.links)
    }

    /// Returns whether a setting that needs a restart differs from its value in force since the start.
    #[must_use]
    pub fn needs_restart(&self, started: &RestartValues) -> bool {
        !self.restart_values().eq(started.0.iter().copied())
    }

    /// Returns the settings that need a restart, in the order of their addresses.
    pub(super) fn restart_values(&self) -> impl Iterator<Item = u16> {
        restart_addresses::<B>().map(|address| self.get(address))
    }

    /// Returns the kind of the point of a setting by point, or none for other settings.
    fn kind_at(&self, address: u16) -> Kind {
        configuration::point_of(address).map_or(Kind::None, |point| self.kind(point))
    }

    /// Chooses a module. A change from one module to another sets the points' settings to the defaults, because a
    /// value for the old module could switch something on with the new one. A change from no module keeps settings
    /// that the new module allows.
    fn choose_module(&mut self, port: u16, code: u16) {
        let first = points::of_port(port);
        let before = self.module(port);
        let after = Module::from_code(code).unwrap_or(Module::None);
        if after == before {
            return;
        }
        self.put(module_of(port), code);
        // The settings by point, see `point_of`.
        let rules = B::ROW
            .rules()
            .iter()
            .filter(|rule| rule.count == points::COUNT);
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
        if !B::ROW.is_modular() {
            self.set_ranges(port);
        }
        for block in B::ROW.behind_links().step_by(points::COUNT.into()) {
            self.slice_mut(block.wrapping_add(first), points::CHANNELS)
                .fill(0);
        }
        self.drop_links(Some(Links::<B>::slot_of(first)));
    }

    /// Sets RANGE of the points of a port of the board to the only value that each takes.
    fn set_ranges(&mut self, port: u16) {
        for point in (points::of_port(port)..).take(CHANNELS) {
            if let Some(range) = self.only_range(point) {
                self.put(RANGE.wrapping_add(point), range);
            }
        }
    }

    /// Returns the only value of RANGE of an analog point that is part of the board.
    fn only_range(&self, point: u16) -> Option<u16> {
        let fixed = B::ROW.fixed(point / points::CHANNELS + 1)?;
        let kind = self.kind(point);
        matches!(kind, Kind::WordInput | Kind::WordOutput)
            .then(|| fixed.range(point % points::CHANNELS, kind))
    }

    /// Returns whether the board allows a value, if it is one of RANGE.
    pub(super) fn takes_range(&self, address: u16, value: u16) -> bool {
        let point = address.wrapping_sub(RANGE);
        B::ROW.is_modular()
            || point >= points::COUNT
            || self.only_range(point).is_none_or(|only| value == only)
    }

    /// Returns whether the chosen module has a digital output at the point of a register of the links.
    pub(super) fn has_link(&self, address: u16) -> bool {
        Links::<B>::contain(address) && self.kind(links::point_of(address)) == Kind::BitOutput
    }

    /// Returns whether the chosen modules allow a link.
    pub(super) fn allows(&self, link: &Link) -> bool {
        link.suits(link.source().map_or(Kind::None, |source| self.kind(source)))
    }

    /// Sets to the default the links that the chosen modules do not allow, and those from or to a slot whose module has
    /// changed. Returns their number.
    fn drop_links(&mut self, changed: Option<usize>) -> u16 {
        let mut dropped: u16 = 0;
        if !Links::<B>::EXIST {
            return dropped;
        }
        for slot in 0..B::PORTS {
            for index in 0..OF_A_SLOT {
                let link = self.links.link(slot, index);
                let from = link.source().map(|source| Links::<B>::slot_of(source));
                let to = Some(slot);
                if changed.is_some() && (changed == from || changed == to) || !self.allows(link) {
                    if let Some(link) = self.links.link_mut((slot, index)) {
                        *link = Link::NONE;
                    }
                    dropped = dropped.saturating_add(1);
                }
            }
        }
        dropped
    }

    fn put(&mut self, address: u16, value: u16) {
        if Links::<B>::EXIST && !is_held::<B>(address) {
            self.links.set(address, value);
        } else if let [held] = self.slice_mut(address, 1) {
            *held = value;
        }
    }
}

/// Returns the indices of settings in values from the address `first` on.
#[inline]
fn place(start: u16, first: u16, count: u16) -> Range<usize> {
    let start = usize::from(start.wrapping_sub(first));
    start..start.saturating_add(usize::from(count))
}

/// Returns whether an address is that of a setting, not one of a link.
#[inline]
const fn is_held<B: Board>(address: u16) -> bool {
    address >> 8 == PAGE || is_behind::<B>(address)
}

/// Returns whether an address is that of a setting behind the links.
#[inline]
pub(super) const fn is_behind<B: Board>(address: u16) -> bool {
    let behind = const { B::ROW.behind_links() };
    address.wrapping_sub(behind.start) < behind.end - behind.start
}

/// Returns whether a value of FORMAT is compatible with a value of MODE.
pub(super) fn format_suits_mode(format: u16, mode: u16) -> bool {
    match (Format::from_code(format), Mode::from_code(mode)) {
        (Some(format), Some(mode)) => format.suits(mode),
        _ => false,
    }
}

/// Returns the port, 1 to 8, whose MODULE is at this address.
pub(super) fn port_of(address: u16) -> Option<u16> {
    let index = address.wrapping_sub(MODULE);
    (index < points::PORTS).then_some(index + 1)
}

/// Returns whether a register of the configuration holds a setting.
pub(super) const fn is_setting(address: u16) -> bool {
    !matches!(address, KEY | COMMAND | HEARTBEAT)
}

/// Returns whether the registers of a rule hold a setting.
const fn holds(rule: &Rule) -> bool {
    is_setting(rule.first)
}

/// Iterates over the addresses of the settings that need a restart.
pub(super) fn restart_addresses<B: Board>() -> impl Iterator<Item = u16> {
    Addresses::from::<B>(KEY)
        .filter(|(rule, _)| rule.in_force == InForce::Restart)
        .map(|(_, address)| address)
}

/// Iterates over every address that holds a setting, with its rule, in ascending order.
struct Addresses {
    rules: &'static [Rule],
    from: u16,
}

impl Addresses {
    fn from<B: Board>(first: u16) -> Self {
        Self {
            rules: B::ROW.rules(),
            from: first,
        }
    }
}

impl Iterator for Addresses {
    type Item = (&'static Rule, u16);

    // Not inlined: start-up and every save call this from several places, and one copy saves flash.
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

/// Iterates over the settings that differ from their defaults, see [`Settings::changed_from`].
pub struct Changed<'a, B: Board> {
    settings: &'a Settings<B>,
    held: Addresses,
    /// The register of a link, or behind the links, that is next after all others.
    behind: u16,
}

impl<B: Board> Iterator for Changed<'_, B> {
    type Item = (u16, u16);

    #[inline(never)]
    fn next(&mut self) -> Option<(u16, u16)> {
        for (rule, address) in self.held.by_ref() {
            let value = self.settings.get(address);
            let default = match rule.narrower {
                Some(_) => rule.default_for(self.settings.kind_at(address)),
                None => rule.default,
            };
            if value != default {
                return Some((address, value));
            }
        }
        while Links::<B>::contain(self.behind) {
            let address = self.behind;
            self.behind = address.wrapping_add(1);
            if let Some(value) = self.settings.links.changed(address) {
                return Some((address, value));
            }
        }
        while is_behind::<B>(self.behind) {
            let address = self.behind;
            self.behind = address.wrapping_add(1);
            let value = self.settings.get(address);
            if value != 0 {
                return Some((address, value));
            }
        }
        None
    }
}

/// Evaluated at compile time.
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
mod tests;
