//! The four tables of a device.

/// A table of the Modbus data model (V1.1b3 4.3). Each table has addresses from 0 to 0xFFFF. The device decides
/// whether two tables contain the same points (V1.1b3 4.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Table {
    /// Bits to read and write: functions 01, 05 and 0F.
    Coils,
    /// Bits to read: function 02.
    DiscreteInputs,
    /// Words to read and write: functions 03, 06, 10, 16 and 17.
    HoldingRegisters,
    /// Words to read: function 04.
    InputRegisters,
}
