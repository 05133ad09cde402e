//! Tests with gateways, and with units that answer late.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use modbus_reference::Server;
use modioctl::bus::adu::{Framing, pdu, words_of};
use modioctl::bus::{Endpoint, Lost, Master, Place};
use register_map::Module;
use register_map::state::UPDATE;

use crate::gateway::Gateway;
use crate::program::{At, has};
use crate::served::{Answers, Modio, other, serve_requests};

const MS: Duration = Duration::from_millis(1);

/// What a request gets.
enum Reply {
    Answer,
    Exception(u8),
    Nothing,
}
use Reply::{Answer, Exception, Nothing};

/// Serves a modio-02 with a loader over TCP with RTU frames. `reply` says what each request to an address gets.
fn line(mut reply: impl FnMut(u8, &[u8]) -> Reply + Send + 'static) -> SocketAddr {
    let mut modio = Modio::modio_02(Module::Di4).with([(UPDATE, 1)]);
    serve_requests(move |unit, pdu| {
        Some(match reply(unit, pdu) {
            Answer => modio.response(unit, pdu),
            Exception(code) => Framing::Rtu.frame(0, unit, &[pdu[0] | 0x80, code]),
            Nothing => Vec::new(),
        })
    })
}

/// Serves units with these addresses.
fn units(addresses: &'static [u8]) -> SocketAddr {
    line(|unit, _| {
        if addresses.contains(&unit) {
            Answer
        } else {
            Nothing
        }
    })
}

#[test]
fn exceptions_0a_and_0b_are_asked_again_on_every_line() {
    for code in [0x0A, 0x0B] {
        let mut requests = 0;
        let line = line(move |_, _| {
            requests += 1;
            if requests % 3 == 0 {
                Answer
            } else {
                Exception(code)
            }
        });
        for at in [
            At::tcp(line),
            At::modbus_tcp(Gateway::default().before(line)),
        ] {
            let text = at.run("read p5.1 FORMAT --raw").fine();
            assert_eq!(text, "p5.1    0\nFORMAT  0\n");
        }
    }
}

#[test]
fn a_unit_that_no_try_finds_behind_a_gateway_is_status_3() {
    let requests = Arc::new(Mutex::new(0));
    let count = Arc::clone(&requests);
    let line = line(move |_, _| {
        *count.lock().unwrap() += 1;
        Nothing
    });
    let gateway = Gateway::waiting(30 * MS);
    let text = At::modbus_tcp(gateway.before(line)).run("read 0").failed(3);
    has(
        &text,
        &["unit 1 does not answer the gateway", "exception 0B"],
    );
    assert_eq!(*requests.lock().unwrap(), 3, "one request and two retries");
}

#[test]
fn a_read_is_repeated_while_the_unit_or_the_gateway_is_busy() {
    for code in [5, 6] {
        let busy = Gateway {
            busy: Some(code),
            ..Gateway::default()
        };
        let at = At::modbus_tcp(busy.before(units(&[1])));
        assert_eq!(at.run("read p5.1").fine(), "p5.1  off\n", "{code:02X}");
        let always = line(move |_, _| Exception(code));
        for words in ["read p5.1", "update --status"] {
            let text = At::tcp(always)
                .run(&format!("--retries 1 {words}"))
                .failed(1);
            has(&text, &["unit 1", "busy", "again"]);
            assert!(!text.contains("not a modio"), "{text}");
        }
    }
}

#[test]
fn busy_is_asked_again_without_retries() {
    let mut is_busy = false;
    let line = line(move |_, _| {
        is_busy = !is_busy;
        if is_busy { Exception(6) } else { Answer }
    });
    let text = At::tcp(line).run("--retries 0 read p5.1").fine();
    assert_eq!(text, "p5.1  off\n");
}

/// Each absent unit costs the gateway more than the time-out, so the answers to later requests are late as well.
#[test]
fn a_scan_waits_for_the_late_answers_of_a_gateway() {
    for healthy in [&[2, 5, 6][..], &[]] {
        let gateway = Gateway::waiting(200 * MS);
        let at = At::modbus_tcp(gateway.before(units(healthy)));
        let ran = at.run("--timeout 100ms scan --units 1-6");
        let found = ran.out.lines().map(|line| line[..1].parse().unwrap());
        assert_eq!(found.collect::<Vec<u8>>(), healthy, "{ran:?}");
        assert_eq!(ran.status, 3, "{ran:?}");
        has(&ran.err, &["the gateway answers late: --timeout 1s"]);
    }
}

