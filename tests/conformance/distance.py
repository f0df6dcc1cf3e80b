"""Distances between surfaces, from trimesh's own samples and proximity queries."""

import numpy as np
import trimesh

SAMPLES = 3_000


def one_sided(mesh, other):
    """Mean, RMS and greatest distance from samples of one surface to the other."""
    points, _ = trimesh.sample.sample_surface(mesh, SAMPLES, seed=1)
    _, distances, _ = trimesh.proximity.closest_point(other, points)
    return {
        "mean": float(distances.mean()),
        "rms": float(np.sqrt((distances**2).mean())),
        "max": float(distances.max()),
    }
