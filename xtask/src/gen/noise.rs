//! Hashing, value noise and permutations: everything random here, and all of it a pure function.

/// A well-mixed hash of one word (the finaliser of SplitMix64).
#[inline]
pub fn hash(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A hash as a number in `[0, 1)`.
#[inline]
pub fn unit(hash: u64) -> f64 {
    (hash >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// A hash as a number in `[-1, 1)`.
#[inline]
pub fn signed(hash: u64) -> f64 {
    2.0 * unit(hash) - 1.0
}

#[inline]
fn lattice(x: i32, y: i32, z: i32, seed: u32) -> f32 {
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77)
        ^ (z as u32).wrapping_mul(0xc2b2_ae3d)
        ^ seed;
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 13)).wrapping_mul(0x297a_2d39);
    (h >> 8) as f32 * (2.0 / 16_777_216.0) - 1.0
}

/// Smooth value noise in `[-1, 1]` with a lattice of unit cells.
#[inline]
pub fn value_noise(p: [f32; 3], seed: u32) -> f32 {
    // Not `f32::floor`, which is a call where the target lacks the instruction.
    let [x, y, z] = p.map(|c| c as i32 - i32::from(c < 0.0));
    let floor = [x, y, z].map(|c| c as f32);
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let [u, v, w] = [fade(p[0] - floor[0]), fade(p[1] - floor[1]), fade(p[2] - floor[2])];
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let row = |y: i32, z: i32| mix(lattice(x, y, z, seed), lattice(x + 1, y, z, seed), u);
    let low = mix(row(y, z), row(y + 1, z), v);
    let high = mix(row(y, z + 1), row(y + 1, z + 1), v);
    mix(low, high, w)
}

/// Octaves of noise, each of twice the frequency and half the amplitude of the one before.
#[inline]
pub fn octaves(p: [f32; 3], num_octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut amplitude, mut frequency) = (0.0, 1.0, 1.0);
    for octave in 0..num_octaves {
        // Shifted, so that the octaves' lattices do not line up.
        let shift = 17.3 * octave as f32;
        let q = p.map(|c| c * frequency + shift);
        sum += amplitude * value_noise(q, seed.wrapping_add(octave));
        amplitude *= 0.5;
        frequency *= 2.0;
    }
    sum
}

/// A permutation of `0..len` in constant memory: a Feistel network, walked until it lands inside.
#[derive(Debug, Clone, Copy)]
pub struct Permutation {
    len: u64,
    half_bits: u32,
    seed: u64,
}

impl Permutation {
    /// The permutation of `0..len` that `seed` chooses.
    pub fn new(len: u64, seed: u64) -> Self {
        let bits = u64::BITS - len.max(2).leading_zeros();
        Self { len, half_bits: bits.div_ceil(2), seed: hash(seed) }
    }

    /// The place that `index`, below the length, goes to.
    pub fn at(&self, index: u64) -> u64 {
        let mask = (1u64 << self.half_bits) - 1;
        let mut x = index;
        loop {
            let (mut left, mut right) = (x >> self.half_bits, x & mask);
            for round in 0..4 {
                let key = self.seed.wrapping_add(round << 56);
                (left, right) = (right, left ^ (hash(right ^ key) & mask));
            }
            x = left << self.half_bits | right;
            if x < self.len {
                return x;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_permutation_reaches_every_place_once() {
        for len in 1..200 {
            let permutation = Permutation::new(len, 3);
            let mut places: Vec<u64> = (0..len).map(|i| permutation.at(i)).collect();
            places.sort_unstable();
            assert!(places.into_iter().eq(0..len));
        }
    }

    #[test]
    fn noise_is_bounded_and_continuous_across_cells() {
        for i in 0..1000 {
            let p = [i as f32 * 0.37 - 100.0, i as f32 * 0.11, 3.0];
            assert!(value_noise(p, 1).abs() <= 1.0);
        }
        let (below, above) =
            (value_noise([0.999_99, 0.3, 0.6], 9), value_noise([1.0, 0.3, 0.6], 9));
        assert!((below - above).abs() < 1e-3);
    }
}
