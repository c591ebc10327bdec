"""glTF 2.0 and GLB, self-contained: triangles of the default scene in world coordinates.

Read: node transforms, skins in their rest pose (as every viewer shows them), triangle lists,
strips and fans, vertex colours, base colour and base colour texture. Refused by name: buffers in
other files, sparse accessors, compressed geometry. Source: Khronos glTF 2.0 specification.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from toonset.dataset.images.picture import decode_rgba
from toonset.dataset.mesh.color import face_colors_from_texture
from toonset.dataset.mesh.gltf_file import GltfFile, data_of_uri, open_gltf
from toonset.dataset.mesh.validate import Soup, check_counts
from toonset.errors import MeshError, PictureError
from toonset.palette.colors import linear_from_srgb, srgb_from_linear

MAX_DEPTH = 200  # of the node tree
TRIANGLES, STRIP, FAN = 4, 5, 6
Matrix = Float[np.ndarray, "4 4"]


@dataclass(frozen=True, eq=False)
class _Piece:
    """One primitive in world coordinates."""

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray | None
    name: str


def read_gltf(data: bytes, path: Path, max_faces: int) -> Soup:
    """Return the triangles of a glTF or GLB file; every node with a mesh is one part.

    Raises:
        MeshError: damaged, cut off, too large, or of a kind named in the module's docstring.
    """
    try:
        file = open_gltf(data, path, max_faces)
        return _soup(_pieces(file, path, max_faces))
    except (MeshError, PictureError):
        raise
    except (LookupError, TypeError, ValueError, AttributeError, RecursionError) as error:
        words = " ".join(str(error).split())[:80]
        raise MeshError(
            f"{path}: the glTF file is damaged ({type(error).__name__}: {words}); export it again"
        ) from error


def _pieces(file: GltfFile, path: Path, max_faces: int) -> list[_Piece]:
    world = _world_matrices(file, path)
    pieces: list[_Piece] = []
    total = 0
    for index, matrix in world.items():
        node = file.json["nodes"][index]
        if "mesh" not in node:
            continue
        mesh = file.json["meshes"][node["mesh"]]
        name = str(node.get("name") or mesh.get("name") or f"node {index}")
        for primitive in mesh["primitives"]:
            faces = _faces(file, primitive)
            total += len(faces)
            check_counts(path, 0, total, max_faces)
            if len(faces):
                pieces.append(_piece(file, node, primitive, faces, (world, matrix), name))
    return pieces


def _piece(
    file: GltfFile,
    node: dict[str, Any],
    primitive: dict[str, Any],
    faces: np.ndarray,
    places: tuple[dict[int, Matrix], Matrix],
    name: str,
) -> _Piece:
    world, matrix = places
    vertices = file.array(primitive["attributes"]["POSITION"]).astype(np.float64).reshape(-1, 3)
    if not 0 <= faces.min() <= faces.max() < len(vertices):
        raise MeshError(
            f"{file.path}: a face of {name} refers to vertex {int(faces.max())}, but it has "
            f"{len(vertices)}; the file is damaged, export it again"
        )
    colors = primitive_colors(file, primitive, faces)
    if "skin" in node and "JOINTS_0" in primitive["attributes"]:
        return _Piece(_skinned(file, node["skin"], primitive, vertices, world), faces, colors, name)
    if not np.array_equal(matrix, np.eye(4)):  # identity keeps every bit of the coordinates
        vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    mirrored = np.linalg.det(matrix[:3, :3]) < 0
    return _Piece(vertices, faces[:, ::-1] if mirrored else faces, colors, name)


def _skinned(
    file: GltfFile,
    skin_index: int,
    primitive: dict[str, Any],
    vertices: np.ndarray,
    world: dict[int, Matrix],
) -> np.ndarray:
    """Return vertices in the rest pose: sum of w_j G_j B_j v; the node's own place is ignored."""
    skin = file.json["skins"][skin_index]
    places = np.stack([world[joint] for joint in skin["joints"]])
    if "inverseBindMatrices" in skin:
        inverse = file.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
        places = places @ inverse[: len(places)]
    joints = file.array(primitive["attributes"]["JOINTS_0"]).astype(np.int64)
    weights = file.array(primitive["attributes"]["WEIGHTS_0"]).astype(np.float64)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.divide(weights, total, out=np.zeros_like(weights), where=total > 0)
    padded = np.concatenate([vertices, np.ones((len(vertices), 1))], axis=1)
    result = np.zeros((len(vertices), 4))
    for column in range(joints.shape[1]):
        moved = np.einsum("nij,nj->ni", places[joints[:, column]], padded)
        result += weights[:, column, None] * moved
    return result[:, :3]


def _faces(file: GltfFile, primitive: dict[str, Any]) -> np.ndarray:
    """Return the triangles of a primitive; none for points and lines."""
    mode = primitive.get("mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN):
        return np.zeros((0, 3), dtype=np.int64)
    if "indices" in primitive:
        corners = file.array(primitive["indices"]).astype(np.int64).ravel()
    else:
        corners = np.arange(file.count(primitive["attributes"]["POSITION"]))
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if len(corners) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    if mode == FAN:
        first = np.full(len(corners) - 2, corners[0])
        return np.stack([first, corners[1:-1], corners[2:]], axis=1)
    strip = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    strip[1::2] = strip[1::2, ::-1]  # every other triangle of a strip turns the other way
    return strip


def _world_matrices(file: GltfFile, path: Path) -> dict[int, Matrix]:
    """Return world_from_node of every node below the default scene, in file order of the tree."""
    nodes = file.json.get("nodes", [])
    scenes = file.json.get("scenes")
    roots = scenes[file.json.get("scene", 0)].get("nodes", []) if scenes else range(len(nodes))
    world: dict[int, Matrix] = {}
    stack = [(root, np.eye(4), 0) for root in reversed(roots)]
    while stack:
        index, parent, depth = stack.pop()
        if index in world and not scenes:
            continue
        if index in world or depth > MAX_DEPTH:
            raise MeshError(f"{path}: its nodes form a loop; the file is damaged, export it again")
        world[index] = parent @ _local_matrix(nodes[index])
        children = nodes[index].get("children", [])
        stack += [(child, world[index], depth + 1) for child in reversed(children)]
    return world


def _local_matrix(node: dict[str, Any]) -> Matrix:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = (float(value) for value in node.get("rotation", (0, 0, 0, 1)))
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _soup(pieces: list[_Piece]) -> Soup:
    if not pieces:
        return Soup(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    starts = np.cumsum([0] + [len(piece.vertices) for piece in pieces])
    names = tuple(dict.fromkeys(piece.name for piece in pieces))
    colors = None
    if any(piece.colors is not None for piece in pieces):
        white = np.uint8(255)  # glTF's default material
        colors = np.concatenate(
            [np.full((len(p.faces), 3), white) if p.colors is None else p.colors for p in pieces]
        )
    parts = [np.full(len(piece.faces), names.index(piece.name)) for piece in pieces]
    return Soup(
        vertices=np.concatenate([piece.vertices for piece in pieces]),
        faces=np.concatenate(
            [piece.faces + start for piece, start in zip(pieces, starts[:-1], strict=True)]
        ),
        colors=colors,
        parts=np.concatenate(parts) if len(names) > 1 else None,
        part_names=names,
    )


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
