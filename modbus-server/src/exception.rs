//! Exception codes.

use core::error::Error;
use core::fmt;

/// Reason why a request is rejected (V1.1b3 section 7). The reply contains the function code with bit 7 set and
/// this code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[repr(u8)]
pub enum Exception {
    /// 01: the server does not support the function code.
    IllegalFunction = 1,
    /// 02: an address in the request does not exist or cannot be written.
    IllegalDataAddress = 2,
    /// 03: a quantity, byte count, length or value is not allowed.
    IllegalDataValue = 3,
    /// 04: the device failed while it executed the request.
    ServerDeviceFailure = 4,
    /// 05: the request was accepted and will take a long time.
    Acknowledge = 5,
    /// 06: the device is busy or the object is locked; the client may repeat the request later.
    ServerDeviceBusy = 6,
    /// 07: the request cannot be executed. In V1.02 appendix A (counted as NAK), but no longer in V1.1b3.
    NegativeAcknowledge = 7,
    /// 08: the memory behind a file record failed its consistency check.
    MemoryParityError = 8,
    /// 0A: a gateway could not allocate a path to the unit.
    GatewayPathUnavailable = 0x0A,
    /// 0B: the unit behind a gateway did not respond.
    GatewayTargetDeviceFailedToRespond = 0x0B,
}

impl Exception {
    /// Returns the code as it is sent on the line.
    #[inline]
    pub const fn code(self) -> u8 {
        self as u8
    }
}

impl fmt::Display for Exception {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::IllegalFunction => "illegal function",
            Self::IllegalDataAddress => "illegal data address",
            Self::IllegalDataValue => "illegal data value",
            Self::ServerDeviceFailure => "server device failure",
            Self::Acknowledge => "acknowledge",
            Self::ServerDeviceBusy => "server device busy",
            Self::NegativeAcknowledge => "negative acknowledge",
            Self::MemoryParityError => "memory parity error",
            Self::GatewayPathUnavailable => "gateway path unavailable",
            Self::GatewayTargetDeviceFailedToRespond => "gateway target device failed to respond",
        };
        write!(f, "exception {:02X}, {name}", self.code())
    }
}

impl Error for Exception {}

/// Returns the exception that is first in the order of checks: address 02, value 03, then state, 04 and above. That
/// is the order of the codes.
pub(crate) fn first_of(
    one: Result<(), Exception>,
    other: Result<(), Exception>,
) -> Result<(), Exception> {
    match (one, other) {
        (Err(one), Err(other)) if other.code() < one.code() => Err(other),
        (Ok(()), other) => other,
        (one, _) => one,
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::boxed::Box;
    use std::string::ToString;

    use super::*;

    #[test]
    fn an_exception_displays_its_code_and_name() {
        let error: Box<dyn Error> = Exception::GatewayPathUnavailable.into();
        assert_eq!(error.to_string(), "exception 0A, gateway path unavailable");
    }
}
