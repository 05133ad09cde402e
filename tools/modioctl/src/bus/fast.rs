//! Requests of Fast Modbus, function 70.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::time::Duration;

use modbus_line::fast::{ADDRESS, Heard, Reply, Request, Scan};
use modbus_line::port::is_pseudo_terminal;
use tokio::time::Instant;

use super::adu::Framing;
use super::answer::{Lost, MOST};
use super::endpoint::{Endpoint, Place};
use super::master::Master;
use crate::failure::Failure;

/// Longest time for which an adapter holds bytes back.
const ADAPTER: Duration = Duration::from_millis(60);
/// The same for a gateway, and for a program at the other end of a pseudo-terminal.
const GATEWAY: Duration = Duration::from_millis(300);

/// Returns how long the reply of a unit may be late, unless the user gives a time-out.
fn lateness(endpoint: &Endpoint) -> Duration {
    match &endpoint.place {
        _ if endpoint.timeout_given => endpoint.timeout,
        Place::Serial(path) if !is_pseudo_terminal(Path::new(path)) => ADAPTER,
        _ => GATEWAY,
    }
}

/// Fails on a line without function 70: it is for RTU, and its arbitration does not fit into Modbus TCP.
pub fn check_line(endpoint: &Endpoint) -> Result<(), Failure> {
    match endpoint.framing {
        Framing::Rtu => Ok(()),
        _ => Err(Failure::usage(
            "Fast Modbus (function 70) is only for RTU: use --port without --mode ascii, or --tcp with a gateway that passes bytes on as they are",
        )),
    }
}

impl Master {
    /// Sends a request to all units once. Returns the reply when its last byte is received.
    pub async fn ask_fast(&mut self, request: &Request) -> Result<Reply, Lost> {
        let pdu = request.pdu();
        let sent = async {
            self.settle().await?;
            self.put(ADDRESS, &pdu).await
        };
        let own = sent.await.map_err(Lost::Broken)?;
        let (to_first, to_end) = request.longest_wait(self.endpoint().line());
        let late = self.free()
            + match request {
                Request::BySerial { .. } => self.endpoint().timeout,
                _ => lateness(self.endpoint()),
            };
        let mut until = late + to_first;
        let mut returned = false;
        let mut got = Vec::new();
        while got.len() < MOST {
            if self
                .read_until(until, &mut got)
                .await
                .map_err(Lost::Broken)?
                == 0
            {
                break;
            }
            returned = returned || self.drop_echo(&own, &mut got);
            if let Some((reply, range)) = request.find(&got) {
                self.received(got.get(range).unwrap_or_default());
                return Ok(reply);
            }
            if !got.is_empty() {
                // A busy computer delivers a reply in pieces with a pause between them.
                let end = late + to_end;
                until = end.max(Instant::now() + ADAPTER);
                until = until.min(end + self.endpoint().timeout);
            }
        }
        if got.is_empty() {
            return Err(Lost::Silent);
        }
        self.received(&got);
        Err(Lost::Garbled(got))
    }

    /// Sends a request to the unit with this serial number, and repeats it as often as the endpoint says. Returns the PDU of
    /// the reply, which may be an exception.
    pub async fn ask_serial(&mut self, serial: u32, pdu: &[u8]) -> Result<Vec<u8>, Lost> {
        let request = Request::BySerial {
            serial,
            pdu: pdu.to_vec(),
        };
        let mut lost = Lost::Silent;
        for _ in 0..=self.endpoint().retries {
            match self.ask_fast(&request).await {
                Ok(Reply::Pdu(pdu)) => return Ok(pdu),
                Ok(_) | Err(Lost::Silent | Lost::Absent(_)) => {}
                Err(Lost::Garbled(bytes)) => lost = Lost::Garbled(bytes),
                Err(broken) => return Err(broken),
            }
        }
        Err(lost)
    }

    /// Sends the next request of a scan.
    pub async fn scan_step(&mut self, scan: &mut Scan, request: &Request) -> io::Result<()> {
        scan.hear(match self.ask_fast(request).await {
            Ok(reply) => Heard::Reply(reply),
            Err(Lost::Silent | Lost::Absent(_)) => Heard::Nothing,
            Err(Lost::Garbled(_)) => Heard::Damaged,
            Err(Lost::Broken(error)) => return Err(error),
        });
        Ok(())
    }
}

/// Returns the unit addresses that several of these units have.
pub fn shared(units: &BTreeMap<u32, u8>) -> Vec<u8> {
    let mut all: Vec<_> = units.values().copied().collect();
    all.sort_unstable();
    let twice = all.windows(2).filter(|two| two[0] == two[1]);
    let mut twice: Vec<_> = twice.map(|two| two[0]).collect();
    twice.dedup();
    twice
}
