//! A gateway with Modbus TCP on one side and RTU frames over TCP on the other.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

use modioctl::bus::adu::Framing;

/// Time that the gateway waits for a unit.
const WAIT: Duration = Duration::from_millis(400);

/// Starts a gateway to the line at `line` and returns the gateway's address.
pub fn before(line: SocketAddr) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for master in listener.incoming().flatten() {
            let line = TcpStream::connect(line).unwrap();
            line.set_read_timeout(Some(WAIT)).unwrap();
            line.set_nodelay(true).unwrap();
            // Ends when the master closes the connection.
            let _ = serve(master, line);
        }
    });
    address
}

fn serve(mut master: TcpStream, mut line: TcpStream) -> std::io::Result<()> {
    let mut header = [0; 6];
    loop {
        master.read_exact(&mut header)?;
        let mut body = vec![0; u16::from_be_bytes([header[4], header[5]]).into()];
        master.read_exact(&mut body)?;
        let transaction = u16::from_be_bytes([header[0], header[1]]);
        let (unit, pdu) = body.split_first().unwrap();
        line.write_all(&Framing::Rtu.frame(0, *unit, pdu))?;
        let answer = answer(&mut line)?;
        // 0B: the unit does not answer.
        let answer = answer.unwrap_or_else(|| vec![pdu[0] | 0x80, 0x0B]);
        master.write_all(&Framing::Mbap.frame(transaction, *unit, &answer))?;
        // Silence between frames on the line.
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn answer(line: &mut TcpStream) -> std::io::Result<Option<Vec<u8>>> {
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
