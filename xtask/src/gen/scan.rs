//! A statue-like scan: a closed surface of genus 0 that stands along y.
//!
//! Here its axis is called z; the positions are turned at the very end.
//!
//! A profile curve is swept about a swaying axis. Lobes, sharp folds and a planar cut shape it, noise of
//! several octaves gives it detail of uneven strength, and every vertex carries a little scanner noise. Each
//! ring lies almost in a plane, so that the stream is sorted along z.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use super::Options;
use super::noise::{LANES, Lane, NoiseWalk, hash, octaves, signed, sum_octaves, unit};
use super::rings::{RingSurface, turn};

/// Half the statue's height, in millimetres.
const HALF_HEIGHT: f64 = 100.0;
/// Samples of the profile's arc length.
const PROFILE_SAMPLES: usize = 1 << 14;
/// The planar cut: its normal's angle about z and its distance from the z axis, in half heights.
const CUT_ANGLE: f64 = 2.2;
const CUT_DISTANCE: f64 = 0.36;
/// Octaves of the detail; the noise that varies its strength and the one that bends folds come after.
const OCTAVES: usize = 6;
const STRENGTH: usize = OCTAVES;
const BEND: usize = OCTAVES + 1;

/// A bulge of the statue.
#[derive(Debug, Clone, Copy)]
struct Lobe {
    direction: [f64; 2],
    height: f64,
    width: f64,
    amplitude: f64,
}

/// The plan of a scan: its profile, and how many vertices each ring has.
#[derive(Debug)]
pub struct Scan {
    /// Arc length from the lower pole and area under the profile, both as shares, at equal steps of the
    /// profile's parameter.
    profile: Vec<[f64; 2]>,
    lobes: Vec<Lobe>,
    noise: [Lane; LANES],
    num_rings: u64,
    num_ring_vertices: u64,
    edge_length: f64,
    origin: [f64; 3],
    seed: u64,
}

/// A smooth bump of height 1 about `center`.
fn bump(z: f64, center: f64, width: f64) -> f64 {
    (-((z - center) / width).powi(2)).exp()
}

/// The profile's distance from the axis and its height, both in half heights, at `u` in `[0, 1]`.
fn profile(u: f64) -> [f64; 2] {
    let angle = PI * u;
    let z = -angle.cos();
    let shape = 0.42 + 0.24 * bump(z, -0.85, 0.35) + 0.20 * bump(z, 0.22, 0.22)
        - 0.24 * bump(z, 0.52, 0.11)
        - 0.08 * bump(z, 0.8, 0.3);
    [angle.sin().max(0.0).powf(0.6) * shape, z]
}

impl Scan {
    /// Plans a scan of the number of triangles asked for, less one if that is odd.
    pub fn new(options: &Options) -> Self {
        let mut table = vec![[0.0; 2]; PROFILE_SAMPLES + 1];
        for i in 1..=PROFILE_SAMPLES {
            let [a, b] = [i - 1, i].map(|i| profile(i as f64 / PROFILE_SAMPLES as f64));
            let length = (a[0] - b[0]).hypot(a[1] - b[1]);
            let [before, area] = table[i - 1];
            table[i] = [before + length, area + length * (a[0] + b[0]) / 2.0];
        }
        let [length, area] = table[PROFILE_SAMPLES];
        for sample in &mut table {
            *sample = [sample[0] / length, sample[1] / area];
        }
        table[PROFILE_SAMPLES] = [1.0; 2];
        // A closed triangle mesh of genus 0 has 2 V − 4 triangles; two of the vertices are poles. The
        // rings are √3/2 edges apart; folds and lobes make them about a seventh longer than circles.
        let num_ring_vertices = options.triangles / 2;
        let circumference = 1.15 * TAU * area / length;
        let ratio = length / (0.866 * circumference);
        let num_rings = (ratio * num_ring_vertices as f64).sqrt().round() as u64;
        let num_rings = num_rings.clamp(3, num_ring_vertices / 6);
        let seed = hash(options.seed);
        let noise_seed = (seed >> 32) as u32;
        let mut noise = octaves(6.0, OCTAVES, noise_seed);
        noise[STRENGTH] = Lane { frequency: 2.5, shift: 0.0, seed: noise_seed ^ 5 };
        noise[BEND] = Lane { frequency: 4.0, shift: 0.0, seed: 77 };
        let lobes = (0..9)
            .map(|i| {
                let random = |k: u64| unit(hash(seed ^ (i << 8) ^ k));
                let angle = TAU * random(1);
                Lobe {
                    direction: [angle.cos(), angle.sin()],
                    height: -0.8 + 1.5 * (i as f64 + random(2)) / 9.0,
                    width: 0.12 + 0.18 * random(3),
                    amplitude: 0.12 + 0.28 * random(4),
                }
            })
            .collect();
        Self {
            profile: table,
            lobes,
            noise,
            num_rings,
            num_ring_vertices,
            edge_length: HALF_HEIGHT * length / num_rings as f64 / 0.866,
            origin: options.origin,
            seed,
        }
    }

