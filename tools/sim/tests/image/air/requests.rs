//! Requests over the air: counters, long frames, broadcasts, commands.

use register_map::{
    configuration::{
        COMM_SOURCE, COMM_TIMEOUT, COMMAND, FILTER, KEY, LORA, LORA_AIR_RATE, LORA_FRAME_GAP,
        OPENING_KEY,
    },
    second, state,
};
use sim::{Corner, Module, Time};

use crate::bench::{FIRST, MODULE, adu, corner};
use crate::radio::{SET_UP, bench};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn each_line_has_its_own_counters_which_both_lines_show() {
    let mut bench = bench(&[]);
    for _ in 0..3 {
        bench.assert_answers_over_the_air();
    }
    bench.ask_over_the_air(1, &[0x42]);
    bench.ask_over_the_air(9, &[1, 0, FIRST, 0, 4]);
    bench.over_the_air(&[1, 2, 3, 4, 5]);
    let on_wire = bench.registers(second::BUS_MESSAGES, 9).unwrap();
    assert_eq!(on_wire, [5, 1, 1, 4, 0, 0, 0, 0, 0]);
    let on_air = bench.read_over_the_air(second::BUS_MESSAGES, 9);
    assert_eq!(on_air[..4], [6, 1, 1, 5]);
    let line = bench.read_over_the_air(state::BUS_MESSAGES, 4);
    assert_eq!(line, [1, 0, 0, 1]);
    // Function 08 returns the counters of the line that received the request.
    let messages = bench.ask_over_the_air(1, &[8, 0, 0x0B, 0, 0]);
    assert_eq!(messages, Some(vec![8, 0, 0x0B, 0, 8]));
    assert_eq!(bench.request(&[8, 0, 0x0B, 0, 0]), Ok(vec![0, 0x0B, 0, 2]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn longest_reply_and_longest_request_pass_the_air_with_a_frame_gap_above_the_pauses() {
    // The pause between two packets of 58 bytes is 300 - 60 ms at 2.4 kbit/s, 75 - 60 ms at 9.6 kbit/s, and 0 at 19.2
    // kbit/s. At the slow corner it is 600 - 60, 150 - 60 and 75 - 60 ms.
    let cases = match corner() {
        Corner::Nominal | Corner::Fast | Corner::Gd32 => &[(2, 300), (4, 50), (5, 5)][..],
        Corner::Slow => &[(4, 150), (5, 50)],
    };
    for &(air_rate, gap) in cases {
        let mut bench = bench(&[(LORA_AIR_RATE, air_rate), (LORA_FRAME_GAP, gap)]);
        assert_eq!(bench.read_over_the_air(FILTER, 32).len(), 32);
        let echo: Vec<u8> = [8, 0, 0].into_iter().chain((0..=249).rev()).collect();
        assert_eq!(
            bench.ask_over_the_air(1, &echo).as_ref(),
            Some(&echo),
            "air rate {air_rate}"
        );
    }
}

/// The pause between the packets is 244 ms at 2.4 kbit/s, and at the slow corner at 4.8 kbit/s.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn write_of_two_packets_is_answered_with_the_factory_frame_gap() {
    let air_rate = match corner() {
        Corner::Nominal | Corner::Fast | Corner::Gd32 => 2,
        Corner::Slow => 3,
    };
    let mut bench = bench(&[(LORA_AIR_RATE, air_rate)]);
    bench.write_over_the_air(KEY, OPENING_KEY);
    let request = [&[0x10, 0x01, 0xA0, 0, 32, 64][..], &[0; 64]].concat();
    let reply = bench.ask_over_the_air(1, &request);
    assert_eq!(reply, Some(vec![0x10, 0x01, 0xA0, 0, 32]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn broadcast_over_the_air_writes_points_in_silence_and_no_setting() {
    let mut bench = bench(&[(MODULE, Module::Do4.code())]);
    bench.write_over_the_air(KEY, OPENING_KEY);
    let before = bench.packets_of_the_unit().len();
    let [a, b] = FILTER.to_be_bytes();
    assert_eq!(bench.ask_over_the_air(0, &[6, a, b, 0, 99]), None);
    assert_eq!(bench.ask_over_the_air(0, &[5, 0, FIRST, 0xFF, 0]), None);
    assert_eq!(bench.packets_of_the_unit().len(), before);
    assert_eq!(bench.register(FILTER), 5);
    assert_eq!(bench.bits(1, FIRST.into(), 1), Ok(vec![true]));
}

/// A stranger in radio range asks for what the page on the radio says that nobody gets over the air.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn radio_for_points_and_reads_only_serves_nothing_else() {
    let mut bench = bench(&[(LORA, 2)]);
    let [k, y] = KEY.to_be_bytes();
    let [c, d] = COMMAND.to_be_bytes();
    bench.unlock();
    for request in [
        &[6, k, y, 0x5A, 0x17][..],
        &[6, c, d, 0, 2],
        &[8, 0, 4, 0, 0],
        &[8, 0, 1, 0, 0],
        &[8, 0, 10, 0, 0],
    ] {
        let refused = Some(vec![request[0] | 0x80, 6]);
        assert_eq!(
            bench.ask_over_the_air(1, request),
            refused,
            "{request:02X?}"
        );
    }
    assert_eq!(bench.register(KEY), 1, "the cable keeps the lock");
    bench.assert_answers_over_the_air();
    assert_eq!(bench.read_over_the_air(KEY, 1), [0]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_and_restart_ordered_over_the_air_are_answered_before_they_are_executed() {
    for air_rate in [0, 5] {
        let mut bench = bench(&[(LORA_AIR_RATE, air_rate)]);
        bench.tolerant = true;
        bench.write_over_the_air(KEY, OPENING_KEY);
        bench.write_over_the_air(FILTER, 77);
        bench.write_over_the_air(COMMAND, 1);
        bench.board.run_for(Time::from_ms(100));
        bench.write_over_the_air(COMMAND, 2);
        // The unit waits for the longest time of a packet on the air, 4.8 s at 0.3 kbit/s, before the restart and
        // after it.
        bench.board.run_for(Time::from_ms(10_000) + SET_UP);
        bench.assert_restarted();
        assert_eq!(
            bench.read_over_the_air(FILTER, 1),
            [77],
            "air rate {air_rate}"
        );
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn command_of_one_line_waits_for_its_own_reply_only() {
    let mut bench = bench(&[]);
    bench.tolerant = true;
    bench.write_over_the_air(KEY, OPENING_KEY);
    // A restart ordered over the air, while the other line is polled without pause.
    let [a, b] = COMMAND.to_be_bytes();
    let now = bench.board.now();
    bench.air().send(now, &adu(&[1, 6, a, b, 0, 2]));
    let mut polls = 0;
    while bench.air().received().count() < 8 {
        bench.assert_answers(1);
        polls += 1;
    }
    assert!(polls > 5, "{polls}");
    bench.board.run_for(SET_UP);
    bench.assert_restarted();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn request_over_the_air_restarts_the_communication_watchdog_unless_comm_source_excludes_it() {
    let mut bench = bench(&[(COMM_TIMEOUT, 25)]);
    bench.assert_answers(1);
    for _ in 0..4 {
        bench.board.run_for(Time::from_ms(100));
        bench.assert_answers_over_the_air();
    }
    assert_eq!(bench.read_over_the_air(state::STATUS, 1)[0] & 1, 0);
    // From now on only writes over the RS-485 line count. This is the last one.
    bench.configure(COMM_SOURCE, &[3]);
    for _ in 0..5 {
        bench.board.run_for(Time::from_ms(100));
        bench.assert_answers(1);
        bench.assert_answers_over_the_air();
    }
    assert_eq!(bench.register(state::STATUS) & 1, 1);
}
