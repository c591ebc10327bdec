"""Draw a run, or a bundle that is not trained yet, from all round.

The door of this room: `views_of` a folder. What is in a record: `apps/web/viewer/page/types.js`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from skimage.measure import marching_cubes

from toonset.camera import Camera
from toonset.dataset.bundle.bundle import CALIBRATION, Bundle, failed_cameras, read_bundle
from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.dataset.bundle.calibration_schema import ViewRecord
from toonset.dataset.bundle.palette_files import palette_title
from toonset.dataset.bundle.read_scene import read_palette_of
from toonset.dataset.bundle.transforms_read import member
from toonset.dataset.silhouettes.mask import alpha_of, has_figure
from toonset.errors import BundleError
from toonset.json_file import read_json
from toonset.mesh import Mesh
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import LEVEL, carve
from toonset.nerf.kernels.threads import working_threads
from toonset.nerf.layered_views.layered import page_paints
from toonset.nerf.layered_views.lossy import webp
from toonset.nerf.layered_views.records import SMALL, camera_record, coding
from toonset.nerf.layered_views.ring import VIEWS, Ring, ring_through
from toonset.nerf.layered_views.sights import (
    body_picture,
    body_sights,
    figure_sights,
    layers_of,
    paints_and_pen,
)
from toonset.nerf.look.drawing import Original
from toonset.nerf.render.turntable import FILL, drawn_on_sheet, filled_box, framed
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import CONFIG, read_field
from toonset.palette.color_names import name_of
from toonset.palette.palette import Palette
from toonset.view import SHEET

FIGURE_PX = 400  # height of the figure, unless told otherwise
HULL_VOXELS = 72  # along the longest side of a bundle's hull
METRICS = "metrics.json"
TRIAL_PX = 1000  # of pictures that the figure is measured in

Record = dict[str, Any]
Picture = UInt8[np.ndarray, "height width 4"]


@dataclass(frozen=True, eq=False)
class SheetDrawings:
    """The drawings of a sheet.

    Attributes:
        cameras: of each.
        pictures: of each, straight alpha.
        calibrated: what calibration said of each, None where it does not tell.
    """

    cameras: list[Camera]
    pictures: list[Picture]
    calibrated: list[ViewRecord | None]

    @classmethod
    def of(cls, drawings: Sequence[Original], folder: Path) -> SheetDrawings:
        """Return drawings with what the calibration of a folder says of them."""
        file = member(folder, CALIBRATION)
        views: list[ViewRecord | None] = list(read_calibration(file).views) if file else []
        said = views if len(views) == len(drawings) else []
        said = said or [None for _ in drawings]
        return cls([d.camera for d in drawings], [d.rgba for d in drawings], said)


@dataclass(frozen=True, eq=False)
class Views:
    """A figure from all round.

    Attributes:
        record: numbers, and bytes for pictures and maps.
        poster: a WebP picture of the first view.
    """

    record: Record
    poster: bytes


def views_of(folder: Path, size: int | None = None, title: str = "") -> Views:
    """Return the views of a run folder, or of a bundle.

    A bundle that holds a run shows that; one that is not trained yet shows its drawings, its
    cameras and its mannequin, or the hull of its drawings.

    Args:
        folder: of the run or bundle.
        size: side of the views' pictures, px; None: the figure is FIGURE_PX high.
        title: of the figure; "": the sheet's name, or the folder's where the sheet is not known.

    Raises:
        ToonsetError: a file is missing or damaged.
    """
    run = run_of(folder)
    with working_threads():
        if run is not None:
            return _views_of_run(run, size, title)
        return _views_of_bundle(read_bundle(folder), size, title)


def run_of(folder: Path) -> Path | None:
    """Return a run folder: this one, or that of a bundle; None where there is none."""
    runs = (place for place in (folder, folder / "run") if (place / CONFIG).is_file())
    return next(runs, None)


def _views_of_run(run: Path, size: int | None, title: str) -> Views:
    trained = read_field(run)
    beside = run.resolve().parent
    in_bundle = (beside / CALIBRATION).is_file()
    palette = read_palette_of(beside) if in_bundle else None
    metrics = run / METRICS
    verdict = read_json(metrics).get("verdict") if metrics.is_file() else None
    failed = failed_cameras(beside) if in_bundle else ""
    state = verdict and {"state": verdict["verdict"], "reasons": verdict["reasons"]}
    about = {
        "title": title or _title(beside if in_bundle else run),
        "verdict": {"state": "failed", "reasons": [failed]} if failed else state,
        "palette": _paints(trained.palette, palette),
    }
    return views_of_field(trained, about, SheetDrawings.of(drawn_on_sheet(trained), beside), size)


def views_of_field(
    trained: TrainedField,
    about: Record,
    sheet: SheetDrawings,
    size: int | None = None,
    views: int = VIEWS,
) -> Views:
    """Return the views of a trained field.

    Args:
        trained: the field.
        about: title, verdict and palette.
        sheet: its drawings as they are on the sheet.
        size: see `views_of`.
        views: of a ring.
    """
    ring = ring_through(sheet.cameras, views)
    cameras = cameras_of(trained, ring, size)
    layers, drawings = layers_of(trained), trained.drawings
    scene = {
        **about,
        "layers": layers,
        "pen": drawings and drawings.pen and {"rgb": list(drawings.pen.rgb)},
        "paints": [] if drawings is None else page_paints(*paints_and_pen(drawings)).tolist(),
    }
    start = render(trained, cameras[ring.start])
    sights = figure_sights(trained, cameras, ring.layered, start)
    return _views(scene, ring, cameras, sights, sheet, start.picture(layers[0]))


def cameras_of(trained: TrainedField, ring: Ring, size: int | None = None) -> tuple[Camera, ...]:
    """Return the cameras of a figure's ring, as `toonset render --size` has them."""
    if size is None:
        low, high = filled_box(trained.hull)
        size = _side(float(high[1] - low[1]) * framed(trained, ring.angles, TRIAL_PX)[0].scale)
    return framed(trained, ring.angles, size)


