//! Registers as a master reads and writes them.

use crate::bench::Bench;

impl Bench {
    /// Registers by function 03, or the exception.
    pub fn registers(&mut self, address: u16, count: u16) -> Result<Vec<u16>, u8> {
        let [[a, b], [c, d]] = [address, count].map(u16::to_be_bytes);
        let reply = self.ask(1, &[3, a, b, c, d]).expect("an answer");
        if reply[0] & 0x80 != 0 {
            return Err(reply[1]);
        }
        assert_eq!(usize::from(reply[1]), usize::from(count) * 2);
        let words = reply[2..].chunks(2);
        Ok(words.map(|w| u16::from_be_bytes([w[0], w[1]])).collect())
    }

    /// One register by function 03, which must exist.
    pub fn register(&mut self, address: u16) -> u16 {
        self.registers(address, 1).expect("the register exists")[0]
    }

    /// Writes registers by function 10, or the exception.
    pub fn write(&mut self, address: u16, values: &[u16]) -> Result<(), u8> {
        let [[a, b], [c, d]] = [address, values.len() as u16].map(u16::to_be_bytes);
        let mut pdu = vec![16, a, b, c, d, values.len() as u8 * 2];
        pdu.extend(values.iter().flat_map(|value| value.to_be_bytes()));
        let reply = self.ask(1, &pdu).expect("an answer");
        if reply[0] & 0x80 != 0 {
            return Err(reply[1]);
        }
        assert_eq!(reply, pdu[..5]);
        Ok(())
    }

    /// Opens the configuration's lock.
    pub fn unlock(&mut self) {
        self.write(0x0100, &[0x5A17]).expect("KEY opens the lock");
    }

    /// Saves the configuration and waits for it.
    pub fn save(&mut self) {
        self.write(0x0108, &[1]).expect("COMMAND takes a save");
        self.board.run_for(sim::Time::from_ms(100));
        assert_eq!(self.register(0x020A) & 8, 0, "it is saved");
    }

    /// Power off and on, and time to start.
    pub fn power_cycle(&mut self) {
        self.board.cycle();
        self.board.run_for(sim::Time::from_ms(300));
        self.board.line().take_received();
    }
}
