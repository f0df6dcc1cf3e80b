"""Reading meshes with trimesh, exactly as they lie in the file."""

from pathlib import Path

import numpy as np
import trimesh

# Materials would need a library for pictures.
OBJ_OPTIONS = {"skip_materials": True, "group_material": False, "split_object": False}


def load(path):
    """A mesh with the file's own vertices and faces; of an STL, vertices welded by their bits."""
    suffix = Path(path).suffix.lower()
    options = OBJ_OPTIONS if suffix == ".obj" else {}
    scene = trimesh.load_scene(path, process=False, maintain_order=True, **options)
    mesh = _joined(scene)
    if len(mesh.faces) == 0:
        raise ValueError(f"{path}: no triangles")
    return weld(mesh) if suffix == ".stl" else mesh


def load_painted(path):
    """The vertices in use with their colours: distinct rows of x, y, z and four components, sorted."""
    suffix = Path(path).suffix.lower()
    options = OBJ_OPTIONS if suffix == ".obj" else {}
    mesh = trimesh.load_mesh(path, process=False, maintain_order=True, **options)
    if mesh.visual.kind != "vertex":
        raise ValueError(f"{path}: no colours of vertices")
    used = np.unique(mesh.faces)
    places = np.asarray(mesh.vertices, np.float32)[used] + np.float32(0)
    return np.unique(np.hstack([places, mesh.visual.vertex_colors[used]]), axis=0)


def write_painted(mesh, folder):
    """Writes a mesh with a colour of its own for each place; returns the file."""
    mesh = weld(mesh)
    low, high = mesh.bounds
    share = (mesh.vertices - low) / (high - low)
    chequered = np.indices((len(mesh.vertices), 1))[0] % 2
    colours = np.hstack([share, 1 - 0.3 * chequered])
    mesh.visual.vertex_colors = (255 * colours).astype(np.uint8)
    file = Path(folder) / "painted.ply"
    file.write_bytes(mesh.export(file_type="ply"))
    return file


def _joined(scene):
    """All of a scene's meshes as one, without materials: copying those needs more libraries."""
    vertices, faces, count = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        part = scene.geometry[name]
        if not isinstance(part, trimesh.Trimesh):
            continue
        moved = not np.array_equal(transform, np.eye(4))
        positions = trimesh.transform_points(part.vertices, transform) if moved else part.vertices
        vertices.append(np.asarray(positions))
        faces.append(np.asarray(part.faces) + count)
        count += len(positions)
    return trimesh.Trimesh(
        np.concatenate(vertices), np.concatenate(faces), process=False, validate=False
    )


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
