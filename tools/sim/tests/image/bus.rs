//! Several boards on one line.

use sim::line::Received;
use sim::{Board, Bus, Config, Module, Time};

use crate::rig::{self, FIRST, START, adu, config, corner};

/// Returns boards with these switches on one bus, with time to start.
fn bus(dips: impl IntoIterator<Item = u8>) -> Bus {
    let boards = dips.into_iter().map(board).collect();
    let mut bus = Bus::new(boards);
    bus.run_for(START);
    bus
}

fn board(dip: u8) -> Board {
    let mut config = Config {
        dip,
        ..config(Module::Di4, &[])
    };
    config.chip.corner = corner();
    rig::board(config)
}

/// Sends these bytes now, waits 50 ms after their end, and returns what the master has received.
fn exchange(bus: &mut Bus, bytes: &[u8]) -> Vec<Received> {
    let now = bus.now();
    let end = bus.line().send(now, bytes);
    bus.run_until(end + Time::from_ms(50));
    bus.line().take_received()
}

/// Sends a PDU to a unit. Returns the PDU of its reply.
fn ask(bus: &mut Bus, unit: u8, pdu: &[u8]) -> Option<Vec<u8>> {
    let received = exchange(bus, &adu(&[&[unit], pdu].concat()));
    assert!(received.iter().all(Received::is_good), "{received:?}");
    let bytes: Vec<u8> = received.iter().map(|received| received.byte).collect();
    let body = bytes.get(..bytes.len().checked_sub(2)?)?;
    assert_eq!(bytes, adu(body), "the CRC");
    assert_eq!(body[0], unit);
    Some(body[1..].to_vec())
}

fn read_inputs(bus: &mut Bus, unit: u8) -> Option<Vec<u8>> {
    ask(bus, unit, &[2, 0, FIRST, 0, 4])
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_unit_that_loses_power_in_mid_reply_releases_the_line() {
    let mut bus = bus([1, 2]);
    let now = bus.now();
    let sent = bus.line().send(now, &adu(&[1, 2, 0, FIRST, 0, 4]));
    let settings = bus.line().settings();
    // Run to the middle of the third byte: the reply begins within a character after t3.5.
    while !bus.board(0).driver_enable() {
        bus.run_for(settings.rate().bits(1));
    }
    bus.run_for(settings.rate().bits(28));
    bus.board_mut(0).power_off();
    assert_eq!(bus.board(0).findings(), []);
    let cut = bus.now();
    bus.run_until(sent + Time::from_ms(50));
    let received = bus.line().take_received();
    assert!((2..=3).contains(&received.len()), "{received:?}");
    assert!(bus.line().level_at(cut + Time::from_us(2)));
    assert_eq!(
        bus.line()
            .falling_edges(cut, sent + Time::from_ms(50))
            .count(),
        0
    );
    // The other unit has received an incomplete message and still answers requests.
    assert_eq!(read_inputs(&mut bus, 1), None);
    assert!(read_inputs(&mut bus, 2).is_some());
    let before = bus.now();
    bus.cycle(0);
    assert!(
        bus.boards()
            .iter()
            .all(|board| board.now() >= before + Time::from_ms(100))
    );
    bus.run_for(START);
    assert!(read_inputs(&mut bus, 1).is_some());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn one_board_on_a_bus_behaves_like_a_board_without_a_bus() {
    let mut alone = board(1);
    let mut bus = Bus::new(vec![board(1)]);
    let request = adu(&[1, 2, 0, FIRST, 0, 4]);
    alone.run_for(START);
    bus.run_for(START);
    for _ in 0..3 {
        let now = alone.now();
        assert_eq!(bus.now(), now);
        let end = alone.line().send(now, &request);
        assert_eq!(bus.line().send(now, &request), end);
        alone.run_until(end + Time::from_ms(30));
        bus.run_until(end + Time::from_ms(30));
    }
    let said = |line: &sim::line::Line| {
        (
            line.frames().cloned().collect::<Vec<_>>(),
            line.received().copied().collect::<Vec<_>>(),
            line.driver_edges().collect::<Vec<_>>(),
            line.falling_edges(Time::ZERO, line.now())
                .collect::<Vec<_>>(),
        )
    };
    let (one, other) = (said(alone.line()), said(bus.line()));
    assert_eq!((one.0.len(), one.2.len()), (6, 6));
    assert_eq!(one, other);
    assert_eq!(alone.instructions(), bus.board(0).instructions());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_unit_replies_the_same_with_and_without_other_units() {
    let replies = |dips: &[u8]| {
        let mut bus = bus(dips.iter().copied());
        let mut at = bus.now();
        for _ in 0..5 {
            // A bus stops after the instruction that passes the time, which may be another one with more boards. A
            // request that was sent "now" would not begin at the same time.
            at += Time::from_ms(60);
            bus.line().send(at, &adu(&[1, 2, 0, FIRST, 0, 4]));
            bus.run_until(at + Time::from_ms(59));
        }
        let received = bus.line().frames().cloned();
        let received: Vec<_> = received.collect();
        assert_eq!(received.len(), 10);
        received
    };
    assert_eq!(replies(&[1]), replies(&[1, 2, 3, 4]));
}
