"""What trimesh, NumPy and SciPy say about a mesh's connectivity."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


@dataclass
class Facts:
    """Numbers and properties of one mesh."""

    triangles: int
    vertices: int
    edges: int
    boundary_edges: int
    components: int
    euler: int
    watertight: bool
    winding: bool
    edge_manifold: bool
    vertex_manifold: bool
    degenerate: int
    volume: float
    area: float
    diagonal: float

    @property
    def manifold(self):
        """Every edge has at most two faces, every vertex one fan, and neighbours agree."""
        return self.edge_manifold and self.vertex_manifold and self.winding and not self.degenerate

    @property
    def closed(self):
        """A manifold without boundary."""
        return self.manifold and self.watertight


def describe(mesh):
    """The facts of a mesh; connectivity by its own vertex numbers."""
    faces = np.asarray(mesh.faces)
    corners = faces[:, [0, 1, 2]]
    degenerate = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    _, faces_at_edge = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    return Facts(
        triangles=len(faces),
        vertices=len(np.unique(faces)),
        edges=len(faces_at_edge),
        boundary_edges=int((faces_at_edge == 1).sum()),
        components=_components(faces),
        euler=int(mesh.euler_number),
        watertight=bool(mesh.is_watertight),
        winding=_winding(faces),
        edge_manifold=bool((faces_at_edge <= 2).all()),
        vertex_manifold=_fans(faces) == len(np.unique(faces)),
        degenerate=int(degenerate.sum()),
        volume=float(mesh.volume),
        area=float(mesh.area),
        diagonal=float(np.linalg.norm(np.ptp(mesh.vertices[np.unique(faces)], axis=0))),
    )


def _components(faces):
    """Number of pieces that hang together by vertices."""
    used, index = np.unique(faces, return_inverse=True)
    index = index.reshape(-1, 3)
    rows = np.concatenate([index[:, 0], index[:, 1]])
    columns = np.concatenate([index[:, 1], index[:, 2]])
    graph = coo_matrix((np.ones(len(rows), bool), (rows, columns)), shape=(len(used), len(used)))
    return int(connected_components(graph, directed=False)[0])


def _directed_edges(faces):
    """Start and end of each face's edges, in the order of the corners that they start at."""
    return faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)


def _winding(faces):
    """Whether no directed edge occurs twice: trimesh asks this of closed edges only."""
    start, end = _directed_edges(faces)
    return len(np.unique(np.stack([start, end], axis=1), axis=0)) == len(start)


def _fans(faces):
    """Number of fans of triangles, over all vertices: corners that hang together across edges."""
    start, end = _directed_edges(faces)
    size = int(faces.max()) + 1 if len(faces) else 1
    corner = np.arange(len(start))
    following = corner - corner % 3 + (corner + 1) % 3
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.argsort(low * size + high, kind="stable")
    key = (low * size + high)[order]
    same = np.flatnonzero(key[1:] == key[:-1])
    first, second = order[same], order[same + 1]
    # The corners of both faces at each end of their common edge.
    at_low = [np.where(start[e] == low[e], corner[e], following[e]) for e in (first, second)]
    at_high = [np.where(start[e] == high[e], corner[e], following[e]) for e in (first, second)]
    rows = np.concatenate([at_low[0], at_high[0]])
    columns = np.concatenate([at_low[1], at_high[1]])
    graph = coo_matrix((np.ones(len(rows), bool), (rows, columns)), shape=(len(start),) * 2)
    return int(connected_components(graph, directed=False)[0])
