//! From keys and mouse to actions and movements.

pub(crate) mod held;
pub(crate) mod keys;
pub(crate) mod pointer;
