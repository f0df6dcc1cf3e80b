//! Mesh formats: every way in must take the same files and find the same triangles, and what was read can be written.

use std::cell::RefCell;
use std::io::Write;
use std::path::{Path, PathBuf};

use glam::Vec3;
use mesh_io::{
    Error, Format, IndexedMesh, Triangle, TriangleSource, open_source_with, read_mesh_from,
    read_mesh_with, source_from, write_mesh_to,
};

use crate::Target;
use crate::mutate::{self, MAX_LEN};
use crate::random::Random;
use crate::target::MemoryLimit;

/// What all formats but glTF may take: what they are read into is at most a few times as large as the text or the records.
const LIMIT: MemoryLimit = MemoryLimit { fixed: 2 << 20, per_byte: 128 };

/// STL, of either kind.
pub const STL: Target = Target {
    name: "stl",
    seeds: stl_seeds,
    mutate: text_or_bytes,
    run: |bytes| formats(bytes, Format::StlBinary),
    memory: LIMIT,
};

/// PLY, of all three kinds, from pipes and files.
pub const PLY: Target = Target {
    name: "ply",
    seeds: ply_seeds,
    mutate: text_or_bytes,
    run: |bytes| formats(bytes, Format::PlyAscii),
    memory: LIMIT,
};

/// OBJ.
pub const OBJ: Target = Target {
    name: "obj",
    seeds: obj_seeds,
    mutate: mutate::text,
    run: |bytes| formats(bytes, Format::Obj),
    memory: LIMIT,
};

/// glTF and GLB.
pub const GLTF: Target = Target {
    name: "gltf",
    seeds: gltf_seeds,
    mutate: gltf,
    run: |bytes| formats(bytes, Format::Gltf),
    memory: MemoryLimit { fixed: 1 << 20, per_byte: 1024 },
};

/// Files packed with gzip and Zstandard, whose content tells the format.
pub const PACKED: Target = Target {
    name: "packed",
    seeds: packed_seeds,
    mutate: mutate::bytes,
    run: packed,
    // What is packed may be a thousand times as large.
    memory: MemoryLimit { fixed: 1 << 20, per_byte: 1 << 15 },
};

fn text_or_bytes(random: &mut Random, file: &mut Vec<u8>, other: &[u8]) {
    // The header of a binary file is text.
    if random.one_in(2) {
        mutate::text(random, file, other);
    } else {
        mutate::bytes(random, file, other);
    }
}

thread_local! {
    /// A file that holds the case, for what is only done with files.
    static FOLDER: RefCell<Option<tempfile::TempDir>> = const { RefCell::new(None) };
}

fn on_disk(bytes: &[u8]) -> PathBuf {
    FOLDER.with_borrow_mut(|folder| {
        let folder = folder.get_or_insert_with(|| tempfile::tempdir().expect("a folder"));
        let path = folder.path().join("case");
        let mut file = std::fs::File::create(&path).expect("a file in it");
        file.write_all(bytes).expect("room for it");
        path
    })
}

fn formats(bytes: &[u8], format: Format) {
    let whole = read_mesh_from(bytes, format, "case");
    let streamed = source_from(bytes, format, "case").and_then(|mut source| drain(&mut *source));
    agree(&whole, &streamed);
    let path = on_disk(bytes);
    let from_file = read_mesh_with(&path, &mesh_io::ReadOptions::default().with_format(format));
    let streamed_from_file =
        open_source_with(&path, Some(format)).and_then(|mut source| drain(&mut *source));
    agree(&from_file, &streamed_from_file);
    // A file whose size does not fit its header is refused, and taken from a pipe.
    if let (Ok(mesh), Ok(other)) = (&whole, &from_file) {
        assert!(same(&mesh.to_soup(), &other.to_soup()), "a file and a pipe differ");
    }
    if let Ok(mesh) = &whole {
        check(mesh);
        write(mesh);
    }
    for error in [whole.err(), streamed.err(), from_file.err(), streamed_from_file.err()] {
        error.iter().for_each(one_line);
    }
}

fn packed(bytes: &[u8]) {
    let path = on_disk(bytes);
    let options = mesh_io::ReadOptions::default();
    match read_mesh_with(&path, &options) {
        Ok(mesh) => check(&mesh),
        Err(error) => one_line(&error),
    }
    match open_source_with(&path, None).and_then(|mut source| drain(&mut *source)) {
        Ok(_) => {}
        Err(error) => one_line(&error),
    }
}

