extern crate std;
use std::vec::Vec;

use modbus_server::line::{Faults, Framing, Next, Port, Receiver};
use modbus_server::{Adu, Server};
use modio_drivers::ChannelStatus;
use modio_drivers::Scale;
use register_map::board::{MODIO_02, MODIO_08};
use register_map::{Board, Module, configuration as at};

use super::*;
use crate::config::Settings;

/// A device with these modules in its slots and these settings stored, and a server in front of it.
struct Bench<const SLOTS: usize = 1> {
    device: Device<SLOTS>,
    server: Server,
}

/// CRC-16/MODBUS (V1.02 6.2.2), low byte first.
fn crc(bytes: &[u8]) -> [u8; 2] {
    let mut register = 0xFFFF;
    for byte in bytes {
        register ^= u16::from(*byte);
        for _ in 0..8 {
            let carry = register & 1;
            register = (register >> 1) ^ (carry * 0xA001);
        }
    }
    register.to_le_bytes()
}

impl Bench {
    fn new(module: Module, settings: &[(u16, u16)]) -> Self {
        Self::on(&MODIO_02, [module], settings)
    }
}

impl<const SLOTS: usize> Bench<SLOTS> {
    fn on(board: &'static Board, modules: [Module; SLOTS], settings: &[(u16, u16)]) -> Self {
        let ports = board.ports().map(at::module_of);
        let mut pairs: Vec<_> = ports.zip(modules.map(Module::code)).collect();
        pairs.extend_from_slice(settings);
        let (settings, rejected) = Settings::load(board, pairs.into_iter());
        assert_eq!(rejected, 0);
        let identity = Identity {
            unit: 1,
            reset_cause: 0b11_0000,
            unique_id: [1, 2, 3, 4, 5, 6],
            fault: [3; 16],
            internal_oscillator: false,
        };
        Self {
            device: Device::new(
                modules.map(Module::points),
                Config::new(board, settings, false),
                identity,
                if *board == MODIO_02 {
                    const { &Fixed::of(&MODIO_02) }
                } else {
                    const { &Fixed::of(&MODIO_08) }
                },
            ),
            server: Server::new(Framing::Rtu),
        }
    }

