//! The kind of a point.

/// The kind of a point, which its module determines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// There is no point at the address.
    None,
    /// A digital input.
    BitInput,
    /// A digital output.
    BitOutput,
    /// An analog input.
    WordInput,
    /// An analog output.
    WordOutput,
}
