//! Requests that are repeated until a unit answers, and whose answer cannot be that to another request.

use std::io;
use std::time::Duration;

use tokio::time::{Instant, sleep};

use super::adu::Framing;
use super::answer::{Lost, MOST, PROBE, differs, is_busy};
use super::master::Master;

/// Pause before a read is repeated because the unit or a gateway is busy.
const BUSY: Duration = Duration::from_millis(200);

/// Number of times that a read is repeated because the unit or a gateway is busy. It does not depend on `--retries`: that
/// is for lost requests.
const BUSY_TIMES: u8 = 2;

/// Number of time-outs for which a unit without function 08 must be silent. Its answer may take almost two.
const QUIET: u32 = 2;

impl Master {
    /// Sends a request to a unit. Repeats it without an answer of the unit as often as the endpoint says, and a read also
    /// when the unit is busy. Returns the PDU of the response, which may be an exception. The error is that of the last
    /// attempt, unless an earlier one was garbled.
    pub async fn ask(&mut self, unit: u8, pdu: &[u8]) -> Result<Vec<u8>, Lost> {
        if self.echo.is_none() && !differs(pdu) {
            self.look_for_echo(unit).await?;
        }
        let mut was_silent = false;
        if self.endpoint().framing != Framing::Mbap && self.late.can_be_confused(unit, pdu) {
            was_silent = self.wait_for_order(unit, pdu).await?;
        }
        let result = self.repeat(unit, pdu).await;
        if was_silent && result.is_ok() {
            self.late.has_no_08(unit);
        }
        result
    }

    async fn repeat(&mut self, unit: u8, pdu: &[u8]) -> Result<Vec<u8>, Lost> {
        let mut busy = 0;
        let mut lost = 0;
        let mut result = Err(Lost::Silent);
        loop {
            let next = self.ask_once(unit, pdu).await;
            match &next {
                Ok(answer) if is_busy(pdu, answer) && busy < BUSY_TIMES => {
                    busy += 1;
                    sleep(BUSY).await;
                    continue;
                }
                Ok(_) | Err(Lost::Broken(_)) => return next,
                Err(Lost::Silent | Lost::Absent(_)) if is_garbled(&result) => {}
                Err(_) => result = next,
            }
            if lost == self.endpoint().retries {
                return result;
            }
            lost += 1;
        }
    }

    /// Finds out whether the adapter returns what it sends. Without that a response that equals its request proves
    /// nothing. Silence leaves it open, and the request is sent nevertheless: a unit in listen-only mode obeys without
    /// an answer.
    async fn look_for_echo(&mut self, unit: u8) -> Result<(), Lost> {
        let mut result = Ok(());
        for _ in 0..=self.endpoint().retries {
            match self.ask_once(unit, &PROBE).await {
                Err(Lost::Broken(error)) => return Err(Lost::Broken(error)),
                Err(Lost::Silent) => {}
                Err(garbled) if self.echo.is_none() => result = Err(garbled),
                _ => return Ok(()),
            }
        }
        result
    }

    /// Waits until no late answer of the unit can be mistaken for the answer to this request: until the unit has answered
    /// 08/00 with a new word, and therefore all requests before it, or until it has been silent. Returns whether the unit
    /// was silent to 08/00, which may be because it does not have it.
    async fn wait_for_order(&mut self, unit: u8, pdu: &[u8]) -> Result<bool, Lost> {
        let has_08 = self.late.has_08(unit);
        if has_08 == Some(false) {
            self.wait_for_late(QUIET).await.map_err(Lost::Broken)?;
            self.late.forget(unit);
            return Ok(false);
        }
        let before = self.late.answered();
        if self.echo.is_none() {
            self.look_for_echo(unit).await?;
        }
        // A response to 08/00 could not be distinguished from an echo. But then the unit has just been silent.
        let times = match self.echo {
            None => 0,
            Some(_) => 1 + self.endpoint().retries,
        };
        for n in 1..=times {
            let [high, low] = self.transaction.to_be_bytes();
            match self.ask_once(unit, &[8, 0, 0, high, low]).await {
                Ok(_) | Err(Lost::Absent(_)) => {
                    self.late.passed(unit);
                    return Ok(false);
                }
                Err(Lost::Silent) => {}
                Err(lost @ Lost::Broken(_)) => return Err(lost),
                Err(lost) if n == times => return Err(lost),
                Err(_) => {}
            }
        }
        if has_08.is_none() && self.late.answered() == before {
            // Nothing was received for at least one time-out.
            self.late.forget(unit);
            return Ok(true);
        }
        match self.late.can_be_confused(unit, pdu) {
            true => Err(Lost::Silent),
            false => Ok(false),
        }
    }

    /// Waits for the answers that are late, until nothing was received for this number of time-outs.
    pub(super) async fn wait_for_late(&mut self, times: u32) -> io::Result<()> {
        let mut got = Vec::new();
        let wait = |master: &Self| Instant::now() + times * master.patience();
        let mut until = wait(self);
        while self.late.is_expected()
            && got.len() < MOST
            && self.read_until(until, &mut got).await? > 0
        {
            if self.take_late(&mut got, None) {
                until = wait(self);
            }
        }
        Ok(())
    }
}

const fn is_garbled(result: &Result<Vec<u8>, Lost>) -> bool {
    matches!(result, Err(Lost::Garbled(_)))
}
