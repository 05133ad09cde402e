//! Requests over the air: frames of several packets, and commands.

use register_map::configuration::{
    COMMAND, FILTER, KEY, LORA_AIR_RATE, LORA_FRAME_GAP, OPENING_KEY,
};
use sim::{Corner, Time};

use crate::radio::{SET_UP, rig};
use crate::rig::{adu, corner};

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
        let mut rig = rig(&[(LORA_AIR_RATE, air_rate), (LORA_FRAME_GAP, gap)]);
        assert_eq!(rig.read_over_the_air(FILTER, 32).len(), 32);
        let echo: Vec<u8> = [8, 0, 0].into_iter().chain((0..=249).rev()).collect();
        assert_eq!(
            rig.ask_over_the_air(1, &echo).as_ref(),
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
    let mut rig = rig(&[(LORA_AIR_RATE, air_rate)]);
    rig.write_over_the_air(KEY, OPENING_KEY);
    let request = [&[0x10, 0x01, 0xA0, 0, 32, 64][..], &[0; 64]].concat();
    let reply = rig.ask_over_the_air(1, &request);
    assert_eq!(reply, Some(vec![0x10, 0x01, 0xA0, 0, 32]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_and_restart_ordered_over_the_air_are_answered_before_they_are_executed() {
    for air_rate in [0, 5] {
        let mut rig = rig(&[(LORA_AIR_RATE, air_rate)]);
        rig.tolerant = true;
        rig.write_over_the_air(KEY, OPENING_KEY);
        rig.write_over_the_air(FILTER, 77);
        rig.write_over_the_air(COMMAND, 1);
        rig.board.run_for(Time::from_ms(100));
        rig.write_over_the_air(COMMAND, 2);
        // The unit waits for the longest time of a packet on the air, 4.8 s at 0.3 kbit/s, before the restart and
        // after it.
        rig.board.run_for(Time::from_ms(10_000) + SET_UP);
        rig.assert_restarted();
        assert_eq!(
            rig.read_over_the_air(FILTER, 1),
            [77],
            "air rate {air_rate}"
        );
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn command_of_one_line_waits_for_its_own_reply_only() {
    let mut rig = rig(&[]);
    rig.tolerant = true;
    rig.write_over_the_air(KEY, OPENING_KEY);
    // A restart ordered over the air, while the other line is polled without pause.
    let [a, b] = COMMAND.to_be_bytes();
    let now = rig.board.now();
    rig.air().send(now, &adu(&[1, 6, a, b, 0, 2]));
    let mut polls = 0;
    while rig.air().received().count() < 8 {
        rig.assert_answers(1);
        polls += 1;
    }
    assert!(polls > 5, "{polls}");
    rig.board.run_for(SET_UP);
    rig.assert_restarted();
}
