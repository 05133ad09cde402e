//! A unit on the bus: the device with its server and its end of the line, and its clock.

use std::collections::VecDeque;
use std::mem::MaybeUninit;

use firmware::config::{Config, LineName, Origin, Settings};
use firmware::device::{Device, Identity};
use modbus_server::fast::{self, Part};
use modbus_server::line::{Arbitration, FastUnit, Faults, Framing, Port, Receiver, Windows};
use modbus_server::{Adu, Server};
use register_map::board::{MODIO_08, Modio08};
use register_map::{Module, configuration};

/// Silences of the line in us.
#[derive(Clone, Copy)]
pub struct Times {
    pub t15: f64,
    pub t35: f64,
}

/// A modio-08 with a 4DI in its first slot.
pub struct Unit {
    pub address: u8,
    device: &'static mut Device<Modio08>,
    server: Server,
    fast: fast::Unit,
    port: Port<'static, FastUnit>,
    /// Levels of the inputs.
    pub levels: u8,
    /// Edges that the device has not seen yet: time in us, input, level.
    edges: VecDeque<(f64, usize, bool)>,
    /// Device's time in ms.
    now_ms: u64,
    /// Time from the master to the unit, in us, and the length of its microsecond.
    pub place: f64,
    pub pace: f64,
    /// Until this time the unit starts.
    pub starts_until: f64,
    /// The end of the last character, and whether a request waits.
    silent_since: f64,
    waits: bool,
}

impl Unit {
    pub fn new(address: u8, place: f64, pace: f64, levels: u8, at: f64) -> Self {
        let modules = [(
            configuration::module_of(MODIO_08.first_port),
            Module::Di4.code(),
        )];
        let (settings, _) = Settings::load(modules.into_iter());
        let serial_number = 0x0D00_0000 + u32::from(address);
        let identity = Identity {
            unit: address,
            serial_number,
            reports_events: true,
            ..Identity::default()
        };
        // A restart leaks some kilobytes.
        let place_of_device = Box::leak(Box::new(MaybeUninit::uninit()));
        let config = Config::new(settings, false);
        let device = Device::new_in(place_of_device, config, identity);
        let units = FastUnit {
            unit: address,
            is_fast: true,
        };
        let adus = Box::leak(Box::new([Adu::new(), Adu::new()]));
        let mut port = Port::new(Receiver::rtu(units, false), adus);
        port.long_silence(0);
        let mut unit = Self {
            address,
            device,
            server: Server::new(Framing::Rtu),
            fast: fast::Unit::new(serial_number, address, Part::Everything),
            port,
            levels,
            edges: VecDeque::new(),
            now_ms: (at / 1000.0) as u64,
            place,
            pace,
            starts_until: at,
            silent_since: at,
            waits: false,
        };
        unit.scan(0);
        unit
    }

    /// Starts again at `at`. What happens until it has started is lost.
    pub fn restart(&mut self, at: f64, lasts_us: f64) {
        let edges = self.edges.split_off(0);
        let until = at + lasts_us;
        for (_, input, level) in edges {
            self.set(input, level);
        }
        *self = Self::new(self.address, self.place, self.pace, self.levels, until);
    }

    fn set(&mut self, input: usize, level: bool) {
        self.levels = self.levels & !(1 << input) | u8::from(level) << input;
    }

    /// Changes an input at `at`.
    pub fn change(&mut self, at: f64, input: usize, level: bool) {
        self.edges.push_back((at, input, level));
    }

    /// Passes the edges up to `at` to the device, each in a separate scan, as after the debounce.
    fn catch_up(&mut self, at: f64) {
        while let Some((time, input, level)) = self.edges.front().copied().filter(|e| e.0 <= at) {
            self.edges.pop_front();
            self.set(input, level);
            let ms = (time / 1000.0) as u64;
            let passed = ms.saturating_sub(self.now_ms);
            self.now_ms += passed;
            self.scan(passed as u32);
        }
    }

    fn scan(&mut self, passed_ms: u32) {
        self.device.tick(passed_ms);
        let mut channels = *self.device.points.ports()[0].channels();
        (0..4).for_each(|n| channels.set_bit(n, self.levels >> n & 1 != 0));
        self.device.scanned(0, &channels, &[None; 4], true, 1);
    }

    /// Receives characters from `start` to `end`, after the silence since the last ones.
    pub fn receive(&mut self, bytes: &[u8], start: f64, end: f64, times: Times) {
        if start < self.starts_until {
            return;
        }
        self.pass_silence(start, times);
        self.waits = false;
        for byte in bytes {
            self.waits |= self.port.received(*byte, Faults::NONE) && self.port.ends_fast_message(0);
        }
        self.silent_since = end;
    }

    /// Passes the silence up to `at`.
    pub fn pass_silence(&mut self, at: f64, times: Times) {
        // Sums of times are not exact.
        let silence = at - self.silent_since + 1e-3;
        if silence >= times.t15 {
            self.port.short_silence(0);
        }
        if silence >= times.t35 {
            self.waits |= self.port.long_silence(0);
        }
    }

    /// Serves the request that has ended at `at`, if there is one. Returns the reply to a request to the unit's own
    /// address. After a request of function 70 the unit takes part in its arbitration.
    pub fn serve(&mut self, at: f64, windows: Windows) -> Option<Vec<u8>> {
        if at < self.starts_until || !core::mem::take(&mut self.waits) {
            return None;
        }
        self.catch_up(at);
        let request = self.port.take()?;
        self.device.set_origin(Origin {
            line: LineName::Rs485,
            broadcast: false,
            by_serial: false,
        });
        if request.unit() == fast::ADDRESS {
            let (reply, contest) = self.server.serve_fast(request, &mut self.fast, self.device);
            let arbitration = Arbitration::new(contest.value, contest.windows, 0, windows);
            self.port.arbitrate(reply, arbitration);
            return None;
        }
        let reply = self.server.serve(request, self.device);
        self.port.send(reply, 0);
        self.device.end_request();
        let mut reply = vec![self.port.start()?];
        reply.extend(std::iter::from_fn(|| self.port.next_byte()));
        self.port.sent();
        Some(reply)
    }

    /// The unit's end of the line, for its arbitration.
    pub fn port(&mut self) -> &mut Port<'static, FastUnit> {
        &mut self.port
    }
}
