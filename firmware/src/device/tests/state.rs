//! Identity, state, counters and commands.

use super::*;

#[test]
fn identity_and_state_are_read_and_never_written() {
    let mut rig = Rig::new(Module::Relay2, &[]);
    (0..2460).for_each(|_| {
        rig.device.tick(1);
    });
    // A late scan catches up.
    rig.device.tick(40);
    assert_eq!(rig.device.state.millis(), 2500);
    assert_eq!(rig.read(0x0200, 2), Ok(std::vec![0x2383, 0x5860]));
    assert_eq!(rig.read(0x0204, 4), Ok(std::vec![2, 1, 1, 0b11_0000]));
    assert_eq!(rig.read(0x0208, 2), Ok(std::vec![0, 2]));
    assert_eq!(rig.read(0x0210, 8), Ok(std::vec![0, 0, 0, 0, 3, 0, 0, 0]));
    assert_eq!(rig.read(0x0218, 8), Ok(std::vec![1, 1, 1, 1, 0, 1, 1, 1]));
    assert_eq!(rig.read(0x0220, 6), Ok(std::vec![1, 2, 3, 4, 5, 6]));
    assert_eq!(rig.read(0x0230, 9).map(|c| c.len()), Ok(9));
    assert_eq!(rig.read(0x0240, 32), Ok(std::vec![0; 32]));
    rig.device.state.line_repairs = 9;
    let mut record = std::vec![3; 16];
    record[13] = 9;
    assert_eq!(rig.read(0x0260, 16), Ok(record));
    assert_eq!(rig.read(0x0270, 9), Ok(std::vec![0; 9]));
    let name = rig.read(0x00C8, 20).unwrap();
    let name: Vec<u8> = name.into_iter().map(|word| word as u8).collect();
    assert_eq!(name, *b"modio-02\0\0\0\0\0\0\0\0\0\0\0\0");
    assert_eq!(rig.read(0x00C7, 1), Err(2));
    assert_eq!(rig.write(0x00C8, &[1]), Err(2));
    assert_eq!(rig.read(0x0228, 2), Ok(std::vec![0x0D00, 0x1234]));
    for gap in [0x022B, 0x0239, 0x0279, 0x02FF, 0x0340, 0x03C0] {
        assert_eq!(rig.read(gap, 1), Err(2), "{gap:#x}");
    }
    assert_eq!(rig.read(0x022A, 2), Err(2), "the span contains a gap");
    assert_eq!(rig.read(0x01FF, 2), Err(2), "the span leaves its block");
    assert_eq!(rig.read(0x025F, 2), Err(2), "the span leaves its block");
    assert_eq!(rig.read(0x026F, 2), Err(2), "the span leaves its block");
    assert_eq!(rig.write(0x0200, &[1]), Err(2));
    assert_eq!(rig.write(0x0260, &[0]), Err(2));
    assert_eq!(rig.write(0x0270, &[0]), Err(2));
}

#[test]
fn counters_of_a_second_line_exist_on_boards_with_one() {
    let modules = [Module::Di4, Module::Di4, Module::Do4, Module::Do4];
    let mut rig = Rig::<EthIo5r>::on(modules, &[]);
    assert_eq!(rig.read(0x0230, 9).map(|words| words.len()), Ok(9));
    for (first, count) in [(0x0270, 9), (0x0270, 1), (0x0278, 1)] {
        assert_eq!(rig.read(first, count), Err(2));
    }
}

#[test]
fn counters_include_the_request_that_reads_them() {
    let mut rig = Rig::new(Module::Di4, &[]);
    let requests = state_map::BUS_MESSAGES + 3;
    assert_eq!(rig.read(requests, 1), Ok(std::vec![1]));
    rig.ask(&[0x07]);
    assert_eq!(rig.read(requests, 1), Ok(std::vec![3]));
    // Read by function 17, which also opens the lock.
    let [address, key, value] = [requests, at::KEY, at::OPENING_KEY].map(u16::to_be_bytes);
    let request = [&[0x17], &address[..], &[0, 1], &key, &[0, 1, 2], &value];
    assert_eq!(rig.ask(&request.concat()), [0x17, 2, 0, 4]);
    assert_eq!(rig.ask(&[0x08, 0, 0x0E, 0, 0]), [0x08, 0, 0x0E, 0, 5]);
}

