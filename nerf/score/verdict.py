"""Judge a run: ok, or weak and why.

A run is weak where a drawing and what the others make of its side are plainly apart (`left_out`),
or where no drawing shows a side (`view_coverage`). The bound is where people would be unhappy with
new views (docs/decisions.md, `python -m lab.bench.verdict`). What eyes see on views between
drawings is reported, but decides nothing: it does not tell how new views of an unknown character
look.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from toonset.dataset.bundle.scene import Scene
from toonset.nerf.options import STEPS_ON_SECTIONS, STEPS_ON_SHAPE, USUAL_STEPS
from toonset.nerf.prepare.view_coverage import guesses
from toonset.nerf.render.baked import Baked
from toonset.nerf.score.between import BetweenView, views_between
from toonset.nerf.score.left_out import LeftOut, left_out
from toonset.nerf.train.result import Training
from toonset.palette.pixels.labels import UNLABELLED

OK, WEAK = "ok", "weak"
MOST_OFF = 0.021  # of the figure's height, of the worst drawing (docs/decisions.md)
BLENDS = 0.3  # of the figures' pixels; clean drawings of 80 px have 0.2, larger ones fewer
STANDS_OUT = 1.4  # times the median drawing's: one that is wrong by itself
SHOWN = (  # of a view between drawings, in a report
    *("outline", "own_outline", "borders", "own_borders", "apart"),
    *("fragments", "features", "whole", "mirrored", "guessed"),
)
NOTHING = "the field shows no figure: look at preview.png, and train longer or check the cameras"


@dataclass(frozen=True)
class Verdict:
    """Verdict of a run.

    Attributes:
        verdict: OK or WEAK.
        reasons: why it is weak and what helps, a line each, for people.
        views: what it rests on: every drawing as the others predict it.
        between: what eyes see on views between them, which decides nothing.
    """

    verdict: str
    reasons: tuple[str, ...]
    views: tuple[LeftOut, ...]
    between: tuple[BetweenView, ...] = ()

    @property
    def off(self) -> float:
        """Return how far the worst drawing is off, in shares of the figure's height; 0 of none."""
        return max((view.off for view in self.views), default=0.0)

    def to_json(self) -> dict[str, Any]:
        """Return the verdict for a report, shares as they are."""
        views = {view.name: round(view.off, 6) for view in self.views}
        return {
            "verdict": self.verdict,
            "reasons": list(self.reasons),
            "off_height": {"worst": round(self.off, 6), "bound": MOST_OFF, "views": views},
            "between": [_between(view) for view in self.between],
        }


def verdict_of(training: Training, drawn: Scene, baked: Baked | None = None) -> Verdict:
    """Judge a run.

    Args:
        training: the run, its field with the drawings laid over it.
        drawn: the drawings as they were drawn.
        baked: its field; None: made here.
    """
    reasons = guesses(training.seen)
    if training.result.drawings is None:
        return Verdict(WEAK, (*reasons, NOTHING), ())
    baked = baked or Baked.of(training.result)
    views = left_out(baked, training.seen, drawn)
    found = judged(views, training)
    reasons += [found] if found else []
    between = views_between(baked)
    return Verdict(WEAK if reasons else OK, tuple(reasons), tuple(views), between)


def judged(views: Sequence[LeftOut], training: Training) -> str:
    """Return why a run is weak, by drawings and what others make of them; "" of an ok one."""
    worst = max(views, key=lambda view: view.off, default=None)
    if worst is None or worst.off <= MOST_OFF:
        return ""
    stands_out = worst.off > STANDS_OUT * float(np.median([view.off for view in views]))
    return f"{_measured(worst)}; {_remedy(training, worst, stands_out=stands_out)}"


def _between(view: BetweenView) -> dict[str, Any]:
    """Return what eyes see on a view between drawings for a report."""
    shown = {name: round(getattr(view, name), 6) for name in SHOWN}
    return {"yaw_deg": round(math.degrees(view.yaw) % 360, 2), **shown}


def _measured(worst: LeftOut) -> str:
    """Return which drawing is off, from which, by how much and where."""
    paint = f", in the {worst.paint}" if worst.paint else ""
    return (
        f"{worst.name} is not what its side looks like by {' and '.join(worst.beside)}: off by "
        f"{100 * worst.off:.1f} % of the height, where up to {100 * MOST_OFF:.1f} % is ok; "
        f"{100 * worst.differs:.0f} % of the figure differs, most at the {worst.place}{paint}"
    )


def _remedy(training: Training, worst: LeftOut, *, stands_out: bool) -> str:
    """Return advice, by the most likely cause."""
    done = len(training.history)
    usual = STEPS_ON_SHAPE if training.prepared.shape else USUAL_STEPS
    usual = usual if training.prepared.compared else STEPS_ON_SECTIONS
    ended = training.stopped in ("steps", "budget")
    if ended and done < usual // 2:
        return f"these were {done} steps: train longer"
    if stands_out:
        return (
            f"the others fit together better: look at {worst.name}'s camera, pose, side and "
            "colours, mend it or leave it out"
        )
    blends = blended(training.prepared.scene)
    if blends > BLENDS:
        return (
            f"{100 * blends:.0f} % of the figures' pixels are blends of two colours, as on lines "
            "and where pictures are small, blurred or saved as JPEG: larger, cleaner ones help"
        )
    return "the others are off, too: `toonset consistency` shows how far each of them is, and where"


def blended(scene: Scene) -> float:
    """Return the share of the figures' pixels without a palette colour; 0 without labels."""
    figure, blends = 0, 0
    for frame in scene.frames:
        if frame.labels is not None:
            inside = frame.rgba[..., 3] > 0
            figure += int(inside.sum())
            blends += int((inside & (frame.labels == UNLABELLED)).sum())
    return blends / max(figure, 1)