    /// The reply's PDU to a PDU for this unit, and what follows from it.
    fn ask(&mut self, pdu: &[u8]) -> Vec<u8> {
        let mut adus = [Adu::new(), Adu::new()];
        let mut port = Port::new(Receiver::rtu(1, false), &mut adus);
        port.long_silence(0);
        let body = [&[1], pdu].concat();
        for byte in body.iter().chain(&crc(&body)) {
            port.received(*byte, Faults::NONE);
        }
        assert!(port.long_silence(0));
        let request = self.server.take(&mut port, 0).expect("a request waits");
        let answered = request.decide(&self.server, &self.device).answer(&mut port);
        let committed = answered.commit(&mut self.server);
        if Device::<SLOTS>::shows_counters(&committed.decision().work) {
            self.device.state.counters = self.server.counters();
        }
        let served = committed.carry_out(&mut self.server, &mut self.device);
        served.finish(&mut port);
        if let Some(order) = self.device.take_order() {
            self.device.carry_out(order);
        }
        let mut reply: Vec<u8> = port.start().into_iter().collect();
        while let Next::Byte(byte) = port.next() {
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

    /// A scan of the board's port with this index.
    fn scan_port(&mut self, index: usize, set: impl FnOnce(&mut modio_drivers::Channels)) {
        let port = &mut self.device.points.ports_mut()[index];
        let mut channels = *port.channels();
        set(&mut channels);
        port.scanned(&channels, true);
    }
}

#[test]
fn what_runs_keeps_its_settings_once_the_module_is_to_change() {
    let settings = [
        (at::SCALE + 0x12, 1),
        (at::SAFE + 0x12, 1000),
        (at::COMM_TIMEOUT, 1),
    ];
    let mut bench = Bench::new(Module::Ai2Ao2, &settings);
    bench.unlock();
    assert_eq!(bench.write(0x12, &[10_000]), Ok(()), "millivolts");
    assert_eq!(bench.write(at::MODULE + 4, &[Module::Ao4.code()]), Ok(()));
    assert_eq!(bench.read(at::SCALE + 0x12, 1), Ok(std::vec![0]));
    assert_eq!(bench.read(0x12, 1), Ok(std::vec![10_000]));
    assert_eq!(bench.write(0x12, &[2000]), Ok(()));
    let before = *bench.device.points.ports()[0].settings();
    assert_eq!(before[2].scale, Scale::Engineering);

    // SAFE is raw, 1000 of 4095 is 2.442 V.
    bench.device.request_seen(0);
    while !bench.device.tick(1) {}
    assert_eq!(bench.read(0x12, 1), Ok(std::vec![2442]));

    assert_eq!(
        bench.write(at::MODULE + 4, &[Module::Ai2Ao2.code()]),
        Ok(())
    );
    assert_eq!(
        bench.device.points.ports()[0].settings()[2].scale,
        before[2].scale
    );
    assert_eq!(bench.read(0x12, 1), Ok(std::vec![2442]), "nothing jumps");
}

#[test]
fn four_modules_answer_at_their_own_addresses() {
    let modules = [Module::Di4, Module::Do4, Module::Ai4, Module::Ao4];
    let mut bench = Bench::on(&MODIO_08, modules, &[(at::SAFE + 13, 7)]);
    bench.scan_port(0, |channels| channels.set_bit(2, true));
    bench.scan_port(2, |channels| channels.set_word(3, 1234));
    // Inputs of port 1 and outputs of port 2 in one request, bits 0 to 7.
    assert_eq!(bench.ask(&[5, 0, 4, 0xFF, 0]), [5, 0, 4, 0xFF, 0]);
    assert_eq!(bench.ask(&[1, 0, 0, 0, 8]), [1, 1, 0b0001_0100]);
    // Inputs of port 3 and outputs of port 4, words 8 to 15.
    assert_eq!(bench.write(12, &[1, 2, 3, 4]), Ok(()));
    let words = std::vec![0, 0, 0, 1234, 1, 2, 3, 4];
    assert_eq!(bench.read(8, 8), Ok(words));
    assert_eq!(bench.read(7, 2), Err(2), "a bit and a word");
    assert_eq!(bench.read(8, 9), Err(2), "beyond the last port");
    assert_eq!(bench.write(11, &[0, 0]), Err(2), "an input");
    assert_eq!(bench.read(0x10, 1), Err(2), "port 5 has no slot");

    let state = |bench: &mut Bench<4>| bench.read(0x0218, 8).unwrap();
    let modules = std::vec![1, 2, 4, 5, 0, 0, 0, 0];
    assert_eq!(bench.read(0x0210, 8), Ok(modules));
    assert_eq!(state(&mut bench), [0, 0, 0, 0, 1, 1, 1, 1]);
    assert_eq!(bench.read(0x0205, 1), Ok(std::vec![2]));
    bench.device.points.ports_mut()[3].set_failing(0b1111);
    assert_eq!(state(&mut bench), [0, 0, 0, 2, 1, 1, 1, 1]);
    assert_eq!(bench.read(8, 4).map(|words| words[3]), Ok(1234));
    assert_eq!(bench.read(8, 8), Err(4), "port 4 does not answer");
    bench.device.points.ports_mut()[3].set_failing(0);

    // The pulses of port 1, channel 3, and SAFE of port 4, channel 2.
    bench.scan_port(0, |channels| channels.set_bit(2, false));
    bench.scan_port(0, |channels| channels.set_bit(2, true));
    assert_eq!(bench.read(0x0300 + 4, 2), Ok(std::vec![0, 1]));
    bench.unlock();
    assert_eq!(bench.write(at::COMM_TIMEOUT, &[1]), Ok(()));
    while !bench.device.tick(1) {}
    assert_eq!(bench.read(12, 4), Ok(std::vec![0, 7, 0, 0]));
    assert_eq!(bench.ask(&[1, 0, 4, 0, 1]), [1, 1, 0]);
}

#[test]
fn points_exist_as_their_module_has_them() {
    for module in Module::ALL {
        let mut bench = Bench::new(module, &[]);
        for (channel, kind) in (0u16..).zip(module.points()) {
            let address = 0x10 + channel;
            let low = address as u8;
            let is_bit = matches!(kind, Kind::BitInput | Kind::BitOutput);
            let is_word = matches!(kind, Kind::WordInput | Kind::WordOutput);
            for function in [1, 2] {
                let reply = bench.ask(&[function, 0, low, 0, 1]);
                assert_eq!(
                    reply[0] & 0x80 == 0,
                    is_bit,
                    "{module} {channel} by {function}"
                );
            }
            assert_eq!(
                bench.read(address, 1).is_ok(),
                is_word,
                "{module} {channel}"
            );
            let coil = bench.ask(&[5, 0, low, 0xFF, 0]);
            assert_eq!(coil[0] == 5, kind == Kind::BitOutput, "{module} {channel}");
            let written = bench.write(address, &[1]);
            assert_eq!(
                written.is_ok(),
                kind == Kind::WordOutput,
                "{module} {channel}"
            );
        }
        assert_eq!(bench.read(0x14, 1), Err(2));
        assert_eq!(bench.read(0x0F, 2), Err(2));
    }
}

#[test]
fn inputs_follow_the_scan_and_outputs_keep_what_was_commanded() {
    let mut bench = Bench::new(Module::Ai2Ao2, &[]);
    bench.write(0x12, &[100, 200]).unwrap();
    bench.scan(|channels| {
        channels.set_word(0, 7);
        channels.set_word(1, 8);
        channels.set_word(2, 9);
        channels.set_status(1, ChannelStatus::OverRange);
    });
    assert_eq!(bench.read(0x10, 4), Ok(std::vec![7, 8, 100, 200]));
    assert_eq!(bench.read(0x0250, 4), Ok(std::vec![0, 2, 0, 0]));
    assert_eq!(
        bench.read(0x021C, 1),
        Ok(std::vec![3]),
        "a channel out of signal"
    );
    assert_eq!(bench.read(0x020A, 1).unwrap()[0] & 4, 4);
}

#[test]
fn a_written_word_must_suit_range_and_scale_and_all_of_a_write_or_none() {
    let ua = [
        (at::RANGE + 0x11, 1),
        (at::SCALE + 0x11, 1),
        (at::SCALE + 0x12, 1),
    ];
    let mut bench = Bench::new(Module::Ao4, &ua);
    // Raw, uA, mV, raw.
    bench.write(0x10, &[4095, 4000, 10_000, 0]).unwrap();
    for bad in [
        [4096, 4000, 0, 0],
        [0, 3999, 0, 0],
        [0, 20_001, 0, 0],
        [0, 4000, 10_001, 0],
    ] {
        assert_eq!(bench.write(0x10, &bad), Err(3), "{bad:?}");
    }
    assert_eq!(bench.read(0x10, 4), Ok(std::vec![4095, 4000, 10_000, 0]));
    assert_eq!(
        bench.write(0x13, &[5000, 5000]),
        Err(2),
        "the address comes before the value"
    );
}

#[test]
fn a_new_scale_does_not_move_an_output() {
    let mut bench = Bench::new(Module::Ao4, &[]);
    bench.write(0x10, &[2048]).unwrap();
    bench.unlock();
    bench.write(at::SCALE + 0x10, &[1]).unwrap();
    assert_eq!(bench.read(0x10, 1), Ok(std::vec![5001]), "mV, at once");
    bench.write(at::SCALE + 0x10, &[0]).unwrap();
    assert_eq!(bench.read(0x10, 1), Ok(std::vec![2048]));
}

#[test]
fn a_failing_channel_answers_04_and_leaves_the_others_alone() {
    let mut bench = Bench::new(Module::Ai2Ao2, &[]);
    // The DAC, which serves channels 3 and 4.
    bench.device.points.ports_mut()[0].set_failing(0b1100);
    assert_eq!(bench.read(0x10, 2), Ok(std::vec![0; 2]));
    assert_eq!(bench.read(0x12, 1), Err(4));
    assert_eq!(bench.read(0x11, 2), Err(4), "one of two fails");
    assert_eq!(bench.write(0x12, &[1, 2]), Err(4));
    assert_eq!(bench.read(0x021C, 1), Ok(std::vec![2]));
    // One input.
    bench.device.points.ports_mut()[0].set_failing(0b0010);
    assert_eq!(bench.read(0x11, 1), Err(4));
    assert_eq!(bench.read(0x10, 1), Ok(std::vec![0]));
    bench.write(0x12, &[1, 2]).unwrap();
    assert_eq!(bench.read(0x021C, 1), Ok(std::vec![2]));
}

#[test]
fn a_module_that_does_not_answer_is_04_after_all_other_checks() {
    let mut bench = Bench::new(Module::Ao4, &[]);
    bench.device.points.ports_mut()[0].set_failing(0b1111);
    assert_eq!(bench.read(0x10, 4), Err(4));
    assert_eq!(bench.write(0x10, &[1]), Err(4));
    assert_eq!(bench.write(0x10, &[4096]), Err(3));
    assert_eq!(bench.read(0x14, 1), Err(2));
    assert_eq!(bench.read(0x021C, 1), Ok(std::vec![2]));
    bench.device.points.ports_mut()[0].set_failing(0);
    assert_eq!(bench.read(0x10, 4), Ok(std::vec![0; 4]));
}

#[test]
fn outputs_start_at_start_and_go_to_safe_in_silence() {
    let stored = [
        (at::START + 0x10, 1),
        (at::START + 0x12, 1),
        (at::SAFE + 0x11, 1),
        (at::SAFE + 0x12, at::HOLD),
        (at::COMM_TIMEOUT, 5),
    ];
    let mut bench = Bench::new(Module::Do4, &stored);
    let bits = |bench: &mut Bench| bench.ask(&[1, 0, 0x10, 0, 4])[2];
    assert_eq!(bits(&mut bench), 0b0101);
    bench.device.request_seen(0);
    let trips = (1..=600).filter(|_| bench.device.tick(1)).count();
    assert_eq!(trips, 1);
    assert_eq!(bits(&mut bench), 0b0110, "off, on, held, off");
    let status = |bench: &mut Bench| bench.read(0x020A, 1).unwrap()[0] & 1;
    assert_eq!(status(&mut bench), 1);
    // Outputs stay until they are written; the flag until it is cleared.
    bench.device.request_seen(bench.device.state.millis());
    assert_eq!(bits(&mut bench), 0b0110);
    bench.ask(&[5, 0, 0x10, 0xFF, 0]);
    assert_eq!(bits(&mut bench), 0b0111);
    bench.unlock();
    bench.write(at::COMMAND, &[5]).unwrap();
    assert_eq!(status(&mut bench), 0);
}

#[test]
fn pulses_are_counted_on_rising_edges_and_cleared_whole() {
    let mut bench = Bench::new(Module::Di4, &[]);
    bench.scan(|channels| channels.set_bit(0, true));
    assert_eq!(
        bench.read(0x0320, 2),
        Ok(std::vec![0, 0]),
        "as it stood at the start"
    );
    for n in 0..0x1_0003 {
        bench.scan(|channels| channels.set_bit(1, n % 2 == 0));
    }
    assert_eq!(bench.read(0x0322, 2), Ok(std::vec![0, 0x8002]));
    for (address, values) in [
        (0x0322, &[0][..]),
        (0x0323, &[0, 0]),
        (0x0322, &[0, 1]),
        (0x0321, &[0, 0, 0]),
    ] {
        assert_eq!(bench.write(address, values), Err(3), "{address:#x}");
    }
    assert_eq!(bench.read(0x0322, 2), Ok(std::vec![0, 0x8002]));
    bench.write(0x0322, &[0, 0]).unwrap();
    assert_eq!(bench.read(0x0322, 2), Ok(std::vec![0, 0]));
    assert_eq!(bench.read(0x0300, 64).unwrap(), [0; 64]);
    assert_eq!(bench.read(0x0300, 65), Err(2));
}

#[test]
fn identity_and_state_are_read_and_never_written() {
    let mut bench = Bench::new(Module::Relay2, &[]);
    (0..2460).for_each(|_| {
        bench.device.tick(1);
    });
    // One that is late makes up for the time.
    bench.device.tick(40);
    assert_eq!(bench.device.state.millis(), 2500);
    assert_eq!(bench.read(0x0200, 2), Ok(std::vec![0x2383, 0x5860]));
    assert_eq!(bench.read(0x0204, 4), Ok(std::vec![1, 1, 1, 0b11_0000]));
    assert_eq!(bench.read(0x0208, 2), Ok(std::vec![0, 2]));
    let [high, low] = [crate::built::COMMIT >> 16, crate::built::COMMIT & 0xFFFF];
    let built = std::vec![high as u16, low as u16, crate::built::FLAGS];
    assert_eq!(bench.read(0x020C, 3), Ok(built));
    assert_eq!(bench.read(0x0210, 8), Ok(std::vec![0, 0, 0, 0, 3, 0, 0, 0]));
    assert_eq!(bench.read(0x0218, 8), Ok(std::vec![1, 1, 1, 1, 0, 1, 1, 1]));
    assert_eq!(bench.read(0x0220, 6), Ok(std::vec![1, 2, 3, 4, 5, 6]));
    assert_eq!(bench.read(0x0230, 9).map(|c| c.len()), Ok(9));
    assert_eq!(bench.read(0x0240, 32), Ok(std::vec![0; 32]));
    bench.device.state.line_repairs = 9;
    let mut record = std::vec![3; 16];
    record[13] = 9;
    assert_eq!(bench.read(0x0260, 16), Ok(record));
    for gap in [0x0226, 0x0239, 0x0270, 0x02FF, 0x0340] {
        assert_eq!(bench.read(gap, 1), Err(2), "{gap:#x}");
    }
    assert_eq!(bench.read(0x0225, 2), Err(2), "into a gap");
    assert_eq!(
        bench.read(0x01FF, 2),
        Err(2),
        "from one block into the next"
    );
    assert_eq!(
        bench.read(0x025F, 2),
        Err(2),
        "from one block into the next"
    );
    assert_eq!(bench.write(0x0200, &[1]), Err(2));
    assert_eq!(bench.write(0x0260, &[0]), Err(2));
}

#[test]
fn counters_are_those_of_the_request_that_reads_them() {
    let mut bench = Bench::new(Module::Di4, &[]);
    let requests = state_map::BUS_MESSAGES + 3;
    assert_eq!(bench.read(requests, 1), Ok(std::vec![1]));
    bench.ask(&[0x07]);
    assert_eq!(bench.read(requests, 1), Ok(std::vec![3]));
    // Read by function 17, with the lock opened by the way.
    let [address, key, value] = [requests, at::KEY, at::OPENING_KEY].map(u16::to_be_bytes);
    let request = [&[0x17], &address[..], &[0, 1], &key, &[0, 1, 2], &value];
    assert_eq!(bench.ask(&request.concat()), [0x17, 2, 0, 4]);
    assert_eq!(bench.ask(&[0x08, 0, 0x0E, 0, 0]), [0x08, 0, 0x0E, 0, 5]);
}

#[test]
fn what_cannot_be_done_yet_is_refused() {
    let mut bench = Bench::new(Module::Di4, &[]);
    bench.unlock();
    assert_eq!(bench.write(at::MODE, &[2]), Err(3));
    assert_eq!(bench.write(at::COMMAND, &[0xB007]), Err(3));
    assert_eq!(bench.write(at::LORA, &[1]), Err(3));
    assert_eq!(bench.read(at::BAUD, 3), Ok(std::vec![96, 0, 0]));
    bench.write(at::BAUD, &[192, 1, 1]).unwrap();
}

#[test]
fn the_device_says_who_it_is_and_how_it_fares() {
    let mut bench = Bench::new(Module::Ai4, &[(at::COMM_TIMEOUT, 1)]);
    assert_eq!(bench.ask(&[0x07]), [0x07, 0]);
    assert_eq!(bench.ask(&[0x11]), [0x11, 2, 1, 0xFF]);
    let name = bench.ask(&[0x2B, 0x0E, 4, 0x81]);
    assert_eq!(name[7..], [&[0x81, 3][..], b"4ai"].concat());
    let serial = bench.ask(&[0x2B, 0x0E, 4, 0x80]);
    assert_eq!(serial[9..], *b"000100020003000400050006");
    let regular = bench.ask(&[0x2B, 0x0E, 2, 0]);
    assert_eq!((regular[3], regular[6]), (0x83, 7));

    (0..101).for_each(|_| {
        bench.device.tick(1);
    });
    bench.unlock();
    let status = bench.read(0x020A, 1).unwrap();
    assert_eq!(status, [0b10_0001], "communication lost, unlocked");
    assert_eq!(bench.ask(&[0x07]), [0x07, 0b10_0001]);
    assert_eq!(bench.ask(&[0x08, 0, 2, 0, 0]), [0x08, 0, 2, 0, 0b10_0001]);
    assert_eq!(
        bench.ask(&[0x11]),
        [0x11, 2, 1, 0x00],
        "SAFE has the outputs"
    );
}

#[test]
fn a_masked_setting_is_a_write_like_any_other() {
    let mut bench = Bench::new(Module::Di4, &[]);
    assert_eq!(
        bench.ask(&[0x16, 1, 5, 0xFF, 0, 0, 0x64]),
        [0x96, 6],
        "locked"
    );
    bench.unlock();
    assert_eq!(bench.ask(&[0x16, 1, 5, 0xFF, 0, 0, 0x64])[0], 0x16);
    assert_eq!(bench.read(at::RESPONSE_DELAY, 1), Ok(std::vec![100]));
    assert_eq!(bench.ask(&[0x16, 1, 5, 0xFF, 0xFF, 0, 0])[0], 0x16);
    assert_eq!(
        bench.ask(&[0x16, 1, 5, 0, 0xFF, 0x10, 0]),
        [0x96, 3],
        "4196 ms"
    );
    assert_eq!(bench.ask(&[0x16, 2, 0, 0, 0, 0, 0]), [0x96, 2], "read-only");
}

impl<const SLOTS: usize> Bench<SLOTS> {
    /// Reads records of a file by one request; the exception, or the bytes of all groups.
    fn read_file(&mut self, groups: &[(u16, u16, u16)]) -> Result<Vec<u8>, u8> {
        let mut pdu = std::vec![0x14, groups.len() as u8 * 7];
        for (file, record, count) in groups {
            let [[f1, f0], [r1, r0], [c1, c0]] = [*file, *record, *count].map(u16::to_be_bytes);
            pdu.extend([6, f1, f0, r1, r0, c1, c0]);
        }
        let reply = self.ask(&pdu);
        if reply[0] == 0x94 {
            return Err(reply[1]);
        }
        assert_eq!(usize::from(reply[1]), reply.len() - 2);
        let (mut rest, mut bytes) = (&reply[2..], Vec::new());
        for (_, _, count) in groups {
            let (group, others) = rest.split_at(2 + usize::from(*count) * 2);
            assert_eq!(group[..2], [*count as u8 * 2 + 1, 6]);
            bytes.extend(&group[2..]);
            rest = others;
        }
        assert!(rest.is_empty());
        Ok(bytes)
    }

    /// Reads file 1 from its first record to its last, a few records at a time.
    fn self_description(&mut self) -> Vec<u8> {
        let head = self.read_file(&[(1, 0, 2)]).unwrap();
        let records = modio_description::records(u16::from_be_bytes([head[0], head[1]]));
        let mut file = Vec::new();
        for record in (0..records).step_by(99) {
            let count = (records - record).min(99);
            file.extend(self.read_file(&[(1, record, count)]).unwrap());
        }
        assert_eq!(self.read_file(&[(1, records, 1)]), Err(2), "after the end");
        assert_eq!(self.read_file(&[(1, records - 1, 2)]), Err(2));
        file
    }
}

#[test]
fn file_1_describes_the_unit_with_its_modules_in_force() {
    for module in Module::ALL {
        let mut bench = Bench::new(module, &[]);
        let file = bench.self_description();
        let expected =
            modio_description::describe(&MODIO_02, env!("CARGO_PKG_VERSION"), |_| module);
        assert_eq!(modio_description::Description::open(&file), Ok(expected));
        let crc = bench.read(0x020F, 1).unwrap()[0];
        assert_eq!(crc.to_be_bytes(), file[2..4]);
    }
}

#[test]
fn file_1_describes_all_slots_of_a_board() {
    let modules = [Module::Ai2Ao2, Module::None, Module::Di4, Module::Relay2];
    let mut bench = Bench::on(&MODIO_08, modules, &[]);
    let file = bench.self_description();
    let expected = modio_description::describe(&MODIO_08, env!("CARGO_PKG_VERSION"), |port| {
        modules[usize::from(port - 1)]
    });
    assert_eq!(modio_description::Description::open(&file), Ok(expected));
}

#[test]
fn module_that_is_not_in_force_does_not_change_file_1() {
    let mut bench = Bench::new(Module::Di4, &[]);
    let file = bench.self_description();
    bench.unlock();
    assert_eq!(bench.write(at::module_of(5), &[Module::Ao4.code()]), Ok(()));
    assert_eq!(bench.self_description(), file);
}

#[test]
fn groups_of_one_request_are_read_in_their_order() {
    let mut bench = Bench::new(Module::Di4, &[]);
    let file = bench.self_description();
    let bytes = bench.read_file(&[(1, 5, 2), (1, 0, 1), (1, 5, 1)]).unwrap();
    let expected = [&file[10..14], &file[..2], &file[10..12]].concat();
    assert_eq!(bytes, expected);
    // The longest reply: 251 bytes of groups.
    let longest = bench.read_file(&[(1, 9, 124)]).unwrap();
    assert_eq!(longest, file[18..18 + 248]);
    assert_eq!(bench.read_file(&[(1, 9, 125)]), Err(3));
}

#[test]
fn other_files_return_illegal_data_address() {
    let mut bench = Bench::new(Module::None, &[]);
    for file in [0, 2, 3, 0x100, 0x101, 0xFFFF] {
        assert_eq!(bench.read_file(&[(file, 0, 1)]), Err(2), "file {file}");
        assert_eq!(bench.read_file(&[(1, 0, 1), (file, 0, 1)]), Err(2));
    }
    assert_eq!(bench.ask(&[0x14]), [0x94, 3]);
}

#[test]
fn files_cannot_be_written() {
    let mut bench = Bench::new(Module::None, &[]);
    let file = bench.self_description();
    for number in [1, 2, 0x100] {
        let [f1, f0] = u16::to_be_bytes(number);
        let request = [0x15, 9, 6, f1, f0, 0, 0, 0, 1, 0x12, 0x34];
        assert_eq!(bench.ask(&request), [0x95, 2], "file {number}");
    }
    assert_eq!(bench.ask(&[0x15, 9, 6]), [0x95, 3]);
    assert_eq!(bench.self_description(), file);
}

#[test]
fn identify_is_passed_on_to_the_leds() {
    let mut bench = Bench::new(Module::None, &[]);
    assert_eq!(bench.write(at::COMMAND, &[6]), Err(6), "locked");
    bench.unlock();
    assert_eq!(bench.write(at::COMMAND, &[7]), Err(3));
    assert_eq!(bench.write(at::COMMAND, &[6]), Ok(()));
    let left = bench.device.carry_out(Command::Identify);
    assert_eq!(left, Some(Command::Identify));
}
