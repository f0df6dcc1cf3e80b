"""Whether two meshes have the same triangles, and how far their vertices are apart."""

import numpy as np
from scipy.spatial import cKDTree


def triangle_rows(mesh):
    """The triangles as sorted rows of nine coordinates.

    Each triangle starts at its least corner, which keeps its orientation; coordinates are those of
    single precision, in which every reader agrees on a number in text.
    """
    corners = np.asarray(mesh.vertices, np.float32)[mesh.faces] + np.float32(0)
    # A corner's rank among all positions stands for it in comparisons.
    _, rank = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    rank = rank.reshape(-1, 3)
    first = rank.argmin(axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    rows = np.take_along_axis(corners, order[:, :, None], axis=1).reshape(-1, 9)
    return rows[np.lexsort(rows.T[::-1])]


def differing_triangles(mesh, other):
    """How many triangles, counted as often as they occur, only one of both meshes has."""
    rows, others = triangle_rows(mesh), triangle_rows(other)
    if rows.shape == others.shape and (rows == others).all():
        return 0
    both = np.concatenate([rows, others])
    _, index = np.unique(both, axis=0, return_inverse=True)
    index = index.reshape(-1)
    count = np.bincount(index[: len(rows)], minlength=index.max() + 1)
    count -= np.bincount(index[len(rows) :], minlength=index.max() + 1)
    return int(np.abs(count).sum())


def vertex_distance(mesh, other):
    """The greatest distance from a vertex in use of either mesh to the nearest of the other."""
    used = [m.vertices[np.unique(m.faces)] for m in (mesh, other)]
    there = cKDTree(used[1]).query(used[0])[0].max()
    back = cKDTree(used[0]).query(used[1])[0].max()
    return float(max(there, back))
