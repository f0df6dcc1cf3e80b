// Text and panels over the picture: rectangles in pixels, each carrying the bits of its own glyph.

struct Cell {
    origin_px: vec2<f32>,
    size_px: vec2<f32>,
    // Row by row from the top left, 5 bits to a row, 7 rows: 30 bits in the first word, the last row in the second.
    bits: vec2<u32>,
    rgba: u32,
    solid: u32,
}

@group(1) @binding(0) var<storage, read> cells: array<Cell>;

struct Glyph {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(linear) place: vec2<f32>,
    @location(1) @interpolate(flat) bits: vec2<u32>,
    @location(2) @interpolate(flat) rgba: vec4<f32>,
    @location(3) @interpolate(flat) solid: u32,
}

@vertex
fn vs_overlay(@builtin(vertex_index) index: u32) -> Glyph {
    let cell = cells[index / 6u];
    let corner = index % 6u;
    let right = corner == 1u || corner == 2u || corner == 4u;
    let bottom = corner == 2u || corner == 4u || corner == 5u;
    let place = vec2<f32>(select(0.0, 1.0, right), select(0.0, 1.0, bottom));
    var out: Glyph;
    let at_px = cell.origin_px + place * cell.size_px;
    out.clip = vec4<f32>(at_px / frame.viewport_px * 2.0 - 1.0, 1.0, 1.0);
    out.place = place * vec2<f32>(5.0, 7.0);
    out.bits = cell.bits;
    out.rgba = unpack4x8unorm(cell.rgba);
    out.solid = cell.solid;
    return out;
}

@fragment
fn fs_overlay(in: Glyph) -> @location(0) vec4<f32> {
    let column = u32(clamp(in.place.x, 0.0, 4.99));
    let row = u32(clamp(in.place.y, 0.0, 6.99));
    let word = select(in.bits.x, in.bits.y, row == 6u);
    let bit = select(row * 5u, 0u, row == 6u) + column;
    if in.solid == 0u && ((word >> bit) & 1u) == 0u {
        discard;
    }
    return vec4<f32>(srgb_to_target(in.rgba.rgb), in.rgba.a);
}
