"""What the verdict rests on against how new views look: counts, a table, a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lab.bench.records.drawing import draw_scatter
from lab.bench.records.record import aligned
from lab.bench.verdict.measure import Judged
from toonset.nerf.score.verdict import MOST_OFF, OK

FINE, BAD = 0.014, 0.017  # worst held-out view: a person is content below, unhappy above
FEWEST = 3  # sheets of which a rank correlation is said
HEAD = ("sheet", "off, %", "look, %", "worst look, %", "verdict")


def rank_correlation(sheets: Sequence[Judged]) -> float:
    """Return Spearman's, of what the verdict rests on and the worst held-out view's look."""
    from scipy.stats import rankdata

    values = np.array([(sheet.off, sheet.worst_look) for sheet in sheets if sheet.off])
    if len(values) < FEWEST or not np.ptp(values, axis=0).all():  # all alike: there is no order
        return float("nan")
    ranks = np.asarray(rankdata(values, axis=0))
    return float(np.corrcoef(ranks, rowvar=False)[0, 1])


def table(sheets: Sequence[Judged]) -> str:
    """Return a row per sheet, from the best to the worst look, and how often verdicts are right.

    Sheets between FINE and BAD count as neither.
    """
    ordered = sorted(sheets, key=lambda sheet: sheet.worst_look)
    looks = [(100 * s.off, 100 * float(np.mean(s.look)), 100 * s.worst_look) for s in ordered]
    rows = [
        (sheet.name, *(f"{value:.2f}" for value in own), sheet.verdict)
        for sheet, own in zip(ordered, looks, strict=True)
    ]
    bad = [sheet for sheet in sheets if sheet.worst_look > BAD]
    fine = [sheet for sheet in sheets if sheet.worst_look < FINE]
    missed, alarms = sum(s.verdict == OK for s in bad), sum(s.verdict != OK for s in fine)
    return "\n".join(
        [
            *aligned([HEAD, *rows], words=1),
            f"{len(sheets)} sheets, rank correlation {rank_correlation(sheets):.2f}",
            f"{len(bad)} look bad (worst view over {100 * BAD:.1f} %), {missed} missed",
            f"{len(fine)} look fine (below {100 * FINE:.1f} %), {alarms} false alarms",
        ]
    )


def draw_curve(groups: Mapping[str, Sequence[Judged]]) -> bytes:
    """Return a PNG: a point per sheet, what its verdict rests on against its worst view."""
    points = {
        name: [(100 * sheet.off, 100 * sheet.worst_look) for sheet in sheets]
        for name, sheets in groups.items()
    }
    axis = (
        "the worst drawing, as the others predict it: off by % of the height",
        "FLIP of the worst held-out view,\nas of a move by % of the height",
    )
    return draw_scatter(points, axis, (100 * MOST_OFF, "ok | weak"), (100 * FINE, 100 * BAD))
