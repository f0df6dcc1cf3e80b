// What every pass sees: the frame's constants, and the way out to the picture.

struct Frame {
    view: mat4x4<f32>,
    projection: mat4x4<f32>,
    // In sRGB.
    background_top: vec4<f32>,
    background_bottom: vec4<f32>,
    viewport_px: vec2<f32>,
    line_width_px: f32,
    max_level: f32,
    // 1 where the target stores what it is given, and the encoding to sRGB is the shader's work.
    encode: f32,
    perspective: f32,
    // 1 where triangles are clockwise seen from outside, else 0.
    inside_out: f32,
    padding: f32,
    // A plane in view space: what lies on its positive side is cut away, where a pass looks at it.
    section: vec4<f32>,
}

@group(0) @binding(0) var<uniform> frame: Frame;

fn to_linear(srgb: vec3<f32>) -> vec3<f32> {
    let low = srgb / 12.92;
    let high = pow((srgb + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, low, srgb <= vec3<f32>(0.04045));
}

fn to_srgb(linear: vec3<f32>) -> vec3<f32> {
    let low = linear * 12.92;
    let high = 1.055 * pow(max(linear, vec3<f32>(0.0)), vec3<f32>(1.0 / 2.4)) - 0.055;
    return select(high, low, linear <= vec3<f32>(0.0031308));
}

fn to_target(linear: vec3<f32>, alpha: f32) -> vec4<f32> {
    if frame.encode > 0.5 {
        return vec4<f32>(to_srgb(linear), alpha);
    }
    return vec4<f32>(linear, alpha);
}

// For what has its colour in sRGB already: nothing is to be done where the target stores it so.
fn srgb_to_target(srgb: vec3<f32>) -> vec3<f32> {
    if frame.encode > 0.5 {
        return srgb;
    }
    return to_linear(srgb);
}
