//! The bytes of the RS-232 socket. Only a board that is alone on its line has an endpoint for it.

use sim::Time;

use super::scene::Scene;

impl Scene {
    /// Sends bytes to the socket now, or directly after the bytes that are still being sent. Returns the end of the last
    /// byte.
    pub fn send_by_rs232(&mut self, bytes: &[u8]) -> Time {
        let now = self.now();
        let socket = self.first().rs232();
        socket.map_or(now, |socket| socket.send(now, bytes))
    }

    /// Returns the bytes that the board has sent at the socket since the last call.
    pub fn take_received_by_rs232(&mut self) -> Vec<u8> {
        let socket = self.first().rs232();
        let received = socket.map(|socket| socket.take_received());
        let received = received.unwrap_or_default();
        received.iter().map(|byte| byte.byte).collect()
    }
}
