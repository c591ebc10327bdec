"""Build the page of a run, or of a bundle that is not trained yet."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from PIL import Image
from skimage.measure import marching_cubes

from toonset.camera import Camera
from toonset.dataset.bundle.bundle import CALIBRATION, Bundle, read_bundle
from toonset.dataset.bundle.calibration_file import read_calibration
from toonset.dataset.bundle.calibration_schema import ViewRecord
from toonset.dataset.bundle.read_scene import read_palette_of
from toonset.dataset.bundle.transforms_read import member
from toonset.dataset.silhouettes.mask import alpha_of, has_figure
from toonset.errors import BundleError
from toonset.json_file import read_json
from toonset.mesh import Mesh
from toonset.nerf.fields.trained_field import TrainedField
from toonset.nerf.hull.hull import LEVEL, carve
from toonset.nerf.render.layers import default_layer
from toonset.nerf.render.turn_angles import ring_of, turn_angles
from toonset.nerf.render.turntable import FILL, turntable
from toonset.nerf.render.views import render
from toonset.nerf.run.folder import CONFIG, read_field
from toonset.nerf.viewer.page import page_html
from toonset.nerf.viewer.scene import (
    Blob,
    camera_record,
    drawings_record,
    field_record,
    plain_drawings_record,
)
from toonset.palette.names import name_of
from toonset.palette.palette import Palette

FRAMES, FRAME_PX, QUALITY = 16, 280, 80  # of a turn: its pictures stand where the page cannot draw
LAYERS = ("drawn", "rgb", "palette", "normal", "depth", "labels")
HULL_VOXELS = 72  # along the longest side of a bundle's hull
METRICS = "metrics.json"


def view_html(folder: Path) -> str:
    """Return the page of a run folder, or of a bundle.

    A bundle that holds a run shows that; one that is not trained yet shows its drawings, its
    cameras and its mannequin, or the hull of its drawings.

    Raises:
        ToonsetError: a file is missing or damaged, or the run's field has no planes.
    """
    own_run = folder / "run"
    if (folder / CONFIG).is_file():
        return _run_html(folder)
    if (own_run / CONFIG).is_file():
        return _run_html(own_run)
    return _bundle_html(read_bundle(folder))


def _run_html(run: Path) -> str:
    trained = read_field(run)
    beside = run.resolve().parent
    in_bundle = (beside / CALIBRATION).is_file()
    palette = read_palette_of(beside) if in_bundle else None
    title = beside.name if in_bundle else run.resolve().name
    drawings = trained.drawings
    cameras = [] if drawings is None else [view.camera for view in drawings.views]
    metrics = run / METRICS
    verdict = read_json(metrics).get("verdict") if metrics.is_file() else None
    about = {
        "verdict": verdict and {"state": verdict["verdict"], "reasons": verdict["reasons"]},
        "palette": _paints(trained.palette, palette),
        "views": _views(cameras, _calibrated(beside, len(cameras))),
    }
    scene, blob = run_scene(trained, title, about)
    return page_html(scene, blob, turn_pictures(trained))


def run_scene(
    trained: TrainedField, title: str, about: dict[str, Any]
) -> tuple[dict[str, Any], bytes]:
    """Return a run's numbers, and its arrays deflated.

    Args:
        trained: the run's field.
        title: of the page.
        about: further entries: verdict, palette, views.

    Raises:
        BundleError: its field has no planes.
    """
    blob = Blob()
    turn = turntable(trained, FRAMES, size=FRAME_PX)
    drawings = trained.drawings
    pen = None if drawings is None else drawings.pen
    missing = set() if drawings is not None else {"drawn"}
    missing |= set() if trained.palette is not None else {"palette", "labels"}
    layers = [layer for layer in LAYERS if layer not in missing]
    layers.sort(key=lambda layer: layer != default_layer(trained))
    scene = {
        "schema": "toonset-view/1",
        "title": title,
        "layers": layers,
        "figure": {
            "target": turn[0].target.tolist(),
            "reach": FILL * FRAME_PX / 2 / turn[0].scale,
            "fill": FILL,
            "k": turn[0].k,
            "turn": [list(camera.angles) for camera in turn],
        },
        "pen": pen and {"rgb": list(pen.rgb), "width_px": pen.width_px},
        **about,
        "field": field_record(trained, blob),
        "drawings": None if drawings is None else drawings_record(drawings, blob),
    }
    return scene, blob.deflated()


def turn_pictures(trained: TrainedField) -> list[bytes]:
    """Return WebP pictures of a whole turn in the run's own look."""
    layer = default_layer(trained)
    cameras = turntable(trained, FRAMES, size=FRAME_PX)
    return [_webp(render(trained, camera).picture(layer)) for camera in cameras]


def _bundle_html(bundle: Bundle) -> str:
    frames = [frame for frame in bundle.scene.frames if has_figure(frame)]
    if not frames:
        raise BundleError(f"{bundle.folder}: no picture shows a figure; there is nothing to view")
    cameras = [frame.camera for frame in frames]
    pictures = [frame.rgba for frame in frames]
    mesh = bundle.mannequin or _hull_mesh(cameras, [alpha_of(frame) for frame in frames])
    blob = Blob()
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    middle = (low + high) / 2
    scene = {
        "schema": "toonset-view/1",
        "title": bundle.folder.resolve().name,
        "layers": ["mannequin"],
        "figure": {
            "target": middle.tolist(),
            "reach": float(np.linalg.norm(mesh.vertices - middle, axis=1).max()),
            "fill": FILL,
            "k": float(np.median([camera.k for camera in cameras])),
            "turn": turn_angles(ring_of(cameras), 1).tolist(),
        },
        "pen": None,
        "verdict": None,
        "palette": [],
        "views": _views(cameras, _calibrated(bundle.folder, len(cameras))),
        "field": None,
        "drawings": plain_drawings_record(cameras, pictures, mesh, blob),
    }
    return page_html(scene, blob.deflated(), [_webp(pictures[0])])


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


def _paints(
    colors: UInt8[np.ndarray, "colors 3"] | None, palette: Palette | None
) -> list[dict[str, Any]]:
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


def _calibrated(folder: Path, count: int) -> list[ViewRecord | None]:
    """Return what calibration said of every drawing, None where it does not tell."""
    file = member(folder, CALIBRATION)
    views = read_calibration(file).views if file else []
    return list(views) if len(views) == count else [None] * count


def _views(
    cameras: Sequence[Camera], calibrated: Sequence[ViewRecord | None]
) -> list[dict[str, Any]]:
    found = []
    for number, (camera, said) in enumerate(zip(cameras, calibrated, strict=True)):
        yaw, elevation, _ = (math.degrees(angle) for angle in camera.angles)
        sigma = said and {"yaw": said.sigma.yaw_deg, "elevation": said.sigma.elevation_deg}
        found.append(
            {
                "name": f"{number:03d}.png" if said is None else said.name,
                "verdict": "" if said is None else said.verdict,
                "reason": "" if said is None else said.reason,
                "yaw": yaw,
                "elevation": elevation,
                "sigma": sigma,
                "camera": camera_record(camera),
                "drawing": number,
            }
        )
    return found


def _webp(picture: UInt8[np.ndarray, "height width 4"]) -> bytes:
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "WEBP", quality=QUALITY, method=6)
    return file.getvalue()
