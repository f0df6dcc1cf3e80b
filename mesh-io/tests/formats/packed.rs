//! gzip and Zstandard around any format.
#![cfg(all(feature = "gz", feature = "zst"))]

use std::io::Write;

use mesh_io::{Format, create_sink, open_source, read_mesh, source_from, write_mesh};

use crate::support::{bytes_of, drain, read, tetrahedron};

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    zstd::encode_all(bytes, 1).unwrap()
}

#[test]
fn packed_input_is_known_by_its_content() {
    let mesh = tetrahedron();
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL {
        let bytes = bytes_of(&mesh, format);
        let (half, rest) = bytes.split_at(bytes.len() / 2);
        let members = [gzip(half), gzip(rest)].concat();
        let frames = [zstd(half), zstd(rest)].concat();
        for packed in [gzip(&bytes), members, zstd(&bytes), frames] {
            assert_eq!(read(&packed, format).unwrap(), mesh, "{format:?}");
            let mut source = source_from(&packed[..], format, "pipe").unwrap();
            assert_eq!(drain(&mut *source, 3).unwrap(), mesh.to_soup());
            let extension = extension(format);
            for suffix in ["", ".gz", ".zst"] {
                let path = folder.path().join(format!("a.{extension}{suffix}"));
                std::fs::write(&path, &packed).unwrap();
                assert_eq!(read_mesh(&path).unwrap(), mesh, "{}", path.display());
                let mut source = open_source(&path).unwrap();
                assert_eq!(drain(&mut *source, 2).unwrap(), mesh.to_soup());
            }
        }
    }
}

fn extension(format: Format) -> &'static str {
    match format {
        Format::StlAscii => "stl",
        Format::PlyAscii | Format::PlyBinaryBig => "ply",
        other => other.name(),
    }
}

#[test]
fn output_is_packed_by_its_name() {
    let mesh = tetrahedron();
    let folder = tempfile::tempdir().unwrap();
    for extension in ["stl", "ply", "obj", "gltf", "glb"] {
        for (suffix, magic) in [("gz", &[0x1f, 0x8b][..]), ("zst", &[0x28, 0xb5][..])] {
            let path = folder.path().join(format!("a.{extension}.{suffix}"));
            write_mesh(&path, &mesh).unwrap();
            assert!(std::fs::read(&path).unwrap().starts_with(magic));
            assert_eq!(read_mesh(&path).unwrap(), mesh);
            let path = folder.path().join(format!("b.{extension}.{suffix}"));
            let mut sink = create_sink(&path).unwrap();
            sink.write(&mesh.to_soup()).unwrap();
            sink.finish().unwrap();
            assert!(std::fs::read(&path).unwrap().starts_with(magic));
            assert_eq!(read_mesh(&path).unwrap(), mesh);
        }
    }
}

#[test]
fn packed_data_cut_short_or_damaged_is_an_error() {
    let bytes = bytes_of(&tetrahedron(), Format::PlyBinaryLittle);
    for packed in [gzip(&bytes), zstd(&bytes)] {
        for cut in 5..packed.len() {
            assert!(read(&packed[..cut], Format::PlyBinaryLittle).is_err(), "cut at {cut}");
        }
        for at in 4..packed.len() {
            let mut broken = packed.clone();
            broken[at] ^= 0x55;
            if let Ok(mesh) = read(&broken, Format::PlyBinaryLittle) {
                assert_eq!(mesh.first_bad_index(), None);
            }
        }
    }
}
