"""Judge how torn the views between drawings are: one sum of what eyes mind.

    torn = OFF off + APART apart + BORDERS max(0, ln b) + OUTLINE |ln o|

off: the worst drawing, as the others predict it (`left_out`); of the views between drawings, means:
apart, how far the two drawings beside a view paint it apart; b, o, how much its borders of paint
and its outline turn, over those of these drawings. The sum is in shares of the figure's height: the
FLIP of such views is about that of the true picture moved by as much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from toonset.camera import Camera
from toonset.nerf.kernels.threads import side_by_side
from toonset.nerf.render.baked import Baked
from toonset.nerf.render.turntable import between_drawings
from toonset.nerf.render.views import render
from toonset.nerf.score.between import Between, BetweenView

VIEWS, TALL = 6, 240.0  # between drawings; px of the figure in them: 1.5 CPU s a run
# Weights and the bound: docs/decisions.md; `python -m bench.verdict --cases FOLDER` fits them anew
OFF, APART, BORDERS, OUTLINE = 0.26, 0.2, 0.020, 0.008
MOST_TORN = 0.008
MUCH = 0.05  # of a view's pixels that no drawing shows


@dataclass(frozen=True)
class Torn:
    """What eyes mind on the views of a run between its drawings.

    Attributes:
        off: the worst drawing as the others predict it, share of the height.
        views: between drawings.
    """

    off: float
    views: tuple[BetweenView, ...]

    @property
    def terms(self) -> tuple[float, float, float, float]:
        """Return off, apart, borders and outline, each without its weight."""
        rows = [(view.apart, _borders(view), _outline(view)) for view in self.views]
        apart, borders, outline = np.mean(rows, axis=0).tolist() if rows else (0.0, 0.0, 0.0)
        return self.off, apart, borders, outline

    @property
    def sum(self) -> float:
        """Return the weighted sum of the terms, share of the figure's height."""
        return float(np.dot(self.terms, (OFF, APART, BORDERS, OUTLINE)))

    @property
    def worst(self) -> BetweenView:
        """Return the view with the largest part of the sum."""
        return max(self.views, key=_part)


def torn_views(baked: Baked, off: float) -> Torn:
    """Return what eyes mind on some views between the drawings of a field that has some.

    Args:
        baked: the field.
        off: the worst drawing as the others predict it.
    """
    drawings = baked.trained.drawings
    assert drawings is not None
    judge = Between(drawings, TALL)
    assert judge.drawn  # made here: two threads must not make them twice
    cameras = between_drawings(baked.trained, VIEWS)
    small = [camera.resized(TALL / (drawings.height * camera.scale)) for camera in cameras]

    def one(camera: Camera) -> BetweenView:
        return judge.judged(render(baked, camera))

    views = side_by_side([partial(one, camera) for camera in small])
    return Torn(off, tuple(views))


def why_torn(found: Torn) -> str:
    """Return what eyes mind most on a run's views, where, and what helps, in plain English."""
    worst = found.worst
    at = round(math.degrees(worst.yaw) % 360)
    sides = sorted({round(math.degrees(yaw) % 360) for yaw in worst.beside})
    between = " and ".join(map(str, sides))
    place = f"between the drawings at {between} deg" if len(sides) > 1 else f"at {at} deg"
    said = f"{place} new views are torn: {'; '.join(_seen(worst))}"
    if len(sides) > 1:
        return f"{said}; add a drawing at about {at} deg, or draw both more alike"
    return f"{said}; add a drawing at about {at} deg"


def _seen(view: BetweenView) -> list[str]:
    """Return what is wrong with a view, the heaviest first."""
    borders, outline = (
        view.borders / _some(view.own_borders),
        view.outline / _some(view.own_outline),
    )
    found = [
        (APART * view.apart, f"these paint it {100 * view.apart:.1f} % of the height apart"),
        (
            BORDERS * _borders(view),
            f"borders of colours are ragged, {borders:.1f} times as winding as in the drawings",
        ),
        (
            OUTLINE * _outline(view),
            f"the outline is {'ragged' if outline > 1 else 'too smooth'}, {outline:.1f} times as "
            "winding as in the drawings",
        ),
    ]
    said = [text for weight, text in sorted(found, reverse=True) if weight >= MOST_TORN / 8]
    missing = view.features - view.whole
    if missing:
        said.append(f"{missing} of {view.features} small features are torn or missing")
    if view.guessed >= MUCH:
        said.append(f"no drawing shows {100 * view.guessed:.0f} % of it")
    return said or [found[0][1]]


def _part(view: BetweenView) -> float:
    return APART * view.apart + BORDERS * _borders(view) + OUTLINE * _outline(view)


def _borders(view: BetweenView) -> float:
    return max(0.0, math.log(_some(view.borders) / _some(view.own_borders)))


def _outline(view: BetweenView) -> float:
    return abs(math.log(_some(view.outline) / _some(view.own_outline)))


def _some(turns: float) -> float:
    """Return turns, at least those of a disc: a blank picture has none."""
    return max(turns, 1.0)
