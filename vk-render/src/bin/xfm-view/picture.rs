//! From a model and a camera to a picture, and a picture to a file.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mergetree::{Camera, FrontVertex};
use vk_render::{Image, MeshBuffers, MeshUpdate, Uploaded, Vertex};
use xfm_pager::Session;

use crate::error::Error;

const _: () = assert!(size_of::<FrontVertex>() == size_of::<Vertex>());

/// The camera as the renderer wants it. `radius` is that of the model: what is nearer than a ten-thousandth of it is cut
/// off.
pub(crate) fn render_camera(camera: &Camera, radius: f32) -> vk_render::Camera {
    vk_render::Camera {
        view: camera.view_matrix(),
        projection: vk_render::Camera::perspective_projection(
            camera.fov_y,
            camera.aspect(),
            (1e-4 * radius).max(f32::MIN_POSITIVE),
        ),
    }
}

/// Sends what changed in a session to the device.
pub(crate) fn upload(session: &mut Session, mesh: &mut MeshBuffers) -> Result<Uploaded, Error> {
    let changes = session.take_changes();
    Ok(mesh.update(&MeshUpdate {
        // The same twenty bytes under another name.
        vertices: bytemuck::cast_slice(session.vertices()),
        vertex_ranges: &changes.vertices,
        triangles: session.triangles(),
        triangle_ranges: &changes.triangles,
    })?)
}

/// Writes a picture as PNG.
pub(crate) fn save(image: &Image, path: &Path) -> Result<(), Error> {
    let file = File::create(path).map_err(Error::file(path))?;
    let mut encoder = png::Encoder::new(BufWriter::new(file), image.width, image.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_compression(png::Compression::Fast);
    let png = |source| Error::Png { path: path.to_owned(), source };
    let mut writer = encoder.write_header().map_err(png)?;
    writer.write_image_data(&image.rgba).map_err(png)?;
    writer.finish().map_err(png)
}
