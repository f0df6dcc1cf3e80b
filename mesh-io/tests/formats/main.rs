//! Every format, in and out, through the public interface.
#![cfg(all(feature = "stl", feature = "ply", feature = "obj", feature = "gltf"))]

mod colour;
mod damage;
mod frame;
mod gltf;
mod obj;
mod output;
mod packed;
mod ply;
mod round_trip;
mod stl;
mod support;
