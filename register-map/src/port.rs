//! Addresses of the I/O points of each port: `(port - 1) * 4 + (channel - 1)`, for bits and words.

/// Number of channels of a port.
pub const CHANNELS: u16 = 4;

/// Number of ports in the address space.
pub const PORTS: u16 = 8;

/// Returns the first address of a port's points, for ports 1 to 8.
///
/// # Panics
///
/// For a port outside 1 to 8; at compile time when it is used in a constant.
#[must_use]
pub const fn first(port: u16) -> u16 {
    assert!(port >= 1 && port <= PORTS);
    of_port(port)
}

/// Like [`first`], for a port that is known to be 1 to 8, without the check: the firmware must not contain panics.
#[inline]
#[must_use]
pub const fn of_port(port: u16) -> u16 {
    port.wrapping_sub(1).wrapping_mul(CHANNELS)
}

/// Number of points of all ports.
pub const COUNT: u16 = PORTS * CHANNELS;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_consecutive_from_address_0() {
        assert_eq!((first(1), first(5), first(8)), (0x0000, 0x0010, 0x001C));
    }
}
