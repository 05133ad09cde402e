//! The device as a master accesses it, through a server and a port.

extern crate std;

mod edges;
mod events;
mod files;
mod keeping;
mod links;
mod over_the_air;
mod points;
mod stage;
mod state;
mod updating;

use std::{boxed::Box, vec::Vec};

use modbus_server::line::{Faults, Framing, Port, Receiver};
use modbus_server::{Adu, Server, crc};
use modio_drivers::ChannelStatus;
use modio_drivers::{Kind, Scale};
use register_map::board::{EthIo5r, MODIO_02, MODIO_08, Modio02, Modio08};
use register_map::{Module, configuration as at, state as state_map};

use super::*;
use crate::config::Settings;

/// A device with these modules in its slots, these stored settings, and a server.
struct Rig<B: Board = Modio02> {
    device: &'static mut Device<B>,
    server: Server,
}

impl Rig {
    fn new(module: Module, settings: &[(u16, u16)]) -> Self {
        Self::on([module], settings)
    }
}

impl<B: Board> Rig<B> {
    fn on<const PORTS: usize>(modules: [Module; PORTS], settings: &[(u16, u16)]) -> Self {
        let ports = B::ROW.ports().map(at::module_of);
        let mut pairs: Vec<_> = ports.zip(modules.map(Module::code)).collect();
        pairs.extend_from_slice(settings);
        let (settings, rejected) = Settings::load(pairs.into_iter());
        assert_eq!(rejected, 0);
        let identity = Identity {
            unit: 1,
            reset_cause: 0b11_0000,
            unique_id: [1, 2, 3, 4, 5, 6],
            fault: [3; 16],
            internal_oscillator: false,
            serial_number: 0x0D00_1234,
            reports_events: true,
            build: 0,
        };
        Self {
            device: Device::new_in(
                Box::leak(Box::new_uninit()),
                Config::new(settings, false),
                identity,
            ),
            server: Server::new(Framing::Rtu),
        }
    }

    /// Sends a PDU to this unit, executes the resulting command, and returns the reply's PDU.
    fn ask(&mut self, pdu: &[u8]) -> Vec<u8> {
        let mut adus = [Adu::new(), Adu::new()];
        let mut port = Port::new(Receiver::rtu(1, false), &mut adus);
        port.long_silence(0);
        let body = [&[1], pdu].concat();
        let crc = body.iter().fold(crc::START, |crc, b| crc::step(crc, *b));
        for byte in body.into_iter().chain(crc.to_le_bytes()) {
            port.received(byte, Faults::NONE);
        }
        assert!(port.long_silence(0));
        let request = port.take().expect("a request waits");
        let reply = self.server.serve(request, self.device);
        port.send(reply, 0);
        if let Some(order) = self.device.end_request() {
            self.device.carry_out(order, LineName::Rs485);
        }
        let mut reply: Vec<u8> = port.start().into_iter().collect();
        while let Some(byte) = port.next_byte() {
            reply.push(byte);
        }
        reply[1..reply.len() - 2].to_vec()
    }

    fn read(&mut self, address: u16, count: u16) -> Result<Vec<u16>, u8> {
        let [[a, b], [c, d]] = [address, count].map(u16::to_be_bytes);
        let reply = self.ask(&[3, a, b, c, d]);
        if reply[0] & 0x80 != 0 {
            return Err(reply[1]);
        }
        let words = reply[2..].chunks(2);
        Ok(words.map(|w| u16::from_be_bytes([w[0], w[1]])).collect())
    }

    fn write(&mut self, address: u16, values: &[u16]) -> Result<(), u8> {
        let [[a, b], [c, d]] = [address, values.len() as u16].map(u16::to_be_bytes);
        let mut pdu = std::vec![16, a, b, c, d, values.len() as u8 * 2];
        pdu.extend(values.iter().flat_map(|value| value.to_be_bytes()));
        let reply = self.ask(&pdu);
        if reply[0] & 0x80 != 0 {
            return Err(reply[1]);
        }
        Ok(())
    }

    fn unlock(&mut self) {
        assert_eq!(self.ask(&[6, 1, 0, 0x5A, 0x17])[0], 6);
    }

    fn scan(&mut self, set: impl FnOnce(&mut modio_drivers::Channels)) {
        self.scan_port(0, set);
    }

    /// Runs a scan, in which the inputs of the port with this index change.
    fn scan_port(&mut self, index: usize, set: impl FnOnce(&mut modio_drivers::Channels)) {
        let mut channels = self
            .device
            .points
            .ports()
            .iter()
            .map(|port| *port.channels())
            .collect::<Vec<_>>();
        set(&mut channels[index]);
        for (slot, channels) in channels.iter().enumerate() {
            self.device.scanned(slot, channels, &[None; 4], true, 1);
        }
        (0..B::PORTS).for_each(|slot| self.device.run_links(slot));
    }

    /// Runs scans for this time.
    fn pass(&mut self, ms: u32) {
        for _ in 0..ms {
            self.device.tick(1);
            self.scan_port(0, |_| {});
        }
    }
}
