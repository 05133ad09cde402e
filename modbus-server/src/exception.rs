//! Exception codes.

/// Why a request is refused (V1.1b3 section 7). The reply carries the function code with bit 7 set
/// and this code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exception {
    /// 01: the function code is not one this server knows.
    IllegalFunction = 1,
    /// 02: an address of the request does not exist, or cannot be written.
    IllegalDataAddress = 2,
    /// 03: quantity, byte count, length or value is not allowed.
    IllegalDataValue = 3,
    /// 04: the device failed while it tried to do it.
    ServerDeviceFailure = 4,
    /// 05: accepted, and it will take long.
    Acknowledge = 5,
    /// 06: busy, or the object is locked at the moment; the client may repeat the request later.
    ServerDeviceBusy = 6,
    /// 07: it cannot be done. In V1.02 appendix A (counted as NAK), no longer in V1.1b3.
    NegativeAcknowledge = 7,
}

impl Exception {
    /// The code as it goes over the line.
    #[inline]
    pub const fn code(self) -> u8 {
        self as u8
    }
}
