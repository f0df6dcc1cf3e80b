"""Reads a mesh with trimesh and leaves its arrays for the peers: prepare.py MESH FOLDER

FOLDER/positions.npy: float32, (vertices, 3); FOLDER/triangles.npy: uint32, (triangles, 3). Vertices are shared
between triangles, as every peer needs them. Prints the counts as JSON.
"""

import json
import pathlib
import sys

import numpy as np
import trimesh


def main(source, folder):
    mesh = trimesh.load(source, force="mesh", process=False)
    if len(mesh.vertices) == 3 * len(mesh.faces):
        # A soup, as STL is.
        mesh.merge_vertices()
    folder = pathlib.Path(folder)
    np.save(folder / "positions.npy", np.ascontiguousarray(mesh.vertices, dtype=np.float32))
    np.save(folder / "triangles.npy", np.ascontiguousarray(mesh.faces, dtype=np.uint32))
    print(json.dumps({"vertices": len(mesh.vertices), "triangles": len(mesh.faces)}))


if __name__ == "__main__":
    main(*sys.argv[1:])
