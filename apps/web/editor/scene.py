"""Collect what the page shows of a sheet and its bundle: see `page/types.js`."""

from __future__ import annotations

import io
import math
import re
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool
from PIL import Image

import toonset as ts
from toonset.dataset.bundle_files import (
    LABELS,
    PALETTE_JSON,
    ViewRecord,
    calibration_of,
    mannequin_of,
    member,
    palette_of,
    palette_title,
)
from toonset.dataset.split_folder.load import Sheet
from toonset.errors import PictureError
from toonset.html_page import base64_text, data_url, html_page, json_text
from toonset.nerf.surface.decimate import decimate
from toonset.palette.names import hex_of
from toonset.read import read_whole

FOLDER = Path(__file__).parent / "page"
STYLES = ("../../viewer/page/base.css", "style.css")
PALETTE = PALETTE_JSON
MOST_FACES = 6000  # that a page projects in every picture while it is dragged
MASK_PX = 192  # along the longer side of a drawing's mask: what the outline error is measured on
SHOWN = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg", b"GIF8": "image/gif"}


def page_of(scene: dict[str, Any] | None, corrections: dict[str, Any] | None, title: str) -> str:
    """Return the page: with its data as a file of its own; without, asking its server for it."""
    data = None if scene is None else {"scene": scene, "corrections": corrections}
    parts = {"data": json_text(data)}
    return html_page(FOLDER, title, parts, styles=STYLES, asks_server=data is None)


def scene_of(folder: Path, sheet: Sheet) -> dict[str, Any]:
    """Return what the page shows of a bundle, but for the sheet's picture.

    Args:
        folder: the bundle.
        sheet: as it was cut for that bundle.

    Raises:
        ToonsetError: a file of the bundle is missing or damaged.
    """
    found = calibration_of(folder)
    source = sheet.split.sources[0]
    ground = source.background
    mesh = mannequin_of(folder)
    return {
        "schema": "toonset-edit/1",
        "title": palette_title([source.name], folder),
        "sheet": {
            "name": source.name,
            "sha256": source.sha256,
            "size": list(source.size_wh),
            "background": None if ground is None else hex_of(ground),
            "notes": list(sheet.warnings),
        },
        "verdict": {"state": found.verdict, "reason": for_page(found.reason)},
        "views": [
            _view(folder, view, said) for view, said in zip(sheet.views, found.views, strict=True)
        ],
        **seen_on(sheet),
        "mannequin": None if mesh is None else _mannequin(mesh),
        "palette": _palette(palette_of(folder)),
    }


def for_page(reason: str) -> str:
    """Return a reason without the command line's options in brackets: the page has buttons."""
    return re.sub(r" \(--[^)]*\)", "", reason)


def seen_on(sheet: Sheet) -> dict[str, Any]:
    """Return the groups of figures that the splitter saw on a sheet, and what it left out."""
    source = sheet.split.sources[0]
    return {
        "groups": [
            {
                "rows": [list(map(list, row)) for row in one.rows],
                "why": one.why,
                "outfits": one.outfits,
            }
            for one in source.groups
        ],
        "leftOut": [{"box": list(one.box), "kind": one.kind} for one in source.left_out],
    }


def sheet_url(path: Path, sheet: Sheet) -> str:
    """Return the sheet's picture as an address of itself, in a form that browsers show.

    The file as it is, if the views' places in it are those of its pixels.
    """
    data = read_whole(path, "picture", PictureError)
    kind = next((kind for magic, kind in SHOWN.items() if data.startswith(magic)), None)
    picture = ts.load_picture(path)
    (cut,) = sheet.pictures
    if cut is not None and not np.array_equal(cut, picture):
        picture, kind = cut, None
    if kind is None:
        bgra = cv2.cvtColor(picture, cv2.COLOR_RGBA2BGRA)
        data, kind = cv2.imencode(".png", bgra)[1].tobytes(), "image/png"
    return data_url(data, kind)


def _view(folder: Path, view: ts.View, said: ViewRecord) -> dict[str, Any]:
    camera = said.camera.camera()
    labels = member(folder, f"{LABELS}/{said.name}")
    yaw, elevation, roll = (math.degrees(angle) for angle in camera.angles)
    return {
        "name": said.name,
        "box": list(view.figure_box),
        "crop": list(view.box),
        "caption": view.caption,
        "verdict": said.verdict,
        "reason": for_page(said.reason),
        "sigma": {"yaw": said.sigma.yaw_deg, "elevation": said.sigma.elevation_deg},
        "yaw": yaw,
        "elevation": elevation,
        "roll": roll,
        "camera": _camera(camera, view),
        "mask": data_url(_mask(view.mask), "image/png"),
        "labels": data_url(labels.read_bytes(), "image/png") if labels else None,
    }


def _camera(camera: ts.Camera, view: ts.View) -> dict[str, Any]:
    """Return a camera's numbers in pixels of the sheet: see `toonset.camera`."""
    center = camera.center + np.array(view.box[:2])
    return {
        "rotation": camera.rotation.reshape(-1).tolist(),
        "target": camera.target.tolist(),
        "scale": camera.scale,
        "center": center.tolist(),
        "size": list(camera.size_wh),
        "k": camera.k,
        "aspect": camera.pixel_aspect,
    }


def _mask(mask: Bool[np.ndarray, "height width"]) -> bytes:
    """Return which pixels a drawing covers, small."""
    height, width = mask.shape
    by = min(1.0, MASK_PX / max(height, width))
    size = (max(1, round(by * width)), max(1, round(by * height)))
    small = cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA)
    buffer = io.BytesIO()
    Image.fromarray(small).save(buffer, "PNG")
    return buffer.getvalue()


def _mannequin(mesh: ts.Mesh) -> dict[str, Any]:
    vertices, faces = _few_faces(mesh.vertices.tobytes(), mesh.faces.tobytes())
    low, high = mesh.bounds
    return {
        "vertices": base64_text(vertices),
        "faces": base64_text(faces),
        "middle": ((low + high) / 2).tolist(),
        "height": float(high[1] - low[1]),
    }


@lru_cache(maxsize=2)
def _few_faces(vertices: bytes, faces: bytes) -> tuple[bytes, bytes]:
    """Return a surface of few faces, as a page reads it; a second of work, so it is kept."""
    places = np.frombuffer(vertices, np.float64).reshape(-1, 3)
    corners = np.frombuffer(faces, np.int64).reshape(-1, 3)
    if len(corners) > MOST_FACES:
        one_label = np.zeros(len(corners), np.int64)
        places, corners, _ = decimate(places, corners, one_label, MOST_FACES)
    return places.astype("<f4").tobytes(), corners.astype("<u4").tobytes()


def _palette(found: ts.Palette | None) -> dict[str, Any]:
    if found is None:
        return {"colors": [], "dropped": []}
    return {
        key: [{"color": hex_of(one.rgb), "name": one.name, "share": one.share} for one in colors]
        for key, colors in (("colors", found.colors), ("dropped", found.dropped))
    }
