//! A bumpy torus: a closed surface of genus 1.
//!
//! The rings go around the tube. Both halves grow at once from x = +R to x = −R, so that the stream
//! is sorted along x.

use std::f64::consts::TAU;
use std::ops::Range;

use super::Options;
use super::noise::{LANES, Lane, NoiseWalk, hash, octaves, sum_octaves};
use super::rings::{RingSurface, turn};

/// Radius of the tube's centre line and of the tube, in millimetres.
const MAJOR: f64 = 80.0;
const MINOR: f64 = 30.0;
/// Octaves of the noise.
const OCTAVES: usize = 5;

/// The plan of a torus.
#[derive(Debug)]
pub struct Torus {
    /// Half the number of rings.
    half: u64,
    ring_len: u64,
    /// Where the vertices of even and of odd rings are around the tube.
    around: [Vec<Around>; 2],
    origin: [f64; 3],
    noise: [Lane; LANES],
}

/// A direction around the tube.
#[derive(Debug)]
struct Around {
    sin: f64,
    cos: f64,
    /// Height of the studs, which stand in rows.
    stud: f64,
}

impl Around {
    fn new(ring: u64, vertex: u64, ring_len: u64) -> Self {
        // Clockwise, so that the next ring lies on the left.
        let angle = -TAU * turn(ring, vertex, ring_len);
        let (sin, cos) = angle.sin_cos();
        Self { sin, cos, stud: (9.0 * angle).sin() }
    }
}

impl Torus {
    /// Plans a torus whose number of triangles comes as near as possible to the one asked for, with
    /// triangles that are nearly equilateral.
    pub fn new(options: &Options) -> Self {
        // Four triangles for each half ring and vertex; edges of a length, rings √3/2 of it apart.
        let quarter = options.triangles as f64 / 4.0;
        let ideal = (quarter * 0.866 * MINOR / MAJOR * 2.0).sqrt();
        let candidates = (ideal * 0.85).max(3.0) as u64..=(ideal * 1.15).max(6.0) as u64;
        let miss = |len: u64| {
            let half = (quarter / len as f64).round().max(2.0) as u64;
            (4 * half * len).abs_diff(options.triangles)
        };
        let best = candidates.min_by_key(|&len| (miss(len), (len as f64 - ideal).abs() as u64));
        let ring_len = best.unwrap_or(6);
        Self {
            half: (quarter / ring_len as f64).round().max(2.0) as u64,
            ring_len,
            around: [0, 1].map(|ring| {
                (0..ring_len).map(|vertex| Around::new(ring, vertex, ring_len)).collect()
            }),
            origin: options.origin,
            noise: octaves(1.0, OCTAVES, hash(options.seed) as u32),
        }
    }
}

impl RingSurface for Torus {
    fn num_strips(&self) -> u64 {
        2 * self.half
    }

    fn strip(&self, strip: u64) -> [u64; 2] {
        let (step, rings) = (strip / 2, 2 * self.half);
        match strip % 2 {
            0 => [step, step + 1],
            _ => [rings - step - 1, (rings - step) % rings],
        }
    }

    fn num_vertices(&self) -> u64 {
        2 * self.half * self.ring_len
    }

    fn num_rings(&self) -> u64 {
        2 * self.half
    }

    fn ring_start(&self, ring: u64) -> u64 {
        ring * self.ring_len
    }

    fn positions(&self, ring: u64, vertices: Range<u64>, out: &mut Vec<[f32; 3]>) {
        let angle = TAU * ring as f64 / (2 * self.half) as f64;
        let (sin_major, cos_major) = angle.sin_cos();
        let studs = (24.0 * angle).sin();
        let mut noise = NoiseWalk::new(&self.noise);
        let around = &self.around[(ring % 2) as usize];
        for &Around { sin, cos, stud } in &around[vertices.start as usize..vertices.end as usize] {
            let base = MAJOR + MINOR * cos;
            let p = [base * cos_major, base * sin_major, MINOR * sin].map(|c| (c / 12.0) as f32);
            let rough = f64::from(sum_octaves(&noise.at(p)[..OCTAVES]));
            let minor = MINOR + 1.2 * (studs * stud) + 0.8 * rough;
            let base = MAJOR + minor * cos;
            out.push([
                (base * cos_major + self.origin[0]) as f32,
                (base * sin_major + self.origin[1]) as f32,
                (minor * sin + self.origin[2]) as f32,
            ]);
        }
    }
}
