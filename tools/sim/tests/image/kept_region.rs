//! The contents that the kept region of the RAM has after each instruction. A reset keeps the RAM, and a start reads nothing
//! of it but this region. So it is enough to start the unit once with each content.

use std::fmt::Debug;
use std::ops::Range;

use crate::rig::Rig;

/// Bytes of the region, and of its end, which holds the marks of the tasks.
const REGION: usize = 512;
const MARKS: usize = 16;

/// Returns the place of the region in the RAM, without the marks.
pub fn region(rig: &Rig) -> Range<usize> {
    let end = rig.board.ram().len();
    end - REGION..end - MARKS
}

/// Contents of the region, each with what the unit may report after it.
pub struct Contents<T>(pub Vec<(Vec<u8>, [T; 2])>);

impl<T: Copy + Debug + PartialEq> Contents<T> {
    /// Runs instructions one by one, while what the unit reports changes from `old` to `new`.
    pub fn collect(&mut self, rig: &mut Rig, instructions: u32, old: T, new: T) {
        let range = region(rig);
        let mut last = rig.board.ram()[range.clone()].to_vec();
        for _ in 0..instructions {
            rig.board.step(1);
            let now = &rig.board.ram()[range.clone()];
            if now != last {
                last = now.to_vec();
                self.0.push((last.clone(), [old, new]));
            }
        }
    }

    /// Resets the unit with each content. Returns what it then reports, without repetitions.
    pub fn play(&self, rig: &mut Rig, mut reset: impl FnMut(&mut Rig) -> T) -> Vec<T> {
        let mut seen = Vec::new();
        for (n, (content, allowed)) in self.0.iter().enumerate() {
            let range = region(rig);
            rig.board.ram_mut()[range].copy_from_slice(content);
            let found = reset(rig);
            assert!(
                allowed.contains(&found),
                "content {n}: {found:?}, not of {allowed:?}"
            );
            seen.push(found);
        }
        seen.dedup();
        seen
    }
}
