//! Runs the links: inputs that switch outputs without a master.

use modio_drivers::{CHANNELS, Codes, Kind};
use register_map::Module;
use register_map::board::{Board, Each};

use super::{Device, IoPort, Points};
use crate::links::{AFTER_POWER_ON_MS, OF_A_SLOT, Outputs, Source, Sources};
use crate::stage::Held;

/// The links of a device, while they run.
#[derive(Debug)]
pub(super) struct Linking<B: Board> {
    outputs: Each<B::Ports, Outputs>,
    sources: Each<B::Ports, Sources>,
    /// Whether the communication watchdog has expired, as read at the beginning of the scan under way.
    alone: bool,
    /// Whether a second of the uptime has begun with this scan. Words are compared with the thresholds only then.
    look: bool,
    /// Whether a link holds its output until a master writes the output.
    holding: bool,
}

impl<B: Board> Linking<B> {
    pub fn new() -> Self {
        Self {
            outputs: Each::all(Outputs::new()),
            sources: Each::all(Sources::new()),
            alone: false,
            look: false,
            holding: false,
        }
    }

    /// Returns the outputs of a slot with a level link that acts, channel 1 in bit 0.
    pub fn with_level(&self, slot: usize) -> u8 {
        self.outputs.get(slot).map_or(0, Outputs::with_level)
    }

    /// Returns the outputs of a slot with a level link, whether it acts or not, channel 1 in bit 0.
    pub fn with_any_level(&self, slot: usize) -> u8 {
        self.outputs.get(slot).map_or(0, Outputs::with_any_level)
    }

    /// Returns the outputs of a slot that keep their present value over a reset, channel 1 in bit 0.
    pub fn keeping(&self, slot: usize) -> u8 {
        self.outputs.get(slot).map_or(0, Outputs::keeping)
    }

    /// Returns the outputs of a slot that are held, or will be held, by a link that always acts, channel 1 in bit 0.
    pub fn held_always(&self, slot: usize) -> u8 {
        self.outputs.get(slot).map_or(0, Outputs::held_always)
    }
}

impl<B: Board> Device<B> {
    /// Prepares the links at a start. The sources have no values yet. `held` returns the outputs of a slot that links
    /// held before the reset, channel 1 in bit 0.
    pub(super) fn begin_links(&mut self, held: impl Fn(usize) -> u8) {
        if !B::ROW.has_links() {
            return;
        }
        let powered_on = self.state.was_powered_on();
        let Self {
            points, linking, ..
        } = self;
        for (slot, port) in points.ports().iter().enumerate() {
            if let Some(sources) = linking.sources.get_mut(slot) {
                for channel in 0..CHANNELS {
                    begin_source(sources, port, channel, powered_on);
                }
            }
            if let Some(outputs) = linking.outputs.get_mut(slot) {
                let on = if powered_on {
                    0
                } else {
                    port.channels().bits()
                };
                outputs.forget(u8::MAX, on);
                outputs.begin_held(held(slot));
            }
        }
    }

    /// Returns the channels of each slot whose settings have changed and are not applied yet, channel 1 in bit 0. Of these
    /// points, point 0 in bit 0.
    pub(super) fn changed_sources(&self, points: u32) -> Each<B::Ports, u8> {
        let mut changed = Each::all(0);
        if !B::ROW.has_links() {
            return changed;
        }
        for (slot, (port, changed)) in self
            .points
            .ports()
            .iter()
            .zip(changed.iter_mut())
            .enumerate()
        {
            let points = points >> (Points::<B>::first_of(slot) & 31);
            for channel in (0..CHANNELS).filter(|channel| points >> channel & 1 != 0) {
                let point = self.config.point(slot, channel);
                let differs = point.is_some_and(|to| port.setting(channel) != Some(&to.settings));
                *changed |= u8::from(differs) << channel;
            }
        }
        changed
    }

