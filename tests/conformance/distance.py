"""Distances between surfaces, from trimesh's own samples and proximity queries."""

import numpy as np
import trimesh

SAMPLES = 3_000

# Diagonal of the meshes that are queried: trimesh takes squared distances that differ by less than 1e-8 for equal, and of
# equally distant triangles one by its normal, which in a mesh of small coordinates need not be the nearest at all.
DIAGONAL = 1_000.0


def one_sided(mesh, other):
    """Mean, RMS and greatest distance from samples of one surface to the other."""
    scale = DIAGONAL / mesh.scale
    mesh, other = (m.copy().apply_scale(scale) for m in (mesh, other))
    points, _ = trimesh.sample.sample_surface(mesh, SAMPLES, seed=1)
    _, distances, _ = trimesh.proximity.closest_point(other, points)
    distances /= scale
    return {
        "mean": float(distances.mean()),
        "rms": float(np.sqrt((distances**2).mean())),
        "max": float(distances.max()),
    }
