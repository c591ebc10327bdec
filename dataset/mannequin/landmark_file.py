"""Read landmark files: which pixel of a drawing shows which point of the mannequin.

JSON:

    {"schema": "toonset-landmarks/1",
     "pixels": "sheet",                                  or "view": pixels of the view's crop
     "points": {"nose": [0, 1.2, 0.3]},                  optional: world coordinates by name
     "views": {"0": {"nose": [412.0, 96.5]},             number in sheet order, or "000.png"
               "1": [{"world": [0, 1.2, 0.3], "pixel": [640.0, 95.0]}]}}

or CSV with the columns view,name,u,v and, optional, x,y,z (sheet pixels). Names without
coordinates are those of the mannequin: `NAME.landmarks.json` beside `NAME.obj`, a file of the same
schema with "points". Left and right are the character's own. A picture's top left corner is
(0, 0), its first pixel's centre (0.5, 0.5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from toonset.dataset.mannequin.landmark_formats import (
    LandmarkFile,
    Numbers,
    Pair,
    closest,
    read_landmark_file,
)
from toonset.errors import LandmarkError
from toonset.view import View

LEAST_POINTS = 3  # fewer leave the camera's turn open
UNTURNED = np.eye(3)


@dataclass(frozen=True, eq=False)
class Landmarks:
    """The pairs of one view.

    Attributes:
        view: file name of the view, for messages.
        names: one per pair.
        world: (n, 3) points in the mannequin's frame.
        pixels: (n, 2) where the view's crop shows them.
    """

    view: str
    names: tuple[str, ...]
    world: Float[np.ndarray, "n 3"]
    pixels: Float[np.ndarray, "n 2"]


def read_landmarks(
    path: Path, views: Sequence[View], known: Mapping[str, Sequence[float]]
) -> tuple[Landmarks | None, ...]:
    """Return the pairs of every view, None for a view without any.

    Args:
        path: a landmark file, CSV or JSON.
        views: the drawings in sheet order; sheet pixels are those of a view's own sheet.
        known: the mannequin's points by name; the file's own "points" go first.

    Raises:
        LandmarkError: a broken file, an unknown name or view, a pixel outside of its view, fewer
            than three pairs in a view that has any.
    """
    file = read_landmark_file(path)
    points = {**{name: tuple(p) for name, p in known.items()}, **file.points}
    found: list[Landmarks | None] = [None] * len(views)
    for key, pairs in file.views.items():
        index = _view_index(f"{path}: view {key!r}", key, views)
        where = f"{path}: view {views[index].name}"
        if found[index] is not None:
            raise LandmarkError(f"{where}: is given twice, under two names; merge both")
        if 0 < len(pairs) < LEAST_POINTS:
            raise LandmarkError(f"{where}: {len(pairs)} pairs, {LEAST_POINTS} are needed; add more")
        if pairs:
            found[index] = _landmarks(where, views, index, pairs, points, file)
    if all(landmarks is None for landmarks in found):
        raise LandmarkError(
            f"{path}: holds no pairs; {LEAST_POINTS} in a view are needed; add them"
        )
    return tuple(found)


def read_known_points(
    mesh_path: Path, world_from_file: Float[np.ndarray, "3 3"] = UNTURNED
) -> dict[str, Numbers]:
    """Return the named points beside a mannequin's file, turned as it was; empty without them.

    Raises:
        LandmarkError: `NAME.landmarks.json` is there, but broken.
    """
    path = mesh_path.with_suffix(".landmarks.json")
    points = read_landmark_file(path).points if path.exists() else {}
    return {name: tuple((world_from_file @ point).tolist()) for name, point in points.items()}


def _view_index(where: str, key: str, views: Sequence[View]) -> int:
    names = [view.name for view in views]
    stems = [Path(name).stem for name in names]
    for choices in (names, stems, [str(i) for i in range(len(views))]):
        if key in choices:
            return choices.index(key)
    raise LandmarkError(f"{where}: no such view among {len(views)}; {closest(key, names)}")


def _landmarks(
    where: str,
    views: Sequence[View],
    index: int,
    pairs: Sequence[Pair],
    points: Mapping[str, Numbers],
    file: LandmarkFile,
) -> Landmarks:
    corner = views[index].box[:2] if file.in_sheet else (0, 0)
    pixels = np.array([pair.pixel for pair in pairs]) - np.array(corner, dtype=np.float64)
    for pair in pairs:
        check_inside(f"{where}: {pair.name}", pair.pixel, views[index], in_sheet=file.in_sheet)
    return Landmarks(
        views[index].name,
        tuple(pair.name for pair in pairs),
        np.array([_world(where, pair, points) for pair in pairs], dtype=np.float64),
        pixels,
    )


def _world(where: str, pair: Pair, points: Mapping[str, Numbers]) -> Numbers:
    if pair.world is not None:
        return pair.world
    if pair.name in points:
        return points[pair.name]
    if not points:
        raise LandmarkError(
            f"{where}: {pair.name!r} has no coordinates, and the mannequin has no named points; "
            'add "points" to the file'
        )
    raise LandmarkError(f"{where}: unknown name {pair.name!r}; {closest(pair.name, list(points))}")


def check_inside(where: str, pixel: Numbers, view: View, *, in_sheet: bool) -> None:
    """Refuse a pixel that a view does not have.

    Args:
        where: file and point, for the message.
        pixel: of the sheet, or of the view's crop.
        view: the drawing.
        in_sheet: it is the sheet's.

    Raises:
        LandmarkError: it lies outside.
    """
    x, y, _, _ = view.box if in_sheet else (0, 0, 0, 0)
    height, width = view.rgba.shape[:2]
    if not (x <= pixel[0] <= x + width and y <= pixel[1] <= y + height):
        unit = "sheet" if in_sheet else "view"
        raise LandmarkError(
            f"{where}: ({pixel[0]:g}, {pixel[1]:g}) lies outside of the view, which has "
            f"{unit} pixels {x} to {x + width}, {y} to {y + height}; correct the pixel or the view"
        )
