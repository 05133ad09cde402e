//! Numbers of things that a board has, as types: what a board lacks takes no RAM in its image.

use core::fmt;
use core::ops::{Deref, DerefMut};

/// A number of things, as a type: [`Exactly`].
pub trait Count: Copy + fmt::Debug + Eq + 'static {
    /// The number.
    const COUNT: usize;

    /// So many values.
    type Of<T: Copy>: Copy + AsRef<[T]> + AsMut<[T]>;

    /// Returns so many values, each from its index.
    fn values<T: Copy>(value: impl FnMut(usize) -> T) -> Self::Of<T>;
}

/// Exactly `N` things.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exactly<const N: usize>;

impl<const N: usize> Count for Exactly<N> {
    const COUNT: usize = N;

    type Of<T: Copy> = [T; N];

    #[inline(always)]
    fn values<T: Copy>(value: impl FnMut(usize) -> T) -> [T; N] {
        core::array::from_fn(value)
    }
}

/// A value for each of a number of things. It is a slice whose length the compiler knows.
///
/// ```
/// use register_map::board::{Board, Each, EthIo5r, Modio08};
///
/// let ports = Each::<<Modio08 as Board>::Ports, u16>::of(|index| index as u16);
/// assert_eq!(*ports, [0, 1, 2, 3]);
/// // The eth-io5r has no second line.
/// assert_eq!(size_of::<Each<<EthIo5r as Board>::Second, u16>>(), 0);
/// ```
pub struct Each<C: Count, T: Copy>(C::Of<T>);

impl<C: Count, T: Copy> Each<C, T> {
    /// Returns a value for each index.
    #[inline(always)]
    #[must_use]
    pub fn of(value: impl FnMut(usize) -> T) -> Self {
        Self(C::values(value))
    }

    /// Returns the same value for all.
    #[inline(always)]
    #[must_use]
    pub fn all(value: T) -> Self {
        Self::of(|_| value)
    }
}

impl<C: Count, T: Copy> Deref for Each<C, T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        self.0.as_ref()
    }
}

impl<C: Count, T: Copy> DerefMut for Each<C, T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        self.0.as_mut()
    }
}

impl<C: Count, T: Copy> Clone for Each<C, T> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<C: Count, T: Copy> Copy for Each<C, T> {}

impl<C: Count, T: Copy + fmt::Debug> fmt::Debug for Each<C, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl<C: Count, T: Copy + PartialEq> PartialEq for Each<C, T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<C: Count, T: Copy + Eq> Eq for Each<C, T> {}
