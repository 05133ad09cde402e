//! The functions that do not read or write points, on the release image.

use sim::{Channel, Module, Time};

use crate::bench::{Bench, FIRST};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn device_returns_its_identification() {
    let mut bench = Bench::new(Module::Di4, 1);
    let mut ask = |pdu: &[u8]| bench.ask(1, pdu).expect("a reply");
    assert_eq!(ask(&[0x07]), [0x07, 0]);
    assert_eq!(
        ask(&[0x08, 0, 0, 0xA5, 0x37, 1]),
        [0x08, 0, 0, 0xA5, 0x37, 1]
    );
    assert_eq!(ask(&[0x08, 0, 0x0B, 0, 0]), [0x08, 0, 0x0B, 0, 3]);
    assert_eq!(ask(&[0x0B]), [0x0B, 0, 0, 0, 3]);
    let log = ask(&[0x0C]);
    assert_eq!((log[1], &log[2..8]), (6 + 9, &[0, 0, 0, 3, 0, 5][..]));
    assert_eq!(
        log[8..],
        [0x80, 0x40, 0x80, 0x40, 0x80, 0x40, 0x80, 0x40, 0x80]
    );
    assert_eq!(ask(&[0x11]), [0x11, 2, 1, 0xFF]);
    let objects = ask(&[0x2B, 0x0E, 3, 0]);
    assert_eq!(objects[..7], [0x2B, 0x0E, 3, 0x83, 0, 0, 9]);
    let has = |text: &[u8]| objects.windows(text.len()).any(|part| part == text);
    assert!(has(b"modio-02") && has(b"23835860") && has(b"4di"));
    bench.assert_sound();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn registers_are_masked_and_written_and_read_in_one_request() {
    let mut bench = Bench::new(Module::Di4, 1);
    bench.unlock();
    let mask = [0x16, 1, 4, 0xFF, 0xF0, 0, 0x0A];
    assert_eq!(bench.ask(1, &mask).as_deref(), Some(&mask[..]));
    assert_eq!(bench.register(0x0104), 10);
    // COMM_TIMEOUT is set back to 0, and BAUD to STRICT_T15 are read in the same request.
    let both = [0x17, 1, 1, 0, 7, 1, 4, 0, 1, 2, 0, 0];
    let reply = bench.ask(1, &both).expect("a reply");
    assert_eq!(reply, [0x17, 14, 0, 96, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    bench.assert_sound();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn outputs_go_to_safe_in_listen_only_mode() {
    let mut bench = Bench::new(Module::Do4, 1);
    bench.unlock();
    bench.write(0x0104, &[2]).unwrap();
    bench.ask(1, &[0x05, 0, FIRST, 0xFF, 0]).expect("a reply");
    assert_eq!(bench.ask(1, &[0x08, 0, 4, 0, 0]), None);
    assert_eq!(bench.board.channel(1), Channel::Do { on: true });
    for _ in 0..10 {
        assert_eq!(bench.ask(1, &[0x05, 0, FIRST + 1, 0xFF, 0]), None);
        bench.board.run_for(Time::from_ms(30));
    }
    assert_eq!(bench.board.channel(1), Channel::Do { on: false });
    assert_eq!(bench.board.channel(2), Channel::Do { on: false });
    assert_eq!(
        bench.ask(1, &[0x08, 0, 1, 0, 0]),
        None,
        "the restart gets no reply"
    );
    // The status is: communication lost, not saved, unlocked.
    assert_eq!(bench.ask(1, &[0x07]), Some(vec![0x07, 0b10_1001]));
    bench.assert_sound();
}
