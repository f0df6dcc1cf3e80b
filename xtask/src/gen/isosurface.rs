//! The surface of an analytic function, by marching tetrahedra, as a scanner's pipeline emits it.
//!
//! The grid is walked in slabs of blocks along z. Blocks far from the surface, by the function's
//! Lipschitz bound, are skipped, many at a time; so time goes with the surface, not the volume, and
//! memory is one slab's list of blocks.

use std::io;

use super::figure::{Parts, Points, figure, figure_around};
use super::marching::{CUBES, Edge, Edges, Inside, NUM_POINTS, PLACES, Table};
use super::noise::{Permutation, hash, unit};
use super::{Emit, Options, Triangle};

/// Size of a grid unit cube's domain in millimetres.
const SCALE: f64 = 60.0;
/// Half the domain's height over half its width.
const TALL: f64 = 1.6;
/// Cubes along the edge of the blocks that slabs consist of; they are cut in eight.
const BLOCK: u64 = 2 * CUBES;
/// Amplitude and frequency of the texture's octaves.
const TEXTURE: [[f64; 2]; 2] = [[0.015, 17.0], [0.003, 71.0]];
/// Bound of the texture.
const ROUGHNESS: f64 = TEXTURE[0][0] + TEXTURE[1][0];
/// Bound of the function's gradient: 1 for the distance, the rest for the texture.
const LIPSCHITZ: f64 = 1.0 + TEXTURE[0][0] * TEXTURE[0][1] + TEXTURE[1][0] * TEXTURE[1][1];
/// Crossings stay this share of an edge away from its ends: else several could round to one position.
const MARGIN: f64 = 0.03;
/// Trial grids to find the resolution, and how fine they may be.
const TRIALS: usize = 6;
const FINEST_TRIAL: f64 = 320.0;
/// Triangles to hand on at once.
const CHUNK: usize = 4096;

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

