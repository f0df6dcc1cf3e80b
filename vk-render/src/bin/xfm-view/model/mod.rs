//! The model that is looked at: the one place that knows pager and front.
//!
//! Everything else in the viewer sees [`Model`], one call per frame, and the [`Numbers`] that come of it.

mod build;
mod numbers;
mod opening;
mod paint;

use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use mergetree::{Camera, Dependencies, FrontVertex};
use tempfile::TempDir;
use vk_render::{MeshBuffers, MeshUpdate, Uploaded, Vertex};
use xfm_pager::{Pager, PagerOptions, Session};

pub(crate) use numbers::Numbers;
pub(crate) use opening::{Opened, Opening};
pub(crate) use paint::{Paint, paint_colours};
pub(crate) use xfm_pager::Detail;

use crate::error::Error;
use paint::Painted;

const _: () = assert!(size_of::<FrontVertex>() == size_of::<Vertex>());

/// How a model is opened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Opener {
    pub(crate) pager: PagerOptions,
    pub(crate) dependencies: Dependencies,
    pub(crate) cache: build::Cache,
}

pub(crate) use build::Cache;

/// A model ready to be looked at.
#[derive(Debug)]
pub(crate) struct Model {
    session: Session,
    painted: Painted,
    /// The file that was asked for.
    pub(crate) source: PathBuf,
    /// The hierarchy: that file, or one built of it.
    file: PathBuf,
    pub(crate) bounds: [Vec3; 2],
    /// Where the origin of all positions lies in the file's own frame.
    pub(crate) origin: DVec3,
    pub(crate) input_triangles: u64,
    /// Levels of the deepest tree.
    pub(crate) depth: u8,
    /// Where a mesh was built; gone with the last model that uses it.
    built: Option<std::sync::Arc<TempDir>>,
}

impl Model {
    /// Opens a hierarchy. Takes as long as it takes to read the coarsest mesh.
    fn open(
        source: &Path,
        file: PathBuf,
        built: Option<std::sync::Arc<TempDir>>,
        opener: &Opener,
    ) -> Result<Self, Error> {
        let pager = Pager::open(&file, opener.pager)?;
        let header = pager.file().header();
        let (bounds, origin, input_triangles) =
            (header.bounds, header.origin, header.input_triangles);
        let depth = header.tree_depth.clamp(1, 255) as u8;
        let session = Session::new(pager, opener.dependencies)?;
        let source = source.to_owned();
        let painted = Painted::default();
        Ok(Self { session, painted, source, file, bounds, origin, input_triangles, depth, built })
    }

    /// Whether triangles are clockwise seen from outside.
    pub(crate) fn is_inside_out(&self) -> bool {
        self.session.is_inside_out()
    }

    /// Whether vertices have colours of their own.
    pub(crate) fn has_colours(&self) -> bool {
        // No file has any so far.
        false
    }

    /// Moves the detail towards what the camera needs.
    pub(crate) fn frame(&mut self, camera: &Camera, detail: Detail) -> Numbers {
        let stats = self.session.frame(camera, detail);
        Numbers::of(&stats, self.session.pager())
    }

    /// Sends what changed to the device, with the colours that `paint` asks for.
    pub(crate) fn upload(
        &mut self,
        mesh: &mut MeshBuffers,
        paint: Paint,
    ) -> Result<Uploaded, Error> {
        let changes = self.session.take_changes();
        let colours = self.painted.update(&self.session, paint, &changes);
        Ok(mesh.update(&MeshUpdate {
            // The same twenty bytes under another name.
            vertices: bytemuck::cast_slice(self.session.vertices()),
            vertex_ranges: &changes.vertices,
            triangles: self.session.triangles(),
            triangle_ranges: &changes.triangles,
            colours: self.painted.colours(),
            colour_ranges: &colours,
        })?)
    }

    /// The triangles that are drawn, with the positions they refer to; `[0, 0, 0]` is none.
    pub(crate) fn surface(&self) -> (impl Fn(u32) -> Option<Vec3> + '_, &[[u32; 3]]) {
        let vertices = self.session.vertices();
        (|v| vertices.get(v as usize).map(|v| v.position), self.session.triangles())
    }

    /// What could not be read of the file, in words, each once.
    pub(crate) fn problems(&self) -> impl Iterator<Item = String> + '_ {
        let problems = self.session.pager().problems().iter();
        problems.map(|p| format!("{}: its detail is not shown", crate::error::one_line(&p.error)))
    }
}

/// Half of the diagonal of a box; never 0.
pub(crate) fn radius([min, max]: [Vec3; 2]) -> f32 {
    (0.5 * (max - min).length()).max(f32::MIN_POSITIVE)
}
