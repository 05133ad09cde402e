//! The DAC of the analog outputs: a Microchip MCP4728 with four channels of 12 bits and an EEPROM, on I2C at 0x60 (data
//! sheet DS22187E).
//!
//! Its LDAC pin is connected to ground, so every input register is copied to its output immediately, whatever the UDAC
//! bit is (table 4-5). Commands that need edges at LDAC (those for the address bits) are not acknowledged after their
//! first byte (5.6.8). While the EEPROM is being written, the input registers can still be written, but another EEPROM
//! write is ignored.

#[cfg(test)]
mod tests;

use f103::time::Time;

/// Default address on the bus, 7 bits. The chip can be ordered with this and the seven following addresses.
pub const ADDRESS: u8 = 0x60;

/// Duration of an EEPROM write: typically 25 ms, at most 50 ms (section 1.0).
pub const EEPROM_WRITE: Time = Time::from_ms(25);

/// Input register of a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Setting {
    /// Output code, 0 to 4095.
    pub code: u16,
    /// Whether the reference is the internal one of 2.048 V instead of VDD.
    pub internal_reference: bool,
    /// Power-down bits: 0 = normal; 1, 2, 3 = off with 1, 100 or 500 kOhm to ground.
    pub power_down: u8,
    /// Whether the gain is 2, with the internal reference.
    pub double_gain: bool,
}

impl Setting {
    /// Returns the setting in the two bytes of the write commands: VREF PD1 PD0 Gx D11-D8, D7-D0.
    const fn from_bytes(high: u8, low: u8) -> Self {
        Self {
            code: (high as u16 & 0x0F) << 8 | low as u16,
            internal_reference: high & 0x80 != 0,
            power_down: high >> 5 & 3,
            double_gain: high & 0x10 != 0,
        }
    }

    /// Returns the setting as two bytes of the read command, in the same form.
    const fn to_bytes(self) -> [u8; 2] {
        let high = (self.internal_reference as u8) << 7
            | self.power_down << 5
            | (self.double_gain as u8) << 4
            | (self.code >> 8) as u8;
        [high, self.code as u8]
    }
}

/// Meaning of the next byte of a write transfer (5.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Expect {
    /// The first byte after the address.
    Command,
    /// The command byte of a general call.
    GeneralCall,
    /// Fast write: the high byte of this channel.
    FastHigh(usize),
    /// Fast write: the low byte of this channel, after this high byte.
    FastLow(usize, u8),
    /// Multi-write: the command byte of the next channel.
    MultiCommand,
    /// The high byte of this channel.
    High(Write, usize),
    /// The low byte of this channel, after this high byte.
    Low(Write, usize, u8),
    /// The second byte of the power-down command.
    PowerDown,
    /// No byte is expected: further bytes are not acknowledged.
    Nothing,
}

/// The three commands that write a whole [`Setting`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Write {
    Multi,
    Sequential,
    Single,
}

/// An MCP4728.
#[derive(Clone, Debug)]
pub struct Mcp4728 {
    address: u8,
    registers: [Setting; 4],
    eeprom: [Setting; 4],
    /// End of the EEPROM write.
    busy_until: Time,
    /// Channels whose registers are copied to the EEPROM at the end of this transfer.
    to_store: [bool; 4],
    expect: Expect,
    /// Number of the next byte to read, 0 to 23.
    cursor: usize,
}

impl Default for Mcp4728 {
    fn default() -> Self {
        Self::new([Setting::default(); 4])
    }
}

impl Mcp4728 {
    /// Returns a chip with these settings in its EEPROM, directly after power-on.
    #[must_use]
    pub const fn new(eeprom: [Setting; 4]) -> Self {
        Self {
            address: ADDRESS,
            registers: eeprom,
            eeprom,
            busy_until: Time::ZERO,
            to_store: [false; 4],
            expect: Expect::Nothing,
            cursor: 0,
        }
    }

    /// Returns the same chip at `address`, 0x60 to 0x67.
    #[must_use]
    pub const fn at(self, address: u8) -> Self {
        Self { address, ..self }
    }

    /// Returns the four input registers. The outputs follow them.
    #[must_use]
    pub const fn registers(&self) -> [Setting; 4] {
        self.registers
    }

    /// Returns the four settings in the EEPROM.
    #[must_use]
    pub const fn eeprom(&self) -> [Setting; 4] {
        self.eeprom
    }

    /// Returns the code of an output (`channel` 0 to 3): 0 while the channel is powered down.
    #[must_use]
    pub const fn output(&self, channel: usize) -> u16 {
        let setting = self.registers[channel];
        if setting.power_down == 0 {
            setting.code
        } else {
            0
        }
    }

    /// Loads the registers from the EEPROM, as after power-on or a general call reset.
    pub const fn power_on(&mut self) {
        self.registers = self.eeprom;
        self.expect = Expect::Nothing;
        self.to_store = [false; 4];
    }

    /// Handles the address byte after a start condition. Returns whether it is acknowledged: the chip's own address and
    /// the general call are.
    pub fn address(&mut self, byte: u8, now: Time) -> bool {
        self.store(now);
        self.cursor = 0;
        self.expect = match byte {
            0 => Expect::GeneralCall,
            _ if byte >> 1 == self.address && byte & 1 == 0 => Expect::Command,
            _ => Expect::Nothing,
        };
        byte == 0 || byte >> 1 == self.address
    }

