//! The device's copy of a mesh.

use crate::context::Context;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Layouts, Memory, MeshSet};
use crate::ranges::coalesce;
use crate::upload::Uploader;
use crate::vertex::Vertex;
use ash::vk;
use std::ops::Range;
use std::sync::Arc;

const VERTEX_BYTES: u64 = size_of::<Vertex>() as u64;
const COLOUR_BYTES: u64 = size_of::<[u8; 4]>() as u64;
const TRIANGLE_BYTES: u64 = size_of::<[u32; 3]>() as u64;
/// Changed ranges this close, in bytes, travel as one.
const GAP_BYTES: u64 = 256;
/// What an empty mesh has room for.
const LEAST: u32 = 1024;

/// What has changed since the last update. Both slices are the whole arrays as they are now; the ranges say which
/// elements differ from what was last given. What the arrays have gained at their ends counts as changed without saying.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeshUpdate<'a> {
    /// All vertices.
    pub vertices: &'a [Vertex],
    /// Changed vertices, in any order; they may overlap.
    pub vertex_ranges: &'a [Range<u32>],
    /// All triangles, as vertex indices, counter-clockwise seen from outside. A triangle whose corners are one vertex,
    /// such as `[0, 0, 0]`, is an empty slot and draws nothing.
    pub triangles: &'a [[u32; 3]],
    /// Changed triangles, in any order; they may overlap.
    pub triangle_ranges: &'a [Range<u32>],
    /// Of each vertex red, green, blue in sRGB and an opacity that is not looked at; none at all where the mesh has no
    /// colours.
    pub colours: &'a [[u8; 4]],
    /// Changed colours, in any order; they may overlap.
    pub colour_ranges: &'a [Range<u32>],
}

/// What an update cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uploaded {
    /// Bytes that travelled to the device.
    pub bytes: u64,
    /// Contiguous pieces they travelled in.
    pub pieces: u64,
    /// Whether a buffer had to be replaced by a larger one.
    pub grew: bool,
}

/// The device's copy of a mesh, kept up to date by its changes.
pub struct MeshBuffers {
    uploader: Uploader,
    vertices: Growing,
    triangles: Growing,
    colours: Growing,
    set: Arc<MeshSet>,
    layouts: Arc<Layouts>,
    context: Context,
    /// Whether the device has all that was given: not so after an error.
    intact: bool,
}

/// A buffer of elements that is replaced when it becomes too small.
struct Growing {
    what: &'static str,
    buffer: Arc<Buffer>,
    element_bytes: u64,
    /// Elements given so far.
    len: u32,
    usage: vk::BufferUsageFlags,
    limit_bytes: u64,
}

impl MeshBuffers {
    /// An empty mesh.
    ///
    /// # Errors
    /// [`OutOfMemory`](crate::Error::OutOfMemory).
    pub fn new(context: &Context) -> Result<Self> {
        Self::with_capacity(context, 0, 0)
    }

    /// An empty mesh with room for what is known to come.
    ///
    /// # Errors
    /// [`OutOfMemory`](crate::Error::OutOfMemory), [`MeshTooLarge`](crate::Error::MeshTooLarge).
    pub fn with_capacity(context: &Context, vertices: u32, triangles: u32) -> Result<Self> {
        let limits = &context.device.limits;
        let indexable = (u64::from(context.device.max_index) + 1) * VERTEX_BYTES;
        let storage = u64::from(limits.max_storage_buffer_range);
        let both = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_DST
            | vk::BufferUsageFlags::TRANSFER_SRC;
        let vertices = Growing::new(
            context,
            ("vertices", VERTEX_BYTES, both, storage.min(indexable)),
            vertices.max(LEAST),
        )?;
        let triangles = Growing::new(
            context,
            ("triangles", TRIANGLE_BYTES, both | vk::BufferUsageFlags::INDEX_BUFFER, storage),
            triangles.max(LEAST),
        )?;
        // Most meshes have none.
        let colours = Growing::new(context, ("colours", COLOUR_BYTES, both, storage), 1)?;
        let set = MeshSet::new(
            &context.layouts,
            Arc::clone(&vertices.buffer),
            Arc::clone(&triangles.buffer),
            Arc::clone(&colours.buffer),
        )?;
        Ok(Self {
            uploader: Uploader::new(&context.device)?,
            vertices,
            triangles,
            colours,
            set: Arc::new(set),
            layouts: Arc::clone(&context.layouts),
            context: context.clone(),
            intact: true,
        })
    }

