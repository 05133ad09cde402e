//! A counter for work that is done once in N scans.

pub struct Every {
    period: u8,
    left: u8,
}

impl Every {
    /// Returns a counter that is due once in `period` calls, 1 to 255, and also in the first call.
    pub const fn new(period: u8) -> Self {
        Self { period, left: 0 }
    }

    /// Counts a call. Returns whether the work is due.
    pub const fn is_due(&mut self) -> bool {
        let due = self.left == 0;
        self.left = if due { self.period } else { self.left }.saturating_sub(1);
        due
    }
}
