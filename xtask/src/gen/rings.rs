//! Surfaces made of rings of vertices, joined by strips of triangles.
//!
//! A strip zips two neighbouring rings, which may have different numbers of vertices: all steps
//! along either ring are done in the order of their angle, and each step is one triangle. A pole is
//! a ring of one vertex, along which there is no step.

use std::io;
use std::ops::Range;

use super::noise::{Permutation, hash, unit};
use super::{Emit, Options, Triangle};

/// A closed surface that consists of rings.
pub trait RingSurface {
    /// Number of strips.
    fn num_strips(&self) -> u64;

    /// The two rings of a strip: the second is on the left of the first's direction, seen from
    /// outside. Strips follow one another along the surface's longest axis.
    fn strip(&self, strip: u64) -> [u64; 2];

    /// Number of vertices.
    fn num_vertices(&self) -> u64;

    /// Number of rings.
    fn num_rings(&self) -> u64;

    /// Number of a ring's first vertex among all vertices.
    fn ring_start(&self, ring: u64) -> u64;

    /// Number of a ring's vertices: one for a pole.
    fn ring_len(&self, ring: u64) -> u64 {
        self.ring_start(ring + 1) - self.ring_start(ring)
    }

    /// Appends the positions of some vertices of a ring.
    fn positions(&self, ring: u64, vertices: Range<u64>, out: &mut Vec<[f32; 3]>);
}

/// The angle, as a share of the full turn, of a ring's vertex: odd rings are turned by half a step.
pub fn turn(ring: u64, vertex: u64, len: u64) -> f64 {
    (2 * vertex + ring % 2) as f64 / (2 * len) as f64
}

/// A part of a strip: the steps along both rings between two angles.
#[derive(Debug, Clone)]
struct Part {
    rings: [u64; 2],
    lens: [u64; 2],
    steps: [Range<u64>; 2],
}

impl Part {
    /// The part of `strip` in sector `sector` of `num_sectors`.
    fn new(surface: &dyn RingSurface, strip: u64, sector: u64, num_sectors: u64) -> Self {
        let rings = surface.strip(strip);
        let lens = rings.map(|ring| surface.ring_len(ring));
        let steps = [0, 1].map(|side| {
            let (len, odd) = (lens[side], rings[side] % 2);
            // The steps before an angle; step j ends at the angle (2j + odd) / 2len.
            let before = |sector: u64| {
                if len == 1 || sector == 0 {
                    0
                } else if sector == num_sectors {
                    len
                } else {
                    let first = (2 * len * sector).div_ceil(num_sectors).saturating_sub(odd);
                    first.div_ceil(2).max(1) - 1
                }
            };
            before(sector)..before(sector + 1)
        });
        Self { rings, lens, steps }
    }

    /// Number of steps, along both rings together.
    fn num_steps(&self) -> u64 {
        self.steps.iter().map(|steps| steps.end - steps.start).sum()
    }

    /// Calls `triangle(side, a, b)` per step: `a`, `b` are the places before it along both rings.
    #[inline]
    fn walk(&self, holes: &Holes, mut triangle: impl FnMut(usize, u64, u64)) {
        let ends = [self.steps[0].end, self.steps[1].end];
        let [mut a, mut b] = [self.steps[0].start, self.steps[1].start];
        let mut holes = holes.of_strip(self, a + b);
        let mut hole = holes.next().unwrap_or(NO_HOLE);
        // Angles of the next steps, both times 2 · len · len.
        let [step_a, step_b] = [2 * self.lens[1], 2 * self.lens[0]];
        let mut angle_a = (2 * (a + 1) + self.rings[0] % 2) * self.lens[1];
        let mut angle_b = (2 * (b + 1) + self.rings[1] % 2) * self.lens[0];
        while a < ends[0] || b < ends[1] {
            let along_a = b >= ends[1] || (a < ends[0] && angle_a <= angle_b);
            if a + b < hole.start {
                triangle(usize::from(!along_a), a, b);
            } else if a + b + 1 == hole.end {
                hole = holes.next().unwrap_or(NO_HOLE);
            }
            if along_a {
                a += 1;
                angle_a += step_a;
            } else {
                b += 1;
                angle_b += step_b;
            }
        }
    }
}

/// Steps between the starts of two possible holes.
const SITE: u64 = 12;

/// The hole after the last.
const NO_HOLE: Range<u64> = u64::MAX..u64::MAX;

/// Which triangles are left out.
///
/// A hole is a run of 2 to 6 triangles in a strip whose first ring is odd. Runs are at least 6
/// triangles apart and strips that may have them never touch, so no vertex is on two holes and the
/// mesh stays manifold.
#[derive(Debug, Clone, Copy)]
struct Holes {
    probability: f64,
    seed: u64,
}

impl Holes {
    fn new(options: &Options) -> Self {
        // On average 4 triangles with 6 boundary edges and 3 edges inside, of 36 edges to a site.
        let share = options.holes;
        Self { probability: 36.0 * share / (6.0 + 3.0 * share), seed: hash(options.seed ^ 0x401e5) }
    }

    /// The holes of a part's strip that end after a step, in order: ranges of steps, none empty.
    fn of_strip(&self, part: &Part, step: u64) -> impl Iterator<Item = Range<u64>> + use<> {
        let [short, long] = [part.lens[0].min(part.lens[1]), part.lens[0].max(part.lens[1])];
        let eligible = part.rings[0] % 2 == 1 && short >= SITE && long <= 2 * short;
        let num_sites = if eligible && self.probability > 0.0 { (short + long) / SITE } else { 0 };
        let (probability, seed) = (self.probability, hash(self.seed ^ part.rings[0]));
        (step / SITE..num_sites).filter_map(move |site| {
            let random = hash(seed ^ site);
            let start = site * SITE + 3;
            let hole = start.max(step)..start + 2 + random % 5;
            (!hole.is_empty() && unit(hash(random)) < probability).then_some(hole)
        })
    }
}