/// After a bit error the gateway reports a unit that is there as absent.
#[test]
fn a_scan_over_modbus_tcp_asks_again_and_counts_the_silent_addresses() {
    let mut asked = [0; 7];
    let line = line(move |unit, _| {
        asked[usize::from(unit)] += 1;
        match (unit, asked[usize::from(unit)]) {
            (5, 1) => Exception(0x0B),
            (2 | 5, _) => Answer,
            _ => Nothing,
        }
    });
    let gateway = Gateway::waiting(200 * MS);
    let ran = At::modbus_tcp(gateway.before(line)).run("scan --units 1-6");
    has(&ran.err, &["silent addresses: 4; ", "in the gateway"]);
    let text = ran.fine();
    assert_eq!(text.lines().count(), 2, "{text}");
    assert!(text.contains("\n5  "), "{text}");
}

#[test]
fn an_address_that_is_busy_and_then_silent_is_named_by_a_scan() {
    let mut asked = 0;
    let line = line(move |unit, _| {
        asked += i32::from(unit == 2);
        match unit {
            1 => Answer,
            2 if asked == 1 => Exception(6),
            _ => Nothing,
        }
    });
    let gateway = Gateway::waiting(200 * MS);
    let ran = At::modbus_tcp(gateway.before(line)).run("scan --units 1-3");
    has(&ran.failed(1), &["had no time for addresses 2:"]);
}

#[test]
fn a_gateway_that_passes_only_standard_functions_creates_no_units() {
    let gateway = Gateway {
        only_standard: true,
        ..Gateway::waiting(20 * MS)
    };
    let at = At::modbus_tcp(gateway.before(units(&[3])));
    let text = at.run("scan --units 1-5").fine();
    assert_eq!(text.lines().count(), 1, "{text}");
    assert!(text.starts_with("3  "), "{text}");
}

/// Gateways that speak RTU answer for a missing unit as those for Modbus TCP do.
#[test]
fn a_gateway_with_rtu_frames_that_passes_only_standard_functions_creates_no_units() {
    let line = line(|unit, pdu| match (unit, pdu[0]) {
        (3, 1..=7) => Answer,
        (_, 1..=7) => Exception(0x0B),
        _ => Exception(1),
    });
    let text = At::tcp(line).run("scan --units 1-5").fine();
    assert!(
        text.starts_with("3  ") && text.lines().count() == 1,
        "{text}"
    );
}

#[test]
fn a_unit_has_a_loader_when_its_register_says_so() {
    let gateway = Gateway {
        only_standard: true,
        ..Gateway::default()
    };
    let at = At::modbus_tcp(gateway.before(units(&[1])));
    let text = at.run("update --status").failed(1);
    has(&text, &["unit 1", "function 14", "gateway"]);
    assert!(!text.contains("no loader"), "{text}");
}

#[test]
fn a_gateway_with_its_own_transaction_ids_is_status_4_and_creates_no_units() {
    let gateway = Gateway {
        own_ids: true,
        ..Gateway::default()
    };
    let at = At::modbus_tcp(gateway.before(units(&[1])));
    let ran = at.run("--timeout 50ms scan --units 1-3");
    assert_eq!(ran.status, 4, "{ran:?}");
    assert!(
        !ran.out
            .lines()
            .any(|line| line.starts_with(char::is_numeric)),
        "{ran:?}"
    );
}

#[test]
fn a_gateway_that_answers_as_unit_255_is_status_4() {
    let gateway = Gateway {
        unit_255: true,
        ..Gateway::default()
    };
    let at = At::modbus_tcp(gateway.before(units(&[1])));
    let text = at.run("--timeout 50ms --retries 0 read 0").failed(4);
    has(&text, &["unit 255 answers, not unit 1"]);
}

/// Reads two registers in turn from a unit that needs longer than the time-out for some answers. The value of each
/// register is its address.
#[track_caller]
fn read_in_turn(place: Place, framing: Framing, retries: u8) {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        let endpoint = Endpoint {
            timeout: 100 * MS,
            retries,
            baud: 921_600,
            ..Endpoint::new(place, framing)
        };
        let mut master = Master::open(endpoint, None).await.unwrap();
        let mut answered = 0;
        for n in 0..24 {
            let address = [0x10, 0x20][n % 2];
            match master.ask(1, &pdu(3, address, 1)).await {
                Ok(answer) => {
                    assert_eq!(words_of(&answer), [address], "{framing:?}, read {n}");
                    answered += 1;
                }
                Err(Lost::Silent) => {}
                Err(lost) => panic!("{framing:?}, read {n}: {lost:?}"),
            }
        }
        assert!(answered > 5, "{framing:?}: {answered}");
    });
}

