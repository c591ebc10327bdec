"""Results of steps as the trials of pages: views by error, trainings by what they lost.

A calibrated view is fine within 5 degrees of the truth and has failed beyond 15. A training has
failed where the worst held-out view looks as if moved by 1.1 % of the height more than that of the
same body's clean scene; below 0.8 % it is fine. The drawn look has failed where its FLIP is above
the field's, and is fine where it is 5 % below. A palette has failed that lacks a colour, labels
where a tenth of the pixels has another paint than the drawing's, or none; paints where their F1 is
below 0.75.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from bench.atlas.figures import Kind, Trial, TriedPage, TriedStep
from bench.atlas.labels import LabelPage
from bench.atlas.look import LookPage
from bench.atlas.palette import CLOSE, LISTED, PalettePage
from bench.atlas.palette import WARNED as PALETTE_WARNED
from bench.atlas.run import AnyPage, Result, TriedStepResult, all_pages
from bench.atlas.training import CRASHED, REFUSED, REPAIRED, SILENT, TrainPage, Tried
from bench.atlas.training import WARNED as TRAIN_WARNED
from bench.charts.chart import COLORS
from bench.stability.steps import SheetResult, StepResult
from bench.stability.table import SOLVED_DEG, WRONG_DEG
from toonset.nerf.score.verdict import WEAK

BLUE, VERMILION, GREEN, PINK, ORANGE, SKY, BLACK, GREY = COLORS
LOST_FINE, LOST_FAILED = 0.8, 1.1  # % of the height; a person is unhappy from there on
LOOK_FINE, LOOK_FAILED = 95.0, 100.0  # % of the field's FLIP
NONE_MISSED = 0.1  # %
LABELS_FINE, LABELS_FAILED = 5.0, 10.0  # % of the pixels; a person sees patches from there on
F1_FINE, F1_FAILED = 10.0, 25.0  # % short of 100: of six paints one too many, two too many
HUNDRED = 100.0
CALIBRATION = Kind(
    *("calibration", "views", "rotation error", "degrees", SOLVED_DEG, WRONG_DEG),
    {"ok": GREEN, "weak": ORANGE, "ambiguous": SKY, "failed": VERMILION, "crashed": BLACK},
    logarithmic=True,
)
TRAINING = Kind(
    *("training", "trainings", "look lost", "% of the height", LOST_FINE, LOST_FAILED),
    {
        SILENT: GREEN,
        REPAIRED: SKY,
        TRAIN_WARNED: PINK,
        WEAK: ORANGE,
        REFUSED: VERMILION,
        CRASHED: BLACK,
    },
    informs=(REPAIRED,),
)
LOOK = Kind(
    *("look", "sheets", "FLIP of the drawn layer", "% of the field's", LOOK_FINE, LOOK_FAILED),
    {SILENT: GREEN, REFUSED: VERMILION, CRASHED: BLACK},
)
PALETTE = Kind(
    *("palette", "palettes", "colours missed", "%", NONE_MISSED, NONE_MISSED),
    {SILENT: GREEN, CLOSE: ORANGE, LISTED: SKY, PALETTE_WARNED: VERMILION, REFUSED: BLACK},
)

LABELS = Kind(
    *("labels", "sheets", "pixels labelled wrong", "%", LABELS_FINE, LABELS_FAILED),
    {SILENT: GREEN, PALETTE_WARNED: VERMILION, REFUSED: BLACK},
)

PAINTS = Kind(*("paints", "sheets", "F1 short of 1", "%", F1_FINE, F1_FAILED), LABELS.voices)


def tried_pages(results: Sequence[Result]) -> list[TriedPage]:
    """Return the pages of which there are results, steps as listed.

    A page about training without its clean step has nothing to compare with, and is left out.
    """
    found = []
    for page in all_pages():
        own = [result for result in results if _page_of(result) == page.name]
        steps = _steps(page, own)
        if steps:
            found.append(TriedPage(page, _kind(page), steps))
    return found


def _page_of(result: Result) -> str:
    return result.sweep if isinstance(result, StepResult) else result.page


def _kind(page: AnyPage) -> Kind:
    if isinstance(page, TrainPage):
        return TRAINING
    if isinstance(page, LookPage):
        return LOOK
    if isinstance(page, LabelPage):
        return LABELS if page.counted == "labels" else PAINTS
    return PALETTE if isinstance(page, PalettePage) else CALIBRATION


def _steps(page: AnyPage, results: Sequence[Result]) -> tuple[TriedStep, ...]:
    sheets = [result for result in results if isinstance(result, StepResult)]
    if sheets:
        return tuple(TriedStep(result.step, _views(result.sheets)) for result in sheets)
    tried = [result for result in results if isinstance(result, TriedStepResult)]
    best = dict.fromkeys((one.seed for result in tried for one in result.tried), HUNDRED)
    if isinstance(page, TrainPage):
        clean = [result for result in tried if result.step == str(page.reference)]
        best = {one.seed: one.figure for result in clean for one in result.tried}
    if not best:
        return ()
    return tuple(
        TriedStep(result.step, tuple(_lost(one, best[one.seed]) for one in result.tried))
        for result in tried
    )


def _views(sheets: Sequence[SheetResult]) -> tuple[Trial, ...]:
    return tuple(
        Trial(number, math.degrees(view.raw), view.verdict, words)
        for number, sheet in enumerate(sheets)
        for view, words in zip(
            sheet.views, sheet.reasons or (sheet.note,) * len(sheet.views), strict=True
        )
    )


def _lost(one: Tried, best: float) -> Trial:
    return Trial(one.seed, best - one.figure, one.voice, one.words)
