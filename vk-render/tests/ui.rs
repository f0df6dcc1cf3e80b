//! A user interface's triangles: textures, colours, clipping, changes, and what is wrong with them.

mod common;

use common::{assert_valid, ball, camera, context, mesh_of};
use vk_render::{Context, Error, Image, Offscreen, Scene, Texture, Ui, UiPiece, UiVertex};

const SIZE: u32 = 64;

/// A rectangle with the whole texture on it.
fn rectangle([left, top, right, bottom]: [f32; 4], rgba: [u8; 4]) -> [UiVertex; 4] {
    [
        (left, top, [0.0, 0.0]),
        (right, top, [1.0, 0.0]),
        (right, bottom, [1.0, 1.0]),
        (left, bottom, [0.0, 1.0]),
    ]
    .map(|(x, y, uv)| UiVertex { position_px: [x, y], uv, rgba })
}

const TWO: [u32; 6] = [0, 1, 2, 0, 2, 3];

fn draw(context: &Context, ui: Ui<'_>) -> Image {
    let mesh = mesh_of(context, &[], &[]);
    let mut target = Offscreen::new(context, SIZE, SIZE).expect("a target");
    let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
    scene.ui = ui;
    target.draw(&scene).expect("a picture")
}

fn near(a: Option<[u8; 4]>, b: [u8; 3]) -> bool {
    a.is_some_and(|a| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 2))
}

#[test]
fn textures_are_drawn_where_they_belong_and_clipped() {
    let context = context();
    // Red, green; blue, white.
    let texels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255; 4]];
    let texture = Texture::new(&context, [2, 2], texels.as_flattened()).expect("a texture");
    let vertices = rectangle([8.0, 8.0, 56.0, 56.0], [255; 4]);
    let piece = UiPiece { clip_px: [0.0, 0.0, 56.0, 40.0], texture: &texture, indices: 0..6 };
    let pieces = [piece];
    let image = draw(&context, Ui { vertices: &vertices, indices: &TWO, pieces: &pieces });
    assert!(near(image.pixel(12, 12), [255, 0, 0]), "{:?}", image.pixel(12, 12));
    assert!(near(image.pixel(52, 12), [0, 255, 0]), "{:?}", image.pixel(52, 12));
    let bare = draw(&context, Ui::default());
    for (x, y) in [(2, 2), (60, 20), (12, 50)] {
        assert_eq!(image.pixel(x, y), bare.pixel(x, y), "outside of rectangle or clip: {x}, {y}");
    }
    assert_valid(&context);
}

#[test]
fn opacity_mixes_with_what_is_behind() {
    let context = context();
    let white = Texture::new(&context, [1, 1], &[255; 4]).expect("a texture");
    let bare = draw(&context, Ui::default());
    let shown = |rgba| {
        let vertices = rectangle([0.0, 0.0, 64.0, 64.0], rgba);
        let piece = UiPiece { clip_px: [0.0, 0.0, 64.0, 64.0], texture: &white, indices: 0..6 };
        draw(&context, Ui { vertices: &vertices, indices: &TWO, pieces: &[piece] })
    };
    assert_eq!(shown([0; 4]), bare, "what is not there does not show");
    assert!(near(shown([10, 200, 30, 255]).pixel(30, 30), [10, 200, 30]));
    // Colours are multiplied with their opacity: half of white.
    let half = shown([128; 4]).pixel(30, 30).expect("a pixel");
    let behind = bare.pixel(30, 30).expect("a pixel");
    assert!(half[0] > behind[0] + 40 && half[0] < 240, "{behind:?} became {half:?}");
    assert_valid(&context);
}

#[test]
fn parts_of_a_texture_change_from_picture_to_picture() {
    let context = context();
    let mut texture = Texture::new(&context, [4, 4], &[255; 64]).expect("a texture");
    let vertices = rectangle([0.0, 0.0, 64.0, 64.0], [255; 4]);
    for round in 0..20_u8 {
        let colour = [10 * round, 255 - 10 * round, 60, 255];
        texture.write([2, 0], [2, 4], &colour.repeat(8)).expect("a change");
        let piece = UiPiece { clip_px: [0.0, 0.0, 64.0, 64.0], texture: &texture, indices: 0..6 };
        let image = draw(&context, Ui { vertices: &vertices, indices: &TWO, pieces: &[piece] });
        assert!(near(image.pixel(60, 30), [colour[0], colour[1], 60]), "{:?}", image.pixel(60, 30));
        assert!(near(image.pixel(4, 30), [255; 3]));
    }
    texture.write([4, 4], [0, 0], &[]).expect("nothing to do");
    drop(texture);
    assert_valid(&context);
}

#[test]
fn wrong_sizes_ranges_and_indices_do_no_harm() {
    let context = context();
    for size in [[0, 1], [1, 0], [u32::MAX, 1]] {
        assert!(matches!(Texture::new(&context, size, &[]), Err(Error::PictureSize { .. })));
    }
    let white = Texture::new(&context, [1, 1], &[255; 4]).expect("a texture");
    let vertices = rectangle([0.0, 0.0, 64.0, 64.0], [255; 4]);
    let bare = draw(&context, Ui::default());
    let piece = |clip_px, indices| UiPiece { clip_px, texture: &white, indices };
    let all = [0.0, 0.0, 64.0, 64.0];
    for nothing in [
        piece(all, 6..100),
        piece([40.0, 0.0, 20.0, 64.0], 0..6),
        piece([-9.0, -9.0, -1.0, -1.0], 0..6),
        piece([f32::NAN; 4], 0..6),
        piece([100.0, 100.0, 200.0, 200.0], 0..6),
    ] {
        let ui = Ui { vertices: &vertices, indices: &TWO, pieces: &[nothing] };
        assert_eq!(draw(&context, ui), bare);
    }
    // An index beyond the corners reads something, and nothing is broken by it.
    let ui = Ui { vertices: &vertices, indices: &[0, 1, 1_000_000], pieces: &[piece(all, 0..3)] };
    draw(&context, ui);
    assert_valid(&context);
}

#[test]
fn panels_stay_above_the_mesh() {
    let context = context();
    let (vertices, triangles) = ball(16);
    let mesh = mesh_of(&context, &vertices, &triangles);
    let white = Texture::new(&context, [1, 1], &[255; 4]).expect("a texture");
    let corners = rectangle([0.0, 0.0, 32.0, 64.0], [20, 30, 200, 255]);
    let pieces = [UiPiece { clip_px: [0.0, 0.0, 64.0, 64.0], texture: &white, indices: 0..6 }];
    let mut target = Offscreen::new(&context, SIZE, SIZE).expect("a target");
    let mut scene = Scene::new(&mesh, camera(SIZE, SIZE));
    let without = target.draw(&scene).expect("a picture");
    scene.ui = Ui { vertices: &corners, indices: &TWO, pieces: &pieces };
    let with = target.draw(&scene).expect("a picture");
    assert!(near(with.pixel(20, 32), [20, 30, 200]));
    assert_eq!(with.pixel(40, 32), without.pixel(40, 32));
    assert_valid(&context);
}
