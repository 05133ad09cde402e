//! The part of an HTTP client that the simulator's interface needs.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;

use serde_json::Value;

/// Sends a request to the simulator at HOST:PORT: a POST with a body, a GET without one. Returns the reply's body.
pub fn request(address: &str, path: &str, body: Option<&Value>) -> Value {
    let method = if body.is_some() { "POST" } else { "GET" };
    let body = body.map(Value::to_string).unwrap_or_default();
    let mut socket = TcpStream::connect(address).expect("the simulator listens");
    write!(
        socket,
        "{method} {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    )
    .expect("the simulator reads");
    let mut reply = String::new();
    socket
        .read_to_string(&mut reply)
        .expect("the simulator answers");
    let (_, body) = reply.split_once("\r\n\r\n").expect("a head and a body");
    serde_json::from_str(body).expect("the body is JSON")
}