/// Number of triangles that are left after the holes.
pub fn num_triangles(surface: &dyn RingSurface, options: &Options) -> u64 {
    let holes = Holes::new(options);
    (0..surface.num_strips())
        .map(|strip| {
            let part = Part::new(surface, strip, 0, 1);
            let left_out = holes.of_strip(&part, 0).map(|hole| hole.end - hole.start);
            part.num_steps() - left_out.sum::<u64>()
        })
        .sum()
}

/// Strips and steps of a block that is generated as a whole when the order is shuffled.
const BLOCK_STRIPS: u64 = 8;
const BLOCK_STEPS: u64 = 32;
/// Triangles to hand on at once.
const CHUNK: usize = 4096;

/// Streams the triangles, strip by strip or block by block in a random order.
pub fn triangles(
    surface: &dyn RingSurface,
    options: &Options,
    emit: &mut Emit<'_>,
) -> io::Result<()> {
    let holes = Holes::new(options);
    let mut chunk = Vec::with_capacity(2 * CHUNK);
    let mut cache = RingCache::default();
    let num_strips = surface.num_strips();
    if !options.shuffle {
        for strip in 0..num_strips {
            let part = Part::new(surface, strip, 0, 1);
            emit_part(surface, &part, &holes, &mut cache, &mut chunk, emit)?;
        }
    } else {
        let longest = (0..num_strips).map(|s| surface.ring_len(surface.strip(s)[0])).max();
        let num_sectors = (2 * longest.unwrap_or(1)).div_ceil(BLOCK_STEPS).max(1);
        let num_blocks = num_strips.div_ceil(BLOCK_STRIPS) * num_sectors;
        let order = Permutation::new(num_blocks, options.seed ^ 0x5_0f1e);
        for block in (0..num_blocks).map(|index| order.at(index)) {
            let first = block / num_sectors * BLOCK_STRIPS;
            for strip in first..(first + BLOCK_STRIPS).min(num_strips) {
                let part = Part::new(surface, strip, block % num_sectors, num_sectors);
                emit_part(surface, &part, &holes, &mut cache, &mut chunk, emit)?;
            }
        }
    }
    emit(&chunk)
}

fn emit_part(
    surface: &dyn RingSurface,
    part: &Part,
    holes: &Holes,
    cache: &mut RingCache,
    chunk: &mut Vec<Triangle>,
    emit: &mut Emit<'_>,
) -> io::Result<()> {
    let slots = [0, 1].map(|side| {
        let vertices = part.steps[side].start..part.steps[side].end + 1;
        cache.slot(surface, part.rings[side], part.lens[side], vertices)
    });
    let [low, high] = slots.map(|slot| &cache.slots[slot].positions[..]);
    let [first_a, first_b] = [part.steps[0].start, part.steps[1].start];
    part.walk(holes, |side, a, b| {
        let (a, b) = ((a - first_a) as usize, (b - first_b) as usize);
        let next = if side == 0 { low[a + 1] } else { high[b + 1] };
        chunk.push([low[a], next, high[b]]);
    });
    if chunk.len() >= CHUNK {
        emit(chunk)?;
        chunk.clear();
    }
    Ok(())
}

/// The last few rings' positions: neighbouring strips share a ring.
#[derive(Debug, Default)]
struct RingCache {
    slots: [CachedRing; 4],
    next: usize,
}

#[derive(Debug, Default)]
struct CachedRing {
    ring: u64,
    vertices: Range<u64>,
    positions: Vec<[f32; 3]>,
}

impl RingCache {
    /// The slot that holds the vertices of a ring; the one after the last is the first.
    fn slot(
        &mut self,
        surface: &dyn RingSurface,
        ring: u64,
        len: u64,
        vertices: Range<u64>,
    ) -> usize {
        let known = self.slots.iter().position(|s| s.ring == ring && s.vertices == vertices);
        if let Some(known) = known {
            // Not the one to be overwritten by the strip's other ring.
            if self.next == known {
                self.next = (self.next + 1) % self.slots.len();
            }
            return known;
        }
        let index = self.next;
        self.next = (self.next + 1) % self.slots.len();
        let slot = &mut self.slots[index];
        slot.positions.clear();
        surface.positions(ring, vertices.start..vertices.end.min(len), &mut slot.positions);
        if vertices.end > len {
            match slot.positions.first() {
                Some(&first) if vertices.start == 0 => slot.positions.push(first),
                _ => surface.positions(ring, 0..1, &mut slot.positions),
            }
        }
        slot.ring = ring;
        slot.vertices = vertices;
        index
    }
}

/// Streams the faces as vertex numbers, in the order of the strips.
pub fn faces(
    surface: &dyn RingSurface,
    options: &Options,
    emit: &mut dyn FnMut([u64; 3]) -> io::Result<()>,
) -> io::Result<()> {
    let holes = Holes::new(options);
    let mut faces = Vec::new();
    for strip in 0..surface.num_strips() {
        let part = Part::new(surface, strip, 0, 1);
        let starts = part.rings.map(|ring| surface.ring_start(ring));
        let number = |side: usize, step: u64| starts[side] + step % part.lens[side];
        faces.clear();
        part.walk(&holes, |side, a, b| {
            let next = if side == 0 { number(0, a + 1) } else { number(1, b + 1) };
            faces.push([number(0, a), next, number(1, b)]);
        });
        faces.iter().try_for_each(|&face| emit(face))?;
    }
    Ok(())
}
