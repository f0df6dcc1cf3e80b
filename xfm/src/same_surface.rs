//! Whether two meshes have the same triangles, bit for bit, whatever their order.

use std::cmp::Ordering;

use glam::Vec3;
use rayon::prelude::*;

/// A triangle by the bits of its coordinates, beginning with its least corner; orientation is kept. Minus zero is zero, as
/// it is where vertices are welded.
type Key = [[u32; 3]; 3];

/// How the triangles of two meshes differ, as sets in which a triangle may occur more than once.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Difference {
    /// Triangles of the first mesh that the second does not have.
    pub missing: u64,
    /// Triangles of the second mesh that the first does not have, or not so often.
    pub extra: u64,
    /// Triangles of the first mesh that the second has, but not so often.
    pub repeated: u64,
    /// A corner of one of those, if there is one.
    pub near: Option<[f32; 3]>,
}

/// Compares two meshes.
///
/// # Complexity
///
/// O(n log n) time, 72 bytes per pair of triangles.
///
/// # Panics
///
/// If an index is out of range.
pub fn difference(
    (a_positions, a_triangles): (&[Vec3], &[[u32; 3]]),
    (b_positions, b_triangles): (&[Vec3], &[[u32; 3]]),
) -> Difference {
    let (a, b) = rayon::join(
        || sorted_keys(a_positions, a_triangles),
        || sorted_keys(b_positions, b_triangles),
    );
    let mut found = Difference::default();
    let (mut a, mut b) = (a.iter().peekable(), b.iter().peekable());
    let mut in_both = None;
    loop {
        let order = match (a.peek(), b.peek()) {
            (None, None) => return found,
            (Some(_), None) => Ordering::Less,
            (None, Some(_)) => Ordering::Greater,
            (Some(a), Some(b)) => a.cmp(b),
        };
        let odd = match order {
            Ordering::Equal => {
                in_both = a.next();
                b.next();
                None
            }
            Ordering::Less if a.peek().copied() == in_both => {
                found.repeated += 1;
                a.next();
                None
            }
            Ordering::Less => {
                found.missing += 1;
                a.next()
            }
            Ordering::Greater => {
                found.extra += 1;
                b.next()
            }
        };
        if let Some([corner, ..]) = odd {
            found.near.get_or_insert(corner.map(f32::from_bits));
        }
    }
}

fn sorted_keys(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Key> {
    let mut keys: Vec<Key> = triangles
        .par_iter()
        .map(|triangle| {
            // Adding zero makes zero of minus zero and changes nothing else.
            let bits = |v: u32| (positions[v as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
            let [a, b, c] = triangle.map(bits);
            // All three beginnings; the least of them is the same for the same triangle.
            [a, b, c].min([b, c, a]).min([c, a, b])
        })
        .collect();
    keys.par_sort_unstable();
    keys
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [Vec3; 4] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];

    #[test]
    fn order_and_numbering_do_not_matter_but_orientation_does() {
        let same = difference(
            (&SQUARE, &[[0, 1, 2], [0, 2, 3]]),
            (&[Vec3::Y, Vec3::X, SQUARE[2], Vec3::ZERO], &[[0, 3, 2], [1, 2, 3]]),
        );
        assert_eq!(same, Difference::default());
        let turned = difference((&SQUARE, &[[0, 1, 2]]), (&SQUARE, &[[0, 2, 1]]));
        assert_eq!((turned.missing, turned.extra), (1, 1));
    }

    #[test]
    fn the_sign_of_zero_does_not_matter() {
        let minus = [Vec3::new(-0.0, 0.0, -0.0), SQUARE[1], SQUARE[2]];
        let found = difference((&SQUARE, &[[0, 1, 2]]), (&minus, &[[0, 1, 2]]));
        assert_eq!(found, Difference::default());
    }

    #[test]
    fn repetitions_and_single_bits_count() {
        let twice = difference((&SQUARE, &[[0, 1, 2], [1, 2, 0]]), (&SQUARE, &[[0, 1, 2]]));
        assert_eq!((twice.missing, twice.extra, twice.repeated), (0, 0, 1));
        let twice = difference((&SQUARE, &[[0, 1, 2]]), (&SQUARE, &[[0, 1, 2], [1, 2, 0]]));
        assert_eq!((twice.missing, twice.extra, twice.repeated), (0, 1, 0));
        let mut moved = SQUARE;
        moved[2].x = moved[2].x.next_up();
        let found =
            difference((&SQUARE, &[[0, 1, 3], [0, 1, 2]]), (&moved, &[[0, 1, 3], [0, 1, 2]]));
        assert_eq!((found.missing, found.extra), (1, 1));
        assert!(found.near.is_some());
    }
}