    /// Takes the links from the settings after these may have changed. `changed` has the channels of each slot whose
    /// settings differ from those before, channel 1 in bit 0.
    pub(super) fn set_up_links(&mut self, changed: &[u8]) {
        if !B::ROW.has_links() {
            return;
        }
        for (slot, channels) in changed.iter().enumerate() {
            let ports = self.points.ports();
            let (Some(sources), Some(port)) = (self.linking.sources.get_mut(slot), ports.get(slot))
            else {
                continue;
            };
            for channel in (0..CHANNELS).filter(|channel| channels >> channel & 1 != 0) {
                // As after a power-on.
                begin_source(sources, port, channel, true);
            }
        }
        for slot in 0..B::PORTS {
            let written = self.config.take_written_links(slot);
            let links = (0..OF_A_SLOT).map(|index| self.config.link(slot, index));
            let of_changed = links.clone().enumerate().filter(|(_, link)| {
                let place = link.source().and_then(|point| Points::<B>::index_of(point));
                place.is_some_and(|(slot, channel)| {
                    changed
                        .get(slot)
                        .is_some_and(|channels| channels >> channel & 1 != 0)
                })
            });
            let of_changed = of_changed.fold(0, |mask, (index, _)| mask | 1 << index);
            let port = self.points.ports().get(slot);
            if let (Some(outputs), Some(port)) = (self.linking.outputs.get_mut(slot), port) {
                outputs.set_up(links);
                // A held output has what its links want, whatever this request has written.
                let held = outputs.held();
                let on = port.channels().bits() & !held.outputs | held.on;
                outputs.forget(of_changed, on);
                outputs.written(written);
                outputs.hold();
                let held = outputs.held();
                self.points.take_held(slot, held);
            }
        }
    }

    /// Advances the links by `ms` milliseconds, at the beginning of a scan. `second`: a second of the uptime has begun.
    pub(super) fn tick_links(&mut self, ms: u32, second: bool) {
        if !B::ROW.has_links() {
            return;
        }
        self.linking.alone = self.comm_watchdog.has_expired();
        self.linking.look = second;
        self.linking.holding = false;
        for outputs in self.linking.outputs.iter_mut() {
            outputs.tick(ms, self.linking.alone);
            self.linking.holding |= outputs.is_holding();
        }
    }

    /// Stores the inputs of a slot as sources after a scan: the codes of the lines, and the digital inputs that have
    /// changed, channel 1 in bit 0. `ms` is the time since the previous scan in milliseconds.
    pub(super) fn scanned_sources(&mut self, slot: usize, codes: &Codes, changed: u8, ms: u32) {
        if B::ROW.has_links()
            && let Some(port) = self.points.ports().get(slot)
            && let Some(sources) = self.linking.sources.get_mut(slot)
        {
            for (channel, (code, settings)) in codes.iter().zip(port.settings()).enumerate() {
                if const { B::ROW.has_analog_inputs() }
                    && let Some(code) = code
                    && port.kind(channel) == Kind::WordInput
                {
                    sources.add_code(channel, *code, settings);
                }
            }
            sources.scanned(port.failing(), changed, ms);
        }
    }

    /// Ends the pulses of a slot's outputs, and runs the links to them with the inputs of the last scan.
    pub fn run_links(&mut self, slot: usize) {
        if !B::ROW.has_links() {
            return;
        }
        let now = self.state.millis();
        if let Some(port) = self.points.ports_mut().get_mut(slot) {
            port.end_pulses(now);
        }
        if self
            .linking
            .outputs
            .get(slot)
            .is_some_and(Outputs::are_to_run)
        {
            self.run_slot(slot, now);
        }
    }

