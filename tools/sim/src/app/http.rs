//! The HTTP server: takes requests off the network, hands them to the board's thread, sends the replies.

use std::io::{Cursor, Read};
use std::net::{SocketAddr, TcpListener};
use std::sync::mpsc::{self, Sender};
use std::thread;

use tiny_http::{Header, Response, Server};

use super::{Event, api};

/// Longest body taken, in bytes; the longest that means something has under a hundred.
const LONGEST_BODY: u64 = 64 * 1024;

/// What of a body that is too long is still read, in bytes, for a client that sends it all before it listens.
const MOST_TO_DROP: usize = 64 * 1024 * 1024;

/// Serves at `address` from now on, and tells where: with port 0 the system chooses one.
///
/// # Errors
///
/// When nothing can listen there, in one line.
pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<SocketAddr, String> {
    let cannot = |error: &dyn std::fmt::Display| {
        format!("cannot serve HTTP at {address}: {error} (choose another with --http ADDR)")
    };
    let listener = TcpListener::bind(address).map_err(|error| cannot(&error))?;
    let address = listener.local_addr().map_err(|error| cannot(&error))?;
    let server = Server::from_listener(listener, None).map_err(|error| cannot(&error))?;
    thread::spawn(move || {
        for request in server.incoming_requests() {
            let events = events.clone();
            // Each in a thread of its own: one that dawdles with its body holds up no other.
            thread::spawn(move || serve(request, &events));
        }
    });
    Ok(address)
}

fn serve(mut request: tiny_http::Request, events: &Sender<Event>) {
    if request.body_length() > Some(MOST_TO_DROP) {
        return refuse(request);
    }
    let mut body = Vec::new();
    let read = request
        .as_reader()
        .take(LONGEST_BODY + 1)
        .read_to_end(&mut body);
    let reply = match read {
        Err(_) => api::Reply::error(400, "the body was cut short"),
        Ok(length) if length as u64 > LONGEST_BODY => too_long(),
        Ok(_) => {
            let request = api::Request {
                method: request.method().to_string(),
                target: request.url().to_owned(),
                body,
            };
            ask(request, events)
        }
    };
    // A client that did not wait for its answer wants none.
    let _ = request.respond(response(&reply));
}

/// Refuses a body by the length that its head tells. `tiny_http` makes room for all that was not read when
/// it drops a request, and none that long is to be had: so this one is never dropped, and its connection
/// stays open for as long as its client likes.
fn refuse(request: tiny_http::Request) {
    std::mem::forget(request.upgrade("none", response(&too_long())));
}

fn too_long() -> api::Reply {
    api::Reply::error(413, "the body is longer than 64 KiB")
}

fn response(reply: &api::Reply) -> Response<Cursor<Vec<u8>>> {
    let json = Header::from_bytes("Content-Type", "application/json").into_iter();
    let mut response = Response::from_string(reply.body.to_string()).with_status_code(reply.status);
    json.for_each(|header| response.add_header(header));
    response
}

fn ask(request: api::Request, events: &Sender<Event>) -> api::Reply {
    let (reply, answer) = mpsc::channel();
    let asked = events.send(Event::Request(request, reply));
    asked
        .ok()
        .and_then(|()| answer.recv().ok())
        .unwrap_or_else(|| api::Reply::error(503, "the simulator is ending"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::io::Write;
    use std::net::TcpStream;

    /// A server whose board answers with what it was asked.
    fn server() -> SocketAddr {
        let (events, queue) = mpsc::channel();
        thread::spawn(move || {
            while let Ok(Event::Request(request, reply)) = queue.recv() {
                let body = String::from_utf8_lossy(&request.body).into_owned();
                let body = json!([request.method, request.target, body]);
                let _ = reply.send(api::Reply { status: 200, body });
            }
        });
        listen("127.0.0.1:0".parse().unwrap(), events).unwrap()
    }

    fn ask(address: SocketAddr, request: &[u8]) -> String {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(request).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn a_request_comes_through_whole_and_its_reply_goes_back() {
        let request = b"POST /api/dip?x HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\
                        Content-Length: 11\r\n\r\n{\"value\":7}";
        let answer = ask(server(), request);
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        assert!(
            answer.contains("Content-Type: application/json"),
            "{answer}"
        );
        let expected = json!(["POST", "/api/dip?x", "{\"value\":7}"]).to_string();
        assert!(answer.ends_with(&expected), "{answer}");
    }

    #[test]
    fn a_body_without_end_is_refused() {
        let address = server();
        let head = |length: u64| {
            format!("POST / HTTP/1.1\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n")
        };
        for length in [LONGEST_BODY + 1, 4_000_000] {
            let mut request = head(length).into_bytes();
            request.resize(request.len() + length as usize, b' ');
            assert!(ask(address, &request).starts_with("HTTP/1.1 413"));
        }
        // There is no memory for this one, whoever asks for it.
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(head(99_999_999_999).as_bytes()).unwrap();
        let mut answer = [0; 12];
        stream.read_exact(&mut answer).unwrap();
        assert_eq!(&answer, b"HTTP/1.1 413");
        let chunks = b"POST / HTTP/1.1\r\nConnection: close\r\nTransfer-Encoding: chunked\r\n\r\n\
                       20000\r\n";
        let mut request = chunks.to_vec();
        request.resize(request.len() + 0x20000, b' ');
        request.extend(b"\r\n0\r\n\r\n");
        assert!(ask(address, &request).starts_with("HTTP/1.1 413"));
    }

    #[test]
    fn a_client_that_dawdles_holds_up_no_other() {
        let address = server();
        let mut slow = TcpStream::connect(address).unwrap();
        slow.write_all(b"POST / HTTP/1.1\r\nContent-Length: 100\r\n\r\n{")
            .unwrap();
        let answer = ask(
            address,
            b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n",
        );
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    }

    #[test]
    fn an_ending_simulator_says_so() {
        let address = listen("127.0.0.1:0".parse().unwrap(), mpsc::channel().0).unwrap();
        let answer = ask(
            address,
            b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n",
        );
        assert!(answer.starts_with("HTTP/1.1 503"), "{answer}");
    }

    #[test]
    fn a_port_in_use_is_told() {
        let taken = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap();
        let text = listen(address, mpsc::channel().0).unwrap_err();
        assert!(text.contains("in use") && text.contains("--http"), "{text}");
    }
}