/// How a unit answers function 08.
#[derive(Clone, Copy, Debug)]
enum Echo {
    Answer,
    /// Every second answer is lost.
    Lost,
    Exception,
    Silence,
}

impl Echo {
    /// Returns the frame for a request of a function, which may be 08.
    fn frame(self, server: &mut Server, unit: u8, pdu: &[u8]) -> Vec<u8> {
        server.device.words[0x3F] += u16::from(pdu[0] == 8);
        match (self, pdu[0]) {
            (Self::Lost, 8) if server.device.words[0x3F] % 2 == 1 => Vec::new(),
            (Self::Silence, 8) => Vec::new(),
            (Self::Exception, 8) => Framing::Rtu.frame(0, unit, &[0x88, 1]),
            _ => server.response(unit, pdu),
        }
    }
}

#[test]
fn a_late_answer_is_never_mistaken_for_the_answer_to_another_request() {
    let echoes = [Echo::Answer, Echo::Lost, Echo::Exception, Echo::Silence];
    let rtu = echoes.map(|echo| (Framing::Rtu, echo));
    thread::scope(|all| {
        for (framing, echo) in rtu.into_iter().chain([(Framing::Mbap, Echo::Answer)]) {
            // `monitor` sends each request once.
            for retries in [0, 2] {
                all.spawn(move || read_late_in_turn(framing, echo, retries));
            }
        }
    });
}

fn read_late_in_turn(framing: Framing, echo: Echo, retries: u8) {
    let mut server = other();
    for (word, n) in server.device.words.iter_mut().zip(0..0x30) {
        *word = n;
    }
    let mut random = fastrand::Rng::with_seed(1);
    let line = serve_requests(move |unit, pdu| {
        // Often twice in succession.
        if random.bool() {
            thread::sleep(MS * random.u32(110..130));
        }
        Some(echo.frame(&mut server, unit, pdu))
    });
    let place = match framing {
        Framing::Mbap => Place::ModbusTcp(Gateway::default().before(line).to_string()),
        _ => Place::Tcp(line.to_string()),
    };
    read_in_turn(place, framing, retries);
}

/// A unit whose every second answer about register 0 has a bit error. The counter is the number of requests of function 08.
fn damaging(
    echo: impl Fn(&mut Server, u8, &[u8]) -> Vec<u8> + Send + 'static,
) -> (At, Arc<Mutex<usize>>) {
    let count = Arc::new(Mutex::new(0));
    let requests = Arc::clone(&count);
    let mut server = other();
    let mut damage = false;
    let line = serve_requests(move |unit, pdu| {
        *requests.lock().unwrap() += usize::from(pdu[0] == 8);
        let mut frame = echo(&mut server, unit, pdu);
        if pdu[0] != 8 && pdu[1..3] == [0, 0] {
            damage = !damage;
            frame[3] ^= u8::from(damage);
        }
        Some(frame)
    });
    (At::tcp(line), count)
}

#[test]
fn a_unit_that_is_silent_to_function_08_is_asked_after_a_damaged_answer() {
    let (at, requests) = damaging(|server, unit, pdu| Echo::Silence.frame(server, unit, pdu));
    let text = at
        .run("--timeout 100ms watch 0 100 --csv --every 100ms --count 3")
        .fine();
    let values = text
        .lines()
        .skip(1)
        .map(|row| row.split_once(',').unwrap().1);
    assert_eq!(values.collect::<Vec<_>>(), ["0,0"; 3]);
    assert_eq!(
        *requests.lock().unwrap(),
        3,
        "one request and two retries, once"
    );
}

#[test]
fn writes_need_no_function_08_after_a_damaged_answer() {
    let (at, requests) = damaging(|server, unit, pdu| Echo::Silence.frame(server, unit, pdu));
    at.run("--timeout 100ms write 0=1 1=1").fine();
    assert_eq!(*requests.lock().unwrap(), 0);
}

#[test]
fn an_exception_to_function_08_shows_the_order_when_one_was_lost() {
    let (at, _) = damaging({
        let lost = std::sync::atomic::AtomicBool::new(false);
        move |server, unit, pdu| match pdu[0] == 8
            && !lost.swap(true, std::sync::atomic::Ordering::Relaxed)
        {
            true => Vec::new(),
            false => Echo::Exception.frame(server, unit, pdu),
        }
    });
    at.run("--timeout 100ms read 0 100").fine();
}
