//! A gateway with Modbus TCP on one side and RTU frames over TCP on the other.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

use modioctl::bus::adu::Framing;

/// A gateway, which serves one request after another.
#[derive(Clone)]
pub struct Gateway {
    /// Time that the gateway waits for a unit before it answers with exception 0B.
    pub wait: Duration,
    /// The gateway counts its answers instead of returning the transaction ids of the requests.
    pub own_ids: bool,
    /// The gateway answers as unit 255 for every unit.
    pub unit_255: bool,
    /// The gateway passes functions 01 to 07, 0F and 10 only, and answers the others with exception 01.
    pub only_standard: bool,
    /// Exception with which the gateway answers every second request.
    pub busy: Option<u8>,
}

impl Default for Gateway {
    fn default() -> Self {
        Self {
            wait: Duration::from_millis(400),
            own_ids: false,
            unit_255: false,
            only_standard: false,
            busy: None,
        }
    }
}

impl Gateway {
    /// A usual gateway that waits this time for a unit.
    pub fn waiting(wait: Duration) -> Self {
        Self {
            wait,
            ..Self::default()
        }
    }

    /// Starts the gateway to the line at `line` and returns the gateway's address.
    pub fn before(self, line: SocketAddr) -> SocketAddr {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        std::thread::spawn(move || {
            for master in listener.incoming().flatten() {
                master.set_nodelay(true).unwrap();
                let line = TcpStream::connect(line).unwrap();
                line.set_nodelay(true).unwrap();
                // Ends when the master closes the connection.
                let _ = self.serve(master, line);
            }
        });
        address
    }

    fn serve(&self, mut master: TcpStream, mut line: TcpStream) -> std::io::Result<()> {
        let mut header = [0; 6];
        for n in 0.. {
            master.read_exact(&mut header)?;
            let mut body = vec![0; u16::from_be_bytes([header[4], header[5]]).into()];
            master.read_exact(&mut body)?;
            let (unit, pdu) = body.split_first().unwrap();
            let exception = |code| vec![pdu[0] | 0x80, code];
            let answer = match self.busy {
                Some(code) if n % 2 == 0 => exception(code),
                _ if self.only_standard && !matches!(pdu[0], 1..=7 | 0x0F | 0x10) => exception(1),
                _ => {
                    line.write_all(&Framing::Rtu.frame(0, *unit, pdu))?;
                    let answer = self.answer(&mut line)?;
                    // 0B: the unit does not answer.
                    answer.unwrap_or_else(|| exception(0x0B))
                }
            };
            let transaction = match self.own_ids {
                true => 0x8000 + n,
                false => u16::from_be_bytes([header[0], header[1]]),
            };
            let unit = if self.unit_255 { 255 } else { *unit };
            master.write_all(&Framing::Mbap.frame(transaction, unit, &answer))?;
            // Silence between frames on the line.
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(())
    }

    fn answer(&self, line: &mut TcpStream) -> std::io::Result<Option<Vec<u8>>> {
        line.set_read_timeout(Some(self.wait))?;
        let mut got = Vec::new();
        let mut chunk = [0; 256];
        loop {
            match line.read(&mut chunk) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(count) => got.extend(&chunk[..count]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(None),
                Err(error) => return Err(error),
            }
            if let Some((_, pdu)) = Framing::Rtu.open(&got) {
                return Ok(Some(pdu));
            }
        }
    }
}
