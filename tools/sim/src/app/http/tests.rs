//! Tests of the server on a socket. In place of the boards' thread, a thread replies with the request itself.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::mpsc;

use serde_json::json;

use super::*;

fn server() -> (SocketAddr, broadcast::Sender<Note>) {
    server_with(connections::PATIENCE)
}

/// Returns a server that closes a connection over which nothing can be sent for `patience`.
fn server_with(patience: Duration) -> (SocketAddr, broadcast::Sender<Note>) {
    let (events, queue) = mpsc::channel();
    thread::spawn(move || {
        while let Ok(Event::Request(request, reply)) = queue.recv() {
            let body = String::from_utf8_lossy(&request.body).into_owned();
            let body = json!([request.method, request.target, body]);
            let _ = reply.send(api::Reply { status: 200, body });
        }
    });
    let live = broadcast::Sender::new(16);
    let address = "127.0.0.1:0".parse().unwrap();
    let address = serve(address, events, live.clone(), patience).unwrap();
    (address, live)
}

fn ask(address: SocketAddr, request: &[u8]) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(request).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

/// Returns the answer to a valid request that changes nothing.
fn read_state(address: SocketAddr) -> String {
    ask(
        address,
        format!("GET /api/state HTTP/1.1\r\n{HEAD}\r\n").as_bytes(),
    )
}

const HEAD: &str = "Host: localhost\r\nConnection: close\r\n";

#[test]
fn request_is_passed_on_completely_and_its_reply_is_sent() {
    let request =
        format!("POST /api/dip?x HTTP/1.1\r\n{HEAD}Content-Length: 11\r\n\r\n{{\"value\":7}}");
    let answer = ask(server().0, request.as_bytes());
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    assert!(
        answer.contains("content-type: application/json"),
        "{answer}"
    );
    let expected = json!(["POST", "/api/dip?x", "{\"value\":7}"]).to_string();
    assert!(answer.ends_with(&expected), "{answer}");
}

#[test]
fn page_loads_nothing_from_other_servers() {
    let (address, _live) = server();
    let mut wanted = vec!["/".to_owned()];
    let mut seen = Vec::new();
    while let Some(path) = wanted.pop() {
        let answer = ask(
            address,
            format!("GET {path} HTTP/1.1\r\n{HEAD}\r\n").as_bytes(),
        );
        assert!(answer.starts_with("HTTP/1.1 200"), "{path}: {answer}");
        assert!(
            answer.contains("content-security-policy: default-src 'self'"),
            "{path}: {answer}"
        );
        for part in answer.split(['"', '\'', '(', ')']) {
            assert!(
                !part.starts_with("//") && (!part.contains("://") || part.contains("www.w3.org")),
                "{path}: {part}"
            );
            let is_file =
                part.starts_with('/') && [".js", ".css"].iter().any(|end| part.ends_with(end));
            if is_file && !seen.contains(&part.to_owned()) {
                wanted.push(part.to_owned());
                seen.push(part.to_owned());
            }
        }
    }
    seen.sort();
    // The first of the files is the page itself, and `/map.js` is not one of them.
    assert_eq!(seen.len(), page::FILES.len(), "{seen:?}");
}

#[test]
fn requests_of_foreign_pages_and_names_can_only_read() {
    let (address, _live) = server();
    let ask = |method: &str, headers: &str| {
        let request = format!(
            "{method} /api/power HTTP/1.1\r\n{headers}Connection: close\r\nContent-Length: 2\r\n\r\n{{}}"
        );
        ask(address, request.as_bytes())
    };
    let foreign = "Host: example.org\r\n";
    assert!(ask("GET", foreign).starts_with("HTTP/1.1 200"));
    for headers in [
        foreign,
        "Host: localhost\r\nOrigin: http://example.org\r\n",
        "Host: localhost\r\nOrigin: null\r\n",
    ] {
        let answer = ask("POST", headers);
        assert!(answer.starts_with("HTTP/1.1 403"), "{headers}: {answer}");
        assert!(answer.contains("{\"error\":"), "{answer}");
    }
    let own = format!("Host: {address}\r\nOrigin: http://{address}\r\n");
    assert!(ask("POST", &own).starts_with("HTTP/1.1 200"));
}

