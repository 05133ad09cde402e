//! The LoRa modules of several boards and the gateway on one air.

use rayon::ThreadPoolBuilder;
use sim::radio::{Byte, Mode, Packet, Parameters, Sender, timing};
use sim::{Board, Bus, Config, Time};

use super::asm::{Asm, When};
use super::board_with;
use super::echo::{echo, select_normal_mode, set_up};
use super::regs::*;

fn ms(n: u64) -> Time {
    Time::from_ms(n)
}

/// A board whose program sends each byte from the air back, plus one.
fn echo_board(stored: Parameters) -> Board {
    let mut program = set_up();
    // With the transmitter of the line on, the boards of a bus run farther between two exchanges.
    program.store(RCC_APB2ENR, 1 << 14 | 0b1_1101);
    program.store(USART1 + 8, 833);
    program.store(USART1 + 0x0C, 0x2008);
    select_normal_mode(&mut program);
    echo(&mut program);
    fitted(program, stored)
}

/// A board whose core sleeps, and whose module is in normal mode.
fn sleeping_board(stored: Parameters) -> Board {
    let mut program = set_up();
    select_normal_mode(&mut program);
    let top = program.here();
    program.wfi();
    program.branch(When::Always, top);
    fitted(program, stored)
}

fn fitted(program: Asm, stored: Parameters) -> Board {
    let config = Config {
        radio: Some(stored),
        ..Config::default()
    };
    let mut board = board_with(&program.image(), config);
    board.watch_pin('B', 5);
    board
}

fn at_address(address: u16) -> Parameters {
    Parameters::FACTORY.with_address(address)
}

/// A bus with these boards, and their modules started.
fn started(boards: Vec<Board>) -> Bus {
    let mut bus = Bus::new(boards);
    bus.run_until(timing::START_UP + ms(20));
    for board in bus.boards() {
        assert_eq!(board.radio().unwrap().mode(), Some(Mode::Normal));
    }
    bus
}

/// Sends bytes from the gateway now, and returns those that it receives within `span`.
fn exchange(bus: &mut Bus, bytes: &[u8], span: Time) -> Vec<u8> {
    let now = bus.now();
    bus.air().unwrap().send(now, bytes);
    bus.run_for(span);
    let received = bus.air().unwrap().take_received();
    received.iter().map(|byte| byte.byte).collect()
}

fn counts(bus: &Bus) -> Vec<(u64, u64)> {
    let radios = bus.boards().iter().map(|board| board.radio().unwrap());
    radios
        .map(|radio| (radio.packets_sent(), radio.packets_received()))
        .collect()
}

#[test]
fn packet_of_a_board_reaches_the_others_at_its_exact_time() {
    let mut bus = started(vec![
        echo_board(at_address(7)),
        sleeping_board(at_address(7)),
        sleeping_board(at_address(9)),
    ]);
    assert_eq!(exchange(&mut bus, b"A", ms(500)), b"B");
    assert_eq!(counts(&bus), [(1, 1), (0, 2), (0, 0)]);
    let packets: Vec<Packet> = bus.air().unwrap().packets().cloned().collect();
    assert_eq!(packets[0].sender, Sender::Gateway);
    assert_eq!(packets[1].sender, Sender::Board(0));
    let edges = bus.board(1).pin_edges('B', 5);
    let falls: Vec<Time> = edges
        .iter()
        .filter(|(at, level)| !level && *at > timing::START_UP)
        .map(|&(at, _)| at)
        .collect();
    let checked = [&packets[0], &packets[1]].map(|packet| packet.end + timing::CHECK);
    assert_eq!(falls, checked);
}

/// Everything that the air and the firmware of the boards can see of a run.
type Run = (Vec<Packet>, Vec<Byte>, Vec<Vec<(Time, bool)>>);

/// Three boards that answer, with losses, a transmitter that disturbs, and a board that loses its power.
fn eventful_run(step: Time) -> Run {
    let boards = [7, 7, 0xFFFF].map(|address| echo_board(at_address(address)));
    let mut bus = started(
        boards
            .into_iter()
            .chain([sleeping_board(at_address(7))])
            .collect(),
    );
    let begin = bus.now();
    let air = bus.air().unwrap();
    air.set_loss(0.3);
    for (n, text) in [&b"one"[..], b"two", b"three", b"four"]
        .into_iter()
        .enumerate()
    {
        air.send(begin + ms(450) * n as u64, text);
    }
    air.transmit(begin + ms(700), at_address(1), b"disturbs");
    let end = begin + ms(2000);
    for (until, power) in [
        (begin + ms(1000), false),
        (begin + ms(1010), true),
        (end, true),
    ] {
        while bus.now() < until {
            bus.run_until(until.min(bus.now() + step));
        }
        match power {
            true => bus.board_mut(1).power_on(),
            false => bus.board_mut(1).power_off(),
        }
    }
    let edges = bus
        .boards()
        .iter()
        .map(|board| board.pin_edges('B', 5).to_vec());
    let edges = edges.collect();
    let air = bus.air().unwrap();
    let packets = air.packets().cloned().collect();
    (packets, air.take_received(), edges)
}

#[test]
fn run_does_not_depend_on_host_cores_or_spans() {
    let with = |threads| {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| eventful_run(ms(2000)))
    };
    let one = with(1);
    assert!(one.0.len() > 8, "{} packets", one.0.len());
    assert!(one == with(4));
    assert!(
        one == eventful_run(ms(3)),
        "nor on the spans in which time passes"
    );
}
