//! Codes of the messages.

/// Sub-functions.
pub mod sub {
    /// Starts a scan.
    pub const START_SCAN: u8 = 0x01;
    /// Continues a scan.
    pub const CONTINUE_SCAN: u8 = 0x02;
    /// A unit that was not found before.
    pub const FOUND: u8 = 0x03;
    /// All units are found.
    pub const NONE_LEFT: u8 = 0x04;
    /// A request to a serial number.
    pub const REQUEST: u8 = 0x08;
    /// The reply to a request to a serial number.
    pub const REPLY: u8 = 0x09;
    /// Fetches events.
    pub const FETCH: u8 = 0x10;
    /// A unit has events.
    pub const EVENTS: u8 = 0x11;
    /// No unit has events.
    pub const NO_EVENTS: u8 = 0x12;
    /// Switches the events of points on and off, and the reply to that.
    pub const SETTINGS: u8 = 0x18;
}

/// Types of events.
pub mod kind {
    /// A coil has changed.
    pub const COIL: u8 = 1;
    /// A discrete input has changed.
    pub const DISCRETE_INPUT: u8 = 2;
    /// A holding register has changed.
    pub const HOLDING_REGISTER: u8 = 3;
    /// An input register has changed.
    pub const INPUT_REGISTER: u8 = 4;
    /// The unit itself: id 0, it has started. Other ids are the maker's own.
    pub const UNIT: u8 = 0x0F;
    /// Of a modio, id 0: edges were lost.
    pub const LOST: u8 = 0x80;
}
