//! What requests order of the background.

/// A save and a restart may be ordered before the background takes either: neither replaces the other.
#[derive(Default)]
pub struct Orders {
    pub save: bool,
    pub restart: bool,
}
