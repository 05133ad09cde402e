//! Silences inside a reply. A reply is complete before its first byte is sent, so only a late interrupt can separate
//! two of its characters.

use register_map::{
    codes::Baud,
    configuration::{self, BETA, LORA, LORA_AIR_RATE, LORA_FRAME_GAP},
};
use sim::line::{Direction, Settings};
use sim::radio::Parameters;
use sim::{Config, Module, Time};

use crate::rig::{Rig, adu, ascii, config};
use crate::saving::{SLOWEST, large};
use crate::self_description::request;

/// Duration of a save with an erase, from the order on.
const SAVE: Time = Time::from_ms(300);
/// A setting that takes any value from 2000 to 5000, whatever the modules are.
const LAST_BETA: u16 = BETA + 31;
/// Time between two requests over the air, which are answered there.
const ON_AIR: Time = Time::from_ms(250);

/// Returns requests whose replies are long or take long to make, with a name for messages.
fn requests() -> [(&'static str, Vec<u8>); 7] {
    let echo = [&[8, 0, 0], &[0x55; 240][..]].concat();
    [
        ("03 x 125", vec![3, 0x01, 0x60, 0, 125]),
        ("14, 35 groups", request(&[(1, 15, 2); 35])),
        ("14, 124 records", request(&[(1, 15, 124)])),
        (
            "17 x 125",
            vec![0x17, 0x01, 0x60, 0, 125, 0x01, 0x7E, 0, 1, 2, 0x0B, 0xB8],
        ),
        ("08, 240 bytes", echo),
        ("03 x 1", vec![3, 0x02, 0x0A, 0, 1]),
        ("0C", vec![0x0C]),
    ]
}

/// A unit under load: it saves its settings and erases pages while it also answers over the air.
struct Loaded {
    rig: Rig,
    is_ascii: bool,
    on_air: Time,
}

impl Loaded {
    fn new(baud: Baud, is_ascii: bool) -> Self {
        let settings = [
            (configuration::BAUD, baud.code()),
            (configuration::MODE, is_ascii.into()),
            (LORA, 1),
            (LORA_AIR_RATE, 5),
            (LORA_FRAME_GAP, 50),
        ];
        let mut rig = Rig::with(Config {
            radio: Some(Parameters::FACTORY),
            ..config(Module::Ai2Ao2, &[&settings, &large()[..]].concat())
        });
        rig.settings(Settings {
            baud: baud.bits_per_second(),
            ..Settings::default()
        });
        rig.board.set_flash_durations(SLOWEST);
        // The radio module sets itself up.
        rig.board.run_for(Time::from_ms(1_500));
        // A request that ends during an erase is answered after the erase.
        rig.patience = Time::from_ms(60);
        Self {
            rig,
            is_ascii,
            on_air: Time::ZERO,
        }
    }

    /// Sends a request. Returns the longest silence inside the reply, or `None` when the reply is not a complete frame.
    fn silence(&mut self, pdu: &[u8]) -> Option<Time> {
        let board = &mut self.rig.board;
        let now = board.now();
        if now >= self.on_air {
            let air = board.air().expect("a radio");
            air.take_received();
            air.send(now, &adu(&[&[1, 8, 0, 0], &[0x55; 60][..]].concat()));
            self.on_air = now + ON_AIR;
        }
        let frame = if self.is_ascii {
            ascii(pdu, "\r\n")
        } else {
            adu(&[&[1], pdu].concat())
        };
        self.rig.exchange(&frame);
        let reply = self.rig.board.line().frames().next_back()?;
        if reply.direction != Direction::Response || !reply.crc_ok {
            return None;
        }
        // The first digit of the function code is 8 or 9 in an exception.
        let refused = if self.is_ascii {
            reply.bytes[3] >= b'8'
        } else {
            reply.bytes[1] >= 0x80
        };
        assert!(!refused, "{pdu:02X?}: {:02X?}", reply.bytes);
        Some(reply.longest_gap)
    }

    /// Orders a save of a changed setting.
    fn save(&mut self, value: u8) {
        let [high, low] = LAST_BETA.to_be_bytes();
        for write in [
            [6, 0x01, 0x00, 0x5A, 0x17],
            [6, high, low, 0x0B, value],
            [6, 0x01, 0x08, 0, 1],
        ] {
            self.silence(&write).expect("a reply");
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn no_reply_has_a_silence_of_more_than_half_a_character_under_any_load() {
    let mut failures = Vec::new();
    for (bauds, is_ascii) in [
        (&[Baud::B1200, Baud::B115200, Baud::B921600][..], false),
        (&[Baud::B115200, Baud::B921600], true),
    ] {
        for &baud in bauds {
            let mut loaded = Loaded::new(baud, is_ascii);
            let half = Time::from_ps(loaded.rig.characters(1).as_ps() / 2);
            let mut longest = requests().map(|(name, _)| (name, Some(Time::ZERO)));
            let operations = loaded.rig.board.flash_operations();
            for value in 10..13 {
                loaded.save(value);
                let end = loaded.rig.board.now() + SAVE;
                while loaded.rig.board.now() < end {
                    for ((_, longest), (_, pdu)) in longest.iter_mut().zip(requests()) {
                        let silence = loaded.silence(&pdu);
                        *longest = longest.and_then(|longest| Some(longest.max(silence?)));
                    }
                }
            }
            let operations = loaded.rig.board.flash_operations() - operations;
            assert!(operations > 3 * 190, "{baud:?}: {operations} operations");
            for (name, silence) in longest {
                let mode = if is_ascii { "ASCII" } else { "RTU" };
                let measured =
                    silence.map_or("not complete".to_owned(), |it| format!("{} ns", it.as_ns()));
                let text = format!(
                    "{baud:?} {mode}, {name}: {measured}, half a character {} ns",
                    half.as_ns()
                );
                println!("{text}");
                if silence.is_none_or(|silence| silence > half) {
                    failures.push(text);
                }
            }
        }
    }
    assert_eq!(failures, [""; 0], "the longest silence inside a reply");
}
