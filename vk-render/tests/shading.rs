//! Every shading draws the ball where it is, in its own colours, and the inside in red.

mod common;

use common::{assert_valid, ball, camera, coloured_mesh_of, context, mesh_of};
use glam::Vec3;
use vk_render::{Background, Camera, Image, Line, Offscreen, Scene, Section, Shading, Text};

const SIZE: u32 = 128;

fn near(a: [u8; 4], b: [u8; 3], tolerance: u8) -> bool {
    a[3] == 255 && a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= tolerance)
}

fn pixel(image: &Image, x: u32, y: u32) -> [u8; 4] {
    image.pixel(x, y).expect("within the picture")
}

fn brightness(p: [u8; 4]) -> u32 {
    p[..3].iter().map(|&c| u32::from(c)).sum()
}

fn is_red(p: [u8; 4]) -> bool {
    p[0] > 50 && p[0] / 2 > p[1] && p[0] / 2 > p[2]
}

#[test]
fn the_background_is_a_gradient_between_its_colours() {
    let context = context();
    let mesh = mesh_of(&context, &[], &[]);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
    scene.background = Background { top: [200, 100, 50], bottom: [10, 60, 90] };
    let image = target.draw(&scene).expect("a picture");
    assert_eq!(image.rgba.len(), 4 * (SIZE * SIZE) as usize);
    for x in [0, SIZE / 2, SIZE - 1] {
        assert!(near(pixel(&image, x, 0), [200, 100, 50], 2), "{:?}", pixel(&image, x, 0));
        assert!(near(pixel(&image, x, SIZE - 1), [10, 60, 90], 2));
        assert!(near(pixel(&image, x, SIZE / 2), [105, 80, 70], 3));
    }
    assert_eq!(image.pixel(SIZE, 0), None);
    assert_valid(&context);
}

#[test]
fn every_shading_lights_the_ball_and_leaves_the_corners_alone() {
    let context = context();
    let (vertices, triangles) = ball(24);
    let mesh = coloured_mesh_of(&context, &vertices, &triangles);
    let empty = mesh_of(&context, &[], &[]);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let background = target.draw(&Scene::new(&empty, camera(SIZE, SIZE))).expect("a picture");
    let mut seen: Vec<Image> = Vec::new();
    for shading in Shading::ALL {
        let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
        scene.shading = shading;
        scene.max_level = 8;
        let image = target.draw(&scene).expect("a picture");
        for (x, y) in [(0, 0), (SIZE - 1, 0), (0, SIZE - 1), (SIZE - 1, SIZE - 1)] {
            assert_eq!(pixel(&image, x, y), pixel(&background, x, y), "{shading:?}");
        }
        let (mut covered, mut red) = (0, 0);
        for y in 0..SIZE {
            for x in 0..SIZE {
                covered += u32::from(pixel(&image, x, y) != pixel(&background, x, y));
                red += u32::from(is_red(pixel(&image, x, y)) && shading != Shading::Normals);
            }
        }
        // The silhouette's radius: 1 / sqrt(8) over tan(0.4), of half the picture.
        let radius = 1.0 / 8.0_f32.sqrt() / 0.4_f32.tan() * 64.0;
        let disc = std::f32::consts::PI * radius * radius;
        assert!(
            (covered as f32 / disc - 1.0).abs() < 0.06,
            "{shading:?} covers {covered} of {disc}"
        );
        // The finest level's red is at the very top, seen edge on.
        assert!(red < 40, "{shading:?} shows its inside: {red}");
        assert!(seen.iter().all(|other| *other != image), "{shading:?} looks like another");
        seen.push(image);
    }
    // Clay is brighter where the key light comes from, the upper left.
    let smooth = &seen[0];
    assert!(brightness(pixel(smooth, 44, 44)) > brightness(pixel(smooth, 84, 90)) + 60);
    // Normals: towards +z in the middle, +x to the right, +y above.
    let normals = &seen[4];
    assert!(near(pixel(normals, 64, 64), [128, 128, 255], 6), "{:?}", pixel(normals, 64, 64));
    assert!(pixel(normals, 100, 64)[0] > 180 && pixel(normals, 64, 28)[1] > 180);
    assert_valid(&context);
}

