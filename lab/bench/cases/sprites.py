"""Game sprites as turnarounds: a few pixels, drawn by others, from nominal directions.

A folder holds one folder per character: `info.json` with `yaw_deg` of every view, and `view_0.png`
and so on with transparent ground. Rendered sprites name their `mesh`, a path relative to the
folder's parent, and their yaws are exact. Drawn ones have no mesh: the default mannequin stands in
where it explains more than no body does, and only the 45 degree bin is asked for. All are also
calibrated without a body, as laid out and laid out anew: the usual layout alone shall not win.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from lab.bench.calib.figures import angle_between, seconds_record, verdict_records
from lab.bench.calib.measure import named_directions, own_cache
from lab.bench.records.record import Column, Record, Recorder, methods_table
from toonset.calib.find_cameras import find_cameras
from toonset.calib.known import Known
from toonset.calib.outline.occluding_contour import prepare_surface
from toonset.calib.result import SEVERITY, Calibration
from toonset.calib.search.template_cache import load_bank
from toonset.calib.without_body.find import calibrate_without_body
from toonset.calib.without_body.rival import with_body_or_without
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
NO_BODY = "no body"  # as laid out, and then: where it starts instead, and which way round
ANEW = {"": (False, 1), ", rolled": (True, 1), ", reversed": (False, -1), ", both": (True, -1)}
COLUMNS = (
    Column("yaw error", "yaw, deg", "{:.2f}", "median"),
    Column("yaw error", "p95", "{:.2f}", "p95"),
    Column("within 3 deg", "<3 deg %", "{:.0f}", scale=100),
    Column("right 45 deg bin", "right %", "{:.0f}", scale=100),
    Column("wrong but ok", "wrong ok", "{:.0f}"),
    *(Column(name, name[:5], "{:.0f}", scale=100) for name in SEVERITY),
    Column("ok sheets", "sheets ok %", "{:.0f}", scale=100),
    Column("seconds", "s", "{:.2f}"),
)
LEGEND = """
right: yaw less than 22.5 deg off. wrong ok: in a wrong bin with verdict ok. Verdicts in %. Seconds
per sheet."""
Measured = tuple[str, list[float], Sequence[str], float]  # name, yaw errors, verdicts, seconds
EXACT, BIN = math.radians(3.0), math.radians(22.5)


@dataclass(frozen=True, eq=False)
class SpriteCase:
    """A character's sprites with the yaws in radians that they stand for."""

    name: str
    group: str
    views: tuple[View, ...]
    mesh: Mesh
    yaws: tuple[float, ...]


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
    """Return records of yaw errors, verdicts and seconds: with the mesh, without, with labels."""
    found: dict[tuple[str, str], list[Measured]] = {}
    for case in cases:
        with own_cache():
            load_bank(prepare_surface(case.mesh))  # fills the cache
            for method, (laid, calibrated) in _methods(case).items():
                progress(f"{case.name}: {method}")
                began = time.perf_counter()
                views = calibrated(laid).views
                pairs = zip(views, laid.yaws, strict=True)
                errors = [abs(angle_between(v.camera.angles[0], yaw)) for v, yaw in pairs]
                measured = (case.name, errors, [v.verdict for v in views])
                one = (*measured, time.perf_counter() - began)
                found.setdefault((case.group, method), []).append(one)
    return [
        record
        for (group, method), sheets in found.items()
        for record in _records(sheets, Recorder(method, group, seed))
    ]


def sprites_table(records: Sequence[Record]) -> str:
    """Return the table of `python -m lab.bench calib --sprites`."""
    return f"{methods_table(records, COLUMNS)}\n{LEGEND}"


def laid_out_anew(case: SpriteCase, *, rolled: bool, way: int) -> SpriteCase:
    """Return the case with its views in another order: begun elsewhere (rolled), then reversed."""
    order = np.roll(np.arange(len(case.yaws)), -(len(case.yaws) // 2 - 1) if rolled else 0)[::way]
    return replace(
        case, views=tuple(case.views[i] for i in order), yaws=tuple(case.yaws[i] for i in order)
    )


def _methods(case: SpriteCase) -> dict[str, tuple[SpriteCase, Callable[[SpriteCase], Calibration]]]:
    """Return how a case is laid out and calibrated, by name."""
    labels = Known(labels=named_directions(case.yaws))
    front = min(range(len(case.yaws)), key=lambda i: abs(angle_between(case.yaws[i], 0.0)))
    hint = Known(labels=tuple((0.0,) if i == front else () for i in range(len(case.yaws))))

    def alone(known: Known) -> Callable[[SpriteCase], Calibration]:
        return lambda laid: calibrate_without_body(laid.views, known)

    anew = {
        f"{NO_BODY}{name}": (laid_out_anew(case, rolled=rolled, way=way), alone(Known()))
        for name, (rolled, way) in ANEW.items()
    }
    return {
        "default": (case, lambda laid: _with_mesh(laid, Known())),
        "labels": (case, lambda laid: _with_mesh(laid, labels)),
        **anew,
        f"{NO_BODY}, front": (case, alone(hint)),
        f"{NO_BODY}, labels": (case, alone(labels)),
    }


def _with_mesh(case: SpriteCase, known: Known) -> Calibration:
    """Return what a person gets who gives the mesh, or, of a case without one, none."""
    found = find_cameras(case.views, case.mesh, known=known)
    if case.group == OWN_MESH:
        return found
    better, _ = with_body_or_without(
        case.views, found, known, given=False, tell=lambda step, share: None
    )
    return better


def _records(sheets: list[Measured], recorder: Recorder) -> list[Record]:
    errors = [error for _, own, _, _ in sheets for error in own]
    verdicts = [verdict for _, _, own, _ in sheets for verdict in own]
    silent = [e > BIN and v == "ok" for e, v in zip(errors, verdicts, strict=True)]
    medians = {name: math.degrees(float(np.median(own))) for name, own, _, _ in sheets}
    exact = [
        recorder.samples("yaw error", [math.degrees(e) for e in errors], by_case=medians),
        *recorder.share("within 3 deg", [e < EXACT for e in errors]),
    ]
    return [
        *(exact if recorder.group == OWN_MESH else []),
        *recorder.share("right 45 deg bin", [e < BIN for e in errors]),
        recorder.total("wrong but ok", silent),
        *verdict_records(verdicts, recorder),
        *recorder.share("ok sheets", [set(own) == {"ok"} for _, _, own, _ in sheets]),
        seconds_record([(name, seconds) for name, _, _, seconds in sheets], recorder),
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
