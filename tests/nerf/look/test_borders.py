"""Lines between paints are closed where the artist always draws them, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from toonset.nerf.look.borders import Unlined, lined_pairs, missing_lines, missing_steps, settled

SIZE, INK = 100, (10, 10, 10)
INSIDE = np.ones((SIZE, SIZE), bool)
PAINTS = np.array([(200, 60, 60), (60, 200, 60), (60, 60, 200)], np.uint8)
PEN = 3.0


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


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


def ragged(rng: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return paint 0 above paint 1, their border ragged by up to two pixels, and its labels."""
    steps = size // 2 + rng.integers(-2, 3, size)
    labels = (np.arange(size)[:, None] >= steps).astype(np.uint8)
    return PAINTS[labels] / np.float32(255), labels


def test_a_ragged_border_is_smooth_and_soft_by_a_pixel(rng: np.random.Generator) -> None:
    size = 400
    color, labels = ragged(rng, size)
    inside = np.ones((size, size), bool)
    joints = np.zeros_like(inside)
    joints[size // 2 - 3 : size // 2 + 3] = True
    shown, names = settled(color, labels, joints, inside, None, 400.0)
    heights = names.argmax(axis=0)[20:-20]
    assert np.abs(np.diff(heights)).mean() < np.abs(np.diff(labels.argmax(axis=0))).mean() / 4
    assert np.abs(heights - size // 2).max() <= 2
    between = np.abs(shown - color[0, 0]).max(axis=-1) * np.abs(shown - color[-1, 0]).max(axis=-1)
    assert 0.5 < (between[:, 20:-20] > 0.01).sum(axis=0).mean() < 3
    far = np.abs(np.arange(size) - size // 2) > 12
    np.testing.assert_array_equal(shown[far], color[far])
    np.testing.assert_array_equal(names[far], labels[far])


@pytest.mark.parametrize("figure_px", [300.0, 1000.0])
@pytest.mark.parametrize("width", [2, 4, 8])
def test_a_line_keeps_its_width_its_label_and_its_paints_texture_at_a_joint(
    width: int, figure_px: float
) -> None:
    size = 200
    labels = np.zeros((size, size), np.uint8)
    labels[:, 100:] = 1
    labels[:, 100 - width // 2 : 100 + width // 2] = 3
    color = np.concatenate([PAINTS, [INK]])[labels] / np.float32(255)
    grain = np.random.default_rng(0).normal(0, 0.01, (size, size, 1)).astype(np.float32)
    color = np.where(labels[..., None] < 3, color + grain, color)
    joints = np.zeros((size, size), bool)
    joints[100] = True
    pen = (float(width), INK)
    shown, names = settled(color, labels, joints, np.ones_like(joints), pen, figure_px)
    dark = (1 - shown.max(axis=-1) / color[0, 0].max()).clip(0.2, 1) - 0.2
    assert dark[100].sum() == pytest.approx(dark[20].sum(), abs=0.35)
    assert abs(int((names[100] == 3).sum()) - width) <= 1
    np.testing.assert_array_equal(shown[100, :80], color[100, :80])  # grain stays


def test_no_black_gets_into_tips_far_from_any_other_paint() -> None:
    color, labels = np.full((120, 120, 3), 0.9, np.float32), np.zeros((120, 120), np.uint8)
    inside = np.zeros((120, 120), bool)
    inside[40:80, 40:80] = inside[20:40, 60] = True  # a spike
    labels[40:80, 40:44], color[40:80, 40:44] = 1, (0.6, 0.3, 0.3)
    shown, _ = settled(color, labels, inside, inside, None, 1000.0)
    assert shown[20:30, 60].min() > 0.85


def test_without_joints_or_a_figure_nothing_is_settled(rng: np.random.Generator) -> None:
    color, labels = ragged(rng, 50)
    nothing, everything = np.zeros((50, 50), bool), np.ones((50, 50), bool)
    for joints, inside in ((nothing, everything), (everything, nothing)):
        shown, names = settled(color, labels, joints, inside, None, 50.0)
        assert shown is color
        assert names is labels
