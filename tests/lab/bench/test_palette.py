"""The palette bench: its truth, its scores, and that it runs."""

from pathlib import Path

import numpy as np
import pytest

from lab.bench.palette.cases import (
    LEAST_APART,
    PaletteCase,
    characters,
    palette_cases,
    random_paints,
)
from lab.bench.palette.cel import (
    GARMENTS,
    OWN_LABEL,
    TONES,
    CelCase,
    CelOptions,
    cel_case,
    score_cel,
)
from lab.bench.palette.measure import bench_palette, f1, score
from lab.bench.palette.methods import METHODS
from lab.bench.palette.painted import GROUP, PaintedCase, score_painted
from toonset.errors import BundleError
from toonset.palette.colors import oklab_from_rgb
from toonset.palette.pixels.labels import UNLABELLED

COLORS = np.array([(200, 30, 40), (20, 60, 180), (30, 160, 60)], dtype=np.uint8)


def case() -> PaletteCase:
    rgba = np.full((40, 100, 4), 255, dtype=np.uint8)
    rgba[:, :90, :3], rgba[:, 90:98, :3], rgba[:, 98:, :3] = COLORS
    return PaletteCase("three", "by hand", (rgba,), COLORS, np.array([0.9, 0.08, 0.02]))


def test_scores() -> None:
    red, blue, green = ((int(r), int(g), int(b)) for r, g, b in COLORS)
    perfect, with_small = score([red, blue], case()), score([red, blue, green], case())
    assert (perfect.found, perfect.missing, perfect.spurious) == (2, 0, 0)
    assert (with_small.found, with_small.missing, with_small.spurious) == (2, 0, 0)
    twice = score([red, (201, 30, 40), (255, 255, 255)], case())
    assert (twice.found, twice.missing, twice.spurious) == (1, 1, 2)
    assert f1([perfect]) == 1
    assert f1([perfect, twice]) == pytest.approx(6 / 9)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_finds_plain_colours(name: str) -> None:
    found = score(METHODS[name](case().images, 3), case())
    assert (found.found, found.missing) == (2, 0)


def test_random_paints_are_apart_and_repeat() -> None:
    paints = random_paints(np.random.default_rng(4), 8)
    places = oklab_from_rgb(np.array(paints, dtype=np.uint8))
    away = np.linalg.norm(places[:, None] - places, axis=2)[np.triu_indices(8, 1)]
    assert away.min() > LEAST_APART
    assert random_paints(np.random.default_rng(4), 8) == paints


def test_a_folder_without_characters_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="holds no character whose info"):
        next(palette_cases(tmp_path, 0, quick=True))


@pytest.mark.slow
def test_the_bench_runs_and_ours_is_best() -> None:
    records, text = bench_palette(None, 3, quick=True)
    merit = {
        name: np.mean([r.value for r in records if (r.method, r.metric) == (name, "F1 of colours")])
        for name in METHODS
    }
    assert merit["default"] == max(merit.values())
    index = {(r.group, r.method): r.value for r in records if r.metric == "index of labels"}
    for group in (GROUP, CelOptions(3).group):
        assert index[group, "default"] > 0.9 > index[group, "k-means, true k"]
    assert "1200 x 600" in text


def test_labels_of_painted_sheets_are_scored() -> None:
    image = np.full((10, 20, 4), 255, dtype=np.uint8)
    image[:, :10, :3], image[:, 10:, :3] = COLORS[:2]
    truth = np.repeat([[0, 1]], 10, axis=0).repeat(10, axis=1).astype(np.uint8)
    truth[0] = 255
    painted = PaintedCase("two", [image], [truth], np.array([0.5, 0.5]))
    red, blue, _ = ((int(r), int(g), int(b)) for r, g, b in COLORS)
    right = score_painted(painted, [red, blue], [1 - truth])
    assert (right.index, right.balanced, right.found) == (1, 1, 1)
    one = score_painted(painted, [red], [np.zeros_like(truth)])
    assert (one.index, one.balanced, one.found) == (0, 0.5, 0.5)


def _cel(options: CelOptions) -> CelCase:
    return cel_case(next(characters(None, 0, quick=True)), 0, options)


@pytest.mark.parametrize("tones", [1, 3])
def test_every_tone_of_a_cel_sheets_paint_is_flat(tones: int) -> None:
    drawn = _cel(CelOptions(tones))
    truths = zip(drawn.sheet.images, drawn.sheet.truths, drawn.tones, strict=True)
    colors: dict[tuple[int, int], set[tuple[int, ...]]] = {}
    for image, paint, tone in truths:
        assert image.shape[:2] == paint.shape == tone.shape
        assert (paint[tone != UNLABELLED] != UNLABELLED).all()
        told = tone != UNLABELLED
        for number, step, *rgba in np.unique(
            np.column_stack([paint[told], tone[told], image[told]]), axis=0
        ).tolist():
            colors.setdefault((number, step), set()).add(tuple(rgba))
    assert {tone for _, tone in colors} == set(range(tones))
    assert all(len(found) == 1 for found in colors.values())


def test_a_cel_sheets_truth_scores_1_and_its_tones_as_paints_less() -> None:
    drawn = _cel(CelOptions(3, garment=True))
    truths = drawn.sheet.truths
    assert drawn.garment is not None
    assert set(score_cel(drawn, truths, drawn.tones).values()) == {1.0}
    worn = [np.where(one == drawn.garment, 0, one) for one in truths]
    assert score_cel(drawn, worn, None)[GARMENTS] == 0
    assert TONES not in score_cel(drawn, worn, None)
    both = zip(truths, drawn.tones, strict=True)
    apart = [np.where(tone == UNLABELLED, tone, 3 * paint + tone) for paint, tone in both]
    parted = score_cel(drawn, apart, None)
    assert parted["index of labels"] < 0.8
    assert parted[OWN_LABEL] < 1
