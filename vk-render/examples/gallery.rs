//! Writes one picture per shading: `cargo run -p vk-render --example gallery -- [FOLDER]`.

use glam::{Vec2, Vec3};
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::Path;
use vk_render::{
    Camera, Context, ContextOptions, Image, MeshBuffers, MeshUpdate, Offscreen, Scene, Shading,
    Text, Vertex,
};

const AROUND: u32 = 192;
const UP: u32 = 96;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".into());
    fs::create_dir_all(&folder)?;
    let context = Context::new(&ContextOptions::default())?;
    let (vertices, triangles) = pebble();
    let mut mesh = MeshBuffers::new(&context)?;
    mesh.update(&MeshUpdate {
        vertices: &vertices,
        triangles: &triangles,
        ..MeshUpdate::default()
    })?;

    let camera =
        Camera::perspective(Vec3::new(1.6, 1.3, 2.6), Vec3::ZERO, Vec3::Y, 0.75, 1.6, 0.01);
    let watched =
        Camera::perspective(Vec3::new(-0.4, 1.8, 1.4), Vec3::ZERO, Vec3::Y, 0.5, 1.6, 0.2);
    let lines = watched.frustum_lines(1.9, [255, 176, 32, 255]);
    let mut target = Offscreen::new(&context, 1280, 800)?;
    for shading in Shading::ALL {
        let caption =
            format!("{shading:?}\n{} triangles\n{}", triangles.len(), context.device_name());
        let text = [Text::new(&caption)];
        let mut scene = Scene::new(&mesh, camera);
        scene.shading = shading;
        scene.lines = &lines;
        scene.text = &text;
        scene.max_level = 12;
        let path = Path::new(&folder).join(format!("{shading:?}.png"));
        save(&target.draw(&scene)?, &path)?;
        println!("{}", path.display());
    }
    Ok(())
}

/// A ball with waves on it, finer towards the top, and with a window cut into its side.
fn pebble() -> (Vec<Vertex>, Vec<[u32; 3]>) {
    let at = |u: f32, v: f32| {
        let (around, up) = (u * std::f32::consts::TAU, v * std::f32::consts::PI);
        let ball = Vec3::new(around.sin() * up.sin(), -up.cos(), around.cos() * up.sin());
        ball * (1.0 + 0.07 * (5.0 * around).sin() * up.sin().powi(3) + 0.05 * (9.0 * up).cos())
    };
    let mut vertices = Vec::new();
    for j in 0..=UP {
        for i in 0..AROUND {
            let place = Vec2::new(i as f32 / AROUND as f32, j as f32 / UP as f32);
            let v = place.y.clamp(0.002, 0.998);
            let e = 0.001;
            let along = at(place.x + e, v) - at(place.x - e, v);
            let upwards = at(place.x, v + e) - at(place.x, v - e);
            let level = (place.y * 12.0) as u8;
            vertices.push(Vertex::new(at(place.x, place.y), along.cross(upwards), level));
        }
    }
    let mut triangles = Vec::new();
    for j in 0..UP {
        for i in 0..AROUND {
            if (60..70).contains(&j) && (40..54).contains(&i) {
                continue;
            }
            let (a, b) = (j * AROUND + i, j * AROUND + (i + 1) % AROUND);
            triangles.push([a, b, b + AROUND]);
            triangles.push([a, b + AROUND, a + AROUND]);
        }
    }
    (vertices, triangles)
}

fn save(image: &Image, path: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let file = BufWriter::new(File::create(path)?);
    let mut encoder = png::Encoder::new(file, image.width, image.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&image.rgba)?;
    Ok(())
}
