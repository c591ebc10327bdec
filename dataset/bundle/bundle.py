"""Read a bundle: what calibration hands to palette, training and other programs.

    transforms.json    cameras (see `toonset.dataset.bundle.transforms`)
    images/000.png     RGBA crops, straight alpha
    calibration.json   native cameras, uncertainty, verdicts (`calibration_schema`)
    overlay.png        every drawing with the mannequin's outline over it
    mannequin.obj      the mannequin as it was fitted, in the cameras' world; none without a body
    palette.json       the colours, once `toonset palette` has found them; .gpl .ase .hex .png are
                       copies for other programs
    labels/000.png     indexed PNG per picture: which colour a pixel is, 255 = none
    coverage/000.png   RGB per picture: two paints of every pixel, and how far the first covers it
    tones/000.png      8-bit grey per picture of a shaded sheet: 0 = in light, 1 = in shadow
    contours/000.png   8-bit grey per picture: how much of a pixel is drawn line
    run/               a trained field
    corrections.json   what a person corrected with `toonset edit`; edit.html is its page

The folder appears whole or not at all. It holds no path and no name of a machine and, but for the
seconds in run/, no time: on one kind of processor the same input, options, seed and versions give
the same bytes, wherever it is made or moved to.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from toonset.camera import Camera
from toonset.dataset.bundle.calibration_file import calibration_content, read_calibration
from toonset.dataset.bundle.calibration_schema import CalibrationFile
from toonset.dataset.bundle.read_scene import MANNEQUIN, read_scene
from toonset.dataset.bundle.scene import Scene
from toonset.dataset.bundle.transforms import transforms_dict
from toonset.dataset.bundle.transforms_read import member, place_in, transforms_file
from toonset.dataset.images.picture import encode_png
from toonset.dataset.mesh.load import load_mesh, save_obj
from toonset.errors import BundleError, ToonsetError
from toonset.mesh import Mesh, Up
from toonset.notebook import MOST_ROWS, Cell, picture_bytes, table
from toonset.palette.formats.json import read_palette_json
from toonset.palette.palette import Palette
from toonset.view import View, small_png
from toonset.write import new_folder, write_bytes, write_json

THUMBNAIL_PX = 96  # of a view in a notebook
OVERLAY, CALIBRATION = "overlay.png", "calibration.json"
LABELS, TONES, COVERAGE, CONTOURS = "labels", "tones", "coverage", "contours"
IMAGES = "images"
WRITTEN = (
    *("transforms.json", "images", "calibration.json", "overlay.png", "mannequin.obj"),
    # what later verbs put beside
    *("palette.*", LABELS, TONES, COVERAGE, CONTOURS, "run", "run.unfinished", "edit.html"),
)


def mannequin_of(folder: Path, given: Path | None = None, *, up: Up = "y") -> Mesh | None:
    """Return the mesh of a file that was given, else the folder's own, else None.

    `up` is the axis that points up in the file that was given.

    Raises:
        BundleError: the folder's own is a link out of it.
        MeshError: the file is not a mesh.
    """
    if given is not None:
        return load_mesh(given, up=up)
    file = member(folder, MANNEQUIN)
    return None if file is None else load_mesh(file)


@dataclass(frozen=True, eq=False)
class Bundle:
    """A bundle on disk.

    Attributes:
        folder: where it lies.
        scene: its posed drawings, with labels where it has a palette: what `train` takes.
        palette: its colours; None before they are found.
        mannequin: as it was fitted; None in bundles without one.
    """

    folder: Path
    scene: Scene
    palette: Palette | None
    mannequin: Mesh | None

    def _repr_html_(self) -> str:
        """Return a table of the views for a notebook, with verdicts where it has any."""
        frames, found = self.scene.frames, _calibration_of(self.folder)
        judged = {view.name: view for view in found.views} if found else {}
        size = picture_bytes(len(frames))
        rows: list[Sequence[Cell]] = []
        for frame in frames[:MOST_ROWS]:
            yaw, elevation, _ = (math.degrees(angle) for angle in frame.camera.angles)
            view, thumbnail = judged.get(frame.name), small_png(frame.rgba, THUMBNAIL_PX, size)
            told = (view.verdict, view.reason) if view else ("", "")
            angles = (f"{yaw % 360:.1f}°", f"{elevation:.1f}°")
            rows.append([thumbnail, frame.name, *angles, *told])
        rows += [[frame.name] for frame in frames[MOST_ROWS:]]
        said = f"; {found.verdict}: {found.reason}" if found else ""
        colors = f", {len(self.palette.colors)} colours" if self.palette else ""
        caption = f"{self.folder}: {len(frames)} views{colors}{said}"
        return table(caption, ("", "view", "yaw", "elevation", "verdict", "reason"), rows)


def _calibration_of(folder: Path) -> CalibrationFile | None:
    """Return the calibration; None if the bundle has none."""
    try:
        return read_calibration(place_in(transforms_file(folder).parent, CALIBRATION))
    except ToonsetError:
        return None


def failed_cameras(folder: Path) -> str:
    """Return a sentence about the drawings whose calibration failed; empty if there are none."""
    found = _calibration_of(folder)
    failed = [view for view in found.views if view.verdict == "failed"] if found else []
    if not found or not failed:
        return ""
    return (
        f"no camera fits {len(failed)} of {len(found.views)} drawings: views between them are "
        "guesses; name the drawings' directions (`calibrate --views`) or use `toonset edit`"
    )


def read_bundle(folder: str | Path) -> Bundle:
    """Return a bundle, or any folder with a transforms.json and RGBA pictures.

    Raises:
        ToonsetError: a file is missing or broken, or pictures do not belong to their cameras.
    """
    folder = Path(folder)
    scene = read_scene(folder)
    file = member(transforms_file(folder).parent, "palette.json")
    palette = None if file is None else read_palette_json(file)
    return Bundle(folder, scene, palette, scene.mannequin)


@contextmanager
def bundle_folder(
    folder: Path,
    views: Sequence[View],
    cameras: Sequence[Camera],
    mesh: Mesh | None,
    size: tuple[float, float],
    calibration: Mapping[str, Any],
    overlay: UInt8[np.ndarray, "height width channels"],
    *,
    force: bool = False,
) -> Iterator[Path]:
    """Write a bundle; yield its temporary folder, to add to it before it appears.

    Args:
        folder: where; replaced as a whole with `force`.
        views: the drawings in sheet order.
        cameras: one per view, in pixels of its crop.
        mesh: the mannequin as it was fitted; None: cameras were found without one.
        size: height and radius of the body, world units: they set the far pinholes and their error
            bound.
        calibration: the report of `toonset.calib.verdict.report`.
        overlay: the picture for people.
        force: replace an existing bundle.

    Raises:
        OutputError: the folder exists, or cannot be written.
    """
    if len(views) != len(cameras):
        raise BundleError(f"{len(views)} views but {len(cameras)} cameras; one each is needed")
    content = calibration_content(calibration, views)
    named = [(f"{IMAGES}/{v.name}", camera) for v, camera in zip(views, cameras, strict=True)]
    with new_folder(folder, force=force) as temporary:
        for view in views:
            write_bytes(temporary / IMAGES / view.name, encode_png(view.rgba))
        write_json(temporary / "transforms.json", transforms_dict(named, *size))
        write_json(temporary / CALIBRATION, content)
        write_bytes(temporary / OVERLAY, encode_png(overlay))
        if mesh is not None:
            write_bytes(temporary / MANNEQUIN, save_obj(mesh))
        yield temporary
