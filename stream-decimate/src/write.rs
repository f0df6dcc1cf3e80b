//! WRITE (Wu and Kobbelt 2003, §4.4): which triangles leave the buffer.

use std::collections::VecDeque;

use mesh_io::Triangle;

use crate::portion::{Portion, UNSURE, state};

/// Steps from the next vertex that waits for triangles; those nobody waits near are farthest away.
const UNREACHED: u32 = u32::MAX;

/// Takes triangles out of the buffer until no more than `left` are there, and appends them to `out`.
///
/// Those farthest from P_ab go first, ring by ring: so the rim P_bc of what has been written stays short, and what is
/// left lies beside the triangles still to come. Triangles at P_ab stay. The vertices of P_bc are frozen.
pub(crate) fn write(portion: &mut Portion, left: usize, out: &mut Vec<Triangle>) {
    let steps = steps_from_open(portion);
    let mut order: Vec<u32> = (0..portion.num_slots() as u32)
        .filter(|&v| portion.state(v) != state::FREE && steps[v as usize] > 1)
        .collect();
    order.sort_by_key(|&v| std::cmp::Reverse(steps[v as usize]));
    for v in order {
        if portion.num_triangles() <= left {
            break;
        }
        if portion.state(v) != state::FREE {
            write_star(portion, v, out);
        }
    }
}

/// Takes all triangles out of the buffer and appends them to `out`, in the order of memory.
pub(crate) fn write_all(portion: &mut Portion, out: &mut Vec<Triangle>) {
    for v in 0..portion.num_slots() as u32 {
        for (a, b) in portion.stars.fans(v).triangles() {
            if v < a && v < b {
                out.push([v, a, b].map(|x| portion.position(x)));
            }
        }
    }
}

/// Writes the triangles around a vertex, which goes with them.
fn write_star(portion: &mut Portion, v: u32, out: &mut Vec<Triangle>) {
    let fans = portion.stars.fans(v);
    let before = out.len();
    out.extend(fans.triangles().map(|(a, b)| [v, a, b].map(|x| portion.position(x))));
    let mut lonely = Vec::new();
    let mut rim = Vec::new();
    portion.stars.all().take_out(
        v,
        |x, has_triangles| {
            if has_triangles { rim.push(x) } else { lonely.push(x) }
        },
    );
    portion.remove_vertex(v);
    for x in lonely {
        portion.remove_vertex(x);
    }
    for &x in &rim {
        portion.set_state(x, state::FROZEN);
        portion.bounds[x as usize] = f32::INFINITY;
    }
    // What could be collapsed into a vertex at will costs more now that it is frozen.
    for x in rim {
        for y in portion.stars.fans(x).neighbours() {
            portion.flags[y as usize] |= UNSURE;
        }
    }
    portion.count_triangles(0, out.len() - before);
}

/// For each vertex, the number of edges to the next open one.
fn steps_from_open(portion: &Portion) -> Vec<u32> {
    let mut steps = vec![UNREACHED; portion.num_slots()];
    let mut queue: VecDeque<u32> =
        (0..portion.num_slots() as u32).filter(|&v| portion.state(v) == state::OPEN).collect();
    for &v in &queue {
        steps[v as usize] = 0;
    }
    while let Some(v) = queue.pop_front() {
        for x in portion.stars.fans(v).neighbours() {
            if steps[x as usize] == UNREACHED {
                steps[x as usize] = steps[v as usize] + 1;
                queue.push_back(x);
            }
        }
    }
    steps
}
