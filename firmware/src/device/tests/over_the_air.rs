//! Requests over the air, which anybody in radio range can send.

use super::*;
use crate::config::LineName;

/// A unit whose radio has this LORA setting, asked over the air.
fn bench(lora: u16) -> Bench {
    let mut bench = Bench::new(Module::Di4, &[(at::LORA, lora)]);
    bench.device.set_origin(Origin {
        line: LineName::Second,
        broadcast: false,
        by_serial: false,
    });
    bench.scan(|_| {});
    bench.scan(|channels| channels.set_bit(0, true));
    bench
}

#[test]
fn points_only_refuses_key_command_and_clearing_of_counters_with_exception_06() {
    let mut bench = bench(2);
    assert_eq!(bench.ask(&[6, 1, 0, 0x5A, 0x17]), [0x86, 6]);
    assert_eq!(bench.ask(&[0x16, 1, 0, 0, 0, 0x5A, 0x17]), [0x96, 6]);
    let with_read = [0x17, 2, 0, 0, 1, 1, 0, 0, 1, 2, 0x5A, 0x17];
    assert_eq!(bench.ask(&with_read), [0x97, 6]);
    assert_eq!(bench.write(at::COMMAND, &[2]), Err(6));
    assert_eq!(bench.write(0x0320, &[0, 0]), Err(6));
    assert_eq!(
        bench.write(0x0320, &[0, 1]),
        Err(3),
        "the value comes first"
    );
    assert_eq!(bench.read(0x0320, 2), Ok(std::vec![0, 1]));
    assert_eq!(bench.ask(&[1, 0, 0x10, 0, 4]), [1, 1, 1]);
}

#[test]
fn points_only_takes_a_heartbeat_by_every_function_that_writes_registers() {
    let mut bench = bench(2);
    for pdu in [
        &[6, 1, 0x0C, 0xFF, 0xFF][..],
        &[0x16, 1, 0x0C, 0, 0, 0x12, 0x34],
    ] {
        assert_eq!(bench.ask(pdu), pdu);
    }
    assert_eq!(bench.write(at::HEARTBEAT, &[7]), Ok(()));
    let with_read = [0x17, 1, 0x0C, 0, 1, 1, 0x0C, 0, 1, 2, 0, 7];
    assert_eq!(bench.ask(&with_read), [0x17, 2, 0, 0]);
    assert_eq!(bench.write(at::SERIAL_LOW, &[0, 7]), Err(6));
}

#[test]
fn radio_with_settings_takes_key_and_clears_counters() {
    let mut bench = bench(1);
    assert_eq!(bench.write(0x0320, &[0, 0]), Ok(()));
    assert_eq!(bench.read(0x0320, 2), Ok(std::vec![0, 0]));
    bench.unlock();
    assert_eq!(bench.read(at::KEY, 1), Ok(std::vec![1]));
    // Functions 07 and 08/02 return the status, whose bit 5 is that of the line.
    assert_eq!(bench.ask(&[7]), [7, 0x20]);
    bench.device.set_origin(Origin::default());
    assert_eq!(bench.ask(&[7]), [7, 0]);
    assert_eq!(bench.ask(&[8, 0, 2, 0, 0]), [8, 0, 2, 0, 0]);
}
