"""Decimates a prepared mesh with one peer: peer.py PEER FOLDER TRIANGLES OUT.ply

The time is that of the one call that decimates. Reading, converting the arrays to the types that the peer likes best,
and writing happen outside of it. Prints JSON: seconds, triangles, the resident memory in bytes before the call
(`rss_before`, with the mesh and the library in it) and at most until its end (`peak_rss`), and the package's version.
"""

import importlib
import importlib.metadata
import json
import os
import pathlib
import resource
import sys
import time

import numpy as np


# A peer gets positions (float32), triangles (uint32) and the number of triangles asked for. It returns the package's
# name, the call to be timed, and what makes positions and triangles from the call's result.


def meshoptimizer(positions, triangles, count):
    """`meshopt_simplify` without options; an error of 1, the mesh's extent, is no limit."""
    indices = triangles.ravel()
    try:
        library = importlib.import_module("almeshopt")
    except ImportError:
        library = importlib.import_module("meshoptimizer")
        out = np.empty_like(indices)
        call = lambda: out[: library.simplify(out, indices, positions, target_index_count=3 * count, target_error=1.0)]
        return "meshoptimizer", call, lambda kept: used(positions, kept.reshape(-1, 3))
    call = lambda: library.simplify(indices, positions, 3 * count, 1.0)
    return "almeshopt", call, lambda result: used(positions, result[0].reshape(-1, 3))


def fast_simplification(positions, triangles, count, aggression=7):
    """As it comes: an aggression of 7."""
    library = importlib.import_module("fast_simplification")
    triangles = triangles.astype(np.int32)
    call = lambda: library.simplify(positions, triangles, target_count=count, agg=aggression)
    return "fast-simplification", call, lambda result: result


def fast_simplification_3(positions, triangles, count):
    """With the aggression at which it is best on scans: 3."""
    return fast_simplification(positions, triangles, count, 3)


def pyfqmr(positions, triangles, count):
    """As it comes: its thresholds are in model units, so that its results depend on these."""
    library = importlib.import_module("pyfqmr")
    simplifier = library.Simplify()
    simplifier.setMesh(positions.astype(np.float64), triangles.astype(np.int32))
    call = lambda: simplifier.simplify_mesh(target_count=count, verbose=False)
    return "pyfqmr", call, lambda _: simplifier.getMesh()[:2]


def pymeshlab(positions, triangles, count):
    """Quadric edge collapse as it comes: optimal placement, quality threshold 0.3."""
    library = importlib.import_module("pymeshlab")
    meshes = library.MeshSet(verbose=False)
    meshes.add_mesh(library.Mesh(positions.astype(np.float64), triangles.astype(np.int32)))
    call = lambda: meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=count)

    def result(_):
        mesh = meshes.current_mesh()
        return mesh.vertex_matrix(), mesh.face_matrix()

    return "pymeshlab", call, result


def trimesh(positions, triangles, count):
    library = importlib.import_module("trimesh")
    mesh = library.Trimesh(positions, triangles, process=False)
    call = lambda: mesh.simplify_quadric_decimation(face_count=count)
    return "trimesh", call, lambda small: (small.vertices, small.faces)


PEERS = {
    "meshoptimizer": meshoptimizer,
    "fast-simplification": fast_simplification,
    "fast-simplification-3": fast_simplification_3,
    "pyfqmr": pyfqmr,
    "pymeshlab": pymeshlab,
    "trimesh": trimesh,
}


def used(positions, triangles):
    """The positions that triangles use, and the triangles of these."""
    numbers, triangles = np.unique(triangles, return_inverse=True)
    return positions[numbers], triangles.reshape(-1, 3)


def peak_rss():
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def current_rss():
    try:
        pages = int(pathlib.Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return peak_rss()


def write_ply(path, positions, triangles):
    """Writes a binary PLY."""
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"], faces["vertices"] = 3, triangles
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(positions)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    with open(path, "wb") as file:
        file.write(header.encode())
        file.write(np.ascontiguousarray(positions, dtype="<f4").tobytes())
        file.write(faces.tobytes())


def main(peer, folder, count, path):
    folder = pathlib.Path(folder)
    positions, triangles = (np.load(folder / f"{name}.npy") for name in ("positions", "triangles"))
    package, call, result = PEERS[peer](positions, triangles, int(count))
    before = current_rss()
    start = time.perf_counter()
    outcome = call()
    seconds = time.perf_counter() - start
    peak = peak_rss()
    positions, triangles = result(outcome)
    write_ply(path, positions, triangles)
    report = {
        "seconds": seconds,
        "output_triangles": len(triangles),
        "rss_before": before,
        "peak_rss": max(peak, before),
        "package": f"{package} {importlib.metadata.version(package)}",
    }
    print(json.dumps(report))


if __name__ == "__main__":
    main(*sys.argv[1:])
