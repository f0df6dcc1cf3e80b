//! A mesh that was changed piece by piece looks like the same mesh given at once.

// One changed range is a list of one range.
#![allow(clippy::single_range_in_vec_init)]

mod common;

use common::{Chance, assert_valid, ball, camera, colours, context, mesh_of, whole};
use glam::Vec3;
use std::ops::Range;
use vk_render::{Error, Image, MeshBuffers, MeshUpdate, Offscreen, Scene, Shading, Vertex};

const SIZE: u32 = 96;

fn draw(target: &mut Offscreen, mesh: &MeshBuffers, shading: Shading) -> Image {
    let (width, height) = target.size();
    let mut scene = Scene::new(mesh, camera(width, height));
    scene.shading = shading;
    target.draw(&scene).expect("a picture")
}

/// Moves a few vertices and empties or restores a few triangles; says which.
fn change(
    chance: &mut Chance,
    vertices: &mut [Vertex],
    triangles: &mut [[u32; 3]],
    original: &[[u32; 3]],
) -> (Vec<Range<u32>>, Vec<Range<u32>>) {
    let (mut moved, mut switched) = (Vec::new(), Vec::new());
    for _ in 0..6 {
        let start = chance.below(vertices.len() as u32 - 8);
        let end = start + 1 + chance.below(7);
        for vertex in &mut vertices[start as usize..end as usize] {
            let place = Vec3::from_array(vertex.position).normalize();
            let scale = 0.7 + chance.below(1000) as f32 / 2000.0;
            *vertex = Vertex::new(place * scale, place, chance.below(24) as u8);
        }
        moved.push(start..end);
        let start = chance.below(triangles.len() as u32 - 8);
        let end = start + 1 + chance.below(7);
        for i in start as usize..end as usize {
            triangles[i] = if triangles[i] == [0; 3] { original[i] } else { [0; 3] };
        }
        switched.push(start..end);
    }
    (moved, switched)
}

#[test]
fn pieces_look_like_the_whole() {
    let context = context();
    let (mut vertices, original) = ball(24);
    let mut triangles = original.clone();
    let mut mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let mut chance = Chance::new(1);
    for round in 0..25 {
        let (moved, switched) = change(&mut chance, &mut vertices, &mut triangles, &original);
        let update = MeshUpdate {
            vertices: &vertices,
            vertex_ranges: &moved,
            triangles: &triangles,
            triangle_ranges: &switched,
            ..MeshUpdate::default()
        };
        let sent = mesh.update(&update).expect("an update");
        assert!(sent.bytes < 12_000 && !sent.grew, "{sent:?}");
        let fresh = mesh_of(&context, &vertices, &triangles);
        let shading = Shading::ALL[round % 5];
        let same = draw(&mut target, &mesh, shading) == draw(&mut target, &fresh, shading);
        assert!(same, "round {round}, {shading:?}");
    }
    assert_valid(&context);
}

#[test]
fn what_is_not_named_does_not_travel() {
    let context = context();
    let (vertices, triangles) = ball(24);
    let mut mesh = mesh_of(&context, &vertices, &triangles);
    let sent = mesh.update(&whole(&vertices, &triangles)).expect("an update");
    assert_eq!((sent.bytes, sent.pieces), (0, 0));
    let update = MeshUpdate {
        vertex_ranges: &[7..8, 500..510],
        triangle_ranges: &[3..4, 4..5],
        ..whole(&vertices, &triangles)
    };
    let sent = mesh.update(&update).expect("an update");
    assert_eq!((sent.bytes, sent.pieces), (11 * 20 + 2 * 12, 3));
    assert_valid(&context);
}

#[test]
fn a_mesh_grows_past_its_room_again_and_again() {
    let context = context();
    let mut mesh = MeshBuffers::new(&context).expect("an empty mesh");
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let (vertices, triangles) = ball(96);
    let mut grown = 0;
    for part in 1..=16 {
        // The tail is not named: what is new at the end counts as changed.
        let (v, t) = (vertices.len() * part / 16, triangles.len() * part / 16);
        let kept: Vec<[u32; 3]> = triangles[..t]
            .iter()
            .map(|t| if t.iter().all(|&i| (i as usize) < v) { *t } else { [0; 3] })
            .collect();
        // Triangles that had to wait for their vertices change when those have come.
        let update = MeshUpdate { triangle_ranges: &[0..t as u32], ..whole(&vertices[..v], &kept) };
        grown += u32::from(mesh.update(&update).expect("an update").grew);
        // Drawn without waiting, so that the old buffers are in use when they are replaced.
        target.render(&Scene::new(&mesh, camera(SIZE, SIZE))).expect("a picture");
        if part % 5 == 0 {
            let fresh = mesh_of(&context, &vertices[..v], &kept);
            let (a, b) = (
                draw(&mut target, &mesh, Shading::Smooth),
                draw(&mut target, &fresh, Shading::Smooth),
            );
            assert!(a == b, "part {part}");
        }
    }
    assert!(grown >= 4, "grew {grown} times");
    assert_eq!(mesh.num_vertices() as usize, vertices.len());
    assert_valid(&context);
}

