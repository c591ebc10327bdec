"""Colour glTF primitives as their materials do, and find what of them is seen.

The colour is the base colour (of KHR_materials_pbrSpecularGlossiness the diffuse one) or, where
that is black or missing, the emitted one. Textures: PNG, JPEG and WebP, with KHR_texture_transform.
Of alphaMode MASK and BLEND, what is transparent is not seen.

Source: Khronos glTF 2.0 specification, section 3.9, and the extensions named.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from toonset.dataset.images.picture import decode_rgba
from toonset.dataset.mesh.gltf_file import GltfFile, of_uri
from toonset.dataset.mesh.texture import Texture, corner_values
from toonset.errors import MeshError
from toonset.palette.colors import linear_from_srgb, srgb_from_linear

SPECULAR = "KHR_materials_pbrSpecularGlossiness"
TRANSFORM = "KHR_texture_transform"
WEBP = "EXT_texture_webp"
BLACK = (
    1e-3  # linear light, a quarter of an 8-bit level: darker, the emitted colour is the one seen
)
LEAST_BLENDED = 8 / 255  # alpha: what compression and smoothing leave of 0 in a texture


@dataclass(frozen=True, eq=False)
class Layer:
    """A factor times a texture.

    Attributes:
        factor: linear RGB and alpha.
        texture: None without one.
        corners: (faces, 3, 2) its coordinates, v from the lower edge up.
    """

    factor: Float[np.ndarray, " 4"]
    texture: Texture | None
    corners: Float[np.ndarray, "faces 3 2"] | None

    def at(
        self, faces: Int[np.ndarray, " places"], weights: Float[np.ndarray, "places 3"]
    ) -> Float[np.ndarray, "places 4"]:
        """Return linear RGB and alpha at places on faces (number, barycentric coordinates)."""
        if self.texture is None or self.corners is None:
            return np.broadcast_to(self.factor, (len(faces), 4))
        texels, known = self.texture.at(np.einsum("pi,piw->pw", weights, self.corners[faces]))
        texels = np.where(known[:, None], texels, np.uint8(255)) / 255
        return np.column_stack([linear_from_srgb(texels[:, :3]), texels[:, 3]]) * self.factor


@dataclass(frozen=True, eq=False)
class Surface:
    """A primitive's material on its faces.

    Attributes:
        base: the colour in light.
        emitted: the colour in the dark; None: nothing is.
        least_alpha: less is not seen; 0: opaque.
        vertex_colors: (faces, 3, 3 or 4) linear; None without.
        is_plain: neither material nor vertex colours.
        name: the material's.
    """

    base: Layer
    emitted: Layer | None
    least_alpha: float
    vertex_colors: Float[np.ndarray, "faces 3 channels"] | None
    is_plain: bool
    name: str

    @cached_property
    def _vertex_alpha(self) -> Float[np.ndarray, "faces 3"] | None:
        colors = self.vertex_colors
        return None if colors is None or colors.shape[2] < 4 else colors[..., 3]

    @property
    def may_be_cut(self) -> bool:
        """Return whether a part of it can be transparent."""
        if not self.least_alpha:
            return False
        rgba = None if self.base.texture is None else self.base.texture.rgba
        of_texture = rgba is not None and bool((rgba[..., 3] < 255).any())
        low = self.base.factor[3] < self.least_alpha
        return bool(low) or of_texture or self._vertex_alpha is not None

    def seen(
        self, faces: Int[np.ndarray, " places"], weights: Float[np.ndarray, "places 3"]
    ) -> Bool[np.ndarray, " places"]:
        """Return which places on faces are not transparent."""
        alpha = self.base.at(faces, weights)[:, 3]
        if self._vertex_alpha is not None:
            alpha = alpha * (weights * self._vertex_alpha[faces]).sum(axis=1)
        return alpha >= self.least_alpha

    def texels(self, faces: int) -> Float[np.ndarray, " faces"]:
        """Return how many texels of the base colour's texture the edges of every face pass."""
        if self.base.texture is None or self.base.corners is None:
            return np.zeros(faces)
        return self.base.texture.texels_along(self.base.corners)

    def colors(
        self, faces: Int[np.ndarray, " places"], weights: Float[np.ndarray, "places 3"]
    ) -> UInt8[np.ndarray, "places 3"] | None:
        """Return the sRGB colour at places on faces; None without material and vertex colours."""
        if self.is_plain:
            return None
        linear = self.base.at(faces, weights)[:, :3]
        if self.vertex_colors is not None:
            own = self.vertex_colors[faces, :, :3]
            linear = linear * np.einsum("pi,piw->pw", weights, own)
        if self.emitted is not None:
            dark = (linear <= BLACK).all(axis=1, keepdims=True)
            linear = np.where(dark, self.emitted.at(faces, weights)[:, :3], linear)
        return np.rint(255 * srgb_from_linear(np.clip(linear, 0, 1))).astype(np.uint8)


