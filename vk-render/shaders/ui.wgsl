// Panels of a user interface: triangles in pixels over the picture, each corner with a place in a texture and a colour.

struct Corner {
    x_px: f32,
    y_px: f32,
    u: f32,
    v: f32,
    rgba: u32,
}

@group(1) @binding(0) var<storage, read> corners: array<Corner>;
@group(1) @binding(1) var<storage, read> indices: array<u32>;
@group(2) @binding(0) var atlas: texture_2d<f32>;
@group(2) @binding(1) var atlas_sampler: sampler;

struct Piece {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(linear) uv: vec2<f32>,
    @location(1) @interpolate(linear) rgba: vec4<f32>,
}

@vertex
fn vs_ui(@builtin(vertex_index) index: u32) -> Piece {
    let corner = corners[indices[index]];
    var out: Piece;
    out.clip = vec4<f32>(vec2<f32>(corner.x_px, corner.y_px) / frame.viewport_px * 2.0 - 1.0, 1.0, 1.0);
    out.uv = vec2<f32>(corner.u, corner.v);
    out.rgba = unpack4x8unorm(corner.rgba);
    return out;
}

// Colours come multiplied with their opacity, in sRGB; they are mixed as the target mixes.
@fragment
fn fs_ui(in: Piece) -> @location(0) vec4<f32> {
    // At an edge with several samples the middle of a pixel may lie outside of the triangle, and so beyond its colours.
    let seen = clamp(in.rgba, vec4<f32>(0.0), vec4<f32>(1.0)) * textureSample(atlas, atlas_sampler, in.uv);
    if frame.encode > 0.5 {
        return seen;
    }
    let colour = to_linear(min(seen.rgb / max(seen.a, 1e-6), vec3<f32>(1.0)));
    return vec4<f32>(colour * seen.a, seen.a);
}