    #[inline(never)]
    fn run_slot(&mut self, slot: usize, now: u32) {
        let Self {
            config,
            points,
            linking,
            ..
        } = self;
        let Linking {
            outputs,
            sources,
            alone,
            look,
            ..
        } = linking;
        let Some(outputs) = outputs.get_mut(slot) else {
            return;
        };
        for index in bits(outputs.levels().into()) {
            let link = config.link(slot, index);
            let safe = points
                .ports()
                .get(slot)
                .and_then(|port| port.safe_bit(index % CHANNELS));
            let place = link.source().and_then(|point| Points::<B>::index_of(point));
            if let Some((of, channel)) = place
                && let (Some(port), Some(sources)) = (points.ports().get(of), sources.get(of))
            {
                outputs.look(index, link, source(port, sources, channel), safe, *look);
            }
        }
        outputs.hold();
        let held = outputs.held();
        points.take_held(slot, held);
        let before = points
            .ports()
            .get(slot)
            .map_or(0, |port| port.channels().bits());
        let mut named = 0;
        for index in bits(outputs.acting_edges(*alone).into()) {
            let link = config.link(slot, index);
            let place = link.source().and_then(|point| Points::<B>::index_of(point));
            if let Some((of, from)) = place
                && sources
                    .get(of)
                    .is_some_and(|sources| sources.has_edge(from))
                && let (Some(port), Some(of)) = (points.ports().get(slot), points.ports().get(of))
                && let output = port.channels().bit(index % CHANNELS)
                && let Some(act) = link.at_edge(of.channels().bit(from), output)
            {
                named |=
                    u8::from(points.act(slot, index % CHANNELS, act, now)) << (index % CHANNELS);
            }
        }
        if named != 0 {
            points.settle_slot(slot, before, named);
        }
        if held.outputs != 0 {
            points.hold(slot, held);
        }
    }

    /// Returns the digital channels of a slot for the scan to drive, channel 1 in bit 0, `ms` milliseconds after the last
    /// scan, 0 for a scan because of a write. Outputs that links hold have what the links want, whatever a request has written
    /// since the links ran.
    pub fn drive(&mut self, slot: usize, ms: u32) -> u8 {
        let links = self
            .linking
            .outputs
            .get(slot)
            .filter(|_| B::ROW.has_links());
        let held = links.map_or_else(Held::default, Outputs::held);
        let manual = if B::ROW.stage && self.config.modules().get(slot) == Some(&Module::Relay2) {
            let bits = self
                .points
                .ports()
                .get(slot)
                .map_or(0, |port| port.channels().bits());
            (bits & 0b11) << 2
        } else {
            0
        };
        self.points.drive(slot, held, manual, ms)
    }

    /// Ends the hold of the links that act only while there is no master: a master has written the outputs of a span.
    #[inline(always)]
    pub(super) fn end_holds(&mut self, start: u16, count: u16) {
        if B::ROW.has_links() && self.linking.holding {
            self.end_holds_now(start, count);
        }
    }

    #[cold]
    #[inline(never)]
    fn end_holds_now(&mut self, start: u16, count: u16) {
        for point in start..start.wrapping_add(count) {
            if let Some((slot, channel)) = Points::<B>::index_of(point)
                && let Some(outputs) = self.linking.outputs.get_mut(slot)
            {
                outputs.end_hold(1 << channel);
                self.points.take_held(slot, outputs.held());
            }
        }
    }
}

/// Starts the wait of a source until it has a value: after a reset, or after a change of the source's settings.
fn begin_source<B: Board>(sources: &mut Sources, port: &IoPort<B>, channel: usize, long: bool) {
    let is_digital = port.kind(channel) == Kind::BitInput;
    let debounce = port.setting(channel).filter(|_| is_digital);
    let debounce = debounce.map_or(0, |setting| setting.filter);
    let wait = if long || !is_digital {
        AFTER_POWER_ON_MS
    } else {
        0
    };
    sources.begin(channel, wait + debounce);
}

/// Returns the level, the word or the missing value of a channel, for a level link.
fn source<B: Board>(port: &IoPort<B>, sources: &Sources, channel: usize) -> Source {
    let channels = port.channels();
    if !sources.has_value(channel) {
        Source::NoValue {
            good: sources.is_good(channel),
        }
    } else if !const { B::ROW.has_analog_inputs() } || port.kind(channel) == Kind::BitInput {
        Source::Bit(channels.bit(channel))
    } else if sources.is_uncertain(channel) {
        Source::Uncertain
    } else {
        Source::Word(channels.word(channel))
    }
}

/// Returns the numbers of the bits that are set.
pub(super) fn bits(mut mask: u32) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let bit = mask.trailing_zeros() as usize;
        let is_set = mask != 0;
        mask &= mask.wrapping_sub(1);
        is_set.then_some(bit)
    })
}
