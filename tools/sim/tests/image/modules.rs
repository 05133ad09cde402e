//! Every module through the functions that apply, on the release image.

use sim::{Channel, Module, Time};

use crate::bench::Bench;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn relays_are_driven_and_their_jumpers_read() {
    let mut bench = Bench::new(Module::Relay2, 1);
    let relay = |bench: &Bench, n: usize| match bench.board.channel(n) {
        Channel::Relay { energised, .. } => energised,
        other => panic!("channel {n} is {other:?}"),
    };
    bench.board.set_manual(2, true).unwrap();
    bench.board.run_for(Time::from_ms(40));
    let read = |bench: &mut Bench| bench.ask(1, &[1, 0, 0x10, 0, 4]).unwrap()[2];
    assert_eq!(read(&mut bench), 0b0010);
    bench.ask(1, &[5, 0, 0x12, 0xFF, 0]).unwrap();
    assert_eq!((relay(&bench, 1), relay(&bench, 2)), (true, false));
    bench.ask(1, &[0x0F, 0, 0x12, 0, 2, 1, 0b10]).unwrap();
    assert_eq!((relay(&bench, 1), relay(&bench, 2)), (false, true));
    assert_eq!(read(&mut bench), 0b1010);
    // The jumpers are inputs, alone and as part of more.
    for pdu in [&[5, 0, 0x10, 0xFF, 0][..], &[0x0F, 0, 0x11, 0, 2, 1, 3]] {
        assert_eq!(bench.ask(1, pdu).unwrap(), [pdu[0] | 0x80, 2]);
    }
    assert_eq!((relay(&bench, 1), relay(&bench, 2)), (false, true));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn analog_inputs_show_volts_milliamps_and_degrees() {
    let mut bench = Bench::new(Module::Ai4, 1);
    for (channel, millivolts) in [(1, 1650), (2, 1650), (3, 1650), (4, 825)] {
        bench.board.set_millivolts(channel, millivolts).unwrap();
    }
    bench.board.run_for(Time::from_ms(400));
    let raw = bench.registers(0x10, 4).unwrap();
    for (word, expected) in raw.iter().zip([2048, 2048, 2048, 1024]) {
        assert!(word.abs_diff(expected) <= 1, "{raw:?}");
    }
    assert_eq!(
        bench.ask(1, &[4, 0, 0x10, 0, 4]).unwrap()[2..4],
        raw[0].to_be_bytes()
    );

    bench.unlock();
    bench.write(0x0190, &[0, 1, 2, 1]).unwrap();
    bench.write(0x01B0, &[1, 1, 1, 1]).unwrap();
    bench.board.run_for(Time::from_ms(50));
    let units = bench.registers(0x10, 4).unwrap();
    for (word, (expected, within)) in
        units
            .iter()
            .zip([(5000, 4), (10_000, 6), (250, 1), (5000, 6)])
    {
        assert!(word.abs_diff(expected) <= within, "{units:?}");
    }
    assert_eq!(bench.registers(0x0250, 4), Ok(vec![0; 4]));

    // A broken wire, a short circuit, a loop without current.
    bench.board.set_millivolts(2, 0).unwrap();
    bench.board.set_millivolts(3, 3300).unwrap();
    bench.board.set_millivolts(4, 495).unwrap();
    bench.board.run_for(Time::from_ms(400));
    assert_eq!(bench.registers(0x0250, 4), Ok(vec![0, 3, 3, 1]));
    assert_eq!(bench.register(0x021C), 3, "a channel out of range");
    assert_eq!(bench.register(0x020A) & 4, 4);
    assert_eq!(bench.write(0x10, &[0]), Err(2), "inputs");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn analog_outputs_reach_the_dac_and_refuse_what_it_cannot() {
    let mut bench = Bench::new(Module::Ao4, 1);
    let codes = |bench: &Bench| {
        [1, 2, 3, 4].map(|n| match bench.board.channel(n) {
            Channel::Ao { code } => code,
            other => panic!("channel {n} is {other:?}"),
        })
    };
    bench.board.run_for(Time::from_ms(100));
    assert_eq!(codes(&bench), [0; 4]);
    bench.write(0x10, &[4095, 1, 2048, 0]).unwrap();
    bench.board.run_for(Time::from_ms(30));
    assert_eq!(codes(&bench), [4095, 1, 2048, 0]);
    assert_eq!(
        bench.ask(1, &[6, 0, 0x13, 0x01, 0x23]).unwrap(),
        [6, 0, 0x13, 0x01, 0x23]
    );
    bench.board.run_for(Time::from_ms(30));
    assert_eq!(codes(&bench), [4095, 1, 2048, 0x123]);
    assert_eq!(bench.write(0x10, &[0, 0, 0, 4096]), Err(3));
    assert_eq!(bench.write(0x12, &[0, 0, 0]), Err(2));
    bench.board.run_for(Time::from_ms(30));
    assert_eq!(codes(&bench), [4095, 1, 2048, 0x123], "all or nothing");
    assert_eq!(bench.registers(0x10, 4), Ok(vec![4095, 1, 2048, 0x123]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn two_in_two_out_has_both() {
    let mut bench = Bench::new(Module::Ai2Ao2, 1);
    bench.board.set_millivolts(1, 3000).unwrap();
    bench.board.set_millivolts(2, 300).unwrap();
    bench.write(0x12, &[1000, 3000]).unwrap();
    bench.board.run_for(Time::from_ms(400));
    let words = bench.registers(0x10, 4).unwrap();
    assert!(
        words[0].abs_diff(3723) <= 1 && words[1].abs_diff(372) <= 1,
        "{words:?}"
    );
    assert_eq!(words[2..], [1000, 3000]);
    assert_eq!(bench.board.channel(3), Channel::Ao { code: 1000 });
    assert_eq!(bench.board.channel(4), Channel::Ao { code: 3000 });
    assert_eq!(
        bench.write(0x11, &[1, 1]),
        Err(2),
        "from an input into an output"
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_dac_that_does_not_answer_is_04_and_comes_back_by_itself() {
    use sim::slot::BusFault;
    let held = BusFault::HoldsSda { clocks: None };
    for fault in [BusFault::Absent, BusFault::HoldsScl, held] {
        let mut bench = Bench::new(Module::Ao4, 1);
        bench.write(0x10, &[100, 200, 300, 400]).unwrap();
        bench.board.run_for(Time::from_ms(100));
        bench.board.set_bus_fault(fault);
        bench.board.run_for(Time::from_ms(1500));
        assert_eq!(bench.registers(0x10, 4), Err(4), "{fault:?}");
        assert_eq!(bench.write(0x10, &[1]), Err(4));
        assert_eq!(bench.register(0x021C), 2);
        assert_eq!(bench.board.resets(), 0);
        bench.board.set_bus_fault(BusFault::None);
        bench.board.run_for(Time::from_ms(1500));
        assert_eq!(
            bench.registers(0x10, 4),
            Ok(vec![100, 200, 300, 400]),
            "{fault:?}"
        );
        assert_eq!(bench.board.channel(4), Channel::Ao { code: 400 });
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_change_of_module_needs_a_setting_and_a_restart() {
    let mut bench = Bench::new(Module::Di4, 1);
    bench.unlock();
    bench.write(0x0114, &[2]).unwrap();
    assert_eq!(bench.register(0x0214), 1, "in force after the restart");
    bench.save();
    assert_eq!(bench.register(0x020A) & 16, 16, "waits for a restart");
    bench.board.power_off();
    bench.board.set_module(Module::Do4).unwrap();
    bench.board.power_on();
    bench.board.run_for(Time::from_ms(300));
    assert_eq!(bench.register(0x0214), 2);
    bench.ask(1, &[5, 0, 0x10, 0xFF, 0]).unwrap();
    assert_eq!(bench.board.channel(1), Channel::Do { on: true });
}
