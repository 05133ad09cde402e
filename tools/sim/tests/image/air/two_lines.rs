//! Orders over one line, and what happens over the other one at the same time.

use register_map::{
    configuration::{
        COMM_TIMEOUT, COMMAND, FILTER, KEY, LORA_AIR_RATE, LORA_FRAME_GAP, OPENING_KEY,
    },
    points, state,
};
use sim::Time;
use sim::radio::Mode;

use crate::radio::{SET_UP, rig};
use crate::rig::{Rig, adu};

impl Rig {
    /// Writes COMMAND over the air, and returns at the instant at which the gateway has the reply.
    fn order_over_the_air(&mut self, command: u8) {
        let [a, b] = COMMAND.to_be_bytes();
        let request = adu(&[1, 6, a, b, 0, command]);
        let now = self.board.now();
        self.air().send(now, &request);
        let limit = now + crate::radio::SILENCE;
        while self.air().received().count() < request.len() {
            assert!(self.board.now() < limit, "no reply");
            self.board.run_for(Time::from_ms(1));
        }
        assert_eq!(self.take_from_the_air(), request);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_ordered_over_the_air_is_done_before_a_restart_ordered_over_the_wire() {
    let mut rig = rig(&[]);
    rig.tolerant = true;
    rig.configure(FILTER, &[77]);
    rig.write_over_the_air(KEY, OPENING_KEY);
    rig.order_over_the_air(1);
    rig.command(2);
    rig.board.run_for(SET_UP);
    rig.assert_restarted();
    assert_eq!(rig.register(FILTER), 77);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn defaults_ordered_over_the_air_do_not_replace_later_settings() {
    let mut rig = rig(&[]);
    rig.configure(FILTER, &[77]);
    rig.write_over_the_air(KEY, OPENING_KEY);
    rig.order_over_the_air(3);
    rig.configure(FILTER, &[78]);
    rig.board.run_for(SET_UP);
    assert_eq!(rig.register(FILTER), 78);
}

/// A request over the air that is never complete is reported to the watchdog when LORA_FRAME_GAP has passed, which is
/// after later requests of the wire.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn polled_wire_keeps_the_communication_watchdog_quiet_during_a_request_over_the_air() {
    let mut rig = rig(&[(COMM_TIMEOUT, 3), (LORA_FRAME_GAP, 500)]);
    // The watchdog has tripped in the set-up.
    rig.command(5);
    let now = rig.board.now();
    rig.air().send(now, &adu(&[1, 8, 0, 0, 1, 2, 3, 4]));
    for _ in 0..20 {
        rig.board.run_for(Time::from_ms(80));
        assert_eq!(rig.register(state::STATUS) & 1, 0);
    }
    assert!(rig.air().received().count() > 0, "it was answered");
}

/// AUX is high while the last packet is on the air, and a reset of the part does not end it. What is sent to the module
/// then goes over the air.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn restart_during_a_reply_over_the_air_sends_nothing_else() {
    let [a, b] = points::first(1).to_be_bytes();
    let long = adu(&[1, 3, a, b, 0, 4]);
    let longest = adu(&[&[1, 8, 0, 0], &[0x55; 100][..]].concat());
    for (air_rate, request) in [(0, &long), (2, &long), (5, &longest)] {
        let mut rig = rig(&[(LORA_AIR_RATE, air_rate), (LORA_FRAME_GAP, 50)]);
        rig.tolerant = true;
        let now = rig.board.now();
        rig.air().send(now, request);
        while rig.packets_of_the_unit().is_empty() {
            rig.board.run_for(Time::from_ms(5));
        }
        rig.board.run_for(Time::from_ms(10));
        let before = rig.board.resets();
        rig.command(2);
        let mut ready = false;
        for _ in 0..600 {
            rig.board.run_for(Time::from_ms(20));
            ready |= rig.board.resets() > before && rig.module().mode() == Some(Mode::Normal);
        }
        assert!(ready, "air rate {air_rate}");
        let reply = rig.take_from_the_air();
        let sent = rig.packets_of_the_unit();
        let sent = sent.iter().map(|packet| &packet.bytes[..]);
        assert_eq!(
            sent.collect::<Vec<_>>().concat(),
            reply,
            "air rate {air_rate}"
        );
        assert!(reply == adu(&reply[..reply.len() - 2]), "{reply:02X?}");
        rig.assert_answers_over_the_air();
    }
}
