//! Requests to all units, which have no answer.

use std::io;
use std::time::Duration;

use tokio::time::Instant;

use super::master::Master;

/// Address of a request to all units.
const ALL: u8 = 0;

/// Step of the timers: they end late by up to this time.
const STEP: Duration = Duration::from_millis(1);

/// Number of bytes that are noise, such as that of a driver which is switched on. The shortest answer has five.
const NOISE: usize = 4;

impl Master {
    /// Sends a request to all units once the line has been free for this pause, without the delay of a timer: a
    /// millisecond is a tenth of a block at 115200 bit/s.
    pub async fn broadcast(&mut self, pdu: &[u8], pause: Duration) -> io::Result<()> {
        let free = self.free() + pause;
        self.free_from(free - STEP);
        self.settle().await?;
        std::thread::sleep(free.saturating_duration_since(Instant::now()));
        self.put(ALL, pdu).await?;
        Ok(())
    }

    /// Sends a request to all units, and returns whether anything answers it within this time.
    pub async fn probe(&mut self, pdu: &[u8], time: Duration) -> io::Result<bool> {
        self.settle().await?;
        let frame = self.put(ALL, pdu).await?;
        let until = self.free() + time;
        let mut got = Vec::new();
        while got.len() < super::MOST && self.read_until(until, &mut got).await? > 0 {}
        self.drop_echo(&frame, &mut got);
        if got.len() > NOISE {
            self.received(&got);
        }
        Ok(got.len() > NOISE)
    }
}
