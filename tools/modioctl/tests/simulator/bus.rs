//! A line with several units over TCP: every unit receives the requests, and the master every reply. It can invert
//! bits.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;

/// Joins these lines to one and returns its address. One bit in `per_error` is inverted on the way, in both
/// directions; 0 means none.
pub fn of(lines: &[SocketAddr], per_error: u64) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let lines = lines.to_vec();
    thread::spawn(move || {
        let noise = Arc::new(Mutex::new(Noise::new(per_error)));
        for mut master in listener.incoming().flatten() {
            master.set_nodelay(true).unwrap();
            let mut units = Vec::new();
            for line in &lines {
                let unit = TcpStream::connect(line).unwrap();
                unit.set_nodelay(true).unwrap();
                units.push(unit.try_clone().unwrap());
                forward(unit, vec![master.try_clone().unwrap()], &noise);
            }
            let mut bytes = [0; 512];
            while let Ok(count @ 1..) = master.read(&mut bytes) {
                noise.lock().unwrap().disturb(&mut bytes[..count]);
                for unit in &mut units {
                    let _ = unit.write_all(&bytes[..count]);
                }
            }
            for unit in units {
                let _ = unit.shutdown(std::net::Shutdown::Both);
            }
        }
    });
    address
}

fn forward(mut from: TcpStream, mut to: Vec<TcpStream>, noise: &Arc<Mutex<Noise>>) {
    let noise = Arc::clone(noise);
    thread::spawn(move || {
        let mut bytes = [0; 512];
        while let Ok(count @ 1..) = from.read(&mut bytes) {
            noise.lock().unwrap().disturb(&mut bytes[..count]);
            for to in &mut to {
                let _ = to.write_all(&bytes[..count]);
            }
        }
    });
}

/// Inverts one bit in `per_error`, the same bits in every run.
struct Noise {
    per_error: u64,
    random: fastrand::Rng,
}

impl Noise {
    fn new(per_error: u64) -> Self {
        Self {
            per_error,
            random: fastrand::Rng::with_seed(1),
        }
    }

    fn disturb(&mut self, bytes: &mut [u8]) {
        if self.per_error == 0 {
            return;
        }
        for byte in bytes {
            for bit in 0..8 {
                if self.random.u64(0..self.per_error) == 0 {
                    *byte ^= 1 << bit;
                }
            }
        }
    }
}