#[test]
fn body_that_is_too_long_is_refused() {
    let (address, _live) = server();
    let head =
        |length: u64| format!("POST /api/dip HTTP/1.1\r\n{HEAD}Content-Length: {length}\r\n\r\n");
    for length in [LONGEST_BODY as u64 + 1, 4_000_000] {
        let mut request = head(length).into_bytes();
        request.resize(request.len() + length as usize, b' ');
        assert!(ask(address, &request).starts_with("HTTP/1.1 413"));
    }
    // The server does not wait for the end of this body, and closes the connection.
    assert!(ask(address, head(99_999_999_999).as_bytes()).starts_with("HTTP/1.1 413"));
    let chunks =
        format!("POST /api/dip HTTP/1.1\r\n{HEAD}Transfer-Encoding: chunked\r\n\r\n20000\r\n")
            .into_bytes();
    let mut request = chunks;
    request.resize(request.len() + 0x20000, b' ');
    request.extend(b"\r\n0\r\n\r\n");
    assert!(ask(address, &request).starts_with("HTTP/1.1 413"));
}

#[test]
fn slow_client_does_not_delay_another_client() {
    let (address, _live) = server();
    let mut slow = TcpStream::connect(address).unwrap();
    slow.write_all(b"POST /api/dip HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n\r\n{")
        .unwrap();
    let answer = read_state(address);
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
}

#[test]
fn connection_above_the_limit_is_refused_until_another_ends() {
    let (address, _live) = server();
    let held: Vec<_> = (0..connections::MOST)
        .map(|_| TcpStream::connect(address).unwrap())
        .collect();
    let answer = read_state(address);
    assert!(answer.starts_with("HTTP/1.1 503"), "{answer}");
    assert!(answer.contains("too many connections"), "{answer}");
    drop(held);
    // The server notices a moment later that these connections have ended.
    let served = (0..200).any(|_| {
        thread::sleep(Duration::from_millis(10));
        read_state(address).starts_with("HTTP/1.1 200")
    });
    assert!(served);
}

/// Reads until the server closes the connection, and returns what was read.
fn until_closed(mut stream: TcpStream) -> String {
    let patience = Some(Duration::from_secs(30));
    stream.set_read_timeout(patience).unwrap();
    let mut answer = Vec::new();
    match stream.read_to_end(&mut answer) {
        Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => panic!("still open"),
        // A connection that is closed before its request is complete may be reset.
        _ => String::from_utf8_lossy(&answer).into_owned(),
    }
}

#[test]
fn connection_without_a_complete_request_is_closed_after_a_time() {
    let (address, _live) = server_with(Duration::from_millis(300));
    let begin = |text: &str| {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(text.as_bytes()).unwrap();
        stream
    };
    let idle = begin("");
    let head = begin("GET /api/state HTTP/1.1\r\nHost: local");
    let body = begin("POST /api/dip HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100\r\n\r\n{");
    // This client has its reply, and sends no further request.
    let kept = begin("GET /api/state HTTP/1.1\r\nHost: localhost\r\n\r\n");
    // This one sends its header a byte at a time, without end.
    let slow = begin("GET /api/state HTTP/1.1\r\nX: ");
    let mut sending = slow.try_clone().unwrap();
    thread::spawn(move || {
        while sending.write_all(b"x").is_ok() {
            thread::sleep(Duration::from_millis(20));
        }
    });
    for stream in [idle, head, body, slow] {
        assert!(!until_closed(stream).contains("200 OK"));
    }
    assert!(until_closed(kept).starts_with("HTTP/1.1 200"));
}

