"""Measure one run: what eyes see on its views between drawings, and beside the truth if known."""

from __future__ import annotations

import time
from collections.abc import Sequence

import cv2
import numpy as np

from lab.bench.between.sheets import DRAWN_SIDE, Sheet
from toonset.camera import Camera
from toonset.dataset.bundle.scene import Frame
from toonset.dataset.silhouettes.mask import mask_of
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.turntable import between_drawings, turntable
from toonset.nerf.render.views import render
from toonset.nerf.score.appearance import dirt
from toonset.nerf.score.between import Between, BetweenView
from toonset.nerf.score.flip import FlipMap
from toonset.nerf.score.lines import line_f1
from toonset.nerf.score.metrics import silhouette_iou
from toonset.view import over_white

SMALL_PX, LARGE_PX = 300.0, 900.0  # of the figure, where roughness is measured
SIZES = (300.0, 600.0, 1200.0)  # of the figure, between which a view may not differ
TURN = 72  # views all round
VIEWS, FEW = 8, 4  # between drawings; where they cost more
SLOW_PX = 1000.0  # of the figure, where seconds are measured beside SMALL_PX
WHOLE = "a turn; one view at 300, 600, 1,200 px"
GROUP = ": "  # between the title of a table and a figure's name in it

Row = dict[str, float]


def of_height(camera: Camera, height: float, tall_px: float) -> Camera:
    """Return a camera at the size at which a figure of some height is so many pixels tall."""
    return camera.resized(tall_px / (height * camera.scale))


def measure(sheet: Sheet, flip: FlipMap, *, whole: bool) -> Row:
    """Return a sheet's figures, by name; those that are not known are missing.

    Args:
        sheet: the run.
        flip: LDR-FLIP.
        whole: the turn and all sizes, too; else the essentials.
    """
    baked = Baked.of(sheet.field)
    row: Row = {}
    row |= _beside_truth(sheet, baked, flip) if sheet.truth else {}
    row |= _between(sheet, baked, SMALL_PX, VIEWS if whole or not sheet.truth else FEW)
    row |= _between(sheet, baked, LARGE_PX, FEW if whole else 1)
    if whole:
        row |= _grouped(WHOLE, _turn(sheet, baked) | _sizes(sheet, baked, flip))
    return row


def _beside_truth(sheet: Sheet, baked: Baked, flip: FlipMap) -> Row:
    """Return what needs the truth: means over the drawn and the other side."""
    drawings = sheet.field.drawings
    assert drawings is not None
    tall_px = drawings.height * sheet.truth[0].camera.scale
    judge = Between(drawings, tall_px)
    rows = []
    for frame in sheet.truth:
        view = render(baked, frame.camera)
        shown = view.picture("drawn")
        found, true = judge.judged(view), judge.judged(view, frame.rgba)
        rows.append(
            against(shown, frame, flip)
            | {
                "outline": found.outline / true.outline,
                "borders": found.borders / true.borders,
                "crumbs": found.fragments,
                "true crumbs": true.fragments,
                "eyes": _whole(found),
                "true eyes": _whole(true),
            }
        )
    result: Row = {}
    for side, part in (("drawn", rows[:DRAWN_SIDE]), ("other", rows[DRAWN_SIDE:])):
        result |= _grouped(f"{side} side, beside the truth", _means(part))
    return result


def against(shown: np.ndarray, frame: Frame, flip: FlipMap) -> Row:
    """Return FLIP, whole and over the figures, IoU, dirt, ink F1 of a picture beside its truth."""
    seen, true = over_white(shown), over_white(frame.rgba)
    error, figure = flip(true, seen), mask_of(shown) | mask_of(frame.rgba)
    values = {
        "FLIP": float(error.mean()),
        "FLIP figure": float(error[figure].mean()),
        "IoU": silhouette_iou(shown, frame.rgba),
        "dirt": dirt(seen, true, mask_of(frame.rgba)),
        "ink F1": line_f1(shown, frame.rgba),
    }
    return {name: float("nan") if value is None else value for name, value in values.items()}


