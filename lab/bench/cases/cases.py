"""What is measured: folders with ground truth, or synthetic turnarounds with fresh seeds.

A case folder holds `sheet.png`, `mannequin.obj` and `gt.json` (world_from_camera, OpenGL axes) for
calibration; `views/` and `test/` with a transforms.json each for training. The condition is the
part of its name after the last hyphen.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from lab.bench.cases.bodies import random_body
from toonset import frames
from toonset.dataset.bundle.read_scene import read_scene
from toonset.dataset.bundle.scene import Frame, Scene
from toonset.dataset.images.picture import load_rgba
from toonset.dataset.mesh.load import load_mesh
from toonset.dataset.split.sheet import split_picture
from toonset.dataset.synthetic.options import SynthOptions
from toonset.dataset.synthetic.turnaround import Turnaround, make_turnaround
from toonset.errors import BundleError
from toonset.json_file import read_json
from toonset.mesh import Mesh
from toonset.view import View

CLEAN = SynthOptions(yaw_jitter_deg=8, outline_px=0, elevation_deg=10)
DRAWN = replace(CLEAN, outline_px=2.5, warp_percent=0.8)
MANNEQUIN_FILE = "mannequin.obj"
STRANGER = 1_000_000  # seeds this far from the drawn body's are other bodies


@dataclass(frozen=True)
class Condition:
    """Recipe of one kind of synthetic sheets.

    Attributes:
        options: of the drawing.
        symmetric: the body is, too: nothing tells its left from its right.
        other_body: the mannequin is symmetric and of other proportions and arm angle: users have
            no model of their character.
    """

    options: SynthOptions
    symmetric: bool = False
    other_body: bool = False


CONDITIONS: dict[str, Condition] = {
    "clean": Condition(CLEAN),
    "drawn": Condition(DRAWN),
    "near": Condition(replace(CLEAN, distance_heights=2.5)),
    "other body": Condition(DRAWN, other_body=True),
    "plain": Condition(replace(DRAWN, elevation_deg=5), symmetric=True),
}


@dataclass(frozen=True, eq=False)
class CalibCase:
    """A sheet with its truth.

    Attributes:
        name: of the sheet.
        group: condition.
        views: drawings.
        mesh: what calibration gets: the mannequin.
        rotations: true camera_from_world, (views, 3, 3).
        drawn: the body that was drawn, its first vertices those of the mannequin, one by one;
            None: not known.
    """

    name: str
    group: str
    views: tuple[View, ...]
    mesh: Mesh
    rotations: Float[np.ndarray, "views 3 3"]
    drawn: Mesh | None = None


@dataclass(frozen=True, eq=False)
class TrainCase:
    """Posed training pictures and held-out ones.

    Attributes:
        name: of the character.
        group: condition.
        train: the drawings.
        test: held-out views, for the figures alone.
    """

    name: str
    group: str
    train: Scene
    test: Scene


def calib_cases(folder: Path | None, seed: int, count: int, only: str = "") -> Iterator[CalibCase]:
    """Yield the folder's cases, or `count` synthetic sheets per condition.

    Args:
        folder: case folders; None for synthetic ones.
        seed: of the first synthetic sheet; the others' follow.
        count: synthetic sheets per condition.
        only: leave out cases whose name does not contain this.

    Raises:
        BundleError: the folder holds no case, or a sheet splits into a wrong number of views.
    """
    if folder is None:
        for group, condition in CONDITIONS.items():
            for i in range(count):
                if only in f"{group} {i}":
                    yield _synthetic_calib(f"{group} {i}", group, condition, seed + i)
        return
    for case in (place for place in case_folders(folder, "gt.json") if only in place.name):
        truth = read_json(case / "gt.json")
        views = split_picture(load_rgba(case / "sheet.png")).views
        poses = [frames.opencv_pose_from_opengl(np.array(m)) for m in truth["world_from_camera"]]
        if len(views) != len(poses):
            raise BundleError(f"{case}: split into {len(views)} views, {len(poses)} were drawn")
        rotations = np.stack([pose[:3, :3].T for pose in poses])
        yield CalibCase(case.name, _group(case), views, load_mesh(case / MANNEQUIN_FILE), rotations)


def train_cases(
    folder: Path | None, seed: int, count: int, *, half: bool = False, px: int = 150
) -> Iterator[TrainCase]:
    """Yield the folder's training cases, or `count` synthetic ones.

    Args:
        folder: case folders; None for synthetic ones.
        seed: first seed of the synthetic ones.
        count: of the synthetic ones.
        half: reduce a folder's pictures to half their size.
        px: size of synthetic pictures.

    Raises:
        BundleError: the folder holds no case.
    """
    if folder is None:
        for i in range(count):
            body = random_body(seed + i)
            drawn = SynthOptions(cell_px=px, outline_px=0, elevation_deg=8)
            held_out = replace(drawn, views=16)
            made, true = (make_turnaround(body, options, seed + i) for options in (drawn, held_out))
            test = scene_of(true, true.palette)
            odd = replace(test, frames=test.frames[1::2])  # between the training views
            yield TrainCase(f"body {seed + i}", "clean", scene_of(made, made.palette), odd)
        return
    for case in case_folders(folder, "views/transforms.json"):
        train, test = read_scene(case / "views"), read_scene(case / "test")
        if half:
            train, test = halved(train), halved(test)
        yield TrainCase(case.name, _group(case), train, test)


def halved(scene: Scene) -> Scene:
    """Return the scene at half size: area average of premultiplied colour."""
    halves = []
    for frame in scene.frames:
        height, width = (n // 2 * 2 for n in frame.rgba.shape[:2])
        rgba = frame.rgba[:height, :width].astype(np.float64)
        rgba[..., :3] *= rgba[..., 3:] / 255
        small = rgba.reshape(height // 2, 2, width // 2, 2, 4).mean(axis=(1, 3))
        small[..., :3] *= 255 / np.maximum(small[..., 3:], 1e-6)
        camera = frame.camera.moved((0, 0), (width, height)).resized(0.5)
        picture = np.clip(small + 0.5, 0, 255).astype(np.uint8)
        halves.append(Frame(frame.name, camera, picture))
    return Scene(tuple(halves), scene.palette, scene.name)


def scene_of(made: Turnaround, palette: np.ndarray | None = None) -> Scene:
    """Return the drawings of a turnaround with their true cameras."""
    frames = zip(made.views, made.cameras, strict=True)
    drawn = tuple(Frame(view.name, camera, view.rgba) for view, camera in frames)
    return Scene(drawn, palette, made.mesh.name)


def _synthetic_calib(name: str, group: str, condition: Condition, seed: int) -> CalibCase:
    body = random_body(seed, symmetric=condition.symmetric)
    made = make_turnaround(body, condition.options, seed)
    views = split_picture(made.sheet).views
    rotations = np.stack([camera.rotation for camera in made.cameras])
    if len(views) != len(rotations):
        raise BundleError(f"synthetic {name}: split into {len(views)} views")
    other = random_body(seed + STRANGER, symmetric=True) if condition.other_body else body
    return CalibCase(name, group, views, other, rotations, body)


def case_folders(folder: Path, needed: str) -> list[Path]:
    """Return the case folders that hold a file.

    Raises:
        BundleError: there is none.
    """
    found = sorted(path.parent for path in folder.glob(f"*/{needed.split('/')[0]}"))
    found = [case for case in found if (case / needed).is_file()]
    if not found:
        raise BundleError(f"{folder}: holds no case (a folder with {needed}); give another --cases")
    return found


def _group(case: Path) -> str:
    return case.name.rsplit("-", 1)[-1]
