//! A state as a scene, and a picture as a file.

use std::path::Path;

use mergetree::Camera;
use vk_render::{Image, Line, MeshBuffers, Scene};

use crate::camera::outside;
use crate::error::Error;
use crate::model::Model;
use crate::output;
use crate::state::State;

/// The camera as the renderer wants it. What is nearer than a hundred-thousandth of the model's `radius` is cut off.
pub(crate) fn render_camera(camera: &Camera, radius: f32) -> vk_render::Camera {
    vk_render::Camera {
        view: camera.view_matrix(),
        projection: vk_render::Camera::perspective_projection(
            camera.fov_y,
            camera.aspect(),
            (1e-5 * radius).max(f32::MIN_POSITIVE),
        ),
    }
}

/// Lines that belong to a state: the frustum of a frozen camera.
pub(crate) fn lines(state: &State) -> Vec<Line> {
    state.frozen.map_or_else(Vec::new, |frozen| outside::frustum(&frozen, state.radius()))
}

/// The model as a state shows it, without panels.
pub(crate) fn scene<'a>(
    state: &State,
    mesh: &'a MeshBuffers,
    model: Option<&Model>,
    lines: &'a [Line],
) -> Scene<'a> {
    let mut scene = Scene::new(mesh, render_camera(&state.camera(), state.radius()));
    scene.shading = state.shading();
    if let Some(model) = model {
        scene.inside_out = model.is_inside_out();
        scene.max_level = model.depth;
    }
    scene.section = state.section.plane(state.bounds);
    scene.lines = lines;
    scene
}

/// Writes a picture as PNG.
pub(crate) fn save(image: &Image, path: &Path) -> Result<(), Error> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, image.width, image.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_compression(png::Compression::Fast);
    let png = |source| Error::Png { path: path.to_owned(), source };
    let mut writer = encoder.write_header().map_err(png)?;
    writer.write_image_data(&image.rgba).map_err(png)?;
    writer.finish().map_err(png)?;
    output::write(path, &bytes)
}
