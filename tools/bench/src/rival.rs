//! The cost of a request on a minimal server with another crate: from the complete frame in memory to the complete
//! response in memory. The CRCs are checked and computed, and nothing is sent.

use register_map::codes::Mode;
use sim::memory::RAM_BASE;
use sim::{Board, Config, Image, Time};

use crate::framing::{adu, is_adu};

/// Layout of the rivals' mailbox, see their `lib.rs`: lengths, then request and response.
const RESPONSE_LEN: u32 = 4;
const REQUEST: u32 = 8;
const RESPONSE: u32 = REQUEST + 256;

/// Time limit for a rival.
const LONGEST: Time = Time::from_ms(100);

/// A rival's program on the virtual board.
pub struct Rival {
    board: Board,
    mailbox: u32,
    begin: u32,
    end: u32,
}

impl Rival {
    /// Starts the program.
    ///
    /// # Errors
    ///
    /// When the image does not fit the board or is not that of a rival.
    pub fn new(image: &Image) -> Result<Self, String> {
        let symbol = |name: &str| {
            let address = image.symbol(name);
            address.ok_or_else(|| format!("the rival has no symbol {name}"))
        };
        let (mailbox, begin, end) = (
            symbol("MAILBOX")?,
            // Bit 0 is the Thumb bit.
            symbol("bench_begin")? & !1,
            symbol("bench_end")? & !1,
        );
        let mut board = Board::new(image, Config::default()).map_err(|error| error.to_string())?;
        board.run_for(Time::from_ms(10));
        Ok(Self {
            board,
            mailbox,
            begin,
            end,
        })
    }

    /// Returns the instructions for a request. Returns `None` when the response is not a valid frame, or is an
    /// exception although the request is valid.
    ///
    /// # Errors
    ///
    /// When the program hangs.
    pub fn measure(&mut self, pdu: &[u8]) -> Result<Option<u32>, String> {
        let request = adu(Mode::Rtu, pdu);
        let too_long = |_| "a request longer than the mailbox".to_owned();
        let write = |board: &mut Board, address, bytes: &[u8]| {
            board.write_memory(address, bytes).map_err(too_long)
        };
        write(&mut self.board, self.mailbox + REQUEST, &request)?;
        let len = u32::try_from(request.len()).expect("an ADU has 256 bytes");
        write(&mut self.board, self.mailbox, &len.to_le_bytes())?;

        let limit = self.board.now() + LONGEST;
        if !self.board.run_until_pc(self.begin, limit) {
            return Err("the rival hangs".to_owned());
        }
        let begun = self.board.instructions();
        if !self.board.run_until_pc(self.end, limit) {
            // The program has most likely panicked.
            return Ok(None);
        }
        let taken = self.board.instructions() - begun;
        self.board.run_for(Time::from_us(100));

        let word = self.board.word(self.mailbox + RESPONSE_LEN).unwrap_or(0);
        let start = (self.mailbox + RESPONSE - RAM_BASE) as usize;
        let response = self.board.ram().get(start..start + word as usize);
        let good = response
            .is_some_and(|response| is_adu(Mode::Rtu, response) && answers(&response[1..], pdu));
        Ok(good.then(|| u32::try_from(taken).unwrap_or(u32::MAX)))
    }
}

/// Returns whether a response, followed by its CRC, has the form of an answer to a valid request of 01 to 06, 0F or
/// 10.
fn answers(response: &[u8], request: &[u8]) -> bool {
    let data = match request {
        [1 | 2, .., high, low] => usize::from(u16::from_be_bytes([*high, *low])).div_ceil(8),
        [3 | 4, .., high, low] => usize::from(u16::from_be_bytes([*high, *low])) * 2,
        [5 | 6 | 0x0F | 0x10, ..] => return response.len() == 7 && response[..5] == request[..5],
        _ => return false,
    };
    response.len() == 2 + data + 2 && response[0] == request[0] && usize::from(response[1]) == data
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_matching_response_is_an_answer() {
        let check = [0, 0];
        let ok = |response: &[u8], request: &[u8]| answers(&[response, &check].concat(), request);
        assert!(ok(&[3, 2, 0, 7], &[3, 0, 0, 0, 1]));
        assert!(!ok(&[3, 4, 0, 7], &[3, 0, 0, 0, 1]), "a wrong byte count");
        assert!(!ok(&[0x83, 2], &[3, 0, 0, 0, 1]), "an exception");
        assert!(ok(&[1, 1, 5], &[1, 0, 0, 0, 4]));
        assert!(ok(&[5, 0, 0, 0xFF, 0], &[5, 0, 0, 0xFF, 0]));
        assert!(!ok(&[5, 0, 0], &[5, 0, 0, 0xFF, 0]), "no echo");
        assert!(ok(&[0x10, 0, 0, 0, 1], &[0x10, 0, 0, 0, 1, 2, 0, 9]));
    }
}