    /// The profile's parameter at a share of its arc length.
    fn parameter(&self, share: f64) -> f64 {
        let after = self.profile.partition_point(|s| s[0] < share).clamp(1, PROFILE_SAMPLES);
        let [low, high] = [self.profile[after - 1][0], self.profile[after][0]];
        let fraction = if high > low { (share - low) / (high - low) } else { 0.0 };
        ((after - 1) as f64 + fraction.clamp(0.0, 1.0)) / PROFILE_SAMPLES as f64
    }

    /// The share of the area below a share of the arc length.
    fn area_below(&self, share: f64) -> f64 {
        let place = self.parameter(share) * PROFILE_SAMPLES as f64;
        let below = (place as usize).min(PROFILE_SAMPLES - 1);
        let [low, high] = [self.profile[below][1], self.profile[below + 1][1]];
        low + (high - low) * (place - below as f64)
    }
}

impl RingSurface for Scan {
    fn num_strips(&self) -> u64 {
        self.num_rings + 1
    }

    fn strip(&self, strip: u64) -> [u64; 2] {
        [strip, strip + 1]
    }

    fn num_vertices(&self) -> u64 {
        self.num_ring_vertices + 2
    }

    fn num_rings(&self) -> u64 {
        self.num_rings + 2
    }

    // Ring 0 and the last are the poles. At least three vertices to a ring, the rest by area.
    fn ring_start(&self, ring: u64) -> u64 {
        if ring == 0 {
            0
        } else if ring > self.num_rings + 1 {
            self.num_vertices()
        } else {
            let before = ring - 1;
            let spare = (self.num_ring_vertices - 3 * self.num_rings) as f64;
            let share = self.area_below(before as f64 / self.num_rings as f64);
            1 + 3 * before + (spare * share).round() as u64
        }
    }

    fn positions(&self, ring: u64, vertices: Range<u64>, out: &mut Vec<[f32; 3]>) {
        let last = self.num_rings + 1;
        let len = self.ring_len(ring);
        let [radius, z] = match ring {
            0 => [0.0, -1.0],
            _ if ring == last => [0.0, 1.0],
            _ => profile(self.parameter(ring as f64 / last as f64)),
        };
        let shape = RingShape::new(self, ring, radius, z);
        let mut noise = NoiseWalk::new(&self.noise);
        let mut directions = Directions::new(ring, len, vertices.start);
        for vertex in vertices {
            let random = hash(self.seed ^ (ring << 32) ^ vertex);
            out.push(shape.position(self, &mut noise, directions.next(), random));
        }
    }
}

/// Cosine and sine at one vertex of a ring after the other.
///
/// Most are turned on from the one before; every few vertices they are calculated, so that errors do not
/// add up and a walk that starts anywhere meets the same bits.
struct Directions {
    ring: u64,
    len: u64,
    vertex: u64,
    current: [f64; 2],
    step: [f64; 2],
}

/// Vertices from one calculated direction to the next.
const EXACT_EVERY: u64 = 16;

impl Directions {
    fn new(ring: u64, len: u64, first: u64) -> Self {
        let (sin, cos) = (TAU / len as f64).sin_cos();
        let vertex = first - first % EXACT_EVERY;
        let mut directions = Self { ring, len, vertex, current: [1.0, 0.0], step: [cos, sin] };
        while directions.vertex < first {
            directions.next();
        }
        directions
    }

    #[inline]
    fn next(&mut self) -> [f64; 2] {
        let ([cos, sin], [step_cos, step_sin]) = (self.current, self.step);
        self.current = if self.vertex.is_multiple_of(EXACT_EVERY) {
            let (sin, cos) = (TAU * turn(self.ring, self.vertex, self.len)).sin_cos();
            [cos, sin]
        } else {
            [cos * step_cos - sin * step_sin, sin * step_cos + cos * step_sin]
        };
        self.vertex += 1;
        self.current
    }
}

/// What is the same for all vertices of a ring.
struct RingShape {
    radius: f64,
    z: f64,
    axis: [f64; 2],
    /// How much of a displacement goes outwards and how much upwards.
    normal: [f64; 2],
    lobes: Vec<(f64, [f64; 2])>,
    folds: f64,
    /// Cosine and sine of the folds' turn.
    fold_turn: [f64; 2],
    cut_normal: [f64; 2],
    cut_distance: f64,
}

