"""R2: meshes that are broken, strange or huge, given to calibrate as the mannequin."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lab.audit.case import Case, Row, run_cases
from lab.audit.material import Material

Make = Callable[[], bytes]
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
SIDES = np.array([int(i) for i in "013032467475045051237276026064157173"]).reshape(12, 3)
TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def row(material: Material) -> Row:
    """Calibrate the sheet against every mesh."""
    rng = np.random.default_rng(material.seed)
    body = (material.root / "m.obj").read_bytes()
    made = [*texts(body), *binaries(rng), *shapes(rng), *cut_and_flipped(material, rng)]

    def cases() -> Iterator[Case]:
        for name, make in made:

            def prepare(folder: Path, name: str = name, make: Make = make) -> None:
                material.copy_all(folder, "sheet.png")
                (folder / name).write_bytes(make())

            yield Case(name, ("calibrate", "sheet.png", "--mesh", name, "-o", "o"), prepare)

    return run_cases(cases(), material.work)


def const(data: bytes) -> Make:
    return lambda: data


def texts(body: bytes) -> Iterator[tuple[str, Make]]:
    """Yield OBJ files with odd lines and numbers, and other texts."""
    lines = (
        *("f 99999999999999999999999 1 2", "f 1 2 999999", "f 0 1 2", "f -1 -2 -3", "f 1 1 1"),
        *("f 1 2", "f 1", "f", "f a b c", "f 1/2/3/4 2 3", "f 1.5 2 3", "f 1//1 2//2 3//3"),
        *("v nan 0 0", "v inf 0 0", "v 1e300 0 0", "v 1e400 0 0", "v 1 2", "v", "v a b c"),
        *("v 1 2 3 4 5 6 7", "v 0x10 0 0", "v 1_0 2 3", "vt 1", "vn 0 0 0", "usemtl \x1b[31m"),
        *("mtllib /dev/zero", "mtllib ../../x.mtl", "o " + "n" * 100_000, "g \xff", "l 1 2", "p 1"),
        *("call x.obj", "\\", "f " + " ".join(map(str, range(1, 5000))), "\0", "# \x1b[2J"),
    )
    for i, line in enumerate(lines):
        yield f"line-{i}.obj", const(body + line.encode("latin-1") + b"\n")
    for name, data in {
        "empty": b"",
        "only-points": TRIANGLE,
        "one-face": TRIANGLE + b"f 1 2 3\n",
        "lying": b"v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n",
        "zero-area": b"v 0 0 0\nv 0 1 0\nv 0 2 0\nf 1 2 3\n",
        "a-point": b"v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n",
        "huge": TRIANGLE.replace(b"1", b"1e30") + b"f 1 2 3\n",
        "dwarf": TRIANGLE.replace(b"1", b"1e-30") + b"f 1 2 3\n",
        "far": TRIANGLE.replace(b"0", b"1e9") + b"f 1 2 3\n",
        "windows": body.replace(b"\n", b"\r\n"),
        "utf-16": body.decode().encode("utf-16"),
        "bom": b"\xef\xbb\xbf" + body,
        "no-newline": body.rstrip(),
        "text": b"hello\n",
    }.items():
        yield f"{name}.obj", const(data)
    head = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
    tail = "property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n"
    flat = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    counts = (
        *((3, 1, flat), (10**9, 1, flat), (-1, 1, flat), (3, 10**12, flat), (3, 0, "0 0 0\n" * 3)),
        *((3, 1, flat.replace("3 0", "255 0")), (3, 1, flat.replace("0 1 2", "0 1 9"))),
        *((3, 1, flat.replace("1 0 0", "nan 0 0")), (3, 1, ""), (0, 0, "")),
    )
    for i, (vertices, faces, data) in enumerate(counts):
        text = (head + tail).format(vertices, faces) + data
        yield f"ply-{i}.ply", const(text.encode())
    yield "no-header.ply", const(b"ply\nend_header\n")
    yield "endless-header.ply", const(b"ply\n" + b"comment x\n" * 300_000)
    yield "ascii.stl", const(b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n")
    yield "counts.stl", const(bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50))
    yield "counts.off", const(b"OFF\n999999999 999999999 0\n0 0 0\n")
    yield "named.fbx", const(b"Kaydara FBX Binary")
    yield "picture.obj", const(b"\x89PNG\r\n\x1a\n")


def glb(document: Any, data: bytes = b"") -> bytes:
    """Return a GLB of this document, or text, and this data."""
    text = document if isinstance(document, bytes) else json.dumps(document).encode()
    text, data = text + b" " * (-len(text) % 4), data + b"\0" * (-len(data) % 4)
    parts = struct.pack("<II", len(text), 0x4E4F534A) + text
    parts += struct.pack("<II", len(data), 0x004E4942) + data if data else b""
    return struct.pack("<III", 0x46546C67, 2, 12 + len(parts)) + parts


def scene(vertices: np.ndarray, faces: np.ndarray, nodes: int = 1) -> tuple[dict[str, Any], bytes]:
    """Return a glTF document of one mesh that `nodes` nodes show at one place."""
    data = vertices.astype("<f4").tobytes() + faces.astype("<u4").tobytes()
    views = [
        {"buffer": 0, "byteOffset": 0, "byteLength": vertices.size * 4},
        {"buffer": 0, "byteOffset": vertices.size * 4, "byteLength": faces.size * 4},
    ]
    bounds = {"min": vertices.min(0).tolist(), "max": vertices.max(0).tolist()}
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3", **bounds},
        {"bufferView": 1, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
    ]
    document: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0}
    document["scenes"] = [{"nodes": list(range(nodes))}]
    document["nodes"] = [{"mesh": 0} for _ in range(nodes)]
    document["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}]
    document |= {
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    return document, data


def binaries(rng: np.random.Generator) -> Iterator[tuple[str, Make]]:
    """Yield GLB files whose parts contradict each other."""
    document, data = scene(CUBE, SIDES)
    changes: tuple[tuple[str, str, Any], ...] = (
        *(("accessors", "count", n) for n in (0, -1, 7, 2**31, 1e300, "x", None)),
        *(("accessors", "bufferView", n) for n in (9, -1, None)),
        *(("accessors", "componentType", n) for n in (0, 5120, "x")),
        *(("bufferViews", "byteOffset", n) for n in (-4, 10**12, 3)),
        *(
            ("buffers", "uri", n)
            for n in ("/etc/passwd", "../x.bin", "data:,", "http://x.invalid/")
        ),
        *(("nodes", "mesh", n) for n in (5, -1, "x")),
        *(("nodes", "children", n) for n in ([0], [99])),
        *(("nodes", "matrix", n) for n in ([0] * 16, [1e300] * 16, [1])),
        *(("nodes", "scale", n) for n in ([0, 0, 0], [-1, 1, 1], [1e30, 1, 1])),
    )
    for i, (part, key, value) in enumerate(changes):
        changed = json.loads(json.dumps(document))
        changed[part][0][key] = value
        yield f"glb-{i}-{part}-{key}.glb", const(glb(changed, data))
    yield "no-scene.glb", const(glb({"asset": {"version": "2.0"}}))
    yield "deep.glb", const(glb(b"[" * 100_000))
    yield "no-json.glb", const(glb(b"x", data))
    yield "lengths.glb", const(struct.pack("<III", 0x46546C67, 2, 2**32 - 1))
    yield "noise.glb", const(b"glTF" + rng.bytes(5000))


def shapes(rng: np.random.Generator) -> Iterator[tuple[str, Make]]:
    """Yield valid meshes that cost much: coincident, random, many faces."""
    for count in (2, 100, 400, 20_000):
        yield f"cubes-{count}.glb", lambda count=count: glb(*scene(CUBE, SIDES, count))
    for count in (50, 2_000, 20_000):
        loose = rng.random((3 * count, 3))
        order = np.arange(3 * count).reshape(-1, 3)
        yield f"triangles-{count}.glb", lambda v=loose, f=order: glb(*scene(v, f))
    fan = np.stack([np.zeros(3000, int), np.arange(1, 3001), np.arange(2, 3002)], 1)
    yield "fan.glb", lambda: glb(*scene(rng.random((3002, 3)), fan))
    for side in (100, 1000):

        def grid(side: int = side) -> bytes:
            x, y = np.meshgrid(*[np.linspace(0, 1, side + 1)] * 2)
            points = np.stack([x, y, np.sin(9 * x) * np.cos(9 * y)], -1).reshape(-1, 3)
            first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
            corners = [
                first,
                first + 1,
                first + side + 2,
                first,
                first + side + 2,
                first + side + 1,
            ]
            return glb(*scene(points, np.stack(corners, 1).reshape(-1, 3)))

        yield f"faces-{2 * side * side}.glb", grid
    yield "open.glb", lambda: glb(*scene(CUBE, SIDES[:-2]))
    yield "inside-out.glb", lambda: glb(*scene(CUBE, SIDES[:, ::-1]))
    yield "repeated.glb", lambda: glb(*scene(CUBE, np.tile(SIDES, (200, 1))))


def cut_and_flipped(material: Material, rng: np.random.Generator) -> Iterator[tuple[str, Make]]:
    """Yield the mannequin, cut off or with a bit flipped."""
    whole = (material.root / "m.obj").read_bytes()
    solid = glb(*scene(CUBE, SIDES))
    for data, suffix in ((whole, "obj"), (solid, "glb")):
        for i in range(5):
            at = int(rng.integers(1, len(data)))
            flipped = bytearray(data)
            flipped[at] ^= 1 << int(rng.integers(8))
            yield f"cut-{i}.{suffix}", const(data[:at])
            yield f"flip-{i}.{suffix}", const(bytes(flipped))
