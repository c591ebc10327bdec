"""What the verdict rests on against how new views look: counts, a table, a picture."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.charts.chart import COLORS
from bench.records.record import aligned
from bench.verdict.measure import Judged
from toonset.nerf.score.verdict import MOST_OFF, OK

FINE, BAD = 0.014, 0.017  # worst held-out view: a person is content below, unhappy above
FEWEST = 3  # sheets of which a rank correlation is said
HEAD = ("sheet", "off, %", "look, %", "worst look, %", "FLIP", "verdict")


@dataclass(frozen=True)
class Count:
    """Sheets counted; those between FINE and BAD are in none of the four.

    Attributes:
        n: all.
        bad: that a person would be unhappy with.
        missed: of these, those that were called ok.
        fine: that a person is content with.
        alarms: of these, those that were called weak.
    """

    n: int
    bad: int
    missed: int
    fine: int
    alarms: int


def count(sheets: Sequence[Judged]) -> Count:
    """Return how often verdicts are right."""
    bad = [sheet for sheet in sheets if sheet.worst_look > BAD]
    fine = [sheet for sheet in sheets if sheet.worst_look < FINE]
    missed = sum(sheet.verdict == OK for sheet in bad)
    return Count(len(sheets), len(bad), missed, len(fine), sum(s.verdict != OK for s in fine))


def rank_correlation(sheets: Sequence[Judged]) -> float:
    """Return Spearman's, of what the verdict rests on and the worst held-out view's look."""
    from scipy.stats import rankdata

    values = [(sheet.statistic, sheet.worst_look) for sheet in sheets if sheet.off]
    if len(values) < FEWEST:
        return float("nan")
    ranks = np.asarray(rankdata(np.array(values), axis=0))
    return float(np.corrcoef(ranks, rowvar=False)[0, 1])


def table(sheets: Sequence[Judged]) -> str:
    """Return a row per sheet, from the best to the worst look, and the counts."""
    rows = [
        (
            sheet.name,
            f"{100 * sheet.statistic:.2f}",
            f"{100 * float(np.mean(sheet.look)):.2f}",
            f"{100 * sheet.worst_look:.2f}",
            f"{float(np.mean(sheet.flip)):.4f}",
            sheet.verdict + (" (too few drawings)" if sheet.guesses else ""),
        )
        for sheet in sorted(sheets, key=lambda sheet: sheet.worst_look)
    ]
    found = count(sheets)
    return "\n".join(
        [
            *aligned([HEAD, *rows], words=1),
            f"{found.n} sheets, rank correlation {rank_correlation(sheets):.2f}",
            f"{found.bad} look bad (worst view over {100 * BAD:.1f} %), {found.missed} missed",
            f"{found.fine} look fine (below {100 * FINE:.1f} %), {found.alarms} false alarms",
        ]
    )


def draw_curve(groups: Mapping[str, Sequence[Judged]]) -> bytes:
    """Return a PNG: a point per sheet, hollow where it is called weak for too few drawings."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.4), dpi=100, layout="constrained")
    for color, (name, sheets) in zip(COLORS, groups.items(), strict=False):
        x = [100 * sheet.statistic for sheet in sheets]
        y = [100 * sheet.worst_look for sheet in sheets]
        faces = ["none" if sheet.guesses else color for sheet in sheets]
        axes.scatter(x, y, s=26, facecolors=faces, edgecolors=color, label=f"{name}: {len(x)}")
    axes.axvline(100 * MOST_OFF, color="black", lw=1, ls="--")
    axes.text(100 * MOST_OFF, 0.05, " weak", va="bottom", ha="left", fontsize=9)
    axes.text(100 * MOST_OFF, 0.05, "ok ", va="bottom", ha="right", fontsize=9)
    axes.axhspan(100 * FINE, 100 * BAD, color="#dddddd", zorder=0)
    axes.set(xlim=(0, None), ylim=(0, None))
    axes.set_xlabel("the worst drawing, as the others predict it: off by % of the height")
    axes.set_ylabel("FLIP of the worst held-out view,\nas of a move by % of the height")
    axes.legend(fontsize=8, frameon=False, loc="upper left")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    plt.close(figure)
    return buffer.getvalue()