    /// Handles a data byte from the master. Returns whether it is acknowledged.
    pub fn write(&mut self, byte: u8, now: Time) -> bool {
        self.expect = match self.expect {
            Expect::Nothing => return false,
            Expect::Command => self.command(byte),
            Expect::GeneralCall => self.general_call(byte, now),
            Expect::FastHigh(channel) => Expect::FastLow(channel, byte),
            Expect::FastLow(channel, high) => self.fast(channel, high, byte),
            Expect::MultiCommand => Expect::High(Write::Multi, channel_of(byte)),
            Expect::High(write, channel) => Expect::Low(write, channel, byte),
            Expect::Low(write, channel, high) => self.whole(write, channel, high, byte),
            Expect::PowerDown => {
                self.registers[2].power_down = byte >> 6 & 3;
                self.registers[3].power_down = byte >> 4 & 3;
                Expect::Nothing
            }
        };
        true
    }

    /// Returns the next of the 24 bytes of the read command (figure 5-15): for each channel three bytes of its register
    /// and three of its EEPROM. After the last byte, the first one follows again.
    pub fn read(&mut self, now: Time) -> u8 {
        let at = self.cursor;
        self.cursor = (at + 1) % 24;
        let channel = at / 6;
        let setting = if at % 6 < 3 {
            self.registers[channel]
        } else {
            self.eeprom[channel]
        };
        let ready = u8::from(now >= self.busy_until);
        match at % 3 {
            // From the highest bit: RDY/BSY, POR (power is on), DAC1, DAC0, 0, A2, A1, A0.
            0 => ready << 7 | 1 << 6 | (channel as u8) << 4 | self.address & 7,
            n => setting.to_bytes()[n - 1],
        }
    }

    /// Handles a stop condition, which ends the transfer.
    pub fn stop(&mut self, now: Time) {
        self.store(now);
        self.expect = Expect::Nothing;
    }

    /// Handles the first byte after the address (table 5-1).
    fn command(&mut self, byte: u8) -> Expect {
        match byte >> 5 {
            0b000 | 0b001 => Expect::FastLow(0, byte),
            0b010 => match byte >> 3 & 3 {
                0b00 => Expect::High(Write::Multi, channel_of(byte)),
                0b10 => Expect::High(Write::Sequential, channel_of(byte)),
                0b11 => Expect::High(Write::Single, channel_of(byte)),
                _ => Expect::Nothing,
            },
            0b100 => {
                for (n, setting) in self.registers.iter_mut().enumerate() {
                    setting.internal_reference = byte >> (3 - n) & 1 == 1;
                }
                Expect::Nothing
            }
            0b110 => {
                for (n, setting) in self.registers.iter_mut().enumerate() {
                    setting.double_gain = byte >> (3 - n) & 1 == 1;
                }
                Expect::Nothing
            }
            0b101 => {
                self.registers[0].power_down = byte >> 2 & 3;
                self.registers[1].power_down = byte & 3;
                Expect::PowerDown
            }
            _ => Expect::Nothing,
        }
    }

    /// Handles a general call (5.4).
    fn general_call(&mut self, byte: u8, _now: Time) -> Expect {
        match byte {
            0x06 => self.power_on(),
            0x09 => self.registers.iter_mut().for_each(|s| s.power_down = 0),
            // 0x08, software update, has no effect: the outputs already follow the registers.
            _ => {}
        }
        Expect::Nothing
    }

    /// Handles a complete pair of bytes of a fast write (5.6.1). It changes only code and power-down; the next pair is
    /// for the next channel.
    fn fast(&mut self, channel: usize, high: u8, low: u8) -> Expect {
        let setting = &mut self.registers[channel];
        setting.code = u16::from(high & 0x0F) << 8 | u16::from(low);
        setting.power_down = high >> 4 & 3;
        Expect::FastHigh((channel + 1) % 4)
    }

    /// Handles a complete pair of bytes of the other write commands (5.6.2 to 5.6.4).
    fn whole(&mut self, write: Write, channel: usize, high: u8, low: u8) -> Expect {
        self.registers[channel] = Setting::from_bytes(high, low);
        match write {
            Write::Multi => Expect::MultiCommand,
            Write::Sequential => {
                self.to_store[channel] = true;
                match channel {
                    3 => Expect::Nothing,
                    _ => Expect::High(write, channel + 1),
                }
            }
            Write::Single => {
                self.to_store[channel] = true;
                Expect::Nothing
            }
        }
    }

    /// Copies the registers of this transfer to the EEPROM, unless the EEPROM is still busy.
    fn store(&mut self, now: Time) {
        let wanted = std::mem::take(&mut self.to_store);
        if wanted == [false; 4] || now < self.busy_until {
            return;
        }
        for ((stored, setting), wanted) in self.eeprom.iter_mut().zip(self.registers).zip(wanted) {
            if wanted {
                *stored = setting;
            }
        }
        self.busy_until = now + EEPROM_WRITE;
    }
}

/// Returns the number of the channel in a command byte: bits DAC1 and DAC0.
const fn channel_of(command: u8) -> usize {
    (command >> 1 & 3) as usize
}
