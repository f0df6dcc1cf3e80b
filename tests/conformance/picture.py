"""Small pictures of meshes for the report, without any drawing library."""

import base64
import struct
import zlib

import numpy as np

SIZE = 200
POINTS = 60_000


def draw(mesh):
    """The mesh from the front, lit from the upper left, as rows of grey values."""
    image = np.full((SIZE, SIZE), 245, np.uint8)
    if len(mesh.faces) == 0:
        return image
    triangles = np.asarray(mesh.triangles, np.float64)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(normals, axis=1)
    if not np.isfinite(area).all() or area.sum() == 0:
        return image
    random = np.random.default_rng(1)
    face = random.choice(len(area), POINTS, p=area / area.sum())
    u, v = random.random((2, POINTS, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = (triangles[face, i] for i in range(3))
    points = a + u * (b - a) + v * (c - a)
    # To the right, into the picture, upwards; seen a little from the right and from above.
    view = np.array([[0.94, 0, -0.34], [-0.32, -0.34, -0.88], [-0.12, 0.94, -0.32]])
    points, normals = points @ view.T, (normals[face] / area[face, None]) @ view.T
    low, high = points.min(axis=0), points.max(axis=0)
    scale = 0.92 * SIZE / max((high - low)[[0, 2]].max(), 1e-12)
    middle = (low + high) / 2
    x = ((points[:, 0] - middle[0]) * scale + SIZE / 2).astype(int).clip(0, SIZE - 1)
    y = (SIZE / 2 - (points[:, 2] - middle[2]) * scale).astype(int).clip(0, SIZE - 1)
    light = np.abs(normals @ np.array([-0.45, -0.7, 0.55]))
    order = np.argsort(-points[:, 1])
    image[y[order], x[order]] = (40 + 190 * light[order].clip(0, 1)).astype(np.uint8)
    return image


def data_url(image):
    """A grey picture as the address of a PNG."""
    height, width = image.shape

    def chunk(kind, data):
        check = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)

    rows = b"".join(b"\0" + row.tobytes() for row in image)
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
    png += chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
    return "data:image/png;base64," + base64.b64encode(png).decode()
