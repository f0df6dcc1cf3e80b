// The mesh. Vertices are pulled from a storage buffer: by index (shared between triangles, cheap), or corner by corner
// where a shading needs to know the triangle (edges, one colour per face).

// As `Vertex` in Rust: 20 bytes, so no member may be a vec3, whose alignment is 16.
struct Vertex {
    x: f32,
    y: f32,
    z: f32,
    normal: u32,
    level: u32,
}

@group(1) @binding(0) var<storage, read> vertices: array<Vertex>;
@group(1) @binding(1) var<storage, read> triangles: array<u32>;
// Of each vertex, where the mesh has any: red, green, blue in sRGB, and an opacity that is not looked at.
@group(1) @binding(2) var<storage, read> colours: array<u32>;

struct Surface {
    @builtin(position) clip: vec4<f32>,
    // Seen from the camera: x right, y up, z towards the viewer.
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) barycentric: vec3<f32>,
    @location(3) @interpolate(flat) level: f32,
    // Linear.
    @location(4) colour: vec3<f32>,
}

fn unfold(normal: u32) -> vec3<f32> {
    let folded = unpack2x16snorm(normal);
    var n = vec3<f32>(folded, 1.0 - abs(folded.x) - abs(folded.y));
    let below = max(-n.z, 0.0);
    n.x += select(below, -below, n.x >= 0.0);
    n.y += select(below, -below, n.y >= 0.0);
    return normalize(n);
}

fn place(vertex: Vertex) -> Surface {
    let seen = frame.view * vec4<f32>(vertex.x, vertex.y, vertex.z, 1.0);
    var out: Surface;
    out.clip = frame.projection * seen;
    out.position = seen.xyz;
    out.normal = (frame.view * vec4<f32>(unfold(vertex.normal), 0.0)).xyz;
    out.barycentric = vec3<f32>(1.0);
    out.level = f32(vertex.level & 0xffu);
    out.colour = vec3<f32>(0.0);
    return out;
}

fn colour_of(index: u32) -> vec3<f32> {
    return to_linear(unpack4x8unorm(colours[index]).rgb);
}

@vertex
fn vs_shared(@builtin(vertex_index) index: u32) -> Surface {
    return place(vertices[index]);
}

@vertex
fn vs_coloured(@builtin(vertex_index) index: u32) -> Surface {
    var out = place(vertices[index]);
    out.colour = colour_of(index);
    return out;
}

fn place_corner(index: u32) -> Surface {
    let first = index - index % 3u;
    let a = triangles[first];
    let b = triangles[first + 1u];
    let c = triangles[first + 2u];
    let corner = index % 3u;
    var out = place(vertices[select(select(c, b, corner == 1u), a, corner == 0u)]);
    out.barycentric = select(vec3<f32>(0.0), vec3<f32>(1.0), vec3<u32>(corner) == vec3<u32>(0u, 1u, 2u));
    // A face is as fine as its finest corner.
    let finest = max(max(vertices[a].level & 0xffu, vertices[b].level & 0xffu), vertices[c].level & 0xffu);
    out.level = f32(finest);
    return out;
}

@vertex
fn vs_corner(@builtin(vertex_index) index: u32) -> Surface {
    return place_corner(index);
}

// As `vs_corner`, with one colour for the whole face: that of its finest corner, the first of them.
@vertex
fn vs_patch(@builtin(vertex_index) index: u32) -> Surface {
    var out = place_corner(index);
    let first = index - index % 3u;
    for (var k = 3u; k > 0u; k -= 1u) {
        let corner = triangles[first + k - 1u];
        if f32(vertices[corner].level & 0xffu) == out.level {
            out.colour = colour_of(corner);
        }
    }
    return out;
}

// The face's own normal, towards the viewer whatever the winding: y runs down the screen, hence the order.
fn face_normal(position: vec3<f32>) -> vec3<f32> {
    let n = cross(dpdy(position), dpdx(position));
    let size = length(n);
    return select(vec3<f32>(0.0, 0.0, 1.0), n / size, size > 0.0);
}

const CLAY = vec3<f32>(0.590, 0.485, 0.400);
const INSIDE = vec3<f32>(0.560, 0.045, 0.060);
const PAPER = vec3<f32>(0.720, 0.730, 0.740);
const INK = vec3<f32>(0.018, 0.024, 0.036);

fn towards_eye(position: vec3<f32>) -> vec3<f32> {
    return normalize(select(vec3<f32>(0.0, 0.0, 1.0), -position, frame.perspective > 0.5));
}

