//! glTF scenes: nodes, modes, index types, and where the data lies.

use base64::Engine;
use glam::Vec3;
use mesh_io::{Format, IndexedMesh, open_source, read_mesh};

use crate::support::{bytes_of, drain, read, refused, tetrahedron};

/// Four positions of a square (48 bytes), the indices 0 1 2 3 in one, two and four bytes, then sparse data:
/// index 1 (one byte, padded to four) and its position.
fn data() -> Vec<u8> {
    let mut data = Vec::new();
    for c in [0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.] as [f32; 12] {
        data.extend(c.to_le_bytes());
    }
    data.extend([0u8, 1, 2, 3]);
    (0u16..4).for_each(|i| data.extend(i.to_le_bytes()));
    (0u32..4).for_each(|i| data.extend(i.to_le_bytes()));
    data.extend([1, 0, 0, 0]);
    for c in [5., 6., 7.] as [f32; 3] {
        data.extend(c.to_le_bytes());
    }
    data
}

/// A scene around that data; `primitive` is the rest of the primitive, `scene` the scenes and nodes.
fn document(primitive: &str, scene: &str, uri: &str) -> String {
    let view = |offset: u32, length: u32| {
        format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#)
    };
    let views = [view(0, 48), view(48, 4), view(52, 8), view(60, 16), view(76, 4), view(80, 12)];
    let index = |view: u32, kind: u32, count: u32| {
        format!(r#"{{"bufferView":{view},"componentType":{kind},"count":{count},"type":"SCALAR"}}"#)
    };
    let sparse = r#"{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","sparse":{"count":1,
        "indices":{"bufferView":4,"componentType":5121},"values":{"bufferView":5}}}"#;
    format!(
        r#"{{"asset":{{"version":"2.0"}},{scene}
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}{primitive}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
            {},{},{},{},{sparse}],
        "bufferViews":[{}],
        "buffers":[{{"byteLength":92{uri}}}]}}"#,
        index(1, 5121, 4),
        index(2, 5123, 4),
        index(3, 5125, 4),
        index(1, 5121, 3),
        views.join(",")
    )
}

