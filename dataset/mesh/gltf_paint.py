"""Colours of glTF primitives: factor x texture x vertex colour, multiplied in linear light."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Int, UInt8

from toonset.dataset.images.picture import decode_rgba
from toonset.dataset.mesh.color import face_colors_from_texture
from toonset.dataset.mesh.gltf_file import GltfFile, data_of_uri
from toonset.palette.colors import linear_from_srgb, srgb_from_linear


def primitive_colors(
    file: GltfFile, primitive: dict[str, Any], faces: Int[np.ndarray, "faces 3"]
) -> UInt8[np.ndarray, "faces 3"] | None:
    """Return the sRGB base colour of every face; None without material and vertex colours.

    Raises:
        MeshError: damaged data.
        PictureError: a texture that cannot be read.
    """
    attributes = primitive["attributes"]
    if "material" not in primitive and "COLOR_0" not in attributes:
        return None
    linear = np.ones((len(faces), 3))
    if "material" in primitive:
        material = file.json["materials"][primitive["material"]]
        surface = material.get("pbrMetallicRoughness", {})
        linear = linear * np.array(surface.get("baseColorFactor", (1, 1, 1, 1)))[:3]
        if "baseColorTexture" in surface:
            linear = linear * _texture_colors(file, surface["baseColorTexture"], attributes, faces)
    if "COLOR_0" in attributes:
        linear = linear * file.array(attributes["COLOR_0"])[:, :3].astype(float)[faces].mean(axis=1)
    return np.rint(255 * srgb_from_linear(linear)).astype(np.uint8)


def _texture_colors(
    file: GltfFile, reference: dict[str, Any], attributes: dict[str, Any], faces: np.ndarray
) -> np.ndarray:
    """Return the texture's linear colour at the middle of every face."""
    channel = f"TEXCOORD_{reference.get('texCoord', 0)}"
    source = file.json["textures"][reference["index"]].get("source")
    white = np.full((len(faces), 3), 255, dtype=np.uint8)
    if source is None or channel not in attributes:
        return linear_from_srgb(white / 255)
    uvs = file.array(attributes[channel]).astype(np.float64)
    uvs = np.stack([uvs[:, 0], 1 - uvs[:, 1]], axis=1)  # glTF counts v from the upper edge
    texture = decode_rgba(_image_bytes(file, file.json["images"][source]), file.path)
    return linear_from_srgb(face_colors_from_texture(texture, uvs, faces, white) / 255)


def _image_bytes(file: GltfFile, image: dict[str, Any]) -> bytes:
    if "uri" in image:
        return data_of_uri(image["uri"], file.path)
    return file.view(image["bufferView"])[0]
