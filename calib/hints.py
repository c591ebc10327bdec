"""Resolve what a person says of the views for these drawings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from toonset.calib.from_landmarks import landmarks_of_every_view
from toonset.calib.known import Known
from toonset.calib.options import Hints
from toonset.calib.outline.pose import Pose
from toonset.camera import Camera, rotation_from_angles
from toonset.dataset.bundle.transforms_read import read_cameras
from toonset.dataset.mannequin.landmark_file import Landmarks, check_inside, read_landmarks
from toonset.dataset.split_folder.corrected import Given
from toonset.dataset.split_folder.corrections import PlacedCamera, PointPair
from toonset.dataset.split_folder.view_labels import parse_labels
from toonset.errors import CameraError
from toonset.view import View

SQUARE = 1e-3  # a pixel may be this much higher than wide: rounding of a file


def check_hints(hints: Hints) -> None:
    """Refuse hints that contradict each other, or what the corrections say.

    Raises:
        UsageError: they do.
        SheetError: the file of corrections is broken.
    """
    hints.check()
    if hints.corrections is not None:
        Given.of(hints.corrections).check_beside(
            views=hints.labels, landmarks=hints.landmarks, init=hints.init
        )


def known_of(hints: Hints, views: Sequence[View], points: Mapping[str, Sequence[float]]) -> Known:
    """Resolve the hints for these views.

    Args:
        hints: as typed.
        views: the drawings.
        points: of the mannequin, by name.

    Raises:
        ToonsetError: a label, a landmark file or cameras that do not belong to the views.
    """
    text = hints.label_text(views)
    labels = parse_labels(text, len(views)) if text else ()
    landmarks: tuple[Landmarks | None, ...] = ()
    if hints.landmarks is not None:
        landmarks = read_landmarks(Path(hints.landmarks), views, points)
    if hints.landmarks_only:
        landmarks_of_every_view(views, landmarks)
    cameras = _cameras(Path(hints.init), views) if hints.init else ()
    known = Known(labels, landmarks, cameras, frozenset(hints.lock))
    if hints.corrections is not None:
        known = _corrected(known, Given.of(hints.corrections), views)
    known.check(views)
    return known


def _corrected(known: Known, given: Given, views: Sequence[View]) -> Known:
    """Return the hints merged with the corrections of single views."""
    said = given.of_views(views)
    if not any(said):
        return known
    labels = [
        (own.yaws if own else ()) or label
        for own, label in zip(said, known.labels or ((),) * len(views), strict=True)
    ]
    placed = tuple(
        _placed(own.camera, view) if own and own.camera else None
        for own, view in zip(said, views, strict=True)
    )
    kept = tuple(own is not None and own.lock for own in said)
    landmarks = tuple(
        _pairs(f"{given.path}: view {view.name}", own.landmarks, view) if own else None
        for own, view in zip(said, views, strict=True)
    )
    return replace(
        known,
        labels=tuple(labels) if any(labels) else (),
        landmarks=landmarks if any(landmarks) else known.landmarks,
        placed=placed if any(placed) or any(kept) else (),
        kept=kept if any(kept) else (),
    )


def _placed(camera: PlacedCamera, view: View) -> Pose:
    """Return a camera placed by hand, in pixels of the view's crop."""
    yaw, elevation, roll = np.radians([camera.yaw, camera.elevation, camera.roll]).tolist()
    shift = np.array(camera.middle) - view.box[:2]
    return Pose(rotation_from_angles(yaw, elevation, roll), shift, camera.scale)


def _pairs(where: str, pairs: Sequence[PointPair], view: View) -> Landmarks | None:
    """Return clicked points as landmarks, in pixels of the view's crop."""
    if not pairs:
        return None
    for i, pair in enumerate(pairs):
        check_inside(f"{where}: landmarks.{i}", pair.pixel, view, in_sheet=True)
    pixels = np.array([pair.pixel for pair in pairs]) - view.box[:2]
    names = tuple(f"point {i}" for i in range(len(pairs)))
    return Landmarks(view.name, names, np.array([pair.world for pair in pairs]), pixels)


def _cameras(path: Path, views: Sequence[View]) -> tuple[Camera, ...]:
    """Return the cameras of `init`; in the views' order where their names are the views'."""
    named = [(Path(name).name, camera) for name, camera in read_cameras(path)]
    names = [view.name for view in views]
    if sorted(name for name, _ in named) == names:
        named.sort(key=lambda frame: frame[0])
    for name, camera in named:
        if abs(camera.pixel_aspect - 1) > SQUARE:
            raise CameraError(
                f"--init: the camera of {name} has pixels {camera.pixel_aspect:.3g} times as high "
                "as wide, square ones are needed; give other cameras"
            )
    return tuple(camera for _, camera in named)
