"""Build a GLB file: JSON, and one buffer that holds arrays and pictures.

Source: Khronos glTF 2.0 specification, sections 3.6 (binary data) and 4.4 (GLB), and its extensions
KHR_materials_unlit and KHR_materials_variants.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from toonset import __version__
from toonset.dataset.mesh.gltf_file import BINARY_CHUNK, JSON_CHUNK

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
FLOAT, UNSIGNED_INT = 5126, 5125
UNLIT, VARIANTS = "KHR_materials_unlit", "KHR_materials_variants"
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


@dataclass
class Gltf:
    """A file under construction.

    Attributes:
        roots: the nodes of its scene.
        variants: that its primitives can be shown in, a name each and what else is known.
    """

    roots: list[int] = field(default_factory=list)
    variants: list[dict[str, Any]] = field(default_factory=list)
    _lists: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    _binary: bytearray = field(default_factory=bytearray)

    def add(self, kind: str, **entry: Any) -> int:
        """Return the index of a new entry of `nodes`, `meshes`, `materials`, ..."""
        entries = self._lists.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def add_array(self, array: np.ndarray, target: int = ARRAY_BUFFER) -> int:
        """Return the accessor of float rows (or of an index list, with its target)."""
        is_index = target == ELEMENT_ARRAY_BUFFER
        values = np.ascontiguousarray(array, dtype="<u4" if is_index else "<f4")
        rows = values.reshape(len(values), -1)
        return self.add(
            "accessors",
            bufferView=self._add_bytes(values.tobytes(), target=target),
            componentType=UNSIGNED_INT if is_index else FLOAT,
            count=len(rows),
            type=KINDS[rows.shape[1]],
            min=rows.min(axis=0).tolist(),
            max=rows.max(axis=0).tolist(),
        )

    def add_texture(self, png: bytes, name: str) -> int:
        """Return the texture of a PNG that the file carries; its edge does not wrap round."""
        view = self._add_bytes(png)
        image = self.add("images", name=name, bufferView=view, mimeType="image/png")
        clamped = 33071
        if "samplers" not in self._lists:
            self.add("samplers", wrapS=clamped, wrapT=clamped)
        return self.add("textures", source=image, sampler=0)

    def add_material(
        self, name: str, color: dict[str, object], *, unlit: bool = True, **more: object
    ) -> int:
        """Return a new matt material of one colour or picture; viewers do not shade unlit ones."""
        matt = {**color, "metallicFactor": 0, "roughnessFactor": 1}
        light: dict[str, object] = {"extensions": {UNLIT: {}}} if unlit else {}
        return self.add("materials", name=name, **more, pbrMetallicRoughness=matt, **light)

    def mappings(self, materials: Sequence[int]) -> dict[str, Any]:
        """Return which material a primitive has in every variant, as part of its description.

        Args:
            materials: one per variant.
        """
        if not self.variants:
            return {}
        found = [
            {"material": one, "variants": [i for i, other in enumerate(materials) if other == one]}
            for one in dict.fromkeys(materials)
        ]
        return {"extensions": {VARIANTS: {"mappings": found}}}

    def encode(self, extras: dict[str, Any]) -> bytes:
        """Return the GLB; `extras` go to its scene."""
        content = {
            "asset": {"version": "2.0", "generator": f"toonset {__version__}"},
            "extensionsUsed": [UNLIT, *([VARIANTS] if self.variants else [])],
            **({"extensions": {VARIANTS: {"variants": self.variants}}} if self.variants else {}),
            "scene": 0,
            "scenes": [{"nodes": self.roots, "extras": extras}],
            **self._lists,
            "buffers": [{"byteLength": len(self._binary)}],
        }
        text = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
        chunks = _chunk(JSON_CHUNK, text, b" ") + _chunk(BINARY_CHUNK, bytes(self._binary), b"\0")
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def _add_bytes(self, data: bytes, **more: int) -> int:
        start = len(self._binary)
        self._binary += data + b"\0" * (-len(data) % 4)
        return self.add("bufferViews", buffer=0, byteOffset=start, byteLength=len(data), **more)


def _chunk(kind: int, data: bytes, padding: bytes) -> bytes:
    padded = data + padding * (-len(data) % 4)
    return struct.pack("<II", len(padded), kind) + padded
