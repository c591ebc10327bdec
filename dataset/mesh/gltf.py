"""Read glTF 2.0 and GLB: triangles of the default scene in world coordinates.

Read: node transforms, skins in their rest pose (as every viewer shows them), vertex colours, base
colour and base colour texture. Refused by name: other files, sparse or compressed data, strips.

Our own reader: trimesh knows no skins and keeps base colours as 8 bits of linear light.
Source: Khronos glTF 2.0 specification.
"""

from __future__ import annotations

import base64
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.dataset.images.picture import decode_rgba
from toonset.dataset.mesh.raw_triangles import RawTriangles, check_counts, face_colors_from_texture
from toonset.errors import MeshError
from toonset.palette.colors import linear_from_srgb, srgb_from_linear

JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
TRIANGLES = 4  # what is below are points and lines
Matrix = Float[np.ndarray, "4 4"]


@dataclass(frozen=True, eq=False)
class GltfFile:
    """An opened file.

    Attributes:
        json: its description.
        buffers: its binary data.
        path: for messages.
        max_faces: three times as many items are read of an accessor.
    """

    json: dict[str, Any]
    buffers: tuple[bytes, ...]
    path: Path
    max_faces: int

    def array(self, index: int) -> np.ndarray:
        """Return an accessor as (count, width); normalised integers become floats.

        Raises:
            MeshError: sparse, compressed or too long.
            TypeError, ValueError: data that ends too early.
        """
        accessor = self.json["accessors"][index]
        count, width = int(accessor["count"]), WIDTHS[accessor["type"]]
        check_counts(self.path, count, 0, self.max_faces)
        if "sparse" in accessor or "bufferView" not in accessor:
            raise MeshError(
                f"{self.path}: sparse or compressed glTF data is not supported; export it plain"
            )
        dtype = np.dtype(DTYPES[accessor["componentType"]])
        stride = self.json["bufferViews"][accessor["bufferView"]].get("byteStride")
        strides = (stride or dtype.itemsize * width, dtype.itemsize)
        data, start = self.view(accessor["bufferView"]), accessor.get("byteOffset", 0)
        raw = np.ndarray((count, width), dtype, data, start, strides)
        if accessor.get("normalized") and dtype.kind != "f":
            return np.maximum(raw.astype(np.float64) / np.iinfo(dtype).max, -1.0)
        return raw

    def view(self, index: int) -> bytes:
        """Return the bytes of a buffer view; fewer where the buffer is cut off."""
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.buffers[view["buffer"]][start : start + view["byteLength"]]


def read_gltf(data: bytes, path: Path, max_faces: int) -> RawTriangles:
    """Return the triangles of a glTF or GLB file; every node with a mesh is one part.

    Raises:
        MeshError: damaged, cut off, too large, or of a kind named in the module's docstring.
        PictureError: a texture that cannot be read.
    """
    try:
        return _joined(_pieces(open_gltf(data, path, max_faces)))
    except (
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
        OverflowError,
        RecursionError,
        struct.error,
    ) as error:
        words = " ".join(str(error).split())[:80]
        raise MeshError(
            f"{path}: the glTF file is damaged or cut off ({type(error).__name__}: {words}); "
            "export it again"
        ) from error


def open_gltf(data: bytes, path: Path, max_faces: int) -> GltfFile:
    """Return the opened file.

    Raises:
        MeshError: cut off, of another version, needs other files or compression.
        Exception: damaged; see `read_gltf` for what Python says then.
    """
    text, binary = _chunks(data, path) if data.startswith(b"glTF") else (data, b"")
    description = json.loads(text.removeprefix(b"\xef\xbb\xbf"))
    if not isinstance(description, dict) or "asset" not in description:
        raise MeshError(f"{path}: is JSON but no glTF; export the mesh again")
    if str(description["asset"].get("version", "2")).split(".")[0] != "2":
        raise MeshError(f"{path}: is glTF 1; export it as glTF 2 (.glb)")
    for name in COMPRESSED:
        if name in description.get("extensionsRequired", []):
            raise MeshError(f"{path}: needs {name}; export it without compression")
    check_counts(path, len(description.get("nodes", [])), 0, max_faces)
    buffers = description.get("buffers", [])
    found = tuple(_of_uri(one["uri"], path) if "uri" in one else binary for one in buffers)
    return GltfFile(description, found, path, max_faces)


