//! Commands from requests for the background task.

/// Pending commands. Several may arrive before the background task takes them, so each has its own flag.
#[derive(Default)]
pub struct Orders {
    pub save: bool,
    pub restart: bool,
    pub identify: bool,
}
