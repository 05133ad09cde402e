//! Tests of the polling task.

use std::sync::Arc;
use std::time::Duration;

use register_map::Module;
use register_map::board::MODIO_02;
use tokio::io::AsyncReadExt;
use tokio::net::TcpListener;
use tokio::sync::mpsc::unbounded_channel;
use tokio::time::Instant;

use super::fixture::EVERY;
use super::messages::{Update, Write};
use super::poll::Poller;
use crate::bus::adu::Framing;
use crate::bus::{Endpoint, Place};
use crate::device::Device;
use crate::names::book;

/// Orders a write that was requested this long ago from a unit that does not answer. Returns the failure and the
/// bytes that the unit received.
fn order(age: Duration) -> (String, Vec<u8>) {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let place = Place::Tcp(listener.local_addr().unwrap().to_string());
        let endpoint = Endpoint {
            timeout: Duration::from_millis(20),
            retries: 0,
            ..Endpoint::new(place, Framing::Rtu)
        };
        let device = Device::open(endpoint, None).await.unwrap();
        let (mut stream, _) = listener.accept().await.unwrap();
        let (updates, mut news) = unbounded_channel();
        let (orders, writes) = unbounded_channel();
        let output = book(&MODIO_02, Module::Do4, (0, 0)).find("p5.1").unwrap();
        let write = Write {
            item: output,
            words: vec![1],
            ordered: Instant::now().checked_sub(age).unwrap(),
        };
        orders.send(write).unwrap();
        let observers = Box::new(|| -> crate::bus::Observer { Box::new(|_| {}) });
        let wants_edges = Arc::default();
        let poller = Poller::new(device, EVERY, observers, updates, writes, wants_edges);
        let task = tokio::spawn(poller.run());
        let failure = loop {
            if let Some(Update::Wrote(_, result)) = news.recv().await {
                break result.unwrap_err().to_string();
            }
        };
        drop(orders);
        task.await.unwrap();
        let mut received = Vec::new();
        stream.read_to_end(&mut received).await.unwrap();
        (failure, received)
    })
}

#[test]
fn order_that_is_too_old_is_not_sent() {
    let (failure, received) = order(Duration::from_secs(3));
    assert!(failure.contains("busy for too long"), "{failure}");
    assert!(received.is_empty());
}

#[test]
fn order_for_a_unit_that_is_not_known_is_not_sent() {
    let (failure, received) = order(Duration::ZERO);
    assert!(failure.contains("does not answer"), "{failure}");
    assert!(received.is_empty());
}
