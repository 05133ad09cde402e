//! What is done once in so many scans.

pub struct Every {
    period: u8,
    left: u8,
}

impl Every {
    /// Once in `period` times, 1 to 255, the first time at once.
    pub const fn new(period: u8) -> Self {
        Self { period, left: 0 }
    }

    /// Whether this time is one.
    pub const fn is_due(&mut self) -> bool {
        let due = self.left == 0;
        self.left = if due { self.period } else { self.left }.saturating_sub(1);
        due
    }
}
