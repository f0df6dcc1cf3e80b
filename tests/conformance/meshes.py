"""Reading meshes with trimesh, exactly as they lie in the file."""

from pathlib import Path

import numpy as np
import trimesh


def load(path):
    """A mesh with the file's own vertices and faces; of an STL, vertices welded by their bits."""
    mesh = trimesh.load(path, process=False, maintain_order=True, force="mesh")
    if not isinstance(mesh, trimesh.Trimesh):
        raise ValueError(f"{path}: no triangles")
    return weld(mesh) if Path(path).suffix.lower() == ".stl" else mesh


def weld(mesh):
    """The same faces, with vertices identified by their coordinates; -0 equals +0."""
    positions, index = np.unique(mesh.vertices + 0.0, axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    return trimesh.Trimesh(positions, faces, process=False, validate=False)


def write_formats(mesh, folder):
    """Writes a mesh in every format that trimesh has; returns the files."""
    folder = Path(folder)
    exports = {
        "trimesh-binary.stl": {"file_type": "stl"},
        "trimesh-text.stl": {"file_type": "stl_ascii"},
        "trimesh-binary.ply": {"file_type": "ply", "encoding": "binary"},
        "trimesh-text.ply": {"file_type": "ply", "encoding": "ascii"},
        "trimesh.obj": {"file_type": "obj"},
        "trimesh.glb": {"file_type": "glb"},
    }
    files = []
    for name, options in exports.items():
        data = mesh.export(**options)
        file = folder / name
        file.write_bytes(data.encode() if isinstance(data, str) else data)
        files.append(file)
    return files