def _chunks(data: bytes, path: Path) -> tuple[bytes, bytes]:
    """Return the JSON and the binary chunk of a GLB."""
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise MeshError(f"{path}: is GLB version {version}; export it as glTF 2")
    if length > len(data):
        raise MeshError(
            f"{path}: the GLB file is cut off ({len(data)} of {length} bytes); export it again"
        )
    found: dict[int, bytes] = {}
    position = 12
    while position + 8 <= length:
        size, kind = struct.unpack_from("<II", data, position)
        found.setdefault(kind, data[position + 8 : position + 8 + size])
        position += 8 + size
    return found[JSON_CHUNK], found.get(BINARY_CHUNK, b"")


def _of_uri(uri: str, path: Path) -> bytes:
    if not uri.startswith("data:"):
        raise MeshError(
            f"{path}: refers to another file ({uri[:40]}); export it in one piece, as .glb"
        )
    return base64.b64decode(uri.partition(",")[2])


def _world_matrices(file: GltfFile) -> dict[int, Matrix]:
    """Return world_from_node of every node below the default scene, in file order of the tree."""
    nodes = file.json.get("nodes", [])
    if scenes := file.json.get("scenes"):
        roots = scenes[file.json.get("scene", 0)].get("nodes", [])
    else:
        held = {child for node in nodes for child in node.get("children", [])}
        roots = [index for index in range(len(nodes)) if index not in held]
    world: dict[int, Matrix] = {}

    def place(index: int, parent: Matrix) -> None:
        if index in world:
            raise MeshError(f"{file.path}: its nodes form a loop; export it again")
        world[index] = parent @ _local_matrix(nodes[index])
        for child in nodes[index].get("children", []):
            place(child, world[index])

    for root in roots:
        place(root, np.eye(4))
    return world


def _local_matrix(node: dict[str, Any]) -> Matrix:
    from trimesh.transformations import quaternion_matrix

    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    wide, high, deep = node.get("scale", (1, 1, 1))
    placed = np.asarray(quaternion_matrix((w, x, y, z)) @ np.diag([wide, high, deep, 1.0]))
    right, up, back = node.get("translation", (0, 0, 0))
    placed[:3, 3] = right, up, back
    return placed


def _pieces(file: GltfFile) -> list[RawTriangles]:
    """Return every primitive in world coordinates."""
    world = _world_matrices(file)
    pieces: list[RawTriangles] = []
    vertices = faces = 0
    for index in world:
        node = file.json["nodes"][index]
        if "mesh" not in node:
            continue
        mesh = file.json["meshes"][node["mesh"]]
        name = str(node.get("name") or mesh.get("name") or f"node {index}")
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", TRIANGLES)
            if mode > TRIANGLES:
                raise MeshError(f"{file.path}: {name} has strips; export it as plain triangles")
            if mode == TRIANGLES:
                pieces.append(_piece(file, index, primitive, world, name))
                vertices += len(pieces[-1].vertices)
                faces += len(pieces[-1].faces)
                check_counts(file.path, vertices, faces, file.max_faces)
    return pieces


