//! A request on the line, until its reply was received or the time for it is over.

use modbus_line::adu::{ASCII_MOST, Framing, RTU_MOST};
use sim::Time;
use sim::line::{Direction, Frame, Line, Settings, frame_silence};

use super::mbap::Request;
use crate::app::Origin;
use crate::app::scene::Scene;

/// Time after the request within which a unit must begin its reply.
const BEGINS: Time = Time::from_ms(200);

/// Pause after a broadcast, in which every unit carries out the request (V1.02, 2.4.1: 100 to 200 ms).
const TURNAROUND: Time = Time::from_ms(100);

/// The outcome of a request.
#[derive(Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The reply may still be received.
    Waiting,
    /// The PDU of the reply.
    Reply(Vec<u8>),
    /// No reply was received in time.
    Silence,
    /// The request was a broadcast, and the pause after it is over.
    Sent,
}

/// A request that is on the line, or has been sent and waits for its reply.
pub struct Exchange {
    framing: Framing,
    unit: u8,
    function: u8,
    /// Number of the last frame before the request.
    after: u64,
    /// End of the request.
    end: Time,
    /// Virtual time at which the gateway stops waiting.
    until: Time,
}

impl Exchange {
    /// Sends a request: now, or directly after the bytes that other masters are still sending.
    pub fn begin(scene: &mut Scene, framing: Framing, request: &Request) -> Self {
        let after = scene.bus.line().frames().next_back();
        let after = after.map_or(0, |frame| frame.number);
        let bytes = framing.frame(0, request.unit, &request.pdu);
        let end = scene.put(bytes, Origin::Gateway);
        let wait = match request.unit {
            0 => TURNAROUND,
            _ => patience(framing, scene.bus.line().settings()),
        };
        Self {
            framing,
            unit: request.unit,
            function: request.pdu[0],
            after,
            end,
            until: end + wait,
        }
    }

    /// Returns the outcome of the request up to now.
    pub fn outcome(&self, line: &Line) -> Outcome {
        let over = line.now() >= self.until;
        let reply = match self.unit {
            0 => None,
            _ => line
                .frames_since(self.after)
                .find_map(|frame| self.reply(frame)),
        };
        match (reply, over) {
            (Some(pdu), _) => Outcome::Reply(pdu),
            (None, false) => Outcome::Waiting,
            (None, true) if self.unit == 0 => Outcome::Sent,
            (None, true) => Outcome::Silence,
        }
    }

    /// Returns the PDU of this frame if the frame is the reply.
    fn reply(&self, frame: &Frame) -> Option<Vec<u8>> {
        let good = frame.direction == Direction::Response && !frame.damaged;
        if !good || frame.start < self.end {
            return None;
        }
        let (unit, pdu) = self.framing.open(&frame.bytes)?;
        (unit == self.unit && pdu[0] & 0x7F == self.function & 0x7F).then_some(pdu)
    }
}

/// Returns the time after a request within which its reply must have been received. It consists of the time until the
/// reply begins, the longest frame, and the silence that ends a frame.
pub fn patience(framing: Framing, settings: Settings) -> Time {
    let longest = match framing {
        Framing::Ascii => ASCII_MOST,
        Framing::Rtu | Framing::Mbap => RTU_MOST,
    };
    BEGINS + settings.characters(longest as u64) + frame_silence(settings) + settings.characters(1)
}

#[cfg(test)]
mod tests {
    use sim::line::Format;

    use super::*;

    #[test]
    fn only_an_intact_frame_of_the_unit_after_the_request_is_the_reply() {
        let end = Time::from_ms(10);
        let exchange = Exchange {
            framing: Framing::Rtu,
            unit: 7,
            function: 3,
            after: 0,
            end,
            until: Time::from_secs(1),
        };
        let pdu = vec![3, 2, 0, 5];
        let good = Frame {
            number: 2,
            direction: Direction::Response,
            start: end + Time::from_ms(4),
            end: end + Time::from_ms(12),
            bytes: Framing::Rtu.frame(0, 7, &pdu),
            crc_ok: true,
            damaged: false,
            longest_gap: Time::ZERO,
            gap: None,
            turnaround: None,
            request: None,
        };
        assert_eq!(exchange.reply(&good), Some(pdu.clone()));
        let with = |change: &dyn Fn(&mut Frame)| {
            let mut frame = good.clone();
            change(&mut frame);
            exchange.reply(&frame)
        };
        let refusal = |frame: &mut Frame| frame.bytes = Framing::Rtu.frame(0, 7, &[0x83, 2]);
        assert_eq!(with(&refusal), Some(vec![0x83, 2]));
        assert_eq!(with(&|frame| frame.bytes[4] ^= 1), None, "wrong CRC");
        assert_eq!(with(&|frame| frame.damaged = true), None);
        assert_eq!(with(&|frame| frame.direction = Direction::Request), None);
        assert_eq!(with(&|frame| frame.start = Time::from_ms(9)), None);
        for (unit, function) in [(8, 3), (7, 4)] {
            let frame = Framing::Rtu.frame(0, unit, &[function, 2, 0, 5]);
            assert_eq!(with(&|other| other.bytes.clone_from(&frame)), None);
        }
        let ascii = Framing::Ascii.frame(0, 7, &pdu);
        assert_eq!(with(&|other| other.bytes.clone_from(&ascii)), None);
    }

    #[test]
    fn patience_depends_on_rate_and_framing() {
        let at = |baud, format| Settings { baud, format };
        let ms = |framing, settings| patience(framing, settings).as_ms();
        // 256 + 3.5 + 1 characters of 11 bits.
        assert_eq!(ms(Framing::Rtu, at(9600, Format::N2)), 498);
        assert_eq!(ms(Framing::Rtu, at(1200, Format::N2)), 2587);
        // 1.75 ms instead of 3.5 characters.
        assert_eq!(ms(Framing::Rtu, at(921_600, Format::N2)), 204);
        // 513 + 3.5 + 1 characters of 10 bits.
        assert_eq!(ms(Framing::Ascii, at(9600, Format::SevenE1)), 739);
    }
}
