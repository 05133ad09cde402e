//! Several units on one air, asked in turn.

use register_map::{
    configuration::{FILTER, LORA, LORA_AIR_RATE},
    second,
};
use sim::radio::{Parameters, timing};
use sim::{Bus, Config, Corner, Module, Time};

use crate::radio::SET_UP;
use crate::rig::{self, adu, config};

/// The rates of LORA_AIR_RATE in bit/s.
const RATES: [u32; 6] = [300, 1200, 2400, 4800, 9600, 19_200];
/// Least time between a reply and the next request of a master: 3.5 characters at 9600 bit/s.
const TURNAROUND: Time = Time::from_ms(4);
/// Longest time of an exchange, without its two packets on the air: bytes at the UARTs and delays of the modules. With
/// the LORA_FRAME_GAP of 300 ms an exchange would take longer.
const REST: Time = Time::from_ms(200);

/// Units 1 to 3 with factory settings except for the air rate, and a master that counts the frames.
struct Air {
    bus: Bus,
    rate: u32,
    corner: Corner,
    requests: u16,
    /// Number of replies of each unit.
    replies: [u16; 3],
}

impl Air {
    fn new(rate: u32, corner: Corner) -> Self {
        let code = RATES.iter().position(|each| *each == rate).expect("a rate") as u16;
        let board = |dip| {
            let mut config = Config {
                dip,
                radio: Some(Parameters::FACTORY),
                ..config(Module::Di4, &[(LORA, 1), (LORA_AIR_RATE, code)])
            };
            config.chip.corner = corner;
            rig::board(config)
        };
        let mut bus = Bus::new([1, 2, 3].map(board).into());
        bus.run_for(SET_UP);
        Self {
            bus,
            rate,
            corner,
            requests: 0,
            replies: [0; 3],
        }
    }

    /// Reads registers of a unit, and returns as soon as the gateway has the reply.
    #[track_caller]
    fn read(&mut self, unit: u8, address: u16, count: u8) -> Vec<u16> {
        self.bus.run_for(TURNAROUND);
        let [high, low] = address.to_be_bytes();
        let request = adu(&[unit, 3, high, low, 0, count]);
        let length = 5 + 2 * usize::from(count);
        let on_air = |bytes| timing::packet(bytes, self.rate, self.corner);
        let latest = self.bus.now() + on_air(request.len()) + on_air(length) + REST;
        let now = self.bus.now();
        self.bus.air().unwrap().send(now, &request);
        self.requests += 1;
        while self.bus.air().unwrap().received().count() < length {
            assert!(
                self.bus.now() < latest,
                "no reply of unit {unit} with {length} bytes at {} bit/s",
                self.rate
            );
            self.bus.run_for(Time::from_ms(2));
        }
        self.replies[usize::from(unit) - 1] += 1;
        let received = self.bus.air().unwrap().take_received();
        let reply: Vec<u8> = received.iter().map(|byte| byte.byte).collect();
        let body = &reply[..length - 2];
        assert_eq!(adu(body), reply, "the reply's CRC");
        assert_eq!(body[..3], [unit, 3, 2 * count]);
        let words = body[3..].as_chunks().0;
        words.iter().copied().map(u16::from_be_bytes).collect()
    }
}

/// The replies have 7 to 57 bytes, which is one packet.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn three_units_that_are_asked_in_turn_answer_at_once_at_every_air_rate() {
    // The lowest rates take minutes at each corner.
    for (corner, rates) in [(Corner::Fast, &RATES[2..]), (Corner::Slow, &RATES[..])] {
        for &rate in rates {
            let mut air = Air::new(rate, corner);
            for (unit, count) in [(1, 1), (2, 26), (3, 2), (1, 9)] {
                assert_eq!(air.read(unit, FILTER, count), vec![5; count.into()]);
            }
            for unit in [2, 3] {
                let counters = air.read(unit, second::BUS_MESSAGES, 2);
                // A unit does not receive its own replies.
                let others = (1..).zip(air.replies).filter(|(other, _)| *other != unit);
                let messages = air.requests + others.map(|(_, replies)| replies).sum::<u16>();
                assert_eq!(counters, [messages, 0], "unit {unit} at {rate} bit/s");
            }
            for board in air.bus.boards() {
                assert_eq!(board.findings(), []);
                assert_eq!(board.resets(), 0);
            }
        }
    }
}
