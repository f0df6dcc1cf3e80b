//! The finest mesh, as it is handed out.

use std::io;

use glam::Vec3;
use mesh_io::{Colour, IndexedSource, Take, TakeVertices, Triangle};
use scratch::{Scratch, Table, TableOptions};
use xfm_format::XfmFile;

use super::links::each_page;
use super::{Corner, damaged};
use crate::{Error, interrupt};

/// Items handed out at once.
const BATCH: usize = 1 << 14;

/// The finest mesh of a file, in tables most of which are in scratch files.
///
/// Vertices come in the order of the file, those of the coarsest mesh first; triangles too.
#[derive(Debug)]
pub struct FullMesh<'a> {
    file: &'a XfmFile,
    scratch: Scratch,
    table: Table<Corner>,
    /// Vertices of the coarsest mesh that have faces.
    base_vertices: Vec<u32>,
    /// For positions by number, where they are needed.
    by_number: TableOptions,
    scratch_bytes: u64,
}

impl<'a> FullMesh<'a> {
    pub(super) fn new(
        file: &'a XfmFile,
        scratch: &Scratch,
        table: Table<Corner>,
        base_vertices: Vec<u32>,
        by_number: TableOptions,
        scratch_bytes: u64,
    ) -> Self {
        Self { file, scratch: scratch.clone(), table, base_vertices, by_number, scratch_bytes }
    }

    /// Scratch space that was taken so far at most, in bytes.
    pub fn scratch_bytes(&self) -> u64 {
        self.scratch_bytes
    }

    /// Hands out all triangles by their vertices.
    ///
    /// # Errors
    ///
    /// Those of `take`, unreadable scratch files, a file that contradicts itself, and Ctrl-C.
    pub fn triangles<E: From<Error>>(
        &mut self,
        mut take: impl FnMut(&[[u32; 3]]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut batch = Vec::with_capacity(BATCH);
        let mut found = 0_u64;
        // Faces have three half-edges with names that follow each other, in the coarsest mesh and in nodes.
        for first in (0..self.table.len()).step_by(3) {
            if let Some(triangle) = self.face(first)? {
                batch.push(triangle);
                found += 1;
            }
            if batch.len() == BATCH {
                interrupt::check()?;
                take(&batch)?;
                batch.clear();
            }
        }
        if found != self.file.header().input_triangles {
            return Err(damaged(self.file).into());
        }
        if batch.is_empty() { Ok(()) } else { take(&batch) }
    }

    fn face(&mut self, first: u64) -> Result<Option<[u32; 3]>, Error> {
        let mut triangle = [0; 3];
        for (vertex, name) in triangle.iter_mut().zip(first..) {
            let corner = self.table.get(name)?;
            if !corner.is_there() {
                return Ok(None);
            }
            *vertex = corner.vertex().ok_or_else(|| damaged(self.file))?;
        }
        Ok(Some(triangle))
    }

    /// Hands out all positions.
    ///
    /// # Errors
    ///
    /// Those of `take`, a file that cannot be read, and Ctrl-C.
    pub fn positions<E: From<Error>>(
        &self,
        mut take: impl FnMut(&[Vec3]) -> Result<(), E>,
    ) -> Result<(), E> {
        self.vertices(|positions, _| take(positions))
    }

    /// Hands out all positions with their colours, if the file has some.
    ///
    /// # Errors
    ///
    /// As [`positions`](Self::positions).
    pub fn vertices<E: From<Error>>(
        &self,
        mut take: impl FnMut(&[Vec3], &[Colour]) -> Result<(), E>,
    ) -> Result<(), E> {
        let base = self.file.base();
        let mut batch = Vec::with_capacity(BATCH);
        let mut colours = Vec::new();
        for vertices in self.base_vertices.chunks(BATCH) {
            batch.clear();
            batch.extend(vertices.iter().map(|&v| base.vertices[v as usize].position));
            colours.clear();
            colours.extend(vertices.iter().filter_map(|&v| base.colours.get(v as usize)));
            take(&batch, &colours)?;
        }
        // An error of `take` is not one of the file.
        let mut refused = None;
        let read = each_page(self.file, 0..self.file.num_pages(), |page| {
            batch.clear();
            batch.extend(page.nodes().iter().map(|node| node.position));
            take(&batch, page.colours()).map_err(|error| {
                refused = Some(error);
                Error::Interrupted
            })
        });
        match refused {
            Some(error) => Err(error),
            None => Ok(read?),
        }
    }

    /// Hands out all triangles by the positions of their corners.
    ///
    /// # Errors
    ///
    /// As [`triangles`](Self::triangles), and scratch files that cannot be written.
    pub fn corners<E: From<Error>>(
        &mut self,
        mut take: impl FnMut(&[Triangle]) -> Result<(), E>,
    ) -> Result<(), E> {
        let count = self.num_vertices();
        let mut table: Table<[f32; 3]> = Table::new(&self.scratch, count, &self.by_number);
        let mut number = 0;
        self.positions(|positions| -> Result<(), Error> {
            for position in positions {
                *table.get_mut(number)? = position.to_array();
                number += 1;
            }
            Ok(())
        })?;
        let mut batch = Vec::with_capacity(BATCH);
        self.triangles(|triangles| -> Result<(), E> {
            batch.clear();
            for triangle in triangles {
                let mut corners = [Vec3::ZERO; 3];
                for (corner, &vertex) in corners.iter_mut().zip(triangle) {
                    *corner = table.get(vertex.into()).map_err(Error::from)?.into();
                }
                batch.push(corners);
            }
            take(&batch)
        })?;
        self.scratch_bytes += table.peak_file_bytes();
        Ok(())
    }
}

/// An error of ours, in the terms of who writes meshes.
#[derive(Debug)]
struct Unwritten(mesh_io::Error);

impl From<Error> for Unwritten {
    fn from(error: Error) -> Self {
        let name = "the finest mesh".to_owned();
        Self(mesh_io::Error::Io { name, action: "find", source: io::Error::other(error) })
    }
}

impl IndexedSource for FullMesh<'_> {
    fn num_vertices(&self) -> u64 {
        self.base_vertices.len() as u64 + self.file.header().nodes
    }

    fn num_triangles(&self) -> u64 {
        self.file.header().input_triangles
    }

    fn each_position(&mut self, take: &mut Take<'_, Vec3>) -> Result<(), mesh_io::Error> {
        self.positions(|positions| take(positions).map_err(Unwritten)).map_err(|error| error.0)
    }

    fn has_colours(&self) -> bool {
        self.file.header().has_colour()
    }

    fn each_vertex(&mut self, take: &mut TakeVertices<'_>) -> Result<(), mesh_io::Error> {
        self.vertices(|positions, colours| take(positions, colours).map_err(Unwritten))
            .map_err(|error| error.0)
    }

    fn each_triangle(&mut self, take: &mut Take<'_, [u32; 3]>) -> Result<(), mesh_io::Error> {
        self.triangles(|triangles| take(triangles).map_err(Unwritten)).map_err(|error| error.0)
    }

    fn each_corners(&mut self, take: &mut Take<'_, Triangle>) -> Result<(), mesh_io::Error> {
        self.corners(|corners| take(corners).map_err(Unwritten)).map_err(|error| error.0)
    }
}
