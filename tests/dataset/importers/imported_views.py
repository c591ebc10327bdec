"""Views of many sizes, written by every export, for imports to read back."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.dataset.exporters import exported_views
from toonset.dataset.exporters.blender import write_blender_script
from toonset.dataset.exporters.blender_synthetic import write_blender_synthetic
from toonset.dataset.exporters.colmap import write_colmap
from toonset.dataset.exporters.common import ExportView
from toonset.dataset.exporters.gltf import write_gltf
from toonset.dataset.exporters.nerfstudio import write_transforms
from toonset.mesh import Mesh
from toonset.write import write_json

Writer = Callable[[Path, tuple[ExportView, ...], Mesh], object]
WRITERS: dict[str, Writer] = {
    "colmap": lambda out, views, mesh: write_colmap(out, views, None, mesh),
    "colmap-old": lambda out, views, mesh: write_colmap(out, views, None, mesh, old_layout=True),
    "colmap-text": lambda out, views, mesh: write_colmap(out, views, None, mesh, text=True),
    "nerfstudio": lambda out, views, mesh: write_transforms(out, views, None, mesh),
    "nerfstudio-pinholes": lambda out, views, mesh: write_transforms(
        out, views, None, mesh, pinholes=True
    ),
    "instant-ngp": lambda out, views, mesh: write_transforms(
        out, views, None, mesh, instant_ngp=True
    ),
    "blender-synthetic": lambda out, views, mesh: write_blender_synthetic(out, views, None, mesh),
    "blender": write_blender_script,
    "gltf": write_gltf,
}
OWN_CAMERAS = [name for name in WRITERS if name not in ("blender", "gltf")]


def views_all_round(count: int = 4, *, k: float = 0.0) -> tuple[ExportView, ...]:
    return exported_views.views_all_round(count, k=k, picture=exported_views.noise)


def tetrahedron() -> Mesh:
    vertices = np.array([[0.0, 0, 0], [0.4, 0, 0.1], [0.1, 1.8, 0], [0, 0.2, 0.5]])
    return Mesh(vertices, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


def change(file: Path, edit: Callable[[Any], object]) -> None:
    content = json.loads(file.read_text())
    edit(content)
    write_json(file, content)
