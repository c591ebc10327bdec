"""Game sprites as turnarounds: a few pixels, drawn by others, from nominal directions.

A folder holds one folder per character: `info.json` with `yaw_deg` of every view, and `view_0.png`
and so on with transparent ground. Rendered sprites name their `mesh`, a path relative to the
folder's parent, and their yaws are exact. Drawn ones have no mesh: the default mannequin stands in,
and only the 45 degree bin is asked for.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from bench.calib.figures import Recorder, angle_between, seconds_record
from bench.calib.measure import named_directions, own_cache
from bench.records.record import Record
from toonset.calib.find_cameras import find_cameras
from toonset.calib.known import Known
from toonset.calib.outline.occluding_contour import prepare_surface
from toonset.calib.search.template_cache import load_bank
from toonset.dataset.images.picture import load_rgba
from toonset.dataset.mannequin.make import default_mannequin
from toonset.dataset.mesh.load import load_mesh
from toonset.dataset.silhouettes.line_width import contour_width_px
from toonset.errors import BundleError
from toonset.json_file import read_json
from toonset.mesh import Mesh
from toonset.view import View

OWN_MESH, MANNEQUIN = "rendered sprites, own mesh", "drawn sprites, default mannequin"
SHADOW_BELOW = 200  # alpha of a cast shadow, where the sheet's description speaks of one
EXACT, BIN = math.radians(3.0), math.radians(22.5)


@dataclass(frozen=True, eq=False)
class SpriteCase:
    """A character's sprites with the yaws in radians that they stand for."""

    name: str
    group: str
    views: tuple[View, ...]
    mesh: Mesh
    yaws: tuple[float, ...]


@dataclass(frozen=True)
class MeasuredSprites:
    """A character's name, its views' yaw errors (radians) and verdicts, and the seconds taken."""

    case: str
    yaw_errors: tuple[float, ...]
    verdicts: tuple[str, ...]
    seconds: float


def sprite_cases(folder: Path, only: str = "") -> Iterator[SpriteCase]:
    """Yield the characters of a folder whose name contains `only`.

    Raises:
        BundleError: there is none, or an info.json does not say its yaws.
    """
    places = [
        path.parent for path in sorted(folder.glob("*/info.json")) if only in path.parent.name
    ]
    if not places:
        asked = f" whose name contains {only!r}" if only else ""
        raise BundleError(
            f"{folder}: no folder with info.json and view_0.png{asked}; give another --sprites"
        )
    for place in places:
        info = read_json(place / "info.json")
        yaws = _yaws(info, place / "info.json")
        shadow = SHADOW_BELOW if "shadow" in str(info.get("alpha")) else 0
        views = tuple(_view(place / f"view_{i}.png", i, shadow) for i in range(len(yaws)))
        own = info.get("mesh")
        mesh = load_mesh(folder.parent / str(own)) if own else default_mannequin().mesh
        yield SpriteCase(place.name, OWN_MESH if own else MANNEQUIN, views, mesh, yaws)


def bench_sprites(
    cases: Iterable[SpriteCase], seed: int, progress: Callable[[str], None] = lambda text: None
) -> list[Record]:
    """Return records of yaw errors, verdicts and seconds, with nothing known and with labels."""
    found: dict[tuple[str, str], list[MeasuredSprites]] = {}
    for case in cases:
        with own_cache():
            load_bank(prepare_surface(case.mesh))  # fills the cache
            for method in ("default", "labels"):
                progress(f"{case.name}: {method}")
                known = Known(labels=named_directions(case.yaws)) if method == "labels" else None
                found.setdefault((case.group, method), []).append(_calibrated(case, known))
    return [
        record
        for (group, method), sheets in found.items()
        for record in _records(sheets, Recorder(method, group, seed))
    ]


def _calibrated(case: SpriteCase, known: Known | None) -> MeasuredSprites:
    start = time.perf_counter()
    result = find_cameras(case.views, case.mesh, known=known)
    seconds = time.perf_counter() - start
    errors = tuple(
        abs(angle_between(view.camera.angles[0], yaw))
        for view, yaw in zip(result.views, case.yaws, strict=True)
    )
    return MeasuredSprites(case.name, errors, tuple(view.verdict for view in result.views), seconds)


def _records(sheets: list[MeasuredSprites], recorder: Recorder) -> list[Record]:
    errors = [error for sheet in sheets for error in sheet.yaw_errors]
    verdicts = [verdict for sheet in sheets for verdict in sheet.verdicts]
    silent = [e > BIN and v == "ok" for e, v in zip(errors, verdicts, strict=True)]
    medians = {s.case: math.degrees(float(np.median(s.yaw_errors))) for s in sheets}
    exact = [
        recorder.samples("yaw error", [math.degrees(e) for e in errors], by_case=medians),
        *recorder.share("within 3 deg", [e < EXACT for e in errors]),
    ]
    return [
        *(exact if recorder.group == OWN_MESH else []),
        *recorder.share("right 45 deg bin", [e < BIN for e in errors]),
        recorder.total("wrong but ok", silent),
        *recorder.verdicts(verdicts),
        seconds_record([(sheet.case, sheet.seconds) for sheet in sheets], recorder),
    ]


def _yaws(info: Any, path: Path) -> tuple[float, ...]:
    try:
        yaws = tuple(math.radians(float(yaw)) for yaw in info["yaw_deg"])
    except (TypeError, KeyError, ValueError):
        yaws = ()
    if not np.isfinite(yaws).all() or not yaws:
        raise BundleError(f"{path}: no list yaw_deg of numbers; one per view is needed, in degrees")
    return yaws


def _view(path: Path, number: int, shadow_below: int) -> View:
    rgba = load_rgba(path)
    rgba = np.where(rgba[..., 3:] < shadow_below, np.uint8(0), rgba)
    height, width = rgba.shape[:2]
    return View(rgba, (0, 0, width, height), _line_width(rgba), f"{number:03d}.png")


def _line_width(rgba: UInt8[np.ndarray, "height width 4"]) -> float:
    return contour_width_px(rgba) if (rgba[..., 3] >= 128).any() else 0.0  # View refuses it
