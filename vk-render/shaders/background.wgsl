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
    let top = frame.background_top.rgb;
    let bottom = frame.background_bottom.rgb;
    let eased = down * down * (3.0 - 2.0 * down);
    // Interleaved gradient noise (Jimenez, Next Generation Post Processing in Call of Duty, 2014): a few products per pixel.
    let grain = fract(52.9829189 * fract(dot(floor(in.clip.xy), vec2<f32>(0.06711056, 0.00583715)))) - 0.5;
    let colour = clamp(mix(top, bottom, eased) + grain / 255.0, vec3<f32>(0.0), vec3<f32>(1.0));
    return vec4<f32>(srgb_to_target(colour), 1.0);
}