#[test]
fn a_mesh_shrinks_and_comes_back() {
    let context = context();
    let (vertices, triangles) = ball(24);
    let mut mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let full = draw(&mut target, &mesh, Shading::Flat);
    mesh.update(&whole(&vertices, &triangles[..100])).expect("an update");
    assert!(draw(&mut target, &mesh, Shading::Flat) != full);
    mesh.update(&whole(&[], &[])).expect("an update");
    assert_eq!((mesh.num_vertices(), mesh.num_triangles()), (0, 0));
    mesh.update(&whole(&vertices, &triangles)).expect("an update");
    assert!(draw(&mut target, &mesh, Shading::Flat) == full);
    assert_valid(&context);
}

#[test]
fn more_than_the_ring_holds_arrives_all_the_same() {
    let context = context();
    // 29 MB of vertices and triangles, several times the ring, given twice.
    let (vertices, triangles) = ball(640);
    let mut mesh = mesh_of(&context, &vertices, &triangles);
    let update = MeshUpdate {
        vertex_ranges: &[0..vertices.len() as u32],
        triangle_ranges: &[0..triangles.len() as u32],
        ..whole(&vertices, &triangles)
    };
    let sent = mesh.update(&update).expect("an update");
    assert_eq!(sent.bytes as usize, 20 * vertices.len() + 12 * triangles.len());
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let fine = draw(&mut target, &mesh, Shading::Normals);
    let (vertices, triangles) = ball(160);
    let coarse = mesh_of(&context, &vertices, &triangles);
    let coarse = draw(&mut target, &coarse, Shading::Normals);
    let far_off = fine.rgba.iter().zip(&coarse.rgba).filter(|(a, b)| a.abs_diff(**b) > 12).count();
    assert!(far_off < 400, "{far_off} of {} values differ", fine.rgba.len());
    assert_valid(&context);
}

#[test]
fn ranges_past_the_end_are_refused_and_change_nothing() {
    let context = context();
    let (vertices, triangles) = ball(8);
    let mut mesh = mesh_of(&context, &vertices, &triangles);
    let end = triangles.len() as u32;
    let update =
        MeshUpdate { triangle_ranges: &[end - 1..end + 1], ..whole(&vertices, &triangles) };
    match mesh.update(&update) {
        Err(Error::RangePastEnd { what: "triangles", range, len }) => {
            assert_eq!((range, len), (end - 1..end + 1, triangles.len()));
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(mesh.update(&whole(&vertices, &triangles)).expect("an update").bytes, 0);
    assert_valid(&context);
}

#[test]
fn a_thousand_frames_of_changes_are_valid_and_true() {
    let context = context();
    let (mut vertices, original) = ball(16);
    let mut triangles = original.clone();
    let mut mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, 64, 48).expect("a target");
    let mut chance = Chance::new(7);
    for frame in 0..1000 {
        let (moved, switched) = change(&mut chance, &mut vertices, &mut triangles, &original);
        let update = MeshUpdate {
            vertices: &vertices,
            vertex_ranges: &moved,
            triangles: &triangles,
            triangle_ranges: &switched,
            ..MeshUpdate::default()
        };
        mesh.update(&update).expect("an update");
        let mut scene = Scene::new(&mesh, camera(64, 48));
        scene.shading = Shading::ALL[frame % 5];
        // No waiting: frames in flight and updates overlap.
        target.render(&scene).expect("a picture");
    }
    let fresh = mesh_of(&context, &vertices, &triangles);
    let same =
        draw(&mut target, &mesh, Shading::Smooth) == draw(&mut target, &fresh, Shading::Smooth);
    assert!(same);
    assert_valid(&context);
}

#[test]
fn colours_travel_by_their_changes_and_for_all_vertices_or_none() {
    let context = context();
    let (vertices, triangles) = ball(16);
    let mut mesh = mesh_of(&context, &vertices, &triangles);
    let mut colours = colours(&vertices);
    let all = whole(&vertices, &triangles);
    let sent = mesh.update(&MeshUpdate { colours: &colours, ..all }).expect("all colours");
    assert_eq!(sent.bytes as usize, 4 * colours.len());
    colours[7] = [1, 2, 3, 255];
    let ranges = [7..8];
    let update = MeshUpdate { colours: &colours, colour_ranges: &ranges, ..all };
    assert_eq!(mesh.update(&update).expect("one colour").bytes, 4);
    match mesh.update(&MeshUpdate { colours: &colours[1..], ..all }) {
        Err(Error::ColourCount { colours: given, vertices: all }) => assert_eq!(given + 1, all),
        other => panic!("{other:?}"),
    }
    assert!(mesh.has_colours());
    mesh.update(&all).expect("no colours any more");
    assert!(!mesh.has_colours());
    assert_valid(&context);
}
