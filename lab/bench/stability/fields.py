"""Trying trainings and looks: how held-out views look, and what `toonset train` says of the run.

Of a training what people are shown is looked at, the drawn look or the field's colours: FLIP of
the worst view, as of a move by percent of the height (see `bench.verdict.measure`). That drawings
were bent or cameras turned is no alarm: whether it was enough, the verdict says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lab.bench.look.cases import DRAWN, LookCase, drawn_case
from lab.bench.look.measure import FIELD, LookResult, bench_look
from lab.bench.records.record import DEFAULT
from lab.bench.stability.scenes import DrawnScene, either, misturned
from lab.bench.stability.trials import UNJUDGED, Drawer, Kind, Trial, Tried
from lab.bench.verdict.measure import judge, needed_flip
from toonset.dataset.images.picture import encode_png
from toonset.nerf.options import TrainOptions
from toonset.nerf.score.evaluation_picture import tile_of
from toonset.nerf.score.verdict import OK
from toonset.view import over_white

STEPS: int | None = None  # of the optimiser: what users get
SHEET = replace(DRAWN, cell_px=150, outline_px=1.25)  # of the pages about look


def try_training(draw: Drawer, seed: int) -> Tried:
    """Return how a training did, and its held-out views under the truth."""
    scene: DrawnScene = draw()
    options = TrainOptions(steps=STEPS, seed=seed)
    judged, picture = judge("", scene.train, scene.test, options, scene.where)
    words = "; ".join(judged.reasons)
    return (Trial(seed, 100 * judged.worst_look, judged.verdict, words),), picture


def try_look(draw: Drawer, seed: int) -> Tried:
    """Return the drawn look's FLIP in percent of the field's, and the view where it is worst."""
    case: LookCase = draw()
    drawn, field = bench_look([case], seed, (DEFAULT, FIELD))
    needed_flip()  # or it says what is missing
    own, other = (one.figures["flip"] or 0.0 for one in (drawn, field))
    words = f"FLIP {own:.4f}, of the field {other:.4f}"
    truths = [over_white(frame.rgba) for frame in case.test.frames]
    errors = [_errors(one, truths) for one in (drawn, field)]
    worst = int((errors[0] - errors[1]).argmax())
    shown = [truths[worst], *(over_white(one.pictures[worst]) for one in (drawn, field))]
    return (Trial(seed, 100 * own / max(other, 1e-9), UNJUDGED, words),), _in_a_row(shown)


def look_case(seed: int, **changes: Any) -> LookCase:
    """Return a sheet of a page about look: eight outlined drawings with changes of the options."""
    return drawn_case(seed, replace(SHEET, **changes))[0]


def look_of_turned(degrees: float, seed: int) -> LookCase:
    """Return such a sheet whose cameras are off by some degrees of yaw, half to either side."""
    case = look_case(seed)
    turned = either("turns", case.train, seed, lambda frame, side: misturned(frame, side * degrees))
    return replace(case, train=turned)


def _errors(one: LookResult, truths: Sequence[np.ndarray]) -> np.ndarray:
    pairs = zip(one.pictures, truths, strict=True)
    return np.array([((over_white(picture) - truth) ** 2).mean() for picture, truth in pairs])


def _in_a_row(pictures: Sequence[np.ndarray]) -> bytes:
    return encode_png(np.concatenate([tile_of(picture) for picture in pictures], axis=1))


TRAINING = Kind(
    *("training", "trainings", "look lost", "% of the height", 0.8, 1.1, 100.0),
    *((OK,), try_training),
    rule="A training is fine if its worst held-out view looks as if moved by less than 0.8 % of "
    "the height more than with the same body's clean scene (FLIP over that of a move by a pixel), "
    "and has failed beyond 1.1 %; it is announced if train refused or called the run weak.",
    pictures="held-out views of the worst training of a step: as they should be, and below as they "
    "were rendered.",
    relative=True,
)
LOOK = Kind(
    *("look", "sheets", "FLIP of the drawn layer", "% of the field's", 95.0, 100.0, 1000.0),
    *((UNJUDGED,), try_look),
    rule="The drawn layer has failed where its FLIP over all held-out views is above the field's, "
    "and is fine where it is at least 5 % below; it gives no verdict of itself.",
    pictures="the held-out view of a step where the drawn layer is worst beside the field: as it "
    "should be, from the drawings, from the field.",
)
