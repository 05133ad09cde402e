//! The events of function 70: the changes that wait to be reported.
//!
//! Edges of digital inputs wait in order. For outputs and words only the last value is reported, so a mark is enough for
//! each. What a master switches on is not stored: it is off after a start.

use heapless::Deque;
use modbus_server::fast::{Kind as EventKind, Packet, Setting, Waiting};
use modio_drivers::{CHANNELS, Kind};
use register_map::board::{Board, Each};

use super::port::IoPort;

/// Number of edges that can wait.
const EDGES: usize = 32;
/// Time between two looks at words, in ms: a point has at most ten events in a second.
const WORDS_MS: u32 = 100;

/// The new level of a waiting edge. The index of the point is below it.
const LEVEL: u8 = 1 << 7;

/// What waits to be reported.
#[derive(Debug)]
pub struct Events<B: Board> {
    ports: Each<B::Ports, PortEvents>,
    edges: Deque<u8, EDGES>,
    /// Number of edges in front that the packet has.
    edges_in_packet: u8,
    /// Edges were lost.
    lost: bool,
    /// The packet says that edges were lost.
    lost_in_packet: bool,
    /// The start is reported.
    started: bool,
}

/// The events of one port. Each byte is a set of channels, channel 1 in bit 0.
#[derive(Clone, Copy, Debug, Default)]
struct PortEvents {
    on: u8,
    high: u8,
    /// The state is to be reported.
    due: u8,
    /// The packet has the state.
    in_packet: u8,
    /// Values as last reported.
    reported: [u16; CHANNELS],
}

impl<B: Board> Events<B> {
    /// Returns the events of a unit that has just started: only that it has started.
    pub fn new() -> Self {
        Self {
            ports: Each::all(PortEvents::default()),
            edges: Deque::new(),
            edges_in_packet: 0,
            lost: false,
            lost_in_packet: false,
            started: true,
        }
    }

    /// Adds an edge of a digital input, given the index of its slot, its channel and the new level.
    pub fn edge(&mut self, slot: usize, channel: usize, level: bool) {
        let port = self.ports.get(slot);
        // A state that is to be reported includes the edge.
        if self.lost || port.is_none_or(|port| port.on & !port.due & (1 << channel) == 0) {
            return;
        }
        let edge = (slot * CHANNELS + channel) as u8 | if level { LEVEL } else { 0 };
        self.lost = self.edges.push_back(edge).is_err();
    }

    /// Looks for changes of outputs, and of words every [`WORDS_MS`].
    pub fn look(&mut self, slot: usize, port: &IoPort<B>, now_ms: u32) {
        let Some(own) = self.ports.get_mut(slot).filter(|own| own.on != 0) else {
            return;
        };
        let words = now_ms.is_multiple_of(WORDS_MS);
        for (channel, before) in own.reported.into_iter().enumerate() {
            let smallest = match port.kind(channel) {
                Kind::BitOutput => 1,
                Kind::WordOutput if words => 1,
                Kind::WordInput if words => port.deadband(channel),
                _ => continue,
            };
            // Also across 0, where a temperature changes its sign.
            let change = port.value(channel).wrapping_sub(before).cast_signed();
            if change.unsigned_abs() >= smallest {
                own.due |= 1 << channel & own.on;
            }
        }
    }

    /// Switches the events of a point on or off: id and kind as in the request. Returns whether they are on.
    #[inline(never)]
    pub fn set(&mut self, ports: &[IoPort<B>], first: u16, kind: u8, id: u16, to: Setting) -> bool {
        let on = to != Setting::Off;
        if kind == EventKind::Unit as u8 && id == EventKind::STARTED {
            self.started = on;
            return on;
        }
        let index = usize::from(id.wrapping_sub(first));
        let (slot, channel) = (index / CHANNELS, index % CHANNELS);
        let (Some(own), Some(port)) = (self.ports.get_mut(slot), ports.get(slot)) else {
            return false;
        };
        if kind_of(port, channel).is_none_or(|own| own as u8 != kind) {
            return false;
        }
        if !on {
            // Edges of this point that wait are no longer reported.
            let in_packet = usize::from(self.edges_in_packet);
            for n in 0..self.edges.len() {
                let Some(edge) = self.edges.pop_front() else {
                    break;
                };
                if usize::from(edge & !LEVEL) != index {
                    let _ = self.edges.push_back(edge);
                } else if n < in_packet {
                    self.edges_in_packet -= 1;
                }
            }
        }
        let bit = 1 << channel;
        for (set, on) in [
            (&mut own.on, on),
            (&mut own.due, on),
            (&mut own.high, to == Setting::High),
            (&mut own.in_packet, false),
        ] {
            *set = *set & !bit | if on { bit } else { 0 };
        }
        on
    }

