// A soft vertical gradient, drawn as one triangle that covers the picture.

struct Covered {
    @builtin(position) clip: vec4<f32>,
}

@vertex
fn vs_background(@builtin(vertex_index) index: u32) -> Covered {
    let corner = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    var out: Covered;
    out.clip = vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0);
    return out;
}

@fragment
fn fs_background(in: Covered) -> @location(0) vec4<f32> {
    let down = in.clip.y / frame.viewport_px.y;
    // Mixed as the eye sees it, and dithered by less than one step of eight bits, so that no bands show.
    let top = to_srgb(frame.background_top.rgb);
    let bottom = to_srgb(frame.background_bottom.rgb);
    let eased = down * down * (3.0 - 2.0 * down);
    let grain = fract(sin(dot(floor(in.clip.xy), vec2<f32>(12.9898, 78.233))) * 43758.547) - 0.5;
    let colour = clamp(mix(top, bottom, eased) + grain / 255.0, vec3<f32>(0.0), vec3<f32>(1.0));
    return to_target(to_linear(colour), 1.0);
}
