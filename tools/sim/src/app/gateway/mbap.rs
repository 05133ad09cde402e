//! Requests on a Modbus TCP connection (Modbus Messaging on TCP/IP V1.0b, 3.1.3).

use std::io::{self, Read};

use modbus_line::adu::MBAP;

/// Largest length in a header: the unit identifier and the longest PDU, in bytes.
const MOST: usize = 254;

/// A request as it was received.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Transaction identifier: the client chooses it, and the response repeats it.
    pub transaction: u16,
    /// The unit identifier: the address of the unit on the line.
    pub unit: u8,
    /// Function code and data.
    pub pdu: Vec<u8>,
}

/// Reads the next request. Returns `None` when the client has closed the connection.
///
/// # Errors
///
/// The connection is lost, or the header is not that of a Modbus request. In both cases the connection is of no further
/// use, because the start of the next request is unknown.
pub fn read(stream: &mut impl Read) -> io::Result<Option<Request>> {
    let mut header = [0; MBAP];
    if stream.read(&mut header[..1])? == 0 {
        return Ok(None);
    }
    stream.read_exact(&mut header[1..])?;
    let word = |at: usize| u16::from_be_bytes([header[at], header[at + 1]]);
    let length = usize::from(word(4));
    if word(2) != 0 || !(2..=MOST).contains(&length) {
        return Err(io::Error::other(
            "the header is not that of a Modbus request",
        ));
    }
    let mut pdu = vec![0; length - 1];
    stream.read_exact(&mut pdu)?;
    Ok(Some(Request {
        transaction: word(0),
        unit: header[6],
        pdu,
    }))
}

#[cfg(test)]
mod tests {
    use modbus_line::adu::Framing;

    use super::*;

    #[test]
    fn requests_are_read_one_after_another() {
        let longest = [&[0x10][..], &[7; 252]].concat();
        let frames = [
            Framing::Mbap.frame(0x1234, 17, &[7]),
            Framing::Mbap.frame(2, 255, &longest),
        ];
        let bytes = frames.concat();
        let mut stream = &bytes[..];
        let first = read(&mut stream).unwrap().unwrap();
        assert_eq!(
            (first.transaction, first.unit, first.pdu),
            (0x1234, 17, vec![7])
        );
        let second = read(&mut stream).unwrap().unwrap();
        assert_eq!((second.unit, second.pdu), (255, longest));
        assert_eq!(read(&mut stream).unwrap(), None);
    }

    #[test]
    fn wrong_header_or_cut_request_is_an_error() {
        let good = Framing::Mbap.frame(1, 1, &[3, 0, 0, 0, 1]);
        let with = |at: usize, value: u8| {
            let mut frame = good.clone();
            frame[at] = value;
            frame.resize(400, 0);
            frame
        };
        // Two wrong protocols, and lengths of 0, 1, 255 and more than 256.
        for bytes in [
            with(3, 1),
            with(2, 1),
            with(5, 0),
            with(5, 1),
            with(5, 255),
            with(4, 1),
        ] {
            assert!(read(&mut &bytes[..]).is_err(), "{:02X?}", &bytes[..8]);
        }
        for length in 1..good.len() {
            assert!(read(&mut &good[..length]).is_err(), "{length} bytes");
        }
    }
}