def surface_of(
    file: GltfFile, primitive: dict[str, Any], faces: Int[np.ndarray, "faces 3"]
) -> Surface:
    """Return a primitive's material.

    Raises:
        MeshError: a texture in a format that is not read.
        PictureError: a texture that cannot be read.
    """
    attributes = primitive["attributes"]
    tint = None
    if "COLOR_0" in attributes:
        tint = file.array(attributes["COLOR_0"]).astype(np.float64)[faces]
    if "material" not in primitive:
        white = Layer(np.ones(4), None, None)
        return Surface(white, None, 0.0, tint, tint is None, "")
    material = file.json["materials"][primitive["material"]]
    usual = material.get("pbrMetallicRoughness", {})
    said = material.get("extensions", {}).get(SPECULAR)
    if said is None:
        factor, texture = usual.get("baseColorFactor"), usual.get("baseColorTexture")
    else:
        factor, texture = said.get("diffuseFactor"), said.get("diffuseTexture")
        if factor is not None and texture is None and max(factor[:3]) <= BLACK:  # bare metal
            factor = [*said.get("specularFactor", (1, 1, 1)), factor[3]]
    emitted = _emitted(file, material, attributes, faces)
    usual_factor = np.ones(4)
    if emitted is not None and factor is None and texture is None:
        usual_factor[:3] = 0  # nothing is said of it but that it glows
    base = np.array(usual_factor if factor is None else factor, dtype=np.float64)
    least = {"MASK": material.get("alphaCutoff", 0.5), "BLEND": LEAST_BLENDED}
    return Surface(
        _layer(file, base, texture, attributes, faces),
        emitted,
        float(least.get(material.get("alphaMode", "OPAQUE"), 0.0)),
        tint,
        False,
        str(material.get("name", "")),
    )


def _emitted(
    file: GltfFile, material: dict[str, Any], attributes: dict[str, int], faces: np.ndarray
) -> Layer | None:
    factor = np.array([*material.get("emissiveFactor", (0, 0, 0)), 1], dtype=np.float64)
    if not factor[:3].any():
        return None
    return _layer(file, factor, material.get("emissiveTexture"), attributes, faces)


def _layer(
    file: GltfFile,
    factor: Float[np.ndarray, " 4"],
    reference: dict[str, Any] | None,
    attributes: dict[str, int],
    faces: Int[np.ndarray, "faces 3"],
) -> Layer:
    if reference is None:
        return Layer(factor, None, None)
    moved = reference.get("extensions", {}).get(TRANSFORM, {})
    channel = f"TEXCOORD_{moved.get('texCoord', reference.get('texCoord', 0))}"
    picture = _picture(file, reference["index"])
    if picture is None or channel not in attributes:
        return Layer(factor, None, None)
    uvs = file.array(attributes[channel]).astype(np.float64) * [1, -1] + [0, 1]  # v runs down
    return Layer(factor, _transformed(picture, moved), corner_values(uvs, faces))


def _transformed(picture: UInt8[np.ndarray, "height width 4"], moved: dict[str, Any]) -> Texture:
    """Return the texture under KHR_texture_transform: scaled, turned, then moved.

    Coordinates turn counter-clockwise as one sees the picture: as v runs down, that is
    (u cos + v sin, v cos - u sin).
    """
    cos, sin = np.cos(moved.get("rotation", 0.0)), np.sin(moved.get("rotation", 0.0))
    down = np.array([[cos, sin], [-sin, cos]]) @ np.diag(moved.get("scale", (1, 1)))
    flip, half = np.diag([1.0, -1.0]), np.array([0.0, 1.0])  # of v, to and fro
    offset = np.array(moved.get("offset", (0, 0)), dtype=np.float64)
    return Texture(picture, flip @ down @ flip, flip @ (down @ half + offset) + half)


def _picture(file: GltfFile, index: int) -> UInt8[np.ndarray, "height width 4"] | None:
    """Return the picture of a texture; None if it names none."""
    texture = file.json["textures"][index]
    others = texture.get("extensions", {})
    source = others.get(WEBP, {}).get("source", texture.get("source"))
    if source is None:
        kinds = [name for name, said in others.items() if "source" in said]
        if kinds:
            raise MeshError(
                f"{file.path}: has textures of {kinds[0]}, which are not read; export them as "
                "PNG, JPEG or WebP"
            )
        return None
    image = file.json["images"][source]
    data = of_uri(image["uri"], file.path) if "uri" in image else file.view(image["bufferView"])
    return decode_rgba(data, file.path)
