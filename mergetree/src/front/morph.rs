//! Geomorphing: a split moves its vertex from where it came out to its place over some frames, and a collapse back before
//! it is done, so that nothing pops.

use crate::front::FrontVertex;
use crate::front::mesh::ActiveMesh;
use crate::{OctNormal, SlotId};

const STILL: u32 = u32::MAX;

/// A vertex on its way.
#[derive(Clone, Copy, Debug)]
struct Moving {
    slot: SlotId,
    /// Frames it has moved away from the vertex it came out of.
    step: u32,
    /// Whether it is on its way back.
    back: bool,
    /// Where it goes.
    place: FrontVertex,
}

/// All vertices on their way.
#[derive(Clone, Debug, Default)]
pub(crate) struct Morphs {
    /// How many frames a way takes; 0 to pop.
    frames: u32,
    moving: Vec<Moving>,
    /// Per slot its place in `moving`, or [`STILL`].
    index: Vec<u32>,
}

impl Morphs {
    pub(crate) fn set_frames(&mut self, mesh: &mut ActiveMesh, frames: u32) {
        self.frames = frames;
        if frames == 0 {
            for moving in std::mem::take(&mut self.moving) {
                mesh.set_vertex(moving.slot, moving.place);
                self.index[moving.slot.index()] = STILL;
            }
        }
    }

    pub(crate) fn num_moving(&self) -> usize {
        self.moving.len()
    }

    fn find(&self, slot: SlotId) -> Option<usize> {
        let at = self.index.get(slot.index()).copied().unwrap_or(STILL);
        (at != STILL).then_some(at as usize)
    }

    fn insert(&mut self, moving: Moving) {
        let slot = moving.slot.index();
        if self.index.len() <= slot {
            self.index.resize(slot + 1, STILL);
        }
        self.index[slot] = self.moving.len() as u32;
        self.moving.push(moving);
    }

    fn remove(&mut self, at: usize) -> Moving {
        let gone = self.moving.swap_remove(at);
        self.index[gone.slot.index()] = STILL;
        if let Some(moved) = self.moving.get(at) {
            self.index[moved.slot.index()] = at as u32;
        }
        gone
    }

    /// Sets the vertex of a slot that was just split on its way.
    pub(crate) fn begin(&mut self, mesh: &mut ActiveMesh, slot: SlotId) {
        if self.frames == 0 {
            return;
        }
        let moving = Moving { slot, step: 0, back: false, place: mesh.vertex(slot) };
        show(mesh, &moving, self.frames);
        self.insert(moving);
    }

    /// Whether a node may be collapsed now without a pop; if not, its vertex is on its way back from now on.
    pub(crate) fn is_back(&mut self, mesh: &ActiveMesh, slot: SlotId) -> bool {
        if self.frames == 0 {
            return true;
        }
        match self.find(slot) {
            Some(at) => {
                self.moving[at].back = true;
                self.moving[at].step == 0
            }
            None => {
                let place = mesh.vertex(slot);
                self.insert(Moving { slot, step: self.frames, back: true, place });
                false
            }
        }
    }

    /// Forgets the vertex of a slot that was collapsed.
    pub(crate) fn end(&mut self, slot: SlotId) {
        if let Some(at) = self.find(slot) {
            self.remove(at);
        }
    }

    /// Moves all vertices by a frame. Those for whose slot `stays` holds turn round if they were on their way back.
    pub(crate) fn advance(&mut self, mesh: &mut ActiveMesh, stays: impl Fn(SlotId) -> bool) {
        let mut at = 0;
        while at < self.moving.len() {
            let moving = &mut self.moving[at];
            moving.back &= !stays(moving.slot);
            moving.step = if moving.back {
                moving.step.saturating_sub(1)
            } else {
                (moving.step + 1).min(self.frames)
            };
            show(mesh, moving, self.frames);
            if moving.step == self.frames && !moving.back {
                self.remove(at);
            } else {
                at += 1;
            }
        }
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.moving.capacity() * size_of::<Moving>() + self.index.capacity() * size_of::<u32>()
    }
}

/// Puts a vertex where it is on its way.
fn show(mesh: &mut ActiveMesh, moving: &Moving, frames: u32) {
    let vertex = if moving.step >= frames {
        moving.place
    } else {
        let from = mesh.vertices[mesh.kept(moving.slot) as usize];
        let share = moving.step as f32 / frames as f32;
        let normal = from.normal.to_vec3().lerp(moving.place.normal.to_vec3(), share);
        FrontVertex {
            position: from.position.lerp(moving.place.position, share),
            normal: OctNormal::new(normal),
            level: moving.place.level,
        }
    };
    mesh.set_vertex(moving.slot, vertex);
}