    /// Sends the changes on their way. Pictures drawn before show the mesh as it was, pictures drawn after as it is;
    /// nothing is waited for, unless more than 8 MiB are on their way already.
    ///
    /// # Errors
    /// [`RangePastEnd`](Error::RangePastEnd), [`ColourCount`](Error::ColourCount) and
    /// [`MeshTooLarge`](Error::MeshTooLarge) change nothing. After any other error the next update that succeeds sends everything.
    ///
    /// # Complexity
    /// Time in the bytes changed (plus a sort of the ranges); growth copies the old content on the device, and doubles
    /// at most, so that it is rare.
    pub fn update(&mut self, changes: &MeshUpdate<'_>) -> Result<Uploaded> {
        let (num_colours, num_vertices) = (changes.colours.len(), changes.vertices.len());
        if num_colours != 0 && num_colours != num_vertices {
            return Err(Error::ColourCount { colours: num_colours, vertices: num_vertices });
        }
        let vertices =
            self.vertices.changed(changes.vertex_ranges, changes.vertices.len(), self.intact)?;
        let triangles = self.triangles.changed(
            changes.triangle_ranges,
            changes.triangles.len(),
            self.intact,
        )?;
        let colours = self.colours.changed(changes.colour_ranges, num_colours, self.intact)?;
        self.intact = false;
        let result = self.send(changes, [&vertices, &triangles, &colours]);
        match result {
            Ok(_) => self.intact = true,
            Err(_) => self.uploader.discard(),
        }
        result
    }

    fn send(
        &mut self,
        changes: &MeshUpdate<'_>,
        [vertices, triangles, colours]: [&[Range<u32>]; 3],
    ) -> Result<Uploaded> {
        let grew = [
            self.vertices.fit(&self.context, &mut self.uploader, changes.vertices.len())?,
            self.triangles.fit(&self.context, &mut self.uploader, changes.triangles.len())?,
            self.colours.fit(&self.context, &mut self.uploader, changes.colours.len())?,
        ]
        .contains(&true);
        // Not only where something grew just now: an error may have come between that and this.
        let bound = Arc::ptr_eq(&self.set.vertices, &self.vertices.buffer)
            && Arc::ptr_eq(&self.set.triangles, &self.triangles.buffer)
            && Arc::ptr_eq(&self.set.colours, &self.colours.buffer);
        if !bound {
            self.set = Arc::new(MeshSet::new(
                &self.layouts,
                Arc::clone(&self.vertices.buffer),
                Arc::clone(&self.triangles.buffer),
                Arc::clone(&self.colours.buffer),
            )?);
        }
        let mut sent = Uploaded { grew, ..Uploaded::default() };
        let uploader = &mut self.uploader;
        self.vertices.send(
            uploader,
            bytemuck::cast_slice(changes.vertices),
            vertices,
            &mut sent,
        )?;
        self.triangles.send(
            uploader,
            bytemuck::cast_slice(changes.triangles),
            triangles,
            &mut sent,
        )?;
        self.colours.send(uploader, changes.colours.as_flattened(), colours, &mut sent)?;
        self.uploader.submit()?;
        // `changed` has seen that both fit.
        self.vertices.len = changes.vertices.len() as u32;
        self.triangles.len = changes.triangles.len() as u32;
        self.colours.len = changes.colours.len() as u32;
        Ok(sent)
    }

    /// Vertices as of the last update.
    pub fn num_vertices(&self) -> u32 {
        self.vertices.len
    }

