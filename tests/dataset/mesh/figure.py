"""A figure of boxes in five colours, and what scenes put around it."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image

from tests.dataset.mesh.mesh_files import gltf

Box = tuple[Sequence[float], Sequence[float]]
BOXES: dict[str, Box] = {  # lowest and highest corner
    "head": ((-0.15, 1.4, -0.15), (0.15, 1.7, 0.15)),
    "torso": ((-0.2, 0.82, -0.12), (0.2, 1.38, 0.12)),
    "arm": ((0.22, 0.9, -0.08), (0.62, 1.3, 0.08)),
    "left": ((0.02, 0.0, -0.08), (0.18, 0.8, 0.08)),
    "right": ((-0.18, 0.0, -0.08), (-0.02, 0.8, 0.08)),
}
COLORS = {"head": "facda5", "torso": "268a8c", "arm": "d95430", "left": "2e3a68", "right": "7c4830"}
QUADS = ((0, 2, 6, 4), (1, 5, 7, 3), (0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6))
FLOOR: Box = ((-3.0, 0.0, -3.0), (3.0, 0.0, 3.0))


def box_points(box: Box) -> np.ndarray:
    """Return its corners; x changes slowest."""
    return np.array(
        [[x, y, z] for x in _ends(box, 0) for y in _ends(box, 1) for z in _ends(box, 2)]
    )


def _ends(box: Box, axis: int) -> tuple[float, float]:
    return box[0][axis], box[1][axis]


def rgb_of(name: str) -> list[int]:
    return list(bytes.fromhex(COLORS[name]))


def sheet_quad(points: Sequence[Sequence[float]]) -> np.ndarray:
    return np.array(points, dtype=np.float64)


def level(half: float, y: float = 0.0) -> np.ndarray:
    """Return the corners of a level square."""
    return sheet_quad([(-half, y, -half), (-half, y, half), (half, y, half), (half, y, -half)])


def upright(half: float, z: float) -> np.ndarray:
    """Return the corners of an upright square around the figure's middle."""
    return sheet_quad(
        [(x, y + 0.85, z) for x, y in ((-half, -half), (half, -half), (half, half), (-half, half))]
    )


def obj_text(more: Sequence[tuple[str, np.ndarray]] = (), *, objects: bool = True) -> str:
    """Return the figure as OBJ with quads, and more polygons."""
    parts = [(name, box_points(box), QUADS) for name, box in BOXES.items()]
    parts += [(name, points, (tuple(range(len(points))),)) for name, points in more]
    lines, start = [], 1
    for name, points, polygons in parts:
        lines += [f"o {name}"] * objects + [f"usemtl {name}"]
        lines += ["v " + " ".join(f"{x:.6g}" for x in point) for point in points]
        lines += ["f " + " ".join(str(start + i) for i in polygon) for polygon in polygons]
        start += len(points)
    return "\n".join(lines) + "\n"


def scene(*more: tuple[np.ndarray, dict[str, Any]], **root: Any) -> str:
    """Return the figure as glTF, and nodes with one polygon each; `root` goes into the document."""
    points = np.concatenate([box_points(box) for box in BOXES.values()]).astype(np.float32)
    quads = np.concatenate([np.array(QUADS) + 8 * i for i in range(len(BOXES))])
    arrays = [points, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1).astype(np.uint16)]
    nodes: list[dict[str, Any]] = [{"mesh": 0, "name": "body"}]
    meshes: list[dict[str, Any]] = [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}]
    for polygon, said in more:
        node = {"mesh": len(meshes), "name": "extra", **said}
        primitive = {"attributes": {"POSITION": len(arrays)}, **node.pop("primitive", {})}
        count = len(polygon)
        fan = np.array([(0, i, i + 1) for i in range(1, count - 1)], dtype=np.uint16).reshape(-1)
        primitive["indices"] = len(arrays) + 1
        arrays += [polygon.astype(np.float32), fan]
        if "uv" in node:
            primitive["attributes"]["TEXCOORD_0"] = len(arrays)
            arrays.append(np.array(node.pop("uv"), dtype=np.float32))
        nodes.append(node)
        meshes.append({"primitives": [primitive]})
    parents = {child for node in nodes for child in node.get("children", [])}
    roots = [i for i in range(len(nodes)) if i not in parents]
    document = {"scenes": [{"nodes": roots}], "nodes": nodes, "meshes": meshes, **root}
    return json.dumps(gltf(document, *arrays))


def strand_picture(width: int = 64, height: int = 64) -> Image.Image:
    """Return a hair card: opaque in the middle quarter, transparent beside it."""
    rgba = np.zeros((height, width, 4), dtype=np.uint8)
    rgba[:, 3 * width // 8 : 5 * width // 8] = (124, 72, 48, 255)
    return Image.fromarray(rgba)
