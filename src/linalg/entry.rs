//! An entry of several vectors, as vector registers hold it.

use std::borrow::Borrow;
use std::ops::{Deref, DerefMut};

use super::kernels::LANES;

/// An entry of L vectors, a multiple of eight. It begins where a cache line does, so that no register is filled from two.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Entry<const L: usize>(pub [f64; L]);

/// An entry of eight vectors.
pub type Eight = Entry<LANES>;

impl<const L: usize> Entry<L> {
    pub const ZERO: Self = Self([0.0; L]);

    /// The numbers of entries, one after the other.
    pub fn flattened(entries: &mut [Self]) -> &mut [f64] {
        const { assert!(size_of::<Self>() == size_of::<[f64; L]>()) };
        // SAFETY: an entry is L numbers and, as has just been asserted, nothing else.
        unsafe { std::slice::from_raw_parts_mut(entries.as_mut_ptr().cast(), L * entries.len()) }
    }
}

impl<const L: usize> Deref for Entry<L> {
    type Target = [f64; L];
    fn deref(&self) -> &[f64; L] {
        &self.0
    }
}

impl<const L: usize> DerefMut for Entry<L> {
    fn deref_mut(&mut self) -> &mut [f64; L] {
        &mut self.0
    }
}

impl<const L: usize> Borrow<[f64; L]> for Entry<L> {
    fn borrow(&self) -> &[f64; L] {
        &self.0
    }
}

/// The first eight entries, filled up with zeros.
pub fn filled(entries: &[Eight]) -> [Eight; LANES] {
    std::array::from_fn(|i| entries.get(i).copied().unwrap_or(Entry::ZERO))
}