def _piece(
    file: GltfFile, index: int, primitive: dict[str, Any], world: dict[int, Matrix], name: str
) -> RawTriangles:
    node, attributes = file.json["nodes"][index], primitive["attributes"]
    vertices = file.array(attributes["POSITION"]).astype(np.float64).reshape(-1, 3)
    corners = np.arange(len(vertices))
    if "indices" in primitive:
        corners = file.array(primitive["indices"]).astype(np.int64).ravel()
    faces = corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if faces.max(initial=-1) >= len(vertices):
        raise MeshError(
            f"{file.path}: a face of {name} refers to vertex {int(faces.max())}, but it has "
            f"{len(vertices)}; the file is damaged, export it again"
        )
    colors, matrix = _colors(file, primitive, faces), world[index]
    if "skin" in node and "JOINTS_0" in attributes:
        vertices = _skinned(file, node["skin"], attributes, vertices, world)
    else:
        if not np.array_equal(matrix, np.eye(4)):  # identity keeps every bit of the coordinates
            vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        if np.linalg.det(matrix[:3, :3]) < 0:
            faces = faces[:, ::-1]
    return RawTriangles(vertices, faces, colors, None, (name,))


def _skinned(
    file: GltfFile,
    skin_index: int,
    attributes: dict[str, int],
    vertices: np.ndarray,
    world: dict[int, Matrix],
) -> np.ndarray:
    """Return vertices in the rest pose: sum of w_j G_j B_j v; the node's own place is ignored."""
    skin = file.json["skins"][skin_index]
    places = np.stack([world[joint] for joint in skin["joints"]])
    if "inverseBindMatrices" in skin:
        inverse = file.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
        places = places @ inverse[: len(places)]
    joints = file.array(attributes["JOINTS_0"]).astype(np.int64)
    weights = file.array(attributes["WEIGHTS_0"]).astype(np.float64)
    weights = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-30)
    padded = np.concatenate([vertices, np.ones((len(vertices), 1))], axis=1)
    result = np.zeros((len(vertices), 4))
    for column in range(joints.shape[1]):
        moved = np.einsum("nij,nj->ni", places[joints[:, column]], padded)
        result += weights[:, column, None] * moved
    return result[:, :3]


def _colors(
    file: GltfFile, primitive: dict[str, Any], faces: Int[np.ndarray, "faces 3"]
) -> UInt8[np.ndarray, "faces 3"] | None:
    """Return the sRGB base colour of every face; None without material and vertex colours."""
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
    file: GltfFile, reference: dict[str, Any], attributes: dict[str, int], faces: np.ndarray
) -> np.ndarray:
    """Return the texture's linear colour at the middle of every face."""
    channel = f"TEXCOORD_{reference.get('texCoord', 0)}"
    source = file.json["textures"][reference["index"]].get("source")
    if source is None or channel not in attributes:
        return np.ones((len(faces), 3))
    image = file.json["images"][source]
    data = _of_uri(image["uri"], file.path) if "uri" in image else file.view(image["bufferView"])
    uvs = file.array(attributes[channel]).astype(np.float64) * [1, -1] + [0, 1]  # v runs down
    white = np.full((len(faces), 3), 255, dtype=np.uint8)
    texture = decode_rgba(data, file.path)
    return linear_from_srgb(face_colors_from_texture(texture, uvs, faces, white) / 255)


def _joined(pieces: list[RawTriangles]) -> RawTriangles:
    if not pieces:
        return RawTriangles(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    starts = np.cumsum([0] + [len(piece.vertices) for piece in pieces[:-1]])
    names = list(dict.fromkeys(piece.part_names[0] for piece in pieces))
    numbers = [names.index(piece.part_names[0]) for piece in pieces]
    colors = [
        # white is glTF's default material
        np.full(piece.faces.shape, 255, np.uint8) if piece.colors is None else piece.colors
        for piece in pieces
    ]
    return RawTriangles(
        vertices=np.concatenate([piece.vertices for piece in pieces]),
        faces=np.concatenate([p.faces + start for p, start in zip(pieces, starts, strict=True)]),
        colors=np.concatenate(colors) if any(p.colors is not None for p in pieces) else None,
        parts=np.repeat(numbers, [len(p.faces) for p in pieces]) if len(names) > 1 else None,
        part_names=tuple(names),
    )
