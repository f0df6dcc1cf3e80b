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

/// Number of places whose noise is evaluated at once.
pub const LANES: usize = 8;

/// One kind of noise: it is looked up at `frequency · p + shift`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Lane {
    pub frequency: f32,
    pub shift: f32,
    pub seed: u32,
}

/// Octaves of noise, each of twice the frequency of the one before; at most [`LANES`].
pub fn octaves(frequency: f32, num_octaves: usize, seed: u32) -> [Lane; LANES] {
    let mut lanes = [Lane::default(); LANES];
    for (octave, lane) in lanes.iter_mut().take(num_octaves).enumerate() {
        *lane = Lane {
            frequency: frequency * (1 << octave) as f32,
            // The octaves' lattices do not line up.
            shift: 17.3 * octave as f32,
            seed: seed.wrapping_add(octave as u32),
        };
    }
    lanes
}

/// The sum of octaves, each of half the amplitude of the one before.
#[inline]
pub fn sum_octaves(octaves: &[f32]) -> f32 {
    let mut amplitude = 2.0;
    octaves.iter().fold(0.0, |sum, octave| {
        amplitude *= 0.5;
        sum + amplitude * octave
    })
}

/// Value noise of several kinds along a walk of small steps.
///
/// Noise is smooth within the unit cells of a lattice. The cells that the walk is in are kept, so
/// that hashing is done only where it enters another; what it gives depends on the place alone.
#[derive(Debug)]
pub struct NoiseWalk {
    frequencies: [f32; LANES],
    shifts: [f32; LANES],
    seeds: [u32; LANES],
    /// Lower corners of the cells, along x, y and z.
    cells: [[f32; LANES]; 3],
    /// For the rows along x of a cell, y first: the value at its lower end, and by how much it grows.
    rows: [[[f32; LANES]; 2]; 4],
}

/// Added to and subtracted from a smaller number, this rounds it to an integer: with it in the sum,
/// a single-precision number has no bits left for a fraction.
const ROUNDING: f32 = 12_582_912.0;

impl NoiseWalk {
    /// A walk that has not begun.
    pub fn new(lanes: &[Lane; LANES]) -> Self {
        Self {
            frequencies: lanes.map(|lane| lane.frequency),
            shifts: lanes.map(|lane| lane.shift),
            seeds: lanes.map(|lane| lane.seed),
            cells: [[f32::NAN; LANES]; 3],
            rows: [[[0.0; LANES]; 2]; 4],
        }
    }

    /// The noise of every lane at `p`, in `[-1, 1]`.
    #[inline]
    pub fn at(&mut self, p: [f32; 3]) -> [f32; LANES] {
        let (mut cells, mut fades) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        let mut moved = false;
        for axis in 0..3 {
            for lane in 0..LANES {
                let place = p[axis] * self.frequencies[lane] + self.shifts[lane];
                // Not `f32::floor`, which is a call where the target lacks the instruction.
                let nearest = place + ROUNDING - ROUNDING;
                let floor = nearest - if nearest > place { 1.0 } else { 0.0 };
                let t = place - floor;
                cells[axis][lane] = floor;
                fades[axis][lane] = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
                moved |= floor != self.cells[axis][lane];
            }
        }
        if moved {
            self.enter(&cells);
        }
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let ([u, v, w], [r0, r1, r2, r3]) = (&fades, &self.rows);
        let mut noise = [0.0; LANES];
        for lane in 0..LANES {
            let along_x = |row: &[[f32; LANES]; 2]| row[0][lane] + row[1][lane] * u[lane];
            let low = mix(along_x(r0), along_x(r1), v[lane]);
            let high = mix(along_x(r2), along_x(r3), v[lane]);
            noise[lane] = mix(low, high, w[lane]);
        }
        noise
    }

    #[inline(never)]
    fn enter(&mut self, cells: &[[f32; LANES]; 3]) {
        for lane in 0..LANES {
            if (0..3).all(|axis| cells[axis][lane] == self.cells[axis][lane]) {
                continue;
            }
            let [x, y, z] = [0, 1, 2].map(|axis| cells[axis][lane] as i32);
            for (row, ends) in (0..).zip(&mut self.rows) {
                let value = |x| lattice(x, y + (row & 1), z + (row >> 1), self.seeds[lane]);
                let [low, high] = [value(x), value(x + 1)];
                ends[0][lane] = low;
                ends[1][lane] = high - low;
            }
        }
        self.cells = *cells;
    }
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
        let mut walk = NoiseWalk::new(&octaves(1.0, LANES, 1));
        for i in 0..1000 {
            let p = [i as f32 * 0.37 - 100.0, i as f32 * 0.11, 3.0];
            assert!(walk.at(p).iter().all(|value| value.abs() <= 1.0));
        }
        for x in [-3.0, 0.0, 1.0] {
            let [below, above] = [x - 1e-5, x + 1e-5].map(|x| walk.at([x, 0.3, 0.6])[0]);
            assert!((below - above).abs() < 1e-3);
        }
    }

    #[test]
    fn noise_depends_on_the_place_and_not_on_the_way_there() {
        let lanes = octaves(0.9, 5, 7);
        let mut walk = NoiseWalk::new(&lanes);
        for i in 0..1000 {
            let turn = i as f32 * 0.01;
            let p = [turn.cos() * 5.0, turn.sin() * 5.0, turn];
            assert_eq!(walk.at(p), NoiseWalk::new(&lanes).at(p));
        }
    }
}
