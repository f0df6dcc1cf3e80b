//! Where the camera is, how it moves, and what is written down of it.

pub(crate) mod navigator;
pub(crate) mod outside;
pub(crate) mod path;
pub(crate) mod standard;
