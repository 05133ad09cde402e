//! Bits and registers of unit 1 as a master reads and writes them.

use sim::Time;

use crate::rig::Rig;

impl Rig {
    /// Sends a PDU. Returns the bytes after the function code of the reply, or the exception code.
    pub fn request(&mut self, pdu: &[u8]) -> Result<Vec<u8>, u8> {
        // The first reply after a save may wait for an erase.
        let patience = self.patience;
        self.patience = patience.max(Time::from_ms(60));
        let reply = self.ask(1, pdu);
        self.patience = patience;
        match reply.as_deref() {
            Some(&[function, code]) if function == pdu[0] | 0x80 => Err(code),
            Some([function, rest @ ..]) if *function == pdu[0] => Ok(rest.to_vec()),
            _ => panic!("{pdu:02X?} was answered by {reply:02X?}"),
        }
    }

    fn read(&mut self, function: u8, address: u16, count: u16) -> Result<Vec<u8>, u8> {
        let [[a, b], [c, d]] = [address, count].map(u16::to_be_bytes);
        let data = self.request(&[function, a, b, c, d])?;
        assert_eq!(usize::from(data[0]), data.len() - 1, "the byte count");
        Ok(data[1..].to_vec())
    }

    /// Reads bits by function 01 or 02.
    pub fn bits(&mut self, function: u8, address: u16, count: u16) -> Result<Vec<bool>, u8> {
        let data = self.read(function, address, count)?;
        let bits = data
            .iter()
            .flat_map(|byte| (0..8).map(move |n| byte >> n & 1 != 0));
        let mut bits: Vec<bool> = bits.collect();
        assert_eq!(data.len(), usize::from(count).div_ceil(8));
        let padding = bits.split_off(count.into());
        assert!(
            !padding.contains(&true),
            "unused bits are zero: {data:02X?}"
        );
        Ok(bits)
    }

    /// Reads words by function 03 or 04.
    pub fn words(&mut self, function: u8, address: u16, count: u16) -> Result<Vec<u16>, u8> {
        let data = self.read(function, address, count)?;
        assert_eq!(data.len(), usize::from(count) * 2);
        let words = data.chunks(2);
        Ok(words.map(|w| u16::from_be_bytes([w[0], w[1]])).collect())
    }

    /// Reads registers by function 03. Returns the values or the exception code.
    pub fn registers(&mut self, address: u16, count: u16) -> Result<Vec<u16>, u8> {
        self.words(3, address, count)
    }

    /// Returns one register, which must exist, by function 03.
    pub fn register(&mut self, address: u16) -> u16 {
        self.registers(address, 1).expect("the register exists")[0]
    }

    /// Returns a value of two registers, high word first.
    pub fn long(&mut self, address: u16) -> u32 {
        let words = self.registers(address, 2).expect("the registers exist");
        u32::from(words[0]) << 16 | u32::from(words[1])
    }

    /// Writes by function 05 or 06, with the value exactly as in the frame.
    pub fn write_single(&mut self, function: u8, address: u16, value: u16) -> Result<(), u8> {
        let [[a, b], [c, d]] = [address, value].map(u16::to_be_bytes);
        let echo = self.request(&[function, a, b, c, d])?;
        assert_eq!(echo, [a, b, c, d]);
        Ok(())
    }

    /// Sets or clears one bit by function 05.
    pub fn write_bit(&mut self, address: u16, on: bool) -> Result<(), u8> {
        self.write_single(5, address, if on { 0xFF00 } else { 0 })
    }

    /// Writes bits by function 0F.
    pub fn write_bits(&mut self, address: u16, bits: &[bool]) -> Result<(), u8> {
        let mut bytes = vec![0; bits.len().div_ceil(8)];
        for (n, bit) in bits.iter().enumerate() {
            bytes[n / 8] |= u8::from(*bit) << (n % 8);
        }
        self.write_several(15, address, bits.len(), &bytes)
    }

    /// Writes registers by function 10. Returns the exception code if there is one.
    pub fn write(&mut self, address: u16, values: &[u16]) -> Result<(), u8> {
        let bytes: Vec<u8> = values
            .iter()
            .flat_map(|value| value.to_be_bytes())
            .collect();
        self.write_several(16, address, values.len(), &bytes)
    }

    fn write_several(
        &mut self,
        function: u8,
        address: u16,
        count: usize,
        bytes: &[u8],
    ) -> Result<(), u8> {
        let [[a, b], [c, d]] = [address, count as u16].map(u16::to_be_bytes);
        let pdu = [&[function, a, b, c, d, bytes.len() as u8], bytes].concat();
        let echo = self.request(&pdu)?;
        assert_eq!(echo, [a, b, c, d]);
        Ok(())
    }

    /// Returns whether a bit of the status register (0x020A) is set.
    pub fn status(&mut self, mask: u16) -> bool {
        self.register(0x020A) & mask != 0
    }

    /// Opens the configuration's lock.
    pub fn unlock(&mut self) {
        self.write(0x0100, &[0x5A17]).expect("KEY opens the lock");
    }

    /// Opens the lock and writes settings.
    pub fn configure(&mut self, address: u16, values: &[u16]) {
        self.unlock();
        self.write(address, values)
            .unwrap_or_else(|code| panic!("{address:#06x} <- {values:?}: exception {code}"));
    }

    /// Opens the lock and writes a value to COMMAND.
    pub fn command(&mut self, command: u16) {
        self.configure(0x0108, &[command]);
    }

    /// Saves the configuration and waits for it.
    pub fn save(&mut self) {
        self.write(0x0108, &[1]).expect("COMMAND accepts a save");
        self.board.run_for(sim::Time::from_ms(100));
        assert!(!self.status(8), "the configuration is saved");
    }

    /// Switches the power off and on after every twentieth save, which fills the budget of saves again. `n` counts
    /// the saves from 0.
    pub fn power_cycle_for_saves(&mut self, n: u16) {
        if n % 20 == 19 {
            self.power_cycle();
        }
    }

    /// Switches the power off and on, with time to start.
    pub fn power_cycle(&mut self) {
        self.board.cycle();
        self.started();
    }

    /// Requests a restart over the line, with time for it.
    pub fn restart(&mut self) {
        let before = self.board.resets();
        self.command(2);
        self.started();
        assert_eq!(self.board.resets(), before + 1, "one restart");
    }

    /// Waits for the start and discards the bytes on the line.
    pub fn started(&mut self) {
        self.board.run_for(sim::Time::from_ms(300));
        self.board.line().take_received();
    }
}