fn data_uri() -> String {
    let text = base64::engine::general_purpose::STANDARD.encode(data());
    format!(r#","uri":"data:application/gltf-buffer;base64,{text}""#)
}

fn load(primitive: &str, scene: &str) -> IndexedMesh {
    read(document(primitive, scene, &data_uri()), Format::Gltf).unwrap()
}

#[test]
fn modes_and_index_types() {
    assert_eq!(load(r#","indices":4"#, "").triangles, [[0, 1, 2]]);
    for indices in ["", r#","indices":1"#, r#","indices":2"#, r#","indices":3"#] {
        let strip = load(&format!(r#"{indices},"mode":5"#), "");
        assert_eq!(strip.triangles, [[0, 1, 2], [2, 1, 3]], "{indices}");
        let fan = load(&format!(r#"{indices},"mode":6"#), "");
        assert_eq!(fan.triangles, [[0, 1, 2], [0, 2, 3]], "{indices}");
    }
    assert_eq!(load(r#","mode":1"#, ""), IndexedMesh::default(), "lines are passed over");
}

#[test]
fn nodes_put_meshes_in_place() {
    let scene = r#""scene":0,"scenes":[{"nodes":[0]}],"nodes":[
        {"translation":[10,0,0],"children":[1,2]},
        {"scale":[2,2,2],"mesh":0},
        {"matrix":[-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,3,1],"mesh":0},
        {"mesh":0}],"#;
    let mesh = load(r#","mode":6"#, scene);
    assert_eq!(mesh.positions.len(), 8, "the node outside the scene is left out");
    assert_eq!(mesh.positions[2], Vec3::new(12., 2., 0.));
    assert_eq!(mesh.positions[6], Vec3::new(9., 1., 3.));
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]], "mirrored: turned");
    let all = load(r#","mode":6"#, &scene.replace(r#""scene":0,"scenes":[{"nodes":[0]}],"#, ""));
    assert_eq!(all.positions.len(), 12, "without a scene every node counts");
}

#[test]
fn node_cycles_are_refused() {
    let scene =
        r#""scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"children":[1]},{"children":[0]}],"#;
    let message = refused(document("", scene, &data_uri()), Format::Gltf);
    assert!(message.contains("two parents or is its own"), "{message}");
}

#[test]
fn sparse_positions() {
    let text =
        document(r#","mode":6"#, "", &data_uri()).replace(r#""POSITION":0"#, r#""POSITION":5"#);
    let mesh = read(text, Format::Gltf).unwrap();
    assert_eq!(mesh.positions[1], Vec3::new(5., 6., 7.));
    assert_eq!(mesh.positions[2], Vec3::new(1., 1., 0.));
}

#[test]
fn data_in_another_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    let text = document(r#","mode":6"#, "", r#","uri":"the%20data.bin""#);
    std::fs::write(&path, &text).unwrap();
    let message = read_mesh(&path).unwrap_err().to_string();
    assert!(message.contains("the data.bin: cannot open"), "{message}");
    std::fs::write(folder.path().join("the data.bin"), data()).unwrap();
    let mesh = read_mesh(&path).unwrap();
    assert_eq!(mesh.triangles.len(), 2);
    assert_eq!(drain(&mut *open_source(&path).unwrap(), 1).unwrap(), mesh.to_soup());
    assert!(refused(&text, Format::Gltf).contains("its data is in another file"));
}

#[test]
fn only_so_much_of_another_file_as_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.gltf");
    let scene = |uri: &str, bytes: &str| {
        let text = document(r#","mode":6"#, "", &format!(r#","uri":"{uri}""#));
        std::fs::write(&path, text.replace(r#""byteLength":92"#, bytes)).unwrap();
        read_mesh(&path).unwrap_err().to_string()
    };
    std::fs::write(folder.path().join("short.bin"), &data()[..90]).unwrap();
    let message = scene("short.bin", r#""byteLength":92"#);
    assert!(message.contains("short.bin, byte 90: the file ends before the 92 bytes"), "{message}");
    #[cfg(unix)]
    {
        let message = scene("/dev/zero", r#""byteLength":1000000000000"#);
        assert!(message.contains("/dev/zero: cannot open: it is not a file"), "{message}");
    }
}

#[test]
fn a_small_file_does_not_become_a_huge_mesh() {
    let nodes = vec![r#"{"mesh":0}"#; 5000].join(",");
    let roots = (0..5000).map(|i| i.to_string()).collect::<Vec<_>>().join(",");
    let scene = format!(r#""scene":0,"scenes":[{{"nodes":[{roots}]}}],"nodes":[{nodes}],"#);
    assert_eq!(load(r#","mode":6"#, &scene).triangles.len(), 10_000);
    let zeros = |count: u32| {
        let sparse = r#"{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","sparse""#;
        let no_data = format!(r#"{{"componentType":5126,"count":{count},"type":"VEC3","sparse""#);
        let text = document(r#","mode":6"#, &scene, &data_uri()).replace(sparse, &no_data);
        text.replace(r#""POSITION":0"#, r#""POSITION":5"#)
    };
    assert_eq!(read(zeros(4), Format::Gltf).unwrap().triangles.len(), 10_000);
    for count in [10_000, 100_000_000, u32::MAX] {
        let message = refused(zeros(count), Format::Gltf);
        assert!(message.contains("more than 1024 times as large as the file"), "{message}");
    }
}

#[test]
fn the_binary_container_by_hand() {
    let mut json = document(r#","mode":6"#, "", "").into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((12 + 8 + json.len() as u32 + 8 + 92).to_le_bytes());
    glb.extend((json.len() as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(&json);
    glb.extend(92u32.to_le_bytes());
    glb.extend(b"BIN\0");
    glb.extend(data());
    assert_eq!(read(&glb, Format::Gltf).unwrap().triangles.len(), 2);
    glb[4] = 1;
    assert!(refused(&glb, Format::Glb).contains("version 1"));
}

#[test]
fn what_is_written_has_bounds_and_alignment() {
    let bytes = bytes_of(&tetrahedron(), Format::Glb);
    assert_eq!(bytes.len() % 4, 0);
    assert_eq!(u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize, bytes.len());
    let json_bytes = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + json_bytes]).unwrap();
    assert_eq!(json["accessors"][0]["max"][2], 7.0);
    assert_eq!(json["accessors"][0]["min"][0], -3.5);
    assert_eq!(json["accessors"][1]["count"], 12);
}

#[test]
fn errors_tell_what_is_wrong() {
    let good = document(r#","mode":6"#, "", &data_uri());
    let required = |extension: &str| {
        good.replacen('{', &format!(r#"{{"extensionsRequired":["{extension}"],"#), 1)
    };
    let cases = [
        (document(r#","indices":1"#, "", &data_uri()), "has 4 corners, not a multiple of three"),
        (
            good.replace(r#""count":4,"type":"VEC3"}"#, r#""count":9,"type":"VEC3"}"#),
            "accessor 0 has 9 elements",
        ),
        (
            good.replace("\"byteLength\":92", "\"byteLength\":99"),
            "buffer 0 is complete, it has 92 of 99",
        ),
        (good.replace(";base64,A", ";base64,*"), "the data of buffer 0 is broken"),
        (good.replace("base64", "hex"), "is not in base64"),
        (
            good.replace(r#""POSITION":0"#, r#""POSITION":1"#)
                .replace(":4,\"type\":\"VEC3\"", ":3,\"type\":\"VEC3\""),
            "do not have three coordinates",
        ),
        (
            good.replace(r#""mesh":0"#, r#""mesh":7"#)
                .replace("\"asset\"", "\"nodes\":[{\"mesh\":7}],\"asset\""),
            "mesh",
        ),
        (
            required("KHR_draco_mesh_compression"),
            "it needs the extension KHR_draco_mesh_compression",
        ),
        ("{}".to_owned(), "not the JSON of a glTF"),
        (good[..good.len() - 9].to_owned(), "the file ends before the JSON is complete"),
    ];
    for (text, expected) in cases {
        let message = refused(&text, Format::Gltf);
        assert!(message.starts_with("test") && message.contains(expected), "{message}");
    }
    assert!(read(required("KHR_materials_unlit"), Format::Gltf).is_ok());
    let mut stray = data();
    stray[48] = 200;
    let encode = |data: &[u8]| base64::engine::general_purpose::STANDARD.encode(data);
    let text =
        document(r#","indices":4"#, "", &data_uri()).replace(&encode(&data()), &encode(&stray));
    let message = refused(&text, Format::Gltf);
    assert!(message.contains("mesh 0, primitive 0: vertex index 200 is out of range"), "{message}");
}
