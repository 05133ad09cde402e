//! Requests over the air, which anybody in radio range can send.

use super::*;
use crate::config::LineName;

/// A unit whose radio has this LORA setting, asked over the air.
fn rig(lora: u16) -> Rig {
    let mut rig = Rig::new(Module::Di4, &[(at::LORA, lora)]);
    rig.device.set_origin(Origin {
        line: LineName::Second,
        broadcast: false,
        by_serial: false,
    });
    rig.scan(|_| {});
    rig.scan(|channels| channels.set_bit(0, true));
    rig
}

#[test]
fn points_only_refuses_key_command_and_clearing_of_counters_with_exception_06() {
    let mut rig = rig(2);
    assert_eq!(rig.ask(&[6, 1, 0, 0x5A, 0x17]), [0x86, 6]);
    assert_eq!(rig.ask(&[0x16, 1, 0, 0, 0, 0x5A, 0x17]), [0x96, 6]);
    let with_read = [0x17, 2, 0, 0, 1, 1, 0, 0, 1, 2, 0x5A, 0x17];
    assert_eq!(rig.ask(&with_read), [0x97, 6]);
    assert_eq!(rig.write(at::COMMAND, &[2]), Err(6));
    assert_eq!(rig.write(0x0320, &[0, 0]), Err(6));
    assert_eq!(rig.write(0x0320, &[0, 1]), Err(3), "the value comes first");
    assert_eq!(rig.read(0x0320, 2), Ok(std::vec![0, 1]));
    assert_eq!(rig.ask(&[1, 0, 0x10, 0, 4]), [1, 1, 1]);
}

#[test]
fn points_only_takes_a_heartbeat_by_every_function_that_writes_registers() {
    let mut rig = rig(2);
    for pdu in [
        &[6, 1, 0x0C, 0xFF, 0xFF][..],
        &[0x16, 1, 0x0C, 0, 0, 0x12, 0x34],
    ] {
        assert_eq!(rig.ask(pdu), pdu);
    }
    assert_eq!(rig.write(at::HEARTBEAT, &[7]), Ok(()));
    let with_read = [0x17, 1, 0x0C, 0, 1, 1, 0x0C, 0, 1, 2, 0, 7];
    assert_eq!(rig.ask(&with_read), [0x17, 2, 0, 0]);
    assert_eq!(rig.write(at::SERIAL_LOW, &[0, 7]), Err(6));
}

#[test]
fn radio_with_settings_takes_key_and_clears_counters() {
    let mut rig = rig(1);
    assert_eq!(rig.write(0x0320, &[0, 0]), Ok(()));
    assert_eq!(rig.read(0x0320, 2), Ok(std::vec![0, 0]));
    rig.unlock();
    assert_eq!(rig.read(at::KEY, 1), Ok(std::vec![1]));
    // Functions 07 and 08/02 return the status, whose bit 5 is that of the line.
    assert_eq!(rig.ask(&[7]), [7, 0x20]);
    rig.device.set_origin(Origin::default());
    assert_eq!(rig.ask(&[7]), [7, 0]);
    assert_eq!(rig.ask(&[8, 0, 2, 0, 0]), [8, 0, 2, 0, 0]);
}
