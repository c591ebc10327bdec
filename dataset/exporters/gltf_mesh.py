"""The mannequin and the drawings' planes as glTF meshes."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from toonset.dataset.exporters.common import ExportView
from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.gltf_write import ELEMENT_ARRAY_BUFFER, Gltf
from toonset.mesh import Mesh
from toonset.palette.colors import linear_from_srgb

GREY = [0.6, 0.6, 0.6, 1.0]  # linear, of a mannequin without colours
PLANE_UV = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])  # glTF's v runs down the picture
PLANE_FACES = np.array([[0, 1, 2], [0, 2, 3]])  # counter-clockwise as the camera sees it


def add_mannequin(file: Gltf, mesh: Mesh) -> int:
    """Return the node of the mannequin, with its face colours as vertex colours."""
    vertices, faces, colors = _vertex_colored(mesh)
    attributes = {"POSITION": file.add_array(vertices)}
    if colors is not None:
        attributes["COLOR_0"] = file.add_array(colors)
    base = GREY if colors is None else [1.0] * 4
    material = file.add(
        "materials",
        name="mannequin",
        doubleSided=True,
        pbrMetallicRoughness={"baseColorFactor": base, "metallicFactor": 0, "roughnessFactor": 1},
    )
    indices = file.add_array(faces.ravel(), ELEMENT_ARRAY_BUFFER)
    primitive = {"attributes": attributes, "indices": indices, "material": material}
    return file.add("nodes", name="mannequin", mesh=file.add("meshes", primitives=[primitive]))


def add_plane(file: Gltf, view: ExportView, corners: Float[np.ndarray, "4 3"]) -> int:
    """Return the node of a drawing's plane: unlit, seen from its front only."""
    texture = file.add_texture(encode_png(view.rgba), view.name)
    material = file.add(
        "materials",
        name=view.name,
        alphaMode="BLEND",
        pbrMetallicRoughness={"baseColorTexture": {"index": texture}, "metallicFactor": 0},
        extensions={"KHR_materials_unlit": {}},
    )
    middle = corners.mean(axis=0)  # vertices near 0 keep more digits in float32
    primitive = {
        "attributes": {
            "POSITION": file.add_array(corners - middle),
            "TEXCOORD_0": file.add_array(PLANE_UV),
        },
        "indices": file.add_array(PLANE_FACES.ravel(), ELEMENT_ARRAY_BUFFER),
        "material": material,
    }
    shape = file.add("meshes", name=view.name, primitives=[primitive])
    return file.add("nodes", name=f"drawing {view.name}", mesh=shape, translation=middle.tolist())


def _vertex_colored(
    mesh: Mesh,
) -> tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, "f 3"], Float[np.ndarray, "v 3"] | None]:
    """Return vertices, faces and linear vertex colours; a vertex of two colours comes twice."""
    if mesh.face_colors is None:
        return mesh.vertices, mesh.faces, None
    palette, color = np.unique(mesh.face_colors, axis=0, return_inverse=True)
    pairs = np.stack([mesh.faces.ravel(), np.repeat(color.ravel(), 3)], axis=1)
    unique, index = np.unique(pairs, axis=0, return_inverse=True)
    linear = linear_from_srgb(palette / 255.0)[unique[:, 1]]
    return mesh.vertices[unique[:, 0]], index.reshape(-1, 3), linear
