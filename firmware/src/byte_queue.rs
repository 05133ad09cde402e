//! A queue of bytes between an interrupt and a task. docs/decisions.md says why it is not `heapless::spsc::Queue`.

use core::sync::atomic::{AtomicU8, Ordering};

/// Bytes that a queue holds: more than a UART at 9600 bit/s receives in the 40 ms for which a page of flash is erased.
pub const CAPACITY: u8 = 64;

/// A queue between one context that pushes and one context that pops. The queue is meant to be a `static`. With several
/// contexts that push, or several that pop, bytes can be lost.
#[derive(Debug)]
pub struct ByteQueue {
    bytes: [AtomicU8; CAPACITY as usize],
    /// Number of bytes that were ever pushed and popped, modulo 256. The place of a byte is its number modulo
    /// [`CAPACITY`].
    pushed: AtomicU8,
    popped: AtomicU8,
}

const _: () = assert!(
    256 % CAPACITY as usize == 0,
    "the places must not jump when the number wraps"
);

impl ByteQueue {
    /// Returns an empty queue.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bytes: [const { AtomicU8::new(0) }; CAPACITY as usize],
            pushed: AtomicU8::new(0),
            popped: AtomicU8::new(0),
        }
    }

    /// Appends a byte. Returns false when the queue is full.
    #[inline(always)]
    pub fn push(&self, byte: u8) -> bool {
        let number = self.pushed.load(Ordering::Relaxed);
        if number.wrapping_sub(self.popped.load(Ordering::Acquire)) >= CAPACITY {
            return false;
        }
        if let Some(place) = self.place(number) {
            place.store(byte, Ordering::Relaxed);
        }
        self.pushed.store(number.wrapping_add(1), Ordering::Release);
        true
    }

    /// Takes the oldest byte.
    #[inline(always)]
    pub fn pop(&self) -> Option<u8> {
        let number = self.popped.load(Ordering::Relaxed);
        if number == self.pushed.load(Ordering::Acquire) {
            return None;
        }
        let byte = self.place(number)?.load(Ordering::Relaxed);
        self.popped.store(number.wrapping_add(1), Ordering::Release);
        Some(byte)
    }

    /// Returns whether there is no byte.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.popped.load(Ordering::Relaxed) == self.pushed.load(Ordering::Acquire)
    }

    /// Returns the place of the byte with this number, which always exists.
    #[inline(always)]
    fn place(&self, number: u8) -> Option<&AtomicU8> {
        self.bytes.get(usize::from(number % CAPACITY))
    }
}

impl Default for ByteQueue {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::thread;

    use super::*;

    #[test]
    fn bytes_are_popped_in_the_order_in_which_they_were_pushed() {
        let queue = ByteQueue::new();
        assert!(queue.is_empty() && queue.pop().is_none());
        for round in 0..10_u8 {
            let bytes = || (0..CAPACITY - 1).map(|n| n.wrapping_mul(round));
            assert!(bytes().all(|byte| queue.push(byte)));
            assert!(!queue.is_empty());
            assert!(bytes().all(|byte| queue.pop() == Some(byte)));
            assert!(queue.is_empty());
        }
    }

    #[test]
    fn full_queue_refuses_a_byte_and_keeps_the_others() {
        let queue = ByteQueue::new();
        assert!((0..CAPACITY).all(|byte| queue.push(byte)));
        assert!(!queue.push(99));
        assert_eq!(queue.pop(), Some(0));
        assert!(queue.push(99) && !queue.push(98));
        assert!((1..CAPACITY).all(|byte| queue.pop() == Some(byte)));
        assert_eq!((queue.pop(), queue.pop()), (Some(99), None));
    }

    #[test]
    fn bytes_pushed_by_another_thread_arrive_complete_and_in_order() {
        static QUEUE: ByteQueue = ByteQueue::new();
        let pusher = thread::spawn(|| {
            for n in 0..100_000_u32 {
                while !QUEUE.push(n as u8) {
                    thread::yield_now();
                }
            }
        });
        for n in 0..100_000_u32 {
            let byte = loop {
                match QUEUE.pop() {
                    Some(byte) => break byte,
                    None => thread::yield_now(),
                }
            };
            assert_eq!(byte, n as u8);
        }
        pusher.join().unwrap();
        assert!(QUEUE.is_empty());
    }
}
