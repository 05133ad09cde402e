//! Names of functions and exceptions, as in the standard (Modbus Application Protocol V1.1b3, 6 and 7).

/// Returns the name of a function. Bit 7, which marks an exception, is ignored.
#[must_use]
pub const fn function(code: u8) -> Option<&'static str> {
    Some(match code & 0x7F {
        0x01 => "read coils",
        0x02 => "read discrete inputs",
        0x03 => "read holding registers",
        0x04 => "read input registers",
        0x05 => "write single coil",
        0x06 => "write single register",
        0x07 => "read exception status",
        0x08 => "diagnostics",
        0x0B => "get comm event counter",
        0x0C => "get comm event log",
        0x0F => "write multiple coils",
        0x10 => "write multiple registers",
        0x11 => "report server id",
        0x14 => "read file record",
        0x15 => "write file record",
        0x16 => "mask write register",
        0x17 => "read/write multiple registers",
        0x18 => "read FIFO queue",
        0x2B => "encapsulated interface",
        _ => return None,
    })
}

/// Returns the name of an exception, if the standard defines it. 07 is only in the older reference guide (PI-MBUS-300).
#[must_use]
pub const fn exception(code: u8) -> Option<&'static str> {
    Some(match code {
        0x01 => "illegal function",
        0x02 => "illegal data address",
        0x03 => "illegal data value",
        0x04 => "server device failure",
        0x05 => "acknowledge",
        0x06 => "server device busy",
        0x07 => "negative acknowledge",
        0x08 => "memory parity error",
        0x0A => "gateway path unavailable",
        0x0B => "gateway target device failed to respond",
        _ => return None,
    })
}