#[test]
fn flipped_faces_show_the_inside_in_every_shading() {
    let context = context();
    let (vertices, mut triangles) = ball(24);
    for triangle in &mut triangles {
        triangle.swap(1, 2);
    }
    let mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    for shading in Shading::ALL {
        let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
        scene.shading = shading;
        let image = target.draw(&scene).expect("a picture");
        let red = (0..SIZE * SIZE).filter(|i| is_red(pixel(&image, i % SIZE, i / SIZE))).count();
        assert!(red > 3000, "{shading:?} shows {red} red pixels");
    }
    assert_valid(&context);
}

#[test]
fn wires_are_dark_lines_between_lit_faces() {
    let context = context();
    let (vertices, triangles) = ball(6);
    let mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, 256, 256).expect("a target");
    let mut scene = Scene::new(&mesh, camera(256, 256));
    let mut draw = |shading| {
        scene.shading = shading;
        target.draw(&scene).expect("a picture")
    };
    let (flat, wire) = (draw(Shading::Flat), draw(Shading::Wireframe));
    let places = (0..256 * 256_u32).map(|i| (i % 256, i / 256)).filter(|(x, y)| {
        let (dx, dy) = (x.abs_diff(128), y.abs_diff(128));
        dx * dx + dy * dy < 80 * 80
    });
    // The wireframe's faces are brighter than clay, so what is darker is a wire.
    let wires = places
        .filter(|&(x, y)| brightness(pixel(&wire, x, y)) < brightness(pixel(&flat, x, y)) * 7 / 10)
        .count();
    assert!((400..6000).contains(&wires), "{wires} dark pixels");
    assert_valid(&context);
}

#[test]
fn empty_slots_draw_nothing() {
    let context = context();
    let (vertices, triangles) = ball(12);
    let mesh = mesh_of(&context, &vertices, &triangles);
    let mut holed = vec![[0, 0, 0]; 500];
    for triangle in &triangles {
        holed.push(*triangle);
        holed.push([0, 0, 0]);
    }
    let holed = mesh_of(&context, &vertices, &holed);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    for shading in Shading::ALL {
        let mut draw = |mesh| {
            let mut scene = Scene::new(mesh, camera(SIZE, SIZE));
            scene.shading = shading;
            target.draw(&scene).expect("a picture")
        };
        assert!(draw(&mesh) == draw(&holed), "{shading:?}");
    }
    assert_valid(&context);
}

#[test]
fn wrong_indices_read_nothing_beyond_the_mesh() {
    let context = context();
    let (vertices, mut triangles) = ball(4);
    triangles[3] = [5, u32::MAX - 1, 70_000_000];
    let mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    for shading in Shading::ALL {
        let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
        scene.shading = shading;
        target.draw(&scene).expect("a picture");
    }
    assert_valid(&context);
}

#[test]
fn lines_are_hidden_by_the_mesh_and_seen_beside_it() {
    let context = context();
    let (vertices, triangles) = ball(24);
    let mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let green = |a: Vec3, b: Vec3| Line { a, b, rgba: [0, 255, 0, 255] };
    let is_green = |p: [u8; 4]| p[1] > 200 && p[0] < 60 && p[2] < 60;
    // Before, behind, through the eye's plane, and of no length.
    let across = Vec3::X * 1.4;
    let lines = [
        green(Vec3::new(-1.2, 0.0, 1.2), Vec3::new(1.2, 0.0, 1.2)),
        green(Vec3::new(0.0, -2.0, -1.2), Vec3::new(0.0, 2.0, -1.2)),
        green(across - Vec3::Z * 3.0, across * 1.5 + Vec3::Z * 30.0),
        green(Vec3::ONE, Vec3::ONE),
    ];
    let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
    scene.lines = &lines;
    scene.line_width_px = 3.0;
    let image = target.draw(&scene).expect("a picture");
    let column = |x: u32| (0..SIZE).filter(|&y| is_green(pixel(&image, x, y))).count();
    assert!((2..=4).contains(&column(40)), "the line before the ball is {} wide", column(40));
    assert!(!is_green(pixel(&image, 64, 80)), "what is behind the ball is hidden");
    assert!(is_green(pixel(&image, 63, 4)) || is_green(pixel(&image, 64, 4)));
    assert!(column(SIZE - 2) > 0, "a line that passes the eye is cut, not lost");
    assert_valid(&context);
}

