//! A figure on a ring, with arms and a handle, as a distance function: parts that blend where they meet.

/// Two parts' distances blend where they differ by less than this.
const WIDTH: f64 = 0.06;
/// Number of the figure's parts.
const NUM_PARTS: usize = 6;

/// A set of the figure's parts.
#[derive(Debug, Clone, Copy)]
pub struct Parts(u8);

impl Parts {
    pub const ALL: Self = Self((1 << NUM_PARTS) - 1);

    #[inline]
    fn iter(self) -> impl Iterator<Item = usize> {
        (0..NUM_PARTS).filter(move |part| self.0 >> part & 1 == 1)
    }
}

#[inline]
fn length(p: [f64; 3]) -> f64 {
    (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt()
}

// Comparisons, because `f64::min` and `max`, which mind NaN, take several instructions each.
#[inline]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline]
fn capsule(p: [f64; 3], a: [f64; 3], b: [f64; 3], radius: f64) -> f64 {
    let [pa, ba] = [[0, 1, 2].map(|i| p[i] - a[i]), [0, 1, 2].map(|i| b[i] - a[i])];
    let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    let along = lesser(greater(dot(pa, ba) / dot(ba, ba), 0.0), 1.0);
    length([0, 1, 2].map(|i| pa[i] - along * ba[i])) - radius
}

/// A torus about the axis that `p` has as its third coordinate.
#[inline]
fn torus(p: [f64; 3], major: f64, minor: f64) -> f64 {
    let ring = (p[0] * p[0] + p[1] * p[1]).sqrt() - major;
    (ring * ring + p[2] * p[2]).sqrt() - minor
}

/// The lesser of both, rounded where they meet; its gradient is no longer than theirs.
#[inline]
fn smooth_min(a: f64, b: f64) -> f64 {
    let h = greater(WIDTH - (a - b).abs(), 0.0) / WIDTH;
    lesser(a, b) - h * h * WIDTH * 0.25
}

/// Places along x, y and z.
pub type Points<const N: usize> = [[f64; N]; 3];

/// The distances to one part.
fn part<const N: usize>(points: &Points<N>, part: usize) -> [f64; N] {
    fn each<const N: usize>([x, y, z]: &Points<N>, distance: impl Fn([f64; 3]) -> f64) -> [f64; N] {
        let mut distances = [0.0; N];
        for (i, out) in distances.iter_mut().enumerate() {
            *out = distance([x[i], y[i], z[i]]);
        }
        distances
    }
    // A loop of its own for each part, so that each can be vectorised.
    match part {
        0 => each(points, |p| capsule(p, [0.0, 0.0, -1.0], [0.0, 0.0, 0.45], 0.36)),
        1 => each(points, |[x, y, z]| length([x - 0.05, y, z - 1.05]) - 0.3),
        2 => each(points, |p| capsule(p, [0.0, 0.3, 0.45], [0.35, 0.72, -0.1], 0.13)),
        3 => each(points, |p| capsule(p, [0.0, -0.3, 0.45], [0.3, -0.7, 0.7], 0.13)),
        4 => each(points, |[x, y, z]| torus([x, y, z + 1.15], 0.5, 0.2)),
        _ => each(points, |[x, y, z]| torus([x + 0.45, z - 0.05, y], 0.3, 0.09)),
    }
}

/// The distances to some parts together; where these blend, less than to the nearest.
pub fn figure<const N: usize>(points: &Points<N>, parts: Parts) -> [f64; N] {
    let mut parts = parts.iter();
    let mut distances = parts.next().map_or([f64::INFINITY; N], |first| part(points, first));
    for next in parts {
        for (distance, other) in distances.iter_mut().zip(part(points, next)) {
            *distance = smooth_min(*distance, other);
        }
    }
    distances
}

/// The distance to some parts at `center`, and those of them that have an influence, to the last bit,
/// on the sign of the distance and its value near zero anywhere within `reach`.
pub fn figure_around(center: [f64; 3], reach: f64, parts: Parts) -> (f64, Parts) {
    let point = center.map(|c| [c]);
    let (mut distance, mut distances) = (f64::INFINITY, [f64::INFINITY; NUM_PARTS]);
    for i in parts.iter() {
        let [one] = part(&point, i);
        distance = if distance.is_finite() { smooth_min(distance, one) } else { one };
        distances[i] = one;
    }
    // Blending lowers a distance by at most a quarter of the width per part.
    let nearest = distances.iter().fold(f64::INFINITY, |d, &one| d.min(one));
    let limit = nearest + 2.0 * reach + WIDTH * (1.0 + 0.25 * NUM_PARTS as f64);
    let near = parts.iter().filter(|&i| distances[i] <= limit);
    (distance, Parts(near.fold(0, |mask, i| mask | 1 << i)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_are_left_out_do_not_matter() {
        let grid = |i: usize| [i % 23, i / 23 % 23, i / 529].map(|c| c as f64 * 0.15 - 1.65);
        let mut left_out = 0;
        for center in (0..23 * 23 * 23).map(grid) {
            let (distance, near) = figure_around(center, 0.2, Parts::ALL);
            assert_eq!([distance], figure(&center.map(|c| [c]), Parts::ALL));
            left_out += NUM_PARTS - near.iter().count();
            for offset in [[0.11, -0.11, 0.11], [-0.2, 0.0, 0.0], [0.0, 0.1, -0.17]] {
                let point = [0, 1, 2].map(|axis| [center[axis] + offset[axis]]);
                assert_eq!(figure(&point, near), figure(&point, Parts::ALL));
            }
        }
        assert!(left_out > 23 * 23 * 23, "hardly anything was left out");
    }
}
