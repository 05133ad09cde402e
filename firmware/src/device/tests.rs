extern crate std;
use std::vec::Vec;

use modbus_server::line::Framing;
use modbus_server::{Adu, LineCounters, Server};
use modio_drivers::ChannelStatus;
use register_map::{Module, configuration as at};

use super::*;
use crate::config::Settings;

/// A device with this module in its slot and these settings stored, and a server in front of it.
struct Bench {
    device: Device,
    server: Server,
}

fn kinds(module: Module) -> [Kind; CHANNELS] {
    use Kind::{BitInput, BitOutput, None, WordInput, WordOutput};
    match module {
        Module::None => [None; 4],
        Module::Di4 => [BitInput; 4],
        Module::Do4 => [BitOutput; 4],
        Module::Relay2 => [BitInput, BitInput, BitOutput, BitOutput],
        Module::Ai4 => [WordInput; 4],
        Module::Ao4 => [WordOutput; 4],
        Module::Ai2Ao2 => [WordInput, WordInput, WordOutput, WordOutput],
    }
}

impl Bench {
    fn new(module: Module, settings: &[(u16, u16)]) -> Self {
        let module_setting = (at::MODULE + 4, module.code());
        let pairs = [&[module_setting], settings].concat();
        let (settings, rejected) = Settings::load(pairs.into_iter());
        assert_eq!(rejected, 0);
        let identity = Identity {
            unit: 1,
            reset_cause: 0b11_0000,
            unique_id: [1, 2, 3, 4, 5, 6],
            fault: [3; 16],
            internal_oscillator: false,
        };
        Self {
            device: Device::new(kinds(module), Config::new(settings, false), identity),
            server: Server::new(1, Framing::Rtu),
        }
    }

    /// The reply's PDU to a PDU for this unit, and what follows from it.
    fn ask(&mut self, pdu: &[u8]) -> Vec<u8> {
        let mut adu = Adu::new();
        adu.push(1);
        pdu.iter().for_each(|byte| assert!(adu.push(*byte)));
        let decision = self.server.decide(&adu, &self.device);
        self.server.commit(&decision, &LineCounters::ZERO);
        if Device::shows_counters(&decision.work) {
            self.device.state.counters = self.server.counters();
        }
        self.server.carry_out(&decision, &mut adu, &mut self.device);
        if let Some(order) = self.device.take_order() {
            self.device.carry_out(order);
        }
        let head = decision.reply.expect("it was asked");
        [&head.as_slice()[1..], head.body_in(&adu)].concat()
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
        let mut channels = *self.device.points.channels();
        set(&mut channels);
        let settings = *self.device.points.settings();
        self.device.points.scanned(&channels, &settings);
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
    let before = *bench.device.points.settings();
    assert_eq!(before[2].scale, Scale::Engineering);

    // SAFE is raw, 1000 of 4095 is 2.442 V.
    bench.device.request_seen(0);
    while !bench.device.tick(1) {}
    assert_eq!(bench.read(0x12, 1), Ok(std::vec![2442]));

    assert_eq!(
        bench.write(at::MODULE + 4, &[Module::Ai2Ao2.code()]),
        Ok(())
    );
    assert_eq!(bench.device.points.settings()[2].scale, before[2].scale);
    assert_eq!(bench.read(0x12, 1), Ok(std::vec![2442]), "nothing jumps");
}

#[test]
fn points_exist_as_their_module_has_them() {
    for module in Module::ALL {
        let mut bench = Bench::new(module, &[]);
        for (channel, kind) in (0u16..).zip(kinds(module)) {
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
        "a channel out of range"
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
    bench.device.points.set_failing(0b1100);
    assert_eq!(bench.read(0x10, 2), Ok(std::vec![0; 2]));
    assert_eq!(bench.read(0x12, 1), Err(4));
    assert_eq!(bench.read(0x11, 2), Err(4), "one of two fails");
    assert_eq!(bench.write(0x12, &[1, 2]), Err(4));
    assert_eq!(bench.read(0x021C, 1), Ok(std::vec![2]));
    // One input.
    bench.device.points.set_failing(0b0010);
    assert_eq!(bench.read(0x11, 1), Err(4));
    assert_eq!(bench.read(0x10, 1), Ok(std::vec![0]));
    bench.write(0x12, &[1, 2]).unwrap();
    assert_eq!(bench.read(0x021C, 1), Ok(std::vec![2]));
}

#[test]
fn a_module_that_does_not_answer_is_04_after_all_other_checks() {
    let mut bench = Bench::new(Module::Ao4, &[]);
    bench.device.points.set_failing(0b1111);
    assert_eq!(bench.read(0x10, 4), Err(4));
    assert_eq!(bench.write(0x10, &[1]), Err(4));
    assert_eq!(bench.write(0x10, &[4096]), Err(3));
    assert_eq!(bench.read(0x14, 1), Err(2));
    assert_eq!(bench.read(0x021C, 1), Ok(std::vec![2]));
    bench.device.points.set_failing(0);
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
    for gap in [0x020F, 0x0226, 0x0239, 0x0270, 0x02FF, 0x0340] {
        assert_eq!(bench.read(gap, 1), Err(2), "{gap:#x}");
    }
    assert_eq!(bench.read(0x020E, 2), Err(2), "into a gap");
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
