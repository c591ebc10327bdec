"""Pages about the drawn look: FLIP of new views from the drawings, beside the field's own.

The base sheet has eight drawings of 150 px of a body with eyes, with outlines and 1 % of drawing
error, and cameras that are right; held-out views are drawn with the same lines and no error.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bench.atlas.training import CRASHED, REFUSED, Tried
from bench.charts.chart import DEFAULT
from bench.look.cases import DRAWN, LookCase, drawn_case
from bench.look.measure import LookResult, bench_look
from bench.look.plan import FIELD
from bench.stability.page import Page
from bench.stability.sheet import Step, stream
from toonset.camera import rotation_from_angles
from toonset.dataset.bundle.scene import Frame
from toonset.dataset.images.picture import encode_png
from toonset.errors import ToonsetError
from toonset.nerf.score.evaluation_picture import tile_of
from toonset.view import over_white

SHEET = replace(DRAWN, cell_px=150, outline_px=1.25)
UNJUDGED = ""  # the look gives no verdict


@dataclass(frozen=True)
class LookPage(Page):
    """A page about the drawn look.

    Attributes:
        draw: step and seed to a sheet.
    """

    draw: Callable[[Step, int], LookCase]


def numbered(step: Step, seed: int) -> LookCase:
    """Return a sheet of `step` drawings."""
    return drawn_case(seed, replace(SHEET, views=int(step)))[0]


def warped(step: Step, seed: int) -> LookCase:
    """Return a sheet with `step` percent of drawing error."""
    return drawn_case(seed, replace(SHEET, warp_percent=float(step)))[0]


def outlined(step: Step, seed: int) -> LookCase:
    """Return a sheet with lines of `step` px, its held-out views, too."""
    return drawn_case(seed, replace(SHEET, outline_px=float(step)))[0]


def misturned(step: Step, seed: int) -> LookCase:
    """Return a sheet whose cameras are off by `step` degrees of yaw, half to either side."""
    case = drawn_case(seed, SHEET)[0]
    sides = stream("turns", seed).permutation(np.resize([-1, 1], len(case.train.frames)))
    pairs = zip(case.train.frames, sides.tolist(), strict=True)
    frames = tuple(_turned(frame, side * math.radians(float(step))) for frame, side in pairs)
    return replace(case, train=replace(case.train, frames=frames))


def _turned(frame: Frame, error: float) -> Frame:
    yaw, elevation, roll = frame.camera.angles
    rotation = rotation_from_angles(yaw + error, elevation, roll)
    camera = replace(frame.camera, rotation=rotation)
    return replace(frame, camera=camera, yaw_sigma=abs(error)) if error else frame


def try_look(page: LookPage, step: Step, seed: int) -> tuple[Tried, bytes]:
    """Return by how many percent the drawn look's FLIP is below the field's, and a picture.

    It shows the view where the drawn look is worst beside the field: truth, drawn, field.
    """
    if step == page.base:
        return _base_tried(seed)
    return _tried(lambda: page.draw(step, seed), seed)


@cache
def _base_tried(seed: int) -> tuple[Tried, bytes]:
    return _tried(lambda: drawn_case(seed, SHEET)[0], seed)


def _tried(draw: Callable[[], LookCase], seed: int) -> tuple[Tried, bytes]:
    try:
        case = draw()
        drawn, field = bench_look([case], seed, (DEFAULT, FIELD))
    except ToonsetError as error:
        return Tried(seed, 0.0, REFUSED, str(error)), b""
    except Exception as error:
        return Tried(seed, 0.0, CRASHED, f"{type(error).__name__}: {error}"), b""
    found = {"flip": _flip(drawn), "flip_field": _flip(field)}
    words = f"FLIP {found['flip']:.4f}, of the field {found['flip_field']:.4f}"
    saved = 100 * (1 - found["flip"] / max(found["flip_field"], 1e-9))
    return Tried(seed, saved, UNJUDGED, words, found), _side_by_side(case, drawn, field)


def _flip(result: LookResult) -> float:
    value = result.figures["flip"]
    if value is None:
        raise ToonsetError("FLIP needs the package flip-evaluator; it is not installed")
    return value


def _side_by_side(case: LookCase, drawn: LookResult, field: LookResult) -> bytes:
    truths = [over_white(frame.rgba) for frame in case.test.frames]
    drawn_error, field_error = (
        np.array(
            [((over_white(p) - t) ** 2).mean() for p, t in zip(one.pictures, truths, strict=True)]
        )
        for one in (drawn, field)
    )
    worst = int((drawn_error - field_error).argmax())
    shown = (truths[worst], *(over_white(one.pictures[worst]) for one in (drawn, field)))
    return encode_png(np.concatenate([tile_of(picture) for picture in shown], axis=1))