def _title(folder: Path) -> str:
    """Return the name of a bundle's sheet; the folder's where it is not of one sheet."""
    file = member(folder, CALIBRATION)
    inputs = read_calibration(file).inputs if file else []
    return palette_title((one.name for one in inputs if one.role == SHEET), folder)


def _views_of_bundle(bundle: Bundle, size: int | None, title: str) -> Views:
    frames = [frame for frame in bundle.scene.frames if has_figure(frame)]
    if not frames:
        raise BundleError(f"{bundle.folder}: no picture shows a figure; there is nothing to view")
    sheet = SheetDrawings.of([Original(one.camera, one.rgba) for one in frames], bundle.folder)
    mesh = bundle.mannequin or _hull_mesh(sheet.cameras, [alpha_of(frame) for frame in frames])
    ring = ring_through(sheet.cameras)
    low, high = mesh.bounds
    middle = (low + high) / 2
    reach = float(np.linalg.norm(mesh.vertices - middle, axis=1).max())
    k = float(np.median([camera.k for camera in sheet.cameras]))
    side = size or _side(FILL * TRIAL_PX / 2 / reach * float(high[1] - low[1]))
    scale = FILL * side / 2 / reach
    cameras = [
        Camera.looking_at(middle, yaw, elevation, scale, (side, side), roll, k=k)
        for yaw, elevation, roll in ring.angles.tolist()
    ]
    scene: Record = {
        "title": title or _title(bundle.folder),
        "verdict": None,
        "palette": [],
        "paints": [],
        "layers": ["mannequin"],
        "pen": None,
    }
    poster = body_picture(mesh, cameras[ring.start])
    return _views(scene, ring, cameras, body_sights(mesh, cameras), sheet, poster)


def _side(trial_px: float) -> int:
    """Return the side of pictures in which a figure so high in trial ones is FIGURE_PX high."""
    return max(1, round(TRIAL_PX * FIGURE_PX / max(trial_px, 1.0)))


def _views(
    scene: Record,
    ring: Ring,
    cameras: Sequence[Camera],
    sights: Sequence[Record],
    sheet: SheetDrawings,
    poster: Picture,
) -> Views:
    first = cameras[0]
    whole = {
        "schema": "toonset-view/2",
        **scene,
        "coding": coding(),
        "figure": {
            "target": first.target.tolist(),
            "reach": FILL * first.size_wh[0] / 2 / first.scale,
            "fill": FILL,
            "k": first.k,
            "size": first.size_wh[0],
            "elevations": ring.elevations,
            "start": ring.start,
        },
        "sights": [
            {"angles": list(angles), "level": level, "layers": layers}
            for angles, level, layers in zip(ring.angles.tolist(), ring.level, sights, strict=True)
        ],
        "views": [
            {**_view(i, camera, said), "sight": own, "picture": webp(picture)}
            for i, (camera, said, own, picture) in enumerate(
                zip(sheet.cameras, sheet.calibrated, ring.own, sheet.pictures, strict=True)
            )
        ],
    }
    return Views(whole, webp(poster, **SMALL))


def _hull_mesh(cameras: Sequence[Camera], alphas: Sequence[np.ndarray]) -> Mesh:
    """Return the surface of what all drawings' outlines leave."""
    hull = carve(cameras, [torch.as_tensor(alpha) for alpha in alphas], HULL_VOXELS, 0)
    support = np.pad(hull.support.numpy(), 1)
    if support.max() < LEVEL:
        raise BundleError("the drawings' outlines leave no common shape; check the cameras")
    vertices, faces, _, _ = marching_cubes(support, LEVEL)
    return Mesh(
        hull.low + hull.voxel * (vertices - 0.5), faces[:, ::-1].astype(np.int64), name="hull"
    )


def _paints(colors: UInt8[np.ndarray, "colors 3"] | None, palette: Palette | None) -> list[Record]:
    """Return the colours of a run with the names and shares that a bundle gives them."""
    if colors is None:
        return []
    known = {} if palette is None else {color.rgb: color for color in palette.colors}
    found = []
    for red, green, blue in colors.tolist():
        color = known.get((red, green, blue))
        name = name_of((red, green, blue)) if color is None else color.name
        share = 0.0 if color is None else color.share
        found.append({"name": name, "rgb": [red, green, blue], "share": share})
    return found


def _view(number: int, camera: Camera, said: ViewRecord | None) -> Record:
    yaw, elevation, _ = (math.degrees(angle) for angle in camera.angles)
    sigma = said and {"yaw": said.sigma.yaw_deg, "elevation": said.sigma.elevation_deg}
    return {
        "name": f"{number:03d}.png" if said is None else said.name,
        "verdict": "" if said is None else said.verdict,
        "reason": "" if said is None else said.reason,
        "yaw": yaw,
        "elevation": elevation,
        "sigma": sigma,
        "camera": camera_record(camera),
    }
