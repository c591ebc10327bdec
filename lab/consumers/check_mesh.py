"""Check what `toonset mesh` writes inside Blender, installed as a Python module.

    uv venv --python 3.11 /tmp/bpy && uv pip install --python /tmp/bpy/bin/python bpy numpy
    toonset mesh RUN -o a.glb && toonset mesh RUN -o a.obj && toonset mesh RUN -o a.ply
    /tmp/bpy/bin/python lab/consumers/check_mesh.py a.glb a.obj a.ply

Every file must have the first one's faces, bounds and colours, in shares of the surface. Measured
with Blender 4.2.23 LTS (180,480 faces, 7 colours) and 4.5.15 LTS (3,000, 8): bounds to 1e-7 of the
height, shares to 4e-8.
PLY knows no axes: Blender takes its y for depth, where GLB and OBJ stand upright.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

bpy = import_module("bpy")

Look = tuple[int, np.ndarray, dict[tuple[int, ...], float]]


def load(path: Path) -> Any:
    """Return the mesh object of a file, alone in an empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    readers = {
        ".glb": bpy.ops.import_scene.gltf,
        ".obj": bpy.ops.wm.obj_import,
        ".ply": bpy.ops.wm.ply_import,
    }
    readers[path.suffix](filepath=str(path))
    (found,) = (thing for thing in bpy.data.objects if thing.type == "MESH")
    return found


def look_of(path: Path) -> Look:
    """Return faces, bounds (y up) and every colour's share of the surface."""
    thing = load(path)
    mesh = thing.data
    corners = np.array([thing.matrix_world @ vertex.co for vertex in mesh.vertices])
    if path.suffix != ".ply":
        corners = np.stack([corners[:, 0], corners[:, 2], -corners[:, 1]], axis=1)
    areas = np.array([face.area for face in mesh.polygons])
    colors = _painted(mesh) if mesh.color_attributes else _textured(mesh)
    found, place = np.unique(colors, axis=0, return_inverse=True)
    shares = np.bincount(place.ravel(), areas) / areas.sum()
    bounds = np.concatenate([corners.min(axis=0), corners.max(axis=0)])
    return len(areas), bounds, dict(zip(map(tuple, found.tolist()), shares.tolist(), strict=True))


def _painted(mesh: Any) -> np.ndarray:
    """Return every face's sRGB from the colours at its first corner."""
    attribute = mesh.color_attributes[0]
    first = [face.vertices[0] for face in mesh.polygons]
    return _bytes(np.array([attribute.data[i].color_srgb[:3] for i in first]))


def _textured(mesh: Any) -> np.ndarray:
    """Return every face's sRGB from the texture at its first corner."""
    nodes = mesh.materials[0].node_tree.nodes
    (image,) = (node.image for node in nodes if node.type == "TEX_IMAGE")
    width, height = image.size
    pixels = np.array(image.pixels[:]).reshape(height, width, -1)[..., :3]
    uv = np.array([mesh.uv_layers[0].data[face.loop_start].uv for face in mesh.polygons])
    column, row = np.floor(uv * (width, height)).astype(int).T
    return _bytes(pixels[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)])


def _bytes(colors: np.ndarray) -> np.ndarray:
    return np.rint(255 * colors).astype(int)


def main() -> int:
    """Compare the files; 1 where one differs from the first."""
    paths = [Path(name) for name in sys.argv[1:]]
    faces, bounds, shares = look_of(paths[0])
    wrong = False
    for path in paths:
        own_faces, own_bounds, own_shares = look_of(path)
        off = float(np.abs(own_bounds - bounds).max() / (bounds[4] - bounds[1]))
        keys = shares.keys() | own_shares.keys()
        apart = max(abs(shares.get(key, 0) - own_shares.get(key, 0)) for key in keys)
        ok = own_faces == faces and off < 1e-5 and apart < 1e-4
        wrong |= not ok
        where = f"Blender {bpy.app.version_string}: {own_faces} faces, {len(own_shares)} colours"
        print(f"{path} in {where}, bounds {off:.1e}, shares {apart:.1e}: {'ok' if ok else 'WRONG'}")
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
