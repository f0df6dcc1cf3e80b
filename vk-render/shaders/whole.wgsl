// The last step of a mesh that nothing is cut from.

fn finish(linear: vec3<f32>, position: vec3<f32>) -> vec4<f32> {
    return to_target(linear, 1.0);
}
