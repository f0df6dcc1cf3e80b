//! Files cut short, lengthened, and with every byte changed: an error or a mesh, never a panic.

use mesh_io::{Error, Format, IndexedMesh, open_source_with, read_mesh_with};

use crate::support::{bytes_of, drain, read, stream, tetrahedron};

/// Formats whose end cannot be told from a cut: a number may lose its last digits, a line its followers.
fn has_no_end_mark(format: Format) -> bool {
    matches!(format, Format::Obj | Format::PlyAscii)
}

#[test]
fn every_truncation_is_an_error_or_the_mesh() {
    let mesh = tetrahedron();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut");
    for format in Format::ALL {
        let bytes = bytes_of(&mesh, format);
        for cut in 0..bytes.len() {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            let options = mesh_io::ReadOptions::default().with_format(format);
            let from_file = read_mesh_with(&path, &options);
            let streamed =
                open_source_with(&path, Some(format)).and_then(|mut s| drain(&mut *s, 3));
            let piped = read(&bytes[..cut], format);
            for result in [from_file, piped] {
                match result {
                    Ok(read) if !has_no_end_mark(format) => {
                        assert_eq!(read, mesh, "{format:?} cut at {cut}");
                    }
                    Ok(read) => {
                        assert_eq!(read.first_bad_index(), None);
                        assert!(read.triangles.len() <= mesh.triangles.len());
                    }
                    Err(error) => {
                        let message = error.to_string();
                        assert!(cut > 0 || matches!(error, Error::Empty { .. }), "{message}");
                        assert!(message.contains("; "), "a remedy: {message}");
                    }
                }
            }
            if !has_no_end_mark(format)
                && let Ok(soup) = streamed
            {
                assert_eq!(soup, mesh.to_soup(), "{format:?} cut at {cut}");
            }
        }
    }
}

#[test]
fn every_changed_byte_is_an_error_or_a_valid_mesh() {
    let mesh = tetrahedron();
    for format in Format::ALL {
        let bytes = bytes_of(&mesh, format);
        for at in 0..bytes.len() {
            for change in [0x01, 0x80, 0xff, b'9' ^ bytes[at]] {
                let mut broken = bytes.clone();
                broken[at] ^= change;
                if let Ok(read) = read(&broken, format) {
                    assert_eq!(read.first_bad_index(), None);
                }
                // As a stream it must come to an end all the same.
                assert!(stream(&broken, format, 3).map_or(true, |soup| soup.len() < 1000));
            }
        }
    }
}

#[test]
fn counts_are_not_believed() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\n\
                  property float x\nproperty float y\nproperty float z\n\
                  element face 18000000000000000000\nproperty list uint int vertex_indices\n\
                  end_header\n";
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend([0; 40]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.ply");
    std::fs::write(&path, &bytes).unwrap();
    let message = mesh_io::read_mesh(&path).unwrap_err().to_string();
    assert!(message.contains("4000000000 rows of `vertex`"), "{message}");
    assert!(matches!(read(&bytes, Format::PlyAscii), Err(Error::Truncated { .. })));

    let mut stl = vec![0; 84];
    stl[80..].copy_from_slice(&u32::MAX.to_le_bytes());
    let path = folder.path().join("huge.stl");
    std::fs::write(&path, &stl).unwrap();
    assert!(matches!(mesh_io::read_mesh(&path), Err(Error::Truncated { .. })));
    assert_eq!(read(&stl, Format::StlBinary).unwrap(), IndexedMesh::default());
}

#[test]
fn empty_files_are_said_to_be_empty() {
    for format in Format::ALL {
        assert!(matches!(read([], format), Err(Error::Empty { .. })));
        assert!(matches!(stream(&[], format, 1), Err(Error::Empty { .. })));
    }
}