impl RingShape {
    fn new(scan: &Scan, ring: u64, radius: f64, z: f64) -> Self {
        let share = ring as f64 / (scan.num_rings + 1) as f64;
        let [low, high] =
            [-1e-3, 1e-3].map(|d| profile(scan.parameter((share + d).clamp(0.0, 1.0))));
        let slope = [high[1] - low[1], low[0] - high[0]];
        let length = slope[0].hypot(slope[1]).max(1e-12);
        let lobes = scan.lobes.iter().filter_map(|lobe| {
            let amplitude = lobe.amplitude * bump(z, lobe.height, lobe.width);
            (amplitude > 1e-6).then_some((amplitude, lobe.direction))
        });
        let axis = [0.08 * (2.6 * z + 0.5).sin(), 0.06 * (3.4 * z).cos()];
        let cut_normal = [CUT_ANGLE.cos(), CUT_ANGLE.sin()];
        let from_axis = axis[0] * cut_normal[0] + axis[1] * cut_normal[1];
        Self {
            radius,
            z,
            axis,
            normal: slope.map(|s| s / length),
            lobes: lobes.collect(),
            folds: 0.16 * bump(z, -0.55, 0.35),
            fold_turn: [(3.0 * z).cos(), (3.0 * z).sin()],
            cut_normal,
            cut_distance: CUT_DISTANCE + 0.6 * (1.0 - bump(z, 0.0, 0.7)) - from_axis,
        }
    }

    #[inline]
    fn position(
        &self,
        scan: &Scan,
        noise: &mut NoiseWalk,
        direction: [f64; 2],
        random: u64,
    ) -> [f32; 3] {
        let [cos, sin] = direction;
        // Lobes are a high power of the cosine to their direction: smooth, and cheap.
        let mut scale = 1.0;
        for &(amplitude, lobe) in &self.lobes {
            let facing = 0.5 + 0.5 * (cos * lobe[0] + sin * lobe[1]);
            let facing = facing * facing * facing;
            scale += amplitude * facing * facing;
        }
        let base = [scale * self.radius * cos, scale * self.radius * sin, self.z];
        let noise = noise.at(base.map(|c| c as f32));
        if self.folds > 1e-4 {
            // sin and cos of 4 angles more: sharp folds that wander with the height.
            let [c2, s2] = [cos * cos - sin * sin, 2.0 * cos * sin];
            let [c4, s4] = [c2 * c2 - s2 * s2, 2.0 * c2 * s2];
            let [turn_cos, turn_sin] = turned(self.fold_turn, 0.8 * f64::from(noise[BEND]));
            scale *= 1.0 + self.folds * (0.5 - (s4 * turn_cos + c4 * turn_sin).abs());
        }
        let rough = 0.6 + 0.5 * f64::from(noise[STRENGTH]);
        let detail = 0.03 * rough * rough * f64::from(sum_octaves(&noise[..OCTAVES]));
        let mut radius = (scale * self.radius
            + detail * self.normal[0] * self.radius.min(0.2) * 5.0)
            .max(0.3 * self.radius);
        let facing = cos * self.cut_normal[0] + sin * self.cut_normal[1];
        if facing > 1e-3 {
            radius = radius.min(self.cut_distance / facing);
        }
        let z = self.z + detail * self.normal[1];
        let jitter = 0.06 * scan.edge_length;
        let outwards =
            HALF_HEIGHT * radius + if radius > 0.0 { jitter * signed(random) } else { 0.0 };
        let x = HALF_HEIGHT * self.axis[0] + outwards * cos;
        let y = HALF_HEIGHT * self.axis[1] + outwards * sin;
        let z = HALF_HEIGHT * z + jitter * signed(hash(random));
        // Turned to stand along y, which is upwards for most viewers.
        [0, 1, 2].map(|axis| ([x, z, -y][axis] + scan.origin[axis]) as f32)
    }
}

/// A direction turned on by an angle in `[-0.8, 0.8]`, by the first terms of sine's and cosine's
/// series: nine digits.
#[inline]
fn turned([cos, sin]: [f64; 2], angle: f64) -> [f64; 2] {
    let square = angle * angle;
    let series = |divisors: [f64; 5]| {
        divisors.iter().rev().fold(1.0, |sum, divisor| 1.0 - sum * square * (1.0 / divisor))
    };
    let turn_sin = angle * series([6.0, 20.0, 42.0, 72.0, 110.0]);
    let turn_cos = series([2.0, 12.0, 30.0, 56.0, 90.0]);
    [cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin]
}