/// Connects and sends a request for a path.
fn requesting(address: SocketAddr, path: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    stream
}

#[test]
fn connection_whose_client_does_not_read_is_closed_after_a_time() {
    let (address, live) = server_with(Duration::from_millis(300));
    let mut stream = requesting(address, "/api/events");
    let note = Note {
        board: None,
        name: "frame",
        data: "x".repeat(1 << 20).into(),
    };
    let closed = (0..2000).any(|_| {
        thread::sleep(Duration::from_millis(10));
        live.send(note.clone()).is_err() && stream.write_all(b"x").is_err()
    });
    assert!(closed);
}

#[test]
fn stream_of_events_above_the_limit_is_refused_and_other_requests_are_answered() {
    let (address, live) = server();
    let streams: Vec<_> = (0..STREAMS)
        .map(|_| {
            let mut stream = requesting(address, "/api/events");
            stream.read_exact(&mut [0; 12]).unwrap();
            stream
        })
        .collect();
    assert_eq!(live.receiver_count(), STREAMS);
    let request = format!("GET /api/events HTTP/1.1\r\n{HEAD}\r\n");
    let answer = ask(address, request.as_bytes());
    assert!(answer.starts_with("HTTP/1.1 503"), "{answer}");
    assert!(answer.contains("too many streams of events"), "{answer}");
    assert!(read_state(address).starts_with("HTTP/1.1 200"));
    drop(streams);
}

#[test]
fn requests_of_clients_that_disconnect_do_not_pile_up_in_the_queue() {
    let (events, queue) = mpsc::channel();
    let live = broadcast::Sender::new(1);
    let address = listen("127.0.0.1:0".parse().unwrap(), events, live).unwrap();
    for _ in 0..3 * connections::MOST {
        let _stream = requesting(address, "/api/state");
        thread::sleep(Duration::from_millis(2));
    }
    let mut waiting = Vec::new();
    while let Ok(event) = queue.recv_timeout(Duration::from_millis(300)) {
        waiting.push(event);
    }
    assert_eq!(waiting.len(), connections::MOST);
    drop(waiting);
    thread::spawn(move || read_state(address));
    let next = queue.recv_timeout(Duration::from_secs(20));
    assert!(matches!(next, Ok(Event::Request(..))));
}

#[test]
fn event_stream_begins_with_the_state_and_continues_with_changes() {
    let (address, live) = server();
    let mut stream = requesting(address, "/api/events");
    let mut received = String::new();
    let mut until = |end: &str| {
        let mut bytes = [0; 512];
        while !received.contains(end) {
            let count = stream.read(&mut bytes).unwrap();
            assert!(count > 0, "{received}");
            received += std::str::from_utf8(&bytes[..count]).unwrap();
        }
        received.clone()
    };
    let begun = until("/api/state");
    assert!(begun.contains("content-type: text/event-stream"), "{begun}");
    assert!(begun.contains("event: state\ndata: [\"GET\""), "{begun}");
    live.send(Note {
        board: None,
        name: "frame",
        data: "{\"number\":1}".into(),
    })
    .unwrap();
    until("event: frame\ndata: {\"number\":1}\n\n");
    assert_eq!(live.receiver_count(), 1);
    drop(stream);
    // The server notices the disconnection when it next sends an event.
    let gone = (0..200).any(|_| {
        thread::sleep(Duration::from_millis(10));
        let _ = live.send(Note {
            board: None,
            name: "frame",
            data: "{}".into(),
        });
        live.receiver_count() == 0
    });
    assert!(gone);
}

#[test]
fn stopping_simulator_answers_with_503() {
    let live = broadcast::Sender::new(1);
    let address = listen("127.0.0.1:0".parse().unwrap(), mpsc::channel().0, live).unwrap();
    let answer = read_state(address);
    assert!(answer.starts_with("HTTP/1.1 503"), "{answer}");
}
