//! The points of the modules and their pulse counters.

use super::*;
use crate::config::LineName;

#[test]
fn the_running_module_keeps_its_settings_after_module_is_written() {
    let settings = [
        (at::SCALE + 0x12, 1),
        (at::SAFE + 0x12, 1000),
        (at::COMM_TIMEOUT, 1),
    ];
    let mut rig = Rig::new(Module::Ai2Ao2, &settings);
    rig.unlock();
    assert_eq!(rig.write(0x12, &[10_000]), Ok(()), "millivolts");
    assert_eq!(rig.write(at::MODULE + 4, &[Module::Ao4.code()]), Ok(()));
    assert_eq!(rig.read(at::SCALE + 0x12, 1), Ok(std::vec![0]));
    assert_eq!(rig.read(0x12, 1), Ok(std::vec![10_000]));
    assert_eq!(rig.write(0x12, &[2000]), Ok(()));
    let before = *rig.device.points.ports()[0].settings();
    assert_eq!(before[2].scale, Scale::Engineering);

    // SAFE is raw, 1000 of 4095 is 2.442 V.
    rig.device.request_seen(0, false);
    while !rig.device.tick(1) {}
    assert_eq!(rig.read(0x12, 1), Ok(std::vec![2442]));

    assert_eq!(rig.write(at::MODULE + 4, &[Module::Ai2Ao2.code()]), Ok(()));
    assert_eq!(
        rig.device.points.ports()[0].settings()[2].scale,
        before[2].scale
    );
    assert_eq!(
        rig.read(0x12, 1),
        Ok(std::vec![2442]),
        "the output does not change"
    );
}

#[test]
fn four_modules_answer_at_their_own_addresses() {
    let modules = [Module::Di4, Module::Do4, Module::Ai4, Module::Ao4];
    let mut rig = Rig::<Modio08>::on(modules, &[(at::SAFE + 13, 7)]);
    rig.scan_port(0, |channels| channels.set_bit(2, true));
    rig.scan_port(2, |channels| channels.set_word(3, 1234));
    // Inputs of port 1 and outputs of port 2 in one request, bits 0 to 7.
    assert_eq!(rig.ask(&[5, 0, 4, 0xFF, 0]), [5, 0, 4, 0xFF, 0]);
    assert_eq!(rig.ask(&[1, 0, 0, 0, 8]), [1, 1, 0b0001_0100]);
    // Inputs of port 3 and outputs of port 4, words 8 to 15.
    assert_eq!(rig.write(12, &[1, 2, 3, 4]), Ok(()));
    let words = std::vec![0, 0, 0, 1234, 1, 2, 3, 4];
    assert_eq!(rig.read(8, 8), Ok(words));
    assert_eq!(rig.read(7, 2), Err(2), "a bit and a word in one request");
    assert_eq!(rig.read(8, 9), Err(2), "after the last port");
    assert_eq!(rig.write(11, &[0, 0]), Err(2), "an input");
    assert_eq!(rig.read(0x10, 1), Err(2), "port 5 has no slot");

    let state = |rig: &mut Rig<Modio08>| rig.read(0x0218, 8).unwrap();
    let modules = std::vec![1, 2, 4, 5, 0, 0, 0, 0];
    assert_eq!(rig.read(0x0210, 8), Ok(modules));
    assert_eq!(state(&mut rig), [0, 0, 0, 0, 1, 1, 1, 1]);
    assert_eq!(rig.read(0x0205, 1), Ok(std::vec![2]));
    rig.device.points.ports_mut()[2].set_failing(0b1111);
    assert_eq!(state(&mut rig), [0, 0, 2, 0, 1, 1, 1, 1]);
    assert_eq!(rig.read(12, 4), Ok(std::vec![1, 2, 3, 4]));
    assert_eq!(rig.read(8, 8), Err(4), "port 3 does not answer");
    rig.device.points.ports_mut()[2].set_failing(0);

    // The pulses of port 1, channel 3, and SAFE of port 4, channel 2.
    rig.scan_port(0, |channels| channels.set_bit(2, false));
    rig.scan_port(0, |channels| channels.set_bit(2, true));
    assert_eq!(rig.read(0x0300 + 4, 2), Ok(std::vec![0, 1]));
    rig.unlock();
    assert_eq!(rig.write(at::COMM_TIMEOUT, &[1]), Ok(()));
    while !rig.device.tick(1) {}
    assert_eq!(rig.read(12, 4), Ok(std::vec![0, 7, 0, 0]));
    assert_eq!(rig.ask(&[1, 0, 4, 0, 1]), [1, 1, 0]);
}

