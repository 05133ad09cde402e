//! The origin of a request, which decides what the request may change.

/// A line of the unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum LineName {
    /// The RS-485 line.
    #[default]
    Rs485,
    /// The second line: a radio or an RS-232 socket.
    Second,
}

/// The origin of a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// The line over which the request arrived.
    pub line: LineName,
    /// The request is for all units.
    pub broadcast: bool,
    /// The request has named this unit by its serial number, with function 70.
    pub by_serial: bool,
}
