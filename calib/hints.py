"""What a person says of the views, as typed, and what that means for these drawings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toonset.calib.from_landmarks import landmarks_of_every_view
from toonset.calib.known import LOCKS, Known
from toonset.camera import Camera
from toonset.dataset.bundle.transforms_read import read_cameras
from toonset.dataset.mannequin.landmark_file import Landmarks, read_landmarks
from toonset.dataset.split_folder.view_labels import parse_labels
from toonset.errors import CameraError, UsageError
from toonset.view import View

SQUARE = 1e-3  # a pixel may be this much higher than wide: rounding of a file


@dataclass(frozen=True)
class Hints:
    """What is known of the views; everything may be left out.

    Attributes:
        labels: what each view shows, in sheet order: "front,3q,side,back", yaws in degrees, "?"
            where unknown; empty: what the views themselves say.
        landmarks: file of pixels that show points of the mannequin, JSON or CSV.
        landmarks_only: cameras from landmarks alone; the outline is not the mannequin's.
        init: bundle or transforms.json of these views to start from.
        lock: what stays as `init` has it (or yaw as labels have it): yaw, elevation, scale, fov.
    """

    labels: str = ""
    landmarks: str | Path | None = None
    landmarks_only: bool = False
    init: str | Path | None = None
    lock: tuple[str, ...] = ()

    def check(self) -> None:
        """Refuse what contradicts itself.

        Raises:
            UsageError: `landmarks_only` without landmarks or beside what it does not use, or a
                lock that does not exist.
        """
        unknown = [name for name in self.lock if name not in LOCKS]
        if unknown:
            raise UsageError(f"--lock: {unknown[0]!r} is none of {', '.join(LOCKS)}")
        if not self.landmarks_only:
            return
        if self.landmarks is None:
            raise UsageError("--landmarks-only needs --landmarks FILE")
        for name, value in {
            "--views": self.labels,
            "--init": self.init,
            "--lock": self.lock,
        }.items():
            if value:
                raise UsageError(f"{name} does nothing beside --landmarks-only; drop one")

    def label_text(self, views: Sequence[View]) -> str:
        """Return what each view shows; the views' own labels where nothing was said here."""
        if self.labels or not any(view.label for view in views):
            return self.labels
        return ",".join(view.label or "?" for view in views)

    def as_options(self, views: Sequence[View]) -> dict[str, Any]:
        """Return what calibration.json keeps besides the files."""
        return {
            "views": self.label_text(views) or None,
            "landmarks_only": self.landmarks_only,
            "locked": list(self.lock),
        }


def known_of(hints: Hints, views: Sequence[View], points: Mapping[str, Sequence[float]]) -> Known:
    """Return what is known of the views before they are looked at.

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
    known.check(views)
    return known


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