fn drain(source: &mut dyn TriangleSource) -> Result<Vec<Triangle>, Error> {
    let count = source.triangle_count();
    let (mut triangles, mut numbers) = (Vec::new(), Vec::new());
    let mut max = 1;
    loop {
        let before = triangles.len();
        let read = source.read_numbered(&mut triangles, &mut numbers, max)?;
        assert!(read <= max, "{read} triangles, {max} were asked for");
        assert_eq!(triangles.len() - before, read, "as many as it says");
        if read == 0 {
            break;
        }
        max = max % 61 + 7;
    }
    if source.has_vertex_numbers() {
        assert_eq!(numbers.len(), triangles.len());
        let mut again = Vec::new();
        source.look_up(&numbers, &mut again);
        assert!(same(&again, &triangles), "vertices looked up are others");
        if source.has_colours() {
            let mut colours = Vec::new();
            source.look_up_colours(&numbers, &mut colours);
            assert_eq!(colours.len(), triangles.len());
        }
    }
    // Of a binary PLY it goes by the size of the file, in which faces without triangles may make up for larger ones.
    if let Some(count) = count.filter(|_| !source.has_vertex_numbers()) {
        assert_eq!(count, triangles.len() as u64, "the count was certain");
    }
    Ok(triangles)
}

/// Bit for bit, but any NaN is any other.
fn same(a: &[Triangle], b: &[Triangle]) -> bool {
    let equal = |a: f32, b: f32| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()) || a == b;
    let point = |a: Vec3, b: Vec3| (0..3).all(|axis| equal(a[axis], b[axis]));
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (0..3).all(|i| point(a[i], b[i])))
}

/// The mesh and the stream of a file have as many triangles. (Coordinates may be in different frames.)
fn agree(whole: &Result<IndexedMesh, Error>, streamed: &Result<Vec<Triangle>, Error>) {
    match (whole, streamed) {
        (Ok(mesh), Ok(triangles)) => assert_eq!(mesh.triangles.len(), triangles.len()),
        (Err(_), Err(_)) => {}
        (Ok(_), Err(error)) => panic!("read whole, but not as a stream: {error}"),
        (Err(error), Ok(_)) => panic!("read as a stream, but not whole: {error}"),
    }
}

fn check(mesh: &IndexedMesh) {
    let vertices = mesh.positions.len();
    assert!([0, vertices].contains(&mesh.colours.len()), "colours of some vertices");
    assert!(
        mesh.triangles.iter().flatten().all(|&v| (v as usize) < vertices),
        "an index too large"
    );
}

/// Writes the mesh in a format that depends on it, and reads it back.
fn write(mesh: &IndexedMesh) {
    let formats = Format::ALL;
    let format = formats[(mesh.triangles.len() + mesh.positions.len()) % formats.len()];
    let mut written = Vec::new();
    match write_mesh_to(&mut written, format, mesh) {
        Ok(()) => {
            let again = read_mesh_from(&written[..], format, "again").expect("what was written");
            assert!(same(&again.to_soup(), &mesh.to_soup()), "not what was written");
        }
        Err(error) => one_line(&error),
    }
}

/// Messages are one line, and name the file.
fn one_line(error: &Error) {
    let message = error.to_string();
    assert!(!message.contains('\n') && !message.contains('\0'), "{message:?}");
    // The case, what was made of it, or another file that it names.
    let names = ["case", "again", "output", "cannot open"];
    assert!(names.iter().any(|name| message.contains(name)), "{message:?}");
}

/// A pyramid with a hole, eleven vertices or so.
fn small() -> IndexedMesh {
    let mut positions = vec![Vec3::new(0.5, 0.5, 1.25)];
    let mut triangles = Vec::new();
    for i in 0..9u32 {
        let angle = 0.7 * i as f32;
        positions.push(Vec3::new(angle.cos(), angle.sin(), -0.125));
        if i > 0 {
            triangles.push([0, i, i + 1]);
        }
    }
    IndexedMesh { positions, triangles, ..IndexedMesh::default() }
}

fn written(format: Format) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_mesh_to(&mut bytes, format, &small()).expect("a valid mesh");
    bytes
}

