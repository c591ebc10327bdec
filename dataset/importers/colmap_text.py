"""Mend a COLMAP images.txt that lacks its lines of points.

Every image takes two lines, its pose and its points.
A model without points has empty lines there, which editors and scripts leave out. COLMAP then takes
every second pose for points and reads half of the images, without a word.

Source: COLMAP's documentation, "Output format", images.txt.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from toonset.errors import BundleError
from toonset.read import read_whole

IMAGES = "images.txt"
MAX_BYTES = 2**30
POSE_WORDS = 10  # id, four of the quaternion, three of the translation, camera, name


@contextmanager
def with_lines_of_points(folder: Path) -> Iterator[Path]:
    """Yield the model's folder, or a temporary copy whose images.txt has the missing lines.

    Raises:
        BundleError: images.txt cannot be read.
    """
    file = folder / IMAGES
    if not file.is_file() or (folder / "images.bin").is_file():
        yield folder
        return
    text = read_whole(file, "COLMAP", BundleError, MAX_BYTES).decode("utf-8", "surrogateescape")
    found = text.removesuffix("\n").split("\n")
    whole = lines_with_points(found)
    if len(whole) == len(found):
        yield folder
        return
    with tempfile.TemporaryDirectory() as place:
        for other in folder.glob("*.txt"):
            if other.name != IMAGES:
                shutil.copyfile(other, Path(place) / other.name)
        text = "\n".join(whole) + "\n"
        (Path(place) / IMAGES).write_bytes(text.encode("utf-8", "surrogateescape"))
        yield Path(place)


def lines_with_points(lines: Sequence[str]) -> list[str]:
    """Return the lines of an images.txt, an empty one wherever an image's points are missing."""
    whole = []
    points_follow = False
    for line in lines:
        if points_follow and _is_pose(line):
            whole.append("")
            points_follow = False
        whole.append(line)
        if points_follow:
            points_follow = False
        else:
            points_follow = bool(line.strip()) and not line.lstrip().startswith("#")
    return [*whole, ""] if points_follow else whole


def _is_pose(line: str) -> bool:
    """Return whether a line is an image's pose and name; points are triples of numbers only."""
    words = line.split()
    if len(words) < POSE_WORDS or not all(map(_is_number, words[: POSE_WORDS - 1])):
        return False
    return not (len(words) % 3 == 0 and all(map(_is_number, words)))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
