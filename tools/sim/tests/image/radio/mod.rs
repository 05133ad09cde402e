//! The radio as a second line: a unit with a module, and the set-up of the module.

mod set_up;

use register_map::{configuration::LORA, state};
use sim::radio::{Packet, Parameters, Sender};
use sim::{Config, Module, Time};

use crate::rig::{FIRST, Rig, adu, config};

/// Time for the module's start and set-up: 500 ms for its own start, the rest for commands and changes of the mode.
pub const SET_UP: Time = Time::from_ms(1_500);
/// Time after which there is no reply any more. The longest exchange of these tests takes less at 2.4 kbit/s.
pub const SILENCE: Time = Time::from_ms(6_000);
/// Silence after a reply. The longest pause between two packets of these tests is shorter.
const PAUSE: Time = Time::from_ms(700);

/// A 4DI at unit address 1 with a radio module, before its set-up is complete.
pub fn starting(module: Parameters, settings: &[(u16, u16)]) -> Rig {
    Rig::with(Config {
        radio: Some(module),
        ..config(Module::Di4, &[&[(LORA, 1)], settings].concat())
    })
}

/// The same after its set-up.
pub fn rig(settings: &[(u16, u16)]) -> Rig {
    let mut rig = starting(Parameters::FACTORY, settings);
    rig.board.run_for(SET_UP);
    rig
}

impl Rig {
    /// Returns the radio module.
    pub fn module(&self) -> &sim::radio::Module {
        self.board.radio().expect("a module is fitted")
    }

    /// Returns the air.
    pub fn air(&mut self) -> &mut sim::radio::Air {
        self.board.air().expect("a module is fitted")
    }

    /// Sends bytes over the air and returns the bytes that the gateway receives, up to a [`PAUSE`].
    pub fn over_the_air(&mut self, bytes: &[u8]) -> Vec<u8> {
        let now = self.board.now();
        self.air().send(now, bytes);
        let end = now + SILENCE;
        let mut last = None;
        while self.board.now() < end && last.is_none_or(|last| self.board.now() < last + PAUSE) {
            self.board.run_for(Time::from_ms(20));
            last = self.air().received().next_back().map(|byte| byte.end);
        }
        self.take_from_the_air()
    }

    /// Returns the bytes that the gateway has received since the last call.
    pub fn take_from_the_air(&mut self) -> Vec<u8> {
        let received = self.air().take_received();
        received.iter().map(|byte| byte.byte).collect()
    }

    /// Sends a PDU to a unit over the air and returns the PDU of the reply, whose frame it checks.
    pub fn ask_over_the_air(&mut self, unit: u8, pdu: &[u8]) -> Option<Vec<u8>> {
        let reply = self.over_the_air(&adu(&[&[unit], pdu].concat()));
        if reply.is_empty() {
            return None;
        }
        let body = &reply[..reply.len() - 2];
        assert_eq!(reply, adu(body), "the reply's CRC");
        assert_eq!(body[0], unit);
        Some(body[1..].to_vec())
    }

    /// Reads registers of unit 1 over the air.
    pub fn read_over_the_air(&mut self, address: u16, count: u16) -> Vec<u16> {
        let [[a, b], [c, d]] = [address, count].map(u16::to_be_bytes);
        let reply = self.ask_over_the_air(1, &[3, a, b, c, d]).expect("a reply");
        assert_eq!(
            usize::from(reply[1]),
            2 * usize::from(count),
            "{reply:02X?}"
        );
        let words = reply[2..].as_chunks().0;
        words.iter().copied().map(u16::from_be_bytes).collect()
    }

    /// Writes a register of unit 1 over the air.
    pub fn write_over_the_air(&mut self, address: u16, value: u16) {
        let [[a, b], [c, d]] = [address, value].map(u16::to_be_bytes);
        let request = [6, a, b, c, d];
        assert_eq!(
            self.ask_over_the_air(1, &request).as_deref(),
            Some(&request[..])
        );
    }

    /// Asserts that unit 1 answers over the air.
    #[track_caller]
    pub fn assert_answers_over_the_air(&mut self) {
        let reply = self.ask_over_the_air(1, &[1, 0, FIRST, 0, 4]);
        assert!(matches!(reply.as_deref(), Some([1, 1, _])), "{reply:02X?}");
    }

    /// Asserts that the firmware itself caused the last reset.
    #[track_caller]
    pub fn assert_restarted(&mut self) {
        let cause = self.register(state::RESET_CAUSE);
        assert_ne!(cause & state::reset_cause::SOFTWARE, 0, "a restart");
    }

    /// Returns the packets that the unit has sent.
    pub fn packets_of_the_unit(&mut self) -> Vec<Packet> {
        let air = self.air();
        let of_the_unit = air
            .packets()
            .filter(|packet| packet.sender == Sender::Board(0));
        of_the_unit.cloned().collect()
    }
}
