"""Views of many sizes, written by every export, for imports to read back."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.dataset.exporters.exported_views import camera_at
from toonset.dataset.exporters.blender import write_blender_script
from toonset.dataset.exporters.blender_synthetic import write_blender_synthetic
from toonset.dataset.exporters.colmap import write_colmap
from toonset.dataset.exporters.common import ExportView
from toonset.dataset.exporters.gltf import write_gltf
from toonset.dataset.exporters.nerfstudio import write_transforms
from toonset.dataset.exporters.opencv import write_opencv
from toonset.mesh import Mesh
from toonset.write import write_json

Writer = Callable[[Path, tuple[ExportView, ...], Mesh], object]
WRITERS: dict[str, Writer] = {
    "colmap": lambda out, views, mesh: write_colmap(out, views, None, mesh),
    "colmap-old": lambda out, views, mesh: write_colmap(out, views, None, mesh, old_layout=True),
    "colmap-text": lambda out, views, mesh: write_colmap(out, views, None, mesh, text=True),
    "nerfstudio": lambda out, views, mesh: write_transforms(out, views, None, mesh),
    "instant-ngp": lambda out, views, mesh: write_transforms(
        out, views, None, mesh, instant_ngp=True
    ),
    "blender-synthetic": lambda out, views, mesh: write_blender_synthetic(out, views, None, mesh),
    "blender": write_blender_script,
    "gltf": write_gltf,
    "opencv": write_opencv,
}
OWN_CAMERAS = [name for name in WRITERS if name not in ("blender", "gltf")]


def views_all_round(count: int = 4, *, k: float = 0.0) -> tuple[ExportView, ...]:
    views = []
    for i in range(count):
        size = (60 + 3 * i, 80 - 2 * i)
        camera = camera_at(i, count, size, 37.0 + i, (31.3 + i, 38.7), k)
        rng = np.random.default_rng(i)
        rgba = rng.integers(0, 256, (size[1], size[0], 4)).astype(np.uint8)
        rgba[..., 3] = np.where(np.add.outer(np.arange(size[1]), np.arange(size[0])) > 40, 255, 0)
        views.append(ExportView(f"{i:03d}.png", rgba, camera, 180.0 if k == 0 else 1 / k, 1.0))
    return tuple(views)


def tetrahedron() -> Mesh:
    vertices = np.array([[0.0, 0, 0], [0.4, 0, 0.1], [0.1, 1.8, 0], [0, 0.2, 0.5]])
    return Mesh(vertices, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


def change(file: Path, edit: Callable[[Any], object]) -> None:
    content = json.loads(file.read_text())
    edit(content)
    write_json(file, content)