#[test]
fn unsupported_commands_and_settings_are_rejected() {
    let mut rig = Rig::new(Module::Di4, &[]);
    rig.unlock();
    assert_eq!(rig.write(at::MODE, &[2]), Err(3));
    assert_eq!(rig.write(at::COMMAND, &[0xB007]), Err(3));
    assert_eq!(rig.read(at::BAUD, 3), Ok(std::vec![96, 0, 0]));
    rig.write(at::BAUD, &[192, 1, 1]).unwrap();
}

#[test]
fn the_device_reports_its_identity_and_state() {
    let mut rig = Rig::new(Module::Ai4, &[(at::COMM_TIMEOUT, 1)]);
    assert_eq!(rig.ask(&[0x07]), [0x07, 0]);
    assert_eq!(rig.ask(&[0x11]), [0x11, 2, 1, 0xFF]);
    let name = rig.ask(&[0x2B, 0x0E, 4, 0x81]);
    assert_eq!(name[7..], [&[0x81, 3][..], b"4ai"].concat());
    let serial = rig.ask(&[0x2B, 0x0E, 4, 0x80]);
    assert_eq!(serial[9..], *b"000100020003000400050006");
    let regular = rig.ask(&[0x2B, 0x0E, 2, 0]);
    assert_eq!((regular[3], regular[6]), (0x83, 7));

    (0..101).for_each(|_| {
        rig.device.tick(1);
    });
    rig.unlock();
    let status = rig.read(0x020A, 1).unwrap();
    assert_eq!(status, [0b10_0001], "communication lost, unlocked");
    assert_eq!(rig.ask(&[0x07]), [0x07, 0b10_0001]);
    assert_eq!(rig.ask(&[0x08, 0, 2, 0, 0]), [0x08, 0, 2, 0, 0b10_0001]);
    assert_eq!(
        rig.ask(&[0x11]),
        [0x11, 2, 1, 0x00],
        "the outputs are at SAFE"
    );
}

#[test]
fn a_mask_write_of_a_setting_acts_like_any_other_write() {
    let mut rig = Rig::new(Module::Di4, &[]);
    assert_eq!(
        rig.ask(&[0x16, 1, 5, 0xFF, 0, 0, 0x64]),
        [0x96, 6],
        "locked"
    );
    rig.unlock();
    assert_eq!(rig.ask(&[0x16, 1, 5, 0xFF, 0, 0, 0x64])[0], 0x16);
    assert_eq!(rig.read(at::RESPONSE_DELAY, 1), Ok(std::vec![100]));
    assert_eq!(rig.ask(&[0x16, 1, 5, 0xFF, 0xFF, 0, 0])[0], 0x16);
    assert_eq!(
        rig.ask(&[0x16, 1, 5, 0, 0xFF, 0x10, 0]),
        [0x96, 3],
        "4196 ms"
    );
    assert_eq!(rig.ask(&[0x16, 2, 0, 0, 0, 0, 0]), [0x96, 2], "read-only");
}

#[test]
fn identify_and_restart_are_left_for_the_background_task() {
    let mut rig = Rig::new(Module::None, &[]);
    assert_eq!(rig.write(at::COMMAND, &[6]), Err(6), "locked");
    rig.unlock();
    assert_eq!(rig.write(at::COMMAND, &[7]), Err(3));
    assert_eq!(rig.write(at::COMMAND, &[6]), Ok(()));
    assert!(rig.device.identify && rig.device.restart.is_none());
    assert_eq!(rig.write(at::COMMAND, &[2]), Ok(()));
    assert_eq!(rig.device.restart, Some(Restart::Asked));
}
