//! The errors of boards.

/// Reason why a board refuses a call.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The part refuses it.
    #[error(transparent)]
    Part(#[from] f103::Error),
    /// The channel does not exist or is of another kind.
    #[error("the plugged module has no such input on this channel")]
    Channel,
    /// The board has no slot at this port.
    #[error("the board has no slot at port {0}")]
    Slot(u8),
    /// The board has no terminal with this name.
    #[error("the board has no terminal with this name")]
    Terminal,
    /// The terminal is of another kind, or an output.
    #[error("the terminal is of another kind")]
    TerminalKind,
    /// The board has no LoRa module.
    #[error("the board has no LoRa module")]
    NoRadio,
    /// A value is out of this range.
    #[error("out of range: {0}")]
    Range(&'static str),
}