    /// Triangles as of the last update, empty slots included.
    pub fn num_triangles(&self) -> u32 {
        self.triangles.len
    }

    /// Whether the last update gave colours.
    pub fn has_colours(&self) -> bool {
        self.colours.len > 0
    }

    /// Device memory that the mesh takes, room to grow included.
    ///
    /// # Units
    /// Bytes.
    pub fn capacity_bytes(&self) -> u64 {
        self.vertices.buffer.size() + self.triangles.buffer.size() + self.colours.buffer.size()
    }

    pub(crate) fn set(&self) -> &Arc<MeshSet> {
        &self.set
    }

    pub(crate) fn is_of(&self, context: &Context) -> bool {
        Arc::ptr_eq(&self.context.device, &context.device)
    }
}

impl std::fmt::Debug for MeshBuffers {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("MeshBuffers")
            .field("num_vertices", &self.num_vertices())
            .field("num_triangles", &self.num_triangles())
            .field("capacity_bytes", &self.capacity_bytes())
            .finish_non_exhaustive()
    }
}

impl Growing {
    fn new(
        context: &Context,
        (what, element_bytes, usage, limit_bytes): (&'static str, u64, vk::BufferUsageFlags, u64),
        capacity: u32,
    ) -> Result<Self> {
        let bytes = u64::from(capacity) * element_bytes;
        if bytes > limit_bytes {
            return Err(Error::MeshTooLarge { what, bytes, limit: limit_bytes });
        }
        let buffer = Buffer::new(&context.device, what, bytes, usage, Memory::Device)?;
        Ok(Self { what, buffer: Arc::new(buffer), element_bytes, len: 0, usage, limit_bytes })
    }

    /// The ranges that have to travel for the array to be as it is now.
    fn changed(&self, ranges: &[Range<u32>], len: usize, intact: bool) -> Result<Vec<Range<u32>>> {
        let bytes = len as u64 * self.element_bytes;
        let too_large = Error::MeshTooLarge { what: self.what, bytes, limit: self.limit_bytes };
        let Some(end) = u32::try_from(len).ok().filter(|_| bytes <= self.limit_bytes) else {
            return Err(too_large);
        };
        let known = if intact { self.len.min(end) } else { 0 };
        let gap = (GAP_BYTES / self.element_bytes) as u32;
        coalesce(self.what, ranges.iter().cloned().chain(std::iter::once(known..end)), len, gap)
    }

    /// Makes room for `len` elements; whether that took another buffer.
    fn fit(&mut self, context: &Context, uploader: &mut Uploader, len: usize) -> Result<bool> {
        let needed = len as u64 * self.element_bytes;
        if needed <= self.buffer.size() {
            return Ok(false);
        }
        let roomy = needed.max(self.buffer.size() * 2).min(self.limit_bytes);
        let make =
            |bytes| Buffer::new(&context.device, self.what, bytes, self.usage, Memory::Device);
        // Where memory is short, what is needed will do.
        let larger = match make(roomy) {
            Err(Error::OutOfMemory { .. }) if needed < roomy => make(needed)?,
            other => other?,
        };
        let larger = Arc::new(larger);
        uploader.carry_over(&self.buffer, &larger, u64::from(self.len) * self.element_bytes)?;
        self.buffer = larger;
        Ok(true)
    }

    fn send(
        &self,
        uploader: &mut Uploader,
        bytes: &[u8],
        ranges: &[Range<u32>],
        sent: &mut Uploaded,
    ) -> Result<()> {
        let size = self.element_bytes as usize;
        let pieces = ranges.iter().map(|range| {
            let from = range.start as usize * size;
            (from as u64, &bytes[from..range.end as usize * size])
        });
        sent.pieces += ranges.len() as u64;
        sent.bytes += pieces.clone().map(|(_, piece)| piece.len() as u64).sum::<u64>();
        uploader.upload(&self.buffer, pieces)
    }
}
