//! Function codes.

/// The functions of this server (V1.1b3 section 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
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
    /// 07 (6.7)
    ReadExceptionStatus = 0x07,
    /// 08 (6.8)
    Diagnostics = 0x08,
    /// 0B (6.9)
    GetCommEventCounter = 0x0B,
    /// 0C (6.10)
    GetCommEventLog = 0x0C,
    /// 0F (6.11)
    WriteMultipleCoils = 0x0F,
    /// 10 (6.12)
    WriteMultipleRegisters = 0x10,
    /// 11 (6.13)
    ReportServerId = 0x11,
    /// 14 (6.14)
    ReadFileRecord = 0x14,
    /// 15 (6.15)
    WriteFileRecord = 0x15,
    /// 16 (6.16)
    MaskWriteRegister = 0x16,
    /// 17 (6.17)
    ReadWriteMultipleRegisters = 0x17,
    /// 2B (6.19): only MEI type 0E, read device identification (6.21).
    EncapsulatedInterface = 0x2B,
}

impl Function {
    /// Bit 7 of a reply's function code, which marks an exception.
    pub const EXCEPTION: u8 = 0x80;

    /// Returns the function with this code, if the server supports it.
    #[inline]
    pub const fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            0x01 => Self::ReadCoils,
            0x02 => Self::ReadDiscreteInputs,
            0x03 => Self::ReadHoldingRegisters,
            0x04 => Self::ReadInputRegisters,
            0x05 => Self::WriteSingleCoil,
            0x06 => Self::WriteSingleRegister,
            0x07 => Self::ReadExceptionStatus,
            0x08 => Self::Diagnostics,
            0x0B => Self::GetCommEventCounter,
            0x0C => Self::GetCommEventLog,
            0x0F => Self::WriteMultipleCoils,
            0x10 => Self::WriteMultipleRegisters,
            0x11 => Self::ReportServerId,
            0x14 => Self::ReadFileRecord,
            0x15 => Self::WriteFileRecord,
            0x16 => Self::MaskWriteRegister,
            0x17 => Self::ReadWriteMultipleRegisters,
            0x2B => Self::EncapsulatedInterface,
            _ => return None,
        })
    }

    /// Returns the code as it is sent on the line.
    pub const fn code(self) -> u8 {
        self as u8
    }
}
