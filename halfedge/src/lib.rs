//! Directed-edge connectivity of triangle meshes: one-rings, half-edge collapse and its exact inverse, manifold repair.
