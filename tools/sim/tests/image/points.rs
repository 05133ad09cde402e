//! The points of the slot, through every function that accesses them.

use sim::{Channel, Module, Time};

use crate::bench::{Bench, FIRST, adu};

/// Returns whether a channel's output is on.
fn on(bench: &Bench, channel: usize) -> bool {
    match bench.board.channel(channel) {
        Channel::Do { on } => on,
        other => panic!("channel {channel} is {other:?}"),
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn four_inputs_return_the_pin_levels_through_both_functions() {
    let mut bench = Bench::new(Module::Di4, 1);
    for pattern in [0b0000u8, 0b0001, 0b1010, 0b0101, 0b1111, 0b1000, 0b0000] {
        for channel in 1..=4 {
            let energised = pattern >> (channel - 1) & 1 != 0;
            bench.board.set_energised(channel, energised).unwrap();
        }
        bench.board.run_for(Time::from_ms(8));
        for function in [1, 2] {
            let all = bench.ask(1, &[function, 0, FIRST, 0, 4]);
            assert_eq!(all.as_deref(), Some(&[function, 1, pattern][..]));
            let middle = bench.ask(1, &[function, 0, FIRST + 1, 0, 2]);
            assert_eq!(
                middle.as_deref(),
                Some(&[function, 1, pattern >> 1 & 3][..])
            );
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_input_is_debounced_for_five_milliseconds() {
    let mut bench = Bench::new(Module::Di4, 1);
    let read = |bench: &mut Bench| bench.ask(1, &[2, 0, FIRST, 0, 1]).unwrap()[2];
    bench.board.set_energised(1, true).unwrap();
    bench.board.run_for(Time::from_ms(3));
    bench.board.set_energised(1, false).unwrap();
    bench.board.run_for(Time::from_ms(10));
    assert_eq!(read(&mut bench), 0, "a pulse of 3 ms must be filtered");
    bench.board.set_energised(1, true).unwrap();
    // The unit builds the reply about 13 ms later, at the end of the request and t3.5.
    assert_eq!(read(&mut bench), 1, "a constant level must be read");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn four_outputs_follow_every_write_and_read_back() {
    let mut bench = Bench::new(Module::Do4, 1);
    let states = |bench: &Bench| [1, 2, 3, 4].map(|channel| on(bench, channel));
    assert_eq!(states(&bench), [false; 4]);

    // One output at a time: the reply equals the request.
    for (address, value, expected) in [
        (0x10, 0xFF, [true, false, false, false]),
        (0x13, 0xFF, [true, false, false, true]),
        (0x10, 0x00, [false, false, false, true]),
    ] {
        let request = [5, 0, address, value, 0];
        assert_eq!(bench.ask(1, &request).as_deref(), Some(&request[..]));
        assert_eq!(states(&bench), expected);
    }

    // Several outputs together; bits of the byte beyond the quantity are ignored.
    let reply = bench.ask(1, &[0x0F, 0, FIRST + 1, 0, 3, 1, 0b1111_0011]);
    assert_eq!(reply.as_deref(), Some(&[0x0F, 0, FIRST + 1, 0, 3][..]));
    assert_eq!(states(&bench), [false, true, true, false]);
    for function in [1, 2] {
        let reply = bench.ask(1, &[function, 0, FIRST, 0, 4]);
        assert_eq!(reply.as_deref(), Some(&[function, 1, 0b0110][..]));
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_write_reaches_its_output_before_the_reply_is_out() {
    let mut bench = Bench::new(Module::Do4, 1);
    bench.board.watch_pin('A', 0);
    let now = bench.board.now();
    let end = bench
        .board
        .line()
        .send(now, &adu(&[1, 5, 0, FIRST, 0xFF, 0]));
    bench.answer_after(end);
    let edges = bench.board.pin_edges('A', 0);
    assert_eq!(edges.len(), 1, "{edges:?}");
    let (at, level) = edges[0];
    assert!(level);
    let late = at - (end + bench.t35());
    assert!(late < Time::from_us(200), "{late:?} after t3.5");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn outputs_are_off_from_the_first_instant_and_after_every_power_on() {
    let mut bench = Bench::cold(sim::Config {
        module: Module::Do4,
        chip: sim::chip::Config::holding(crate::bench::flash_with(Module::Do4)),
        ..sim::Config::default()
    });
    for pin in 0..4 {
        bench.board.watch_pin('A', pin);
    }
    bench.board.run_for(Time::from_ms(300));
    for pin in 0..4 {
        assert_eq!(bench.board.pin_edges('A', pin), [], "no edge at power-up");
    }
    bench.ask(1, &[0x0F, 0, FIRST, 0, 4, 1, 0x0F]).unwrap();
    assert!(on(&bench, 1));
    bench.board.cycle();
    bench.board.run_for(Time::from_ms(150));
    assert_eq!([1, 2, 3, 4].map(|c| on(&bench, c)), [false; 4]);
    let reply = bench.ask(1, &[1, 0, FIRST, 0, 4]);
    assert_eq!(reply.as_deref(), Some(&[1, 1, 0][..]));
}