/// The same with colours.
fn coloured(format: Format) -> Vec<u8> {
    let mut mesh = small();
    let bytes = (0..mesh.positions.len()).map(|i| (i * 23) as u8);
    mesh.colours = bytes.map(|byte| [byte, 255 - byte, 7, 255]).collect();
    let mut bytes = Vec::new();
    write_mesh_to(&mut bytes, format, &mesh).expect("a valid mesh");
    bytes
}

fn stl_seeds() -> Vec<Vec<u8>> {
    let text = "\u{feff}SOLID a\r\n# x\nfacet normal 0 0 1\n outer loop\nvertex 1e1 -0 .5\nvertex 2 3 4\n\
                vertex 500000.125 4500000.25 1\nendloop\nendfacet\nendsolid\nsolid\ncolor 1 2 3\nendsolid b\n";
    let mut binary = written(Format::StlBinary);
    binary[..5].copy_from_slice(b"solid");
    vec![written(Format::StlBinary), written(Format::StlAscii), text.as_bytes().to_vec(), binary]
}

fn ply_seeds() -> Vec<Vec<u8>> {
    let all_sorts = "ply\ncomment one\nformat ascii 1.0\nobj_info two\nelement camera 1\n\
        property double fov\nproperty list uchar float weights\nelement vertex 4\nproperty uchar red\n\
        property double z\nproperty list int int bones\nproperty double y\nproperty float64 x\n\
        element face 2\nproperty uchar flags\n\
        property list uchar uint vertex_index\nproperty list uchar float texcoord\n\
        element edge 1\nproperty int a\nend_header\n\
        1.5 2 7 7\n255 0 0 0 500000.125\n255 0 2 8 9 0 1\n0 0 0 1 1\n0 0 1 5 1 0\n\
        9 3 0 1 2 0\n9 4 0 2 3 1 2 1 1\n5\n";
    let strips = "ply\nformat ascii 1.0\nelement tristrips 1\nproperty list int int vertex_indices\n\
        element vertex 5\nproperty float x\nproperty float y\nproperty float z\nend_header\n\
        9 0 1 2 3 -1 4 3 2 1\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 2 1\n";
    let mut seeds: Vec<Vec<u8>> =
        [Format::PlyAscii, Format::PlyBinaryLittle, Format::PlyBinaryBig].map(written).into();
    seeds.extend([Format::PlyAscii, Format::PlyBinaryBig].map(coloured));
    seeds.extend([all_sorts, strips].map(|text| text.as_bytes().to_vec()));
    for (big, faces_first) in [(false, false), (true, true), (false, true)] {
        seeds.push(binary_ply(big, faces_first));
    }
    seeds
}

/// Doubles, bytes and lists in binary, with strips or polygons, either part first.
fn binary_ply(big: bool, faces_first: bool) -> Vec<u8> {
    let vertices = "element vertex 5\nproperty uchar red\nproperty double x\nproperty float y\n\
                    property short z\n";
    let faces =
        "element face 2\nproperty list ushort ushort vertex_indices\nproperty uint16 flags\n";
    let strips = "element tristrips 1\nproperty list uchar char vertex_indices\n";
    let extra = "element extra 2\nproperty list int8 double stuff\n";
    let order = if big { "binary_big_endian" } else { "binary_little_endian" };
    let (first, second) = if faces_first { (faces, vertices) } else { (vertices, faces) };
    let mut bytes =
        format!("ply\nformat {order} 1.0\n{extra}{first}{second}{strips}end_header\n").into_bytes();
    let put = |out: &mut Vec<u8>, field: &[u8]| {
        let mut field = field.to_vec();
        if big {
            field.reverse();
        }
        out.extend(field);
    };
    let mut vertex_rows = Vec::new();
    for i in 0..5u8 {
        vertex_rows.push(i);
        put(&mut vertex_rows, &(f64::from(i) + 1e6).to_le_bytes());
        put(&mut vertex_rows, &(f32::from(i * i)).to_le_bytes());
        put(&mut vertex_rows, &i16::from(i % 2).to_le_bytes());
    }
    let mut face_rows = Vec::new();
    for face in [&[0u16, 1, 2][..], &[0, 2, 4, 3]] {
        put(&mut face_rows, &(face.len() as u16).to_le_bytes());
        face.iter().for_each(|v| put(&mut face_rows, &v.to_le_bytes()));
        put(&mut face_rows, &7u16.to_le_bytes());
    }
    bytes.push(1);
    put(&mut bytes, &1.5f64.to_le_bytes());
    bytes.push(0);
    let (first, second) =
        if faces_first { (face_rows, vertex_rows) } else { (vertex_rows, face_rows) };
    bytes.extend(first);
    bytes.extend(second);
    bytes.extend([6, 0, 1, 2, 0xff, 3, 4]);
    bytes
}