// A key from the upper left, a cooler fill from the right, sky and ground; all of them travel with the camera.
fn lit(base: vec3<f32>, n: vec3<f32>, position: vec3<f32>) -> vec3<f32> {
    let key = normalize(vec3<f32>(-0.60, 0.66, 0.45));
    let fill = normalize(vec3<f32>(0.80, -0.05, 0.45));
    let to_eye = towards_eye(position);

    let key_share = clamp(dot(n, key) * 0.92 + 0.08, 0.0, 1.0);
    let fill_share = max(dot(n, fill), 0.0);
    let ambient = mix(vec3<f32>(0.050, 0.044, 0.040), vec3<f32>(0.120, 0.135, 0.160), n.y * 0.5 + 0.5);
    let light = ambient + key_share * vec3<f32>(1.12, 1.06, 0.97) + fill_share * vec3<f32>(0.15, 0.18, 0.23);

    let half_way = normalize(key + to_eye);
    let shine = pow(max(dot(n, half_way), 0.0), 38.0) * 0.075;
    let rim = pow(clamp(1.0 - dot(n, to_eye), 0.0, 1.0), 3.5) * 0.09 * (0.6 + 0.4 * n.y);
    let colour = base * light + vec3<f32>(shine + rim);
    // Bright parts bend towards white instead of being cut off there.
    return colour / (vec3<f32>(1.0) + 0.16 * colour);
}

// Whether a face is seen from outside, which is its front unless the whole mesh is inside out.
fn seen_from_outside(front: bool) -> bool {
    return front != (frame.inside_out > 0.5);
}

fn base_colour(outside: vec3<f32>, front: bool) -> vec3<f32> {
    return select(INSIDE, outside, seen_from_outside(front));
}

// How much of a pixel an edge of the given half width covers. Where triangles shrink to pixels the lines fade to
// their average instead of drowning the picture.
fn edge_cover(barycentric: vec3<f32>, half_width_px: f32) -> f32 {
    let step = max(fwidth(barycentric), vec3<f32>(1e-7));
    let distances = barycentric / step;
    let nearest = min(min(distances.x, distances.y), distances.z);
    let cover = 1.0 - smoothstep(half_width_px - 0.5, half_width_px + 0.5, nearest);
    let density = max(max(step.x, step.y), step.z);
    return mix(cover, 0.60, smoothstep(0.22, 0.75, density));
}

// Coarse to fine: night blue, blue, green, yellow, red; even steps of hue, growing lightness until the last third.
fn level_colour(level: f32) -> vec3<f32> {
    let t = clamp(level / max(frame.max_level, 1.0), 0.0, 1.0) * 5.0;
    let c0 = vec3<f32>(0.060, 0.070, 0.330);
    let c1 = vec3<f32>(0.035, 0.260, 0.680);
    let c2 = vec3<f32>(0.020, 0.480, 0.420);
    let c3 = vec3<f32>(0.280, 0.630, 0.090);
    let c4 = vec3<f32>(0.900, 0.610, 0.045);
    let c5 = vec3<f32>(0.780, 0.110, 0.050);
    var colour = mix(c0, c1, clamp(t, 0.0, 1.0));
    colour = mix(colour, c2, clamp(t - 1.0, 0.0, 1.0));
    colour = mix(colour, c3, clamp(t - 2.0, 0.0, 1.0));
    colour = mix(colour, c4, clamp(t - 3.0, 0.0, 1.0));
    return mix(colour, c5, clamp(t - 4.0, 0.0, 1.0));
}

// The vertices' normal as it is to be lit.
fn shading_normal(in: Surface, front: bool) -> vec3<f32> {
    var n = normalize(in.normal) * select(1.0, -1.0, frame.inside_out > 0.5);
    // A face seen from inside is lit as seen, whether its normals follow its winding or not.
    if !seen_from_outside(front) && dot(n, towards_eye(in.position)) < 0.0 {
        n = -n;
    }
    // A vertex on a sharp edge has one normal for both sides of it; far from the face's own it is not believed.
    let flat = face_normal(in.position);
    return normalize(mix(flat, n, smoothstep(0.64, 0.91, dot(n, flat))));
}

@fragment
fn fs_smooth(in: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
    return finish(lit(base_colour(CLAY, front), shading_normal(in, front), in.position), in.position);
}

@fragment
fn fs_coloured(in: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
    return finish(lit(base_colour(in.colour, front), shading_normal(in, front), in.position), in.position);
}

@fragment
fn fs_patch(in: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
    let face = lit(base_colour(in.colour, front), face_normal(in.position), in.position);
    return finish(mix(face, face * 0.25, edge_cover(in.barycentric, 0.35) * 0.45), in.position);
}

@fragment
fn fs_flat(in: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
    return finish(lit(base_colour(CLAY, front), face_normal(in.position), in.position), in.position);
}

@fragment
fn fs_wireframe(in: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
    let face = lit(base_colour(PAPER, front), face_normal(in.position), in.position);
    return finish(mix(face, INK, edge_cover(in.barycentric, 0.65) * 0.94), in.position);
}

@fragment
fn fs_level(in: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
    let outside = level_colour(in.level);
    let face = lit(base_colour(outside, front), face_normal(in.position), in.position);
    return finish(mix(face, face * 0.25, edge_cover(in.barycentric, 0.35) * 0.55), in.position);
}

@fragment
fn fs_normals(in: Surface, @builtin(front_facing) front: bool) -> @location(0) vec4<f32> {
    // In the model's own axes: the view's rotation undone by its transpose.
    let seen = normalize(in.normal);
    let n = normalize((vec4<f32>(seen, 0.0) * frame.view).xyz);
    let colour = to_linear(n * 0.5 + 0.5);
    return finish(select(mix(colour * 0.15, INSIDE, 0.85), colour, seen_from_outside(front)), in.position);
}
