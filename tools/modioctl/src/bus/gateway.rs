//! Gateways from Modbus TCP to a serial line.

use std::io;
use std::time::Duration;

use super::Found;
use super::answer::{Lost, MOST, PROBE, is_busy};
use super::master::Master;

/// Number of time-outs for which late answers are waited for at the end of a sweep.
const BACKLOG: u32 = 3;

/// Largest number of addresses without a unit that are asked again. Each can cost the gateway some seconds.
const FEW: usize = 32;

/// Returns a time-out in seconds for a gateway that took this time for an answer.
pub fn sufficient(time: Duration) -> u64 {
    (time + Duration::from_millis(200)).as_secs() + 1
}

impl Master {
    /// Asks these addresses over Modbus TCP. A unit is what answers function 03, which every gateway passes. When the
    /// gateway answers later than the time-out, its answers are waited for, and the addresses concerned are asked again.
    /// A few others are asked again, too: after a bit error the gateway reports a unit as absent. Calls `asked` with each
    /// address before its first request.
    pub async fn sweep_gateway(
        &mut self,
        units: &[u8],
        found: &mut Found,
        mut asked: impl FnMut(u8),
    ) -> io::Result<()> {
        let mut silent = Vec::new();
        let mut absent = Vec::new();
        for unit in units {
            asked(*unit);
            match self.ask_once(*unit, &PROBE).await {
                Ok(answer) if is_busy(&PROBE, &answer) => {
                    found.busy.insert(*unit);
                }
                Err(Lost::Silent) => silent.push(*unit),
                Err(Lost::Absent(_)) => absent.push(*unit),
                answer => found.answered_gateway(*unit, answer)?,
            }
            if found.never_silent {
                return Ok(());
            }
        }
        self.wait_for_late(BACKLOG).await?;
        let mut again: Vec<_> = found.busy.iter().copied().collect();
        let are_few = silent.len() + absent.len() <= FEW;
        if are_few || self.lateness() > Duration::ZERO {
            again.extend(silent);
        }
        if are_few {
            again.extend(absent);
        }
        let usual = self.be_patient(self.endpoint().timeout, 0);
        for unit in again {
            match self.ask(unit, &PROBE).await {
                Ok(answer) if is_busy(&PROBE, &answer) => {
                    found.busy.insert(unit);
                }
                answer => found.answered_gateway(unit, answer)?,
            }
        }
        self.be_patient(usual.0, usual.1);
        Ok(())
    }
}

impl Found {
    /// Takes the answer of a gateway for this address.
    fn answered_gateway(&mut self, unit: u8, answer: Result<Vec<u8>, Lost>) -> io::Result<()> {
        match answer {
            Ok(_) => {
                self.busy.remove(&unit);
                self.units.insert(unit);
            }
            Err(Lost::Garbled(bytes)) if bytes.len() >= MOST => self.never_silent = true,
            Err(Lost::Garbled(_)) => {
                self.garbled.insert(unit);
            }
            Err(Lost::Silent | Lost::Absent(_)) => {}
            Err(Lost::Broken(error)) => return Err(error),
        }
        Ok(())
    }
}
