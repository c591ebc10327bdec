"""Read glTF 2.0 and GLB: triangles of the default scene in world coordinates.

Read: node transforms, skins in their rest pose and morph targets at their default weights (as every
viewer shows them), vertex colours, materials (`toonset.dataset.mesh.gltf_materials`). Left out:
hidden nodes, and what materials leave transparent. Refused by name: other files, compressed data,
strips. VRM 0 looks along -Z: it is turned by 180 degrees about +Y.

Our own reader: trimesh knows no skins and keeps base colours as 8 bits of linear light.
Source: Khronos glTF 2.0 specification, KHR_node_visibility; VRM consortium, VRM 0.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from toonset.dataset.mesh.gltf_file import GltfFile, open_gltf
from toonset.dataset.mesh.gltf_materials import surface_of
from toonset.dataset.mesh.raw_triangles import RawTriangles, check_counts, listed
from toonset.dataset.mesh.texture import cut_away, whole
from toonset.errors import MeshError

TRIANGLES = 4  # what is below are points and lines
VISIBILITY = "KHR_node_visibility"
VRM_0, VRM_1 = "VRM", "VRMC_vrm"
HALF_TURN = np.diag([-1.0, 1.0, -1.0])  # about +Y
Matrix = Float[np.ndarray, "4 4"]


def read_gltf(data: bytes, path: Path, max_faces: int) -> RawTriangles:
    """Return the triangles of a glTF or GLB file; every node with a mesh is one part.

    Raises:
        MeshError: damaged, cut off, too large, or of a kind named in the module's docstring.
        PictureError: a texture that cannot be read.
    """
    try:
        file = open_gltf(data, path, max_faces)
        pieces, unseen = _pieces(file)
        if unseen and not pieces:
            raise MeshError(f"{path}: all of it is hidden or transparent; show it and export again")
        return _as_vrm(file, _joined(pieces, unseen))
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


def _hidden(file: GltfFile) -> set[int]:
    """Return the nodes that are not shown, with all below them."""
    nodes = file.json.get("nodes", [])
    shut = [
        index
        for index, node in enumerate(nodes)
        if node.get("extensions", {}).get(VISIBILITY, {}).get("visible", True) is False
    ]
    hidden: set[int] = set()
    while shut:
        index = shut.pop()
        if index not in hidden:
            hidden.add(index)
            shut += nodes[index].get("children", [])
    return hidden


def _pieces(file: GltfFile) -> tuple[list[RawTriangles], list[str]]:
    """Return every primitive that is seen in world coordinates, and the names of what is not."""
    world, hidden = _world_matrices(file), _hidden(file)
    pieces: list[RawTriangles] = []
    unseen: list[str] = []
    vertices = faces = 0
    for index in world:
        node = file.json["nodes"][index]
        if "mesh" not in node:
            continue
        mesh = file.json["meshes"][node["mesh"]]
        name = str(node.get("name") or mesh.get("name") or f"node {index}")
        if index in hidden:
            unseen.append(name)
            continue
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", TRIANGLES)
            if mode > TRIANGLES:
                raise MeshError(f"{file.path}: {name} has strips; export it as plain triangles")
            if mode == TRIANGLES:
                piece = _piece(file, index, primitive, world, name)
                if piece is None or piece.remarks:
                    own = _material_name(file, primitive) or name
                    unseen.append(own if piece is None else f"parts of {own}")
                if piece is None:
                    continue
                pieces.append(piece)
                vertices += len(piece.vertices)
                faces += len(piece.faces)
                check_counts(file.path, vertices, faces, file.max_faces)
    return pieces, list(dict.fromkeys(unseen))


def _material_name(file: GltfFile, primitive: dict[str, Any]) -> str:
    return str(file.json["materials"][primitive["material"]].get("name", ""))


def _piece(
    file: GltfFile, index: int, primitive: dict[str, Any], world: dict[int, Matrix], name: str
) -> RawTriangles | None:
    """Return a primitive in world coordinates; None if all of it is transparent."""
    node, attributes = file.json["nodes"][index], primitive["attributes"]
    vertices = _morphed(file, node, primitive)
    corners = np.arange(len(vertices))
    if "indices" in primitive:
        corners = file.array(primitive["indices"]).astype(np.int64).ravel()
    faces = corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if faces.max(initial=-1) >= len(vertices):
        raise MeshError(
            f"{file.path}: a face of {name} refers to vertex {int(faces.max())}, but it has "
            f"{len(vertices)}; the file is damaged, export it again"
        )
    surface, matrix = surface_of(file, primitive, faces), world[index]
    cut = cut_away(surface.texels(len(faces)), surface.seen) if surface.may_be_cut else None
    if cut is not None and not len(cut.parents):
        return None
    if "skin" in node and "JOINTS_0" in attributes:
        vertices = _skinned(file, node["skin"], attributes, vertices, world)
        mirrored = False
    else:
        if not np.array_equal(matrix, np.eye(4)):  # identity keeps every bit of the coordinates
            vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
    shown = whole(len(faces)) if cut is None else cut
    colors = surface.colors(shown.parents, shown.middles)
    said: tuple[str, ...] = ()
    if cut is not None:
        vertices, faces = cut.apply(vertices, faces)
        said = ("cut",)
    faces = faces[:, ::-1] if mirrored else faces
    return RawTriangles(vertices, faces, colors, None, (name,), said)


def _morphed(
    file: GltfFile, node: dict[str, Any], primitive: dict[str, Any]
) -> Float[np.ndarray, "vertices 3"]:
    """Return the vertices at the default weights of the morph targets, the node's own first."""
    vertices = file.array(primitive["attributes"]["POSITION"]).astype(np.float64).reshape(-1, 3)
    weights = node.get("weights") or file.json["meshes"][node["mesh"]].get("weights") or []
    for weight, target in zip(weights, primitive.get("targets", []), strict=False):
        if weight and "POSITION" in target:
            vertices = vertices + float(weight) * file.array(target["POSITION"])
    return vertices


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


def _joined(pieces: list[RawTriangles], unseen: list[str]) -> RawTriangles:
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
        remarks=(f"left out what is hidden or transparent: {listed(unseen)}",) if unseen else (),
    )


def _as_vrm(file: GltfFile, raw: RawTriangles) -> RawTriangles:
    """Return the triangles so that a VRM 0 faces +Z, as all else does."""
    extensions = file.json.get("extensions", {})
    if VRM_0 not in extensions or VRM_1 in extensions:
        return raw
    said = "is VRM 0, which faces -Z: turned by 180 degrees about +Y"
    return raw.turned(HALF_TURN, said)
