"""The flat colours of a mesh: a palette and every face's place in it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Int, UInt8
from PIL import Image

from toonset.mesh import Mesh

PLAIN = (204, 204, 204)  # a mesh without colours
MOST_COLORS = 64  # a textured mesh is reduced to so many


def flat_palette(
    mesh: Mesh,
) -> tuple[UInt8[np.ndarray, "colors 3"], Int[np.ndarray, " faces"]]:
    """Return the mesh's colours, largest surface first, and the index of every face's colour.

    A mesh without colours is grey; more than 64 colours are reduced to 64 by median cut.
    """
    if mesh.face_colors is None:
        return np.array([PLAIN], dtype=np.uint8), np.zeros(len(mesh.faces), dtype=np.int64)
    colors, labels = np.unique(mesh.face_colors, axis=0, return_inverse=True)
    if len(colors) > MOST_COLORS:
        colors, labels = np.unique(_reduced(mesh.face_colors), axis=0, return_inverse=True)
    labels = labels.reshape(-1)
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.bincount(labels, np.linalg.norm(normals, axis=1), len(colors))
    order = np.argsort(-areas, kind="stable")
    return colors[order], np.argsort(order)[labels]


def _reduced(face_colors: np.ndarray) -> np.ndarray:
    image = Image.fromarray(np.ascontiguousarray(face_colors[None]))
    return np.asarray(image.quantize(MOST_COLORS, Image.Quantize.MEDIANCUT).convert("RGB"))[0]
