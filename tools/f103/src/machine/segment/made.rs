//! Segments that all machines of this process share. The same code on many boards then stays in the host's cache.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

use super::{MOST, Place, Segment};
use crate::costs::Pace;

/// Number of segments above which those that no machine uses any more are dropped.
const MANY: usize = 1 << 14;

/// A segment and the bytes that it was made from.
#[derive(Debug)]
pub struct Made {
    pub segment: Segment,
    bytes: [u8; 4 * MOST],
}

impl Made {
    fn new(place: Place, code: &[u8], pace: &Pace) -> Self {
        let segment = Segment::new(place, code, pace);
        let size = usize::from(segment.size);
        let mut bytes = [0; 4 * MOST];
        bytes[..size].copy_from_slice(&code[..size]);
        Self { segment, bytes }
    }

    fn bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.segment.size)]
    }

    /// Returns whether `code` begins with the bytes of this segment.
    pub fn is_of(&self, code: &[u8]) -> bool {
        self.segment.size > 0 && code.starts_with(self.bytes())
    }
}

/// Start, bytes and costs of a segment.
type Key = (Place, Vec<u8>, Pace);

static SHARED: LazyLock<Mutex<HashMap<Key, Arc<Made>>>> = LazyLock::new(Mutex::default);

/// Returns the shared segment that starts at `place`; `code` begins with its bytes.
pub fn shared(place: Place, code: &[u8], pace: &Pace) -> Arc<Made> {
    let made = Made::new(place, code, pace);
    let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
    if shared.len() >= MANY {
        shared.retain(|_, made| Arc::strong_count(made) > 1);
    }
    let key = (place, made.bytes().to_vec(), *pace);
    Arc::clone(shared.entry(key).or_insert_with(|| Arc::new(made)))
}
