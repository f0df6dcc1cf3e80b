//! What is fuzzed.

use crate::random::Random;

/// Something that takes bytes from outside.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name on the command line, and that of its folder of cases.
    pub name: &'static str,
    /// Files to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Changes a file; the other one is there to take pieces from.
    pub mutate: fn(&mut Random, &mut Vec<u8>, &[u8]),
    /// Takes the bytes; panics where what comes of it is wrong.
    pub run: fn(&[u8]),
    /// Memory that a case may take.
    pub memory: MemoryLimit,
}

/// How much memory a file may cost.
#[derive(Clone, Copy, Debug)]
pub struct MemoryLimit {
    /// Bytes whatever the file: buffers and tables of fixed size.
    pub fixed: usize,
    /// Bytes for each byte of the file.
    pub per_byte: usize,
}

impl MemoryLimit {
    /// For a file of so many bytes.
    pub fn of(&self, length: usize) -> usize {
        self.fixed.saturating_add(length.saturating_mul(self.per_byte))
    }
}
