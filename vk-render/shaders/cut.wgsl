// The last step of a mesh that is cut: at the end, because nothing after it knows how a face goes on in the pixels beside.

fn finish(linear: vec3<f32>, position: vec3<f32>) -> vec4<f32> {
    if dot(frame.section.xyz, position) + frame.section.w > 0.0 {
        discard;
    }
    return to_target(linear, 1.0);
}