fn obj_seeds() -> Vec<Vec<u8>> {
    let all_sorts = "# one\nmtllib a.mtl\no a\nf 1 2 3\nv 0 0 0\nv 1 0 0 1 0 0\nv 1 1 0\nv 0 1e0 .0\nvt 0 0\n\
        vn 0 0 1\ng b\nusemtl c\ns off\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -1//1 -2//1 -3//1\nf 1/1 2/1 \\\n 3/1\n\
        l 1 2\np 1\nv 500000.125 4500000.25 1\nv 5 5 5\nf 1 2 3 4 5 6\n";
    vec![written(Format::Obj), coloured(Format::Obj), all_sorts.as_bytes().to_vec()]
}

fn gltf_seeds() -> Vec<Vec<u8>> {
    // Four positions, the indices 0 1 2 3 in three widths, then a sparse index and its position.
    let data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAgD8AAAAAAAECAwAAAQACAAMAAAAAAAEAAAACAAAA\
                AwAAAAEAAAAAAKBAAADAQAAA4EA=";
    let view = |offset: u32, length: u32| {
        format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#)
    };
    let views = [view(0, 48), view(48, 4), view(52, 8), view(60, 16), view(76, 4), view(80, 12)];
    let index = |view: u32, kind: u32, count: u32| {
        format!(r#"{{"bufferView":{view},"componentType":{kind},"count":{count},"type":"SCALAR"}}"#)
    };
    let scene = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[
        {{"translation":[10,0,0],"children":[1,2]}},{{"scale":[2,2,2],"mesh":0}},
        {{"matrix":[-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,3,1],"mesh":1}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"mode":5}},
            {{"attributes":{{"POSITION":0}},"indices":3,"mode":6}}]}},
            {{"primitives":[{{"attributes":{{"POSITION":5}},"indices":4}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
            {},{},{},{},{{"componentType":5126,"count":4,"type":"VEC3","sparse":{{"count":1,
            "indices":{{"bufferView":4,"componentType":5121}},"values":{{"bufferView":5}}}}}}],
        "bufferViews":[{}],
        "buffers":[{{"byteLength":92,"uri":"data:application/gltf-buffer;base64,{data}"}}]}}"#,
        index(1, 5121, 4),
        index(2, 5123, 4),
        index(3, 5125, 4),
        index(1, 5121, 3),
        views.join(",")
    );
    vec![written(Format::Gltf), written(Format::Glb), coloured(Format::Glb), scene.into_bytes()]
}

/// Changes the parts of a container by themselves and puts them together with the right lengths, mostly.
fn gltf(random: &mut Random, file: &mut Vec<u8>, other: &[u8]) {
    let json_len =
        file.get(12..16).and_then(|len| len.first_chunk()).map(|&len| u32::from_le_bytes(len));
    let parts =
        json_len.filter(|_| file.starts_with(b"glTF") && !random.one_in(5)).and_then(|len| {
            let end = 20usize.checked_add(len as usize)?;
            Some((file.get(20..end)?.to_vec(), file.get(end + 8..).unwrap_or_default().to_vec()))
        });
    let Some((mut json, mut bin)) = parts else { return text_or_bytes(random, file, other) };
    if random.one_in(3) {
        mutate::bytes(random, &mut bin, other);
    } else {
        mutate::text(random, &mut json, other);
    }
    file.clear();
    file.extend(b"glTF\x02\0\0\0");
    file.extend((12 + 8 + json.len() as u32 + 8 + bin.len() as u32).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json);
    file.extend((bin.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(bin);
    file.truncate(MAX_LEN);
}

fn packed_seeds() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    ["a.stl.gz", "a.obj.zst", "a.ply.gz", "a.glb.zst"]
        .map(|name| {
            let path: &Path = &folder.path().join(name);
            mesh_io::write_mesh(path, &small()).expect("a valid mesh");
            std::fs::read(path).expect("what was written")
        })
        .into()
}