    /// Returns what waits, and what a packet has that was not on the line yet.
    #[inline(never)]
    pub fn waiting(&self) -> Waiting {
        let mut count = self.edges.len() + usize::from(self.lost || self.lost_in_packet);
        let mut is_high = false;
        for port in self.ports.iter() {
            let waits = port.due | port.in_packet;
            count += waits.count_ones() as usize;
            is_high |= waits & port.high != 0;
        }
        for edge in &self.edges {
            let index = usize::from(edge & !LEVEL);
            let port = self.ports.get(index / CHANNELS);
            is_high |= port.is_some_and(|port| port.high >> (index % CHANNELS) & 1 != 0);
        }
        Waiting {
            // At most 32 edges, 1 and 32 points.
            count: count as u8,
            is_high,
        }
    }

    /// Returns whether the start of the unit is reported.
    pub const fn reports_start(&self) -> bool {
        self.started
    }

    /// The master knows of the start.
    pub const fn start_is_known(&mut self) {
        self.started = false;
    }

    /// Adds events to a packet: first the edges, in order, then the states of points. What an earlier packet has waits again
    /// before.
    #[inline(never)]
    pub fn fill(&mut self, packet: &mut Packet, ports: &[IoPort<B>], first: u16) {
        self.edges_in_packet = 0;
        self.lost |= core::mem::take(&mut self.lost_in_packet);
        for own in self.ports.iter_mut() {
            own.due |= core::mem::take(&mut own.in_packet);
        }
        for edge in &self.edges {
            let id = first.wrapping_add((edge & !LEVEL).into());
            if !packet.push(EventKind::DiscreteInput, id, (edge >> 7).into()) {
                return;
            }
            self.edges_in_packet += 1;
        }
        if self.lost {
            if !packet.push(EventKind::Lost, 0, 0) {
                return;
            }
            (self.lost, self.lost_in_packet) = (false, true);
            self.ports.iter_mut().for_each(|port| port.due = port.on);
        }
        let mut id = first;
        for (own, port) in self.ports.iter_mut().zip(ports) {
            for (channel, reported) in own.reported.iter_mut().enumerate() {
                let bit = 1 << channel;
                if own.due & bit != 0
                    && let Some(kind) = kind_of(port, channel)
                {
                    let value = port.value(channel);
                    if !packet.push(kind, id, value) {
                        return;
                    }
                    own.due &= !bit;
                    own.in_packet |= bit;
                    *reported = value;
                }
                id = id.wrapping_add(1);
            }
        }
    }

    /// The packet that was filled last has been on the line.
    #[inline(never)]
    pub fn sent(&mut self) {
        for _ in 0..core::mem::take(&mut self.edges_in_packet) {
            self.edges.pop_front();
        }
        self.lost_in_packet = false;
        for own in self.ports.iter_mut() {
            own.in_packet = 0;
        }
    }
}

/// Returns the kind of a channel's events.
fn kind_of<B: Board>(port: &IoPort<B>, channel: usize) -> Option<EventKind> {
    match port.kind(channel) {
        Kind::None => None,
        Kind::BitInput => Some(EventKind::DiscreteInput),
        Kind::BitOutput => Some(EventKind::Coil),
        Kind::WordInput => Some(EventKind::InputRegister),
        Kind::WordOutput => Some(EventKind::HoldingRegister),
    }
}