#[test]
fn points_exist_as_their_module_defines() {
    for module in Module::ALL {
        let mut rig = Rig::new(module, &[]);
        for (channel, kind) in (0u16..).zip(module.points()) {
            let address = 0x10 + channel;
            let low = address as u8;
            let is_bit = matches!(kind, Kind::BitInput | Kind::BitOutput);
            let is_word = matches!(kind, Kind::WordInput | Kind::WordOutput);
            for function in [1, 2] {
                let reply = rig.ask(&[function, 0, low, 0, 1]);
                assert_eq!(
                    reply[0] & 0x80 == 0,
                    is_bit,
                    "{module} {channel} by {function}"
                );
            }
            assert_eq!(rig.read(address, 1).is_ok(), is_word, "{module} {channel}");
            let coil = rig.ask(&[5, 0, low, 0xFF, 0]);
            assert_eq!(coil[0] == 5, kind == Kind::BitOutput, "{module} {channel}");
            let written = rig.write(address, &[1]);
            assert_eq!(
                written.is_ok(),
                kind == Kind::WordOutput,
                "{module} {channel}"
            );
        }
        assert_eq!(rig.read(0x14, 1), Err(2));
        assert_eq!(rig.read(0x0F, 2), Err(2));
    }
}

#[test]
fn inputs_follow_the_scan_and_outputs_keep_the_commanded_value() {
    let mut rig = Rig::new(Module::Ai2Ao2, &[]);
    rig.write(0x12, &[100, 200]).unwrap();
    rig.scan(|channels| {
        channels.set_word(0, 7);
        channels.set_word(1, 8);
        channels.set_word(2, 9);
        channels.set_status(1, ChannelStatus::OverRange);
    });
    assert_eq!(rig.read(0x10, 4), Ok(std::vec![7, 8, 100, 200]));
    assert_eq!(rig.read(0x0250, 4), Ok(std::vec![0, 2, 0, 0]));
    assert_eq!(
        rig.read(0x021C, 1),
        Ok(std::vec![3]),
        "the channel's signal is out of range"
    );
    assert_eq!(rig.read(0x020A, 1).unwrap()[0] & 4, 4);
}

#[test]
fn a_word_out_of_range_or_scale_rejects_the_whole_write() {
    let ua = [
        (at::RANGE + 0x11, 1),
        (at::SCALE + 0x11, 1),
        (at::SCALE + 0x12, 1),
    ];
    let mut rig = Rig::new(Module::Ao4, &ua);
    // Units: raw, uA, mV, raw.
    rig.write(0x10, &[4095, 4000, 10_000, 0]).unwrap();
    for bad in [
        [4096, 4000, 0, 0],
        [0, 3999, 0, 0],
        [0, 20_001, 0, 0],
        [0, 4000, 10_001, 0],
    ] {
        assert_eq!(rig.write(0x10, &bad), Err(3), "{bad:?}");
    }
    assert_eq!(rig.read(0x10, 4), Ok(std::vec![4095, 4000, 10_000, 0]));
    assert_eq!(
        rig.write(0x13, &[5000, 5000]),
        Err(2),
        "the address is checked before the value"
    );
}

