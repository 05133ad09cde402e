//! Where the I/O points of each port stand: `(port - 1) * 4 + (channel - 1)`, for bits and words alike.

/// Channels of one port.
pub const CHANNELS: u16 = 4;

/// Ports the address space has room for.
pub const PORTS: u16 = 8;

/// The only port of the modio-02 board that has a slot.
pub const SLOT_PORT: u16 = 5;

/// The first address of a port's points, for ports 1 to 8.
///
/// # Panics
///
/// At compile time where it is used in a constant, for a port outside 1 to 8.
#[must_use]
pub const fn first(port: u16) -> u16 {
    assert!(port >= 1 && port <= PORTS);
    (port - 1) * CHANNELS
}

/// The first point of the slot: 0x0010.
pub const SLOT_FIRST: u16 = first(SLOT_PORT);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_follow_one_another_and_the_slot_is_where_the_manual_has_it() {
        assert_eq!((first(1), first(8)), (0x0000, 0x001C));
        assert_eq!(SLOT_FIRST, 0x0010);
    }
}
