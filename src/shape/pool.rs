//! Memory to work in, one piece for each thread that is at work, kept for the next frame.

use std::sync::{Mutex, PoisonError};

#[derive(Debug)]
pub(super) struct Pool<T>(Mutex<Vec<T>>);

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<T: Default> Pool<T> {
    /// Lends a piece to `work`; what is in it is left over from some other call.
    pub(super) fn lend<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut piece = lock().pop().unwrap_or_default();
        let result = work(&mut piece);
        lock().push(piece);
        result
    }
}
