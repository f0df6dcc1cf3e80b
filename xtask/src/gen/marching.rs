//! Marching tetrahedra over a block of a grid, with its signs as one word of bits.
//!
//! Each cube is cut into six tetrahedra about its main diagonal (Kuhn's subdivision), which makes the
//! surface a closed manifold for any function that is positive at the border of the grid. An edge is
//! named by its lower end and one of seven directions.

/// Cubes along the edge of a block.
pub const CUBES: u64 = 4;
/// Points along the edge of a block, and of all.
const POINTS: usize = CUBES as usize + 1;
pub const NUM_POINTS: usize = POINTS * POINTS * POINTS;

/// Directions of edges; bit i of a direction, counted from 1, is its step along axis i.
const NUM_DIRECTIONS: usize = 7;

/// The corners of the six tetrahedra of a cube; bit i of a corner is its step along axis i.
const TETRAHEDRA: [[u8; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// The places within their block of the points, or of the cubes above them.
pub const PLACES: [[u64; 3]; NUM_POINTS] = {
    let (mut places, mut point) = ([[0; 3]; NUM_POINTS], 0);
    while point < NUM_POINTS {
        let place = [point % POINTS, point / POINTS % POINTS, point / (POINTS * POINTS)];
        places[point] = [place[0] as u64, place[1] as u64, place[2] as u64];
        point += 1;
    }
    places
};

/// The step from a cube's first point to a corner.
const fn offset(corner: usize) -> usize {
    (corner & 1) + (corner >> 1 & 1) * POINTS + (corner >> 2) * POINTS * POINTS
}

/// For each direction, the points that have a neighbour in the block.
const WITH_NEIGHBOUR: [u128; NUM_DIRECTIONS + 1] = {
    let mut masks = [0; NUM_DIRECTIONS + 1];
    let mut direction = 0;
    while direction <= NUM_DIRECTIONS {
        let mut point = 0;
        while point < NUM_POINTS {
            let [x, y, z] = PLACES[point];
            let step = [direction & 1, direction >> 1 & 1, direction >> 2];
            let [x, y, z] = [x + step[0] as u64, y + step[1] as u64, z + step[2] as u64];
            if x <= CUBES && y <= CUBES && z <= CUBES {
                masks[direction] |= 1 << point;
            }
            point += 1;
        }
        direction += 1;
    }
    masks
};

/// The places of the bits that are set, in order.
#[inline]
fn bits(mut word: u128) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then_some(word.trailing_zeros() as usize);
        word &= word.wrapping_sub(1);
        bit
    })
}

/// Which points of a block are inside: where the function is not positive.
#[derive(Debug, Clone, Copy)]
pub struct Inside(u128);

impl Inside {
    /// The signs of a block's values, x first.
    #[inline]
    pub fn new(values: &[f64; NUM_POINTS]) -> Self {
        let (rows, _) = values.as_chunks::<POINTS>();
        Self(rows.iter().rev().fold(0, |word, row| {
            let row = row.iter().rev().fold(0u32, |bits, v| bits << 1 | u32::from(*v <= 0.0));
            word << POINTS | u128::from(row)
        }))
    }

    /// The cubes that the surface cuts, by their first points, in order.
    #[inline]
    pub fn cut_cubes(self) -> impl Iterator<Item = Cube> {
        let corners = |combine: fn(u128, u128) -> u128| {
            (1..8).fold(self.0, |word, corner| combine(word, self.0 >> offset(corner)))
        };
        let (some, all) = (corners(|a, b| a | b), corners(|a, b| a & b));
        bits(some & !all & WITH_NEIGHBOUR[7]).map(move |point| {
            let word = self.0 >> point;
            let corner = |corner: usize| ((word >> offset(corner)) as usize & 1) << corner;
            Cube { point, mask: (0..8).fold(0, |mask, c| mask | corner(c)) }
        })
    }

    /// The edges that the surface crosses.
    #[inline]
    pub fn crossed_edges(self) -> impl Iterator<Item = Edge> {
        (1..=NUM_DIRECTIONS).flat_map(move |direction| {
            let crossed = (self.0 ^ self.0 >> offset(direction)) & WITH_NEIGHBOUR[direction];
            bits(crossed).map(move |point| Edge { point, direction })
        })
    }
}

