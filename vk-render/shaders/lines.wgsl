// Lines as quads of constant width on the screen, with the mesh's depth, smooth at their sides.

struct Line {
    a: vec3<f32>,
    rgba: u32,
    b: vec3<f32>,
    padding: u32,
}

@group(1) @binding(0) var<storage, read> lines: array<Line>;

struct Quad {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(linear) side_px: f32,
    @location(1) @interpolate(flat) rgba: vec4<f32>,
}

@vertex
fn vs_line(@builtin(vertex_index) index: u32) -> Quad {
    let line = lines[index / 6u];
    let corner = index % 6u;
    let at_end = corner == 1u || corner == 2u || corner == 4u;
    let side = select(-1.0, 1.0, corner == 2u || corner == 4u || corner == 5u);

    let world_to_clip = frame.projection * frame.view;
    var a = world_to_clip * vec4<f32>(line.a, 1.0);
    var b = world_to_clip * vec4<f32>(line.b, 1.0);
    // What lies behind the eye has no place on the screen: cut there, just in front of it.
    let near = max(max(a.w, b.w) * 1e-4, 1e-12);
    var out: Quad;
    out.rgba = unpack4x8unorm(line.rgba);
    out.side_px = 0.0;
    out.clip = vec4<f32>(2.0, 2.0, 2.0, 1.0);
    if a.w < near && b.w < near {
        return out;
    }
    if a.w < near {
        a = mix(a, b, (near - a.w) / (b.w - a.w));
    } else if b.w < near {
        b = mix(b, a, (near - b.w) / (a.w - b.w));
    }
    let half_viewport = frame.viewport_px * 0.5;
    var along = (b.xy / b.w - a.xy / a.w) * half_viewport;
    let size = length(along);
    along = select(vec2<f32>(1.0, 0.0), along / size, size > 1e-6);
    let across = vec2<f32>(-along.y, along.x);
    // Half a pixel more on each side, in which the line fades out.
    let half_width = frame.line_width_px * 0.5 + 0.5;
    let end = select(a, b, at_end);
    let offset_px = across * side * half_width + along * select(-0.5, 0.5, at_end);
    out.clip = vec4<f32>(end.xy + offset_px / half_viewport * end.w, end.z, end.w);
    out.side_px = side * half_width;
    return out;
}

@fragment
fn fs_line(in: Quad) -> @location(0) vec4<f32> {
    let cover = clamp(frame.line_width_px * 0.5 + 0.5 - abs(in.side_px), 0.0, 1.0);
    return vec4<f32>(srgb_to_target(in.rgba.rgb), in.rgba.a * cover);
}
