//! A line with several units over TCP: every unit receives the requests, and the master every reply.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;

/// Joins these lines to one and returns its address. Calls `touch` with all bytes on the way, in both directions.
pub fn of(lines: &[SocketAddr], touch: impl FnMut(&mut [u8]) + Send + 'static) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let lines = lines.to_vec();
    thread::spawn(move || {
        let touch = Arc::new(Mutex::new(touch));
        for master in listener.incoming().flatten() {
            master.set_nodelay(true).unwrap();
            let mut units = Vec::new();
            for line in &lines {
                let unit = TcpStream::connect(line).unwrap();
                unit.set_nodelay(true).unwrap();
                units.push(unit.try_clone().unwrap());
                let (master, touch) = (master.try_clone().unwrap(), Arc::clone(&touch));
                thread::spawn(move || forward(unit, vec![master], &touch));
            }
            let ends: Vec<_> = units.iter().map(|unit| unit.try_clone().unwrap()).collect();
            forward(master, units, &touch);
            for unit in ends {
                let _ = unit.shutdown(std::net::Shutdown::Both);
            }
        }
    });
    address
}

fn forward(mut from: TcpStream, mut to: Vec<TcpStream>, touch: &Mutex<impl FnMut(&mut [u8])>) {
    let mut bytes = [0; 512];
    while let Ok(count @ 1..) = from.read(&mut bytes) {
        touch.lock().unwrap()(&mut bytes[..count]);
        for to in &mut to {
            let _ = to.write_all(&bytes[..count]);
        }
    }
}

/// Inverts one bit in `per_error`, the same bits in every run.
pub fn noise(per_error: u64) -> impl FnMut(&mut [u8]) {
    let mut random = fastrand::Rng::with_seed(1);
    move |bytes| {
        for byte in bytes {
            for bit in 0..8 {
                if random.u64(0..per_error) == 0 {
                    *byte ^= 1 << bit;
                }
            }
        }
    }
}
