"""Walking COLMAP's binary files before pycolmap does: a damaged count makes it fill memory or hang.

Only lengths are followed; what the numbers mean is left to pycolmap.
Source: COLMAP, src/colmap/scene/reconstruction_io_binary.cc.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

from toonset.errors import BundleError
from toonset.read import read_whole

MAX_BYTES = 2**30
# of each camera model by its number, as COLMAP lists them
PARAMETERS = (3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12, 16, 4, 5, 3, 4, 6, 2)
POSE = 7 * 8  # quaternion and translation
SENSOR = 4 + 4  # type and id


class _Walk:
    """A place in a file that moves on; past its end is an error."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def skip(self, count: int) -> None:
        self.at += count
        if self.at > len(self.data):
            raise ValueError("cut off")

    def number(self, kind: str) -> int:
        start = self.at
        self.skip(struct.calcsize(kind))
        return int(struct.unpack_from(kind, self.data, start)[0])

    def skip_text(self) -> None:
        self.at = self.data.index(b"\0", self.at) + 1


def check_lengths(folder: Path) -> None:
    """Refuse a model whose binary files do not end where their counts say.

    Raises:
        BundleError: a file is cut off, longer than it says, or damaged.
    """
    for name, walk_record in RECORDS.items():
        file = folder / f"{name}.bin"
        if file.is_file():
            _check(file, walk_record)


def _check(file: Path, walk_record: Callable[[_Walk], None]) -> None:
    walk = _Walk(read_whole(file, "COLMAP", BundleError, MAX_BYTES))
    try:
        for _ in range(walk.number("<Q")):
            walk_record(walk)
        if walk.at != len(walk.data):
            raise ValueError("too long")
    except ValueError as error:
        raise BundleError(
            f"{file}: is no complete COLMAP model (cut off or damaged); export it again"
        ) from error


def _camera(walk: _Walk) -> None:
    walk.skip(4)
    model = walk.number("<i")
    if not 0 <= model < len(PARAMETERS):
        raise ValueError("unknown model")
    walk.skip(2 * 8 + 8 * PARAMETERS[model])


def _image(walk: _Walk) -> None:
    walk.skip(4 + POSE + 4)
    walk.skip_text()
    walk.skip(walk.number("<Q") * (2 * 8 + 8))  # pixels and the point that each shows


def _point(walk: _Walk) -> None:
    walk.skip(8 + 3 * 8 + 3 + 8)
    walk.skip(walk.number("<Q") * (4 + 4))  # its track: image and keypoint


def _rig(walk: _Walk) -> None:
    walk.skip(4)
    sensors = walk.number("<I")
    if sensors:
        walk.skip(SENSOR)  # the first is where the rig is
    for _ in range(sensors - 1):
        walk.skip(SENSOR)
        walk.skip(POSE if walk.number("<B") else 0)


def _frame(walk: _Walk) -> None:
    walk.skip(4 + 4 + POSE)
    walk.skip(walk.number("<I") * (SENSOR + 8))


RECORDS: dict[str, Callable[[_Walk], None]] = {
    "cameras": _camera,
    "images": _image,
    "points3D": _point,
    "rigs": _rig,
    "frames": _frame,
}
