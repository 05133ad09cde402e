//! What requests order of the background.

/// Several orders may arrive before the background takes them: none replaces another.
#[derive(Default)]
pub struct Orders {
    pub save: bool,
    pub restart: bool,
    pub identify: bool,
}
