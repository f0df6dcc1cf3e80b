//! The surface of an analytic function, by marching tetrahedra, as a scanner's pipeline emits it.
//!
//! The grid is walked in slabs of blocks along z. A block far from the surface, by the function's
//! Lipschitz bound, is skipped whole; so time goes with the surface, not the volume, and memory is
//! one block. Each cube is cut into six tetrahedra about its main diagonal (Kuhn's subdivision),
//! which makes the surface a closed manifold for any function that is positive at the border of the
//! grid.

use std::io;

use super::noise::{Permutation, hash, unit};
use super::{Emit, Options, Triangle};

/// Size of a grid unit cube's domain in millimetres.
const SCALE: f64 = 60.0;
/// Half the domain's height over half its width.
const TALL: f64 = 1.6;
/// Cubes along the edge of the blocks that slabs consist of, and of the smallest ones.
const BLOCK: u64 = 8;
const SMALL: u64 = 4;
/// Points along the edge of a smallest block.
const POINTS: usize = SMALL as usize + 1;
/// Bound of the function's gradient: 1 for the distance, the rest for the texture.
const LIPSCHITZ: f64 = 1.0 + TEXTURE[0][0] * TEXTURE[0][1] + TEXTURE[1][0] * TEXTURE[1][1];
/// Amplitude and frequency of the texture's octaves.
const TEXTURE: [[f64; 2]; 2] = [[0.015, 17.0], [0.003, 71.0]];
/// Crossings stay this share of an edge away from its ends: else several could round to one position.
const MARGIN: f64 = 0.03;
/// Trial grids to find the resolution, and how fine they may be.
const TRIALS: usize = 6;
const FINEST_TRIAL: f64 = 320.0;
/// Triangles to hand on at once.
const CHUNK: usize = 4096;