def _between(sheet: Sheet, baked: Baked, tall_px: float, count: int) -> Row:
    """Return what eyes see on views between drawings, of figures of some height."""
    drawings = sheet.field.drawings
    assert drawings is not None
    judge, rows = Between(drawings, tall_px), []
    assert judge.drawn  # made here: it is no cost of the view
    for camera in between_drawings(sheet.field, VIEWS)[VIEWS // count - 1 :: VIEWS // count]:
        began = time.process_time()
        view = render(baked, of_height(camera, drawings.height, tall_px))
        assert len(view.drawn.rgb)
        spent = time.process_time() - began
        found = judge.judged(view)
        rows.append(
            {
                "outline": found.outline / max(found.own_outline, 1e-9),
                "borders": found.borders / max(found.own_borders, 1e-9),
                "crumbs": found.fragments,
                "eyes": _whole(found),
                "mirrored": found.mirrored,
                "guessed": found.guessed,
                "CPU s": spent,
            }
        )
    worst = max(row["borders"] for row in rows)
    title = f"between drawings, figures of {tall_px:.0f} px, beside the drawings"
    return _grouped(title, _means(rows) | {"worst borders": worst})


def _whole(view: BetweenView) -> float:
    """Return the share of the features of both drawings beside a view that it shows."""
    return view.whole / view.features if view.features else float("nan")


def _grouped(title: str, row: Row) -> Row:
    """Return figures of one table."""
    return {f"{title}{GROUP}{name}": value for name, value in row.items()}


def _turn(sheet: Sheet, baked: Baked) -> Row:
    """Return how steady a turn is: second over first difference of its pictures, mean and worst."""
    drawings = sheet.field.drawings
    assert drawings is not None
    pictures = []
    for camera in turntable(sheet.field, TURN):
        small = of_height(camera, drawings.height, SMALL_PX)
        pictures.append(over_white(render(baked, small).picture("drawn")))
    turn = np.stack([*pictures, *pictures[:2]])
    first, second = (np.abs(np.diff(turn, n=n, axis=0)).mean(axis=(1, 2, 3)) for n in (1, 2))
    share = float((np.stack(pictures) < 1).any(axis=-1).mean())
    return {
        "second difference": 100 * float(second.mean()) / share,
        "worst jump": float(first.max() / np.median(first)),
    }


def _sizes(sheet: Sheet, baked: Baked, flip: FlipMap) -> Row:
    """Return FLIP between views of several sizes, scaled down to the smallest, over the figure."""
    drawings = sheet.field.drawings
    assert drawings is not None
    camera = between_drawings(sheet.field, VIEWS)[0]
    shown = []
    for tall_px in SIZES:
        own = of_height(camera, drawings.height, tall_px)
        shown.append(over_white(render(baked, own).picture("drawn")).astype(np.float32))
    size = shown[0].shape[1::-1]
    small = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in shown]
    figure = (np.stack(small) < 1).any(axis=(0, 3))
    apart = [float(flip(small[0], other)[figure].mean()) for other in small[1:]]
    return {"FLIP of sizes": max(apart)} | _seconds(sheet, baked, camera)


def _seconds(sheet: Sheet, baked: Baked, camera: Camera) -> Row:
    drawings = sheet.field.drawings
    assert drawings is not None
    began = time.process_time()
    assert len(render(baked, of_height(camera, drawings.height, SLOW_PX)).drawn.rgb)
    return {"CPU s 1000": time.process_time() - began}


def _means(rows: Sequence[Row]) -> Row:
    """Return the mean of every figure over the rows that know it; nan where none does."""
    found = {}
    for name in rows[0] if rows else ():
        values = [row[name] for row in rows if np.isfinite(row[name])]
        found[name] = float(np.mean(values)) if values else float("nan")
    return found