#[test]
fn a_new_scale_does_not_change_an_output() {
    let mut rig = Rig::new(Module::Ao4, &[]);
    rig.write(0x10, &[2048]).unwrap();
    rig.unlock();
    rig.write(at::SCALE + 0x10, &[1]).unwrap();
    assert_eq!(rig.read(0x10, 1), Ok(std::vec![5001]), "in mV immediately");
    rig.write(at::SCALE + 0x10, &[0]).unwrap();
    assert_eq!(rig.read(0x10, 1), Ok(std::vec![2048]));
}

#[test]
fn a_failing_output_reads_its_commanded_value_and_refuses_writes_with_04() {
    let mut rig = Rig::new(Module::Ai2Ao2, &[]);
    rig.write(0x12, &[100, 200]).unwrap();
    // The DAC fails, which drives channels 3 and 4.
    rig.device.points.ports_mut()[0].set_failing(0b1100);
    assert_eq!(rig.read(0x10, 4), Ok(std::vec![0, 0, 100, 200]));
    assert_eq!(rig.write(0x12, &[1, 2]), Err(4));
    assert_eq!(rig.ask(&[0x16, 0, 0x12, 0, 0, 0, 1]), [0x96, 4]);
    let write_then_read = [0x17, 0, 0x10, 0, 1, 0, 0x12, 0, 1, 2, 0, 1];
    assert_eq!(rig.ask(&write_then_read), [0x97, 4]);
    assert_eq!(rig.read(0x12, 2), Ok(std::vec![100, 200]));
    assert_eq!(rig.read(0x021C, 1), Ok(std::vec![2]));
    assert_eq!(rig.read(0x020A, 1).unwrap()[0] & 4, 4);
}

#[test]
fn a_failing_bit_output_reads_its_commanded_value_and_refuses_writes_with_04() {
    let mut rig = Rig::new(Module::Relay2, &[]);
    assert_eq!(rig.ask(&[5, 0, 0x12, 0xFF, 0]), [5, 0, 0x12, 0xFF, 0]);
    rig.device.points.ports_mut()[0].set_failing(0b1100);
    for function in [1, 2] {
        assert_eq!(rig.ask(&[function, 0, 0x10, 0, 4]), [function, 1, 0b0100]);
    }
    assert_eq!(rig.ask(&[5, 0, 0x12, 0, 0]), [0x85, 4]);
    assert_eq!(rig.ask(&[0x0F, 0, 0x12, 0, 2, 1, 0]), [0x8F, 4]);
    // The jumpers, channels 1 and 2, are inputs.
    rig.device.points.ports_mut()[0].set_failing(0b0001);
    assert_eq!(rig.ask(&[1, 0, 0x10, 0, 4]), [0x81, 4]);
    assert_eq!(rig.ask(&[1, 0, 0x12, 0, 1]), [1, 1, 1]);
}

#[test]
fn a_failing_input_returns_04_and_does_not_affect_the_others() {
    let mut rig = Rig::new(Module::Ai2Ao2, &[]);
    rig.device.points.ports_mut()[0].set_failing(0b0010);
    assert_eq!(rig.read(0x11, 1), Err(4));
    assert_eq!(rig.read(0x11, 2), Err(4), "one of two fails");
    assert_eq!(rig.read(0x10, 1), Ok(std::vec![0]));
    rig.write(0x12, &[1, 2]).unwrap();
    assert_eq!(rig.read(0x021C, 1), Ok(std::vec![2]));
}

#[test]
fn a_module_that_does_not_answer_returns_04_after_all_other_checks() {
    let mut rig = Rig::new(Module::Ao4, &[]);
    rig.device.points.ports_mut()[0].set_failing(0b1111);
    assert_eq!(rig.write(0x10, &[1]), Err(4));
    assert_eq!(rig.write(0x10, &[4096]), Err(3));
    assert_eq!(rig.write(0x13, &[1, 1]), Err(2));
    assert_eq!(rig.read(0x021C, 1), Ok(std::vec![2]));
    rig.device.points.ports_mut()[0].set_failing(0);
    assert_eq!(rig.write(0x10, &[1]), Ok(()));
}