/// The corners of the six tetrahedra of a cube; bit i of a corner is its step along axis i.
const TETRAHEDRA: [[u8; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// The plan of an isosurface.
#[derive(Debug)]
pub struct Isosurface {
    /// Cubes along x and y, and along z.
    cubes: [u64; 2],
    /// Edge of a cube, in units of half the domain's width.
    step: f64,
    /// The texture's sines at the grid's planes, for each octave and axis.
    sines: [[Vec<f64>; 3]; 2],
    table: Table,
}

/// The triangles of a tetrahedron by the mask of its corners that are inside.
#[derive(Debug)]
struct Table([[Vec<[[u8; 2]; 3]>; 16]; 6]);

impl Table {
    fn new() -> Self {
        Self(TETRAHEDRA.map(|corners| {
            std::array::from_fn(|mask| {
                let (inside, outside): (Vec<usize>, Vec<usize>) =
                    (0..4).partition(|i| mask >> i & 1 == 1);
                let order: Vec<usize> = inside.iter().chain(&outside).copied().collect();
                let inversions = (0..4)
                    .flat_map(|i| (0..i).map(move |j| (i, j)))
                    .filter(|&(i, j)| order[j] > order[i])
                    .count();
                let edge = |a: usize, b: usize| {
                    let [a, b] = [corners[order[a]], corners[order[b]]];
                    [a.min(b), a.max(b)]
                };
                // Outward for an even order of the corners of a positively oriented tetrahedron.
                let mut triangles = match inside.len() {
                    1 => vec![[edge(0, 1), edge(0, 2), edge(0, 3)]],
                    2 => vec![
                        [edge(0, 2), edge(0, 3), edge(1, 3)],
                        [edge(0, 2), edge(1, 3), edge(1, 2)],
                    ],
                    3 => vec![[edge(0, 3), edge(1, 3), edge(2, 3)]],
                    _ => Vec::new(),
                };
                if inversions % 2 == 1 {
                    triangles.iter_mut().for_each(|t| t.swap(1, 2));
                }
                triangles
            })
        }))
    }
}

fn length(p: [f64; 3]) -> f64 {
    (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt()
}

fn capsule(p: [f64; 3], a: [f64; 3], b: [f64; 3], radius: f64) -> f64 {
    let [pa, ba] = [[0, 1, 2].map(|i| p[i] - a[i]), [0, 1, 2].map(|i| b[i] - a[i])];
    let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    let along = (dot(pa, ba) / dot(ba, ba)).clamp(0.0, 1.0);
    length([0, 1, 2].map(|i| pa[i] - along * ba[i])) - radius
}

/// A torus about the axis that `p` has as its third coordinate.
fn torus(p: [f64; 3], major: f64, minor: f64) -> f64 {
    let ring = (p[0] * p[0] + p[1] * p[1]).sqrt() - major;
    (ring * ring + p[2] * p[2]).sqrt() - minor
}

/// Two parts' distances blend where they differ by less than this.
const WIDTH: f64 = 0.06;

/// The lesser of both, rounded where they meet; its gradient is no longer than theirs.
fn smooth_min(a: f64, b: f64) -> f64 {
    let h = (WIDTH - (a - b).abs()).max(0.0) / WIDTH;
    a.min(b) - h * h * WIDTH * 0.25
}

/// Number of the figure's parts.
const NUM_PARTS: usize = 6;
/// All parts, as a mask.
const ALL_PARTS: u8 = (1 << NUM_PARTS) - 1;

/// The distance to one part of the figure on a ring, with arms and a handle.
#[inline]
fn part(p: [f64; 3], part: usize) -> f64 {
    let [x, y, z] = p;
    match part {
        0 => capsule(p, [0.0, 0.0, -1.0], [0.0, 0.0, 0.45], 0.36),
        1 => length([x - 0.05, y, z - 1.05]) - 0.3,
        2 => capsule(p, [0.0, 0.3, 0.45], [0.35, 0.72, -0.1], 0.13),
        3 => capsule(p, [0.0, -0.3, 0.45], [0.3, -0.7, 0.7], 0.13),
        4 => torus([x, y, z + 1.15], 0.5, 0.2),
        _ => torus([x + 0.45, z - 0.05, y], 0.3, 0.09),
    }
}

/// The distance to the figure, nearly, from its parts in `mask`.
#[inline]
fn figure(p: [f64; 3], mask: u8) -> f64 {
    let (mut distance, mut mask) = (f64::INFINITY, mask);
    while mask != 0 {
        let one = part(p, mask.trailing_zeros() as usize);
        distance = if distance.is_finite() { smooth_min(distance, one) } else { one };
        mask &= mask - 1;
    }
    distance
}

impl Isosurface {
    /// Plans a grid on which about the number of triangles asked for come out.
    pub fn new(options: &Options) -> Self {
        // The number goes with the square of the resolution, nearly: a few trials on grids that are
        // not too fine tell the factor.
        let wanted = options.triangles as f64;
        let (mut resolution, mut best, mut least_miss) = (24.0_f64, 24.0, f64::INFINITY);
        for _ in 0..TRIALS {
            let count =
                Self::with_resolution(resolution, options.seed).count(&|_| true).max(1) as f64;
            if (count - wanted).abs() < least_miss {
                (best, least_miss) = (resolution, (count - wanted).abs());
            }
            let better = resolution * (wanted / count).sqrt();
            if resolution == FINEST_TRIAL && better > FINEST_TRIAL {
                best = better;
                break;
            }
            resolution = better.clamp(5.0, FINEST_TRIAL);
        }
        Self::with_resolution(best, options.seed)
    }

    /// A grid of this many cubes per two units, around the whole domain.
    fn with_resolution(resolution: f64, seed: u64) -> Self {
        let cubes = [resolution.ceil() as u64, (TALL * resolution).ceil() as u64];
        let step = 2.0 / resolution;
        let sines = [0, 1].map(|octave| {
            [0, 1, 2].map(|axis: usize| {
                let phase = 6.3 * unit(hash(seed ^ (octave as u64 * 8 + axis as u64)));
                let count = cubes[axis / 2] + BLOCK + 1;
                let half = cubes[axis / 2] as f64 / 2.0;
                (0..count)
                    .map(|i| (TEXTURE[octave][1] * (i as f64 - half) * step + phase).sin())
                    .collect()
            })
        });
        Self { cubes, step, sines, table: Table::new() }
    }

    /// The position of a place of the grid, in units of half the domain's width.
    fn place(&self, i: [f64; 3]) -> [f64; 3] {
        let [xy, z] = self.cubes.map(|n| n as f64 / 2.0);
        [(i[0] - xy) * self.step, (i[1] - xy) * self.step, (i[2] - z) * self.step]
    }

    fn value(&self, [x, y, z]: [u64; 3], parts: u8) -> f64 {
        let mut value = figure(self.place([x as f64, y as f64, z as f64]), parts);
        for ([sx, sy, sz], [amplitude, _]) in self.sines.iter().zip(TEXTURE) {
            value += amplitude * sx[x as usize] * sy[y as usize] * sz[z as usize];
        }
        // An exact zero counts as inside.
        value
    }

    fn num_blocks(&self) -> [u64; 3] {
        let [xy, z] = self.cubes.map(|n| n.div_ceil(BLOCK));
        [xy, xy, z]
    }

    /// Visits the small blocks of a block that may meet the surface.
    fn descend(
        &self,
        first: [u64; 3],
        size: u64,
        parts: u8,
        visit: &mut dyn FnMut([u64; 3], u8) -> io::Result<()>,
    ) -> io::Result<()> {
        // Blocks have an even number of cubes along each edge: the center is a point of the grid.
        let middle = first.map(|c| c + size / 2);
        let reach = LIPSCHITZ * self.step * size as f64 * 0.5 * 3.0_f64.sqrt();
        if self.value(middle, parts).abs() > reach {
            return Ok(());
        }
        // Parts too far off to have an influence anywhere in the block, to the last bit, are left out:
        // blending lowers a distance by at most a quarter of the width per part.
        let is_set = |i: &usize| parts >> i & 1 == 1;
        let center = self.place(middle.map(|c| c as f64));
        let distances: [f64; NUM_PARTS] = std::array::from_fn(|i| part(center, i));
        let nearest = (0..NUM_PARTS).filter(is_set).fold(f64::INFINITY, |d, i| d.min(distances[i]));
        let limit = nearest + 2.0 * reach + WIDTH * (1.0 + 0.25 * NUM_PARTS as f64);
        let parts = (0..NUM_PARTS)
            .filter(is_set)
            .fold(0, |mask, i| mask | u8::from(distances[i] <= limit) << i);
        if size == SMALL {
            return visit(first, parts);
        }
        let half = size / 2;
        for child in 0..8 {
            let at = [0, 1, 2].map(|axis| first[axis] + half * (child >> axis & 1));
            self.descend(at, half, parts, visit)?;
        }
        Ok(())
    }

    /// Evaluates the function at a small block's points; none if all have one sign.
    fn sample(
        &self,
        first: [u64; 3],
        parts: u8,
        values: &mut [f64; POINTS * POINTS * POINTS],
    ) -> bool {
        let mut inside = 0;
        for z in 0..POINTS {
            for y in 0..POINTS {
                for x in 0..POINTS {
                    let at = [first[0] + x as u64, first[1] + y as u64, first[2] + z as u64];
                    let value = self.value(at, parts);
                    inside += usize::from(value <= 0.0);
                    values[(z * POINTS + y) * POINTS + x] = value;
                }
            }
        }
        inside > 0 && inside < values.len()
    }

    /// Calls `cube` with the place and the corners' values of each cube that the surface cuts.
    fn cut_cubes(
        &self,
        block: u64,
        keep: &dyn Fn([u64; 3]) -> bool,
        cube: &mut dyn FnMut([u64; 3], [f64; 8]) -> io::Result<()>,
    ) -> io::Result<()> {
        let [nx, ny, _] = self.num_blocks();
        let first = [block % nx * BLOCK, block / nx % ny * BLOCK, block / (nx * ny) * BLOCK];
        let mut values = [0.0; POINTS * POINTS * POINTS];
        self.descend(first, BLOCK, ALL_PARTS, &mut |first, parts| {
            if !self.sample(first, parts, &mut values) {
                return Ok(());
            }
            for place in 0..SMALL * SMALL * SMALL {
                let [x, y, z] = [place % SMALL, place / SMALL % SMALL, place / (SMALL * SMALL)];
                let corner = ((z as usize * POINTS) + y as usize) * POINTS + x as usize;
                let corners: [f64; 8] = std::array::from_fn(|c| {
                    values[corner + (c & 1) + (c >> 1 & 1) * POINTS + (c >> 2) * POINTS * POINTS]
                });
                let inside = corners.iter().filter(|&&v| v <= 0.0).count();
                let at = [first[0] + x, first[1] + y, first[2] + z];
                if inside > 0 && inside < 8 && keep(at) {
                    cube(at, corners)?;
                }
            }
            Ok(())
        })
    }

    /// The triangles, as corners of cube edges, of a cube with these values at its corners.
    fn cut(&self, corners: &[f64; 8]) -> impl Iterator<Item = &[[u8; 2]; 3]> {
        TETRAHEDRA.iter().zip(&self.table.0).flat_map(|(tetrahedron, by_mask)| {
            let bit = |i: usize| usize::from(corners[tetrahedron[i] as usize] <= 0.0) << i;
            &by_mask[bit(0) | bit(1) | bit(2) | bit(3)]
        })
    }

    fn count(&self, keep: &dyn Fn([u64; 3]) -> bool) -> u64 {
        let mut count = 0;
        for block in 0..self.num_blocks().iter().product() {
            let counted = self.cut_cubes(block, keep, &mut |_, corners| {
                count += self.cut(&corners).count() as u64;
                Ok(())
            });
            debug_assert!(counted.is_ok(), "counting writes nothing");
        }
        count
    }

    /// The number of triangles that come out.
    pub fn num_triangles(&self, options: &Options) -> u64 {
        self.count(&|at| !is_hole(at, options))
    }

    /// Streams the triangles, slab by slab or, shuffled, block by block.
    pub fn triangles(&self, options: &Options, emit: &mut Emit<'_>) -> io::Result<()> {
        let keep = |at: [u64; 3]| !is_hole(at, options);
        let num_blocks = self.num_blocks().iter().product();
        let order = options.shuffle.then(|| Permutation::new(num_blocks, options.seed ^ 0x5_0f1e));
        let mut chunk: Vec<Triangle> = Vec::with_capacity(2 * CHUNK);
        for index in 0..num_blocks {
            let block = order.map_or(index, |order| order.at(index));
            self.cut_cubes(block, &keep, &mut |at, corners| {
                for triangle in self.cut(&corners) {
                    chunk.push(triangle.map(|edge| self.crossing(at, edge, &corners, options)));
                }
                if chunk.len() >= CHUNK {
                    emit(&chunk)?;
                    chunk.clear();
                }
                Ok(())
            })?;
        }
        emit(&chunk)
    }

    /// Where the surface crosses an edge: the same bits in every cube that has the edge.
    #[inline]
    fn crossing(
        &self,
        at: [u64; 3],
        [a, b]: [u8; 2],
        corners: &[f64; 8],
        options: &Options,
    ) -> [f32; 3] {
        let [va, vb] = [corners[a as usize], corners[b as usize]];
        let t = (va / (va - vb)).clamp(MARGIN, 1.0 - MARGIN);
        let offset = |corner: u8, axis: usize| f64::from(corner >> axis & 1);
        let place = self.place([0, 1, 2].map(|axis| {
            let from = at[axis] as f64 + offset(a, axis);
            from + t * (offset(b, axis) - offset(a, axis))
        }));
        // Turned to stand along y, which is upwards for most viewers.
        let turned = [place[0], place[2], -place[1]];
        [0, 1, 2].map(|axis| (SCALE * turned[axis] + options.origin[axis]) as f32)
    }
}

/// Whether a cube's triangles are left out. Such cubes have even places, so that no two of them
/// touch and the mesh stays manifold.
fn is_hole(at: [u64; 3], options: &Options) -> bool {
    if options.holes == 0.0 || at.iter().any(|c| c % 2 == 1) {
        return false;
    }
    let random = hash(hash(options.seed ^ 0x401e5) ^ (at[0] << 42 | at[1] << 21 | at[2]));
    unit(random) < HOLES_PER_SHARE * options.holes
}

/// Probability of a hole in a cube that may have one, by the share of boundary edges: measured.
const HOLES_PER_SHARE: f64 = 10.0;