#[test]
fn text_lies_over_everything() {
    let context = context();
    let (vertices, triangles) = ball(12);
    let mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let mut block = Text::new("L");
    block.origin_px = [60.0, 60.0];
    block.panel = Some([0, 0, 255, 255]);
    block.rgba = [255, 255, 0, 255];
    let text = [block];
    let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
    scene.text = &text;
    let image = target.draw(&scene).expect("a picture");
    // The panel's border is 4 dots of 2 pixels wide; then come the dots of the L.
    let dot = |column: u32, row: u32| pixel(&image, 60 + 8 + 2 * column + 1, 60 + 8 + 2 * row + 1);
    assert_eq!(pixel(&image, 61, 61), [0, 0, 255, 255]);
    for row in 0..7 {
        assert_eq!(dot(0, row), [255, 255, 0, 255], "row {row}");
        let foot = if row == 6 { [255, 255, 0, 255] } else { [0, 0, 255, 255] };
        assert_eq!(dot(3, row), foot, "row {row}");
    }
    assert_valid(&context);
}

#[test]
fn a_parallel_projection_keeps_sizes() {
    let context = context();
    let (vertices, triangles) = ball(32);
    let mesh = mesh_of(&context, &vertices, &triangles);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let camera = Camera::parallel(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 4.0, 1.0, 10.0);
    let image = target.draw(&Scene::new(&mesh, camera)).expect("a picture");
    let row: Vec<_> = (0..SIZE).map(|x| pixel(&image, x, 64)).collect();
    let wide = row.iter().filter(|p| !near(**p, [row[0][0], row[0][1], row[0][2]], 3)).count();
    assert!((63..=66).contains(&wide), "half the picture's width, not {wide}");
    assert_valid(&context);
}

#[test]
fn vertices_have_colours_of_their_own() {
    let context = context();
    let (vertices, triangles) = ball(24);
    let mesh = coloured_mesh_of(&context, &vertices, &triangles);
    let plain = mesh_of(&context, &vertices, &triangles);
    assert!(mesh.has_colours() && !plain.has_colours());
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    for shading in [Shading::Coloured, Shading::Patches] {
        let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
        scene.shading = shading;
        let image = target.draw(&scene).expect("a picture");
        let (above, below) = (pixel(&image, 64, 40), pixel(&image, 64, 84));
        assert!(above[2] > above[0] + 30 && above[2] > above[1] + 30, "{shading:?}: {above:?}");
        assert!(below[1] > below[0] + 30 && below[1] > below[2] + 30, "{shading:?}: {below:?}");
        // Where there are none it is clay.
        let mut scene = Scene::new(&plain, camera(SIZE, SIZE));
        scene.shading = shading;
        let clay = target.draw(&scene).expect("a picture");
        assert!(clay == target.draw(&Scene::new(&plain, camera(SIZE, SIZE))).expect("a picture"));
    }
    assert_valid(&context);
}

#[test]
fn a_section_opens_the_ball_and_shows_its_inside() {
    let context = context();
    let (vertices, triangles) = ball(24);
    let mesh = coloured_mesh_of(&context, &vertices, &triangles);
    let empty = mesh_of(&context, &[], &[]);
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let background = target.draw(&Scene::new(&empty, camera(SIZE, SIZE))).expect("a picture");
    for shading in Shading::ALL {
        let mut draw = |normal: Vec3, offset: f32| {
            let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
            scene.shading = shading;
            scene.section = Some(Section { normal, offset });
            target.draw(&scene).expect("a picture")
        };
        // The half towards the eye: what is left is seen from inside.
        let open = draw(Vec3::Z, 0.0);
        // Edges of triangles are dark.
        let middle = (0..400).map(|i| pixel(&open, 54 + i % 20, 54 + i / 20));
        let reds = middle.filter(|p| p[0] > p[1] + 20 && p[0] > p[2] + 15).count();
        assert!(reds > 200, "{shading:?}: {reds} of 400");
        // The right half, with a normal of another length: it is gone.
        let left = draw(Vec3::X * 5.0, 0.0);
        assert_eq!(pixel(&left, 90, 64), pixel(&background, 90, 64), "{shading:?}");
        assert!(!is_red(pixel(&left, 40, 64)), "{shading:?}");
        // A plane that meets nothing.
        let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
        scene.shading = shading;
        let whole = target.draw(&scene).expect("a picture");
        let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
        (scene.shading, scene.section) = (shading, Some(Section { normal: Vec3::Y, offset: 9.0 }));
        assert!(whole == target.draw(&scene).expect("a picture"), "{shading:?}");
    }
    assert_valid(&context);
}
