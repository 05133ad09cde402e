//! A Modbus TCP gateway to the line: `--modbus-tcp`.
//!
//! ```text
//! client --- thread --- requests --+
//! client --- thread --- requests --+-- in turn, one at a time --- the line
//! client --- thread --- requests --+
//! ```
//!
//! The gateway is one more master on the line. It sends the request of one client, waits for the reply of the addressed
//! unit, and passes the reply on. A frame with a wrong check, a damaged frame and a frame of another unit are no reply.
//! Like a gateway on a real line, it does not wait for a free line: the frames of two masters at the same time collide.

mod ask;
mod client;
mod exchange;
mod mbap;
mod mode;

use std::collections::VecDeque;
use std::net::SocketAddr;
use std::sync::mpsc::{Sender, TryRecvError};

use modbus_line::adu::Framing;

pub use self::ask::ask;
use self::client::{Client, Responses};
use self::exchange::{Exchange, Outcome};
use self::mbap::Request;
use self::mode::Mode;
use super::Event;
use super::scene::Scene;

/// Exception 0A: nothing can be sent on the line now, or not to this unit.
const NO_PATH: u8 = 0x0A;
/// Exception 0B: no unit has answered.
const NO_ANSWER: u8 = 0x0B;

/// Most requests that are answered in one call, so that requests that need no line cannot keep the boards' thread busy.
const AT_ONCE: usize = 64;

/// Messages from the clients' threads to the boards' thread.
pub enum Message {
    /// A client has connected.
    Joined(Client),
    /// A client has sent a request, or has disconnected.
    Ready,
}

/// The part of the gateway that runs on the boards' thread.
pub struct Gateway {
    address: SocketAddr,
    /// The clients; the first one has the next turn.
    clients: VecDeque<Client>,
    under_way: Option<(Exchange, Request, Responses)>,
    mode: Mode,
}

impl Gateway {
    /// Starts to listen at `address`.
    ///
    /// # Errors
    ///
    /// In one line, why the simulator cannot listen there.
    pub fn listen(address: SocketAddr, events: Sender<Event>) -> Result<Self, String> {
        Ok(Self {
            address: client::listen(address, events)?,
            clients: VecDeque::new(),
            under_way: None,
            mode: Mode::default(),
        })
    }

    /// Returns the address of the gateway: with port 0 the system has chosen the port.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Accepts a message from a client. The next [`update`](Self::update) acts on it.
    pub fn take(&mut self, message: Message) {
        match message {
            Message::Joined(client) => self.clients.push_back(client),
            Message::Ready => {}
        }
    }

    /// Passes on a reply that was received, and sends the next request. `halted` says that a debugger has halted the
    /// core: no time passes on the line then, so nothing can be sent.
    pub fn update(&mut self, scene: &mut Scene, halted: bool) {
        self.mode.update(scene.bus.board(0));
        for _ in 0..AT_ONCE {
            if let Some((exchange, request, responses)) = self.under_way.take() {
                match exchange.outcome(scene.bus.line()) {
                    Outcome::Waiting => {
                        self.under_way = Some((exchange, request, responses));
                        return;
                    }
                    Outcome::Reply(pdu) => respond(&responses, &request, &pdu),
                    Outcome::Silence => refuse(&responses, &request, NO_ANSWER),
                    Outcome::Sent => {}
                }
            }
            let Some((request, responses)) = self.next() else {
                return;
            };
            // No unit can have these addresses (V1.02, 2.2).
            if halted || (248..=254).contains(&request.unit) {
                refuse(&responses, &request, NO_PATH);
            } else {
                let framing = self.mode.framing(scene.bus.line().settings());
                let exchange = Exchange::begin(scene, framing, &request);
                self.under_way = Some((exchange, request, responses));
            }
        }
    }

    /// Returns the next request of the next client that has one. Removes clients that have disconnected.
    fn next(&mut self) -> Option<(Request, Responses)> {
        for _ in 0..self.clients.len() {
            let client = self.clients.pop_front()?;
            match client.next() {
                Ok(request) => {
                    let responses = client.responses.clone();
                    self.clients.push_back(client);
                    return Some((request, responses));
                }
                Err(TryRecvError::Empty) => self.clients.push_back(client),
                Err(TryRecvError::Disconnected) => {}
            }
        }
        None
    }
}

fn respond(responses: &Responses, request: &Request, pdu: &[u8]) {
    responses.send(Framing::Mbap.frame(request.transaction, request.unit, pdu));
}

/// Answers with an exception. A broadcast never has a response, so it is dropped.
fn refuse(responses: &Responses, request: &Request, exception: u8) {
    if request.unit != 0 {
        respond(responses, request, &[request.pdu[0] | 0x80, exception]);
    }
}
