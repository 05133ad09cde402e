//! Somebody else's firmware as a witness of the fx3u-24: the prebuilt `fx3u.bin` of eddyem/stm32samples
//! (`F1:F103/FX3U`), which was written for the real board and knows nothing of this project. It is not part of the
//! repository: set MODIO_WITNESS to its path.

use sim::board::terminals::Value;
use sim::board::{FX3U_24, Layout};
use sim::line::{Format, Settings};
use sim::part::{Part, STM32F103VC};
use sim::{Board, Config, Image, Time};

use super::{board_with, findings};

const LINE: Settings = Settings {
    baud: 9600,
    format: Format::N1,
};

/// The board as the witness needs it. Its stack is at the end of 64 KiB of SRAM, of which the part has 48 KiB by its data
/// sheet: all parts of high density have the same silicon.
const LAYOUT: Layout = Layout {
    part: Part {
        name: "STM32F103VC with 64 KiB of SRAM",
        ram_size: 64 * 1024,
        ..STM32F103VC
    },
    ..FX3U_24
};

fn witness() -> Board {
    let path = std::env::var("MODIO_WITNESS").expect("MODIO_WITNESS is the path of fx3u.bin");
    let code = std::fs::read(path).expect("the file can be read");
    let image = Image::from_bytes(&code).expect("it is plain machine code");
    let config = Config {
        layout: &LAYOUT,
        ..Config::default()
    };
    let mut board = board_with(&image, config);
    board.line().set_settings(LINE);
    board.rs232().unwrap().set_settings(Settings {
        baud: 115_200,
        format: Format::N1,
    });
    board
}

/// Sends a request and returns the reply without address and CRC.
fn ask(board: &mut Board, body: &[u8]) -> Vec<u8> {
    let mut frame = [&[1], body].concat();
    frame.extend(modbus_line::adu::crc(&frame));
    let at = board.now();
    board.line().send(at, &frame);
    board.run_for(Time::from_ms(80));
    let received = board.line().take_received();
    assert!(received.iter().all(sim::line::Received::is_good));
    let reply: Vec<u8> = received.iter().map(|received| received.byte).collect();
    println!("{frame:02X?} -> {reply:02X?}");
    let (rest, crc) = reply.split_at(reply.len().saturating_sub(2));
    assert_eq!(crc, modbus_line::adu::crc(rest));
    assert_eq!(rest[0], 1);
    rest[1..].to_vec()
}

/// Returns the 16 inputs, X8 being the switch RUN. A set bit is a high pin.
fn inputs(board: &mut Board) -> u16 {
    let reply = ask(board, &[2, 0, 0, 0, 16]);
    assert_eq!(reply[..2], [2, 2]);
    u16::from_be_bytes([reply[2], reply[3]])
}

/// Returns the text that the witness has sent to the RS-232 port.
fn console(board: &mut Board) -> String {
    let received = board.rs232().unwrap().take_received();
    received.iter().map(|byte| char::from(byte.byte)).collect()
}

fn relays(board: &Board) -> Vec<&'static str> {
    let all = board.terminals().iter();
    let on = all.filter(|(_, value)| *value == Value::Relay(true));
    on.map(|(terminal, _)| terminal.name).collect()
}