/// A cube that the surface cuts.
#[derive(Debug, Clone, Copy)]
pub struct Cube {
    /// Its first point.
    pub point: usize,
    /// Which of its corners are inside.
    mask: usize,
}

/// An edge between two points of a block.
#[derive(Debug, Clone, Copy)]
pub struct Edge {
    /// The lower end.
    pub point: usize,
    direction: usize,
}

impl Edge {
    /// The step to the other end along each axis.
    #[inline]
    pub fn step(self) -> [u64; 3] {
        [0, 1, 2].map(|axis| (self.direction >> axis & 1) as u64)
    }

    /// The other end.
    #[inline]
    pub fn end(self) -> usize {
        self.point + offset(self.direction)
    }
}

/// What there is to know at each edge of a block.
#[derive(Debug)]
pub struct Edges<T>(Vec<T>);

impl<T: Copy> Edges<T> {
    pub fn new(value: T) -> Self {
        Self(vec![value; NUM_DIRECTIONS * NUM_POINTS])
    }

    #[inline]
    pub fn set(&mut self, edge: Edge, value: T) {
        self.0[(edge.direction - 1) * NUM_POINTS + edge.point] = value;
    }
}

/// The triangles of a cube by which of its corners are inside.
#[derive(Debug)]
pub struct Table {
    /// Each corner is the place in [`Edges`] of a cube's edge whose first point is the block's.
    triangles: Vec<[u16; 3]>,
    /// Where each mask's triangles begin.
    starts: [u16; 257],
}

impl Table {
    pub fn new() -> Self {
        let mut table = Self { triangles: Vec::new(), starts: [0; 257] };
        for mask in 0..256 {
            for corners in TETRAHEDRA {
                add_triangles(corners, mask, &mut table.triangles);
            }
            table.starts[mask + 1] = table.triangles.len() as u16;
        }
        table
    }

    /// The number of a cube's triangles.
    #[inline]
    pub fn num_triangles(&self, cube: Cube) -> u64 {
        u64::from(self.starts[cube.mask + 1] - self.starts[cube.mask])
    }

    /// A cube's triangles, as what is known at the edges that they have their corners on.
    #[inline]
    pub fn triangles<T: Copy>(&self, cube: Cube, edges: &Edges<T>) -> impl Iterator<Item = [T; 3]> {
        let [start, end] = [cube.mask, cube.mask + 1].map(|mask| self.starts[mask] as usize);
        self.triangles[start..end]
            .iter()
            .map(move |triangle| triangle.map(|edge| edges.0[edge as usize + cube.point]))
    }
}

/// Appends the triangles of a tetrahedron for a cube's corners that are inside.
fn add_triangles(corners: [u8; 4], mask: usize, triangles: &mut Vec<[u16; 3]>) {
    let (inside, outside): (Vec<usize>, Vec<usize>) =
        (0..4).partition(|&i| mask >> corners[i] & 1 == 1);
    let order: Vec<usize> = inside.iter().chain(&outside).copied().collect();
    let inversions =
        (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).filter(|&(i, j)| order[j] > order[i]);
    let odd = inversions.count() % 2 == 1;
    let edge = |a: usize, b: usize| {
        let [a, b] = [a, b].map(|i| usize::from(corners[order[i]]));
        // The corners of a tetrahedron ascend: the lower one's steps are among the other's.
        ((a ^ b) - 1) * NUM_POINTS + offset(a.min(b))
    };
    // Outward for an even order of the corners of a positively oriented tetrahedron.
    let found = match inside.len() {
        1 => vec![[edge(0, 1), edge(0, 2), edge(0, 3)]],
        2 => vec![[edge(0, 2), edge(0, 3), edge(1, 3)], [edge(0, 2), edge(1, 3), edge(1, 2)]],
        3 => vec![[edge(0, 3), edge(1, 3), edge(2, 3)]],
        _ => Vec::new(),
    };
    triangles.extend(found.iter().map(|&[a, b, c]| {
        let turned = if odd { [a, c, b] } else { [a, b, c] };
        turned.map(|edge| edge as u16)
    }));
}
