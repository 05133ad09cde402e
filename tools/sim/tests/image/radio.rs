//! The radio as a second line: its set-up, requests over the air, saves and restarts, faults, and that the RS-485 line
//! is not disturbed by it.

use register_map::{
    codes::Baud,
    configuration::{
        BAUD, COMM_TIMEOUT, COMMAND, FILTER, KEY, LORA, LORA_ADDRESS, LORA_AIR_RATE, LORA_CHANNEL,
        LORA_FRAME_GAP, LORA_POWER, OPENING_KEY,
    },
    fault, radio, state,
};
use sim::radio::{Confirmation, Fault, Mode, Packet, Parameters, Sender};
use sim::soc::map::Block;
use sim::{Config, Module, Time};

use crate::LAYOUT;
use crate::bench::{Bench, FIRST, MODULE, adu, flash_with_settings, pages};

/// Time for the module's start and set-up: 500 ms for its own start, the rest for commands and changes of the mode.
const SET_UP: Time = Time::from_ms(1_500);
/// Time after which there is no reply any more. The longest exchange of these tests takes less at 2.4 kbit/s.
const SILENCE: Time = Time::from_ms(4_000);

/// A 4DI at unit address 1 with a radio module, before its set-up is complete.
fn starting(module: Parameters, settings: &[(u16, u16)]) -> Bench {
    let all = [&[(MODULE, Module::Di4.code()), (LORA, 1)], settings].concat();
    Bench::with(Config {
        module: Module::Di4,
        flash: Some(flash_with_settings(&all)),
        radio: Some(module),
        ..Config::default()
    })
}

/// The same after its set-up.
fn bench(settings: &[(u16, u16)]) -> Bench {
    let mut bench = starting(Parameters::FACTORY, settings);
    bench.board.run_for(SET_UP);
    bench
}

impl Bench {
    fn module(&self) -> &sim::radio::Module {
        self.board.radio().expect("a module is fitted")
    }

    fn air(&mut self) -> &mut sim::radio::Air {
        self.board.air().expect("a module is fitted")
    }

    /// Sends bytes over the air and returns the bytes that the gateway receives, up to a silence of half a second.
    fn over_the_air(&mut self, bytes: &[u8]) -> Vec<u8> {
        let now = self.board.now();
        self.air().send(now, bytes);
        let end = now + SILENCE;
        let mut last = None;
        while self.board.now() < end
            && last.is_none_or(|last| self.board.now() < last + Time::from_ms(500))
        {
            self.board.run_for(Time::from_ms(20));
            last = self.air().received().next_back().map(|byte| byte.end);
        }
        let received = self.air().take_received();
        received.iter().map(|byte| byte.byte).collect()
    }

    /// Sends a PDU to a unit over the air and returns the PDU of the reply, whose frame it checks.
    fn ask_over_the_air(&mut self, unit: u8, pdu: &[u8]) -> Option<Vec<u8>> {
        let reply = self.over_the_air(&adu(&[&[unit], pdu].concat()));
        if reply.is_empty() {
            return None;
        }
        let body = &reply[..reply.len() - 2];
        assert_eq!(reply, adu(body), "the reply's CRC");
        assert_eq!(body[0], unit);
        Some(body[1..].to_vec())
    }

