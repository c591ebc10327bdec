"""R3, mutated: documents, palettes and COLMAP's files with random values and random bytes."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from typing import Any

from lab.audit.case import Case, Row, run_cases
from lab.audit.documents import (
    BOXES,
    JSON_KINDS,
    ODD,
    Kind,
    imported,
    places_of,
    put,
    set_at,
    value_at,
)
from lab.audit.material import Material

PER_KIND = 45  # mutations
OTHER_KINDS = (
    Kind(("bundle",), "bundle/palette.gpl", (("palette", "b", "--colors", "b/palette.gpl"),)),
    Kind(("bundle",), "bundle/palette.ase", (("palette", "b", "--colors", "b/palette.ase"),)),
    Kind(("bundle",), "bundle/palette.hex", (("palette", "b", "--colors", "b/palette.hex"),)),
    Kind(
        ("sheet.png",), "boxes.csv", (("split", "sheet.png", "--boxes", "boxes.csv", "-o", "o"),),
        "x,y,width,height\n" + "".join(f"{','.join(map(str, box))}\n" for box in BOXES),
    ),
    *[Kind(("colmap",), f"colmap/sparse/0/{name}.bin", imported("colmap")[:1])
      for name in ("cameras", "images", "points3D", "rigs", "frames")],
    *[Kind(("colmap--text",), f"colmap--text/sparse/0/{name}.txt", imported("colmap--text")[:1])
      for name in ("cameras", "images")],
)  # fmt: skip


def row(material: Material) -> Row:
    """Change values and bytes by lot: 16 kinds of mutations, one to three at a time."""
    lot = random.Random(material.seed)

    def cases() -> Iterator[Case]:
        for kind in (*JSON_KINDS, *OTHER_KINDS):
            content = kind.content(material)
            for i in range(PER_KIND):
                name, data = mutated(content, lot, kind in JSON_KINDS and i % 2 == 0)
                yield from kind.only(i).cases(material, f"{i} {name}", put(data))

    return run_cases(cases(), material.work)


def mutated(content: bytes, lot: random.Random, as_json: bool) -> tuple[str, bytes]:
    """Return how and the content with one to three changes, of its values or its bytes."""
    names, count = [], lot.randint(1, 3)
    if as_json:
        document = json.loads(content)
        names = [mutate_value(document, lot) for _ in range(count) if document]
        return "+".join(names), json.dumps(document).encode()
    data = bytearray(content)
    names = [mutate_bytes(data, lot) for _ in range(count) if data]
    return "+".join(names), bytes(data)


def mutate_value(document: Any, lot: random.Random) -> str:
    """Change one value of a document in place; return how."""
    place, other = lot.choices([*places_of(document)], k=2)
    old = value_at(document, place)
    number = old if isinstance(old, int | float) and abs(old) < 1e9 else 1
    kind, new = lot.choice(
        [
            ("gone", []),
            ("odd", [lot.choice(ODD)]),
            ("negative", [-number]),
            ("a thousand", [number * 1000]),
            ("a thousandth", [number / 1000]),
            ("a bit more", [number + lot.gauss(0, 0.01)]),
            ("as text", [str(old)]),
            ("in a list", [[old]]),
            ("twice", [[old, old]]),
            ("another", [json.loads(json.dumps(value_at(document, other)))]),
        ]
    )
    set_at(document, place, new)
    return kind


def mutate_bytes(data: bytearray, lot: random.Random) -> str:
    """Change some bytes in place; return how."""
    at = lot.randrange(len(data))
    piece = bytes(data[at : at + lot.choice((1, 4, 8, 50))])
    kind, new = lot.choice(
        [
            ("flip", bytes([piece[0] ^ 1 << lot.randrange(8)]) + piece[1:]),
            ("cut out", b""),
            ("repeat", piece * 2),
            ("noise", lot.randbytes(len(piece))),
            ("ones", b"\xff" * len(piece)),
            ("insert", lot.randbytes(3) + piece),
        ]
    )
    data[at : at + len(piece)] = new
    return kind
