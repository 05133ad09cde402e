//! A request served as a device serves it: the reply begins before anything is decided.

use modbus_server::line::{Next, Transmitter};
use modbus_server::{Adu, LineCounters, Server};

use crate::common::Points;

/// The reply to a request that may be for this unit, as it goes over the line; the buffer may then
/// hold another request.
///
/// # Panics
///
/// When what the server and the transmitter say about the reply is not what happens.
pub fn serve(
    server: &mut Server,
    points: &mut Points,
    line: &LineCounters,
    adu: &mut Adu,
) -> Option<Vec<u8>> {
    let answers = server.answers(adu);
    let mut transmitter = if answers {
        Transmitter::open(server.unit(), server.framing())
    } else {
        Transmitter::idle()
    };
    let mut reply = Vec::new();
    let rest = send(&mut transmitter, &mut reply);
    assert_eq!(rest, if answers { Next::Wait } else { Next::Done });
    assert_eq!(!reply.is_empty(), answers, "the unit address goes at once");

    let decision = server.decide(adu, points);
    assert_eq!(decision.reply.is_some(), answers);
    if let Some(head) = decision.reply {
        transmitter.head(head);
        send(&mut transmitter, &mut reply);
    }
    server.commit(&decision, line);
    server.carry_out(&decision, adu, points);
    let has_body = decision.reply.is_some_and(|head| head.has_body());
    assert_eq!(transmitter.body(adu).is_none(), has_body);
    assert_eq!(send(&mut transmitter, &mut reply), Next::Done);
    assert_eq!(transmitter.take_buffer().is_some(), has_body);
    answers.then_some(reply)
}

/// Sends what there is to send; then it waits, or is done.
fn send(transmitter: &mut Transmitter<'_>, reply: &mut Vec<u8>) -> Next {
    loop {
        match transmitter.next() {
            Next::Byte(byte) => reply.push(byte),
            rest => return rest,
        }
    }
}
