"""Lines between paints are closed where the artist always draws them, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from toonset.nerf.look.border_lines import Unlined, lined_pairs, missing_lines, missing_steps

SIZE, INK = 100, (10, 10, 10)
INSIDE = np.ones((SIZE, SIZE), bool)
PAINTS = np.array([(200, 60, 60), (60, 200, 60), (60, 60, 200)], np.uint8)
PEN = 3.0


def unlined_of(gap: slice = slice(0), ink: tuple[int, int, int] = INK) -> Unlined:
    """Return paint 0 above paint 1, a line between them but for a gap, 2 right of both without."""
    labels = np.zeros((SIZE, SIZE), np.uint8)
    labels[50:] = 1
    labels[:, 70:] = 2
    drawn = PAINTS[labels]
    drawn[49:52, :70] = ink
    drawn[49:52, gap] = PAINTS[labels][49:52, gap]
    return Unlined.of(drawn / np.float32(255), labels, INSIDE, (PEN, ink), float(SIZE))


def test_a_gap_in_a_line_between_paints_is_closed() -> None:
    pairs = lined_pairs([unlined_of()], PEN)
    assert pairs.tolist() == [1]  # of paints 0 and 1
    cover = missing_lines(unlined_of(slice(20, 40)), pairs, PEN)
    assert cover[47:53, 22:38].sum(axis=0) == pytest.approx(PEN, abs=0.5)
    assert cover[40:46].sum() + cover[55:].sum() == 0
    assert cover[:, :14].sum() + cover[:, 46:].sum() == 0


def test_whole_lines_are_left_alone() -> None:
    drawing = unlined_of()
    assert missing_lines(drawing, lined_pairs([drawing], PEN), PEN).sum() == 0


def test_what_is_lined_by_halves_stands_for_steps_in_depth() -> None:
    assert len(lined_pairs([unlined_of(slice(0, 35))], PEN)) == 0
    assert len(lined_pairs([unlined_of(slice(0, 35)), *[unlined_of()] * 12], PEN)) == 1


def test_without_a_pen_no_pair_is_lined() -> None:
    drawing = unlined_of()
    bare = Unlined.of(
        PAINTS[drawing.labels] / np.float32(255), drawing.labels, INSIDE, None, float(SIZE)
    )
    assert len(lined_pairs([bare], PEN)) == 0


def test_lines_of_any_colour_count() -> None:
    navy = (20, 20, 90)
    assert lined_pairs([unlined_of(ink=navy)], PEN).tolist() == [1]


def test_paint_goes_on_under_lines() -> None:
    labels = unlined_of().labels
    assert (labels[:48, :68] == 0).all()
    assert (labels[53:, :68] == 1).all()
    assert set(np.unique(labels[:, 30])) == {0, 1}


def hiding(step: float, line: slice = slice(0)) -> tuple[Unlined, np.ndarray]:
    """Return one paint, right of column 40 `step` heights behind, with a line in some rows."""
    labels = np.zeros((SIZE, SIZE), np.uint8)
    drawn = PAINTS[labels]
    drawn[line, 39:42] = INK
    depth = np.zeros((SIZE, SIZE))
    depth[:, 40:] = step
    return Unlined.of(drawn / np.float32(255), labels, INSIDE, (PEN, INK), float(SIZE)), depth


def test_a_part_before_another_of_its_own_paint_has_a_line() -> None:
    cover = missing_steps(*hiding(0.2), 1.0, PEN)
    assert cover[10:90].sum(axis=1) == pytest.approx(PEN, abs=0.8)
    assert cover[:, :35].sum() + cover[:, 45:].sum() == 0


def test_shallow_steps_and_lined_ones_have_none() -> None:
    assert missing_steps(*hiding(0.05), 1.0, PEN).sum() == 0
    assert missing_steps(*hiding(0.2, slice(None)), 1.0, PEN).sum() == 0


def test_a_line_along_a_part_of_a_step_goes_on() -> None:
    cover = missing_steps(*hiding(0.2, slice(0, 50)), 1.0, PEN)
    assert cover[55:90].max(axis=1).min() == pytest.approx(1)
    assert cover[:45].sum() == 0


def test_a_line_goes_on_where_no_drawing_shows_the_step() -> None:
    unlined, depth = hiding(0.2)
    unseen = np.zeros_like(INSIDE)
    unseen[46:54, 36:46] = True
    torn = replace(unlined, inside=~unseen, labels=np.where(unseen, 2, unlined.labels))
    assert missing_steps(torn, depth, 1.0, PEN)[47:53].sum() == 0
    cover = missing_steps(torn.extended(INSIDE), depth, 1.0, PEN)
    assert cover[10:90].sum(axis=1) == pytest.approx(PEN, abs=0.8)
