//! Function codes.

/// The functions this server has (V1.1b3 section 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Function {
    /// 01 (6.1)
    ReadCoils = 0x01,
    /// 02 (6.2)
    ReadDiscreteInputs = 0x02,
    /// 03 (6.3)
    ReadHoldingRegisters = 0x03,
    /// 04 (6.4)
    ReadInputRegisters = 0x04,
    /// 05 (6.5)
    WriteSingleCoil = 0x05,
    /// 06 (6.6)
    WriteSingleRegister = 0x06,
    /// 0F (6.11)
    WriteMultipleCoils = 0x0F,
    /// 10 (6.12)
    WriteMultipleRegisters = 0x10,
}

impl Function {
    /// Bit 7 of the function code of a reply says that it is an exception.
    pub const EXCEPTION: u8 = 0x80;

    /// The function with this code, if the server has it.
    #[inline]
    pub const fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            0x01 => Self::ReadCoils,
            0x02 => Self::ReadDiscreteInputs,
            0x03 => Self::ReadHoldingRegisters,
            0x04 => Self::ReadInputRegisters,
            0x05 => Self::WriteSingleCoil,
            0x06 => Self::WriteSingleRegister,
            0x0F => Self::WriteMultipleCoils,
            0x10 => Self::WriteMultipleRegisters,
            _ => return None,
        })
    }

    /// The code as it goes over the line.
    pub const fn code(self) -> u8 {
        self as u8
    }
}
