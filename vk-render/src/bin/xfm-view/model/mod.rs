//! The model that is looked at: the one place that knows pager and front.
//!
//! Everything else in the viewer sees [`Model`], one call per frame, and the [`Numbers`] that come of it.

mod build;
mod numbers;
mod opening;
mod paint;

use std::path::{Path, PathBuf};
use std::time::Duration;

use glam::{DVec3, Vec3};
use mergetree::{Camera, FrontVertex};
use tempfile::TempDir;
use vk_render::{MeshBuffers, MeshUpdate, Uploaded, Vertex};
use xfm_pager::{Pager, PagerOptions, Session, SessionOptions};

pub(crate) use numbers::Numbers;
pub(crate) use opening::{Opened, Opening};
pub(crate) use paint::{Paint, paint_colours};
pub(crate) use xfm_pager::Detail;

use crate::error::Error;
use paint::Painted;

const _: () = assert!(size_of::<FrontVertex>() == size_of::<Vertex>());

/// Frames in which a vertex glides to its place.
const GLIDE_FRAMES: u32 = 8;

/// How a model is opened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Opener {
    pub(crate) pager: PagerOptions,
    pub(crate) session: SessionOptions,
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
    pub(crate) bounds: [Vec3; 2],
    /// Where the origin of all positions lies in the file's own frame.
    pub(crate) origin: DVec3,
    pub(crate) input_triangles: u64,
    /// Levels of the deepest tree.
    pub(crate) depth: u8,
    /// Where a mesh was built; gone with the model.
    _built: Option<TempDir>,
}

impl Model {
    /// Opens a hierarchy. Takes as long as it takes to read the coarsest mesh.
    fn open(
        source: &Path,
        file: &Path,
        built: Option<TempDir>,
        opener: &Opener,
    ) -> Result<Self, Error> {
        let pager = Pager::open(file, opener.pager)?;
        let header = pager.file().header();
        let (bounds, origin, input_triangles) =
            (header.bounds, header.origin, header.input_triangles);
        let depth = header.tree_depth.clamp(1, 255) as u8;
        let session = Session::with_options(pager, opener.session)?;
        let source = source.to_owned();
        let painted = Painted::default();
        Ok(Self { session, painted, source, bounds, origin, input_triangles, depth, _built: built })
    }

    /// Whether triangles are clockwise seen from outside.
    pub(crate) fn is_inside_out(&self) -> bool {
        self.session.is_inside_out()
    }

    /// Whether vertices have colours of their own.
    pub(crate) fn has_colours(&self) -> bool {
        !self.session.front().colours().is_empty()
    }

    /// Moves the detail towards what the camera needs.
    pub(crate) fn frame(&mut self, camera: &Camera, detail: Detail) -> Numbers {
        let stats = self.session.frame(camera, detail);
        Numbers::of(&stats, self.session.pager())
    }

    /// Moves the detail on until no more comes, or for so long.
    pub(crate) fn settle(&mut self, camera: &Camera, detail: Detail, most: Duration) -> Numbers {
        let stats = self.session.settle(camera, detail, most);
        Numbers::of(&stats, self.session.pager())
    }

    /// Tells how long the last frame took, for whoever holds a time.
    pub(crate) fn report_frame_time(&mut self, time: Duration) {
        self.session.report_frame_time(time);
    }

    /// Changes how much memory detail may take, in bytes.
    pub(crate) fn set_quotas(&mut self, [soft, hard]: [usize; 2]) {
        self.session.set_quotas(soft, hard);
    }

    /// Whether vertices glide to their places, instead of being there at once.
    pub(crate) fn set_gliding(&mut self, glides: bool) {
        let mut options = self.session.options();
        options.geomorph_frames = if glides { GLIDE_FRAMES } else { 0 };
        if options != self.session.options() {
            self.session.set_options(options);
        }
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
            colours: match paint {
                Paint::Own => self.session.front().colours(),
                _ => self.painted.colours(),
            },
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