#[test]
#[ignore = "needs fx3u.bin: MODIO_WITNESS"]
fn witness_reads_every_input_and_switches_every_relay_by_its_own_table() {
    let mut board = witness();
    board.run_until(Time::from_ms(1000));
    assert_eq!(console(&mut board), "START\nPORRSTF=1\nPINRSTF=1\n");
    assert_eq!(inputs(&mut board), 0xFCFF);
    let names = (0..8).chain(10..16).map(|n| (n, format!("X{n}")));
    for (n, name) in names {
        board.set_terminal(&name, Value::Input(true)).unwrap();
        assert_eq!(inputs(&mut board), 0xFCFF & !(1 << n), "{name}");
        board.set_terminal(&name, Value::Input(false)).unwrap();
    }
    board.set_terminal("RUN", Value::Switch(true)).unwrap();
    assert_eq!(inputs(&mut board), 0xFDFF);
    for n in (0..8).chain(10..12) {
        let on = [5, 0, n, 0xFF, 0];
        assert_eq!(ask(&mut board, &on), on);
        assert_eq!(relays(&board), [format!("Y{n}")]);
        let reply = ask(&mut board, &[1, 0, 0, 0, 16]);
        assert_eq!(reply[..2], [1, 2]);
        assert_eq!(u16::from_be_bytes([reply[2], reply[3]]), 1 << n);
        let off = [5, 0, n, 0, 0];
        assert_eq!(ask(&mut board, &off), off);
    }
    // All, in its own order of bytes.
    assert_eq!(
        ask(&mut board, &[15, 0, 0, 0, 16, 2, 8, 1]),
        [15, 0, 0, 0, 16]
    );
    assert_eq!(relays(&board), ["Y0", "Y11"]);
    for (request, exception) in [
        (&[5, 0, 8, 0xFF, 0], 2),
        (&[5, 0, 12, 0xFF, 0], 2),
        (&[1, 0, 8, 0, 8], 2),
        (&[2, 0, 0, 0, 12], 3),
    ] {
        assert_eq!(ask(&mut board, request), [request[0] | 0x80, exception]);
    }
}

#[test]
#[ignore = "needs fx3u.bin: MODIO_WITNESS"]
fn witness_measures_the_analog_terminals_and_switches_the_led() {
    let mut board = witness();
    for (name, value) in [
        ("AD0", Value::Voltage(10_000)),
        ("AD1", Value::Voltage(1_000)),
        ("AD2", Value::Voltage(5_000)),
        ("AD3", Value::Current(20_000)),
        ("AD4", Value::Current(4_000)),
        ("AD5", Value::Current(12_000)),
        ("POT0", Value::Potentiometer(1000)),
        ("POT1", Value::Potentiometer(500)),
    ] {
        board.set_terminal(name, value).unwrap();
    }
    board.run_until(Time::from_ms(1000));
    let reply = ask(&mut board, &[4, 0, 0, 0, 10]);
    let words = reply[2..].chunks(2);
    let codes: Vec<_> = words.map(|w| u16::from_be_bytes([w[0], w[1]])).collect();
    // It samples most inputs for 167 ns only, in which the inputs for currents, which have no capacitor, do not settle.
    // In place of AD5 the binary, which is older than its source, converts PA0, the output Y3. The last two are the
    // temperature sensor and the reference of 1.2 V.
    let exact = [3968, 397, 1985, 3830, 766, 0, 4095, 2048, 1775, 1489];
    for (n, (code, exact)) in codes.iter().zip(exact).enumerate() {
        assert!(code.abs_diff(exact) <= 32, "input {n}: {code}, {exact}");
    }
    assert!(!board.leds().run);
    assert_eq!(ask(&mut board, &[6, 0, 2, 0, 1]), [6, 0, 2, 0, 1]);
    assert!(board.leds().run);
    assert_eq!(ask(&mut board, &[3, 0, 2, 0, 1]), [3, 4, 0, 0, 0, 1]);
    assert_eq!(ask(&mut board, &[3, 0, 3, 0, 1]), [3, 4, 0, 0, 0xFC, 0xFF]);
    // It restarts by this register, without a reply.
    let frame = [1, 6, 0, 0, 0, 0];
    let crc = modbus_line::adu::crc(&frame);
    let at = board.now();
    board.line().send(at, &[&frame[..], &crc].concat());
    board.run_for(Time::from_ms(1000));
    let console = console(&mut board);
    assert!(
        console.ends_with("START\nSFTRSTF=1\nPINRSTF=1\n"),
        "{console}"
    );
    println!("{:#?}", findings(&board));
}
