"""Runs and, where it is known, the truth of their new views, in the run's own world."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from toonset.camera import Camera
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.bundle.scene import Frame
from toonset.errors import BundleError
from toonset.json_file import read_json
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.run.folder import CONFIG, read_field

DRAWN_SIDE = 6  # of a studio sheet's held-out views: so many, and the first, are of its drawn side


@dataclass(frozen=True, eq=False)
class Sheet:
    """A run and what its new views should look like.

    Attributes:
        name: of it.
        field: of the run, with its drawings.
        truth: held-out views, by cameras in the run's world; empty where nothing is known.
    """

    name: str
    field: TrainedField
    truth: tuple[Frame, ...] = ()


def sheets(places: Sequence[Path], cases: Path | None, only: str = "") -> Iterator[Sheet]:
    """Yield every run of some folders.

    Args:
        places: run folders, or folders with `run/` and `bundle/` in them, named as their case.
        cases: folders with ground truth; those named as a place is have the truth of its views.
        only: leave out places whose name does not contain this.

    Raises:
        BundleError: a place holds no run, or the drawings of its bundle are not those of the case.
    """
    for place in places:
        if only not in place.name:
            continue
        run = place if (place / CONFIG).is_file() else place / "run"
        name = place.parent.name if place.name == "run" else place.name
        case = None if cases is None else cases / name.removesuffix("-default")
        truth: tuple[Frame, ...] = ()
        if case is not None and (case / "test/transforms.json").is_file():
            truth = _truth(case, run.parent / "bundle")
        yield Sheet(name, read_field(run), truth)


def _truth(case: Path, bundle: Path) -> tuple[Frame, ...]:
    """Return a case's held-out views, their cameras moved to the world that calibration found."""
    found, true = read_scene(bundle).frames, read_scene(case / "views").frames
    boxes = read_json(case / "gt.json")["boxes"]
    about = read_json(bundle / "calibration.json")["views"]
    if not len(found) == len(true) == len(boxes) == len(about):
        raise BundleError(f"{bundle}: holds {len(found)} drawings, {case} has {len(true)}")
    cells = [np.array([box["sheet_x"], box["sheet_y"]], float) for box in boxes]
    crops = [np.array(view["box"][:2], float) for view in about]
    placed = [_on_sheet(f.camera, at) for f, at in zip(found, crops, strict=True)]
    wanted = [_on_sheet(f.camera, at) for f, at in zip(true, cells, strict=True)]
    world = similarity(placed, wanted)
    test = read_scene(case / "test").frames
    return tuple(replace(frame, camera=world.into(frame.camera)) for frame in test)


def _on_sheet(camera: Camera, corner: np.ndarray) -> Camera:
    """Return a camera of a cell in pixels of the sheet."""
    return replace(camera, center=camera.center + corner)


@dataclass(frozen=True, eq=False)
class Similarity:
    """Map from one world to another: `scale * rotation @ x + shift`."""

    rotation: np.ndarray
    scale: float
    shift: np.ndarray

    def into(self, camera: Camera) -> Camera:
        """Return the camera in the first world that sees what `camera` sees in the second."""
        target = self.rotation.T @ (camera.target - self.shift) / self.scale
        return replace(
            camera,
            rotation=camera.rotation @ self.rotation,
            target=target,
            scale=camera.scale * self.scale,
            k=camera.k * self.scale,
        )


def similarity(found: Sequence[Camera], true: Sequence[Camera]) -> Similarity:
    """Return the similarity that brings found cameras nearest to true ones (least squares).

    Projections of a box round the figure are compared, over all views at once: the sheet's gauge.
    """
    start = Rotation.from_matrix(
        [b.rotation.T @ a.rotation for a, b in zip(found, true, strict=True)]
    ).mean()
    size = float(np.median([min(c.size_wh) / c.scale for c in found]))
    middle = np.mean([c.target for c in found], axis=0)
    sides = [np.array([-0.4, 0.4]) * size] * 3
    points = middle + np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 3)
    shown = [camera.project(points)[0] for camera in found]

    def apart(p: np.ndarray) -> np.ndarray:
        moved = np.exp(p[3]) * (Rotation.from_rotvec(p[:3]) * start).apply(points) + p[4:]
        pairs = zip(true, shown, strict=True)
        return np.concatenate([(camera.project(moved)[0] - own).ravel() for camera, own in pairs])

    scale = float(np.median([a.scale / b.scale for a, b in zip(found, true, strict=True)]))
    shift = np.mean([c.target for c in true], axis=0) - scale * start.apply(middle)
    best = least_squares(apart, np.array([0, 0, 0, np.log(scale), *shift]), loss="soft_l1").x
    rotation = (Rotation.from_rotvec(best[:3]) * start).as_matrix()
    return Similarity(rotation, float(np.exp(best[3])), best[4:])