    fn read_over_the_air(&mut self, address: u16, count: u16) -> Vec<u16> {
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

    fn write_over_the_air(&mut self, address: u16, value: u16) {
        let [[a, b], [c, d]] = [address, value].map(u16::to_be_bytes);
        let request = [6, a, b, c, d];
        assert_eq!(
            self.ask_over_the_air(1, &request).as_deref(),
            Some(&request[..])
        );
    }

    #[track_caller]
    fn assert_answers_over_the_air(&mut self) {
        let reply = self.ask_over_the_air(1, &[1, 0, FIRST, 0, 4]);
        assert!(matches!(reply.as_deref(), Some([1, 1, _])), "{reply:02X?}");
    }

    fn packets_of_the_unit(&mut self) -> Vec<Packet> {
        let air = self.air();
        let of_the_unit = air
            .packets()
            .filter(|packet| packet.sender == Sender::Board(0));
        of_the_unit.cloned().collect()
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn module_gets_the_stored_settings_and_requests_over_the_air_are_answered() {
    let mut bench = bench(&[
        (LORA_ADDRESS, 0x1234),
        (LORA_CHANNEL, 31),
        (LORA_AIR_RATE, 5),
        (LORA_POWER, 3),
    ]);
    let module = bench.module();
    assert_eq!(module.mode(), Some(Mode::Normal));
    assert_eq!(module.parameters().bytes(), [0x12, 0x34, 0x1D, 0x1F, 0x47]);
    assert_eq!(module.stored(), module.parameters());
    bench.board.set_energised(2, true).unwrap();
    bench.board.run_for(Time::from_ms(20));
    let reply = bench.ask_over_the_air(1, &[1, 0, FIRST, 0, 4]);
    assert_eq!(reply, Some(vec![1, 1, 0b0010]));
    assert_eq!(
        bench.ask_over_the_air(1, &[1, 0x7F, 0, 0, 1]),
        Some(vec![0x81, 2])
    );
    assert!(bench.board.take_log().ends_with("radio: ready\n"));
    assert!(!bench.status(state::status::MODULE_FAULT));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn module_that_has_the_settings_already_is_not_written() {
    let wanted = Parameters::FACTORY.with_address(7);
    let mut bench = starting(wanted, &[(LORA_ADDRESS, 7)]);
    let aux = LAYOUT.radio.aux;
    let (port, number) = (aux.port(), aux.number() as u8);
    bench.board.watch_pin(port, number);
    bench.board.run_for(SET_UP);
    // The end of the module's start, the command that reads the parameters, and the change to the normal mode.
    assert_eq!(bench.board.pin_edges(port, number).len(), 1 + 2 + 2);
    bench.assert_answers_over_the_air();
    assert_eq!(bench.module().stored(), wanted);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn module_whose_reply_to_the_settings_is_a_text_is_set_up() {
    let mut bench = starting(Parameters::FACTORY, &[(LORA_CHANNEL, 3)]);
    bench
        .board
        .change_radio(|module| module.set_confirmation(Confirmation::Text));
    bench.board.run_for(SET_UP);
    bench.assert_answers_over_the_air();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn settings_apply_after_a_save_and_a_restart() {
    let mut bench = bench(&[]);
    bench.tolerant = true;
    bench.configure(LORA_CHANNEL, &[9]);
    bench.configure(LORA_AIR_RATE, &[5]);
    bench.save();
    bench.assert_answers_over_the_air();
    bench.unlock();
    bench.write(COMMAND, &[2]).unwrap();
    bench.board.run_for(SET_UP);
    assert_eq!(bench.module().parameters().bytes()[2..4], [0x1D, 9]);
    bench.assert_answers_over_the_air();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn radio_that_is_off_leaves_its_pins_alone() {
    let mut bench = Bench::with(Config {
        flash: Some(flash_with_settings(&[(MODULE, Module::Di4.code())])),
        radio: Some(Parameters::FACTORY),
        ..Config::default()
    });
    bench.board.run_for(SET_UP);
    // The module's own pull-ups keep it in sleep.
    assert_eq!(bench.module().mode(), Some(Mode::Sleep));
    assert_eq!(bench.ask_over_the_air(1, &[1, 0, FIRST, 0, 4]), None);
    bench.assert_answers(1);
    assert_eq!(bench.registers(radio::BUS_MESSAGES, 9), Ok(vec![0; 9]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn radio_is_off_in_loader_mode_and_without_a_unit_address() {
    for dip in [255, 0, 248] {
        let all = [(MODULE, Module::Di4.code()), (LORA, 1)];
        let mut bench = Bench::with(Config {
            dip,
            flash: Some(flash_with_settings(&all)),
            radio: Some(Parameters::FACTORY),
            ..Config::default()
        });
        bench.board.run_for(SET_UP);
        assert_eq!(bench.module().mode(), Some(Mode::Sleep), "DIP switch {dip}");
    }
}

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
    let on_wire = bench.registers(radio::BUS_MESSAGES, 9).unwrap();
    assert_eq!(on_wire, [5, 1, 1, 4, 0, 0, 0, 0, 0]);
    let on_air = bench.read_over_the_air(radio::BUS_MESSAGES, 9);
    assert_eq!(on_air[..4], [6, 1, 1, 5]);
    let line = bench.read_over_the_air(state::BUS_MESSAGES, 4);
    assert_eq!(line, [1, 0, 0, 1]);
    // Function 08 answers with the counters of its own line.
    let messages = bench.ask_over_the_air(1, &[8, 0, 0x0B, 0, 0]);
    assert_eq!(messages, Some(vec![8, 0, 0x0B, 0, 8]));
    assert_eq!(bench.request(&[8, 0, 0x0B, 0, 0]), Ok(vec![0, 0x0B, 0, 2]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn longest_reply_and_longest_request_pass_the_air_with_a_frame_gap_above_the_pauses() {
    // The pause between two packets of 58 bytes is 300 - 60 ms at 2.4 kbit/s, and 75 - 60 ms at 9.6 kbit/s.
    for (air_rate, gap) in [(2, 300), (4, 50), (5, 5)] {
        let mut bench = bench(&[(LORA_AIR_RATE, air_rate), (LORA_FRAME_GAP, gap)]);
        assert_eq!(bench.read_over_the_air(FILTER, 32).len(), 32);
        let request = [&[0x10, 0x01, 0xA0, 0, 32, 64][..], &[0; 64]].concat();
        bench.unlock();
        let reply = bench.ask_over_the_air(1, &request);
        assert_eq!(
            reply,
            Some(vec![0x10, 0x01, 0xA0, 0, 32]),
            "air rate {air_rate}"
        );
        let echo: Vec<u8> = [8, 0, 0].into_iter().chain((0..=249).rev()).collect();
        assert_eq!(
            bench.ask_over_the_air(1, &echo).as_ref(),
            Some(&echo),
            "air rate {air_rate}"
        );
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn request_of_several_packets_with_pauses_above_the_frame_gap_is_lost_and_the_next_one_is_answered()
{
    let mut bench = bench(&[(LORA_FRAME_GAP, 50)]);
    let echo: Vec<u8> = [8, 0, 0].into_iter().chain([0x55; 100]).collect();
    assert_eq!(bench.ask_over_the_air(1, &echo), None);
    bench.assert_answers_over_the_air();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn broadcast_over_the_air_is_obeyed_in_silence() {
    let mut bench = bench(&[]);
    bench.unlock();
    let before = bench.packets_of_the_unit().len();
    let [a, b] = FILTER.to_be_bytes();
    assert_eq!(bench.ask_over_the_air(0, &[6, a, b, 0, 99]), None);
    assert_eq!(bench.packets_of_the_unit().len(), before);
    assert_eq!(bench.register(FILTER), 99);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_and_restart_ordered_over_the_air_are_answered_before_they_are_executed() {
    for air_rate in [0, 2, 5] {
        let mut bench = bench(&[(LORA_AIR_RATE, air_rate)]);
        bench.tolerant = true;
        bench.write_over_the_air(KEY, OPENING_KEY);
        bench.write_over_the_air(FILTER, 77);
        bench.write_over_the_air(COMMAND, 1);
        bench.board.run_for(Time::from_ms(100));
        bench.write_over_the_air(COMMAND, 2);
        // The unit waits for the longest time of a packet on the air, 4.8 s at 0.3 kbit/s.
        bench.board.run_for(Time::from_ms(5_000) + SET_UP);
        assert_eq!(
            bench.register(state::RESET_CAUSE) & 0b1000,
            0b1000,
            "a restart"
        );
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
    bench.unlock();
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
    assert_eq!(
        bench.register(state::RESET_CAUSE) & 0b1000,
        0b1000,
        "a restart"
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn request_over_the_air_restarts_the_communication_watchdog() {
    let mut bench = bench(&[(COMM_TIMEOUT, 25)]);
    bench.assert_answers(1);
    for _ in 0..4 {
        bench.board.run_for(Time::from_ms(100));
        bench.assert_answers_over_the_air();
    }
    assert_eq!(bench.read_over_the_air(state::STATUS, 1)[0] & 1, 0);
    bench.board.run_for(Time::from_ms(2600));
    assert_eq!(bench.read_over_the_air(state::STATUS, 1)[0] & 1, 1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn silent_radio_is_reported_and_used_when_it_answers() {
    for fault in [Fault::Absent, Fault::Hung] {
        let mut bench = starting(Parameters::FACTORY, &[]);
        bench.board.set_radio_fault(fault);
        bench.board.take_log();
        bench.board.run_for(Time::from_ms(3_000));
        let log = bench.board.take_log();
        assert!(
            log.contains("WARN radio: the module does not answer"),
            "{log}"
        );
        assert!(
            bench.status(state::status::MODULE_FAULT),
            "a module has a fault"
        );
        assert!(bench.board.leds().fault);
        bench.assert_answers(1);
        bench.board.run_for(Time::from_ms(12_000));
        assert_eq!(bench.board.take_log(), "", "reported once");
        bench.board.set_radio_fault(Fault::None);
        bench.board.run_for(Time::from_ms(9_000));
        assert!(bench.board.take_log().ends_with("radio: ready\n"));
        assert!(!bench.status(state::status::MODULE_FAULT));
        bench.assert_answers_over_the_air();
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn radio_that_hangs_in_service_is_reported_and_set_up_again() {
    let mut bench = bench(&[]);
    bench.assert_answers_over_the_air();
    bench.board.set_radio_fault(Fault::Hung);
    assert_eq!(bench.ask_over_the_air(1, &[1, 0, FIRST, 0, 4]), None);
    bench.board.run_for(Time::from_ms(31_000));
    assert!(bench.status(state::status::MODULE_FAULT));
    bench.board.set_radio_fault(Fault::None);
    bench.board.run_for(Time::from_ms(9_000));
    assert!(!bench.status(state::status::MODULE_FAULT));
    bench.assert_answers_over_the_air();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn lost_and_collided_packets_cost_their_requests_only() {
    let mut bench = bench(&[]);
    bench.air().set_loss(1.0);
    assert_eq!(bench.ask_over_the_air(1, &[1, 0, FIRST, 0, 4]), None);
    bench.air().set_loss(0.0);
    bench.assert_answers_over_the_air();
    // Another transmitter during the request.
    let now = bench.board.now();
    let parameters = bench.module().parameters();
    bench
        .air()
        .transmit(now + Time::from_ms(30), parameters, &[0x55; 20]);
    assert_eq!(bench.ask_over_the_air(1, &[1, 0, FIRST, 0, 4]), None);
    bench.assert_answers_over_the_air();
    // A frame of another protocol in front of a request.
    let now = bench.board.now();
    bench.air().transmit(now, parameters, b"hello");
    bench.board.run_for(Time::from_ms(500));
    bench.air().take_received();
    bench.assert_answers_over_the_air();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn disturbed_register_of_the_uart_is_set_again() {
    // Baud rate, receiver off, two stop bits and a reserved mode, half duplex.
    for (offset, bits) in [
        (0x08, 0x0400),
        (0x0C, 0x0004),
        (0x10, 0x2000),
        (0x14, 0x0008),
    ] {
        let mut bench = bench(&[]);
        bench.tolerant = true;
        bench.board.upset(Block::Usart3, offset, bits);
        bench.board.run_for(Time::from_ms(150));
        bench.assert_answers_over_the_air();
        assert_eq!(bench.register(fault::LINE_REPAIRS), 1, "offset {offset:#x}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn saves_do_not_disturb_requests_over_the_air() {
    let mut bench = bench(&[(LORA_AIR_RATE, 5), (LORA_FRAME_GAP, 20)]);
    let mut changed = false;
    for round in 0..60 {
        bench.configure(FILTER, &[round + 1; 30]);
        let now = bench.board.now();
        bench.air().send(now, &adu(&[1, 1, 0, FIRST, 0, 4]));
        // At a phase of the request and the reply that moves on from round to round.
        bench.board.run_for(Time::from_ms(u64::from(round) * 3));
        bench.write(COMMAND, &[1]).unwrap();
        bench.board.run_for(Time::from_ms(400));
        let reply = bench.air().take_received();
        let reply: Vec<u8> = reply.iter().map(|byte| byte.byte).collect();
        assert_eq!(reply, adu(&[1, 1, 1, 0]), "round {round}");
        changed |= pages()
            .iter()
            .any(|page| bench.board.flash()[page.clone()][2..4] == [0xFF; 2]);
    }
    assert!(changed, "a page is erased by some of the saves");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn rs485_line_at_921600_loses_nothing_while_the_radio_is_busy() {
    let mut bench = bench(&[
        (BAUD, Baud::B921600.code()),
        (LORA_AIR_RATE, 5),
        (LORA_FRAME_GAP, 5),
    ]);
    bench.settings(sim::line::Settings {
        baud: 921_600,
        ..sim::line::Settings::default()
    });
    // A reply may wait while a request over the air is served.
    bench.patience = Time::from_ms(1);
    let echo: Vec<u8> = [8, 0, 0].into_iter().chain(0..=249).collect();
    let request = adu(&[&[1], &echo[..200]].concat());
    let (mut replies, mut asked) = (0, false);
    for _ in 0..600 {
        if !asked {
            let now = bench.board.now();
            bench.air().send(now, &request);
            asked = true;
        }
        assert_eq!(bench.ask(1, &echo).as_ref(), Some(&echo));
        if bench.air().received().count() == request.len() {
            let received = bench.air().take_received();
            assert!(
                received
                    .iter()
                    .map(|byte| byte.byte)
                    .eq(request.iter().copied())
            );
            (replies, asked) = (replies + 1, false);
        }
    }
    assert!(replies >= 4, "{replies} replies over the air");
    assert_eq!(bench.registers(state::BUS_ERRORS, 1), Ok(vec![0]));
    assert_eq!(bench.registers(state::OVERRUNS, 2), Ok(vec![0, 0]));
    assert_eq!(bench.registers(radio::BUS_ERRORS, 1), Ok(vec![0]));
}
