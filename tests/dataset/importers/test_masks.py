"""Masks of other programs, however white is written, become the same alpha."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from toonset.dataset.importers.masks import ALPHA, INVERTED, VALUES, read_mask
from toonset.errors import BundleError

SIZE = (40, 30)
FIGURE = np.zeros(SIZE, bool)
FIGURE[5:35, 8:22] = True
OPAQUE = np.full(SIZE, 255, np.uint8)


def grey(values: np.ndarray) -> Image.Image:
    return Image.fromarray(values.astype(np.uint8))


def grey_16(values: np.ndarray) -> Image.Image:
    return Image.fromarray(values.astype(np.uint16))


def with_alpha(level: int, mode: str) -> Image.Image:
    bands = [grey(np.full(SIZE, level))] * (len(mode) - 1)
    return Image.merge(mode, (*bands, grey(FIGURE * 255)))


def indexed() -> Image.Image:
    image = grey(FIGURE * 1)
    image.putpalette([0, 0, 0, 128, 0, 0])
    return image


MASKS: dict[str, tuple[Callable[[], Image.Image], tuple[str, ...]]] = {
    "0 and 255": (lambda: grey(FIGURE * 255), ()),
    "one bit": (lambda: Image.fromarray(FIGURE), ()),
    "16 bit": (lambda: grey_16(FIGURE * 65535), ()),
    "RGBA, opaque": (lambda: grey(FIGURE * 255).convert("RGBA"), ()),
    "255 in 16 bit": (lambda: grey_16(FIGURE * 255), ()),
    "0 and 1": (lambda: grey(FIGURE * 1), (VALUES,)),
    "0 and 1, RGB": (lambda: grey(FIGURE * 1).convert("RGB"), (VALUES,)),
    "0 and 1 in 16 bit": (lambda: grey_16(FIGURE * 1), (VALUES,)),
    "12 of 16 bit": (lambda: grey_16(FIGURE * 4095), (VALUES,)),
    "a label's colour": (indexed, (VALUES,)),
    "alpha of white": (lambda: with_alpha(255, "LA"), (ALPHA,)),
    "alpha of black": (lambda: with_alpha(0, "RGBA"), (ALPHA,)),
    "inverted": (lambda: grey(~FIGURE * 255), (INVERTED,)),
    "inverted 0 and 1": (lambda: grey(~FIGURE * 1), (VALUES, INVERTED)),
}


@pytest.mark.parametrize("kind", MASKS)
def test_every_way_to_write_white_is_one_alpha(kind: str, tmp_path: Path) -> None:
    make, how = MASKS[kind]
    make().save(tmp_path / "m.png")
    mask = read_mask(tmp_path / "m.png", OPAQUE)
    np.testing.assert_array_equal(mask.alpha, FIGURE * 255)
    assert mask.how == how


def test_soft_edges_stay_soft(tmp_path: Path) -> None:
    soft = np.linspace(0, 255, SIZE[0] * SIZE[1]).reshape(SIZE)
    grey(soft).save(tmp_path / "m.png")
    np.testing.assert_array_equal(read_mask(tmp_path / "m.png", OPAQUE).alpha, soft.astype("u1"))


def test_a_picture_with_alpha_says_whether_its_mask_is_inverted(tmp_path: Path) -> None:
    drawn = (FIGURE * 255).astype(np.uint8)
    for values, how in ((~FIGURE, (INVERTED,)), (np.ones(SIZE, bool), ())):
        grey(values * 255).save(tmp_path / "m.png")
        mask = read_mask(tmp_path / "m.png", drawn)
        assert mask.how == how
        np.testing.assert_array_equal(np.minimum(mask.alpha, drawn), drawn)


def test_a_figure_that_fills_the_picture_is_not_inverted(tmp_path: Path) -> None:
    for figure in (np.ones(SIZE, bool), ~np.pad(np.ones((2, 2), bool), ((10, 28), (10, 18)))):
        grey(figure * 255).save(tmp_path / "m.png")
        np.testing.assert_array_equal(read_mask(tmp_path / "m.png", OPAQUE).alpha, figure * 255)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (np.zeros(SIZE), "its brightest value is 0 of 255, so it shows no figure"),
        (FIGURE * 2 + np.eye(*SIZE), "its brightest value is 3 of 255"),
        (np.ones((20, 15)), "is 15 x 20 px, its picture 30 x 40; give a mask of that size"),
    ],
)
def test_masks_without_a_figure_are_refused(values: np.ndarray, words: str, tmp_path: Path) -> None:
    grey(values).save(tmp_path / "m.png")
    with pytest.raises(BundleError, match=words):
        read_mask(tmp_path / "m.png", OPAQUE)