/// The function at the points of a small block that the surface meets.
struct Samples<'a> {
    first: [u64; 3],
    values: &'a [f64; NUM_POINTS],
    inside: Inside,
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
    #[inline]
    fn position(&self, i: [f64; 3]) -> [f64; 3] {
        let [xy, z] = self.cubes.map(|n| n as f64 / 2.0);
        [(i[0] - xy) * self.step, (i[1] - xy) * self.step, (i[2] - z) * self.step]
    }

    /// What the texture adds to the figure's distance at a point of the grid.
    #[inline]
    fn add_texture(&self, value: f64, [x, y, z]: [u64; 3]) -> f64 {
        self.sines.iter().zip(TEXTURE).fold(value, |value, ([sx, sy, sz], [amplitude, _])| {
            value + amplitude * sx[x as usize] * sy[y as usize] * sz[z as usize]
        })
    }

    fn num_blocks(&self) -> [u64; 3] {
        let [xy, z] = self.cubes.map(|n| n.div_ceil(BLOCK));
        [xy, xy, z]
    }

    /// Appends the blocks of a slab that may meet the surface, from those of a square.
    fn find_blocks(
        &self,
        [x, y]: [u64; 2],
        slab: u64,
        size: u64,
        parts: Parts,
        found: &mut Vec<u64>,
    ) {
        let [nx, ny, _] = self.num_blocks();
        if x >= nx || y >= ny {
            return;
        }
        let half = [size, size, 1].map(|blocks| (blocks * BLOCK) as f64 / 2.0);
        let first = [x, y, slab].map(|block| (block * BLOCK) as f64);
        let center = self.position([0, 1, 2].map(|axis| first[axis] + half[axis]));
        let reach = half.iter().map(|h| h * h).sum::<f64>().sqrt() * self.step;
        let (distance, parts) = figure_around(center, reach, parts);
        if distance.abs() > reach + ROUGHNESS {
            return;
        }
        if size == 1 {
            return found.push((slab * ny + y) * nx + x);
        }
        let half = size / 2;
        for [i, j] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            self.find_blocks([x + half * i, y + half * j], slab, half, parts, found);
        }
    }

    /// Visits the small blocks of a block that may meet the surface.
    fn descend(
        &self,
        first: [u64; 3],
        size: u64,
        parts: Parts,
        visit: &mut dyn FnMut([u64; 3], Parts) -> io::Result<()>,
    ) -> io::Result<()> {
        // Blocks have an even number of cubes along each edge: the center is a point of the grid.
        let middle = first.map(|c| c + size / 2);
        let reach = LIPSCHITZ * self.step * size as f64 * 0.5 * 3.0_f64.sqrt();
        let (distance, parts) =
            figure_around(self.position(middle.map(|c| c as f64)), reach, parts);
        if self.add_texture(distance, middle).abs() > reach {
            return Ok(());
        }
        if size == CUBES {
            return visit(first, parts);
        }
        let half = size / 2;
        for child in 0..8 {
            let at = [0, 1, 2].map(|axis| first[axis] + half * (child >> axis & 1));
            self.descend(at, half, parts, visit)?;
        }
        Ok(())
    }

    /// The function at a small block's points.
    fn sample(&self, first: [u64; 3], parts: Parts) -> [f64; NUM_POINTS] {
        let mut points: Points<NUM_POINTS> = [[0.0; NUM_POINTS]; 3];
        for (point, place) in PLACES.iter().enumerate() {
            let position = self.position([0, 1, 2].map(|axis| (first[axis] + place[axis]) as f64));
            for (axis, c) in position.into_iter().enumerate() {
                points[axis][point] = c;
            }
        }
        let mut values = figure(&points, parts);
        for (value, place) in values.iter_mut().zip(&PLACES) {
            *value = self.add_texture(*value, [0, 1, 2].map(|axis| first[axis] + place[axis]));
        }
        values
    }

    /// Calls `visit` for each small block of a block that the surface meets.
    fn sample_block(
        &self,
        block: u64,
        visit: &mut dyn FnMut(Samples<'_>) -> io::Result<()>,
    ) -> io::Result<()> {
        let [nx, ny, _] = self.num_blocks();
        let first = [block % nx, block / nx % ny, block / (nx * ny)].map(|c| c * BLOCK);
        self.descend(first, BLOCK, Parts::ALL, &mut |first, parts| {
            let values = &self.sample(first, parts);
            visit(Samples { first, values, inside: Inside::new(values) })
        })
    }

    /// Calls `visit` for each small block that the surface meets, slab by slab.
    fn sample_all(&self, visit: &mut dyn FnMut(Samples<'_>) -> io::Result<()>) -> io::Result<()> {
        let [nx, ny, num_slabs] = self.num_blocks();
        let mut blocks = Vec::new();
        for slab in 0..num_slabs {
            blocks.clear();
            let square = nx.max(ny).next_power_of_two();
            self.find_blocks([0, 0], slab, square, Parts::ALL, &mut blocks);
            blocks.sort_unstable();
            blocks.iter().try_for_each(|&block| self.sample_block(block, visit))?;
        }
        Ok(())
    }

    fn count(&self, keep: &dyn Fn([u64; 3]) -> bool) -> u64 {
        let mut count = 0;
        let counted = self.sample_all(&mut |samples| {
            for cube in samples.inside.cut_cubes() {
                if keep(samples.at(cube.point)) {
                    count += self.table.num_triangles(cube);
                }
            }
            Ok(())
        });
        debug_assert!(counted.is_ok(), "counting writes nothing");
        count
    }

    /// The number of triangles that come out.
    pub fn num_triangles(&self, options: &Options) -> u64 {
        self.count(&|at| !is_hole(at, options))
    }

    /// Streams the triangles, slab by slab or, shuffled, block by block.
    pub fn triangles(&self, options: &Options, emit: &mut Emit<'_>) -> io::Result<()> {
        let mut chunk: Vec<Triangle> = Vec::with_capacity(2 * CHUNK);
        let mut crossings = Edges::new([0.0; 3]);
        let mut cut = |samples: Samples<'_>| {
            for edge in samples.inside.crossed_edges() {
                crossings.set(edge, self.crossing(&samples, edge, options));
            }
            for cube in samples.inside.cut_cubes() {
                if !is_hole(samples.at(cube.point), options) {
                    chunk.extend(self.table.triangles(cube, &crossings));
                }
            }
            if chunk.len() >= CHUNK {
                emit(&chunk)?;
                chunk.clear();
            }
            Ok(())
        };
        if options.shuffle {
            let num_blocks = self.num_blocks().iter().product();
            let order = Permutation::new(num_blocks, options.seed ^ 0x5_0f1e);
            (0..num_blocks).try_for_each(|block| self.sample_block(order.at(block), &mut cut))?;
        } else {
            self.sample_all(&mut cut)?;
        }
        emit(&chunk)
    }

    /// Where the surface crosses an edge: the same bits in every block that has the edge.
    #[inline]
    fn crossing(&self, samples: &Samples<'_>, edge: Edge, options: &Options) -> [f32; 3] {
        let [va, vb] = [edge.point, edge.end()].map(|point| samples.values[point]);
        let t = (va / (va - vb)).clamp(MARGIN, 1.0 - MARGIN);
        let (from, step) = (samples.at(edge.point), edge.step());
        let [x, y, z] =
            self.position([0, 1, 2].map(|axis| from[axis] as f64 + t * step[axis] as f64));
        // Turned to stand along y, which is upwards for most viewers.
        let turned = [x, z, -y];
        [0, 1, 2].map(|axis| (SCALE * turned[axis] + options.origin[axis]) as f32)
    }
}

impl Samples<'_> {
    /// The place in the grid of a point of the block, or of the cube above it.
    #[inline]
    fn at(&self, point: usize) -> [u64; 3] {
        let place = PLACES[point];
        [0, 1, 2].map(|axis| self.first[axis] + place[axis])
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
