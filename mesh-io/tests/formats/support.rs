//! Small meshes and shorthands.

use std::io::Read;

use glam::Vec3;
use mesh_io::{
    Error, Format, IndexedMesh, Triangle, TriangleSource, read_mesh_from, source_from,
    write_mesh_to,
};

/// A tetrahedron with awkward coordinates, welded, and every vertex first used in order.
pub fn tetrahedron() -> IndexedMesh {
    IndexedMesh {
        positions: vec![
            Vec3::new(0.1, -0.2, 1e-7),
            Vec3::new(1.0 / 3.0, 16_777_216.0, -1e-30),
            Vec3::new(-3.5, 1e20, 7.0),
            Vec3::new(0.0, 4.0, f32::MIN_POSITIVE),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
        ..Default::default()
    }
}

pub fn bytes_of(mesh: &IndexedMesh, format: Format) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_mesh_to(&mut bytes, format, mesh).unwrap();
    bytes
}

pub fn read(bytes: impl AsRef<[u8]>, format: Format) -> Result<IndexedMesh, Error> {
    read_mesh_from(bytes.as_ref(), format, "test")
}

/// The message of an error that there must be.
pub fn refused(bytes: impl AsRef<[u8]>, format: Format) -> String {
    let bytes = bytes.as_ref();
    let message = read(bytes, format).expect_err("a broken file").to_string();
    let streamed = stream(bytes, format, 2).expect_err("a broken file").to_string();
    assert_eq!(message, streamed, "both ways in say the same");
    message
}

/// All triangles of a source, `max` at a time.
pub fn drain(source: &mut dyn TriangleSource, max: usize) -> Result<Vec<Triangle>, Error> {
    let mut all = Vec::new();
    loop {
        let before = all.len();
        let count = source.read(&mut all, max)?;
        assert_eq!(all.len(), before + count);
        assert!(count <= max);
        if count == 0 {
            return Ok(all);
        }
    }
}

pub fn stream(bytes: &[u8], format: Format, max: usize) -> Result<Vec<Triangle>, Error> {
    drain(&mut *source_from(bytes, format, "test")?, max)
}

pub fn bits(soup: &[Triangle]) -> Vec<[u32; 9]> {
    soup.iter()
        .map(|triangle| {
            let mut bits = [0; 9];
            let corners = triangle.iter().flat_map(|corner| corner.to_array());
            bits.iter_mut().zip(corners).for_each(|(bit, c)| *bit = c.to_bits());
            bits
        })
        .collect()
}

/// A reader that gives a few bytes at a time.
pub struct Dribble<'a>(pub &'a [u8], pub usize);

impl Read for Dribble<'_> {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let count = self.0.len().min(out.len()).min(self.1);
        out[..count].copy_from_slice(&self.0[..count]);
        self.0 = &self.0[count..];
        Ok(count)
    }
}