#[test]
fn outputs_begin_with_start_and_go_to_safe_in_silence() {
    let stored = [
        (at::START + 0x10, 1),
        (at::START + 0x12, 1),
        (at::SAFE + 0x11, 1),
        (at::SAFE + 0x12, at::HOLD),
        (at::COMM_TIMEOUT, 5),
    ];
    let mut rig = Rig::new(Module::Do4, &stored);
    let bits = |rig: &mut Rig| rig.ask(&[1, 0, 0x10, 0, 4])[2];
    assert_eq!(bits(&mut rig), 0b0101);
    rig.device.request_seen(0, false);
    let trips = (1..=600).filter(|_| rig.device.tick(1)).count();
    assert_eq!(trips, 1);
    assert_eq!(bits(&mut rig), 0b0110, "off, on, held, off");
    let status = |rig: &mut Rig| rig.read(0x020A, 1).unwrap()[0] & 1;
    assert_eq!(status(&mut rig), 1);
    // Outputs keep their values until they are written, and the flag stays set until it is cleared.
    rig.device.request_seen(rig.device.state.millis(), false);
    assert_eq!(bits(&mut rig), 0b0110);
    rig.ask(&[5, 0, 0x10, 0xFF, 0]);
    assert_eq!(bits(&mut rig), 0b0111);
    rig.unlock();
    rig.write(at::COMMAND, &[5]).unwrap();
    assert_eq!(status(&mut rig), 0);
}

#[test]
fn comm_source_selects_the_requests_that_restart_the_communication_watchdog() {
    let lines = [LineName::Rs485, LineName::Second];
    // Reads and writes over RS-485, then over the air.
    for (source, expected) in [
        (0, [true; 4]),
        (1, [false, true, false, true]),
        (2, [true, true, false, false]),
        (3, [false, true, false, false]),
    ] {
        let settings = [(at::COMM_TIMEOUT, 1), (at::COMM_SOURCE, source)];
        let requests = lines
            .into_iter()
            .flat_map(|line| [(line, false), (line, true)]);
        for ((line, writes), restarts) in requests.zip(expected) {
            let rig = Rig::new(Module::Do4, &settings);
            rig.device.set_origin(Origin {
                line,
                broadcast: false,
                by_serial: false,
            });
            assert!(!rig.device.tick(50));
            rig.device.request_seen(50, writes);
            let trips = rig.device.tick(50);
            assert_eq!(trips, !restarts, "{source}: {line:?}, writes: {writes}");
        }
    }
}

#[test]
fn pulses_are_counted_on_rising_edges_and_cleared_whole() {
    let mut rig = Rig::new(Module::Di4, &[]);
    rig.scan(|channels| channels.set_bit(0, true));
    assert_eq!(
        rig.read(0x0320, 2),
        Ok(std::vec![0, 0]),
        "the level at the start is no edge"
    );
    for n in 0..0x2_0003 {
        rig.scan(|channels| channels.set_bit(1, n % 2 == 0));
    }
    assert_eq!(rig.read(0x0322, 2), Ok(std::vec![1, 2]));
    for (address, values) in [
        (0x0322, &[0][..]),
        (0x0323, &[0, 0]),
        (0x0322, &[0, 1]),
        (0x0321, &[0, 0, 0]),
    ] {
        assert_eq!(rig.write(address, values), Err(3), "{address:#x}");
    }
    assert_eq!(rig.read(0x0322, 2), Ok(std::vec![1, 2]));
    rig.write(0x0322, &[0, 0]).unwrap();
    assert_eq!(rig.read(0x0322, 2), Ok(std::vec![0, 0]));
    assert_eq!(rig.read(0x0300, 64).unwrap(), [0; 64]);
    assert_eq!(rig.read(0x0300, 65), Err(2));
}
