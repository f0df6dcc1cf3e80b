//! Files appear whole or not at all.

use std::io::{self, Write};

use mesh_io::{
    Error, Format, IndexedMesh, ReadOptions, create_sink, read_mesh, read_mesh_with, sink_to,
    write_mesh, write_mesh_to,
};

use crate::support::{bytes_of, tetrahedron};

/// Takes `0` bytes and then fails.
struct Full(usize);

impl Write for Full {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.0 == 0 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        let count = bytes.len().min(self.0);
        self.0 -= count;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn files_in(folder: &std::path::Path) -> usize {
    std::fs::read_dir(folder).unwrap().count()
}

#[test]
fn a_full_disk_is_an_error_wherever_it_strikes() {
    let mesh = tetrahedron();
    for format in Format::ALL {
        let length = bytes_of(&mesh, format).len();
        for room in 0..length {
            let result = write_mesh_to(Full(room), format, &mesh);
            assert!(matches!(result, Err(Error::Io { .. })), "{format:?} {room}");
            let streamed = sink_to(Full(room), format).and_then(|mut sink| {
                sink.write(&mesh.to_soup())?;
                sink.finish()
            });
            assert!(matches!(streamed, Err(Error::Io { .. })), "{format:?} {room}");
        }
        write_mesh_to(Full(length), format, &mesh).unwrap();
    }
}

#[test]
fn nothing_is_left_of_a_writer_that_failed_or_was_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let mut bad = tetrahedron();
    bad.triangles.push([0, 1, 99]);
    let mut infinite = tetrahedron();
    infinite.positions[0].x = f32::INFINITY;
    for extension in ["stl", "ply", "obj", "gltf", "glb", "ply.gz", "obj.zst"] {
        let path = folder.path().join(format!("a.{extension}"));
        assert!(matches!(write_mesh(&path, &bad), Err(Error::IndexOutOfRange { index: 99, .. })));
        assert_eq!(files_in(folder.path()), 0);
        let mut sink = create_sink(&path).unwrap();
        sink.write(&tetrahedron().to_soup()).unwrap();
        drop(sink);
        assert_eq!(files_in(folder.path()), 0);
        if extension.starts_with("gl") {
            assert!(write_mesh(&path, &infinite).is_err());
            let mut sink = create_sink(&path).unwrap();
            sink.write(&infinite.to_soup()).unwrap();
            assert!(sink.finish().is_err());
            assert_eq!(files_in(folder.path()), 0);
        }
    }
}

#[test]
fn an_older_file_stays_until_the_new_one_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    std::fs::write(&path, "old").unwrap();
    let mut sink = create_sink(&path).unwrap();
    sink.write(&tetrahedron().to_soup()).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    sink.finish().unwrap();
    assert_eq!(read_mesh(&path).unwrap(), tetrahedron());
    assert_eq!(files_in(folder.path()), 1);
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_devices_are_not_replaced() {
    use std::os::unix::fs::{FileTypeExt, PermissionsExt};
    let folder = tempfile::tempdir().unwrap();
    let (target, link) = (folder.path().join("a.ply"), folder.path().join("b.ply"));
    std::fs::write(&target, "old").unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    write_mesh(&link, &tetrahedron()).unwrap();
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(read_mesh(&target).unwrap(), tetrahedron());
    let mode = std::fs::metadata(&target).unwrap().permissions().mode();
    assert_ne!(mode & 0o044, 0, "as readable as any new file: {mode:o}");

    mesh_io::write_mesh_as("/dev/null".as_ref(), Some(Format::Obj), &tetrahedron()).unwrap();
    assert!(std::fs::metadata("/dev/null").unwrap().file_type().is_char_device());
}

#[test]
fn names_that_tell_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh");
    let mesh = tetrahedron();
    assert!(matches!(write_mesh(&path, &mesh), Err(Error::UnknownFormat { .. })));
    for format in Format::ALL {
        // A binary STL shows itself by nothing.
        if format != Format::StlBinary {
            std::fs::write(&path, bytes_of(&mesh, format)).unwrap();
            assert_eq!(read_mesh(&path).unwrap(), mesh, "{format:?}");
        }
    }
    std::fs::write(&path, "hello").unwrap();
    assert!(matches!(read_mesh(&path), Err(Error::UnknownFormat { .. })));
    let missing = read_mesh(&folder.path().join("none.ply")).unwrap_err().to_string();
    assert!(missing.contains("none.ply: cannot open: "), "{missing}");
    assert!(matches!(read_mesh(folder.path()), Err(Error::Io { .. })));
}

#[test]
fn progress_counts_up_to_the_size_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let many = IndexedMesh::from_soup(&tetrahedron().to_soup().repeat(20_000));
    write_mesh(&path, &many).unwrap();
    let size = std::fs::metadata(&path).unwrap().len();
    let calls = std::cell::RefCell::new(Vec::new());
    let report = |done, total| calls.borrow_mut().push((done, total));
    let options = ReadOptions::default().with_progress(&report);
    assert_eq!(read_mesh_with(&path, &options).unwrap(), many);
    let calls = calls.into_inner();
    assert!(calls.len() > 3 && calls.is_sorted());
    assert_eq!(calls.last(), Some(&(size, Some(size))));
}

#[test]
fn vertices_at_one_place_stay_two_in_any_frame() {
    use glam::{DVec3, Vec3};
    use mesh_io::{Frame, IndexedMesh, read_mesh_from, write_indexed_to};

    let mesh = IndexedMesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ZERO, Vec3::Z, Vec3::X],
        triangles: vec![[0, 1, 2], [3, 4, 5]],
        ..Default::default()
    };
    let far = Frame { origin: DVec3::new(500_000.0, 0.0, 0.0), double: true };
    for frame in [Frame::default(), far] {
        for format in [Format::PlyBinaryLittle, Format::PlyAscii, Format::Obj, Format::Glb] {
            let mut bytes = Vec::new();
            write_indexed_to(&mut bytes, format, &mut &mesh, frame).unwrap();
            let back = read_mesh_from(&bytes[..], format, "mesh").unwrap();
            assert_eq!(back.triangles, mesh.triangles, "{format:?}");
            let expected: Vec<Vec3> =
                mesh.positions.iter().map(|&p| frame.to_file(p).as_vec3()).collect();
            assert_eq!(back.positions, expected, "{format:?}");
        }
    }
}
