"""Coloured points of the mannequin for an export, and the PLY file that trainers start from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toonset.dataset.colmap_points import TrackedPoints

PLY_VERTEX = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")),
        *((name, "u1") for name in ("red", "green", "blue")),
    ]
)


def encode_ply(points: TrackedPoints) -> bytes:
    """Return coloured points as a binary PLY; normals are 0, but Gaussian splatting wants them."""
    vertices = np.zeros(len(points.xyz), dtype=PLY_VERTEX)
    for axis, name in enumerate(("x", "y", "z")):
        vertices[name] = points.xyz[:, axis]
    for channel, name in enumerate(("red", "green", "blue")):
        vertices[name] = points.rgb[:, channel]
    return _header(len(vertices)) + vertices.tobytes()


def _header(count: int) -> bytes:
    kinds: Sequence[tuple[str, str]] = [
        (name, "uchar" if PLY_VERTEX[name] == np.uint8 else "float")
        for name in PLY_VERTEX.names or ()
    ]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    lines += [f"property {kind} {name}" for name, kind in kinds]
    return ("\n".join([*lines, "end_header"]) + "\n").encode()
