//! Runs egui and keeps on the device what it paints with.

use std::collections::BTreeMap;
use std::ops::Range;

use egui::epaint::Primitive;
use egui::{ClippedPrimitive, FullOutput, PlatformOutput, RawInput, TextureId};
use vk_render::{Context, Texture, Ui, UiPiece, UiVertex};

use crate::error::Error;
use crate::panels::style;

/// Everything of egui but where its input comes from.
pub(crate) struct Overlay {
    pub(crate) context: egui::Context,
    textures: BTreeMap<TextureId, Texture>,
    vertices: Vec<UiVertex>,
    indices: Vec<u32>,
    pieces: Vec<(TextureId, [f32; 4], Range<u32>)>,
    /// What bars left of the window in the last frame, if there was one.
    free: Option<egui::Rect>,
}

/// What came of a frame.
pub(crate) struct Ran {
    pub(crate) platform: PlatformOutput,
    /// Whether egui wants to paint again at once: something moves.
    pub(crate) again: bool,
}

impl Overlay {
    pub(crate) fn new() -> Self {
        let context = egui::Context::default();
        style::apply(&context);
        Self {
            context,
            textures: BTreeMap::new(),
            vertices: Vec::new(),
            indices: Vec::new(),
            pieces: Vec::new(),
            free: None,
        }
    }

    /// Lets egui lay out and paint, into memory and textures.
    pub(crate) fn run(
        &mut self,
        device: &Context,
        input: RawInput,
        mut panels: impl FnMut(&egui::Context),
    ) -> Result<Ran, Error> {
        let mut free = None;
        let FullOutput {
            platform_output,
            textures_delta,
            shapes,
            pixels_per_point,
            viewport_output,
        } = self.context.run(input, |context| {
            panels(context);
            free = Some(context.available_rect());
        });
        self.free = free;
        for (id, delta) in &textures_delta.set {
            let egui::ImageData::Color(image) = &delta.image;
            let size = image.size.map(|side| side as u32);
            let bytes: &[u8] = bytemuck::cast_slice(&image.pixels);
            match (delta.pos, self.textures.get_mut(id)) {
                (Some(origin), Some(texture)) => {
                    texture.write(origin.map(|place| place as u32), size, bytes)?;
                }
                _ => {
                    self.textures.insert(*id, Texture::new(device, size, bytes)?);
                }
            }
        }
        for id in &textures_delta.free {
            // What is being drawn keeps it.
            self.textures.remove(id);
        }
        let primitives = self.context.tessellate(shapes, pixels_per_point);
        self.gather(&primitives, pixels_per_point);
        let again = viewport_output.values().any(|viewport| viewport.repaint_delay.is_zero());
        Ok(Ran { platform: platform_output, again })
    }

    fn gather(&mut self, primitives: &[ClippedPrimitive], scale: f32) {
        self.vertices.clear();
        self.indices.clear();
        self.pieces.clear();
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            let Primitive::Mesh(mesh) = primitive else { continue };
            let first = self.vertices.len() as u32;
            let start = self.indices.len() as u32;
            self.vertices.extend(mesh.vertices.iter().map(|vertex| UiVertex {
                position_px: [scale * vertex.pos.x, scale * vertex.pos.y],
                uv: [vertex.uv.x, vertex.uv.y],
                rgba: vertex.color.to_array(),
            }));
            self.indices.extend(mesh.indices.iter().map(|index| first + index));
            let clip = [clip_rect.min.x, clip_rect.min.y, clip_rect.max.x, clip_rect.max.y];
            let range = start..self.indices.len() as u32;
            self.pieces.push((mesh.texture_id, clip.map(|edge| scale * edge), range));
        }
    }

    /// Whether a panel is at a place, in pixels from the upper left. Asked of the place itself: where egui last saw the
    /// pointer may be a frame ago.
    pub(crate) fn covers(&self, place: glam::Vec2) -> bool {
        let scale = self.context.pixels_per_point();
        let place = egui::pos2(place.x / scale, place.y / scale);
        match self.context.layer_id_at(place) {
            // Bars take their part of the window away.
            Some(layer) if layer.order == egui::Order::Background => {
                self.free.is_some_and(|free| !free.contains(place))
            }
            other => other.is_some(),
        }
    }

    /// What was painted, in pieces for [`Self::ui`].
    pub(crate) fn pieces(&self) -> Vec<UiPiece<'_>> {
        let with_texture = |(id, clip_px, indices): &(TextureId, [f32; 4], Range<u32>)| {
            let texture = self.textures.get(id)?;
            Some(UiPiece { clip_px: *clip_px, texture, indices: indices.clone() })
        };
        self.pieces.iter().filter_map(with_texture).collect()
    }

    pub(crate) fn ui<'a>(&'a self, pieces: &'a [UiPiece<'a>]) -> Ui<'a> {
        Ui { vertices: &self.vertices, indices: &self.indices, pieces }
    }
}
